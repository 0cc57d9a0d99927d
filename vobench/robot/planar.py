"""Ways over the floor as ideal wheeled robots drive them: exact, from rest to rest, from any start.

circle, square, figure_8, lissajous, stop_and_go, pure_rotation, reverse: each a curve and a law of time.
The body's x axis lies along the way; lengths are in m, and `start` is the body's (x_m, y_m, heading_rad) at first.
Each raises MotionError with a sentence for what cannot be driven.
"""

from collections.abc import Sequence
from math import pi

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.robot.course import Piece, course
from vobench.robot.lissajous import Lissajous, lissajous_curve
from vobench.trajectory.curve import CurveMotion
from vobench.trajectory.kinematics import level
from vobench.trajectory.time_law import in_stages, rest_to_rest

Start = tuple[float, float, float]
ORIGIN: Start = (0.0, 0.0, 0.0)
CORNERS = 4
MOST_LAPS = 1000


def circle(
    radius_m: float,
    *,
    speed_mps: float,
    laps: float = 1.0,
    clockwise: bool = False,
    accel_mps2: float = 0.5,
    start: Start = ORIGIN,
) -> CurveMotion:
    """A circle to the left of the start, or to its right if clockwise; laps need not be whole."""
    _require_positive("radius_m", radius_m)
    _require_laps(laps, whole=False)
    length_m = 2 * pi * radius_m * laps
    law = rest_to_rest(length_m, speed=speed_mps, acceleration=accel_mps2)
    return CurveMotion(course([Piece(length_m, bend=_side(clockwise=clockwise) / radius_m)]), law, _placed(start))


def square(
    side_m: float,
    *,
    speed_mps: float,
    laps: int = 1,
    corner_radius_m: float = 0.0,
    turn_radps: float = 1.0,
    clockwise: bool = False,
    accel_mps2: float = 0.5,
    turn_accel_radps2: float = 2.0,
    start: Start = ORIGIN,
) -> CurveMotion:
    """A square from one end of a straight stretch; where corner_radius_m is 0, with stops to turn on the spot.

    Else each corner is two clothoids that meet where the way is tightest, at corner_radius_m.
    """
    _require_positive("side_m", side_m)
    _require_laps(laps, whole=True)
    if corner_radius_m:
        straight_m, corner = _rounded(side_m, corner_radius_m, side=_side(clockwise=clockwise))
        pieces = [Piece(straight_m), *corner] * (CORNERS * int(laps))
        law = rest_to_rest(sum(piece.length for piece in pieces), speed=speed_mps, acceleration=accel_mps2)
        return CurveMotion(course(pieces), law, _placed(start))
    ahead = rest_to_rest(side_m, speed=speed_mps, acceleration=accel_mps2)
    turn = rest_to_rest(pi / 2, speed=turn_radps, acceleration=turn_accel_radps2)
    pieces = [Piece(side_m), Piece(pi / 2, bend=_side(clockwise=clockwise), advance=0.0)] * (CORNERS * int(laps))
    return CurveMotion(course(pieces), in_stages([ahead, turn] * (CORNERS * int(laps))), _placed(start))


def figure_8(
    length_m: float,
    *,
    width_m: float | None = None,
    speed_mps: float,
    laps: int = 1,
    accel_mps2: float = 0.5,
    start: Start = ORIGIN,
) -> CurveMotion:
    """A figure of eight (Gerono's) from its crossing, half as wide as long where no width is given."""
    size_m = (length_m, length_m / 2 if width_m is None else width_m)
    return lissajous(size_m, speed_mps=speed_mps, laps=laps, accel_mps2=accel_mps2, start=start)


def lissajous(
    size_m: tuple[float, float],
    *,
    ratio: tuple[int, int] = (1, 2),
    phase_rad: float = 0.0,
    speed_mps: float,
    laps: int = 1,
    accel_mps2: float = 0.5,
    start: Start = ORIGIN,
) -> CurveMotion:
    """The curve x = A sin(a phi + phase), y = B sin(b phi) of length 2A and width 2B, ratio a:b, from phi = 0."""
    _require_laps(laps, whole=True)
    curve: Lissajous = lissajous_curve(size_m, ratio=ratio, phase_rad=phase_rad)
    law = rest_to_rest(curve.arc.length * int(laps), speed=speed_mps, acceleration=accel_mps2)
    return CurveMotion(curve, law, _placed(start))


