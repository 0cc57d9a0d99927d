"""The layout of KITTI's odometry benchmark."""

from pathlib import Path

import numpy as np
import pytest

from vobench.dataset.layout import read
from vobench.dataset.recording import ReadOptions
from vobench.errors import VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.sequence import Sequence, read_truth

POSES = Path(__file__).parents[3] / "shared" / "data" / "trajectories" / "KITTI_00_gt.txt"
LEVEL = looking(pitch_deg=0.0, position_m=(0.0, 0.0, 0.0))  # ahead, left, up of a camera's right, down, ahead
TIMES = POSES.with_name("KITTI_00_gt_times.txt")


def test_everything_of_a_sequence_arrives(scene, tmp_path, imported):
    folder = imported(scene.kitti(tmp_path / "in"))
    sequence, truth = Sequence.open(folder), read_truth(folder)
    assert sequence.frame_stamps().tolist() == [t - scene.t_ns[0] for t in scene.t_ns] == truth.t_ns.tolist()
    assert np.abs(truth.T_world_frame - LEVEL @ scene.T_world_body @ LEVEL.T).max() < 1e-8  # ten digits are written
    assert sequence.rig.left == sequence.rig.right == Pinhole(48, 32, 40.0, 40.0, 23.5, 15.5)
    assert np.abs(sequence.rig.T_body_left - LEVEL).max() < 1e-15
    assert np.allclose(sequence.rig.T_left_right, se3.transform(np.eye(3), [0.5, 0, 0]), rtol=0, atol=1e-15)
    for frame, left, right in zip(sequence.frames(), scene.left, scene.right, strict=True):
        assert np.array_equal(frame.left, left)
        assert np.array_equal(frame.right, right)


def test_the_colour_pair_sits_beside_the_grey_one_that_the_truth_is_of(scene, tmp_path):
    recording = read(scene.kitti(tmp_path, pair=("image_2", "image_3"), colour=True))
    assert recording.rig.T_body_left[1, 3] == pytest.approx(0.06)
    assert recording.rig.baseline_m == pytest.approx(0.54)
    assert any("converted to grey" in note for note in recording.notes)
    for frame, left in zip(recording.frames(), scene.left, strict=True):
        assert np.array_equal(frame.left, left)  # three equal channels come to themselves


@pytest.mark.parametrize("pair", [("image_0", "image_3"), ("image_2", "image_1"), ("image_0", "image_2")])
def test_of_single_cameras_of_both_pairs_one_is_read_and_the_other_one_is_named(scene, tmp_path, pair):
    recording = read(scene.kitti(tmp_path, pair=pair))
    assert recording.rig.right is None
    assert f"There is one camera: {pair[0]} has no partner." in recording.notes
    assert f"The images of {pair[1]} were not used." in recording.notes


def test_rotations_of_seven_digits_are_made_exact(scene, tmp_path):
    folder = scene.kitti(tmp_path)
    rough = "\n".join(" ".join(f"{v:.6e}" for v in T[:3].ravel()) for T in scene.T_world_body)
    (tmp_path / "poses/00.txt").write_text(rough)
    recording = read(folder)
    assert se3.is_rotation(recording.truth.T_world_frame[:, :3, :3], tolerance=1e-14)
    assert any("were made exact" in note for note in recording.notes)


def test_what_was_not_used_is_named(scene, tmp_path):
    notes = read(scene.kitti(tmp_path)).notes
    assert "P2, P3, Tr of calib.txt were not used." in notes
    assert any(note.startswith("The body is the left grey camera") for note in notes)


@pytest.mark.parametrize("place", ["poses.txt", "00.txt", "../poses/00.txt", "../../poses/00.txt"])
def test_poses_are_found_in_the_folder_and_above_it(scene, tmp_path, place):
    folder = scene.kitti(tmp_path)
    (folder / place).parent.mkdir(exist_ok=True)
    (tmp_path / "poses/00.txt").rename(folder / place)
    assert read(folder).truth.t_ns.tolist() == [t - scene.t_ns[0] for t in scene.t_ns]


