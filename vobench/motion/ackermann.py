"""A car that follows a planar path: the bicycle model, with feedback control of its speed and steering.

The state is the position (x, y) of the middle of the rear axle, the heading psi, and the steering angle delta. At the
speed u, with the wheelbase L:

    x' = u cos(psi)
    y' = u sin(psi)
    psi' = u tan(delta) / L
    delta' = (requested delta - delta) / lag, within the limits of delta and delta'

`ackermann` is the motion, and ACKERMANNS are the vehicles by name.
"""

from dataclasses import dataclass
from math import pi
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Lt

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.setting import Positive, settings
from vobench.trajectory.kinematics import CurveMotion, Kinematics, along, level
from vobench.trajectory.trajectory import Stamps

STEP_S = 0.01  # the longest step of the integration
CHECKED_POINTS = 8192  # the number of points of a path at which its curvature is compared with the limit


@settings(kw_only=False)
class AckermannSettings:
    """A vehicle and its driver.

    `wheelbase_m` is the distance between the axles.
    `max_steer_rad` is the largest steering angle, and `max_steer_radps` is its largest rate.
    `steer_lag_s` is the time constant of the steering.
    `lookahead_m` is the approximate distance within which the driver corrects an error.
    """

    wheelbase_m: Positive
    max_steer_rad: Annotated[float, Gt(0), Lt(pi / 2)]
    max_steer_radps: Positive
    steer_lag_s: Annotated[float, Ge(STEP_S)]
    lookahead_m: Positive

    @property
    def sharpest_radius_m(self) -> float:
        """The smallest radius of the path of the rear axle's middle, at full lock."""
        return float(self.wheelbase_m / np.tan(self.max_steer_rad))


# The wheelbase is that of the Volkswagen Passat of KITTI (Geiger et al. 2013); the small robot's wheelbase and limits
# are those of a 1:10 race car (the defaults of f1tenth_gym). Lags and lookaheads are engineering choices.
ACKERMANNS = {
    "kitti_like": AckermannSettings(2.71, 0.6, 0.6, steer_lag_s=0.2, lookahead_m=5.0),
    "small_robot": AckermannSettings(0.33, 0.4189, 3.2, steer_lag_s=0.1, lookahead_m=0.5),
}


class Reference(NamedTuple):
    """Position, heading and motion of the target at an instant, in SI units. Each is a number or an array (K,).

    `curvature` is that of the path one steering lag later, in 1/m, because the steering needs this time to respond.
    `advance` is 1 if the target moves forwards, and -1 if it moves backwards.
    """

    x: Array
    y: Array
    heading: Array
    speed: Array
    acceleration: Array
    angular_velocity: Array
    curvature: Array
    advance: Array


class State(NamedTuple):
    """Position, heading and steering angle of a car in m and rad, or their rates; numbers or arrays (K,)."""

    x: Array
    y: Array
    heading: Array
    steer: Array


@dataclass(frozen=True, slots=True)
class AckermannMotion:
    """The motion of a car, with its state at nodes in time. Between them it is integrated from the node before.

    `nodes_s` (M + 1,) are the times of the nodes.
    `state` (M + 1, 4) is the state at the nodes: x, y, heading and steering angle.
    `advance` (M,) is the direction of each step between nodes: 1 is forwards, and -1 is backwards.
    `breaks_ns` are the breaks of the target, and the times at which the steering begins to respond to them.
    """

    target: CurveMotion
    settings: AckermannSettings
    nodes_s: Array
    state: Array
    advance: Array
    start_ns: int
    end_ns: int
    breaks_ns: Array

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """The kinematics (K,) after one Runge-Kutta step from the last node."""
        t_s = np.asarray(t_ns, float) / 1e9
        node = np.searchsorted(self.nodes_s, t_s, side="right") - 1
        node = np.clip(node, 0, len(self.advance) - 1)
        step_s = t_s - self.nodes_s[node]
        stages = []
        for remaining_share in (1.0, 0.5, 0.0):  # the start, middle and end of the step
            stage_s = t_s - step_s * remaining_share
            stages.append(_reference(self.target, self.settings, stage_s, self.advance[node]))

        state = _stepped(State(*self.state[node].T), stages, step_s, self.settings)
        rates, speed, acceleration = _rates(state, stages[-1], self.settings)
        # The derivative of the yaw rate u tan(delta) / L.
        from_speed = acceleration * np.tan(state.steer)
        from_steering = speed * rates.steer / np.cos(state.steer) ** 2
        angular_acceleration = (from_speed + from_steering) / self.settings.wheelbase_m
        return along(
            level(state.x, state.y, state.heading),
            speed=speed,
            acceleration=acceleration,
            turn=rates.heading,
            turn_rate=angular_acceleration,
        )


