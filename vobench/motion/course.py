"""Planar courses: circles, squares, figures of eight, arcs and clothoids, as ideal wheeled robots drive them."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import ceil, gcd, pi, radians
from typing import Annotated, ClassVar, Literal

import numpy as np
import scipy
from annotated_types import Ge, Gt, Le, MinLen
from numpy.typing import ArrayLike

from vobench.errors import MotionError, SettingError
from vobench.geometry.rig import WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion.pioneer import wheel_speeds
from vobench.motion.wheeled import MOVER_KEYS, UNLED_KEYS, Acceleration, Length, Mover, Pause, Speed, Wheeled
from vobench.trajectory.kinematics import CurveMotion, Kinematics, Motion, along, in_stages, level, rest_to_rest
from vobench.trajectory.trajectory import Stamps

BLUNT = 0.05  # a curve whose derivative falls below this share of its largest all but comes to a point
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, slots=True)
class ArcLength:
    """parameter(s) is the curve's parameter at arc length s, up to `length`."""

    parameter: "scipy.interpolate.BSpline"
    length: float


def arc_length(speed: Callable[[Array], Array], knots: Array) -> ArcLength:
    """The inverse of the integral of `speed`, the length of the derivative (K,) at parameters (K,), from knots[0] on.

    Gauss-Legendre between knots (N,), so close that speed hardly changes between them, then a quintic through
    the inverse; a place where the speed is not smooth should be a knot.
    """
    half = np.diff(knots) / 2
    parameters = (knots[:-1] + half)[:, None] + half[:, None] * NODES
    lengths = speed(parameters.ravel()).reshape(parameters.shape) @ WEIGHTS * half
    s = np.concatenate([[0.0], np.cumsum(lengths)])
    return ArcLength(scipy.interpolate.make_interp_spline(s, knots, k=5), float(s[-1]))


# Twelve nodes integrate a heading's cosine over a quarter turn to rounding.
COURSE_NODES, COURSE_WEIGHTS = np.polynomial.legendre.leggauss(12)
QUARTER_RAD = pi / 2


@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch of progress: metres driven ahead (advance 1) or back (-1), or radians turned on the spot (0).

    The turn in rad per unit of progress runs evenly from `bend` to `bend + bent * length`.
    """

    length: float
    bend: float = 0.0
    bent: float = 0.0
    advance: float = 1.0

    @property
    def turned_rad(self) -> float:
        """The change of heading over it."""
        return self.bend * self.length + self.bent * self.length**2 / 2

    def parts(self) -> Iterator["Piece"]:
        """The same in parts that turn by a quarter at most."""
        most = max(abs(self.bend), abs(self.bend + self.bent * self.length)) * self.length
        count = max(1, ceil(most / QUARTER_RAD))
        length = self.length / count
        for k in range(count):
            yield Piece(length, self.bend + self.bent * k * length, self.bent, self.advance)


@dataclass(frozen=True, slots=True)
class Course:
    """Pieces in a row, from the origin along x: a Curve.

    parts (P, 7): the progress at which each begins, its bend, bent and advance, and its first heading, x and y.
    """

    breaks: Array
    parts: Array

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at progress s (K,), and their derivatives by s."""
        k = np.clip(np.searchsorted(self.parts[:, 0], s, side="right") - 1, 0, len(self.parts) - 1)
        begin, bend, bent, advance, heading, x_m, y_m = self.parts[k].T
        into = s - begin
        ahead_m, left_m = _steps(into, bend, bent, heading_rad=heading)
        T = level(x_m + advance * ahead_m, y_m + advance * left_m, heading + into * (bend + bent * into / 2))
        return along(T, speed=advance, acceleration=np.zeros_like(s), turn=bend + bent * into, turn_rate=bent)


def course(pieces: Iterable[Piece]) -> Course:
    """The pieces laid end to end, each with the heading that the one before ended with."""
    pieces = list(pieces)
    parts = [part for piece in pieces for part in piece.parts()]
    length, bend, bent, advance = np.array([(p.length, p.bend, p.bent, p.advance) for p in parts]).T
    heading_rad = _sums([part.turned_rad for part in parts])
    x_m, y_m = _steps(length, bend, bent, heading_rad=heading_rad[:-1])
    begin, x_m, y_m = (_sums(steps)[:-1] for steps in (length, advance * x_m, advance * y_m))
    columns = [begin, bend, bent, advance, heading_rad[:-1], x_m, y_m]
    return Course(_sums([piece.length for piece in pieces])[1:-1], np.stack(columns, -1))


