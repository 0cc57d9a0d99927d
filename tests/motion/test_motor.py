"""The voltage model keeps energy, mirrors, and asks its motors for what its loops want."""

from dataclasses import fields, replace

import numpy as np
import pytest

from vobench.errors import SettingError
from vobench.motion.controller import CONTROLLERS
from vobench.motion.drive import drive
from vobench.motion.motor import MotorConstants, accelerations_at, loop_voltages, theta_of, wheel_voltages
from vobench.motion.pioneer import wheel_speeds

REPRESENTATIVE = MotorConstants()


def some_robot(rng: np.random.Generator) -> MotorConstants:
    """The representative robot with every value up to three times smaller or larger, its mass ahead or behind."""
    share = dict(zip((f.name for f in fields(MotorConstants)), 3 ** rng.uniform(-1, 1, 14), strict=True))
    motors = replace(REPRESENTATIVE, **{name: getattr(REPRESENTATIVE, name) * by for name, by in share.items()})
    return replace(motors, b_m=motors.b_m * rng.choice([-1, 1]))


ROBOTS = [REPRESENTATIVE, *map(some_robot, np.random.default_rng(0).spawn(4))]
EVERY_ROBOT = pytest.mark.parametrize("motors", ROBOTS, ids=["representative", "b", "c", "d", "e"])
STATES = np.random.default_rng(1).uniform(-1.5, 1.5, (30, 2)).tolist()
VOLTS = np.random.default_rng(2).uniform(-12, 12, (30, 2)).tolist()


def rim_speeds(u: float, omega: float, motors: MotorConstants) -> list[float]:
    """Angular rates of the left and the right wheel in rad/s."""
    return [speed / motors.r_m for speed in wheel_speeds(u, omega, track_m=motors.d_m)]


def kinetic_energy(u: float, omega: float, motors: MotorConstants) -> float:
    """Energy in J of the body, moving and turning, and of its wheels."""
    body = motors.m_kg * (u**2 + (motors.b_m * omega) ** 2) + motors.Iz_kgm2 * omega**2
    return (body + motors.Ie_kgm2 * sum(rate**2 for rate in rim_speeds(u, omega, motors))) / 2


def motor_power(u: float, omega: float, v_u: float, v_omega: float, motors: MotorConstants) -> float:
    """Power in W that both motors hand to their wheels."""
    pairs = zip(wheel_voltages(v_u, v_omega), rim_speeds(u, omega, motors), strict=True)
    return sum(motors.ka_NmpA / motors.Ra_ohm * (volts - motors.kb_Vsprad * rate) * rate for volts, rate in pairs)


def friction_power(u: float, omega: float, motors: MotorConstants) -> float:
    """Power in W that friction takes from both wheels."""
    return sum(motors.Be_Nmsprad * rate**2 for rate in rim_speeds(u, omega, motors))


@EVERY_ROBOT
def test_energy_grows_by_what_the_motors_give_and_friction_takes(motors: MotorConstants) -> None:
    for (u, omega), volts in zip(STATES, VOLTS, strict=True):
        du, dw = accelerations_at(u, omega, *volts, motors=motors)
        # Energy is quadratic in the speeds, so this central difference is its derivative and no approximation.
        after, before = (kinetic_energy(u + way * du, omega + way * dw, motors) for way in (1, -1))
        given = motor_power(u, omega, *volts, motors) - friction_power(u, omega, motors)
        assert (after - before) / 2 == pytest.approx(given, abs=1e-10, rel=1e-10)


@EVERY_ROBOT
def test_a_robot_without_voltage_slows_down_into_rest_from_any_speed(motors: MotorConstants) -> None:
    for u, omega in STATES:
        assert motor_power(u, omega, 0.0, 0.0, motors) < 0 <= friction_power(u, omega, motors)
    assert accelerations_at(0.0, 0.0, 0.0, 0.0, motors=motors) == (0.0, 0.0)


@EVERY_ROBOT
def test_the_theta_of_any_physical_robot_is_passive(motors: MotorConstants) -> None:
    theta = theta_of(motors)
    c = motors.d_m * motors.kPR_Vsprad / (2 * motors.kPT_Vspm)
    assert theta.t3 / theta.t5 == pytest.approx(c, rel=1e-12)
    assert min(theta.t1, theta.t2, c) > 0
    assert min(theta.t4, theta.t6) > 1


@EVERY_ROBOT
def test_mirroring_turn_and_difference_of_voltage_mirrors_the_motion(motors: MotorConstants) -> None:
    for (u, omega), (v_u, v_omega) in zip(STATES, VOLTS, strict=True):
        du, dw = accelerations_at(u, omega, v_u, v_omega, motors=motors)
        assert accelerations_at(u, -omega, v_u, -v_omega, motors=motors) == (du, -dw)


@pytest.mark.parametrize(("name", "peak_V"), [("paper", 6.5), ("smooth", 4.7), ("easy", 3.3)])
def test_a_drive_of_the_representative_robot_asks_its_motors_for_less_than_a_battery_has(
    name: str, peak_V: float
) -> None:
    run = drive(
        [(1, 1), (0, 1), (1, 0), (2, 2)], theta=theta_of(REPRESENTATIVE), controller=CONTROLLERS[name], max_time_s=30
    )
    volts = loop_voltages(run.state[:, 3:].T, run.references.T, run.rates.T, motors=REPRESENTATIVE)
    assert np.abs(wheel_voltages(*volts)).max() == pytest.approx(peak_V, abs=0.1)


@pytest.mark.parametrize("name", [f.name for f in fields(MotorConstants)])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_value_that_is_no_number_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(SettingError, match=rf"{name}: should be a finite number \(got {value}\)"):
        replace(REPRESENTATIVE, **{name: value})


@pytest.mark.parametrize("name", ["r_m", "d_m", "m_kg", "Iz_kgm2", "Ra_ohm", "ka_NmpA", "kPT_Vspm", "kPR_Vsprad"])
def test_a_value_that_must_be_positive_is_refused_at_nought(name: str) -> None:
    with pytest.raises(SettingError, match=rf"{name}: should be greater than 0 \(got 0.0\)"):
        replace(REPRESENTATIVE, **{name: 0.0})


@pytest.mark.parametrize("name", ["Ie_kgm2", "kb_Vsprad", "Be_Nmsprad", "kDT_Vs2pm", "kDR_Vs2prad"])
def test_a_loss_or_a_gain_may_be_nought_but_not_less(name: str) -> None:
    assert getattr(replace(REPRESENTATIVE, **{name: 0.0}), name) == 0
    with pytest.raises(SettingError, match=rf"{name}: should be 0 or more \(got -1.0\)"):
        replace(REPRESENTATIVE, **{name: -1.0})


def test_the_centre_of_mass_may_lie_behind_the_axle_on_it_or_ahead() -> None:
    assert [np.sign(theta_of(replace(REPRESENTATIVE, b_m=b)).t3) for b in (-0.02, 0.0, 0.02)] == [-1, 0, 1]
