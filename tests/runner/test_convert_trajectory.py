"""Trajectory files are merged, shifted, cut and downsampled, in this order."""

import numpy as np
import pytest

from vobench.errors import InputError, TrajectoryError
from vobench.runner.convert_trajectory import TrajectoryEdit, convert_trajectories
from vobench.runner.trajectory_pair import TrajectorySource, read_one
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum


@pytest.fixture
def source(tmp_path):
    """A file of six poses, a second apart from 0 s on."""
    t_ns = np.arange(6) * NS_PER_S
    (tmp_path / "path.tum").write_text(format_tum(Trajectory(t_ns, np.tile(np.eye(4), (6, 1, 1)))))
    return TrajectorySource(tmp_path / "path.tum")


def test_a_part_is_cut_after_the_shift_and_before_poses_are_left_out(source, tmp_path):
    edit = TrajectoryEdit(offset_ns=10 * NS_PER_S, first_ns=11 * NS_PER_S, last_ns=15 * NS_PER_S, count=3)
    converted = convert_trajectories([source], tmp_path / "out.tum", "tum", edit=edit)
    assert converted.pose_count == 3
    found = read_one(TrajectorySource(tmp_path / "out.tum")).trajectory
    assert (found.t_ns // NS_PER_S).tolist() == [11, 13, 15]


def test_an_empty_part_is_an_error_and_writes_nothing(source, tmp_path):
    with pytest.raises(TrajectoryError, match="no pose is left"):
        convert_trajectories([source], tmp_path / "out.tum", "tum", edit=TrajectoryEdit(first_ns=6 * NS_PER_S))
    assert not (tmp_path / "out.tum").exists()


def test_the_stamps_of_a_form_without_stamps_are_a_second_file(source, tmp_path):
    converted = convert_trajectories([source, source], tmp_path / "out.txt", "kitti")
    assert [file.name for file in converted.files] == ["out.txt", "out.times.txt"]
    assert converted.notes == (
        "6 poses left out, whose stamps an earlier file has, too.",
        "Poses in this format have no stamps; the stamps are in out.times.txt.",
    )


KITTI_ROWS = "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n1 0 0 2 0 1 0 0 0 0 1 0\n"


@pytest.fixture
def unstamped(tmp_path):
    """A file of three poses without stamps."""
    (tmp_path / "00.txt").write_text(KITTI_ROWS)
    return TrajectorySource(tmp_path / "00.txt", words=("axes:z,-x,-y",))


@pytest.mark.parametrize("form", ["kitti", "tartanair"])
def test_between_formats_without_stamps_none_are_needed_and_none_are_written(unstamped, tmp_path, form):
    converted = convert_trajectories([unstamped], tmp_path / "out.txt", form, edit=TrajectoryEdit(count=2))
    assert converted.files == (tmp_path / "out.txt",)
    assert converted.notes == ()
    assert converted.pose_count == 2


@pytest.mark.parametrize(
    ("form", "count", "edit"),
    [
        ("tum", 1, TrajectoryEdit()),
        ("kitti", 2, TrajectoryEdit()),
        ("kitti", 1, TrajectoryEdit(offset_ns=1)),
        ("kitti", 1, TrajectoryEdit(last_ns=NS_PER_S)),
    ],
)
def test_stamps_are_needed_by_a_format_by_merging_and_by_edits_in_time(unstamped, tmp_path, form, count, edit):
    with pytest.raises(InputError, match="no stamps in"):
        convert_trajectories([unstamped] * count, tmp_path / "out.txt", form, edit=edit)


def test_numbers_of_frames_are_not_lost(tmp_path):
    rows = [f"{2 * row} {line}" for row, line in enumerate(KITTI_ROWS.splitlines())]
    (tmp_path / "00.txt").write_text("\n".join(rows))
    with pytest.raises(InputError, match="no stamps in"):
        convert_trajectories([TrajectorySource(tmp_path / "00.txt")], tmp_path / "out.txt", "kitti")
