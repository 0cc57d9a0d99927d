"""A mover is at its keys on time, goes straight between them, and starts again where it repeats; limbs swing."""

import numpy as np
import pytest

from vobench.asset.outdoors import walker
from vobench.geometry import se3
from vobench.scene.scene import LimbMotion, WaypointMotion

PATH = WaypointMotion(
    np.array([1.0, 3.0, 4.0]), np.array([[0.0, 0, 0], [2, 0, 0], [2, 3, 0.5]]), np.array([0.0, 0.0, 90.0])
)
AGAIN = WaypointMotion(PATH.times_s, PATH.positions_m, PATH.yaw_deg, repeats=True)


def at(path: WaypointMotion, t_s: float) -> list[float]:
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


def test_a_way_that_repeats_goes_on_growing() -> None:
    length_m = 2 + np.sqrt(9.25)
    assert PATH.distance_m(3e9) == pytest.approx(2)
    assert PATH.distance_m(99e9) == pytest.approx(length_m)
    assert [AGAIN.distance_m(t * 1e9) for t in (2, 5, 8)] == pytest.approx([1, 1 + length_m, 1 + 2 * length_m])


def gaits(path: WaypointMotion, by: float = 1.0) -> list[tuple[LimbMotion, np.ndarray]]:
    """The limbs of a walker, and the points of each."""
    who = walker(np.random.default_rng(0))
    ways = [LimbMotion(path, who.cycle_m, limb.joints_m, limb.pitch_rad, who.rise_m).sized(by) for limb in who.limbs]
    points = [np.concatenate([part.mesh.vertices for part in limb.parts]) * by for limb in who.limbs]
    return list(zip(ways, points, strict=True))


AHEAD = WaypointMotion(np.array([0.0, 4.0]), np.array([[0.0, 0, 0], [5.0, 0, 0]]), np.zeros(2))


def test_who_walks_neither_sinks_in_nor_floats_and_keeps_a_foot_where_it_stands() -> None:
    lowest, feet_m, limbs = [], [], gaits(AHEAD)
    shins = [(way, way.joints_m[1, 1]) for way, _ in limbs if len(way.joints_m) == 2]
    for t_s in np.linspace(0.5, 3.5, 61):
        placed = [se3.apply(way.pose(t_s * 1e9), points) for way, points in limbs]
        lowest.append(min(points[:, 2].min() for points in placed))
        feet_m.append([se3.apply(way.pose(t_s * 1e9), [[0.06, y, 0]])[0, 0] for way, y in shins])
    assert np.abs(lowest).max() < 0.004
    steps = np.abs(np.diff(np.array(feet_m), axis=0)).min(axis=1)
    assert np.median(steps) < 0.003  # of 62 mm that the body goes meanwhile
    assert np.ptp(np.array(feet_m), axis=0).min() > 3


def test_who_is_twice_as_large_takes_steps_of_twice_the_length() -> None:
    for (way, _), (large, _) in zip(gaits(AHEAD), gaits(AHEAD, 2.0), strict=True):
        np.testing.assert_allclose(large.pose(1.3e9)[:3, 3], 2 * way.pose(1.3e9)[:3, 3], atol=1e-9)
        np.testing.assert_allclose(large.pose(1.3e9)[:3, :3], way.pose(1.3e9)[:3, :3], atol=1e-9)
