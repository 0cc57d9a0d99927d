"""Lissajous curves by arc length; the figure of eight is one of them."""

from dataclasses import dataclass
from math import gcd

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.robot.course import along
from vobench.trajectory.arc_length import BLUNT, ArcLength, arc_length
from vobench.trajectory.kinematics import Kinematics

KNOTS_PER_WAVE = 4096
MOST_WAVES = 20


@dataclass(frozen=True, slots=True)
class Lissajous:
    """x = A sin(a phi + phase), y = B sin(b phi): a closed Curve, from the origin along x at s = 0.

    half_m (2,) is A, B; waves (2,) is a, b; phase_rad (2,) is phase, 0.
    """

    half_m: Array
    waves: Array
    phase_rad: Array
    arc: ArcLength

    @property
    def breaks(self) -> Array:
        """None: it is smooth."""
        return np.zeros(0)

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at arc length s (K,), and their derivatives by s."""
        s = np.mod(s, self.arc.length)
        (x0, y0), *first = _derivatives(self.half_m, self.waves, self.phase_rad, np.zeros(1))[..., 0]
        ahead = np.arctan2(first[0][1], first[0][0])
        (x, y), d1, d2, d3 = _derivatives(self.half_m, self.waves, self.phase_rad, self.arc.parameter(s))
        speed = np.hypot(*d1)
        bend = _cross(d1, d2) / speed**3
        bent = (_cross(d1, d3) / speed**3 - 3 * bend * (d1 * d2).sum(0) / speed**2) / speed
        place = (x - x0 + 1j * (y - y0)) * np.exp(-1j * ahead)
        heading = np.arctan2(d1[1], d1[0]) - ahead
        return along(place.real, place.imag, heading, advance=np.ones_like(s), bend=bend, bent=bent)


def lissajous_curve(size_m: tuple[float, float], *, ratio: tuple[int, int], phase_rad: float) -> Lissajous:
    """One of the given length and width. Raises MotionError where it has no size, or has points for bends."""
    if not (len(size_m) == 2 and np.isfinite([*size_m, phase_rad]).all() and min(size_m) > 0):
        raise MotionError(
            f"a Lissajous curve of {' m by '.join(map(str, size_m))} m, phase {phase_rad:g} rad, cannot be driven; "
            "both sizes should be above 0, and all finite"
        )
    if any(n not in range(1, MOST_WAVES + 1) for n in ratio) or gcd(*map(int, ratio)) != 1:
        raise MotionError(
            f"the ratio of a Lissajous curve is {':'.join(map(str, ratio))}; it should be two whole numbers "
            f"from 1 to {MOST_WAVES} without a common divisor"
        )
    half_m, waves = np.array(size_m)[:, None] / 2, np.array(ratio, float)[:, None]
    phases = np.array([[phase_rad], [0.0]])

    def speed(phi: Array) -> Array:
        length: Array = np.hypot(*_derivatives(half_m, waves, phases, phi)[1])
        return length

    knots = np.linspace(0, 2 * np.pi, KNOTS_PER_WAVE * max(ratio) + 1)
    _require_blunt(speed(knots), phase_rad)
    return Lissajous(half_m, waves, phases, arc_length(speed, knots))


def _require_blunt(speeds: Array, phase_rad: float) -> None:
    if speeds.min() < BLUNT * speeds.max():
        raise MotionError(
            f"with a phase of {phase_rad:g} rad the Lissajous curve comes to a point where it turns back; "
            "choose another phase: 0 where one number of the ratio is even, a quarter turn where both are odd"
        )


def _derivatives(half_m: Array, waves: Array, phases: Array, phi: Array) -> Array:
    """Position and its first three derivatives by phi: (4, 2, K)."""
    angle = waves * phi + phases
    sine, cosine = half_m * np.sin(angle), half_m * np.cos(angle)
    return np.stack([sine, waves * cosine, -(waves**2) * sine, -(waves**3) * cosine])


def _cross(a: Array, b: Array) -> Array:
    product: Array = a[0] * b[1] - a[1] * b[0]
    return product
