"""The motion of a body: its pose, velocity and acceleration at any instant."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import scipy

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Stamps

STANDARD_GRAVITY_MPS2 = 9.80665  # exact by definition (3rd CGPM, 1901); along -z of the world


@dataclass(frozen=True, slots=True)
class Kinematics:
    """The motion of a body at K instants, relative to the world and in the axes of the body.

    T_world_body (K, 4, 4); velocity_mps (K, 3) and acceleration_mps2 (K, 3): the first and second derivative
    of its position in the world, turned into body axes (so without gravity); angular_velocity_radps (K, 3): angular
    velocity, with R' = R [turn]x; angular_acceleration_radps2 (K, 3): its derivative.
    """

    T_world_body: Array
    velocity_mps: Array
    angular_velocity_radps: Array
    acceleration_mps2: Array
    angular_acceleration_radps2: Array

    @property
    def twist(self) -> Array:
        """Velocities (K, 6): linear, then angular."""
        return np.concatenate([self.velocity_mps, self.angular_velocity_radps], -1)

    def of_mounted(self, T_body_sensor: Array) -> "Kinematics":
        """The kinematics of a sensor fixed to the body, in the sensor's frame, with the effect of the lever arm."""
        R_body_sensor = T_body_sensor[:3, :3]
        lever_m = T_body_sensor[:3, 3]
        lever_mps = np.cross(self.angular_velocity_radps, lever_m)
        euler_mps2 = np.cross(self.angular_acceleration_radps2, lever_m)
        centripetal_mps2 = np.cross(self.angular_velocity_radps, lever_mps)
        lever_mps2 = euler_mps2 + centripetal_mps2

        def in_sensor(vectors: Array) -> Array:
            return np.asarray(vectors @ R_body_sensor)

        return Kinematics(
            T_world_body=self.T_world_body @ T_body_sensor,
            velocity_mps=in_sensor(self.velocity_mps + lever_mps),
            angular_velocity_radps=in_sensor(self.angular_velocity_radps),
            acceleration_mps2=in_sensor(self.acceleration_mps2 + lever_mps2),
            angular_acceleration_radps2=in_sensor(self.angular_acceleration_radps2),
        )


class Motion(Protocol):
    """The motion of a body through the world, which can be evaluated at any instant.

    It continues at a constant rate shortly before `start_ns` and after `end_ns`, for shutters that are open there.
    """

    @property
    def start_ns(self) -> int:
        """The first instant."""

    @property
    def end_ns(self) -> int:
        """The last instant."""

    @property
    def breaks_ns(self) -> Array:
        """The instants (B,) in ns, float64 and increasing, at which the acceleration may jump."""

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """The pose and motion of the body at instants (K,) in ns, which may be fractions."""


def level(x_m: Array, y_m: Array, heading_rad: Array) -> Array:
    """T_world_body (K, 4, 4) of a body that stays level on the floor."""
    R = se3.rotation_z(heading_rad)
    z_m = np.zeros_like(x_m)
    return se3.transform(R, np.stack([x_m, y_m, z_m], -1))


def along(
    T_world_body: Array,
    *,
    speed: Array,
    acceleration: Array,
    turn: Array,
    turn_rate: Array,
) -> Kinematics:
    """The kinematics (K,) of a level body that moves only along its own x axis, as on wheels."""
    zero = np.zeros_like(speed)
    centripetal = speed * turn
    return Kinematics(
        T_world_body,
        velocity_mps=np.stack([speed, zero, zero], -1),
        angular_velocity_radps=np.stack([zero, zero, turn], -1),
        acceleration_mps2=np.stack([acceleration, centripetal, zero], -1),
        angular_acceleration_radps2=np.stack([zero, zero, turn_rate], -1),
    )


LONGEST_S = 86_400.0
SHORTEST_S = 1e-9  # the shortest duration of an acceleration, because instants are integers in nanoseconds
HALVINGS = 80  # the number of bisections, after which a part of a day is shorter than the resolution of float64
NO_STAGE = 1e-9  # a stage that is shorter than this, relative to the ramp, is omitted


