"""The point controller of the paper, equations (20) and (21), and the sequence of targets to which it drives."""

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

BISECTIONS = 40  # the number of bisection steps in the search for the largest stable gain
SMALLEST_GAIN_PER_S = 1e-6  # if the largest stable gain is smaller, no gain is recommended
GROWTH_MARGIN = 1e-9  # the growth must be below 1 by this much
# A component of the state (m, m/s, rad, rad/s) that exceeds this shows that the integration has diverged.
MAX_STATE = 1e6
# A longer leg or a higher rate is probably a typing error, and the drive would fill the memory.
MAX_LEG_S = 3600.0
MAX_RATE_HZ = 1e4
LegTime = Annotated[float, Gt(0), Le(MAX_LEG_S)]
MOST_FRAMES = 200_000  # the largest number of frames of a drive: nearly two hours at 30 Hz
# The largest number of frames if every leg lasts as long as possible. Disturbances are drawn for all these frames.
MOST_POSSIBLE_FRAMES = 20_000_000


@dataclass(frozen=True, slots=True)
class ControllerSettings:
    """Gains of the controller, which are the same on both axes as in the paper, and the limits of its references.

    `gain_per_s` is k of (20): the speed per distance from the target, close to the target.
    `axis_speed_mps` is l of (20): the speed on each axis, far from the target.
    `a_m` is the distance from the wheel axle to the controlled point h.
    `max_speed_mps` is the largest |u_ref|.
    `max_turn_radps` is the largest |omega_ref|.
    Raises MotionError for a value that is not positive, and for a gain, speed or distance that is infinite.
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
    """The references u_ref in m/s and omega_ref in rad/s, equations (20) and (21).

    `error_x_m` is the x of the target minus the x of h.
    `error_y_m` is the y of the target minus the y of h.
    `psi` is the heading in rad.
    `settings` has the gains and limits of the controller.
    `path_mps` is the velocity (x, y) of a moving target. It is added to the velocity of (20).

    If a reference exceeds its limit, both are divided by the same factor. This preserves the direction in which h
    moves, so that the path to a target stays straight.
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
    """How a control period is integrated.

    `period_s` is the duration of the period.
    `substeps` is the number of steps of the integrator in a period.
    `integrator` is the name of the integrator, one of INTEGRATORS.
    """

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
    """The factor by which a small error near the target grows in one control period. The loop is stable below 1.

    Near the target the loop is linear. It consists of two independent loops, for u and for omega, of the same form:
    error' = -v and lag v' = k error - drag v. They do not depend on a_m.
    With one Euler step per period, the factor is 1 at k = drag / period.
    Without a theta, v changes linearly to k error within the period.
    """
    clock = ControlClock(period_s, substeps, integrator)
    if theta is None:
        return _axis_growth(gain_per_s, lag_s=period_s, drag=0.0, start_weight=1.0, clock=clock)
    speed_growth = _axis_growth(gain_per_s, lag_s=theta.t1, drag=theta.t4, start_weight=0.0, clock=clock)
    turn_growth = _axis_growth(gain_per_s, lag_s=theta.t2, drag=theta.t6, start_weight=0.0, clock=clock)
    return max(speed_growth, turn_growth)


def settling_gain(gain_per_s: float, growth: Callable[[float], float]) -> float:
    """The largest stable gain in 1/s, by bisection between 0 and an unstable gain.

    `gain_per_s` is the unstable gain.
    `growth` is the growth of the loop as a function of the gain; see `loop_growth`.
    """
    low = 0.0
    high = gain_per_s
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        if growth(middle) < 1:
            low = middle
        else:
            high = middle
    return low


