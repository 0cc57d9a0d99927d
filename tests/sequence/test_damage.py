"""What is torn, damaged, foreign or missing is refused in one line that says what it is."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vobench.errors import SequenceError
from vobench.sequence import Sequence, SequenceWriter, has_truth, read_case, read_truth
from vobench.sequence.bag import Bag
from vobench.sequence.bag_writer import BagWriter
from vobench.sequence.calibration import write_mounts
from vobench.sequence.camera_info import camera_info_messages
from vobench.sequence.cdr import serialise
from vobench.sequence.mcap_file import HEAD, MESSAGE_INDEX_ENTRY, MESSAGE_INDEX_HEAD
from vobench.sequence.message import image_message
from vobench.sequence.picture import encode
from vobench.sequence.topic import INFO_TOPICS, LEFT_IMAGE, RIGHT_IMAGE, sensor_topics


def read_all(folder: Path) -> None:
    sequence = Sequence.open(folder)
    list(sequence.frames())
    sequence.encoders()
    read_truth(folder)
    read_case(folder)


@pytest.mark.parametrize("name", ["sensors.mcap", "truth.mcap"])
@pytest.mark.parametrize("kept", [0, 5, 8, 60, 0.5, 0.97, 0.999])
def test_torn_file_is_refused_in_one_line(folder, tmp_path, name, kept):
    torn = Path(shutil.copytree(folder, tmp_path / "torn"))
    whole = (torn / name).read_bytes()
    (torn / name).write_bytes(whole[: kept if isinstance(kept, int) else int(kept * len(whole))])
    with pytest.raises(SequenceError, match=name) as caught:
        read_all(torn)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("at", [0.1, 0.3, 0.6, 0.8])
def test_flipped_bit_in_the_pictures_is_refused(folder, tmp_path, at):
    bad = Path(shutil.copytree(folder, tmp_path / "bad"))
    data = bytearray((bad / "sensors.mcap").read_bytes())
    data[int(at * len(data))] ^= 0x10
    (bad / "sensors.mcap").write_bytes(data)
    with pytest.raises(SequenceError, match=r"sensors\.mcap"):
        read_all(bad)


def test_missing_recording_is_named(tmp_path):
    with pytest.raises(SequenceError, match=r"^no recording at .*nowhere/sensors\.mcap$"):
        Sequence.open(tmp_path / "nowhere")


def test_foreign_recording_says_which_topic_it_lacks(folder, tmp_path):
    shutil.copy(folder / "truth.mcap", tmp_path / "sensors.mcap")
    with pytest.raises(
        SequenceError, match=r"^/cam_left/camera_info should be sensor_msgs/msg/CameraInfo but is missing"
    ):
        Sequence.open(tmp_path)


def test_a_git_lfs_pointer_and_a_text_are_named_as_what_they_are(folder, tmp_path):
    path = tmp_path / "sensors.mcap"
    for start, said in (
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:00", r"^this is a Git-LFS pointer .*`git lfs pull`"),
        (b"hello", r"^not an MCAP recording by its first bytes: .*sensors\.mcap$"),
        (
            (folder / "sensors.mcap").read_bytes()[:-1],
            r"^the recording was cut off, .*`mcap recover`",
        ),
    ):
        path.write_bytes(start)
        with pytest.raises(SequenceError, match=said):
            Sequence.open(tmp_path)


def test_a_flipped_bit_in_the_index_of_stamps_is_refused(folder, tmp_path):
    """A stamp that its chunk has not, and one that only the calibration's own index denies."""
    bad = Path(shutil.copytree(folder, tmp_path / "bad"))
    bag, whole = Bag.open(folder / "sensors.mcap"), (folder / "sensors.mcap").read_bytes()
    channel = next(c.id for c in bag.summary.channels.values() if c.topic == LEFT_IMAGE.name)
    at = bag.summary.chunk_indexes[-1].message_index_offsets[channel] + MESSAGE_INDEX_HEAD
    for byte, said in (
        (7, "has stamps that its chunk does not have"),
        (0, "images and calibration should have the same"),
    ):
        data = bytearray(whole)
        data[at + MESSAGE_INDEX_ENTRY + byte] ^= 1
        (bad / "sensors.mcap").write_bytes(data)
        with pytest.raises(SequenceError, match=said):
            Sequence.open(bad).frame_stamps()


def test_a_truth_that_was_never_finished_is_not_taken_for_none(folder, tmp_path):
    shutil.copy(folder / "truth.mcap", tmp_path / "truth.mcap.part")
    with pytest.raises(SequenceError, match="was never finished, its writer was stopped"):
        has_truth(tmp_path)


@pytest.mark.parametrize(
    ("right_ns", "said"),
    [
        ([], r"as many left as right images and at least one, got 2 and 0: "),
        ([5], r"as many left as right images and at least one, got 2 and 1: "),
        ([5, 7], r"^frame 1 is not a left and a right image of one stamp in "),
    ],
)
def test_pictures_that_are_no_pairs_are_refused(recording, tmp_path, right_ns, said):
    rig = recording.rig
    shots = [(5, LEFT_IMAGE), (6, LEFT_IMAGE), *((t_ns, RIGHT_IMAGE) for t_ns in right_ns)]
    with BagWriter(tmp_path / "sensors.mcap", sensor_topics(rig), encoded=True) as bag:
        write_mounts(bag, rig, 0)
        for topic, info in zip(INFO_TOPICS, camera_info_messages(0, rig), strict=True):
            bag.write(topic, 0, serialise(info))
        for t_ns, topic in sorted(shots, key=lambda shot: shot[0]):
            bag.write(
                topic,
                t_ns,
                serialise(image_message(t_ns, "cam", encode(recording.left[0], rig.left, "a"), codec="png")),
            )
    with pytest.raises(SequenceError, match=said):
        list(Sequence.open(tmp_path).frames())


def test_a_chunk_with_fewer_frames_than_the_summary_says_is_refused(recording, tmp_path):
    """A message of another kind in the place of the last picture, and no checksum that would tell."""
    rig = replace(recording.rig, right=None, T_body_right=None, wheels=None)
    with SequenceWriter(tmp_path, rig, case_json=b"") as writer:
        for t_ns in (1, 2):
            writer.write_frame(t_ns, recording.left[0], None)
    path = tmp_path / "sensors.mcap"
    bag, data = Bag.open(path), bytearray(path.read_bytes())
    channel = next(c.id for c in bag.summary.channels.values() if c.topic == LEFT_IMAGE.name)
    chunk = bag.summary.chunk_indexes[-1].chunk_start_offset + HEAD.size
    entry = bag.summary.chunk_indexes[-1].message_index_offsets[channel] + MESSAGE_INDEX_HEAD + MESSAGE_INDEX_ENTRY
    message = int(np.frombuffer(data, "<u8", 2, entry)[1])
    data[chunk + 24 : chunk + 28] = bytes(4)
    data[chunk + 40 + message] = 99  # behind times, size, checksum, no name and the length
    path.write_bytes(data)
    with pytest.raises(SequenceError, match=r"^1 frames found, but its summary says 2: "):
        list(Sequence.open(tmp_path).frames())
    with pytest.raises(SequenceError, match="a chunk has 1 messages of /cam_left/image/compressed where the index has"):
        Sequence.open(tmp_path).frame(1)
