"""A course over ground: its derivatives are those of its poses, and a body on it tilts with the ground or not."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.motion.course import CoursePiece, course
from vobench.motion.ground_curve import GroundCurve, over_ground

LENGTH_M = 6.0
PIECES = [CoursePiece(2.0, 0.0, 0.2), CoursePiece(2.0, 0.4, -0.3), CoursePiece(2.0, -0.2, 0.1)]


def curve(*, is_level: bool, slope: float | None = None) -> GroundCurve:
    stops_m = np.linspace(0, LENGTH_M, 16)
    heights_m = 0.2 * np.sin(1.1 * stops_m) if slope is None else slope * stops_m
    return over_ground(course(PIECES), stops_m, heights_m, is_level=is_level)


@pytest.mark.parametrize("is_level", [False, True])
def test_velocities_and_accelerations_are_the_derivatives_of_the_poses(is_level: bool) -> None:
    way = curve(is_level=is_level)
    s = np.array([0.7, 1.3, 2.9, 3.4, 4.6, 5.3])
    step = 1e-5
    now = way.at(s)
    before = way.at(s - step)
    after = way.at(s + step)
    R_body_world = se3.transposed(now.T_world_body[:, :3, :3])

    def in_body(vectors: np.ndarray) -> np.ndarray:
        return np.einsum("kij,kj->ki", R_body_world, vectors)

    places = [each.T_world_body[:, :3, 3] for each in (before, now, after)]
    assert now.velocity_mps == pytest.approx(in_body((places[2] - places[0]) / (2 * step)), abs=1e-8)
    world_mps = [np.einsum("kij,kj->ki", each.T_world_body[:, :3, :3], each.velocity_mps) for each in (before, after)]
    assert now.acceleration_mps2 == pytest.approx(in_body((world_mps[1] - world_mps[0]) / (2 * step)), abs=1e-8)

    R_change = (after.T_world_body - before.T_world_body)[:, :3, :3] / (2 * step)
    spin = R_body_world @ R_change
    turn = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], -1)
    assert now.angular_velocity_radps == pytest.approx(turn, abs=1e-8)
    turn_rate = (after.angular_velocity_radps - before.angular_velocity_radps) / (2 * step)
    assert now.angular_acceleration_radps2 == pytest.approx(turn_rate, abs=1e-7)


def test_on_an_even_slope_it_climbs_as_the_slope_and_pitches_up_by_its_angle() -> None:
    slope = 0.15
    kinematics = curve(is_level=False, slope=slope).at(np.linspace(1.0, 5.0, 9))
    x_axis = kinematics.T_world_body[:, :3, 0]
    y_axis = kinematics.T_world_body[:, :3, 1]
    assert x_axis[:, 2] == pytest.approx(slope / np.hypot(1, slope), abs=1e-3)
    assert y_axis[:, 2] == pytest.approx(0, abs=1e-12)
    assert kinematics.velocity_mps[:, 0] == pytest.approx(np.hypot(1, slope), abs=1e-3)
    assert kinematics.velocity_mps[:, 1:] == pytest.approx(0, abs=1e-12)


def test_a_level_body_stays_upright_and_moves_up() -> None:
    kinematics = curve(is_level=True, slope=0.15).at(np.linspace(1.0, 5.0, 9))
    assert kinematics.T_world_body[:, :3, 2] == pytest.approx(np.tile([0.0, 0.0, 1.0], (9, 1)))
    assert kinematics.velocity_mps[:, 2] == pytest.approx(0.15, abs=1e-3)


def test_heights_are_smoothed_but_not_those_of_a_slope() -> None:
    stops_m = np.linspace(0, LENGTH_M, 31)
    heights_m = 0.1 * stops_m
    heights_m[15] += 0.04
    way = over_ground(course(PIECES), stops_m, heights_m, is_level=True)
    z_m = way.at(stops_m).T_world_body[:, 2, 3]
    assert z_m[2:13] == pytest.approx(0.1 * stops_m[2:13])
    assert z_m[15] - 0.1 * stops_m[15] == pytest.approx(0.02)
    assert way.breaks.tolist() == course(PIECES).breaks.tolist()