@dataclass(frozen=True, slots=True)
class TimeLaw:
    """The progress along a path, in metres, radians or seconds, as a nondecreasing piecewise polynomial of time in s.

    Raises MotionError for a duration above a day.
    """

    progress: "scipy.interpolate.PPoly"

    def __post_init__(self) -> None:
        if not self.end_s - self.start_s <= LONGEST_S:
            raise MotionError(f"the motion would last {self.end_s - self.start_s:.3g} s; it should last at most a day")

    @property
    def start_s(self) -> float:
        """The start time."""
        return float(self.progress.x[0])

    @property
    def end_s(self) -> float:
        """The end time."""
        return float(self.progress.x[-1])

    @property
    def length(self) -> float:
        """Progress at the end."""
        return float(self.progress(self.end_s))

    def at(self, t_s: Array) -> tuple[Array, Array, Array]:
        """The progress (K,), its rate and the derivative of its rate.

        Before the start and after the end, the progress continues at a constant rate.
        """
        inside_s = np.clip(t_s, self.start_s, self.end_s)
        outside_s = t_s - inside_s
        progress = self.progress(inside_s)
        rate = self.progress(inside_s, 1)
        change = self.progress(inside_s, 2)
        return progress + rate * outside_s, rate, np.where(inside_s == t_s, change, 0.0)

    def when(self, progress: Array) -> Array:
        """The times (B,) at which the progress reaches values (B,), by bisection."""
        early = np.full(len(progress), self.start_s)
        late = np.full(len(progress), self.end_s)
        for _ in range(HALVINGS):
            middle = (early + late) / 2
            is_before = self.progress(middle) < progress
            early = np.where(is_before, middle, early)
            late = np.where(is_before, late, middle)
        return late


def rest_to_rest(length: float, *, speed: float, acceleration: float) -> TimeLaw:
    """The law of a motion from rest to `speed` and back to rest over `length`, with at most `acceleration`.

    The speed increases as the quintic 10τ³ - 15τ⁴ + 6τ⁵, so that the acceleration begins and ends smoothly. On a short
    path, the speed is not reached.
    Raises MotionError for a value that is not positive, and for a duration below an instant or above a day.
    """
    _require_positive(length, "the length of the path")
    _require_positive(speed, "the speed on the path")
    _require_positive(acceleration, "the acceleration on the path")

    # The quintic's steepest slope is 15/8 of the mean; two ramps alone cover the length at the reachable speed.
    reachable_speed = float(np.sqrt(length * acceleration * 8 / 15))
    top_speed = min(speed, reachable_speed)
    ramp_s = 15 / 8 * top_speed / acceleration
    cruise_s = length / top_speed - ramp_s
    duration_s = cruise_s + 2 * ramp_s
    if not ramp_s >= SHORTEST_S or not duration_s <= LONGEST_S:
        raise MotionError(
            f"{length:g} at a speed of {speed:g} and an acceleration of {acceleration:g} takes "
            f"{duration_s:.3g} s; it should be from a nanosecond to a day"
        )

    # Coefficients of progress, from the sixth power of time down.
    ramp_up = top_speed * np.array([ramp_s**-5, -3 * ramp_s**-4, 2.5 * ramp_s**-3, 0.0, 0.0, 0.0, 0.0])
    cruise = np.array([0.0, 0.0, 0.0, 0.0, 0.0, top_speed, 0.0])
    ramp_down = cruise - ramp_up
    stages = [(ramp_s, ramp_up), (cruise_s, cruise), (ramp_s, ramp_down)]
    return _in_turn([stage for stage in stages if stage[0] > NO_STAGE * ramp_s])


def _require_positive(value: float, name: str) -> None:
    """Raise MotionError for a value that is not a finite number above 0."""
    if not (np.isfinite(value) and value > 0):
        raise MotionError(f"{name} is {value:g}; it should be a finite number above 0")


def evenly(
    start_s: float,
    end_s: float,
    *,
    begin: float = 0.0,
    rate: float = 1.0,
) -> TimeLaw:
    """The law of a constant rate of progress from `begin`."""
    coefficients = np.array([[rate], [begin]])
    times_s = np.array([start_s, end_s])
    return TimeLaw(scipy.interpolate.PPoly(coefficients, times_s))


def in_stages(laws: Sequence[TimeLaw], *, pause_s: float = 0.0) -> TimeLaw:
    """The law that consists of several laws in sequence, with pauses between them. Raises MotionError for the pause."""
    if not (np.isfinite(pause_s) and pause_s >= 0):
        raise MotionError(f"pause_s is {pause_s:g}; it should be a finite number of seconds, 0 or more")
    stages = list[tuple[float, Array]]()
    for law in laws:
        if stages and pause_s:
            stages.append((pause_s, np.zeros(7)))
        durations_s = np.diff(law.progress.x)
        stages += zip(durations_s, law.progress.c.T, strict=True)
    return _in_turn(stages)


