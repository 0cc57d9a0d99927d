"""Fixed-step integration of an autonomous system, with its inputs held over each control period."""

from collections.abc import Callable

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array

Rates = Callable[[Array], Array]


def euler(rates: Rates, state: Array, step_s: float) -> Array:
    """One explicit Euler step, order 1: what the paper's 33 ms script does."""
    return state + step_s * rates(state)


def rk4(rates: Rates, state: Array, step_s: float) -> Array:
    """One classical Runge-Kutta step, order 4 (Kutta, 1901)."""
    k1 = rates(state)
    k2 = rates(state + step_s / 2 * k1)
    k3 = rates(state + step_s / 2 * k2)
    k4 = rates(state + step_s * k3)
    return state + step_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


INTEGRATORS = {"rk4": rk4, "euler": euler}


def integrator_named(name: str) -> Callable[[Rates, Array, float], Array]:
    """The step function of that name. Raises MotionError where there is none."""
    if name not in INTEGRATORS:
        raise MotionError(f"no integrator named {name!r}. Known: {', '.join(INTEGRATORS)}")
    return INTEGRATORS[name]


def over_period(rates: Rates, state: Array, *, period_s: float, substeps: int, integrator: str = "rk4") -> Array:
    """States (substeps, n) at the end of every sub-step of one period; the last is the period's end.

    `rates` must be smooth over the period: change the inputs between periods, never inside one,
    and the method keeps its order.
    """
    step = integrator_named(integrator)
    states = np.empty((substeps, len(state)))
    for i in range(substeps):
        states[i] = state = step(rates, state, period_s / substeps)
    return states
