"""Laws of the identified model, equations (18)-(19)."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.robot.pioneer import THETAS, Theta, accelerations, axle_poses, feed_forward, velocities, wheel_speeds

ALL = pytest.mark.parametrize("theta", THETAS.values(), ids=THETAS.keys())
PIONEER = THETAS["pioneer_3dx"]


def random_inputs(seed: int, count: int = 50) -> list[list[float]]:
    """u, omega, u_ref, omega_ref."""
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (count, 4)).tolist()


@ALL
def test_mirroring_turn_and_turn_reference_mirrors_the_motion_exactly(theta: Theta) -> None:
    for u, omega, u_ref, omega_ref in random_inputs(0):
        u_rate, omega_rate = accelerations(u, omega, u_ref, omega_ref, theta=theta)
        assert accelerations(u, -omega, u_ref, -omega_ref, theta=theta) == (u_rate, -omega_rate)


@ALL
def test_what_is_fed_forward_for_an_acceleration_gives_that_acceleration(theta: Theta) -> None:
    for u, omega, u_rate, omega_rate in random_inputs(7):
        references = feed_forward(u, omega, u_rate, omega_rate, theta=theta)
        np.testing.assert_allclose(accelerations(u, omega, *references, theta=theta), (u_rate, omega_rate), atol=1e-12)


@pytest.mark.parametrize("psi", [-2.0, 0.0, 0.3, 3.0])
def test_in_the_robots_own_axes_the_point_h_moves_at_u_and_a_omega(psi: float) -> None:
    x_rate, y_rate, psi_rate = velocities(psi, 0.6, -0.9, a_m=0.2)
    body = se3.rotation_z(psi)[:2, :2].T @ [x_rate, y_rate]
    np.testing.assert_allclose([*body, psi_rate], [0.6, 0.2 * -0.9, -0.9], atol=1e-15)


def test_sliding_moves_h_to_the_robots_left_and_turns_nothing() -> None:
    psi = 0.7
    difference = np.subtract(velocities(psi, 0.6, 0.9, a_m=0.2, side_mps=0.1), velocities(psi, 0.6, 0.9, a_m=0.2))
    np.testing.assert_allclose(difference, [-0.1 * np.sin(psi), 0.1 * np.cos(psi), 0.0], atol=1e-15)


def test_the_axle_midpoint_is_a_behind_h_on_the_floor() -> None:
    x, y, psi = np.random.default_rng(3).uniform(-2, 2, (3, 20))
    T_world_body = axle_poses(x, y, psi, a_m=0.2)
    h = se3.apply(T_world_body, [[0.2, 0.0, 0.0]])[:, 0]
    np.testing.assert_allclose(h, np.stack([x, y, 0 * x], -1), atol=1e-15)


def test_both_wheels_of_a_robot_that_turns_on_the_spot_run_oppositely() -> None:
    assert wheel_speeds(0.0, 2.0, track_m=0.331) == (-0.331, 0.331)


@pytest.mark.parametrize(("name", "value"), [("t1", 0.0), ("t2", -0.2), ("t3", float("nan")), ("t6", float("inf"))])
def test_a_theta_without_finite_values_and_positive_lags_is_refused(name: str, value: float) -> None:
    with pytest.raises(MotionError, match="six finite values with positive lags"):
        replace(THETAS["pioneer_3dx"], **{name: value})
