"""The robot as one system: where its wheels touch the floor, and what its speeds do in a period."""

import numpy as np
import pytest

from vobench.geometry.rig import PIONEER_WHEELS
from vobench.robot.controller import CONTROLLERS
from vobench.robot.limits import AccelerationLimits
from vobench.robot.pioneer import THETAS, Theta, axle_poses
from vobench.robot.slip import SlipNow
from vobench.robot.vehicle import Vehicle

STATES = np.random.default_rng(0).uniform(-1, 1, (20, 7))


def vehicle(theta: Theta | None = THETAS["pioneer_3dx"], **options: object) -> Vehicle:
    return Vehicle(theta, CONTROLLERS["smooth"], PIONEER_WHEELS, 30.0, 4, "rk4", **options)


def test_the_wheels_are_foreseen_where_they_are_a_period_on_if_nothing_is_asked_to_change() -> None:
    robot, slip = vehicle(None), SlipNow(beta=0.1, skid_s=0.02)
    for state in STATES:
        x, y, psi = robot.advance(state, (state[3], state[4]), slip)[-1, :3]
        T_world_body = axle_poses(np.array([x]), np.array([y]), np.array([psi]), a_m=0.2)[0]
        half = PIONEER_WHEELS.track_m / 2
        expected = (T_world_body @ [[0, 0, 0], [half, -half, 0], [0, 0, 0], [1, 1, 1]])[:2].T
        np.testing.assert_allclose(robot.contacts_ahead(state, slip), expected, atol=2e-3)


def test_turning_on_the_spot_the_wheels_are_foreseen_on_their_circle() -> None:
    state = np.array([0.2, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0])
    left, right, _ = vehicle().contacts_ahead(state, SlipNow())
    half = PIONEER_WHEELS.track_m / 2
    np.testing.assert_allclose(np.subtract(left, right), 2 * half * np.array([-np.sin(0.1), np.cos(0.1)]), atol=1e-12)


def test_speeds_of_the_ideal_unicycle_run_evenly_to_what_is_asked_in_one_period() -> None:
    for state in STATES:
        speeds = vehicle(None).advance(state, (0.5, -1.0), SlipNow())[:, 3:5]
        share = np.array([0.25, 0.5, 0.75, 1.0])[:, None]
        np.testing.assert_allclose(speeds, (1 - share) * state[3:5] + share * [0.5, -1.0], atol=1e-12)


def test_a_push_acts_beyond_the_limits_of_the_drive_train() -> None:
    robot = vehicle(limits=AccelerationLimits(0.1, 0.1))
    calm = robot.speed_rates(0.0, 0.0, (1.0, 1.0), (0.0, 0.0), (0.0, 0.0))
    assert calm == (0.1, 0.1)
    assert robot.speed_rates(0.0, 0.0, (1.0, 1.0), (0.0, 0.0), (0.3, -0.2)) == pytest.approx((0.4, -0.1))


def test_slip_that_stays_is_the_same_however_it_is_said() -> None:
    robot, slip = vehicle(), SlipNow(0.02, -0.03, 0.05, 0.01, 0.02, 0.1, -0.1)
    almost = slip._replace(left=0.02 + 1e-15)
    for state in STATES:
        held, running = robot.advance(state, (0.5, 0.3), slip, slip), robot.advance(state, (0.5, 0.3), slip, almost)
        np.testing.assert_allclose(held, running, atol=1e-13)
        np.testing.assert_array_equal(held, robot.advance(state, (0.5, 0.3), slip))
