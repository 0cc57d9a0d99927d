"""Planar courses: circles, squares, figures of eight, arcs and clothoids, as ideal wheeled robots drive them."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import ceil, gcd, pi, radians
from typing import Annotated, ClassVar, Literal

import numpy as np
import scipy
from annotated_types import Ge, Gt, Le, MaxLen, MinLen
from numpy.typing import ArrayLike

from vobench.errors import MotionError, SettingError
from vobench.geometry.rig import WheelGeometry
from vobench.geometry.se3 import Array
from vobench.geometry.vector import cross_2d
from vobench.motion.pioneer import wheel_speeds
from vobench.motion.wheeled import (
    KEYS_WITHOUT_CONTROLLER,
    MOVER_KEYS,
    Acceleration,
    Length,
    Mover,
    Pause,
    Speed,
    Wheeled,
)
from vobench.setting import MOST_POINTS
from vobench.trajectory.kinematics import (
    CurveMotion,
    Kinematics,
    Motion,
    TimeLaw,
    along,
    in_stages,
    level,
    rest_to_rest,
)
from vobench.trajectory.trajectory import Stamps

BLUNT = 0.05  # a curve whose derivative falls below this share of its largest nearly has a cusp
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, slots=True)
class ArcLength:
    """The curve's parameter as a function of its arc length s, up to `length`."""

    parameter: "scipy.interpolate.BSpline"
    length: float


def arc_length(speed: Callable[[Array], Array], knots: Array) -> ArcLength:
    """The inverse of the integral of `speed`, the length of the derivative (K,) at parameters (K,), from knots[0] on.

    Gauss-Legendre quadrature between knots (N,), which are so close that speed hardly changes between them, then a
    quintic through the inverse; a point at which the speed is not smooth should be a knot.
    """
    half = np.diff(knots) / 2
    middle = knots[:-1] + half
    parameters = middle[:, None] + half[:, None] * NODES
    speeds = speed(parameters.ravel()).reshape(parameters.shape)
    lengths = speeds @ WEIGHTS * half
    s = _running_sums(lengths)
    parameter = scipy.interpolate.make_interp_spline(s, knots, k=5)
    return ArcLength(parameter, float(s[-1]))


# Twelve nodes integrate a heading's cosine over a quarter turn to rounding.
COURSE_NODES, COURSE_WEIGHTS = np.polynomial.legendre.leggauss(12)
QUARTER_RAD = pi / 2


@dataclass(frozen=True, slots=True)
class CoursePiece:
    """A piece of a course: metres driven ahead (advance 1) or back (-1), or radians turned on the spot (0).

    The turn in rad per unit of progress changes linearly from `bend` to `bend + bent * length`.
    """

    length: float
    bend: float = 0.0
    bent: float = 0.0
    advance: float = 1.0

    @property
    def turned_rad(self) -> float:
        """The change of heading over the piece."""
        of_bend = self.bend * self.length
        of_change = self.bent * self.length**2 / 2
        return of_bend + of_change

    def parts(self) -> Iterator["CoursePiece"]:
        """The piece in parts that turn by a quarter at most."""
        end_bend = self.bend + self.bent * self.length
        largest_turn_rad = max(abs(self.bend), abs(end_bend)) * self.length
        count = max(1, ceil(largest_turn_rad / QUARTER_RAD))
        length = self.length / count
        for k in range(count):
            bend = self.bend + self.bent * k * length
            yield CoursePiece(length, bend, self.bent, self.advance)


def _running_sums(steps: ArrayLike) -> Array:
    """Sums (N + 1,) of the first 0, 1, ... N of the steps (N,)."""
    return np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(frozen=True, slots=True)
