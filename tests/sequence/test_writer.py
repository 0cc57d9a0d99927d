"""Writing is deterministic, ordered, whole or absent, and needs no more memory for a longer path."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from vobench.errors import SequenceError
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import stereo_rig
from vobench.sequence import Sequence, SequenceWriter

FILES = ("sensors.mcap", "truth.mcap")


def test_writing_twice_gives_the_same_bytes(recording, folder, tmp_path):
    again = recording.write(tmp_path)
    assert sorted(p.name for p in again.iterdir()) == list(FILES)
    for name in FILES:
        assert (again / name).read_bytes() == (folder / name).read_bytes()


def test_sequence_that_fails_half_way_leaves_no_file(recording, tmp_path):
    def fail():
        with SequenceWriter(tmp_path, recording.rig, case_json=b"") as sequence:
            sequence.write_frame(0, recording.left[0], recording.right[0])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", FILES)
def test_sensors_never_get_their_name_before_the_truth_is_whole(recording, tmp_path, monkeypatch, name):
    replace = Path.replace

    def full(path, target):
        if target.name == name:
            raise OSError("disk full")
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="disk full"):
        recording.write(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == (["truth.mcap"] if name == "sensors.mcap" else [])


@pytest.mark.parametrize("second_ns", [100, 99])
def test_frame_that_is_not_later_is_refused(recording, tmp_path, second_ns):
    with SequenceWriter(tmp_path, recording.rig, case_json=b"") as sequence:
        sequence.write_frame(100, recording.left[0], recording.right[0])
        with pytest.raises(SequenceError, match=rf"stamp {second_ns} ns does not come after 100 ns"):
            sequence.write_frame(second_ns, recording.left[1], recording.right[1])


def test_encoder_reading_from_before_the_last_frame_is_refused(recording, tmp_path):
    with SequenceWriter(tmp_path, recording.rig, case_json=b"") as sequence:
        sequence.write_frame(100, recording.left[0], recording.right[0])
        with pytest.raises(SequenceError, match=r"^/encoders: the stamp 99 ns does not come after 100 ns"):
            sequence.write_encoders([99], [[1, 2]])


def test_truth_may_run_ahead_of_the_frames(recording, tmp_path):
    with SequenceWriter(tmp_path, recording.rig, case_json=b"") as sequence:
        sequence.write_truth(0, np.eye(4), np.zeros(6))
        sequence.write_truth(1_000, np.eye(4), np.zeros(6))
        sequence.write_frame(500, recording.left[0], recording.right[0])
    assert len(Sequence.open(tmp_path)) == 1


@pytest.mark.parametrize(
    ("picture", "seen"),
    [(np.zeros((32, 47), np.uint8), r"\(32, 47\) uint8"), (np.zeros((32, 48), np.float32), r"\(32, 48\) float32")],
)
def test_picture_of_another_form_is_refused(recording, tmp_path, picture, seen):
    with (
        pytest.raises(SequenceError, match=rf"^cam_right takes \(32, 48\) uint8 images, got {seen}$"),
        SequenceWriter(tmp_path, recording.rig, case_json=b"") as sequence,
    ):
        sequence.write_frame(0, recording.left[0], picture)


@pytest.mark.parametrize("pose", [2 * np.eye(4), np.full((4, 4), np.nan)])
def test_pose_that_is_no_rigid_transform_is_refused(recording, tmp_path, pose):
    with (
        pytest.raises(SequenceError, match=r"the true pose at 5 ns is no rigid transform"),
        SequenceWriter(tmp_path, recording.rig, case_json=b"") as sequence,
    ):
        sequence.write_truth(5, pose, np.zeros(6))


def peak_bytes(work):
    """Highest memory in use while `work` runs, above what was in use before."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_stays_flat_while_writing_and_reading(tmp_path):
    """12 MB of pictures pass through the few copies of one 1 MiB chunk that MCAP works on."""
    rig = stereo_rig(Pinhole(160, 120, 100.0, 100.0, 79.5, 59.5), pitch_deg=0)
    rng = np.random.default_rng(0)

    def write():
        with SequenceWriter(tmp_path, rig, case_json=b"") as sequence:
            for i in range(300):
                sequence.write_frame(i * 1000, *rng.integers(0, 256, (2, 120, 160), np.uint8))
                sequence.write_truth(i * 1000, np.eye(4), np.zeros(6))

    def read():
        assert sum(1 for _ in Sequence.open(tmp_path).frames()) == 300

    assert peak_bytes(write) < 5_000_000
    assert peak_bytes(read) < 5_000_000
    assert (tmp_path / "sensors.mcap").stat().st_size > 11_000_000
