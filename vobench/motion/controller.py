"""The paper's point controller (20)-(21), its limits, and the targets it is led to."""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, cos, inf, isfinite, sin, tanh
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Le

from vobench.errors import MotionError
from vobench.geometry.rig import WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion.pioneer import (
    INTEGRATORS,
    UNLIMITED,
    AccelerationLimits,
    Number,
    Pair,
    Theta,
    accelerations,
    over_period,
    velocities,
    wheel_speeds,
)
from vobench.motion.slip import SlipNow
from vobench.setting import OneOf, Positive, require


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
    error_x_m: float, error_y_m: float, psi: float, settings: ControllerSettings, *, path_mps: Pair[float] = (0.0, 0.0)
) -> Pair[float]:
    """u_ref in m/s and omega_ref in rad/s of (20)-(21), for the error target minus current position of h.

    `path_mps` is the velocity of a target that moves, added to what (20) asks for on each axis. Both are
    divided by one factor where either is over its limit: the direction in which h moves, and so the
    straightness of a leg, survives.
    """
    k = settings.gain_per_s
    l = settings.axis_speed_mps  # noqa: E741 - the paper's letter
    a = settings.a_m
    v_x = path_mps[0] + l * tanh(k * error_x_m / l)
    v_y = path_mps[1] + l * tanh(k * error_y_m / l)
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


def settling_gain(gain_per_s: float, growth: Callable[[float], float]) -> float:
    """The gain below which the loop of this growth is stable, 1/s, where `gain_per_s` is one that is not."""
    low = 0.0
    high = gain_per_s
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if growth(middle) < 1 else (low, middle)
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


# Beyond this (m, m/s, rad) the equations have run away: no room is so large and no wheel so fast.
BOUND = 1e6
# What is slower or faster is a slip of the pen, and would fill the memory.
LONGEST_LEG_S = 3600.0
FASTEST_HZ = 1e4
LegTime = Annotated[float, Gt(0), Le(LONGEST_LEG_S)]


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A robot, its controller, and how finely time is cut.

    The state is (7,): x, y of h in m, psi in rad, u in m/s, omega in rad/s, left and right rim in rad.
    Without a theta it is the ideal unicycle: within a control period its speeds run evenly to what is asked.
    Raises MotionError where the closed loop would not settle on a target.
    """

    theta: Theta | None
    controller: ControllerSettings
    wheels: WheelGeometry
    rate_hz: Annotated[float, Gt(0), Le(FASTEST_HZ)]
    substeps: Annotated[int, Ge(1)]
    integrator: Annotated[str, OneOf("integrator", INTEGRATORS)]
    limits: AccelerationLimits = UNLIMITED

    def __post_init__(self) -> None:
        require(self)
        k = self.controller.gain_per_s
        cut: Any = {"period_s": 1 / self.rate_hz, "substeps": self.substeps, "integrator": self.integrator}
        if loop_growth(k, self.theta, **cut) > 1 - 1e-9:
            limit = settling_gain(k, lambda gain_per_s: loop_growth(gain_per_s, self.theta, **cut))
            cure = (
                f"take a gain below {limit:.3g} or a higher rate_hz"
                if limit > 1e-6
                else "no gain does; raise rate_hz or substeps"
            )
            raise MotionError(
                f"gain_per_s {k:g} at {self.rate_hz:g} Hz with {self.integrator} in {self.substeps} sub-step(s) never "
                f"settles: errors do not shrink; {cure}"
            )

    def references(self, state: Array, target_m: Array, path_mps: Pair[float] = (0.0, 0.0)) -> Pair[float]:
        """u_ref in m/s and omega_ref in rad/s that the controller asks for on the way to a target (2,)."""
        x, y, psi = state[:3].tolist()
        target_x, target_y = target_m.tolist()
        return references(target_x - x, target_y - y, psi, self.controller, path_mps=path_mps)

    def speed_rates(
        self, u: Number, omega: Number, reference: Pair[Number], began: Pair[Number], delta: Pair[Number]
    ) -> Pair[Number]:
        """Accelerations u' and omega' of (18), within the limits, and delta; `began`: speeds as the period began."""
        if self.theta is None:
            asked = (reference[0] - began[0]) * self.rate_hz, (reference[1] - began[1]) * self.rate_hz
        else:
            asked = accelerations(u, omega, *reference, theta=self.theta)
        u_rate, omega_rate = self.limits.held(*asked)
        return u_rate + delta[0], omega_rate + delta[1]

    def rates(self, state: Array, reference: Pair[float], slip: SlipNow, began: Pair[float]) -> tuple[float, ...]:
        """Time derivative (7) of the state: equations (18) and (19), and what the wheels do for it."""
        _, _, psi, u, omega, _, _ = state.tolist()
        pose_rates = velocities(psi, u, omega, a_m=self.controller.a_m, side_mps=slip.side_speed(u, omega))
        speed_rates = self.speed_rates(u, omega, reference, began, (slip.delta_u, slip.delta_omega))
        ground_mps = wheel_speeds(u, omega, track_m=self.wheels.track_m)
        ground_mps2 = wheel_speeds(*speed_rates, track_m=self.wheels.track_m)
        rims = slip.rim_rates(*ground_mps, radius_m=self.wheels.radius_m, driven_mps2=ground_mps2)
        return *pose_rates, *speed_rates, *rims

    def advance(self, state: Array, reference: Pair[float], slip: SlipNow, then: SlipNow | None = None) -> Array:
        """States (substeps, 7) over one control period with references held; slip runs evenly to what it is `then`.

        Raises MotionError where they run away.
        """
        _, _, _, u, omega, _, _ = state.tolist()

        def steady(now: Array) -> Array:
            return np.array(self.rates(now, reference, slip, (u, omega)))

        def changing(clocked: Array) -> Array:
            now = slip.towards(then or slip, float(clocked[7]))
            return np.array((*self.rates(clocked[:7], reference, now, (u, omega)), self.rate_hz))

        rates, start = (steady, state) if then is None or then == slip else (changing, np.append(state, 0.0))
        states = over_period(
            rates, start, period_s=1 / self.rate_hz, substeps=self.substeps, integrator=self.integrator
        )[:, :7]
        if not np.abs(states).max() < BOUND:
            raise MotionError(f"the motion ran away with {self.integrator}; use rk4, more sub-steps or a lower gain")
        return states

    def contacts_ahead(self, state: Array, slip: SlipNow) -> tuple[tuple[float, float], ...]:
        """Where the left wheel, the right wheel and the axle's middle will be a period on, if nothing changes."""
        x, y, psi, u, omega = state[:5].tolist()
        period_s = 1 / self.rate_hz
        a = self.controller.a_m
        half = self.wheels.track_m / 2
        x_rate, y_rate, _ = velocities(psi, u, omega, a_m=a, side_mps=slip.side_speed(u, omega))
        c = cos(psi + omega * period_s)
        s = sin(psi + omega * period_s)
        x = x + x_rate * period_s - a * c
        y = y + y_rate * period_s - a * s
        return (x - half * s, y + half * c), (x + half * s, y - half * c), (x, y)