class Course:
    """Pieces one after the other, from the origin along x: a Curve.

    parts (P, 7): the progress at which each begins, its bend, bent and advance, and its initial heading, x and y.
    """

    breaks: Array
    parts: Array

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at progress s (K,), and their derivatives by s."""
        begins = self.parts[:, 0]
        part = np.searchsorted(begins, s, side="right") - 1
        part = np.clip(part, 0, len(self.parts) - 1)
        begin, bend, bent, advance, heading, x_m, y_m = self.parts[part].T

        inside = s - begin
        step_x_m, step_y_m = _steps(inside, bend, bent, heading_rad=heading)
        mean_bend = bend + bent * inside / 2
        T = level(
            x_m + advance * step_x_m,
            y_m + advance * step_y_m,
            heading + inside * mean_bend,
        )
        return along(
            T,
            speed=advance,
            acceleration=np.zeros_like(s),
            turn=bend + bent * inside,
            turn_rate=bent,
        )


def course(pieces: Iterable[CoursePiece]) -> Course:
    """The pieces laid end to end, each with the heading at the end of the one before."""
    pieces = list(pieces)
    parts = list[CoursePiece]()
    for piece in pieces:
        parts.extend(piece.parts())
    length = np.array([part.length for part in parts])
    bend = np.array([part.bend for part in parts])
    bent = np.array([part.bent for part in parts])
    advance = np.array([part.advance for part in parts])
    heading_rad = _running_sums([part.turned_rad for part in parts])[:-1]

    step_x_m, step_y_m = _steps(length, bend, bent, heading_rad=heading_rad)
    begin = _running_sums(length)[:-1]
    x_m = _running_sums(advance * step_x_m)[:-1]
    y_m = _running_sums(advance * step_y_m)[:-1]
    columns = [begin, bend, bent, advance, heading_rad, x_m, y_m]
    breaks = _running_sums([piece.length for piece in pieces])[1:-1]
    return Course(breaks, np.stack(columns, -1))


def _steps(
    length: Array,
    bend: Array,
    bent: Array,
    *,
    heading_rad: Array,
) -> tuple[Array, Array]:
    """Displacements (K,) in x and y over `length` of clothoids from a heading: the integrals of cosine and sine."""
    s = length[:, None] * (COURSE_NODES + 1) / 2
    mean_bend = bend[:, None] + bent[:, None] * s / 2
    heading = heading_rad[:, None] + s * mean_bend
    weights = COURSE_WEIGHTS / 2
    x_m = np.cos(heading) @ weights * length
    y_m = np.sin(heading) @ weights * length
    return x_m, y_m


KNOTS_PER_WAVE = 4096
MAX_WAVES = 20


@dataclass(frozen=True, slots=True)
class LissajousCurve:
    """x = A sin(a phi + phase), y = B sin(b phi): a closed Curve, from the origin along x at s = 0.

    derivatives: position and its first three derivatives (4, 2, K) at phi (K,).
    """

    derivatives: Callable[[Array], Array]
    arc: ArcLength
    breaks: Array  # none: it is smooth

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at arc length s (K,), and their derivatives by s."""
        s = np.mod(s, self.arc.length)
        (x0, y0), (start_rate_x, start_rate_y), _, _ = self.derivatives(np.zeros(1))[..., 0]
        start_heading = np.arctan2(start_rate_y, start_rate_x)
        (x, y), d1, d2, d3 = self.derivatives(self.arc.parameter(s))

        # Curvature and its derivative by arc length.
        speed = np.hypot(*d1)
        curvature = cross_2d(d1.T, d2.T) / speed**3
        jerk_term = cross_2d(d1.T, d3.T) / speed**3
        stretch_term = 3 * curvature * (d1 * d2).sum(0) / speed**2
        curvature_rate = (jerk_term - stretch_term) / speed

        offset = x - x0 + 1j * (y - y0)
        position = offset * np.exp(-1j * start_heading)
        heading = np.arctan2(d1[1], d1[0]) - start_heading
        return along(
            level(position.real, position.imag, heading),
            speed=np.ones_like(s),
            acceleration=np.zeros_like(s),
            turn=curvature,
            turn_rate=curvature_rate,
        )


