"""What an estimator is, and the process it runs in."""

from vobench.estimator.protocol import EncoderReadings, Estimator, Frame, Result, Status, Tracks

__all__ = ["EncoderReadings", "Estimator", "Frame", "Result", "Status", "Tracks"]
