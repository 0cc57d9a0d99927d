"""Motion of a body: pose, velocity and acceleration at any instant, each the derivative of the other."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import scipy

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Stamps

STANDARD_GRAVITY_MPS2 = 9.80665  # exact by definition (3rd CGPM, 1901); it pulls down the world's z axis


@dataclass(frozen=True, slots=True)
class Kinematics:
    """A body at K instants; velocities and accelerations are of its origin, against the world, in its own axes.

    T_world_body (K, 4, 4); velocity_mps (K, 3) and acceleration_mps2 (K, 3): the first and second derivative
    of its position in the world, turned into body axes (so without gravity); turn_radps (K, 3): angular
    velocity, with R' = R [turn]x; turn_rate_radps2 (K, 3): its derivative.
    """

    T_world_body: Array
    velocity_mps: Array
    turn_radps: Array
    acceleration_mps2: Array
    turn_rate_radps2: Array

    @property
    def twist(self) -> Array:
        """Velocities (K, 6): linear, then angular."""
        return np.concatenate([self.velocity_mps, self.turn_radps], -1)

    def of_mounted(self, T_body_sensor: Array) -> "Kinematics":
        """The same of something fixed to the body, in that thing's axes: the lever arm's share is added."""
        R_sensor_body = T_body_sensor[:3, :3].T
        lever_m = T_body_sensor[:3, 3]
        w = self.turn_radps
        dw = self.turn_rate_radps2
        swung_mps = np.cross(w, lever_m)
        swung_mps2 = np.cross(dw, lever_m) + np.cross(w, swung_mps)

        def seen(vectors: Array) -> Array:
            turned: Array = vectors @ R_sensor_body.T
            return turned

        return Kinematics(
            self.T_world_body @ T_body_sensor,
            seen(self.velocity_mps + swung_mps),
            seen(w),
            seen(self.acceleration_mps2 + swung_mps2),
            seen(dw),
        )


class Motion(Protocol):
    """A body's way through the world, exact at any instant.

    Goes on evenly for a little before `start_ns` and after `end_ns`, for shutters that are open there.
    """

    @property
    def start_ns(self) -> int:
        """The first instant."""

    @property
    def end_ns(self) -> int:
        """The last instant."""

    @property
    def breaks_ns(self) -> Array:
        """Instants (B,) float64 in ns, rising, between which acceleration is smooth: where it may jump."""

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """Where the body is and how it moves at instants (K,), whole nanoseconds or fractions of them."""


def level(x_m: Array, y_m: Array, heading_rad: Array) -> Array:
    """T_world_body (K, 4, 4) of a body that stays level on the floor."""
    return se3.transform(se3.rotation_z(heading_rad), np.stack([x_m, y_m, np.zeros_like(x_m)], -1))


def along(T_world_body: Array, *, speed: Array, acceleration: Array, turn: Array, turn_rate: Array) -> Kinematics:
    """A level body (K,) that goes along its own x axis alone, as wheels do."""
    still = np.zeros_like(speed)
    return Kinematics(
        T_world_body,
        velocity_mps=np.stack([speed, still, still], -1),
        turn_radps=np.stack([still, still, turn], -1),
        acceleration_mps2=np.stack([acceleration, speed * turn, still], -1),
        turn_rate_radps2=np.stack([still, still, turn_rate], -1),
    )


LONGEST_S = 86_400.0
SHORTEST_S = 1e-9  # of speeding up: an instant is a whole nanosecond
HALVINGS = 80  # of a day, they leave less than float64 can tell


@dataclass(frozen=True, slots=True)
class TimeLaw:
    """Progress, metres or radians or seconds of a way, as a never falling polynomial in pieces over time in s.

    Raises MotionError where it lasts longer than a day.
    """

    progress: "scipy.interpolate.PPoly"

    def __post_init__(self) -> None:
        if not self.end_s - self.start_s <= LONGEST_S:
            raise MotionError(f"the motion would last {self.end_s - self.start_s:.3g} s; a day is the longest")

    @property
    def start_s(self) -> float:
        """When it begins."""
        return float(self.progress.x[0])

    @property
    def end_s(self) -> float:
        """When it ends."""
        return float(self.progress.x[-1])

    @property
    def length(self) -> float:
        """Progress at its end."""
        return float(self.progress(self.end_s))

    def at(self, t_s: Array) -> tuple[Array, Array, Array]:
        """Progress (K,), its rate and the rate's derivative; outside its time it goes on at the rate of its end."""
        inside_s = np.clip(t_s, self.start_s, self.end_s)
        s, rate, change = (self.progress(inside_s, order) for order in range(3))
        return s + rate * (t_s - inside_s), rate, np.where(inside_s == t_s, change, 0.0)

    def when(self, progress: Array) -> Array:
        """The times (B,) at which a progress (B,) is passed, found by halving."""
        early = np.full(len(progress), self.start_s)
        late = np.full(len(progress), self.end_s)
        for _ in range(HALVINGS):
            middle = (early + late) / 2
            is_before = self.progress(middle) < progress
            early = np.where(is_before, middle, early)
            late = np.where(is_before, late, middle)
        return late


