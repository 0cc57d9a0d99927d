"""vobench: simulate, run and score visual odometry, and explain where it breaks."""

__version__ = "0.1.0"