def _axis_growth(
    gain_per_s: float,
    *,
    lag_s: float,
    drag: float,
    start_weight: float,
    clock: ControlClock,
) -> float:
    """The spectral radius of the map of (error, v) from the start of a control period to its end.

    The controller uses the error at the start, error0, during the whole period. The loop has
    lag v' = k error0 - drag v - start_weight v0, with the speed v0 at the start of the period.
    """

    def rates(state: Array) -> Array:
        _, speed, start_error, start_speed = state
        drive = gain_per_s * start_error - drag * speed - start_weight * start_speed
        acceleration = drive / lag_s
        return np.array([-speed, acceleration, 0.0, 0.0])

    def after_period(error: float, speed: float) -> Array:
        # The last two components of the state stay at their values at the start.
        start = np.array([error, speed, error, speed])
        states = over_period(
            rates,
            start,
            period_s=clock.period_s,
            substeps=clock.substeps,
            integrator=clock.integrator,
        )
        return states[-1, :2]

    from_unit_error = after_period(1.0, 0.0)
    from_unit_speed = after_period(0.0, 1.0)
    period_map = np.stack([from_unit_error, from_unit_speed], -1)
    eigenvalues = np.linalg.eigvals(period_map)
    return float(np.abs(eigenvalues).max())


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A robot with its controller, and how its motion is integrated.

    `theta` has the parameters of the dynamics (18). Without it the robot is an ideal unicycle, whose speeds change
    linearly to the references within a control period.
    `controller` has the gains and limits of the controller.
    `wheels` has the radius and the distance of the wheels.
    `rate_hz` is the rate of the controller.
    `substeps` is the number of steps of the integrator in a control period.
    `integrator` is the name of the integrator.
    `limits` are the largest accelerations.

    The state (7,) is x and y of h in m, psi in rad, u in m/s, omega in rad/s, and the angles of the left and the
    right wheel in rad.
    Raises MotionError if the closed loop would not settle on a target.
    """

    theta: Theta | None
    controller: ControllerSettings
    wheels: WheelGeometry
    rate_hz: Annotated[float, Gt(0), Le(MAX_RATE_HZ)]
    substeps: Annotated[int, Ge(1)]
    integrator: Annotated[str, OneOf("integrator", INTEGRATORS)]
    limits: AccelerationLimits = UNLIMITED

    def __post_init__(self) -> None:
        require(self)
        gain_per_s = self.controller.gain_per_s
        is_stable = self._growth(gain_per_s) <= 1 - GROWTH_MARGIN
        if is_stable:
            return
        largest_gain = settling_gain(gain_per_s, self._growth)
        remedy = "no gain does; raise rate_hz or substeps"
        if largest_gain > SMALLEST_GAIN_PER_S:
            remedy = f"take a gain below {largest_gain:.3g} or a higher rate_hz"
        raise MotionError(
            f"gain_per_s {gain_per_s:g} at {self.rate_hz:g} Hz with {self.integrator} in {self.substeps} sub-step(s) "
            f"never settles: errors do not shrink; {remedy}"
        )

    def _growth(self, gain_per_s: float) -> float:
        """The `loop_growth` of this vehicle with the given gain."""
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
        """The references u_ref in m/s and omega_ref in rad/s that drive h to a target.

        `state` (7,) is the state of the vehicle.
        `target_m` (2,) is the position of the target.
        `path_mps` is the velocity (x, y) of a moving target.
        """
        x, y, psi = state[:3].tolist()
        target_x, target_y = target_m.tolist()
        error_x_m = target_x - x
        error_y_m = target_y - y
        return references(error_x_m, error_y_m, psi, self.controller, path_mps=path_mps)

    def speed_rates(
        self,
        u: Number,
        omega: Number,
        reference: Pair[Number],
        period_start: Pair[Number],
        delta: Pair[Number],
    ) -> Pair[Number]:
        """The accelerations u' in m/s^2 and omega' in rad/s^2: those of (18), limited, plus the disturbance delta.

        `u` is the speed in m/s.
        `omega` is the angular velocity in rad/s.
        `reference` are u_ref and omega_ref.
        `period_start` are u and omega at the start of the control period.
        `delta` are delta_u in m/s^2 and delta_omega in rad/s^2.
        """
        u_ref, omega_ref = reference
        if self.theta is None:
            start_u, start_omega = period_start
            u_rate = (u_ref - start_u) * self.rate_hz
            omega_rate = (omega_ref - start_omega) * self.rate_hz
        else:
            u_rate, omega_rate = accelerations(u, omega, u_ref, omega_ref, theta=self.theta)
        u_rate, omega_rate = self.limits.held(u_rate, omega_rate)
        delta_u, delta_omega = delta
        return u_rate + delta_u, omega_rate + delta_omega

    def rates(
        self,
        state: Array,
        reference: Pair[float],
        slip: Disturbance,
        period_start: Pair[float],
    ) -> tuple[float, ...]:
        """The time derivative (7,) of the state: equations (18) and (19), and the angular velocities of the wheels.

        `reference` are u_ref and omega_ref.
        `slip` is the disturbance at this instant.
        `period_start` are u and omega at the start of the control period.
        """
        _, _, psi, u, omega, _, _ = state.tolist()
        side_mps = slip.side_speed(u, omega)
        pose_rates = velocities(psi, u, omega, a_m=self.controller.a_m, side_mps=side_mps)
        delta = (slip.delta_u, slip.delta_omega)
        speed_rates = self.speed_rates(u, omega, reference, period_start, delta)
        left_mps, right_mps = wheel_speeds(u, omega, track_m=self.wheels.track_m)
        wheel_accelerations_mps2 = wheel_speeds(*speed_rates, track_m=self.wheels.track_m)
        rim_rates = slip.rim_rates(
            left_mps,
            right_mps,
            radius_m=self.wheels.radius_m,
            driven_mps2=wheel_accelerations_mps2,
        )
        return *pose_rates, *speed_rates, *rim_rates

    def advance(
        self,
        state: Array,
        reference: Pair[float],
        slip: Disturbance,
        next_slip: Disturbance | None = None,
    ) -> Array:
        """The states (substeps, 7) at the ends of the sub-steps of a control period, from the state at its start.

        `reference` are u_ref and omega_ref, which are constant within the period.
        `slip` is the disturbance at the start of the period.
        `next_slip` is the disturbance at its end, to which `slip` changes linearly; None if it is constant.
        Raises MotionError if the states diverge.
        """
        period_start = (float(state[3]), float(state[4]))

        def rates_at_constant_slip(state_now: Array) -> Array:
            return np.array(self.rates(state_now, reference, slip, period_start))

        # The state is extended by the elapsed share of the period, whose time derivative is the rate.
        def rates_at_changing_slip(extended_state: Array) -> Array:
            elapsed_share = float(extended_state[7])
            slip_now = slip.towards(next_slip or slip, elapsed_share)
            state_rates = self.rates(extended_state[:7], reference, slip_now, period_start)
            return np.array((*state_rates, self.rate_hz))

        rates: Callable[[Array], Array]
        is_constant = next_slip is None or next_slip == slip
        if is_constant:
            rates = rates_at_constant_slip
            start = state
        else:
            rates = rates_at_changing_slip
            start = np.append(state, 0.0)
        extended_states = over_period(
            rates,
            start,
            period_s=1 / self.rate_hz,
            substeps=self.substeps,
            integrator=self.integrator,
        )
        states = extended_states[:, :7]
        is_bounded = np.abs(states).max() < MAX_STATE  # False for NaN
        if not is_bounded:
            raise MotionError(f"the motion diverged with {self.integrator}; use rk4, more sub-steps or a lower gain")
        return states

    def contacts_ahead(self, state: Array, slip: Disturbance) -> tuple[Pair[float], ...]:
        """The predicted positions (x, y) of the left wheel, the right wheel and the middle of the axle after a period.

        The velocity of h and the angular velocity are assumed to be constant.
        """
        x, y, psi, u, omega = state[:5].tolist()
        period_s = 1 / self.rate_hz
        a_m = self.controller.a_m
        half_track_m = self.wheels.track_m / 2
        side_mps = slip.side_speed(u, omega)
        x_rate, y_rate, _ = velocities(psi, u, omega, a_m=a_m, side_mps=side_mps)

        heading = psi + omega * period_s
        c = cos(heading)
        s = sin(heading)
        axle_x = x + x_rate * period_s - a_m * c
        axle_y = y + y_rate * period_s - a_m * s
        left = (axle_x - half_track_m * s, axle_y + half_track_m * c)
        right = (axle_x + half_track_m * s, axle_y - half_track_m * c)
        return left, right, (axle_x, axle_y)


@dataclass(frozen=True, slots=True)
class Legs:
    """A sequence of targets, and when a leg, which is the drive to one of them, ends.

    `targets_m` (K, 2) are the positions of the targets, in the order in which h is driven to them.
    `rate_hz` is the number of frames per second.
    `tolerance_m` is the largest distance on each axis at which h has reached a target.
    `max_time_s` is the longest duration of a leg that ends at its target.
    `leg_s` is the fixed duration of each leg; if it is None, a leg ends when h has reached its target.
    `settle_s` is the time for which the drive continues after the last leg.

    Raises MotionError if a leg is shorter than a frame, or if the drive could have too many frames.
    """

    targets_m: Array
    rate_hz: float
    tolerance_m: Positive
    max_time_s: LegTime
    leg_s: LegTime | None
    settle_s: Annotated[float, Ge(0), Le(MAX_LEG_S)]

    def __post_init__(self) -> None:
        require(self)
        if self.max_frames > MOST_POSSIBLE_FRAMES:
            raise MotionError(
                f"{len(self.targets_m)} targets with up to {self.leg_s or self.max_time_s:g} s each are up to "
                f"{self.max_frames} frames; at most {MOST_POSSIBLE_FRAMES} are possible"
            )
        if self.leg_s is None:
            return
        frames = self.leg_s * self.rate_hz
        if frames < 1:
            raise MotionError(f"leg_s must last one frame or more, got {frames:.3g} frames")

    @property
    def max_leg_frames(self) -> int:
        """The largest number of frames of a leg that ends at its target."""
        return ceil(self.max_time_s * self.rate_hz)

    @property
    def settle_frames(self) -> int:
        """The number of frames after the last leg."""
        return ceil(self.settle_s * self.rate_hz)

    @property
    def max_frames(self) -> int:
        """The number of frames of the longest possible drive."""
        leg_count = len(self.targets_m)
        last_end = self._timed_end(leg_count) if self.leg_s else leg_count * self.max_leg_frames
        return last_end + self.settle_frames + 1

    def newly_ended(self, positions_m: list[Array], ends: list[int]) -> list[int]:
        """The current frame, repeated for each leg that ends in it.

        `positions_m` are the positions (2,) of h at all frames so far; the last one is the current frame.
        `ends` are the frames at which the previous legs ended.
        Raises MotionError if h has not reached the current target in time.
        """
        frame = len(positions_m) - 1
        remaining_targets_m = self.targets_m[len(ends) :]
        if not len(remaining_targets_m):
            return []
        if self.leg_s:
            is_over = frame == self._timed_end(len(ends) + 1)
            return [frame] if is_over else []

        reached_count = 0
        for target_m in remaining_targets_m:
            distance_m = np.abs(target_m - positions_m[-1])
            if not (distance_m < self.tolerance_m).all():
                break
            reached_count += 1

        leg_start = ends[-1] if ends else 0
        is_late = frame - leg_start >= self.max_leg_frames
        if is_late and reached_count == 0:
            leg_positions_m = np.array(positions_m[leg_start:])
            self._raise_timeout(leg_positions_m, remaining_targets_m[0], number=len(ends) + 1)
        return [frame] * reached_count

    def _raise_timeout(self, positions_m: Array, target_m: Array, *, number: int) -> None:
        """Raise MotionError for the target with this number, from the positions (N, 2) of h in its leg."""
        offset_m = positions_m - target_m
        distance_m = np.hypot(offset_m[:, 0], offset_m[:, 1])
        raise MotionError(
            f"target {number} at ({target_m[0]:g}, {target_m[1]:g}) m was not entered in max_time_s "
            f"({self.max_leg_frames} frames): {_end_of_leg(distance_m)}; "
            f"allow more time, a wider tolerance_m or another controller"
        )

    def are_over(self, frame: int, ends: list[int]) -> bool:
        """Whether all legs and the time after the last one are over at a frame, given the ends of legs so far."""
        has_ended = len(ends) == len(self.targets_m)
        return has_ended and frame >= ends[-1] + self.settle_frames

    def _timed_end(self, leg_count: int) -> int:
        """The frame at which a number of legs of fixed duration end. A leg need not last a whole number of frames."""
        leg_s = self.leg_s or 0.0
        leg_frames = leg_s * self.rate_hz
        return round(leg_count * leg_frames)


def _end_of_leg(distance_m: Array) -> str:
    """How a leg that took too long ended, in words, from the distances (N,) of h to its target at all frames."""
    quarter = len(distance_m) // 4
    third_quarter_m = distance_m[len(distance_m) // 2 : -quarter]
    last_quarter_m = distance_m[-quarter - 1 :]
    steps_m = np.diff(last_quarter_m)
    oscillates = (steps_m > 0).any() and (steps_m < 0).any()
    if not oscillates:
        return f"the robot is {distance_m[-1]:.3g} m away"

    nearest_m = last_quarter_m.min()
    farthest_m = last_quarter_m.max()
    comes_no_nearer = nearest_m > 0.98 * third_quarter_m.min()
    has_wide_range = farthest_m - nearest_m > 0.02 * farthest_m
    if comes_no_nearer and has_wide_range:
        return f"the robot keeps circling it, between {nearest_m:.3g} and {farthest_m:.3g} m away, and comes no nearer"
    return f"the robot is {distance_m[-1]:.3g} m away"