def rest_to_rest(length: float, *, speed: float, acceleration: float) -> TimeLaw:
    """From rest to `speed` and back to rest over `length`, at most at `acceleration`; a short way is never that fast.

    Speed rises as the quintic 10τ³ - 15τ⁴ + 6τ⁵, so that acceleration begins and ends smoothly.
    Raises MotionError where a figure is not positive, or it would take less than an instant or more than a day.
    """
    named = {"the length of the way": length, "the speed on it": speed, "the acceleration on it": acceleration}
    for name, value in named.items():
        if not (np.isfinite(value) and value > 0):
            raise MotionError(f"{name} is {value:g}; it should be a finite number above 0")
    top = min(speed, float(np.sqrt(length * acceleration * 8 / 15)))
    ramp_s = 15 / 8 * top / acceleration
    cruise_s = length / top - ramp_s
    if not ramp_s >= SHORTEST_S or not cruise_s + 2 * ramp_s <= LONGEST_S:
        raise MotionError(
            f"{length:g} at a speed of {speed:g} and an acceleration of {acceleration:g} takes "
            f"{cruise_s + 2 * ramp_s:.3g} s; it should be from a nanosecond to a day"
        )
    rise = top * np.array([ramp_s**-5, -3 * ramp_s**-4, 2.5 * ramp_s**-3, 0.0, 0.0, 0.0, 0.0])
    even = np.array([0.0, 0.0, 0.0, 0.0, 0.0, top, 0.0])
    stages = [(ramp_s, rise), (cruise_s, even), (ramp_s, even - rise)]
    return _in_turn([stage for stage in stages if stage[0] > 1e-9 * ramp_s])


def evenly(start_s: float, end_s: float, *, begin: float = 0.0, rate: float = 1.0) -> TimeLaw:
    """From `begin` on at a constant rate."""
    return TimeLaw(scipy.interpolate.PPoly(np.array([[rate], [begin]]), np.array([start_s, end_s])))


def in_stages(laws: Sequence[TimeLaw], *, pause_s: float = 0.0) -> TimeLaw:
    """One law after another, each from where the last ended, with rests between. Raises MotionError for its pause."""
    if not (np.isfinite(pause_s) and pause_s >= 0):
        raise MotionError(f"pause_s is {pause_s:g}; it should be a finite number of seconds, 0 or more")
    stages = list[tuple[float, Array]]()
    for law in laws:
        if stages and pause_s:
            stages.append((pause_s, np.zeros(7)))
        stages += zip(np.diff(law.progress.x), law.progress.c.T, strict=True)
    return _in_turn(stages)


def _in_turn(stages: Sequence[tuple[float, Array]]) -> TimeLaw:
    """The law of polynomials (duration, coefficients (7,)), each lifted to where the one before ended."""
    x = np.concatenate([[0.0], np.cumsum([duration_s for duration_s, _ in stages])])
    c = np.stack([coefficients for _, coefficients in stages], -1)
    c[-1] = 0.0
    gained = [np.polyval(c[:, k], duration_s) for k, (duration_s, _) in enumerate(stages)]
    c[-1] = np.concatenate([[0.0], np.cumsum(gained)[:-1]])
    return TimeLaw(scipy.interpolate.PPoly(c, x))


AT_REST = 1e-9  # progress per second: slower than that, a break of the curve is also one of the law


class Curve(Protocol):
    """Poses by progress s along a way: metres of a path, radians of a turn, seconds of a recording."""

    @property
    def breaks(self) -> Array:
        """Progress (B,), rising, between which the second derivative of the pose is smooth."""

    def at(self, s: Array) -> Kinematics:
        """Poses at s (K,) with velocities and accelerations as if s were seconds: derivatives by s."""


@dataclass(frozen=True, slots=True)
class CurveMotion:
    """A body on a curve by a law of time; T_world_start lays the curve's own frame in the world."""

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
        """Where the law changes its polynomial, and where the body passes a break of the curve, unless at rest."""
        passed_s = self.law.when(self.curve.breaks)
        rate = self.law.at(passed_s)[1]
        passed_s = passed_s[(rate > AT_REST) & (passed_s > self.law.start_s) & (passed_s < self.law.end_s)]
        return np.unique(np.concatenate([self.law.progress.x[1:-1], passed_s])) * 1e9

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """The curve where the law says, by the chain rule."""
        s, rate, change = self.law.at(np.asarray(t_ns, float) / 1e9)
        by_s = self.curve.at(s)
        rate = rate[:, None]
        change = change[:, None]
        return Kinematics(
            T_world_body=self.T_world_start @ by_s.T_world_body,
            velocity_mps=by_s.velocity_mps * rate,
            turn_radps=by_s.turn_radps * rate,
            acceleration_mps2=by_s.acceleration_mps2 * rate**2 + by_s.velocity_mps * change,
            turn_rate_radps2=by_s.turn_rate_radps2 * rate**2 + by_s.turn_radps * change,
        )
