"""The voltage model keeps energy, mirrors, and asks its motors for what its loops want."""

from dataclasses import fields, replace

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.motion.controller import CONTROLLERS
from vobench.motion.drive import drive
from vobench.motion.motor import (
    REPRESENTATIVE,
    PhysicalRobot,
    accelerations_at,
    friction_power,
    kinetic_energy,
    loop_voltages,
    motor_power,
    rates,
    rim_speeds,
    theta_of,
    wheel_voltages,
)


def some_robot(rng: np.random.Generator) -> PhysicalRobot:
    """The representative robot with every value up to three times smaller or larger, its mass ahead or behind."""
    share = dict(zip((f.name for f in fields(PhysicalRobot)), 3 ** rng.uniform(-1, 1, 14), strict=True))
    robot = replace(REPRESENTATIVE, **{name: getattr(REPRESENTATIVE, name) * by for name, by in share.items()})
    return replace(robot, b=robot.b * rng.choice([-1, 1]))


ROBOTS = [REPRESENTATIVE, *map(some_robot, np.random.default_rng(0).spawn(4))]
EVERY_ROBOT = pytest.mark.parametrize("robot", ROBOTS, ids=["representative", "b", "c", "d", "e"])
STATES = np.random.default_rng(1).uniform(-1.5, 1.5, (30, 2)).tolist()
VOLTS = np.random.default_rng(2).uniform(-12, 12, (30, 2)).tolist()


@EVERY_ROBOT
def test_energy_grows_by_what_the_motors_give_and_friction_takes(robot: PhysicalRobot) -> None:
    for (u, omega), volts in zip(STATES, VOLTS, strict=True):
        du, dw = accelerations_at(u, omega, *volts, robot=robot)
        # Energy is quadratic in the speeds, so this central difference is its derivative and no approximation.
        after, before = (kinetic_energy(u + way * du, omega + way * dw, robot=robot) for way in (1, -1))
        given = motor_power(u, omega, *volts, robot=robot) - friction_power(u, omega, robot=robot)
        assert (after - before) / 2 == pytest.approx(given, abs=1e-10, rel=1e-10)


@EVERY_ROBOT
def test_a_robot_without_voltage_slows_down_into_rest_from_any_speed(robot: PhysicalRobot) -> None:
    for u, omega in STATES:
        assert motor_power(u, omega, 0.0, 0.0, robot=robot) < 0 <= friction_power(u, omega, robot=robot)
    assert accelerations_at(0.0, 0.0, 0.0, 0.0, robot=robot) == (0.0, 0.0)


@EVERY_ROBOT
def test_the_theta_of_any_physical_robot_is_passive(robot: PhysicalRobot) -> None:
    theta = theta_of(robot)
    c = robot.d * robot.kPR / (2 * robot.kPT)
    assert theta.t3 / theta.t5 == pytest.approx(c, rel=1e-12)
    assert min(theta.t1, theta.t2, c) > 0
    assert min(theta.t4, theta.t6) > 1


@EVERY_ROBOT
def test_mirroring_turn_and_difference_of_voltage_mirrors_the_motion(robot: PhysicalRobot) -> None:
    for (u, omega), (v_u, v_omega) in zip(STATES, VOLTS, strict=True):
        du, dw = accelerations_at(u, omega, v_u, v_omega, robot=robot)
        assert accelerations_at(u, -omega, v_u, -v_omega, robot=robot) == (du, -dw)


def test_the_state_moves_by_its_speeds_its_accelerations_and_its_wheels() -> None:
    state, volts = np.array([1.0, 2.0, 0.0, 0.4, 0.9, 5.0, 6.0]), (3.0, 1.0)
    dx, dy, dpsi, du, dw, left, right = rates(state, *volts, robot=REPRESENTATIVE, a_m=0.2)
    assert (dx, dy, dpsi) == (0.4, pytest.approx(0.2 * 0.9), 0.9)
    assert (du, dw) == accelerations_at(0.4, 0.9, *volts, robot=REPRESENTATIVE)
    assert (left, right) == rim_speeds(0.4, 0.9, robot=REPRESENTATIVE)


@pytest.mark.parametrize(("name", "peak_V"), [("paper", 6.5), ("smooth", 4.7), ("easy", 3.3)])
def test_a_drive_of_the_representative_robot_asks_its_motors_for_less_than_a_battery_has(
    name: str, peak_V: float
) -> None:
    run = drive(
        [(1, 1), (0, 1), (1, 0), (2, 2)], theta=theta_of(REPRESENTATIVE), controller=CONTROLLERS[name], max_time_s=30
    )
    volts = loop_voltages(*run.state[:, 3:].T, *run.references.T, robot=REPRESENTATIVE)
    assert np.abs(wheel_voltages(*volts)).max() == pytest.approx(peak_V, abs=0.1)


def test_arrays_give_what_each_of_their_instants_gives() -> None:
    speeds, asked = np.array(STATES), np.random.default_rng(5).uniform(-1, 1, (30, 2))
    together = np.stack(loop_voltages(*speeds.T, *asked.T, robot=REPRESENTATIVE), -1)
    alone = [loop_voltages(*now, *ref, robot=REPRESENTATIVE) for now, ref in zip(STATES, asked.tolist(), strict=True)]
    np.testing.assert_allclose(together, alone, rtol=1e-14)


@pytest.mark.parametrize("name", [f.name for f in fields(PhysicalRobot)])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_value_that_is_no_number_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(MotionError, match=f"the robot's {name} must be finite, got {value}"):
        replace(REPRESENTATIVE, **{name: value})


@pytest.mark.parametrize("name", ["r", "d", "m", "Iz", "Ra", "ka", "kPT", "kPR"])
def test_a_value_that_must_be_positive_is_refused_at_nought(name: str) -> None:
    with pytest.raises(MotionError, match=f"{name} must be positive, got 0"):
        replace(REPRESENTATIVE, **{name: 0.0})


@pytest.mark.parametrize("name", ["Ie", "kb", "Be", "kDT", "kDR"])
def test_a_loss_or_a_gain_may_be_nought_but_not_less(name: str) -> None:
    assert getattr(replace(REPRESENTATIVE, **{name: 0.0}), name) == 0
    with pytest.raises(MotionError, match=f"{name} must not be negative, got -1"):
        replace(REPRESENTATIVE, **{name: -1.0})


def test_the_centre_of_mass_may_lie_behind_the_axle_on_it_or_ahead() -> None:
    assert [np.sign(theta_of(replace(REPRESENTATIVE, b=b)).t3) for b in (-0.02, 0.0, 0.02)] == [-1, 0, 1]