def through_speeds(lengths: Array, speeds: Array, pauses_s: Array) -> TimeLaw:
    """The law of progress over N lengths (N,) with given speeds (N + 1,) at their ends.

    Over a length, the speed changes as the quintic 10τ³ - 15τ⁴ + 6τ⁵ of time, so that the acceleration is 0 at its
    ends and at most 15/16 |v₁² - v₀²| / length between them. At an end where the speed is 0, the body pauses for
    pauses_s (N + 1,). Raises MotionError if the speeds at both ends of a length are 0.
    """
    stages = list[tuple[float, Array]]()
    for k, length in enumerate(lengths.tolist()):
        start_speed = float(speeds[k])
        end_speed = float(speeds[k + 1])
        if start_speed + end_speed <= 0:
            raise MotionError(f"the speed is 0 at both ends of a stretch of {length:g}; it should be more at one")
        if start_speed == 0 and pauses_s[k] > 0:
            stages.append((float(pauses_s[k]), np.zeros(7)))
        duration_s = 2 * length / (start_speed + end_speed)
        change = end_speed - start_speed
        ramp = change * np.array([duration_s**-5, -3 * duration_s**-4, 2.5 * duration_s**-3, 0.0, 0.0, 0.0, 0.0])
        even = np.array([0.0, 0.0, 0.0, 0.0, 0.0, start_speed, 0.0])
        stages.append((duration_s, ramp + even))
    return _in_turn(stages)


def _in_turn(stages: Sequence[tuple[float, Array]]) -> TimeLaw:
    """The law of several polynomials (duration, coefficients (7,)), each starting at the end of the one before."""
    durations_s = [duration_s for duration_s, _ in stages]
    starts_s = np.concatenate([[0.0], np.cumsum(durations_s)])
    coefficients = np.stack([polynomial for _, polynomial in stages], -1)
    coefficients[-1] = 0.0
    gains = []
    for polynomial, duration_s in zip(coefficients.T, durations_s, strict=True):
        gains.append(np.polyval(polynomial, duration_s))
    coefficients[-1] = np.concatenate([[0.0], np.cumsum(gains)[:-1]])
    return TimeLaw(scipy.interpolate.PPoly(coefficients, starts_s))


AT_REST = 1e-9  # at a lower rate of progress per second, a break of the curve is no break of the motion


class Curve(Protocol):
    """Poses as a function of the progress s: metres of a path, radians of a turn, or seconds of a recording."""

    @property
    def breaks(self) -> Array:
        """The progress values (B,), increasing, at which the second derivative of the pose may jump."""

    def at(self, s: Array) -> Kinematics:
        """The poses at s (K,), and their first and second derivatives with respect to s."""


@dataclass(frozen=True, slots=True)
class CurveMotion:
    """The motion along a curve by a time law. T_world_start (4, 4) is the pose of the frame of the curve."""

    curve: Curve
    law: TimeLaw
    T_world_start: Array = field(default_factory=lambda: np.eye(4))

    @property
    def start_ns(self) -> int:
        """The first instant."""
        return round(self.law.start_s * 1e9)

    @property
    def end_ns(self) -> int:
        """The last instant."""
        return round(self.law.end_s * 1e9)

    @property
    def breaks_ns(self) -> Array:
        """The times at which the law changes its polynomial, or at which the body passes a break of the curve."""
        passed_s = self.law.when(self.curve.breaks)
        rate = self.law.at(passed_s)[1]
        is_moving = rate > AT_REST
        is_inside = (passed_s > self.law.start_s) & (passed_s < self.law.end_s)
        law_breaks_s = self.law.progress.x[1:-1]
        curve_breaks_s = passed_s[is_moving & is_inside]
        return np.unique(np.concatenate([law_breaks_s, curve_breaks_s])) * 1e9

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """The kinematics (K,) on the curve at the progress of the law, by the chain rule."""
        progress, rate, change = self.law.at(np.asarray(t_ns, float) / 1e9)
        by_progress = self.curve.at(progress)
        rate = rate[:, None]
        change = change[:, None]
        rate_squared = rate**2
        tangential_mps2 = by_progress.velocity_mps * change
        angular_radps2 = by_progress.angular_velocity_radps * change
        return Kinematics(
            T_world_body=self.T_world_start @ by_progress.T_world_body,
            velocity_mps=by_progress.velocity_mps * rate,
            angular_velocity_radps=by_progress.angular_velocity_radps * rate,
            acceleration_mps2=by_progress.acceleration_mps2 * rate_squared + tangential_mps2,
            angular_acceleration_radps2=by_progress.angular_acceleration_radps2 * rate_squared + angular_radps2,
        )
