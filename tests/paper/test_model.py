"""Equations (11), (18) and (19): the identified model, its printed form, and the laws that it keeps."""

from dataclasses import astuple, replace

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.pioneer import THETAS, Theta, accelerations, over_period, velocities

AS_PRINTED = THETAS["pioneer_3dx_paper"]
A_M = 0.2
EVERY_THETA = pytest.mark.parametrize("theta", THETAS.values(), ids=THETAS.keys())
NOWS = np.random.default_rng(1).uniform(-1, 1, (20, 5)).tolist()


def moved(state: Array, u_ref: float, omega_ref: float, theta: Theta) -> Array:
    """Time derivative (5,) of x, y, psi, u, omega."""
    _, _, psi, u, omega = state.tolist()
    return np.array([*velocities(psi, u, omega, a_m=A_M), *accelerations(u, omega, u_ref, omega_ref, theta=theta)])


def held(
    u_ref: float, omega_ref: float, *, seconds: float, theta: Theta = AS_PRINTED, start: Array | None = None
) -> Array:
    """States (200 seconds, 5) after each 5 ms under constant references, from rest at the origin or from `start`."""
    state = np.zeros(5) if start is None else start
    steps = round(200 * seconds)
    return over_period(lambda now: moved(now, u_ref, omega_ref, theta), state, period_s=seconds, substeps=steps)


@EVERY_THETA
def test_equation_11_in_the_papers_matrix_form_mended(theta: Theta) -> None:
    t1, t2, t3, t4, t5, t6 = astuple(theta)
    for psi, u, omega, u_ref, omega_ref in NOWS:
        matrix = [
            [np.cos(psi), -A_M * np.sin(psi)],
            [np.sin(psi), A_M * np.cos(psi)],
            [0, 1],
            [-t4 / t1, t3 / t1 * omega],
            [-t5 / t2 * omega, -t6 / t2],
        ]
        inputs = [[0, 0], [0, 0], [0, 0], [1 / t1, 0], [0, 1 / t2]]
        expected = np.array(matrix) @ [u, omega] + np.array(inputs) @ [u_ref, omega_ref]
        found = moved(np.array([3, 4, psi, u, omega]), u_ref, omega_ref, theta)
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12)


def test_equation_11_as_printed_would_turn_a_robot_that_is_sent_straight_ahead() -> None:
    t1, t2, _, _, t5, t6 = astuple(AS_PRINTED)
    u, omega, u_ref, omega_ref = 0.5, 0.0, 0.5, 0.0
    without_omega = -t5 / t2 * u - t6 / t2 * omega + omega_ref / t2
    with_u_ref = -t5 / t2 * omega * u - t6 / t2 * omega + u_ref / t1 + omega_ref / t2
    assert accelerations(u, omega, u_ref, omega_ref, theta=AS_PRINTED)[1] == 0
    assert without_omega == pytest.approx(0.168, abs=1e-3)
    assert with_u_ref == pytest.approx(0.937, abs=1e-3)


def test_equation_18_in_the_papers_matrix_form() -> None:
    t1, t2, t3, t4, t5, t6 = astuple(AS_PRINTED)
    for _, u, omega, u_ref, omega_ref in NOWS:
        matrix = np.array([[-t4 / t1, t3 / t1 * omega], [-t5 / t2 * omega, -t6 / t2]])
        expected = matrix @ [u, omega] + np.diag([1 / t1, 1 / t2]) @ [u_ref, omega_ref] + [0.3, -0.2]
        found = accelerations(u, omega, u_ref, omega_ref, theta=AS_PRINTED, delta=(0.3, -0.2))
        np.testing.assert_allclose(found, expected, atol=1e-14)


@EVERY_THETA
def test_equation_18_on_a_straight_line_is_a_first_order_lag(theta: Theta) -> None:
    states = held(0.5, 0.0, seconds=1.0, theta=theta)
    x, y, psi, u, omega = states.T
    final, lag, t = 0.5 / theta.t4, theta.t1 / theta.t4, np.arange(1, 201) / 200
    runge_kutta = final * (0.005 / lag) ** 4 / 120 + 1e-13  # the most that its order leaves of a lag
    np.testing.assert_allclose(u, final * -np.expm1(-t / lag), rtol=0, atol=runge_kutta)
    np.testing.assert_allclose(x, final * (t + lag * np.expm1(-t / lag)), rtol=0, atol=runge_kutta)
    assert not np.any([y, psi, omega])


