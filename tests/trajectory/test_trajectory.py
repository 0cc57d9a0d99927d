"""Moves: said in a word, read back from it, and rigid."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import InputError, TrajectoryError
from vobench.geometry import se3
from vobench.trajectory import trajectory as trajectory_module
from vobench.trajectory.associate import associate, match
from vobench.trajectory.trajectory import PoseConvention, Trajectory, mean_rate_hz, parse_pose_convention, poses_at

AXES = [
    ",".join(sign + axis for sign, axis in zip(signs, order, strict=True))
    for order in itertools.permutations("xyz")
    for signs in itertools.product(("", "-"), repeat=3)
]


def poses(n=20):
    rng = np.random.default_rng(4)
    q = rng.normal(size=(n, 4))
    return se3.transform(se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True)), rng.normal(size=(n, 3)))


@pytest.mark.parametrize("axes", AXES)
def test_all_48_axes_read_back_and_keep_poses_rigid(axes):
    T = poses()
    for kind in ("axes", "positions"):
        move = parse_pose_convention(f"{kind}:{axes}")
        assert str(move) == f"{kind}:{axes}"
        moved = move.apply(T)
        assert se3.is_rotation(moved[:, :3, :3])
        np.testing.assert_array_equal(PoseConvention(move.kind, move.matrix.T).apply(moved), T)


def test_axes_say_where_the_new_ones_are_found_in_the_file():
    T = se3.transform(np.eye(3), [1.0, 2.0, 3.0])
    assert parse_pose_convention("positions:z,-x,-y").apply(T)[:3, 3].tolist() == [3, -1, -2]


def test_turned_axes_turn_motions_with_them():
    T, move = poses(), parse_pose_convention("axes:z,-x,-y")
    motion = se3.inverse(T[:-1]) @ T[1:]
    moved = move.apply(T)
    np.testing.assert_allclose(se3.inverse(moved[:-1]) @ moved[1:], move.apply(motion), atol=1e-14)


def test_a_mount_is_a_constant_motion_in_the_bodys_own_frame():
    T, move = poses(), parse_pose_convention("mount:0.1,0.2,0.3,0,0,0.6,0.8")
    np.testing.assert_allclose(se3.inverse(T) @ move.apply(T), np.broadcast_to(move.matrix, T.shape), atol=1e-14)
    assert str(move) == "mount:0.1,0.2,0.3,0,0,0.6,0.8"


@pytest.mark.parametrize("word", ["inverse", "rotations:inverse"])
def test_an_inverse_reads_back_and_undoes_itself(word):
    T, move = poses(), parse_pose_convention(word)
    assert str(move) == word
    np.testing.assert_allclose(move.apply(move.apply(T)), T, atol=1e-14)
    undone = T @ move.apply(T) if word == "inverse" else T[:, :3, :3] @ move.apply(T)[:, :3, :3]
    np.testing.assert_allclose(undone, np.broadcast_to(np.eye(undone.shape[-1]), undone.shape), atol=1e-14)
    if word == "rotations:inverse":
        np.testing.assert_array_equal(move.apply(T)[:, :3, 3], T[:, :3, 3])


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("axes:x,y", "axes are x, y and z, each once"),
        ("axes:x,x,z", "axes are x, y and z, each once"),
        ("positions:x,y,w", "axes are x, y and z, each once"),
        ("mount:1,2,3", "a mount is x,y,z,qx,qy,qz,qw in metres with a quaternion of norm 1"),
        ("mount:1,2,3,0,0,0,2", "a mount is x,y,z,qx,qy,qz,qw in metres with a quaternion of norm 1"),
        ("mount:a,2,3,0,0,0,1", "a mount is x,y,z,qx,qy,qz,qw in metres with a quaternion of norm 1"),
        (
            "sideways",
            "a file may be read as axes:…, positions:…, mount:…, inverse or rotations:inverse, but not as 'sideways'",
        ),
    ],
)
def test_a_word_that_means_nothing_is_named(word, sentence):
    with pytest.raises(InputError, match=sentence):
        parse_pose_convention(word)


SEEDS = st.integers(0, 2**32 - 1)


def random_path(rng, n=10):
    q = rng.normal(size=(n, 4))
    R = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    return Trajectory(np.cumsum(rng.integers(1, 10**9, n)), se3.transform(R, rng.normal(size=(n, 3))))


def screw(t_ns):
    """A motion of constant speed and constant turn."""
    t_s = np.asarray(t_ns) / 1e9
    return Trajectory(t_ns, se3.transform(se3.rotation_z(0.7 * t_s), t_s[:, None] * [1.0, -2.0, 0.5]))


@given(SEEDS)
def test_at_a_stamp_is_its_pose(seed):
    path = random_path(np.random.default_rng(seed))
    np.testing.assert_allclose(poses_at(path, path.t_ns), path.T_world_frame, atol=1e-12)


@given(SEEDS)
def test_a_constant_motion_is_met_exactly(seed):
    rng = np.random.default_rng(seed)
    t_ns = np.sort(rng.choice(10**10, 50, replace=False))
    sparse = screw(np.arange(11, dtype=np.int64) * 10**9)
    np.testing.assert_allclose(poses_at(sparse, t_ns), screw(t_ns).T_world_frame, atol=1e-12)


@given(SEEDS, st.floats(0, 1))
def test_between_two_poses_the_angle_is_shared_out(seed, share):
    path = random_path(np.random.default_rng(seed), 2)
    t_ns = np.array([path.t_ns[0] + round(share * (path.t_ns[1] - path.t_ns[0]))])
    share = (t_ns[0] - path.t_ns[0]) / (path.t_ns[1] - path.t_ns[0])
    R0, R1 = path.T_world_frame[:, :3, :3]
    R = poses_at(path, t_ns)[0, :3, :3]
    assert se3.rotation_angle(R0.T @ R) == pytest.approx(share * se3.rotation_angle(R0.T @ R1), abs=1e-7)
    assert se3.rotation_angle(R.T @ R1) == pytest.approx((1 - share) * se3.rotation_angle(R0.T @ R1), abs=1e-7)


def test_before_the_first_and_after_the_last_stand_the_ends():
    path = random_path(np.random.default_rng(1))
    ends = poses_at(path, np.array([path.t_ns[0] - 10**9, path.t_ns[-1] + 10**9]))
    np.testing.assert_allclose(ends, path.T_world_frame[[0, -1]], atol=1e-12)
    one = Trajectory(path.t_ns[:1], path.T_world_frame[:1])
    np.testing.assert_allclose(poses_at(one, path.t_ns[:3]), np.repeat(one.T_world_frame, 3, 0), atol=1e-12)


@pytest.mark.parametrize("offset_ns", [0, 3_000_000])
@pytest.mark.parametrize("truth_is_denser", [True, False])
def test_interpolated_matches_of_one_motion_are_the_same_pose(truth_is_denser, offset_ns):
    dense, sparse = screw(np.arange(1001) * 10_000_000), screw(np.arange(301) * 33_333_333)
    gt, est = (dense, sparse) if truth_is_denser else (sparse, dense)
    late = Trajectory(est.t_ns - offset_ns, est.T_world_frame)
    found = match(gt, late, method="interpolate", offset_ns=offset_ns)
    np.testing.assert_allclose(found.T_est, found.T_gt, atol=1e-12)
    nearest = match(gt, late, method="nearest", offset_ns=offset_ns)
    assert len(found) == len(nearest)
    assert np.abs(nearest.T_est - nearest.T_gt).max() > 1e-3
    assert found.pairs.gt.tolist() == associate(gt.t_ns, est.t_ns, method="evo").gt.tolist()


def test_a_match_is_on_the_truths_clock():
    gt, est = screw(np.arange(100) * 10**7), screw(np.arange(30) * 33_000_000 + 10**9)
    nearest = match(gt, est, offset_ns=-(10**9))
    np.testing.assert_array_equal(nearest.t_ns, gt.t_ns[nearest.pairs.gt])
    between = match(gt, est, method="interpolate", offset_ns=-(10**9))
    np.testing.assert_array_equal(between.t_ns, est.t_ns[between.pairs.est] - 10**9)


T_NS = np.arange(5, dtype=np.int64)


def poses_trajectory(n=5):
    return se3.transform(se3.rotation_z(np.arange(n)), np.arange(3.0 * n).reshape(n, 3))


def spoilt(value, at):
    T = poses_trajectory()
    T[at] = value
    return T


@pytest.mark.parametrize(
    ("T", "message"),
    [
        (spoilt(np.nan, (3, 0, 3)), "pose 3 is not finite"),
        (spoilt(np.nan, (2, 1, 1)), "pose 2 is not finite"),
        (spoilt(np.inf, (3, 2, 3)), "pose 3 is not finite"),
        (spoilt(-np.inf, (0, 2, 3)), "pose 0 is not finite"),
        (spoilt(1e200, (4, 1, 3)), r"pose 4 is 1e\+200 m away"),
        (spoilt(np.diag([1.0, 1.0, -1.0]), (1, slice(3), slice(3))), "pose 1 is mirrored"),
        (spoilt(np.zeros((3, 3)), (1, slice(3), slice(3))), "pose 1 is off by 1 "),
        (spoilt(2 * np.eye(3), (1, slice(3), slice(3))), "pose 1 is off by 3 "),
    ],
)
@pytest.mark.parametrize("block", [2, 1 << 14])
def test_what_is_no_pose_is_named_with_its_number(monkeypatch, T, message, block):
    monkeypatch.setattr(trajectory_module, "BLOCK", block)
    with pytest.raises(TrajectoryError, match=message):
        Trajectory(T_NS, T)


@pytest.mark.parametrize("t_ns", [[0, 1, 1, 2, 3], [0, 1, 5, 4, 6]])
def test_stamps_that_stand_or_go_back_are_refused(t_ns):
    with pytest.raises(TrajectoryError, match=r"stamps must increase, but pose [23] is not later"):
        Trajectory(np.array(t_ns, np.int64), poses_trajectory())


def test_shapes_and_types_that_do_not_fit_are_refused():
    for t_ns, T in [
        (T_NS[:4], poses_trajectory()),
        (T_NS.astype(float), poses_trajectory()),
        (T_NS, poses_trajectory()[:, :3]),
    ]:
        with pytest.raises(TrajectoryError, match="needs"):
            Trajectory(t_ns, T)


def test_rotations_with_few_digits_and_no_poses_at_all_pass():
    T = poses_trajectory()
    T[:, :3, :3] = np.round(T[:, :3, :3], 3)
    assert len(Trajectory(T_NS, T)) == 5
    assert len(Trajectory(T_NS[:0], poses_trajectory(0))) == 0


def test_the_way_grows_by_each_step():
    path = Trajectory(T_NS, poses_trajectory())
    np.testing.assert_allclose(path.distances_m(), np.arange(5) * np.sqrt(27))
    assert Trajectory(T_NS[:0], poses_trajectory(0)).distances_m().shape == (0,)


def test_something_mounted_moves_along():
    T_body_camera = se3.transform(se3.rotation_z(1.0), [0.1, 0.0, 0.3])
    path = Trajectory(T_NS, poses_trajectory())
    back = path.of_mounted(T_body_camera).of_mounted(se3.inverse(T_body_camera))
    np.testing.assert_allclose(back.T_world_frame, path.T_world_frame, atol=1e-12)


@pytest.mark.parametrize(("stamps", "rate_hz"), [([5], 0.0), ([5, 5], 0.0), ([0, 50_000_000, 100_000_000], 20.0)])
def test_the_mean_rate_is_the_number_of_intervals_over_their_time(stamps, rate_hz):
    assert mean_rate_hz(np.array(stamps)) == rate_hz
