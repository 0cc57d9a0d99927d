"""What is no trajectory is refused by name, and what is one isn't."""

import numpy as np
import pytest

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.trajectory import trajectory as trajectory_module
from vobench.trajectory.trajectory import Trajectory

T_NS = np.arange(5, dtype=np.int64)


def poses(n=5):
    return se3.transform(se3.rotation_z(np.arange(n)), np.arange(3.0 * n).reshape(n, 3))


def spoilt(value, at):
    T = poses()
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
        Trajectory(np.array(t_ns, np.int64), poses())


def test_shapes_and_types_that_do_not_fit_are_refused():
    for t_ns, T in [(T_NS[:4], poses()), (T_NS.astype(float), poses()), (T_NS, poses()[:, :3])]:
        with pytest.raises(TrajectoryError, match="needs"):
            Trajectory(t_ns, T)


def test_rotations_with_few_digits_and_no_poses_at_all_pass():
    T = poses()
    T[:, :3, :3] = np.round(T[:, :3, :3], 3)
    assert len(Trajectory(T_NS, T)) == 5
    assert len(Trajectory(T_NS[:0], poses(0))) == 0


def test_the_way_grows_by_each_step():
    path = Trajectory(T_NS, poses())
    np.testing.assert_allclose(path.distances_m(), np.arange(5) * np.sqrt(27))
    assert Trajectory(T_NS[:0], poses(0)).distances_m().shape == (0,)


def test_something_mounted_moves_along():
    T_body_camera = se3.transform(se3.rotation_z(1.0), [0.1, 0.0, 0.3])
    path = Trajectory(T_NS, poses())
    back = path.of_mounted(T_body_camera).of_mounted(se3.inverse(T_body_camera))
    np.testing.assert_allclose(back.T_world_frame, path.T_world_frame, atol=1e-12)
