"""Finding what a lens function was given: Newton's method that arrives, or says that it did not."""

from collections.abc import Callable

import numpy as np

from vobench.geometry.se3 import Array

TOLERANCE = 1e-13  # of a focal length: 1e-10 px
KNOTS = 1025
MOST_STEPS = 60

Plane = Callable[[Array, Array], tuple[Array, Array, Array, Array, Array]]


def rising_root(g: Callable[[Array], Array], slope: Callable[[Array], Array], target: Array, limit: float) -> Array:
    """The x (N,) in [0, limit] with g(x) = target, for a g that rises from g(0) = 0; NaN where there is none.

    A table brackets each root, and a Newton step that leaves its bracket becomes a bisection.
    """
    knots = np.linspace(0.0, limit, KNOTS)
    values = g(knots)
    reached = (target >= 0) & (target <= values[-1])
    target = np.where(reached, target, 0.0)
    above = np.searchsorted(values, target).clip(1, KNOTS - 1)
    low, high = knots[above - 1], knots[above]
    x = np.interp(target, values, knots)
    for _ in range(MOST_STEPS):
        error = g(x) - target
        if np.abs(error).max(initial=0.0) <= TOLERANCE:
            break
        low, high = np.where(error > 0, low, x), np.where(error > 0, x, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = x - error / slope(x)
        x = np.where((step >= low) & (step <= high), step, (low + high) / 2)
    return np.where(reached, x, np.nan)


def plane_root(f: Plane, target: tuple[Array, Array], start: tuple[Array, Array], limit: float) -> Array:
    """The places (2, N) within `limit` of the origin that f sends to the target; NaN where there are none.

    `f` gives its value and the distinct entries xx, xy, yy of its symmetric Jacobian, which is positive
    within the limit. So every Newton step points downhill, and is halved until it gets there.
    """
    x, goal = np.stack(start), np.stack(target)
    state, share, left = _missed(f, x, goal), np.ones(x.shape[1]), np.arange(x.shape[1])
    enough = TOLERANCE * np.maximum(1.0, np.hypot(*goal))
    for _ in range(MOST_STEPS):
        left = left[state[0, left] > enough[left]]
        if not len(left):
            break
        trial = x[:, left] - share[left] * _newton_step(state[:, left])
        trial_state = _missed(f, trial, goal[:, left])
        better = (trial_state[0] < state[0, left]) & (np.hypot(*trial) <= limit)
        x[:, left[better]], state[:, left[better]] = trial[:, better], trial_state[:, better]
        share[left] = np.where(better, 1.0, share[left] / 2)
    return np.where(state[0] <= enough, x, np.nan)


def _missed(f: Plane, x: Array, goal: Array) -> Array:
    """How far, right and down f misses the goal, and its Jacobian's xx, xy, yy: rows of (6, N)."""
    u, v, *jacobian = f(*x)
    u, v = u - goal[0], v - goal[1]
    return np.stack([np.hypot(u, v), u, v, *jacobian])


def _newton_step(state: Array) -> Array:
    _, u, v, xx, xy, yy = state
    step: Array = np.stack([yy * u - xy * v, xx * v - xy * u]) / (xx * yy - xy * xy)
    return step
