"""Recordings: stereo pictures, encoders and ground truth as two MCAP files in ROS 2 form."""

from vobench.sequence.reader import (
    EncodedFrame,
    Sequence,
    StereoFrame,
    payload_hash,
    read_case,
    read_true_rig,
    read_truth,
)
from vobench.sequence.truth_reader import StereoTruth, read_truth_frames, read_truth_names, truth_channels
from vobench.sequence.writer import SequenceWriter

__all__ = [
    "EncodedFrame",
    "Sequence",
    "SequenceWriter",
    "StereoFrame",
    "StereoTruth",
    "payload_hash",
    "read_case",
    "read_true_rig",
    "read_truth",
    "read_truth_frames",
    "read_truth_names",
    "truth_channels",
]