def test_equation_18_after_a_second_straight_ahead_with_the_printed_theta() -> None:
    x, _, _, u, _ = held(0.5, 0.0, seconds=1.0)[-1]
    assert (x, u) == (pytest.approx(0.279691483417, abs=1e-11), pytest.approx(0.435771715724, abs=1e-11))


STEADY = [
    ((0.75, 1.745), (0.741536178556, 1.751149160017)),
    ((0.5, 0.5), (0.519612492557, 0.492515407421)),
    ((0.0, 1.0), (-0.012473632767, 0.943350369582)),
]


@pytest.mark.parametrize("theta", [AS_PRINTED, THETAS["pioneer_3dx"]], ids=["as printed", "mended"])
@pytest.mark.parametrize(("asked", "settled"), STEADY)
def test_equation_18_settles_in_a_turn_where_speed_and_turn_depend_on_each_other(
    theta: Theta, asked: tuple[float, float], settled: tuple[float, float]
) -> None:
    u, omega = held(*asked, seconds=18.0, theta=theta)[-1, 3:]
    assert theta.t4 * u == pytest.approx(asked[0] + theta.t3 * omega**2, abs=1e-10)
    assert (theta.t6 + theta.t5 * u) * omega == pytest.approx(asked[1], abs=1e-10)
    assert (u, omega) == (pytest.approx(settled[0], abs=1e-10), pytest.approx(settled[1], abs=1e-10))


@EVERY_THETA
def test_equation_18_steady_turning_solves_its_cubic(theta: Theta) -> None:
    u_ref, omega_ref = 0.5, -0.6
    cubic = [theta.t5 * theta.t3 / theta.t4, 0.0, theta.t6 + theta.t5 * u_ref / theta.t4, -omega_ref]
    u, omega = held(u_ref, omega_ref, seconds=30.0, theta=theta)[-1, 3:]
    assert np.polyval(cubic, omega) == pytest.approx(0, abs=1e-10)
    assert u == pytest.approx((u_ref + theta.t3 * omega**2) / theta.t4, abs=1e-10)


def test_equation_18_asked_to_turn_on_the_spot_backs_up_in_a_small_circle() -> None:
    states = held(0.0, 1.0, seconds=24.0)[-1600:]  # more than one full turn at the end
    h, psi = states[:, :2], states[:, 2]
    B = h - A_M * np.stack([np.cos(psi), np.sin(psi)], -1)

    def radius(path: Array) -> float:
        a, c = np.stack([*path.T, np.ones(len(path))], -1), (path**2).sum(1)
        x, y, rest = np.linalg.lstsq(a, c, rcond=None)[
            0
        ]  # a circle: x^2 + y^2 = 2 x_c x + 2 y_c y + R^2 - x_c^2 - y_c^2
        return float(np.sqrt(rest + (x**2 + y**2) / 4))

    assert radius(B) == pytest.approx(0.013223, abs=1e-6)
    assert radius(h) == pytest.approx(0.200437, abs=1e-6)
    assert (states[:, 3] < 0).all()


def test_equation_18_turns_truly_on_the_spot_when_it_is_asked_for_what_the_coupling_takes() -> None:
    omega = 0.9
    u_rate, omega_rate = accelerations(0, omega, -AS_PRINTED.t3 * omega**2, AS_PRINTED.t6 * omega, theta=AS_PRINTED)
    assert (u_rate, omega_rate) == (pytest.approx(0, abs=1e-15), pytest.approx(0, abs=1e-15))


@EVERY_THETA
def test_equation_18_its_coupling_neither_makes_nor_takes_energy(theta: Theta) -> None:
    c = theta.t3 / theta.t5
    for _, u, omega, u_ref, omega_ref in NOWS:
        du, dw = accelerations(u, omega, u_ref, omega_ref, theta=theta)
        stored = theta.t1 * u * du + c * theta.t2 * omega * dw
        supplied = u * u_ref + c * omega * omega_ref - theta.t4 * u**2 - c * theta.t6 * omega**2
        assert stored == pytest.approx(supplied, abs=1e-10)


