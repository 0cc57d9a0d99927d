"""The integrators keep their order, also where references jump from period to period."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.robot.integrate import Rates, over_period
from vobench.robot.pioneer import THETAS, accelerations, velocities

THETA = THETAS["pioneer_3dx_paper"]
PERIOD_S = 1 / 30


def robot(u_ref: float, omega_ref: float) -> Rates:
    """Equations (18)-(19) for the state x, y, psi, u, omega."""

    def rates(state: Array) -> Array:
        _, _, psi, u, omega = state.tolist()
        pose = velocities(psi, u, omega, a_m=0.2)
        return np.array([*pose, *accelerations(u, omega, u_ref, omega_ref, theta=THETA)])

    return rates


@pytest.fixture(scope="module")
def jumps() -> Array:
    """Two seconds of random references at 30 Hz, (60, 2)."""
    return np.random.default_rng(7).uniform([-0.75, -1.745], [0.75, 1.745], (60, 2))


@pytest.fixture(scope="module")
def truth(jumps: Array) -> Array:
    """The state after them, by an integrator of order 8 that restarts at every jump."""
    state = np.zeros(5)
    for reference in jumps:
        f = robot(*reference)
        state = solve_ivp(lambda _, s, f=f: f(s), (0, PERIOD_S), state, method="DOP853", rtol=1e-13, atol=1e-14).y[
            :, -1
        ]
    return state


def after(jumps: Array, *, substeps: int, integrator: str) -> Array:
    state = np.zeros(5)
    for reference in jumps:
        state = over_period(robot(*reference), state, period_s=PERIOD_S, substeps=substeps, integrator=integrator)[-1]
    return state


@pytest.mark.parametrize(("integrator", "order"), [("rk4", 4), ("euler", 1)])
def test_the_measured_order_of_convergence_is_the_stated_one(
    jumps: Array, truth: Array, integrator: str, order: int
) -> None:
    counts = np.array([1, 2, 4, 8])
    errors = [np.linalg.norm(after(jumps, substeps=n, integrator=integrator) - truth) for n in counts]
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert -slope == pytest.approx(order, abs=0.2)


def test_four_runge_kutta_steps_a_frame_agree_with_order_eight_to_nanometres(jumps: Array, truth: Array) -> None:
    np.testing.assert_allclose(after(jumps, substeps=4, integrator="rk4"), truth, atol=1e-8)


def test_the_last_substep_ends_the_period_and_the_first_is_a_period_of_its_own() -> None:
    f, start = robot(0.5, 1.0), np.array([0.0, 0.0, 0.0, 0.2, 0.1])
    states = over_period(f, start, period_s=0.4, substeps=4)
    np.testing.assert_array_equal(states[0], over_period(f, start, period_s=0.1, substeps=1)[0])
    assert states.shape == (4, 5)


def test_an_unknown_integrator_is_named_with_the_known_ones() -> None:
    with pytest.raises(MotionError, match=r"'heun'.*rk4, euler"):
        over_period(robot(0, 0), np.zeros(5), period_s=0.1, substeps=1, integrator="heun")
