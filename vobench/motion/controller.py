"""The paper's point controller (20)-(21), its limits, and the targets that it leads the robot to."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from math import ceil, cos, inf, isfinite, sin, tanh
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le

from vobench.errors import MotionError
from vobench.geometry.rig import WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion.disturbance import Disturbance
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
from vobench.setting import OneOf, Positive, require


@dataclass(frozen=True, slots=True)
class ControllerSettings:
    """Gains of (20)-(21), the same on both axes as in the paper, and the largest references given.

    Raises MotionError for a value that is not positive (only the two limits may be infinite).
    """

    gain_per_s: float
    axis_speed_mps: float
    a_m: float = 0.2
    max_speed_mps: float = inf
    max_turn_radps: float = inf

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            is_limit = field.name.startswith("max_")
            is_valid = value > 0 and (is_limit or isfinite(value))
            if not is_valid:
                raise MotionError(f"the controller's {field.name} must be positive and finite, got {value}")


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
    path_mps: Pair[float] = (0.0, 0.0),
) -> Pair[float]:
    """u_ref in m/s and omega_ref in rad/s of (20)-(21), for the error target minus current position of h.

    `path_mps` is the velocity of a moving target, added to that of (20) on each axis. Both references are
    divided by one factor if either exceeds its limit: the direction in which h moves, and so the
    straightness of a leg, is preserved.
    """
    k = settings.gain_per_s
    l = settings.axis_speed_mps  # noqa: E741 - the paper's letter
    v_x = path_mps[0] + l * tanh(k * error_x_m / l)
    v_y = path_mps[1] + l * tanh(k * error_y_m / l)
    u_ref = v_x * cos(psi) + v_y * sin(psi)
    lateral = v_y * cos(psi) - v_x * sin(psi)
    omega_ref = lateral / settings.a_m

    speed_excess = abs(u_ref) / settings.max_speed_mps
    turn_excess = abs(omega_ref) / settings.max_turn_radps
    excess = max(1.0, speed_excess, turn_excess)
    return u_ref / excess, omega_ref / excess


@dataclass(frozen=True, slots=True)
class ControlClock:
    """How a control period is integrated: its duration, its sub-steps and the integrator."""

    period_s: float
    substeps: int
    integrator: str


def loop_growth(
    gain_per_s: float,
    theta: Theta | None,
    *,
    period_s: float,
    substeps: int,
    integrator: str,
) -> float:
    """The factor by which a small error near the target grows in one control period; stable below 1.

    The loop, linear there, splits into two of one form, independent of a: error' = -v, lag v' = k error - drag v.
    With one Euler step a period this is 1 exactly at k = drag / period. Without a theta v changes linearly to
    k error within the period.
    """
    clock = ControlClock(period_s, substeps, integrator)
    if theta is None:
        return _axis_growth(gain_per_s, period_s, 0.0, 1.0, clock=clock)
    speed_growth = _axis_growth(gain_per_s, theta.t1, theta.t4, 0.0, clock=clock)
    turn_growth = _axis_growth(gain_per_s, theta.t2, theta.t6, 0.0, clock=clock)
    return max(speed_growth, turn_growth)


def settling_gain(gain_per_s: float, growth: Callable[[float], float]) -> float:
    """The gain in 1/s below which a loop of this growth is stable, where `gain_per_s` is not."""
    low = 0.0
    high = gain_per_s
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if growth(middle) < 1:
            low = middle
        else:
            high = middle
    return low


def _axis_growth(
    gain_per_s: float,
    lag_s: float,
    drag: float,
    start_weight: float,
    *,
    clock: ControlClock,
) -> float:
    """Spectral radius of one axis over a period, in which the controller holds the error that it saw at the start.

    The axis has lag v' = k error - drag v - start_weight v0, with the speed v0 at the start of the period.
    """

    def rates(state: Array) -> Array:
        _, speed, seen_error, seen_speed = state
        acceleration = (gain_per_s * seen_error - drag * speed - start_weight * seen_speed) / lag_s
        return np.array([-speed, acceleration, 0.0, 0.0])

    def after_period(error: float, speed: float) -> Array:
        start = np.array([error, speed, error, speed])
        states = over_period(
            rates,
            start,
            period_s=clock.period_s,
            substeps=clock.substeps,
            integrator=clock.integrator,
        )
        return states[-1, :2]

    of_unit_error = after_period(1.0, 0.0)
    of_unit_speed = after_period(0.0, 1.0)
    period_map = np.stack([of_unit_error, of_unit_speed], -1)
    return float(np.abs(np.linalg.eigvals(period_map)).max())


HALVINGS = 40  # of a range of gains
SMALLEST_GAIN = 1e-6  # in 1/s: below it no gain settles
# Beyond this (m, m/s, rad) the equations have diverged: no room is so large and no wheel so fast.
BOUND = 1e6
# A slower or faster value is a typing error, and would fill the memory.
LONGEST_LEG_S = 3600.0
FASTEST_HZ = 1e4
LegTime = Annotated[float, Gt(0), Le(LONGEST_LEG_S)]
MOST_FRAMES = 200_000  # nearly two hours at 30 Hz
MOST_POSSIBLE_FRAMES = 20_000_000  # of all legs if each takes its full time; disturbances are drawn for all of them


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A robot, its controller, and the steps in which time is integrated.

    The state is (7,): x, y of h in m, psi in rad, u in m/s, omega in rad/s, left and right rim in rad.
    Without a theta it is the ideal unicycle: within a control period its speeds change linearly to the references.
    Raises MotionError if the closed loop would not settle on a target.
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
        gain_per_s = self.controller.gain_per_s
        if self._growth(gain_per_s) <= 1 - 1e-9:
            return
        largest_gain = settling_gain(gain_per_s, self._growth)
        remedy = "no gain does; raise rate_hz or substeps"
        if largest_gain > SMALLEST_GAIN:
            remedy = f"take a gain below {largest_gain:.3g} or a higher rate_hz"
        raise MotionError(
            f"gain_per_s {gain_per_s:g} at {self.rate_hz:g} Hz with {self.integrator} in {self.substeps} sub-step(s) "
            f"never settles: errors do not shrink; {remedy}"
        )

    def _growth(self, gain_per_s: float) -> float:
        """`loop_growth` of this vehicle with another gain."""
        return loop_growth(
            gain_per_s,
            self.theta,
            period_s=1 / self.rate_hz,
            substeps=self.substeps,
            integrator=self.integrator,
        )

    def references(
        self,
        state: Array,
        target_m: Array,
        path_mps: Pair[float] = (0.0, 0.0),
    ) -> Pair[float]:
        """u_ref in m/s and omega_ref in rad/s of the controller on the way to a target (2,)."""
        x, y, psi = state[:3].tolist()
        target_x, target_y = target_m.tolist()
        return references(target_x - x, target_y - y, psi, self.controller, path_mps=path_mps)

    def speed_rates(
        self,
        u: Number,
        omega: Number,
        reference: Pair[Number],
        began: Pair[Number],
        delta: Pair[Number],
    ) -> Pair[Number]:
        """Accelerations u' and omega' of (18), within the limits, plus delta; `began`: speeds at the period's start."""
        u_ref, omega_ref = reference
        if self.theta is None:
            u_rate = (u_ref - began[0]) * self.rate_hz
            omega_rate = (omega_ref - began[1]) * self.rate_hz
        else:
            u_rate, omega_rate = accelerations(u, omega, u_ref, omega_ref, theta=self.theta)
        u_rate, omega_rate = self.limits.held(u_rate, omega_rate)
        return u_rate + delta[0], omega_rate + delta[1]

    def rates(
        self,
        state: Array,
        reference: Pair[float],
        slip: Disturbance,
        began: Pair[float],
    ) -> tuple[float, ...]:
        """Time derivative (7) of the state: equations (18) and (19), and the rates of the wheels."""
        _, _, psi, u, omega, _, _ = state.tolist()
        side_mps = slip.side_speed(u, omega)
        pose_rates = velocities(psi, u, omega, a_m=self.controller.a_m, side_mps=side_mps)
        delta = (slip.delta_u, slip.delta_omega)
        speed_rates = self.speed_rates(u, omega, reference, began, delta)
        left_mps, right_mps = wheel_speeds(u, omega, track_m=self.wheels.track_m)
        ground_mps2 = wheel_speeds(*speed_rates, track_m=self.wheels.track_m)
        rim_rates = slip.rim_rates(
            left_mps,
            right_mps,
            radius_m=self.wheels.radius_m,
            driven_mps2=ground_mps2,
        )
        return *pose_rates, *speed_rates, *rim_rates

    def advance(
        self,
        state: Array,
        reference: Pair[float],
        slip: Disturbance,
        then: Disturbance | None = None,
    ) -> Array:
        """States (substeps, 7) over one control period with constant references; slip changes linearly to `then`.

        Raises MotionError if they diverge.
        """
        began = (float(state[3]), float(state[4]))

        def steady(now: Array) -> Array:
            return np.array(self.rates(now, reference, slip, began))

        def changing(clocked: Array) -> Array:
            share = float(clocked[7])
            slip_now = slip.towards(then or slip, share)
            rates = self.rates(clocked[:7], reference, slip_now, began)
            return np.array((*rates, self.rate_hz))

        is_steady = then is None or then == slip
        states = over_period(
            steady if is_steady else changing,
            state if is_steady else np.append(state, 0.0),
            period_s=1 / self.rate_hz,
            substeps=self.substeps,
            integrator=self.integrator,
        )[:, :7]
        if not np.abs(states).max() < BOUND:
            raise MotionError(f"the motion diverged with {self.integrator}; use rk4, more sub-steps or a lower gain")
        return states

    def contacts_ahead(self, state: Array, slip: Disturbance) -> tuple[Pair[float], ...]:
        """Positions of the left wheel, the right wheel and the axle's middle a period later at constant velocity."""
        x, y, psi, u, omega = state[:5].tolist()
        period_s = 1 / self.rate_hz
        a_m = self.controller.a_m
        half_track_m = self.wheels.track_m / 2
        side_mps = slip.side_speed(u, omega)
        x_rate, y_rate, _ = velocities(psi, u, omega, a_m=a_m, side_mps=side_mps)

        heading = psi + omega * period_s
        c = cos(heading)
        s = sin(heading)
        x = x + x_rate * period_s - a_m * c
        y = y + y_rate * period_s - a_m * s
        left = (x - half_track_m * s, y + half_track_m * c)
        right = (x + half_track_m * s, y - half_track_m * c)
        return left, right, (x, y)


