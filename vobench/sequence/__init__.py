"""Recordings: pictures, encoders, IMU and ground truth as two MCAP files in ROS 2 form."""

from vobench.sequence.reader import EncodedFrame as EncodedFrame
from vobench.sequence.reader import Sequence as Sequence
from vobench.sequence.reader import StereoFrame as StereoFrame
from vobench.sequence.reader import StereoTruth as StereoTruth
from vobench.sequence.reader import has_case as has_case
from vobench.sequence.reader import has_truth as has_truth
from vobench.sequence.reader import payload_hash as payload_hash
from vobench.sequence.reader import read_case as read_case
from vobench.sequence.reader import read_disturbances as read_disturbances
from vobench.sequence.reader import read_import_notes as read_import_notes
from vobench.sequence.reader import read_imu_bias as read_imu_bias
from vobench.sequence.reader import read_provenance as read_provenance
from vobench.sequence.reader import read_true_rig as read_true_rig
from vobench.sequence.reader import read_truth as read_truth
from vobench.sequence.reader import read_truth_frames as read_truth_frames
from vobench.sequence.reader import read_truth_names as read_truth_names
from vobench.sequence.reader import read_twist as read_twist
from vobench.sequence.reader import truth_channels as truth_channels
from vobench.sequence.writer import SequenceWriter as SequenceWriter
