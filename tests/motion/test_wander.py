"""A body that wanders keeps clear of everything, goes as far as asked, and moves as smoothly as its derivatives say."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from vobench.errors import MotionError
from vobench.motion.wander import Clearance, Wander

BODIES = ("pioneer", "hand", "quadrotor")


def room(half_m: float, *, block_m: float = 0.0) -> Clearance:
    """A square room around the origin, with a square block in the middle."""
    cell_m = 0.1
    centres = np.arange(-half_m + cell_m / 2, half_m, cell_m)
    x, y = np.meshgrid(centres, centres)
    is_free = np.maximum(abs(x), abs(y)) > block_m
    distance = scipy.ndimage.distance_transform_edt(np.pad(is_free, 1))[1:-1, 1:-1]
    return Clearance(float(centres[0]), float(centres[0]), 0.2, cell_m, np.maximum(distance - 0.5, 0) * cell_m)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_it_keeps_clear_of_walls_and_of_a_block(body, seed) -> None:
    found = Wander(body=body, length_m=8, seed=seed).motion(room(3, block_m=0.7))
    motion = found.motion
    positions = motion.at(np.linspace(motion.start_ns, motion.end_ns, 2000)).T_world_body[:, :2, 3]
    to_block_m = np.linalg.norm(np.maximum(np.abs(positions) - 0.7, 0), axis=1)
    assert found.clearance_m > 0
    assert np.abs(positions).max() < 3 - 0.25
    assert to_block_m.min() > 0.25 - 0.05  # half a cell, at corners


def test_a_robot_goes_exactly_as_far_as_asked_on_the_floor_from_rest_to_rest() -> None:
    motion = Wander(length_m=8, seed=4).motion(room(3)).motion
    kinematics = motion.at(np.linspace(motion.start_ns, motion.end_ns, 20_001))
    positions = kinematics.T_world_body[:, :3, 3]
    assert np.linalg.norm(np.diff(positions, axis=0), axis=1).sum() == pytest.approx(8, rel=1e-5)
    assert np.all(positions[:, 2] == pytest.approx(0.2))
    assert kinematics.velocity_mps[[0, -1]] == pytest.approx(0, abs=1e-6)
    assert kinematics.velocity_mps[:, 1:] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("body", BODIES)
def test_velocity_is_the_derivative_of_position(body) -> None:
    motion = Wander(body=body, length_m=5, seed=2).motion(room(3)).motion
    t_ns = np.linspace(motion.start_ns + 1e8, motion.end_ns - 1e8, 50)
    step_ns = 1e4
    ahead = motion.at(t_ns + step_ns).T_world_body[:, :3, 3]
    behind = motion.at(t_ns - step_ns).T_world_body[:, :3, 3]
    now = motion.at(t_ns)
    velocity = np.einsum("kij,kj->ki", now.T_world_body[:, :3, :3], now.velocity_mps)
    np.testing.assert_allclose((ahead - behind) / (2 * step_ns / 1e9), velocity, atol=1e-5)


def test_the_seed_decides_the_drive_and_nothing_else_does() -> None:
    ends = [Wander(length_m=5, seed=seed).motion(room(3)).motion.end_ns for seed in (1, 1, 2)]
    assert ends[0] == ends[1] != ends[2]


def test_a_closet_is_refused_in_one_line() -> None:
    with pytest.raises(MotionError, match=r"no path of 9 m was found on which a pioneer with seed 1 keeps clear"):
        Wander(length_m=9).motion(room(0.25))


def hills(half_m: float = 4.0) -> Clearance:
    """A square of uneven ground around the origin."""
    flat = room(half_m)
    centres = flat.x_m + flat.cell_m * np.arange(flat.distance_m.shape[1])
    x, y = np.meshgrid(centres, centres)
    return replace(flat, ground_m=0.3 * np.sin(0.6 * x) + 0.2 * np.cos(0.5 * y))


@pytest.mark.parametrize(
    ("body", "above_m"), [("pioneer", (-0.02, 0.02)), ("hand", (1.3, 1.6)), ("quadrotor", (0.4, 1.8))]
)
def test_on_uneven_ground_bodies_follow_the_ground(body, above_m) -> None:
    ground = hills()
    motion = Wander(body=body, length_m=6, seed=3).motion(ground).motion
    positions = motion.at(np.linspace(motion.start_ns, motion.end_ns, 500)).T_world_body[:, :3, 3]
    heights_m = positions[:, 2] - ground.ground_at(positions[:, :2])
    assert np.ptp(ground.ground_at(positions[:, :2])) > 0.1
    assert above_m[0] < heights_m.min() <= heights_m.max() < above_m[1]


def test_a_car_on_uneven_ground_is_refused_in_one_line() -> None:
    with pytest.raises(MotionError, match="the ground of this place is uneven, where a car does not wander; choose"):
        Wander(body="car", length_m=6).motion(hills(12))


def test_the_ground_of_a_level_floor_is_its_height() -> None:
    assert room(3).ground_at(np.zeros((2, 2))).tolist() == [0.2, 0.2]