@dataclass(frozen=True, slots=True)
class Legs:
    """Targets (K, 2) for h in order, each until h is near on both axes or for `leg_s`; then `settle_s` more.

    `ends` are always the frames at which legs have ended so far. Raises MotionError for a leg below one frame.
    """

    targets_m: Array
    rate_hz: float
    tolerance_m: Positive
    max_time_s: LegTime
    leg_s: LegTime | None
    settle_s: Annotated[float, Ge(0), Le(LONGEST_LEG_S)]

    def __post_init__(self) -> None:
        require(self)
        if self.longest > MOST_POSSIBLE_FRAMES:
            raise MotionError(
                f"{len(self.targets_m)} targets with up to {self.leg_s or self.max_time_s:g} s each are up to "
                f"{self.longest} frames; at most {MOST_POSSIBLE_FRAMES} are possible"
            )
        if self.leg_s is None:
            return
        frames = self.leg_s * self.rate_hz
        if frames < 1:
            raise MotionError(f"leg_s must last one frame or more, got {frames:.3g} frames")

    @property
    def patience(self) -> int:
        """The largest number of frames of a leg."""
        return ceil(self.max_time_s * self.rate_hz)

    @property
    def settle_frames(self) -> int:
        """The number of frames after the last leg."""
        return ceil(self.settle_s * self.rate_hz)

    @property
    def longest(self) -> int:
        """The number of frames of the longest possible drive."""
        count = len(self.targets_m)
        last = self._clock(count) if self.leg_s else count * self.patience
        return last + self.settle_frames + 1

    def ended(self, place_m: list[Array], ends: list[int]) -> list[int]:
        """This frame, once for each leg that ends in it, from the positions (2,) of h so far, one per frame.

        Raises MotionError if this leg's target has not been entered in time.
        """
        frame = len(place_m) - 1
        targets_left_m = self.targets_m[len(ends) :]
        if not len(targets_left_m):
            return []
        if self.leg_s:
            is_over = frame == self._clock(len(ends) + 1)
            return [frame] if is_over else []

        entered = 0
        for target_m in targets_left_m:
            distance_m = np.abs(target_m - place_m[-1])
            if not (distance_m < self.tolerance_m).all():
                break
            entered += 1
        leg_start = ends[-1] if ends else 0
        if not entered and frame - leg_start >= self.patience:
            self._raise_timeout(np.array(place_m[leg_start:]), targets_left_m[0], number=len(ends) + 1)
        return [frame] * entered

    def _raise_timeout(self, place_m: Array, target_m: Array, *, number: int) -> None:
        """Raise MotionError for a target that the positions (N, 2) of h in its leg do not enter."""
        distance_m = np.hypot(*(place_m - target_m).T)
        raise MotionError(
            f"target {number} at ({target_m[0]:g}, {target_m[1]:g}) m was not entered in max_time_s "
            f"({self.patience} frames): {_end_of_leg(distance_m)}; "
            f"allow more time, a wider tolerance_m or another controller"
        )

    def are_over(self, frame: int, ends: list[int]) -> bool:
        """Whether the last leg ended long enough ago."""
        return len(ends) == len(self.targets_m) and frame >= ends[-1] + self.settle_frames

    def _clock(self, legs: int) -> int:
        """The frame at which this many legs are over, whether they last whole frames or not."""
        leg_s = self.leg_s or 0.0
        return round(legs * (leg_s * self.rate_hz))


def _end_of_leg(distance_m: Array) -> str:
    """A description of the end of a leg that was too long, from h's distance to its target at every frame."""
    quarter = len(distance_m) // 4
    third_quarter_m = distance_m[len(distance_m) // 2 : -quarter]
    last_quarter_m = distance_m[-quarter - 1 :]
    directions = set(np.sign(np.diff(last_quarter_m)).tolist())
    comes_and_goes = {-1.0, 1.0} <= directions
    if not comes_and_goes:
        return f"the robot is {distance_m[-1]:.3g} m away"
    nearest_m = last_quarter_m.min()
    farthest_m = last_quarter_m.max()
    comes_no_nearer = nearest_m > 0.98 * third_quarter_m.min()
    is_wide = np.ptp(last_quarter_m) > 0.02 * farthest_m
    if comes_no_nearer and is_wide:
        return f"the robot keeps circling it, between {nearest_m:.3g} and {farthest_m:.3g} m away, and comes no nearer"
    return f"the robot is {distance_m[-1]:.3g} m away"
