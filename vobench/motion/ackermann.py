"""A car: the bicycle model with lagged and limited steering, kept on a planar path by feedback.

ACKERMANNS: the presets by name. ackermann: the motion.
x' = u cos psi, y' = u sin psi, psi' = u tan(delta) / L, delta' = (requested - delta) / lag, at the rear axle's middle.
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

STEP_S = 0.01
CHECKED_POINTS = 8192


@settings(kw_only=False)
class AckermannSettings:
    """A vehicle and its driver, who returns to the path over about lookahead_m."""

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
    """Position, heading and motion of the target at an instant; numbers or arrays (K,).

    curvature: in 1/m, one steering lag later; advance: 1 ahead, -1 back.
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
    """Position, heading and steering angle of a car, in m and rad, or their rates; numbers or arrays (K,)."""

    x: Array
    y: Array
    heading: Array
    steer: Array


@dataclass(frozen=True, slots=True)
class AckermannMotion:
    """A Motion with the state (M + 1, 4) of x, y, psi, delta at nodes_s, integrated from the node before an instant.

    advance (M,) is the direction of each step, ahead (1) or back (-1).
    """

    target: CurveMotion
    settings: AckermannSettings
    nodes_s: Array
    state: Array
    advance: Array
    start_ns: int
    end_ns: int
    breaks_ns: Array  # those of the target, and the times at which the steering begins to answer them

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """The kinematics (K,) after one Runge-Kutta step from the last node."""
        t_s = np.asarray(t_ns, float) / 1e9
        node = np.searchsorted(self.nodes_s, t_s, side="right") - 1
        node = np.clip(node, 0, len(self.advance) - 1)
        step_s = t_s - self.nodes_s[node]
        stages = []
        for share in (1.0, 0.5, 0.0):  # of the step before t_s
            stage_s = t_s - step_s * share
            stages.append(_reference(self.target, self.settings, stage_s, self.advance[node]))

        state = _stepped(State(*self.state[node].T), stages, step_s, self.settings)
        rates, speed, acceleration = _rates(state, stages[-1], self.settings)
        cosine_squared = np.cos(state.steer) ** 2
        curvature_rate = speed * rates.steer / cosine_squared
        angular_acceleration = (acceleration * np.tan(state.steer) + curvature_rate) / self.settings.wheelbase_m
        return along(
            level(state.x, state.y, state.heading),
            speed=speed,
            acceleration=acceleration,
            turn=rates.heading,
            turn_rate=angular_acceleration,
        )


def ackermann(target: CurveMotion, settings: AckermannSettings = ACKERMANNS["small_robot"]) -> AckermannMotion:
    """The motion of a car that follows a planar motion from its start, steering by curvature and position error.

    Raises MotionError if the target turns on the spot, or more sharply than the steering allows.
    """
    _require_drivable(target, settings)
    breaks_s = _breaks_s(target, settings)
    ends_s = [target.law.start_s, target.law.end_s]
    nodes_s = _nodes(np.insert(ends_s, 1, breaks_s))
    step_s = np.diff(nodes_s)
    middles_s = nodes_s[:-1] + step_s / 2
    advance, _ = _by_progress(target, middles_s)

    # The references of all steps at once, as Python floats, which are faster than arrays of one element.
    stages = []
    for share in (0.0, 0.5, 1.0):
        reference = _reference(target, settings, nodes_s[:-1] + step_s * share, advance)
        stages.append(np.array(reference).T.tolist())

    first = Reference(*stages[0][0])
    limit = settings.max_steer_rad
    steer = np.clip(np.arctan(settings.wheelbase_m * first.curvature), -limit, limit)
    state = State(first.x, first.y, first.heading, steer)
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
    """Rates of the state, the speed and its derivative: the model and its driver.

    After Kanayama et al. (1990), with gains by distance: at rest nothing moves.

    At a position error (ahead, aside) and a heading error, the driver goes faster by ahead / lookahead, and increases
    the curvature by aside / lookahead² + 2 sin(heading error) / lookahead: critically damped along the path, whatever
    the speed.
    """
    x, y, heading, steer = state
    cosine = np.cos(heading)
    sine = np.sin(heading)
    error_x = target.x - x
    error_y = target.y - y
    ahead = cosine * error_x + sine * error_y
    aside = cosine * error_y - sine * error_x
    heading_error = target.heading - heading
    error_cosine = np.cos(heading_error)
    error_sine = np.sin(heading_error)
    gain = target.advance / settings.lookahead_m

    curvature = target.curvature + aside / settings.lookahead_m**2 + 2 * gain * error_sine
    requested_steer = np.arctan(settings.wheelbase_m * curvature)
    requested_steer = _clipped(requested_steer, settings.max_steer_rad)
    steer_rate = (requested_steer - steer) / settings.steer_lag_s
    steer_rate = _clipped(steer_rate, settings.max_steer_radps)

    speed_factor = error_cosine + gain * ahead
    speed = target.speed * speed_factor
    heading_rate = speed * np.tan(steer) / settings.wheelbase_m
    ahead_rate = heading_rate * aside - speed + target.speed * error_cosine
    heading_error_rate = target.angular_velocity - heading_rate
    speed_factor_rate = gain * ahead_rate - error_sine * heading_error_rate
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
    T = now.T_world_body
    _, curvature = _by_progress(target, t_s + settings.steer_lag_s)
    return Reference(
        x=T[:, 0, 3],
        y=T[:, 1, 3],
        heading=np.arctan2(T[:, 1, 0], T[:, 0, 0]),
        speed=now.velocity_mps[:, 0],
        acceleration=now.acceleration_mps2[:, 0],
        angular_velocity=now.angular_velocity_radps[:, 2],
        curvature=curvature,
        advance=advance,
    )


def _by_progress(target: CurveMotion, t_s: Array) -> tuple[Array, Array]:
    """Advance (K,), 1 ahead, -1 back, 0 on the spot, and curvature in 1/m (K,) of the target at t_s."""
    inside_s = np.clip(t_s, target.law.start_s, target.law.end_s)
    progress, _, _ = target.law.at(inside_s)
    by_progress = target.curve.at(progress)
    advance = by_progress.velocity_mps[:, 0]
    curvature = advance * by_progress.angular_velocity_radps[:, 2]
    return advance, curvature


def _breaks_s(target: CurveMotion, settings: AckermannSettings) -> Array:
    """The times at which the target has a break, or the steering begins to answer one."""
    target_breaks_s = target.breaks_ns / 1e9
    steering_breaks_s = target_breaks_s - settings.steer_lag_s
    breaks_s = np.unique(np.concatenate([target_breaks_s, steering_breaks_s]))
    is_inside = (breaks_s > target.law.start_s) & (breaks_s < target.law.end_s)
    return breaks_s[is_inside]


def _nodes(marks_s: Array) -> Array:
    """Times at most STEP_S apart that include all marks."""
    starts_s = marks_s[:-1]
    ends_s = marks_s[1:]
    counts = np.ceil(np.diff(marks_s) / STEP_S).astype(int)
    spans = []
    for start_s, end_s, count in zip(starts_s, ends_s, counts, strict=True):
        spans.append(np.linspace(start_s, end_s, count, endpoint=False))
    return np.concatenate([*spans, marks_s[-1:]])


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
