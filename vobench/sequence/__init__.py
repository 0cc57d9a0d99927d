"""Recordings: stereo pictures, encoders and ground truth as two MCAP files in ROS 2 form."""

from vobench.sequence.reader import PngFrame, Sequence, StereoFrame, payload_hash, read_case, read_truth
from vobench.sequence.writer import SequenceWriter

__all__ = [
    "PngFrame",
    "Sequence",
    "SequenceWriter",
    "StereoFrame",
    "payload_hash",
    "read_case",
    "read_truth",
]