def lissajous_curve(
    size_m: tuple[float, float],
    ratio: tuple[int, int],
    *,
    phase_rad: float,
) -> LissajousCurve:
    """The curve of the given length and width. Raises MotionError if it has cusps."""
    half_m = np.array(size_m)[:, None] / 2
    waves = np.array(ratio, float)[:, None]
    phases = np.array([[phase_rad], [0.0]])

    def derivatives(phi: Array) -> Array:
        angle = waves * phi + phases
        sine = half_m * np.sin(angle)
        cosine = half_m * np.cos(angle)
        first = waves * cosine
        second = -(waves**2) * sine
        third = -(waves**3) * cosine
        return np.stack([sine, first, second, third])

    def speed(phi: Array) -> Array:
        length: Array = np.hypot(*derivatives(phi)[1])
        return length

    n_knots = KNOTS_PER_WAVE * max(ratio) + 1
    knots = np.linspace(0, 2 * np.pi, n_knots)
    speeds = speed(knots)
    if speeds.min() < BLUNT * speeds.max():
        raise MotionError(
            f"with a phase of {phase_rad:g} rad the Lissajous curve comes to a point where it turns back; "
            "choose another phase: 0 where one number of the ratio is even, a quarter turn where both are odd"
        )
    return LissajousCurve(derivatives, arc_length(speed, knots), np.zeros(0))


