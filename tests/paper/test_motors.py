"""Equations (1)-(10) and (12)-(17): motors, inner loops, wheels, and the theta that they come to.

The judge is Newton's laws, written here from a free-body drawing and solved as one linear system.
"""

from dataclasses import astuple, fields

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vobench.geometry.se3 import Array
from vobench.motion.motor import (
    MotorConstants,
    accelerations_at,
    loop_voltages,
    theta_of,
    voltage_theta_of,
    wheel_voltages,
)
from vobench.motion.pioneer import THETAS, Theta, accelerations, velocities, wheel_speeds

A_M = 0.2
REPRESENTATIVE = MotorConstants()
DIFFERENT = MotorConstants(
    r_m=0.06, d_m=0.4, m_kg=7.0, b_m=0.05, Iz_kgm2=0.2, Ie_kgm2=0.03, Ra_ohm=1.3, ka_NmpA=0.5, kb_Vsprad=0.6,
    Be_Nmsprad=0.04, kPT_Vspm=22.0, kPR_Vsprad=9.0, kDT_Vs2pm=4.0, kDR_Vs2prad=0.0,
)  # fmt: skip
ROBOTS = pytest.mark.parametrize("motors", [REPRESENTATIVE, DIFFERENT], ids=["representative", "another"])
NOWS = np.random.default_rng(0).uniform(-1.5, 1.5, (30, 4)).tolist()


def scaled(by: Array) -> MotorConstants:
    """Another robot, every constant times a factor (14,)."""
    return MotorConstants(**{name: getattr(DIFFERENT, name) * x for name, x in zip(UNITS, by.tolist(), strict=True)})


def newton(u: float, omega: float, motors: MotorConstants, loops: Array, asked: Array) -> Array:
    """Unknowns u', omega', forces F_r, F_l that push the wheels on, side force N, and v_r, v_l, (7,).

    `loops` (2, 7) and `asked` (2,) are two more equations for the voltages.
    """
    r, d, m, b, Iz, Ie, Ra, ka, kb, Be = astuple(motors)[:10]
    rim = [(u + way * omega * d / 2) / r for way in (1, -1)]
    left_side = [
        [m, 0, -1, -1, 0, 0, 0],  # forward: m (u' - b omega^2) = F_r + F_l
        [0, m * b, 0, 0, -1, 0, 0],  # to the left: m (u omega + b omega') = N, what the tyres hold
        [0, Iz, -d / 2, d / 2, b, 0, 0],  # turning about the centre of mass, N being b behind it
        [Ie / r, Ie * d / (2 * r), r, 0, 0, -ka / Ra, 0],  # right wheel: Ie phi'' = ka i - Be phi' - r F_r
        [Ie / r, -Ie * d / (2 * r), 0, r, 0, 0, -ka / Ra],  # left wheel; i = (v - kb phi') / Ra in both
        *loops,
    ]
    friction = [-(Be + ka * kb / Ra) * rate for rate in rim]
    return np.linalg.solve(np.array(left_side), [m * b * omega**2, -m * u * omega, 0, *friction, *asked])


def newton_at(u: float, omega: float, v_u: float, v_omega: float, motors: MotorConstants) -> Array:
    """u' and omega' with given voltages: (7) and (8) close the system."""
    mean, half = [0, 0, 0, 0, 0, 0.5, 0.5], [0, 0, 0, 0, 0, 0.5, -0.5]
    return newton(u, omega, motors, np.array([mean, half]), np.array([v_u, v_omega]))[:2]


def newton_asked(u: float, omega: float, u_ref: float, omega_ref: float, motors: MotorConstants) -> Array:
    """All seven unknowns with the loops (6) on top."""
    kPT, kPR, kDT, kDR = motors.kPT_Vspm, motors.kPR_Vsprad, motors.kDT_Vs2pm, motors.kDR_Vs2prad
    loops = [[kDT, 0, 0, 0, 0, 0.5, 0.5], [0, kDR, 0, 0, 0, 0.5, -0.5]]
    return newton(u, omega, motors, np.array(loops), np.array([kPT * (u_ref - u), kPR * (omega_ref - omega)]))


