"""What an estimator is, and the process it runs in."""

from vobench.estimator.protocol import EncoderReadings, Estimator, Frame, Result, Status, Tracks
from vobench.sensor.imu import ImuReadings

__all__ = ["EncoderReadings", "Estimator", "Frame", "ImuReadings", "Result", "Status", "Tracks"]
