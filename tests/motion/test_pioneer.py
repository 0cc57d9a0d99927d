"""The robot's equations, integrated to their stated order, within limits of acceleration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.controller import CONTROLLERS
from vobench.motion.drive import Drive, drive
from vobench.motion.pioneer import (
    THETAS,
    UNLIMITED,
    AccelerationLimits,
    Rates,
    Theta,
    accelerations,
    feed_forward,
    over_period,
    velocities,
    wheel_speeds,
)

THETA = THETAS["pioneer_3dx_paper"]
PERIOD_S = 1 / 30


def robot(u_ref: float, omega_ref: float, theta: Theta = THETA) -> Rates:
    """Equations (18)-(19) for the state x, y, psi, u, omega."""

    def rates(state: Array) -> Array:
        _, _, psi, u, omega = state.tolist()
        pose = velocities(psi, u, omega, a_m=0.2)
        return np.array([*pose, *accelerations(u, omega, u_ref, omega_ref, theta=theta)])

    return rates


@pytest.fixture(scope="module")
def jumps() -> Array:
    """Two seconds of random references at 30 Hz, (60, 2)."""
    return np.random.default_rng(7).uniform([-0.75, -1.745], [0.75, 1.745], (60, 2))


def of_order_eight(held: Array, period_s: float, theta: Theta = THETA) -> Array:
    """States (periods + 1, 5) by DOP853, which starts anew wherever the references jump."""
    states = [np.zeros(5)]
    for reference in held:
        f = robot(*reference, theta)
        end = solve_ivp(lambda _, s, f=f: f(s), (0, period_s), states[-1], method="DOP853", rtol=1e-12, atol=1e-14)
        states.append(end.y[:, -1])
    return np.array(states)


@pytest.fixture(scope="module")
def truth(jumps: Array) -> Array:
    """The state after them."""
    return of_order_eight(jumps, PERIOD_S)[-1]


def after(jumps: Array, *, substeps: int, integrator: str, theta: Theta = THETA) -> Array:
    state = np.zeros(5)
    for reference in jumps:
        state = over_period(
            robot(*reference, theta), state, period_s=PERIOD_S, substeps=substeps, integrator=integrator
        )[-1]
    return state


@pytest.mark.parametrize(("integrator", "order"), [("rk4", 4), ("euler", 1)])
def test_the_measured_order_of_convergence_is_the_stated_one(
    jumps: Array, truth: Array, integrator: str, order: int
) -> None:
    counts = np.array([1, 2, 4, 8])
    errors = [np.linalg.norm(after(jumps, substeps=n, integrator=integrator) - truth) for n in counts]
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert -slope == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize(("substeps", "apart"), [(16, 1e-9), (4, 1e-6)])
@pytest.mark.parametrize("held", [(0.75, 1.745), (0.5, 0.0), (0.0, 1.0), (-0.4, -1.2)])
def test_ten_seconds_of_held_references_agree_with_order_eight(
    held: tuple[float, float], substeps: int, apart: float
) -> None:
    f, states = robot(*held), [np.zeros(5)]
    for _ in range(300):
        states.append(over_period(f, states[-1], period_s=PERIOD_S, substeps=substeps)[-1])
    frames_s = np.arange(301) * PERIOD_S
    exact = solve_ivp(lambda _, s: f(s), (0, 10), states[0], "DOP853", frames_s, rtol=1e-12, atol=1e-14).y.T
    np.testing.assert_allclose(states, exact, rtol=0, atol=apart)


def three_hundred_frames(name: str, substeps: int) -> Drive:
    """A drive through waypoints, long enough."""
    path = [(1, 1), (0, 1), (1, 0), (2, 2), (0, 0)]
    return drive(path, theta=THETA, controller=CONTROLLERS[name], substeps=substeps)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_three_hundred_frames_of_control_agree_with_order_eight(name: str) -> None:
    """The controller's references of the finer drive, held over each frame, are given to DOP853."""
    fine, default = three_hundred_frames(name, 16), three_hundred_frames(name, 4)
    exact = of_order_eight(fine.references[:300], PERIOD_S)
    np.testing.assert_allclose(fine.state[:301], exact, rtol=0, atol=1e-9)
    np.testing.assert_allclose(default.state[:301], exact, rtol=0, atol=1e-6)