def test_equation_18_with_the_printed_theta_is_passive_and_with_four_fitted_ones_that_proof_fails() -> None:
    weight = {name: theta.t3 / theta.t5 for name, theta in THETAS.items()}
    assert weight["pioneer_3dx_paper"] == pytest.approx(0.15896, abs=5e-6)
    unproven = {name for name, c in weight.items() if c < 0}
    assert unproven == {"pioneer_3dx_laser", "pioneer_2_computer", "wheelchair_55kg", "khepera_3"}


def test_equation_18_in_martins_form_damps_at_every_speed_the_robot_can_reach() -> None:
    """H v' + C v + F v = v_ref with C skew; F is positive up to 14.9 m/s for the printed set."""
    t1, t2, t3, t4, t5, t6 = astuple(AS_PRINTED)
    for _, u, omega, u_ref, omega_ref in NOWS:
        rate = np.array(accelerations(u, omega, u_ref, omega_ref, theta=AS_PRINTED))
        skew = np.array([[0, -t3 * omega], [t3 * omega, 0]])
        damping = np.diag([t4, t6 + (t5 - t3) * u])
        found = np.diag([t1, t2]) @ rate + (skew + damping) @ [u, omega]
        np.testing.assert_allclose(found, [u_ref, omega_ref], atol=1e-14)
    assert t6 / (t3 - t5) == pytest.approx(14.9, abs=0.05)


def test_equation_18_and_19_mirror_exactly() -> None:
    ahead, mirrored = held(0.4, 0.8, seconds=2.0), held(0.4, -0.8, seconds=2.0)
    np.testing.assert_array_equal(mirrored, ahead * [1, -1, -1, 1, -1])


def test_equation_18_and_19_do_the_same_from_any_start() -> None:
    angle, shift = 2.1, np.array([3.0, -1.0])
    here = held(0.4, 0.8, seconds=2.0)
    there = held(0.4, 0.8, seconds=2.0, start=np.array([*shift, angle, 0.0, 0.0]))
    R = se3.rotation_z(angle)[:2, :2]
    np.testing.assert_allclose(there[:, :2], here[:, :2] @ R.T + shift, atol=1e-13)
    np.testing.assert_allclose(there[:, 2], here[:, 2] + angle, atol=1e-13)
    np.testing.assert_array_equal(there[:, 3:], here[:, 3:])


def test_equation_19_in_the_papers_matrix_form() -> None:
    for psi, u, omega, side, _ in NOWS:
        matrix = np.array([[np.cos(psi), -A_M * np.sin(psi)], [np.sin(psi), A_M * np.cos(psi)], [0, 1]])
        expected = matrix @ [u, omega] + [-side * np.sin(psi), side * np.cos(psi), 0]
        np.testing.assert_allclose(velocities(psi, u, omega, a_m=A_M, side_mps=side), expected, atol=1e-15)


def test_equation_19_moves_the_axle_only_along_the_heading() -> None:
    """The rolling constraint of B, a behind h: -sin(psi) x_B' + cos(psi) y_B' = 0."""
    for psi, u, omega, _, _ in NOWS:
        x_rate, y_rate, _ = velocities(psi, u, omega, a_m=A_M)
        B_rate = np.array([x_rate + A_M * omega * np.sin(psi), y_rate - A_M * omega * np.cos(psi)])
        assert -np.sin(psi) * B_rate[0] + np.cos(psi) * B_rate[1] == pytest.approx(0, abs=1e-15)
        assert np.cos(psi) * B_rate[0] + np.sin(psi) * B_rate[1] == pytest.approx(u, abs=1e-15)


def test_the_printed_theta_mixes_the_robot_with_and_without_its_laser() -> None:
    printed, bare, laser = THETAS["pioneer_3dx_paper"], THETAS["pioneer_3dx"], THETAS["pioneer_3dx_laser"]
    assert astuple(printed) == (0.5338, 0.2509, -0.0134, 0.9560, -0.0843, 1.0590)
    assert replace(printed, t2=bare.t2) == bare
    assert printed.t2 == laser.t2 != bare.t2