def ackermann(target: CurveMotion, settings: AckermannSettings = ACKERMANNS["small_robot"]) -> AckermannMotion:
    """The motion of a car that follows a planar motion from its start, with feedback from the position and heading.

    Raises MotionError if the target turns on the spot, or more sharply than the steering allows.
    """
    _require_drivable(target, settings)
    breaks_s = _breaks_s(target, settings)
    nodes_s = _nodes(np.array([target.law.start_s, *breaks_s, target.law.end_s]))
    step_s = np.diff(nodes_s)
    middles_s = nodes_s[:-1] + step_s / 2
    advance, _ = _by_progress(target, middles_s)

    # The references of all steps are computed at once. Python floats are then faster than arrays of one element.
    stages = []  # for the start, middle and end of steps: a list of the values of each step's reference
    for share in (0.0, 0.5, 1.0):
        reference = _reference(target, settings, nodes_s[:-1] + step_s * share, advance)
        stages.append(np.array(reference).T.tolist())

    first = Reference(*stages[0][0])
    first_steer = np.arctan(settings.wheelbase_m * first.curvature)
    first_steer = np.clip(first_steer, -settings.max_steer_rad, settings.max_steer_rad)
    state = State(first.x, first.y, first.heading, first_steer)
    states = [state]
    for *step_stages, duration_s in zip(*stages, step_s.tolist(), strict=True):
        references = [Reference(*stage) for stage in step_stages]
        state = _stepped(state, references, duration_s, settings)
        states.append(state)
    return AckermannMotion(
        target=target,
        settings=settings,
        nodes_s=nodes_s,
        state=np.array(states, float),
        advance=advance,
        start_ns=target.start_ns,
        end_ns=target.end_ns,
        breaks_ns=breaks_s * 1e9,
    )


def _rates(
    state: State,
    target: Reference,
    settings: AckermannSettings,
) -> tuple[State, Array, Array]:
    """The rates of the state, the speed and its derivative, from the vehicle model and the control law of its driver.

    The control law compares the target with the car, in the axes of the car: e_x is the error ahead, e_y that to the
    left, and e_psi that of the heading. The target has the speed u_t, the curvature k_t, and the direction a, which is
    1 forwards and -1 backwards. With the lookahead l:

        speed = u_t (cos(e_psi) + a e_x / l)
        curvature = k_t + e_y / l² + 2 a sin(e_psi) / l

    Gains are per distance instead of per time. Errors are therefore critically damped along the path at any speed, and
    a car at rest does not move. Source: Kanayama et al. (1990), with these gains.
    """
    x, y, heading, steer = state
    cosine = np.cos(heading)
    sine = np.sin(heading)
    error_x = target.x - x
    error_y = target.y - y
    error_ahead = cosine * error_x + sine * error_y
    error_left = cosine * error_y - sine * error_x
    heading_error = target.heading - heading
    error_cosine = np.cos(heading_error)
    error_sine = np.sin(heading_error)
    gain = target.advance / settings.lookahead_m

    curvature = target.curvature + error_left / settings.lookahead_m**2 + 2 * gain * error_sine
    requested_steer = np.arctan(settings.wheelbase_m * curvature)
    requested_steer = _clipped(requested_steer, settings.max_steer_rad)
    steer_rate = (requested_steer - steer) / settings.steer_lag_s
    steer_rate = _clipped(steer_rate, settings.max_steer_radps)

    speed_factor = error_cosine + gain * error_ahead
    speed = target.speed * speed_factor
    heading_rate = speed * np.tan(steer) / settings.wheelbase_m

    # The derivative of the speed. That of the target's speed is known; that of the factor follows from the errors.
    error_ahead_rate = heading_rate * error_left - speed + target.speed * error_cosine
    heading_error_rate = target.angular_velocity - heading_rate
    speed_factor_rate = gain * error_ahead_rate - error_sine * heading_error_rate
    acceleration = target.acceleration * speed_factor + target.speed * speed_factor_rate
    rates = State(speed * cosine, speed * sine, heading_rate, steer_rate)
    return rates, speed, acceleration


def _clipped(value: Array, limit: float) -> Array:
    """A number or array within ±limit."""
    return np.minimum(np.maximum(value, -limit), limit)