@dataclass(frozen=True, slots=True)
class Legs:
    """Targets (K, 2) for h in order, each until it is near on both axes or for `leg_s`; then `settle_s` more.

    `ends` is always the frames at which legs have ended so far. Raises MotionError for a leg below one frame.
    """

    targets_m: Array
    rate_hz: float
    tolerance_m: Positive
    max_time_s: LegTime
    leg_s: LegTime | None
    settle_s: Annotated[float, Ge(0), Le(LONGEST_LEG_S)]

    def __post_init__(self) -> None:
        require(self)
        if self.leg_s is not None and self.leg_s * self.rate_hz < 1:
            raise MotionError(f"leg_s must last one frame or more, got {self.leg_s * self.rate_hz:.3g} frames")

    @property
    def patience(self) -> int:
        """Frames that a leg may take."""
        return ceil(self.max_time_s * self.rate_hz)

    @property
    def longest(self) -> int:
        """Frames in the longest drive possible."""
        count = len(self.targets_m)
        last = self._clock(count) if self.leg_s else count * self.patience
        return last + ceil(self.settle_s * self.rate_hz) + 1

    def ended(self, place_m: list[Array], ends: list[int]) -> list[int]:
        """This frame, once for each leg that ends in it, given the places (2,) of h so far, one a frame.

        Raises MotionError where this leg's target has not been entered in time.
        """
        frame = len(place_m) - 1
        left_m = self.targets_m[len(ends) :]
        if self.leg_s:
            return [frame] if len(left_m) and frame == self._clock(len(ends) + 1) else []
        inside = (np.abs(left_m - place_m[-1]) < self.tolerance_m).all(1)
        entered = int(np.logical_and.accumulate(inside).sum())
        leg_start = ends[-1] if ends else 0
        if len(left_m) and not entered and frame - leg_start >= self.patience:
            away_m = np.hypot(*(np.array(place_m[leg_start:]) - left_m[0]).T)
            raise MotionError(
                f"target {len(ends) + 1} at ({left_m[0, 0]:g}, {left_m[0, 1]:g}) m was not entered in max_time_s "
                f"({self.patience} frames): {_end_of_leg(away_m)}; "
                f"allow more time, a wider tolerance_m or another controller"
            )
        return [frame] * entered

    def are_over(self, frame: int, ends: list[int]) -> bool:
        """Whether the last leg ended long enough ago."""
        return len(ends) == len(self.targets_m) and frame >= ends[-1] + ceil(self.settle_s * self.rate_hz)

    def _clock(self, legs: int) -> int:
        """The frame in which so many legs have had their time, whole frames or not."""
        return round(legs * ((self.leg_s or 0.0) * self.rate_hz))


def _end_of_leg(away_m: Array) -> str:
    """How a leg that was too long ended, from h's distance to its target at every frame."""
    third = away_m[len(away_m) // 2 : -(len(away_m) // 4)]
    last = away_m[-(len(away_m) // 4) - 1 :]
    comes_and_goes = {-1.0, 1.0} <= set(np.sign(np.diff(last)).tolist())
    if comes_and_goes and last.min() > 0.98 * third.min() and np.ptp(last) > 0.02 * last.max():
        return f"the robot keeps circling it, between {last.min():.3g} and {last.max():.3g} m away, and comes no nearer"
    return f"the robot is {away_m[-1]:.3g} m away"