@ROBOTS
def test_equation_1_with_2_to_5_is_newtons_laws_for_the_robot_and_its_wheels(motors: MotorConstants) -> None:
    for u, omega, *tenths in NOWS:
        v_u, v_omega = np.multiply(tenths, 8)
        expected = newton_at(u, omega, v_u, v_omega, motors)
        np.testing.assert_allclose(accelerations_at(u, omega, v_u, v_omega, motors=motors), expected, rtol=1e-11)


@ROBOTS
def test_equation_1_in_the_papers_matrix_form_mended(motors: MotorConstants) -> None:
    t1, t2, t3, t4 = astuple(voltage_theta_of(motors))
    r, d = motors.r_m, motors.d_m
    for psi, u, omega, tenth in NOWS:
        matrix = [
            [np.cos(psi), -A_M * np.sin(psi)],
            [np.sin(psi), A_M * np.cos(psi)],
            [0, 1],
            [-2 * t4 / t1, t3 / t1 * r**2 * omega],
            [-2 * t3 / t2 * r**2 * omega, -t4 / t2 * d**2],
        ]
        inputs = [[0, 0], [0, 0], [0, 0], [2 * r / t1, 0], [0, 2 * r * d / t2]]
        volts = np.array([8 * tenth, 3.0])
        expected = np.array(matrix) @ [u, omega] + np.array(inputs) @ volts
        moved = *velocities(psi, u, omega, a_m=A_M), *accelerations_at(u, omega, *volts, motors=motors)
        np.testing.assert_allclose(moved, expected, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("row", ["u' as printed", "omega' as printed", "input as printed"])
def test_equation_1_as_printed_is_not_newtons_laws(row: str) -> None:
    motors, u, omega, v_u, v_omega = DIFFERENT, 0.6, 0.9, 3.0, 1.0
    t1, t2, t3, t4 = astuple(voltage_theta_of(motors))
    r, d = motors.r_m, motors.d_m
    du, dw = newton_at(u, omega, v_u, v_omega, motors)
    printed = {
        # The matrix times [u; omega], with the terms of u' standing where their coefficients belong.
        "u' as printed": (t3 / t1 * r**2 * omega**2 * u - 2 * u / omega * t4 / t1 * omega + 2 * r / t1 * v_u, du),
        "omega' as printed": (
            -2 * r**2 * omega * t3 / t2 * u - t3 / t2 * d**2 * omega**2 + 2 * r * d / t2 * v_omega,
            dw,
        ),
        "input as printed": (t3 / t1 * r**2 * omega**2 - 2 * t4 / t1 * u + 2 * r / t1 * (2 * v_u), du),
    }
    wrong, right = printed[row]
    assert abs(wrong - right) > 0.001 * abs(right)


@ROBOTS
def test_equation_6_gives_1_the_voltages_that_make_the_rates_it_was_given(motors: MotorConstants) -> None:
    for u, omega, u_ref, omega_ref in NOWS:
        rates = accelerations(u, omega, u_ref, omega_ref, theta=theta_of(motors))
        volts = loop_voltages((u, omega), (u_ref, omega_ref), rates, motors=motors)
        np.testing.assert_allclose(accelerations_at(u, omega, *volts, motors=motors), rates, atol=1e-11)


@ROBOTS
def test_equations_6_7_and_8_the_motors_voltages_are_those_of_newtons_laws(motors: MotorConstants) -> None:
    for u, omega, u_ref, omega_ref in NOWS:
        solved = newton_asked(u, omega, u_ref, omega_ref, motors)
        left, right = wheel_voltages(*loop_voltages((u, omega), (u_ref, omega_ref), solved[:2], motors=motors))
        assert (right, left) == tuple(map(pytest.approx, solved[5:]))


@ROBOTS
def test_equations_9_and_10_wheel_rates_give_speed_and_yaw_rate_back(motors: MotorConstants) -> None:
    for u, omega, _, _ in NOWS:
        left, right = (speed / motors.r_m for speed in wheel_speeds(u, omega, track_m=motors.d_m))
        assert motors.r_m * (right + left) / 2 == pytest.approx(u, abs=1e-14)
        assert motors.r_m * (right - left) / motors.d_m == pytest.approx(omega, abs=1e-14)


@ROBOTS
def test_equation_11_with_12_to_17_is_1_with_6_to_10_at_every_instant(motors: MotorConstants) -> None:
    for u, omega, u_ref, omega_ref in NOWS:
        identified = accelerations(u, omega, u_ref, omega_ref, theta=theta_of(motors))
        np.testing.assert_allclose(identified, newton_asked(u, omega, u_ref, omega_ref, motors)[:2], atol=1e-12)


@ROBOTS
def test_equation_11_drives_as_newtons_laws_motors_and_loops_do_for_ten_seconds(motors: MotorConstants) -> None:
    theta = theta_of(motors)

    def asked(t: float) -> tuple[float, float]:
        return 0.4 + 0.4 * np.sin(1.7 * t), 1.2 * np.sin(0.9 * t + 0.5)

    def by_newton(t: float, state: Array) -> Array:
        _, _, psi, u, omega = state.tolist()
        return np.array([*velocities(psi, u, omega, a_m=A_M), *newton_asked(u, omega, *asked(t), motors)[:2]])

    def by_voltage(t: float, state: Array) -> Array:
        _, _, psi, u, omega = state.tolist()
        volts = loop_voltages((u, omega), asked(t), newton_asked(u, omega, *asked(t), motors)[:2], motors=motors)
        return np.array([*velocities(psi, u, omega, a_m=A_M), *accelerations_at(u, omega, *volts, motors=motors)])

    def by_equation_11(t: float, state: Array) -> Array:
        _, _, psi, u, omega = state.tolist()
        return np.array([*velocities(psi, u, omega, a_m=A_M), *accelerations(u, omega, *asked(t), theta=theta)])

    when = np.linspace(0, 10, 101)
    ways = [
        solve_ivp(way, (0, 10), np.zeros(5), t_eval=when, method="DOP853", rtol=1e-12, atol=1e-13).y
        for way in (by_newton, by_voltage, by_equation_11)
    ]
    assert np.abs(ways[0]).max(1).min() > 0.5
    np.testing.assert_allclose(ways[1], ways[0], atol=1e-9, rtol=0)
    np.testing.assert_allclose(ways[2], ways[0], atol=1e-9, rtol=0)


@ROBOTS
def test_delta_of_11_is_delta_of_1_as_far_as_the_derivative_gains_let_it_through(motors: MotorConstants) -> None:
    pushed, t = (0.5, -0.8), voltage_theta_of(motors)
    r, d = motors.r_m, motors.d_m
    with_loops = t.t1 + 2 * r * motors.kDT_Vs2pm, t.t2 + 2 * r * d * motors.kDR_Vs2prad
    through = np.array([t.t1, t.t2]) / with_loops
    for u, omega, u_ref, omega_ref in NOWS:
        identified = accelerations(u, omega, u_ref, omega_ref, theta=theta_of(motors), delta=tuple(through * pushed))
        volts = loop_voltages((u, omega), (u_ref, omega_ref), identified, motors=motors)
        by_motors = np.add(accelerations_at(u, omega, *volts, motors=motors), pushed)
        np.testing.assert_allclose(by_motors, identified, atol=1e-11)


# Exponents of metre, kilogram, second and volt.
UNITS = {
    "r_m": (1, 0, 0, 0), "d_m": (1, 0, 0, 0), "m_kg": (0, 1, 0, 0), "b_m": (1, 0, 0, 0),
    "Iz_kgm2": (2, 1, 0, 0), "Ie_kgm2": (2, 1, 0, 0), "Ra_ohm": (-2, -1, 3, 2),
    "ka_NmpA": (0, 0, 1, 1), "kb_Vsprad": (0, 0, 1, 1), "Be_Nmsprad": (2, 1, -1, 0),
    "kPT_Vspm": (-1, 0, 1, 1), "kPR_Vsprad": (0, 0, 1, 1), "kDT_Vs2pm": (-1, 0, 2, 1), "kDR_Vs2prad": (0, 0, 2, 1),
}  # fmt: skip
PRINTED_UNITS = [(0, 0, 2, 1), (2, 0, 2, 1), (-1, 0, 2, 1), (0, 0, 1, 1)]  # of (2)-(5)
THETA_UNITS = [(0, 0, 1, 0), (0, 0, 1, 0), (1, 0, 1, 0), (0, 0, 0, 0), (-1, 0, 1, 0), (0, 0, 0, 0)]  # of (12)-(17)


@pytest.mark.parametrize("which", range(4), ids=["metre", "kilogram", "second", "volt"])
def test_equations_2_to_5_and_12_to_17_have_the_units_printed_beside_them(which: int) -> None:
    """With another metre, kilogram, second or volt every value follows its unit; Be as N m s/rad, not N s/rad."""
    smaller = {name: getattr(DIFFERENT, name) * 7.0 ** unit[which] for name, unit in UNITS.items()}
    assert list(smaller) == [f.name for f in fields(MotorConstants)]
    for of, units in ((voltage_theta_of, PRINTED_UNITS), (theta_of, THETA_UNITS)):
        factors = [7.0 ** unit[which] for unit in units]
        np.testing.assert_allclose(astuple(of(MotorConstants(**smaller))), astuple(of(DIFFERENT)) * np.array(factors))


def test_equations_12_to_17_for_the_representative_robot() -> None:
    expected = [0.515937, 0.0809978, -0.000235994, 1.227710, -0.00148470, 1.039239]
    np.testing.assert_allclose(astuple(theta_of(REPRESENTATIVE)), expected, rtol=3e-6)


def test_equation_12_without_its_bracket_is_another_robot() -> None:
    """As printed theta_1 adds V s^2 to s: 0.624 where this robot's lag is 0.516 s."""
    r, t = REPRESENTATIVE.r_m, voltage_theta_of(REPRESENTATIVE)
    printed = t.t1 + 2 * r * REPRESENTATIVE.kDT_Vs2pm / (2 * r * REPRESENTATIVE.kPT_Vspm)
    assert printed == pytest.approx(0.624, abs=5e-4)
    assert theta_of(REPRESENTATIVE).t1 == pytest.approx(0.516, abs=5e-4)


def tie(theta: Theta) -> float:
    """What (14)-(17) make 4/d^2 for every physical motors."""
    return (theta.t4 - 1) * theta.t5 / ((theta.t6 - 1) * theta.t3)


def test_equations_14_to_17_tie_four_parameters_to_the_track_and_the_printed_theta_breaks_the_tie() -> None:
    factors = 3 ** np.random.default_rng(3).uniform(-1, 1, (20, len(UNITS)))
    for by in factors:
        motors = scaled(by)
        assert tie(theta_of(motors)) == pytest.approx(4 / motors.d_m**2, rel=1e-9)
    assert 4 / REPRESENTATIVE.d_m**2 == pytest.approx(36.509, abs=5e-4)
    assert tie(THETAS["pioneer_3dx_paper"]) == pytest.approx(-4.69, abs=0.005)


def test_equation_15_cannot_give_the_printed_theta_4_with_any_motor() -> None:
    """Friction, back voltage and gains only ever add to 1: the printed 0.9560 is a fit to measured runs."""
    for by in 10 ** np.random.default_rng(4).uniform(-2, 2, (50, len(UNITS))):
        theta = theta_of(scaled(by))
        assert min(theta.t4, theta.t6) >= 1 > THETAS["pioneer_3dx_paper"].t4