def _stepped(
    state: State,
    stages: list[Reference],
    step_s: Array | float,
    settings: AckermannSettings,
) -> State:
    """The state after a step of the classical Runge-Kutta method; `stages` are at its start, middle and end."""
    start, middle, end = stages
    k1, _, _ = _rates(state, start, settings)
    k2, _, _ = _rates(_advanced(state, k1, 0.5 * step_s), middle, settings)
    k3, _, _ = _rates(_advanced(state, k2, 0.5 * step_s), middle, settings)
    k4, _, _ = _rates(_advanced(state, k3, 1.0 * step_s), end, settings)
    weighted_sums = (a + 2 * b + 2 * c + d for a, b, c, d in zip(k1, k2, k3, k4, strict=True))
    mean_rates = State(*(total / 6 for total in weighted_sums))
    return _advanced(state, mean_rates, 1.0 * step_s)


def _advanced(state: State, rates: State, duration_s: Array | float) -> State:
    """The state after a duration at constant rates."""
    values = (value + duration_s * rate for value, rate in zip(state, rates, strict=True))
    return State(*values)


def _reference(
    target: CurveMotion,
    settings: AckermannSettings,
    t_s: Array,
    advance: Array,
) -> Reference:
    """The target at t_s (K,), with its curvature one steering lag later."""
    now = target.at(t_s * 1e9)
    T_world_body = now.T_world_body
    _, curvature = _by_progress(target, t_s + settings.steer_lag_s)
    return Reference(
        x=T_world_body[:, 0, 3],
        y=T_world_body[:, 1, 3],
        heading=np.arctan2(T_world_body[:, 1, 0], T_world_body[:, 0, 0]),
        speed=now.velocity_mps[:, 0],
        acceleration=now.acceleration_mps2[:, 0],
        angular_velocity=now.angular_velocity_radps[:, 2],
        curvature=curvature,
        advance=advance,
    )


def _by_progress(target: CurveMotion, t_s: Array) -> tuple[Array, Array]:
    """The direction (K,) and the curvature (K,) in 1/m of the target's path at t_s (K,).

    The direction is 1 forwards, -1 backwards, and 0 for a turn on the spot. Both are derivatives by progress along the
    path, so that they are also defined while the target stands still.
    """
    inside_s = np.clip(t_s, target.law.start_s, target.law.end_s)
    progress, _, _ = target.law.at(inside_s)
    by_progress = target.curve.at(progress)
    advance = by_progress.velocity_mps[:, 0]
    curvature = advance * by_progress.angular_velocity_radps[:, 2]
    return advance, curvature


def _breaks_s(target: CurveMotion, settings: AckermannSettings) -> Array:
    """The times at which the target has a break, or at which the steering begins to respond to one."""
    target_breaks_s = target.breaks_ns / 1e9
    steering_breaks_s = target_breaks_s - settings.steer_lag_s
    breaks_s = np.unique(np.concatenate([target_breaks_s, steering_breaks_s]))
    is_inside = (breaks_s > target.law.start_s) & (breaks_s < target.law.end_s)
    return breaks_s[is_inside]


def _nodes(required_s: Array) -> Array:
    """Increasing times that are at most STEP_S apart and include all required times."""
    starts_s = required_s[:-1]
    ends_s = required_s[1:]
    counts = np.ceil(np.diff(required_s) / STEP_S).astype(int)
    parts_s = []
    for start_s, end_s, count in zip(starts_s, ends_s, counts, strict=True):
        parts_s.append(np.linspace(start_s, end_s, count, endpoint=False))
    return np.concatenate([*parts_s, required_s[-1:]])


def _require_drivable(target: CurveMotion, settings: AckermannSettings) -> None:
    """Raise MotionError for a target that turns on the spot, or more sharply than the steering allows."""
    even_progress = np.linspace(0, target.law.length, CHECKED_POINTS)
    progress = np.concatenate([even_progress, target.curve.breaks])
    by_progress = target.curve.at(progress)
    if (by_progress.velocity_mps[:, 0] == 0).any():
        raise MotionError("a car cannot turn on the spot; give the path corners with a radius, or use another robot")
    sharpest = float(np.abs(by_progress.angular_velocity_radps[:, 2]).max())
    if sharpest * settings.sharpest_radius_m > 1:
        raise MotionError(
            f"the path turns with a radius of {1 / sharpest:.3g} m, but a wheelbase of {settings.wheelbase_m:g} m and "
            f"{np.rad2deg(settings.max_steer_rad):.3g} deg of steering allow {settings.sharpest_radius_m:.3g} m or more"
        )