CORNERS = 4
Laps = Annotated[int, Ge(1), Le(1000)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned(Wheeled):
    """A path of a given shape.

    With `start_seed`, it starts at a random pose from which the robot keeps clear of everything in its place (module
    `free_start`), in place of `start_m` and `start_heading_deg`.
    """

    start_seed: Annotated[int, Ge(0), Le(2**31 - 1)] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle(Planned):
    """A circle to the left, or clockwise to the right; laps need not be whole."""

    kind: Literal["circle"] = "circle"
    radius_m: Length
    laps: Annotated[float, Gt(0), Le(1000)] = 1.0
    clockwise: bool = False
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def way(self) -> CurveMotion:
        """The motion of an ideal robot. Raises MotionError."""
        length_m = 2 * pi * self.radius_m * self.laps
        law = rest_to_rest(length_m, speed=self.speed_mps, acceleration=self.accel_mps2)
        side = -1 if self.clockwise else 1
        circle = CoursePiece(length_m, bend=side / self.radius_m)
        return CurveMotion(course([circle]), law, self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Square(Planned):
    """A square from one end of a side: it turns on the spot at each corner, or rounds it on two clothoids.

    The clothoids meet at the smallest radius, corner_radius_m.
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
        """The motion of an ideal robot. Raises MotionError."""
        side = -1.0 if self.clockwise else 1.0
        count = CORNERS * self.laps
        if self.corner_radius_m:
            straight_m, corner = _rounded(self.side_m, self.corner_radius_m, side=side)
            pieces = [CoursePiece(straight_m), *corner] * count
            length_m = sum(piece.length for piece in pieces)
            law = rest_to_rest(length_m, speed=self.speed_mps, acceleration=self.accel_mps2)
            return CurveMotion(course(pieces), law, self.T_world_start)

        straight_law = rest_to_rest(self.side_m, speed=self.speed_mps, acceleration=self.accel_mps2)
        turn_law = rest_to_rest(pi / 2, speed=self.turn_radps, acceleration=self.turn_accel_radps2)
        law = in_stages([straight_law, turn_law] * count)
        straight = CoursePiece(self.side_m)
        turn = CoursePiece(pi / 2, bend=side, advance=0.0)
        return CurveMotion(course([straight, turn] * count), law, self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure8(Planned):
    """A figure of eight (Gerono's) from its crossing; half as wide as long without a width."""

    kind: Literal["figure_8"] = "figure_8"
    length_m: Length
    width_m: Length | None = None
    laps: Laps = 1
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def way(self) -> CurveMotion:
        """The motion of an ideal robot. Raises MotionError."""
        width_m = self.length_m / 2 if self.width_m is None else self.width_m
        curve = lissajous_curve((self.length_m, width_m), (1, 2), phase_rad=0.0)
        length_m = curve.arc.length * self.laps
        law = rest_to_rest(length_m, speed=self.speed_mps, acceleration=self.accel_mps2)
        return CurveMotion(curve, law, self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lissajous(Planned):
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
        is_in_range = all(1 <= n <= MAX_WAVES for n in self.ratio)
        if not is_in_range or gcd(*self.ratio) != 1:
            raise SettingError(
                f"should be two whole numbers from 1 to {MAX_WAVES} without a common divisor (got {list(self.ratio)})",
                "ratio",
            )

    def way(self) -> CurveMotion:
        """The motion of an ideal robot. Raises MotionError."""
        curve = lissajous_curve(self.size_m, self.ratio, phase_rad=radians(self.phase_deg))
        length_m = curve.arc.length * self.laps
        law = rest_to_rest(length_m, speed=self.speed_mps, acceleration=self.accel_mps2)
        return CurveMotion(curve, law, self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class StopAndGo(Planned):
    """Straight ahead by each length in turn, with a pause between them."""

    kind: Literal["stop_and_go"] = "stop_and_go"
    legs_m: Annotated[tuple[Length, ...], MinLen(1), MaxLen(MOST_POINTS)]
    pause_s: Pause = 1.0
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def way(self) -> CurveMotion:
        """The motion of an ideal robot. Raises MotionError."""

        def leg_law(leg_m: float) -> TimeLaw:
            return rest_to_rest(leg_m, speed=self.speed_mps, acceleration=self.accel_mps2)

        law = in_stages([leg_law(leg_m) for leg_m in self.legs_m], pause_s=self.pause_s)
        straight = course(CoursePiece(leg_m) for leg_m in self.legs_m)
        return CurveMotion(straight, law, self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class PureRotation(Planned):
    """A turn on the spot about the middle of the axle, to the left; to the right for a negative angle.

    The Pioneer does it without feedback: its controller holds the point h, not the axle.
    """

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = {"pioneer": KEYS_WITHOUT_CONTROLLER, "unicycle": ()}

    kind: Literal["pure_rotation"] = "pure_rotation"
    angle_deg: Annotated[float, Ge(-36_000), Le(36_000)]
    turn_radps: Speed = 1.0
    turn_accel_radps2: Acceleration = 2.0

    def __post_init__(self) -> None:
        Wheeled.__post_init__(self)
        if self.angle_deg == 0:
            raise SettingError("should be another angle than 0, or less than 0 for right", "angle_deg")

    def way(self) -> CurveMotion:
        """The motion of an ideal robot. Raises MotionError."""
        angle_rad = abs(radians(self.angle_deg))
        law = rest_to_rest(angle_rad, speed=self.turn_radps, acceleration=self.turn_accel_radps2)
        side = -1.0 if self.angle_deg < 0 else 1.0
        turn = CoursePiece(angle_rad, bend=side, advance=0.0)
        return CurveMotion(course([turn]), law, self.T_world_start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reverse(Planned):
    """Ahead and back to the start, straight or on an arc to the left (radius_m < 0: to the right).

    The Pioneer does it without feedback: led backwards by a point ahead of its axle it would turn round.
    """

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = {**MOVER_KEYS, "pioneer": KEYS_WITHOUT_CONTROLLER}

    kind: Literal["reverse"] = "reverse"
    length_m: Length
    radius_m: float | None = None
    pause_s: Pause = 0.0
    speed_mps: Speed = 0.3
    accel_mps2: Acceleration = 0.5

    def __post_init__(self) -> None:
        Wheeled.__post_init__(self)
        if self.radius_m is None:
            return
        if not 0.01 <= abs(self.radius_m) <= 1e5:
            raise SettingError(
                f"should be from 0.01 to 1e5, or less than 0 for right (got {self.radius_m:g})", "radius_m"
            )

    def way(self) -> CurveMotion:
        """The motion of an ideal robot. Raises MotionError."""
        bend = 1 / self.radius_m if self.radius_m else 0.0
        one_way = rest_to_rest(self.length_m, speed=self.speed_mps, acceleration=self.accel_mps2)
        law = in_stages([one_way, one_way], pause_s=self.pause_s)
        ahead = CoursePiece(self.length_m, bend)
        back = CoursePiece(self.length_m, -bend, advance=-1.0)
        return CurveMotion(course([ahead, back]), law, self.T_world_start)


# Courses on which no point ahead of the axle can lead a robot.
Unled = PureRotation | Reverse
Planar = Circle | Square | Figure8 | Lissajous | StopAndGo | Unled


def _rounded(side_m: float, radius_m: float, *, side: float) -> tuple[float, list[CoursePiece]]:
    """The straight length between two corners, and a corner. Raises MotionError if no straight is left."""
    half_m = pi / 2 * radius_m  # a clothoid to 1/radius turns by half of that curvature times its length
    bent = side / (radius_m * half_m)
    into_corner = CoursePiece(half_m, 0.0, bent)
    out_of_corner = CoursePiece(half_m, side / radius_m, -bent)
    corner = [into_corner, out_of_corner]
    corner_end = course(corner).at(np.array([2 * half_m]))
    end_m = corner_end.T_world_body[0, :2, 3]
    reach_m = float(abs(end_m[0]))  # by symmetry the same along the side it leaves and along the next
    straight_m = side_m - 2 * reach_m
    if straight_m <= 0:
        largest_m = radius_m * side_m / (2 * reach_m)
        raise MotionError(
            f"corner_radius_m is {radius_m:g}, too wide for a side of {side_m:g} m: its corners begin "
            f"{reach_m:.3g} m before the corner; it should be below {largest_m:.3g}"
        )
    return straight_m, corner


# Pieces no longer than this are integrated with four Gauss-Legendre nodes: exact for polynomials of degree 7.
LONGEST_NS = 2e7
ROLL_NODES, ROLL_WEIGHTS = np.polynomial.legendre.leggauss(4)


def rolled(motion: Motion, t_ns: Stamps, wheels: WheelGeometry) -> Array:
    """Rim angles (M, 2) in rad, left and right, at increasing instants (M,) of the motion of the axle's middle.

    Both are 0 at the motion's start. Only the forward speed turns wheels: a body that slides sideways does not.
    """
    knots_ns = _knots(motion, np.asarray(t_ns, float))
    middle_ns = (knots_ns[1:] + knots_ns[:-1]) / 2
    half_ns = np.diff(knots_ns) / 2
    nodes_ns = middle_ns[:, None] + half_ns[:, None] * ROLL_NODES  # (P, 4)
    kinematics = motion.at(nodes_ns.ravel())
    u = kinematics.velocity_mps[:, 0]
    omega = kinematics.angular_velocity_radps[:, 2]

    speeds_mps = np.stack(wheel_speeds(u, omega, track_m=wheels.track_m), -1)
    by_piece_mps = speeds_mps.reshape(-1, len(ROLL_NODES), 2).transpose(0, 2, 1)  # (P, 2, 4)
    travel_m = by_piece_mps @ ROLL_WEIGHTS * half_ns[:, None] / 1e9
    sums_m = np.concatenate([np.zeros((1, 2)), np.cumsum(travel_m, 0)])
    rims_rad: Array = sums_m / wheels.radius_m
    start = np.searchsorted(knots_ns, motion.start_ns)
    since_start: Array = rims_rad - rims_rad[start]
    return since_start[np.searchsorted(knots_ns, t_ns)]


def _knots(motion: Motion, t_ns: Array) -> Array:
    """All requested instants, the start, and every break between them, with intervals of LONGEST_NS at most."""
    requested_ns = np.unique(np.append(t_ns, motion.start_ns))
    breaks_ns = motion.breaks_ns
    is_inside = (breaks_ns > requested_ns[0]) & (breaks_ns < requested_ns[-1])
    knots_ns = np.unique(np.concatenate([requested_ns, breaks_ns[is_inside]]))

    lengths_ns = np.diff(knots_ns)
    counts = np.ceil(lengths_ns / LONGEST_NS).astype(int)  # of the pieces of each interval
    first_piece = np.cumsum(counts) - counts
    begins_ns = np.repeat(knots_ns[:-1], counts)
    number_in_interval = np.arange(len(begins_ns)) - np.repeat(first_piece, counts)
    piece_ns = np.repeat(lengths_ns / np.maximum(counts, 1), counts)
    starts_ns = begins_ns + number_in_interval * piece_ns
    return np.append(starts_ns, knots_ns[-1])
