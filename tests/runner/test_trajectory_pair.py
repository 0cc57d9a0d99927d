"""Pairs of trajectory files: on one clock, in one set of axes, or refused with what would make them a pair."""

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.runner.trajectory_pair import BY_FRAME, BY_ROW, NS_PER_S, TrajectorySource, read_one, read_pair
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

N = 6
T_NS = np.arange(N, dtype=np.int64) * NS_PER_S // 10 + 5 * NS_PER_S
T = np.stack([se3.transform(se3.rotation_z(0.1 * n), [n, 0.5 * n, 0.0]) for n in range(N)])


def tum(path, rows=slice(None)):
    path.write_text(format_tum(Trajectory(T_NS[rows], T[rows])))
    return TrajectorySource(path)


def kitti(path, rows=slice(None), *, frames=None):
    lines = [" ".join(map(repr, pose[:3].ravel().tolist())) for pose in T[rows]]
    if frames is not None:
        lines = [f"{frame} {line}" for frame, line in zip(frames, lines, strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return TrajectorySource(path)


def times(path, count=N):
    path.write_text("".join(f"{t / NS_PER_S:.9f}\n" for t in T_NS[:count]))
    return path


def test_files_with_stamps_keep_them(tmp_path):
    pair = read_pair(tum(tmp_path / "a"), tum(tmp_path / "b", slice(1, 4)))
    np.testing.assert_array_equal(pair.gt.trajectory.t_ns, T_NS)
    np.testing.assert_array_equal(pair.est.trajectory.t_ns, T_NS[1:4])
    np.testing.assert_allclose(pair.gt.trajectory.T_world_frame, T, atol=1e-9)
    assert pair.by_frame is None
    assert pair.notes == ()


def test_files_without_stamps_are_paired_by_row_a_second_each(tmp_path):
    pair = read_pair(kitti(tmp_path / "a"), kitti(tmp_path / "b"))
    assert pair.by_frame == BY_ROW
    assert pair.gt.trajectory.t_ns.tolist() == [n * NS_PER_S for n in range(N)]


def test_numbers_of_frames_pair_poses_with_rows(tmp_path):
    pair = read_pair(kitti(tmp_path / "a"), kitti(tmp_path / "b", [1, 4, 5], frames=[1, 4, 5]))
    assert pair.by_frame == BY_FRAME
    assert pair.est.trajectory.t_ns.tolist() == [1 * NS_PER_S, 4 * NS_PER_S, 5 * NS_PER_S]
    (note,) = pair.notes
    assert "3 poses for frames 1 to 5" in note


def test_a_frame_beyond_the_rows_of_the_other_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=f"frames should be below {N}, the number of rows in .*a, but there is {N} in"):
        read_pair(kitti(tmp_path / "a"), kitti(tmp_path / "b", [1, 4], frames=[1, N]))


def test_files_without_stamps_of_other_lengths_are_refused(tmp_path):
    with pytest.raises(InputError, match=f"pair by row, but have {N} in .*a and 3 in .*b rows"):
        read_pair(kitti(tmp_path / "a"), kitti(tmp_path / "b", slice(0, 3)))


def test_one_file_without_stamps_needs_times(tmp_path):
    with pytest.raises(InputError, match=r"no stamps in .*b; name the file that has them with --times"):
        read_pair(tum(tmp_path / "a"), kitti(tmp_path / "b"))
    pair = read_pair(tum(tmp_path / "a"), kitti(tmp_path / "b"), times=[times(tmp_path / "t")])
    np.testing.assert_array_equal(pair.est.trajectory.t_ns, T_NS)
    assert pair.by_frame is None


def test_times_that_nobody_needs_or_that_do_not_fit_are_refused(tmp_path):
    with pytest.raises(InputError, match="--times is for files without stamps, but both files have theirs"):
        read_pair(tum(tmp_path / "a"), tum(tmp_path / "b"), times=[times(tmp_path / "t")])
    with pytest.raises(InputError, match=rf"4 stamps in .*t for {N} poses in .*b"):
        read_pair(tum(tmp_path / "a"), kitti(tmp_path / "b"), times=[times(tmp_path / "t", 4)])
    both = [times(tmp_path / "t", 4), times(tmp_path / "u", 3)]
    with pytest.raises(InputError, match=rf"none of 2 files of times is for {N} poses"):
        read_pair(tum(tmp_path / "a"), kitti(tmp_path / "b"), times=both)


def test_of_several_files_of_times_the_one_that_fits_is_taken(tmp_path):
    pair = read_pair(
        kitti(tmp_path / "a"),
        kitti(tmp_path / "b", slice(0, 4)),
        times=[times(tmp_path / "t"), times(tmp_path / "u", 4)],
    )
    assert (len(pair.gt.trajectory.t_ns), len(pair.est.trajectory.t_ns)) == (N, 4)
    other = tmp_path / "v"
    other.write_text("".join(f"{n}\n" for n in range(N)))
    with pytest.raises(InputError, match=rf"one file of times should fit the {N} poses in .*a, but .*t and .*v do"):
        read_pair(kitti(tmp_path / "a"), kitti(tmp_path / "b"), times=[times(tmp_path / "t"), other])


def test_axes_are_turned_as_the_words_say(tmp_path):
    turned = TrajectorySource(tum(tmp_path / "a").path, words=("axes:z,-x,-y",))
    plain = read_one(tum(tmp_path / "a")).trajectory
    moved = read_one(turned).trajectory
    assert not np.allclose(moved.T_world_frame, plain.T_world_frame)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(moved.positions_m, axis=0), axis=1),
        np.linalg.norm(np.diff(plain.positions_m, axis=0), axis=1),
    )


def test_a_unit_or_order_that_the_file_does_not_have_is_refused(tmp_path):
    source = kitti(tmp_path / "a")
    with pytest.raises(InputError, match="no stamps to read as ns in"):
        read_one(TrajectorySource(source.path, words=("ns",)))
    with pytest.raises(InputError, match="no quaternions to read as wxyz in"):
        read_one(TrajectorySource(source.path, words=("wxyz",)))


def test_a_topic_is_for_a_recording(tmp_path):
    with pytest.raises(InputError, match="a topic is for a recording, but this is a text file"):
        read_one(TrajectorySource(tum(tmp_path / "a").path, topic="/pose"))


@pytest.mark.parametrize(
    ("name", "comment", "is_truth"),
    [("gt.txt", "", True), ("est.txt", "# ground truth\n", True), ("est.txt", "", False), ("length.txt", "", False)],
)
def test_a_file_says_that_it_is_the_truth_by_its_name_or_a_comment(tmp_path, name, comment, is_truth):
    path = tum(tmp_path / name).path
    path.write_text(comment + path.read_text())
    assert read_one(TrajectorySource(path)).mentions_ground_truth is is_truth


@pytest.mark.slow
def test_a_sequence_is_its_true_path_by_its_folder_or_by_its_file_of_truth(first):
    sequence = next((first.path / "cases").glob("*/sequence")).resolve()
    truth = TrajectorySource(
        first.path / "cases" / sorted(p.name for p in (first.path / "cases").iterdir())[0] / "ground_truth.tum"
    )
    expected = read_one(truth).trajectory
    for path in (sequence, sequence / "truth.mcap"):
        np.testing.assert_array_equal(read_one(TrajectorySource(path)).trajectory.t_ns, expected.t_ns)
    with pytest.raises(InputError, match="a recording states its stamps' unit and quaternions' order itself"):
        read_one(TrajectorySource(sequence, words=("ns",)))
