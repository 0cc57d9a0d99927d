"""TartanAir's layouts."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from vobench.dataset.layout import read
from vobench.dataset.recording import ReadOptions
from vobench.errors import VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.sequence import Sequence, read_truth

NED = Path(__file__).parents[3] / "shared" / "data" / "trajectories" / "tartanair" / "pose_gt.txt"
UP = np.diag([1.0, -1.0, -1.0])


def test_everything_of_a_trajectory_arrives_with_z_up(scene, tmp_path, imported):
    folder = imported(scene.tartanair(tmp_path / "P000"))
    sequence, truth = Sequence.open(folder), read_truth(folder)
    assert sequence.frame_stamps().tolist() == [index * 40_000_000 for index in range(5)] == truth.t_ns.tolist()
    assert sequence.rig.left == sequence.rig.right == Pinhole(640, 480, 320.0, 320.0, 320.0, 240.0)
    assert np.allclose(sequence.rig.T_left_right, se3.transform(np.eye(3), [0.25, 0, 0]), rtol=0, atol=1e-15)
    assert np.allclose(truth.positions_m, scene.T_world_body[:, :3, 3] @ UP, rtol=0, atol=1e-12)
    assert np.allclose(truth.T_world_frame[:, :3, :3], UP @ scene.T_world_body[:, :3, :3] @ UP, rtol=0, atol=1e-12)


def test_the_camera_looks_where_ned_s_x_points(scene, tmp_path):
    """TartanAir's camera has x ahead, y right, z down: its z axis is NED's x, its x axis NED's y."""
    recording = read(scene.tartanair(tmp_path))
    T_world_left = recording.truth.T_world_frame @ recording.rig.T_body_left
    ahead, right = T_world_left[:, :3, 2] @ UP, T_world_left[:, :3, 0] @ UP
    assert np.allclose(ahead, scene.T_world_body[:, :3, 0], rtol=0, atol=1e-12)
    assert np.allclose(right, scene.T_world_body[:, :3, 1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("cameras", [1, 2])
def test_the_body_is_at_the_left_camera_and_looks_ahead(scene, tmp_path, camchain, cameras):
    folder = scene.tartanair(tmp_path)
    if cameras == 1:
        shutil.rmtree(folder / "image_right")
    rig = read(folder).rig
    assert len(rig.sides) == cameras
    ahead, right, down = np.eye(3)[0], -np.eye(3)[1], -np.eye(3)[2]
    assert np.allclose(rig.T_body_left, se3.transform(np.stack([right, down, ahead], -1), np.zeros(3)), atol=1e-15)


def test_another_rate_may_be_given(scene, tmp_path):
    recording = read(scene.tartanair(tmp_path), options=ReadOptions(rate_hz=30.0))
    assert [frame.t_ns for frame in recording.frames()] == [0, 33_333_333, 66_666_667, 100_000_000, 133_333_333]
    assert any("30 Hz" in note for note in recording.notes)


def test_the_second_layout_is_known_by_its_own_names(scene, tmp_path):
    folder = scene.tartanair(tmp_path)
    (folder / "image_left").rename(folder / "image_lcam_front")
    (folder / "image_right").rename(folder / "image_rcam_front")
    (folder / "pose_left.txt").rename(folder / "pose_lcam_front.txt")
    assert len(read(folder).truth) == 5


def test_pictures_of_another_size_need_a_calibration(scene, tmp_path):
    folder = scene.kitti(tmp_path)
    (folder / "image_0").rename(folder / "image_left")
    (folder / "image_1").rename(folder / "image_right")
    with pytest.raises(VobenchError, match="these have 48 x 32: name their camchain"):
        read(folder, form="tartanair")


@pytest.mark.skipif(not NED.is_file(), reason="no folder ../shared/data with real trajectories")
def test_real_poses_go_through_and_fly_upwards(scene, tmp_path, imported):
    folder = scene.tartanair(tmp_path / "in")
    rows = NED.read_text().splitlines()[:5]
    (folder / "pose_left.txt").write_text("\n".join(rows))
    given = np.array([row.split() for row in rows], float)
    assert np.allclose(read_truth(imported(folder)).positions_m, given[:, :3] @ UP, rtol=0, atol=1e-12)
