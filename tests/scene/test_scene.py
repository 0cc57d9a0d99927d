"""A mover is at its keys on time, goes straight between them, and starts again where it repeats."""

import numpy as np

from vobench.scene.scene import Path

PATH = Path(np.array([1.0, 3.0, 4.0]), np.array([[0.0, 0, 0], [2, 0, 0], [2, 3, 0.5]]), np.array([0.0, 0.0, 90.0]))
AGAIN = Path(PATH.times_s, PATH.positions_m, PATH.yaw_deg, repeats=True)


def at(path: Path, t_s: float) -> list[float]:
    return path.pose(t_s * 1e9)[:3, 3].tolist()


def test_a_mover_is_at_each_key_in_time_and_amid_two_halfway() -> None:
    assert [at(PATH, t) for t in (1, 3, 4)] == PATH.positions_m.tolist()
    np.testing.assert_allclose(at(PATH, 3.5), [2, 1.5, 0.25])
    np.testing.assert_allclose(PATH.pose(3.5e9)[:2, 0], np.sqrt([0.5, 0.5]))


def test_before_and_after_its_path_a_mover_rests() -> None:
    assert at(PATH, 0) == [0, 0, 0]
    assert at(PATH, 99) == [2, 3, 0.5]


def test_a_repeating_mover_starts_again() -> None:
    for t in (1.0, 1.7, 3.4):
        np.testing.assert_allclose(AGAIN.pose(t * 1e9), AGAIN.pose((t + 3) * 1e9), atol=1e-12)
        np.testing.assert_allclose(AGAIN.pose(t * 1e9), PATH.pose(t * 1e9), atol=1e-12)


def test_poses_are_rigid() -> None:
    R = PATH.pose(3.3e9)[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
