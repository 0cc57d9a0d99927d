"""The paper's point controller, equations (20)-(21), and limits that keep the path's shape.

u_ref, omega_ref   references for forward speed (m/s) and yaw rate (rad/s)
k, l               gain (1/s) near the target, and speed (m/s) that each axis tends to far from it
a                  distance (m) from the axle to the controlled point h
"""

from dataclasses import dataclass
from math import cos, inf, isfinite, sin, tanh

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.robot.integrate import over_period
from vobench.robot.pioneer import Theta


@dataclass(frozen=True, slots=True)
class ControllerSettings:
    """Gains of (20)-(21), the same on both axes as in the paper, and the largest references given.

    Raises MotionError where a value is not positive (only the two limits may be infinite).
    """

    gain_per_s: float
    axis_speed_mps: float
    a_m: float = 0.2
    max_speed_mps: float = inf
    max_turn_radps: float = inf

    def __post_init__(self) -> None:
        for name in ("gain_per_s", "axis_speed_mps", "a_m", "max_speed_mps", "max_turn_radps"):
            value = getattr(self, name)
            if not value > 0 or not (isfinite(value) or name.startswith("max_")):
                raise MotionError(f"the controller's {name} must be positive and finite, got {value}")


# The paper gives gains of 10 and "max velocities" without numbers: .75 m/s and 100 deg/s are its toolbox's defaults.
CONTROLLERS = {
    "paper": ControllerSettings(10.0, 10.0, max_speed_mps=0.75, max_turn_radps=1.745),
    "smooth": ControllerSettings(0.8, 0.5, max_speed_mps=0.75, max_turn_radps=1.745),
    "easy": ControllerSettings(0.4, 0.4, max_speed_mps=0.5, max_turn_radps=1.0),
}


def references(
    error_x_m: float,
    error_y_m: float,
    psi: float,
    settings: ControllerSettings,
    *,
    path_mps: tuple[float, float] = (0.0, 0.0),
) -> tuple[float, float]:
    """u_ref in m/s and omega_ref in rad/s of (20)-(21), for the error target minus current position of h.

    `path_mps` is the velocity of a target that moves, added to what (20) asks for on each axis. Both are
    divided by one factor where either is over its limit: the direction in which h moves, and so the
    straightness of a leg, survives.
    """
    k, l, a = settings.gain_per_s, settings.axis_speed_mps, settings.a_m  # noqa: E741 - the paper's letter
    v_x, v_y = path_mps[0] + l * tanh(k * error_x_m / l), path_mps[1] + l * tanh(k * error_y_m / l)
    u_ref = v_x * cos(psi) + v_y * sin(psi)
    omega_ref = (v_y * cos(psi) - v_x * sin(psi)) / a
    excess = max(1.0, abs(u_ref) / settings.max_speed_mps, abs(omega_ref) / settings.max_turn_radps)
    return u_ref / excess, omega_ref / excess


def loop_growth(gain_per_s: float, theta: Theta | None, *, period_s: float, substeps: int, integrator: str) -> float:
    """How much a small error near the target grows in one control period; stable below 1.

    The loop, linear there, falls into two of one form, independent of a: error' = -v, lag v' = k error - drag v.
    With one Euler step a period this is 1 exactly where k = drag / period. Without a theta v runs evenly to
    k error within the period.
    """
    # lag v' = k error - drag v - keep v0, where v0 is the speed at the period's start.
    axes = [(period_s, 0.0, 1.0)] if theta is None else [(theta.t1, theta.t4, 0.0), (theta.t2, theta.t6, 0.0)]
    return max(
        _axis_growth(gain_per_s, *axis, period_s=period_s, substeps=substeps, integrator=integrator) for axis in axes
    )


def settling_gain(gain_per_s: float, theta: Theta | None, *, period_s: float, substeps: int, integrator: str) -> float:
    """The gain below which the loop of `loop_growth` is stable, 1/s, where `gain_per_s` is one that is not."""

    def is_stable(k: float) -> bool:
        return loop_growth(k, theta, period_s=period_s, substeps=substeps, integrator=integrator) < 1

    low, high = 0.0, gain_per_s
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if is_stable(middle) else (low, middle)
    return low


def _axis_growth(
    k: float, lag_s: float, drag: float, keep: float, *, period_s: float, substeps: int, integrator: str
) -> float:
    """Spectral radius of one axis: error and speed, with the error that the controller saw held over the period."""

    def rates(state: Array) -> Array:
        _, speed, seen_error, seen_speed = state
        return np.array([-speed, (k * seen_error - drag * speed - keep * seen_speed) / lag_s, 0.0, 0.0])

    def after(error: float, speed: float) -> Array:
        start = np.array([error, speed, error, speed])
        return over_period(rates, start, period_s=period_s, substeps=substeps, integrator=integrator)[-1, :2]

    period_map = np.stack([after(1.0, 0.0), after(0.0, 1.0)], -1)
    return float(np.abs(np.linalg.eigvals(period_map)).max())