def test_the_default_number_of_substeps_agrees_with_order_eight_where_references_jump(
    jumps: Array, truth: Array
) -> None:
    np.testing.assert_allclose(after(jumps, substeps=4, integrator="rk4"), truth, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", THETAS)
def test_sixteen_substeps_serve_every_robot_of_the_table_also_those_that_lag_by_20_ms(name: str, jumps: Array) -> None:
    exact = of_order_eight(jumps, PERIOD_S, THETAS[name])[-1]
    found = after(jumps, substeps=16, integrator="rk4", theta=THETAS[name])
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-6)


def test_the_last_substep_ends_the_period_and_the_first_is_a_period_of_its_own() -> None:
    f, start = robot(0.5, 1.0), np.array([0.0, 0.0, 0.0, 0.2, 0.1])
    states = over_period(f, start, period_s=0.4, substeps=4)
    np.testing.assert_array_equal(states[0], over_period(f, start, period_s=0.1, substeps=1)[0])
    assert states.shape == (4, 5)


COURSE = ((1, 1), (0, 1))
TIGHT = AccelerationLimits(0.3, 1.0)
# Source: block defaults of Martins' Simulink toolbox. From .75 m/s they need .94 m to stop.
TOOLBOX = AccelerationLimits(0.3, 1.745)


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("ideal", [False, True])
def test_no_acceleration_is_over_its_limit(controller: str, ideal: bool) -> None:
    options = {"theta": None} if ideal else {}
    run = drive(COURSE, controller=CONTROLLERS[controller], limits=TIGHT, **options)
    rate = np.diff(run.state[:, 3:], axis=0) * 30
    assert (np.abs(rate) <= np.array([0.3, 1.0]) * (1 + 1e-9)).all()
    assert np.abs(rate).max(0) == pytest.approx([0.3, 1.0])


def test_limits_that_are_never_reached_change_nothing_to_the_last_bit() -> None:
    np.testing.assert_array_equal(drive(COURSE, limits=AccelerationLimits(1e3, 1e3)).state, drive(COURSE).state)


def test_for_arrays_they_are_the_same_as_for_one_instant() -> None:
    rates = np.random.default_rng(0).uniform(-2, 2, (2, 20))
    held = np.array(TIGHT.held(*rates))
    np.testing.assert_array_equal(held.T, [TIGHT.held(u, w) for u, w in rates.T.tolist()])
    assert UNLIMITED.held(3.0, -4.0) == (3.0, -4.0)


def test_errors_still_fall_with_the_step_as_its_square_or_faster() -> None:
    ends = {n: drive(COURSE, limits=TOOLBOX, substeps=n, leg_s=3.0).state for n in (1, 8, 64)}
    coarse, fine = (np.abs(ends[n] - ends[64]).max() for n in (1, 8))
    assert fine < coarse / 8**2
    assert fine < 1e-5


@pytest.mark.parametrize("bad", [(0.0, 1.0), (1.0, -1.0), (float("nan"), 1.0)])
def test_a_limit_that_is_not_positive_is_refused(bad: tuple[float, float]) -> None:
    with pytest.raises(MotionError, match=r"acceleration limit .* must be positive"):
        AccelerationLimits(*bad)


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


def test_both_wheels_of_a_robot_that_turns_on_the_spot_run_oppositely() -> None:
    assert wheel_speeds(0.0, 2.0, track_m=0.331) == (-0.331, 0.331)


@pytest.mark.parametrize(("name", "value"), [("t1", 0.0), ("t2", -0.2), ("t3", float("nan")), ("t6", float("inf"))])
def test_a_theta_without_finite_values_and_positive_lags_is_refused(name: str, value: float) -> None:
    with pytest.raises(MotionError, match="six finite values with positive lags"):
        replace(THETAS["pioneer_3dx"], **{name: value})