def test_poses_may_lie_anywhere(scene, tmp_path):
    folder = scene.kitti(tmp_path)
    (tmp_path / "poses/00.txt").rename(tmp_path / "mine.txt")
    assert read(folder).truth is None
    assert "There is no ground truth." in read(folder).notes
    assert len(read(folder, options=ReadOptions(truth=tmp_path / "mine.txt")).truth) == len(scene.t_ns)


def test_a_pose_for_each_picture_or_none(scene, tmp_path):
    folder = scene.kitti(tmp_path)
    path = tmp_path / "poses/00.txt"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(VobenchError, match=r"4 poses without stamps for 5 images: give .* image's number.*00\.txt"):
        read(folder)


def test_poses_behind_their_picture_s_number_may_be_fewer(scene, tmp_path):
    folder, path = scene.kitti(tmp_path), tmp_path / "poses/00.txt"
    rows, whole = path.read_text().splitlines(), read(folder).truth
    path.write_text("\n".join(f"{k} {rows[k]}" for k in (0, 1, 4)))
    recording = read(folder)
    assert recording.truth.t_ns.tolist() == whole.t_ns[[0, 1, 4]].tolist()
    assert np.array_equal(recording.truth.T_world_frame, whole.T_world_frame[[0, 1, 4]])
    assert "00.txt has poses of 3 of 5 images, by their numbers." in recording.notes


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ((0, 1, 5), r"an image's number, from 0 to 4, but there is 5: .*00\.txt"),
        ((0, 2, 1), r"00\.txt:3: frame numbers must increase, but 1 follows 2"),
        ((0, 1, -2), r"00\.txt:3: .* an integer from 0, but is -2"),
        ((0, 1, 2.5), r"00\.txt:3: .* an integer from 0, but is 2\.5"),
    ],
)
def test_a_number_that_no_picture_has_or_that_does_not_rise_is_refused(scene, tmp_path, numbers, said):
    folder, path = scene.kitti(tmp_path), tmp_path / "poses/00.txt"
    rows = path.read_text().splitlines()
    path.write_text("\n".join(f"{number} {row}" for number, row in zip(numbers, rows, strict=False)))
    with pytest.raises(VobenchError, match=said):
        read(folder)


def test_of_poses_with_one_number_the_first_is_kept_and_it_is_said(scene, tmp_path):
    folder, path = scene.kitti(tmp_path), tmp_path / "poses/00.txt"
    rows, whole = path.read_text().splitlines(), read(folder).truth
    path.write_text("\n".join(f"{k} {row}" for k, row in zip((0, 0, 1), rows, strict=False)))
    recording = read(folder)
    assert np.array_equal(recording.truth.T_world_frame, whole.T_world_frame[[0, 2]])
    assert any("left out: 1 of 3" in note for note in recording.notes)


@pytest.mark.skipif(not POSES.is_file(), reason="no folder ../shared/data with real trajectories")
def test_the_real_poses_and_times_of_kitti_00_go_through(scene, tmp_path, imported):
    poses, times = POSES.read_text().splitlines(), TIMES.read_text().splitlines()
    folder = scene.kitti(tmp_path / "in")
    count = len(scene.t_ns)
    (folder / "times.txt").write_text("\n".join(times[:count]))
    (tmp_path / "in/poses/00.txt").write_text("\n".join(poses[:count]))
    truth = read_truth(imported(folder)).of_mounted(LEVEL)
    given = np.array([line.split() for line in poses[:count]], float).reshape(-1, 3, 4)
    assert np.abs((LEVEL.T @ truth.T_world_frame)[:, :3] - given).max() < 1e-6
    assert truth.t_ns[1] == 103_735_900  # 1.037359e-01 in the file
