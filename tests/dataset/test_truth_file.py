from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.dataset.recording import ReadOptions
from vobench.dataset.truth_file import read_truth_file, truth_file
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.trajectory.kitti import format_kitti
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

FRAMES_NS = np.array([1_000_000_000, 2_000_000_000, 3_000_000_000])
POSES = se3.transform(
    Rotation.from_rotvec([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, -0.8, 0.9]]).as_matrix(), np.arange(9.0).reshape(3, 3)
)
FLIP = se3.transform(np.diag([1.0, -1.0, -1.0]), np.zeros(3))


def test_stamped_poses_come_back_and_unstamped_ones_get_those_of_the_pictures(tmp_path: Path) -> None:
    path = tmp_path / "truth.txt"
    path.write_text(format_tum(Trajectory(FRAMES_NS + 7, POSES)))
    truth, notes = read_truth_file(path, FRAMES_NS)
    np.testing.assert_array_equal(truth.t_ns, FRAMES_NS + 7)
    np.testing.assert_allclose(truth.T_world_frame, POSES, atol=1e-12)
    path.write_text(format_kitti(POSES))
    truth, notes = read_truth_file(path, FRAMES_NS)
    np.testing.assert_array_equal(truth.t_ns, FRAMES_NS)
    np.testing.assert_allclose(truth.T_world_frame, POSES, atol=1e-12)
    assert notes == ()


def test_numbered_poses_are_those_of_the_pictures_of_their_numbers(tmp_path: Path) -> None:
    path = tmp_path / "truth.txt"
    lines = format_kitti(POSES).splitlines()
    path.write_text(f"0 {lines[0]}\n2 {lines[2]}\n")
    truth, notes = read_truth_file(path, FRAMES_NS)
    np.testing.assert_array_equal(truth.t_ns, FRAMES_NS[[0, 2]])
    assert notes == ("truth.txt has poses of 2 of 3 images, by their numbers.",)
    path.write_text(f"0 {lines[0]}\n3 {lines[2]}\n")
    with pytest.raises(InputError, match=r"an image's number, from 0 to 2, but there is 3: .*truth\.txt$"):
        read_truth_file(path, FRAMES_NS)
    path.write_text(format_kitti(POSES[:2]))
    with pytest.raises(InputError, match=r"^2 poses without stamps for 3 images: give one pose per image"):
        read_truth_file(path, FRAMES_NS)


def test_rotations_of_few_digits_are_made_exact_and_said(tmp_path: Path) -> None:
    path = tmp_path / "truth.txt"
    path.write_text(format_kitti(np.round(POSES, 5)))
    truth, (note,) = read_truth_file(path, FRAMES_NS)
    R = truth.T_world_frame[:, :3, :3]
    np.testing.assert_allclose(np.swapaxes(R, 1, 2) @ R, np.tile(np.eye(3), (3, 1, 1)), atol=1e-14)
    np.testing.assert_allclose(R, POSES[:, :3, :3], atol=1e-5)
    assert note.startswith("Rotations of truth.txt were made exact; they were up to ")


def test_the_file_of_the_options_comes_before_the_first_one_beside_the_pictures(tmp_path: Path) -> None:
    named, first, second = (tmp_path / name for name in ("named.txt", "first.txt", "second.txt"))
    for path, count in ((named, 1), (second, 3)):
        path.write_text(format_tum(Trajectory(FRAMES_NS[:count], POSES[:count])))
    truth, notes = truth_file(ReadOptions(), [first, second], FRAMES_NS, "of the camera.")
    assert truth is not None
    assert len(truth) == 3
    assert notes[0] == "The truth is second.txt, of the camera."
    truth, notes = truth_file(ReadOptions(truth=named), [second], FRAMES_NS, "of the camera.")
    assert truth is not None
    assert len(truth) == 1
    assert truth_file(ReadOptions(), [first], FRAMES_NS, "of the camera.") == (None, ())


def test_a_turn_changes_the_axes_of_world_and_body(tmp_path: Path) -> None:
    path = tmp_path / "truth.txt"
    path.write_text(format_tum(Trajectory(FRAMES_NS, POSES)))
    truth, _ = truth_file(ReadOptions(), [path], FRAMES_NS, "", FLIP)
    assert truth is not None
    np.testing.assert_allclose(truth.positions_m, POSES[:, :3, 3] * [1, -1, -1], atol=1e-12)
    point = np.array([[0.5, -0.3, 2.0]])
    for T, original in zip(truth.T_world_frame, POSES, strict=True):
        there = se3.apply(FLIP, se3.apply(original, se3.apply(FLIP, point)))
        np.testing.assert_allclose(se3.apply(T, point), there, atol=1e-12)