def _steps(length: Array, bend: Array, bent: Array, *, heading_rad: Array) -> tuple[Array, Array]:
    """Displacements (K,) over `length` of clothoids that begin at a heading: the integrals of cosine and sine."""
    s = length[:, None] * (COURSE_NODES + 1) / 2
    heading = heading_rad[:, None] + s * (bend[:, None] + bent[:, None] * s / 2)
    weights = COURSE_WEIGHTS / 2
    return np.cos(heading) @ weights * length, np.sin(heading) @ weights * length


def _sums(steps: ArrayLike) -> Array:
    """Sums of the first 0, 1, ... all of the steps."""
    return np.concatenate([[0.0], np.cumsum(steps)])


KNOTS_PER_WAVE = 4096
MOST_WAVES = 20


@dataclass(frozen=True, slots=True)
class LissajousCurve:
    """x = A sin(a phi + phase), y = B sin(b phi): a closed Curve, from the origin along x at s = 0.

    derivatives: place and its first three derivatives (4, 2, K) at phi (K,).
    """

    derivatives: Callable[[Array], Array]
    arc: ArcLength
    breaks: Array  # none: it is smooth

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at arc length s (K,), and their derivatives by s."""
        s = np.mod(s, self.arc.length)
        (x0, y0), *first = self.derivatives(np.zeros(1))[..., 0]
        ahead = np.arctan2(first[0][1], first[0][0])
        (x, y), d1, d2, d3 = self.derivatives(self.arc.parameter(s))
        speed = np.hypot(*d1)
        bend = _cross(d1, d2) / speed**3
        bent = (_cross(d1, d3) / speed**3 - 3 * bend * (d1 * d2).sum(0) / speed**2) / speed
        place = (x - x0 + 1j * (y - y0)) * np.exp(-1j * ahead)
        T = level(place.real, place.imag, np.arctan2(d1[1], d1[0]) - ahead)
        return along(T, speed=np.ones_like(s), acceleration=np.zeros_like(s), turn=bend, turn_rate=bent)


def lissajous_curve(size_m: tuple[float, float], ratio: tuple[int, int], *, phase_rad: float) -> LissajousCurve:
    """One of the given length and width. Raises MotionError where it has points for bends."""
    half_m = np.array(size_m)[:, None] / 2
    waves = np.array(ratio, float)[:, None]
    phases = np.array([[phase_rad], [0.0]])

    def derivatives(phi: Array) -> Array:
        angle = waves * phi + phases
        sine = half_m * np.sin(angle)
        cosine = half_m * np.cos(angle)
        return np.stack([sine, waves * cosine, -(waves**2) * sine, -(waves**3) * cosine])

    def speed(phi: Array) -> Array:
        length: Array = np.hypot(*derivatives(phi)[1])
        return length

    knots = np.linspace(0, 2 * np.pi, KNOTS_PER_WAVE * max(ratio) + 1)
    if speed(knots).min() < BLUNT * speed(knots).max():
        raise MotionError(
            f"with a phase of {phase_rad:g} rad the Lissajous curve comes to a point where it turns back; "
            "choose another phase: 0 where one number of the ratio is even, a quarter turn where both are odd"
        )
    return LissajousCurve(derivatives, arc_length(speed, knots), np.zeros(0))


def _cross(a: Array, b: Array) -> Array:
    product: Array = a[0] * b[1] - a[1] * b[0]
    return product


CORNERS = 4
Laps = Annotated[int, Ge(1), Le(1000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle(Wheeled):
    """A circle to the left, or clockwise to the right; laps need not be whole."""

    kind: Literal["circle"] = "circle"
    radius_m: Length
    laps: Annotated[float, Gt(0), Le(1000)] = 1.0
    clockwise: bool = False
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        length_m = 2 * pi * self.radius_m * self.laps
        law = rest_to_rest(length_m, speed=self.speed_mps, acceleration=self.accel_mps2)
        bend = (-1 if self.clockwise else 1) / self.radius_m
        return CurveMotion(course([Piece(length_m, bend)]), law, self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Square(Wheeled):
    """A square from one end of a side: it turns on the spot at each corner, or goes round it on two clothoids.

    These meet where the way is tightest, at corner_radius_m.
    """

    kind: Literal["square"] = "square"
    side_m: Length
    corner_radius_m: Annotated[float, Ge(0), Le(1e5)] = 0.0
    laps: Laps = 1
    clockwise: bool = False
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5
    turn_radps: Speed = 1.0
    turn_accel_radps2: Acceleration = 2.0

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        side = -1.0 if self.clockwise else 1.0
        count = CORNERS * self.laps
        if self.corner_radius_m:
            straight_m, corner = _rounded(self.side_m, self.corner_radius_m, side=side)
            pieces = [Piece(straight_m), *corner] * count
            length_m = sum(piece.length for piece in pieces)
            law = rest_to_rest(length_m, speed=self.speed_mps, acceleration=self.accel_mps2)
            return CurveMotion(course(pieces), law, self.T_world_start)
        ahead = rest_to_rest(self.side_m, speed=self.speed_mps, acceleration=self.accel_mps2)
        turn = rest_to_rest(pi / 2, speed=self.turn_radps, acceleration=self.turn_accel_radps2)
        pieces = [Piece(self.side_m), Piece(pi / 2, bend=side, advance=0.0)] * count
        return CurveMotion(course(pieces), in_stages([ahead, turn] * count), self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure8(Wheeled):
    """A figure of eight (Gerono's) from its crossing; half as wide as long where no width is given."""

    kind: Literal["figure_8"] = "figure_8"
    length_m: Length
    width_m: Length | None = None
    laps: Laps = 1
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        width_m = self.length_m / 2 if self.width_m is None else self.width_m
        curve = lissajous_curve((self.length_m, width_m), (1, 2), phase_rad=0.0)
        law = rest_to_rest(curve.arc.length * self.laps, speed=self.speed_mps, acceleration=self.accel_mps2)
        return CurveMotion(curve, law, self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lissajous(Wheeled):
    """The closed curve x = A sin(a φ + phase), y = B sin(b φ) from φ = 0, of length 2A and width 2B, ratio [a, b]."""

    kind: Literal["lissajous"] = "lissajous"
    size_m: tuple[Length, Length]
    ratio: tuple[int, int] = (1, 2)
    phase_deg: float = 0.0
    laps: Laps = 1
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def __post_init__(self) -> None:
        Wheeled.__post_init__(self)
        if not all(1 <= n <= MOST_WAVES for n in self.ratio) or gcd(*self.ratio) != 1:
            raise SettingError(
                f"should be two whole numbers from 1 to {MOST_WAVES} without a common divisor (got {list(self.ratio)})",
                "ratio",
            )

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        curve = lissajous_curve(self.size_m, self.ratio, phase_rad=radians(self.phase_deg))
        law = rest_to_rest(curve.arc.length * self.laps, speed=self.speed_mps, acceleration=self.accel_mps2)
        return CurveMotion(curve, law, self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class StopAndGo(Wheeled):
    """Straight ahead by each length in turn, with a pause between them."""

    kind: Literal["stop_and_go"] = "stop_and_go"
    legs_m: Annotated[tuple[Length, ...], MinLen(1)]
    pause_s: Pause = 1.0
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        laws = [rest_to_rest(leg_m, speed=self.speed_mps, acceleration=self.accel_mps2) for leg_m in self.legs_m]
        return CurveMotion(course(map(Piece, self.legs_m)), in_stages(laws, pause_s=self.pause_s), self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class PureRotation(Wheeled):
    """A turn on the spot about the middle of the axle, to the left; to the right for a negative angle.

    The Pioneer does it without feedback: its controller holds the point h, not the axle.
    """

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = {"pioneer": UNLED_KEYS, "unicycle": ()}

    kind: Literal["pure_rotation"] = "pure_rotation"
    angle_deg: Annotated[float, Ge(-36_000), Le(36_000)]
    turn_radps: Speed = 1.0
    turn_accel_radps2: Acceleration = 2.0

    def __post_init__(self) -> None:
        Wheeled.__post_init__(self)
        if self.angle_deg == 0:
            raise SettingError("should be another angle than 0, or less than 0 for right", "angle_deg")

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        angle_rad = abs(radians(self.angle_deg))
        law = rest_to_rest(angle_rad, speed=self.turn_radps, acceleration=self.turn_accel_radps2)
        turn = Piece(angle_rad, -1.0 if self.angle_deg < 0 else 1.0, advance=0.0)
        return CurveMotion(course([turn]), law, self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reverse(Wheeled):
    """Ahead and back to the start, straight or on an arc to the left (radius_m < 0: to the right).

    The Pioneer does it without feedback: led backwards by a point ahead of its axle it would swing round.
    """

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = {**MOVER_KEYS, "pioneer": UNLED_KEYS}

    kind: Literal["reverse"] = "reverse"
    length_m: Length
    radius_m: float | None = None
    pause_s: Pause = 0.0
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def __post_init__(self) -> None:
        Wheeled.__post_init__(self)
        if self.radius_m is not None and not 0.01 <= abs(self.radius_m) <= 1e5:
            raise SettingError(
                f"should be from 0.01 to 1e5, or less than 0 for right (got {self.radius_m:g})", "radius_m"
            )

    def way(self) -> CurveMotion:
        """As an ideal robot drives it. Raises MotionError."""
        bend = 1 / self.radius_m if self.radius_m else 0.0
        law = rest_to_rest(self.length_m, speed=self.speed_mps, acceleration=self.accel_mps2)
        pieces = [Piece(self.length_m, bend), Piece(self.length_m, -bend, advance=-1.0)]
        return CurveMotion(course(pieces), in_stages([law, law], pause_s=self.pause_s), self.T_world_start)


# Where no point ahead of the axle can lead a robot.
Unled = PureRotation | Reverse
Planar = Circle | Square | Figure8 | Lissajous | StopAndGo | Unled


def _rounded(side_m: float, radius_m: float, *, side: float) -> tuple[float, list[Piece]]:
    """What is left of a side between its corners, and a corner. Raises MotionError where nothing is left."""
    half_m = pi / 2 * radius_m  # a clothoid to 1/radius turns by half of that curvature times its length
    bent = side / (radius_m * half_m)
    corner = [Piece(half_m, 0.0, bent), Piece(half_m, side / radius_m, -bent)]
    end_m = course(corner).at(np.array([2 * half_m])).T_world_body[0, :2, 3]
    reach_m = float(abs(end_m[0]))  # by symmetry as far along the side it leaves as along the next
    straight_m = side_m - 2 * reach_m
    if straight_m <= 0:
        most_m = radius_m * side_m / (2 * reach_m)
        raise MotionError(
            f"corner_radius_m is {radius_m:g}, too wide for a side of {side_m:g} m: its corners begin "
            f"{reach_m:.3g} m before the corner; it should be below {most_m:.3g}"
        )
    return straight_m, corner


# Pieces no longer than this are integrated with four Gauss-Legendre nodes: exact for polynomials of degree 7.
LONGEST_NS = 2e7


def rolled(motion: Motion, t_ns: Stamps, wheels: WheelGeometry) -> Array:
    """Rim angles (M, 2) in rad, left and right, at rising instants (M,) of a body whose axle's middle moves so.

    Both are 0 at the motion's start. Only the forward speed turns wheels: a body that slides sideways does not.
    """
    knots = _knots(motion, np.asarray(t_ns, float))
    nodes, weights = np.polynomial.legendre.leggauss(4)
    middle = (knots[1:] + knots[:-1]) / 2
    half = np.diff(knots) / 2
    moved = motion.at((middle[:, None] + half[:, None] * nodes).ravel())
    speeds = wheel_speeds(moved.velocity_mps[:, 0], moved.turn_radps[:, 2], track_m=wheels.track_m)
    travel = np.stack(speeds, -1).reshape(-1, 4, 2).transpose(0, 2, 1) @ weights * half[:, None] / 1e9
    rims: Array = np.concatenate([np.zeros((1, 2)), np.cumsum(travel, 0)]) / wheels.radius_m
    since_start: Array = rims - rims[np.searchsorted(knots, motion.start_ns)]
    return since_start[np.searchsorted(knots, t_ns)]


def _knots(motion: Motion, t_ns: Array) -> Array:
    """All instants asked, the start, and every break between them; cut where they are too far apart."""
    ends = np.unique(np.append(t_ns, motion.start_ns))
    inside = (motion.breaks_ns > ends[0]) & (motion.breaks_ns < ends[-1])
    knots = np.unique(np.concatenate([ends, motion.breaks_ns[inside]]))
    cuts = np.ceil(np.diff(knots) / LONGEST_NS).astype(int)
    begins = np.repeat(knots[:-1], cuts)
    nth = np.arange(len(begins)) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    return np.append(begins + nth * np.repeat(np.diff(knots) / np.maximum(cuts, 1), cuts), knots[-1])
