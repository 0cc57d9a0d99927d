"""vobench convert, as it is typed."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.runner.trajectory_pair import TrajectorySource, read_one
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum


@pytest.fixture
def path(here):
    """A trajectory of ten poses, 0.5 s apart, and its file path.tum."""
    rng = np.random.default_rng(3)
    rotations = se3.rotation_z(rng.uniform(-1, 1, 10))
    trajectory = Trajectory(np.arange(10) * 500_000_000, se3.transform(rotations, rng.normal(size=(10, 3))))
    (here / "path.tum").write_text(format_tum(trajectory))
    return trajectory


def read(name, *words, times=()):
    return read_one(TrajectorySource(name, words=words), times=times).trajectory


@pytest.mark.parametrize("form", ["tum", "euroc", "kitti", "tartanair"])
def test_a_trajectory_survives_every_form(vobench, here, path, form):
    written = vobench("convert", "path.tum", "--out", "other.txt", "--form", form, "--json").json
    assert written["poses"] == 10
    assert written["files"] == [str(file.relative_to(here)) for file in sorted(here.glob("other*txt"), reverse=True)]
    times = [here / "other.times.txt"] if len(written["files"]) == 2 else []
    assert bool(times) == (form in ("kitti", "tartanair"))
    found = read(here / "other.txt", times=times)
    np.testing.assert_array_equal(found.t_ns, path.t_ns)
    np.testing.assert_allclose(found.T_world_frame, path.T_world_frame, atol=1e-12)


def test_a_file_that_exists_is_kept(vobench, here, path):
    (here / "mine.txt").write_text("mine")
    refused = vobench("convert", "path.tum", "-o", "mine.txt")
    assert refused.err.endswith("choose another name or remove it: mine.txt\n")
    assert (here / "mine.txt").read_text() == "mine"


def test_a_file_without_stamps_needs_times(vobench, here):
    (here / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 2)
    refused = vobench("convert", "poses.txt", "-o", "out.tum")
    assert "no stamps in poses.txt" in refused.err
    (here / "times.txt").write_text("1.5\n2.5\n")
    assert vobench("convert", "poses.txt", "--times", "times.txt", "-o", "out.tum").code == 0
    assert read(here / "out.tum").t_ns.tolist() == [1_500_000_000, 2_500_000_000]


def test_poses_are_of_another_frame_where_a_mount_says_so(vobench, here, path):
    vobench("convert", "path.tum", "-o", "camera.tum", "--as", "mount:0.1,0,0.2,0,0,0,1")
    T_body_camera = se3.transform(np.eye(3), np.array([0.1, 0, 0.2]))
    expected = path.of_mounted(T_body_camera)
    np.testing.assert_allclose(read(here / "camera.tum").T_world_frame, expected.T_world_frame, atol=1e-12)


def test_parts_are_merged_in_order_of_time_and_a_repeated_stamp_is_kept_once(vobench, here, path):
    lines = (here / "path.tum").read_text().splitlines(keepends=True)
    (here / "late").write_text("".join(lines[4:]))
    (here / "early").write_text("".join(lines[:5]))
    said = vobench("convert", "late", "early", "-o", "whole.tum").out
    assert "- 1 pose left out, whose stamps an earlier file has, too." in said
    whole = read(here / "whole.tum")
    np.testing.assert_array_equal(whole.t_ns, path.t_ns)
    np.testing.assert_allclose(whole.T_world_frame, path.T_world_frame, atol=1e-12)


def test_stamps_are_shifted_before_they_are_cut_and_poses_are_spread_evenly(vobench, here, path):
    vobench("convert", "path.tum", "-o", "part.tum", "--t-offset", "10", "--t-start", "11", "--t-end", "14")
    assert read(here / "part.tum").t_ns.tolist() == [10**9 * 11 + k * 500_000_000 for k in range(7)]
    vobench("convert", "path.tum", "-o", "few.tum", "--downsample", "4")
    np.testing.assert_array_equal(read(here / "few.tum").t_ns, path.t_ns[[0, 3, 6, 9]])
    refused = vobench("convert", "path.tum", "-o", "none.tum", "--t-start", "20")
    assert refused.err == "vobench: no pose is left; the stamps are from 0.000000000 s to 4.500000000 s\n"