def stop_and_go(
    legs_m: Sequence[float], *, speed_mps: float, pause_s: float, accel_mps2: float = 0.5, start: Start = ORIGIN
) -> CurveMotion:
    """Straight ahead by each length in turn, with a pause between them."""
    if not len(legs_m):
        raise MotionError("legs_m is empty; it should hold the length of each stretch between two stops")
    laws = [rest_to_rest(leg_m, speed=speed_mps, acceleration=accel_mps2) for leg_m in legs_m]
    return CurveMotion(course(map(Piece, legs_m)), in_stages(laws, pause_s=pause_s), _placed(start))


def pure_rotation(
    angle_rad: float, *, rate_radps: float, accel_radps2: float = 2.0, start: Start = ORIGIN
) -> CurveMotion:
    """A turn on the spot, about the middle of the axle: to the left, or to the right where the angle is negative."""
    if not (np.isfinite(angle_rad) and angle_rad):
        raise MotionError(f"the angle is {angle_rad:g} rad; it should be finite and other than 0")
    law = rest_to_rest(abs(angle_rad), speed=rate_radps, acceleration=accel_radps2)
    return CurveMotion(
        course([Piece(abs(angle_rad), _side(clockwise=angle_rad < 0), advance=0.0)]), law, _placed(start)
    )


def reverse(
    length_m: float,
    *,
    speed_mps: float,
    radius_m: float | None = None,
    pause_s: float = 0.0,
    accel_mps2: float = 0.5,
    start: Start = ORIGIN,
) -> CurveMotion:
    """Ahead and back to the start on a straight line, or on an arc to the left (to the right if radius_m < 0)."""
    _require_positive("length_m", length_m)
    if radius_m is not None and not (np.isfinite(radius_m) and radius_m):
        raise MotionError(
            f"radius_m is {radius_m:g}; it should be finite and other than 0, or none for a straight line"
        )
    bend = 1 / radius_m if radius_m else 0.0
    law = rest_to_rest(length_m, speed=speed_mps, acceleration=accel_mps2)
    pieces = [Piece(length_m, bend), Piece(length_m, -bend, advance=-1.0)]
    return CurveMotion(course(pieces), in_stages([law, law], pause_s=pause_s), _placed(start))


def _rounded(side_m: float, radius_m: float, *, side: float) -> tuple[float, list[Piece]]:
    """What is left of a side between its corners, and a corner. Raises MotionError where nothing is left."""
    _require_positive("corner_radius_m", radius_m)
    half_m = pi / 2 * radius_m  # a clothoid to 1/radius turns by half of that curvature times its length
    bent = side / (radius_m * half_m)
    corner = [Piece(half_m, 0.0, bent), Piece(half_m, side / radius_m, -bent)]
    reach_m = float(abs(_end(corner)[0]))  # by symmetry as far along the side it leaves as along the next
    straight_m = side_m - 2 * reach_m
    if straight_m <= 0:
        most_m = radius_m * side_m / (2 * reach_m)
        raise MotionError(
            f"corner_radius_m is {radius_m:g}, too wide for a side of {side_m:g} m: its corners begin "
            f"{reach_m:.3g} m before the corner; it should be below {most_m:.3g}"
        )
    return straight_m, corner


def _end(pieces: Sequence[Piece]) -> Array:
    """Where pieces from the origin end (2,)."""
    end: Array = course(pieces).at(np.array([sum(piece.length for piece in pieces)])).T_world_body[0, :2, 3]
    return end


def _placed(start: Start) -> Array:
    """T_world_start (4, 4)."""
    if np.shape(start) != (3,) or not np.isfinite(start).all():
        raise MotionError(f"start is {tuple(start)}; it should be three finite numbers: x and y in m, heading in rad")
    T_world_start: Array = level(*(np.array([value], float) for value in start))[0]
    return T_world_start


def _side(*, clockwise: bool) -> float:
    return -1.0 if clockwise else 1.0


def _require_positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise MotionError(f"{name} is {value:g}; it should be a finite number of metres above 0")


def _require_laps(laps: float, *, whole: bool) -> None:
    if not 0 < laps <= MOST_LAPS or (whole and laps != round(laps)):
        what = "a whole number from 1 to" if whole else "above 0 and at most"
        raise MotionError(f"laps is {laps:g}; it should be {what} {MOST_LAPS}")
