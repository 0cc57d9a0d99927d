"""Recordings: pictures, encoders, IMU and ground truth as two MCAP files in ROS 2 form."""

from vobench.sequence.reader import (
    EncodedFrame,
    Sequence,
    StereoFrame,
    StereoTruth,
    has_truth,
    payload_hash,
    read_case,
    read_disturbances,
    read_import_notes,
    read_imu_bias,
    read_provenance,
    read_true_rig,
    read_truth,
    read_truth_frames,
    read_truth_names,
    read_twist,
    truth_channels,
)
from vobench.sequence.salvage import Salvaged, salvage, salvage_sequence
from vobench.sequence.writer import SequenceWriter

__all__ = [
    "EncodedFrame",
    "Salvaged",
    "Sequence",
    "SequenceWriter",
    "StereoFrame",
    "StereoTruth",
    "has_truth",
    "payload_hash",
    "read_case",
    "read_disturbances",
    "read_import_notes",
    "read_imu_bias",
    "read_provenance",
    "read_true_rig",
    "read_truth",
    "read_truth_frames",
    "read_truth_names",
    "read_twist",
    "salvage",
    "salvage_sequence",
    "truth_channels",
]
