"""The integrators keep their order, also where references jump from period to period."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.robot.controller import CONTROLLERS
from vobench.robot.drive import Drive, drive
from vobench.robot.integrate import Rates, over_period
from vobench.robot.pioneer import THETAS, Theta, accelerations, velocities

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


def test_an_unknown_integrator_is_named_with_the_known_ones() -> None:
    with pytest.raises(MotionError, match=r"'heun'.*rk4, euler"):
        over_period(robot(0, 0), np.zeros(5), period_s=0.1, substeps=1, integrator="heun")
