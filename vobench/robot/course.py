"""A way over the floor made of straight lines, arcs, clothoids and turns on the spot."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil, pi

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array
from vobench.trajectory.kinematics import Kinematics, level

# Twelve nodes integrate a heading's cosine over a quarter turn to rounding.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)
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
    """Pieces in a row, from the origin along x: a Curve. Arrays (P,) are of the parts, at their beginnings."""

    breaks: Array
    begin: Array
    bend: Array
    bent: Array
    advance: Array
    heading_rad: Array
    x_m: Array
    y_m: Array

    def at(self, s: Array) -> Kinematics:
        """Poses (K, 4, 4) at progress s (K,), and their derivatives by s."""
        k = np.clip(np.searchsorted(self.begin, s, side="right") - 1, 0, len(self.begin) - 1)
        into, bend, bent, advance = s - self.begin[k], self.bend[k], self.bent[k], self.advance[k]
        x_m, y_m = _steps(into, bend, bent, heading_rad=self.heading_rad[k])
        heading = self.heading_rad[k] + into * (bend + bent * into / 2)
        return along(
            self.x_m[k] + advance * x_m,
            self.y_m[k] + advance * y_m,
            heading,
            advance=advance,
            bend=bend + bent * into,
            bent=bent,
        )


def course(pieces: Iterable[Piece]) -> Course:
    """The pieces laid end to end, each with the heading that the one before ended with."""
    pieces = list(pieces)
    parts = [part for piece in pieces for part in piece.parts()]
    length, bend, bent, advance = np.array([(p.length, p.bend, p.bent, p.advance) for p in parts]).T
    heading_rad = _sums([part.turned_rad for part in parts])
    x_m, y_m = _steps(length, bend, bent, heading_rad=heading_rad[:-1])
    return Course(
        breaks=_sums([piece.length for piece in pieces])[1:-1],
        begin=_sums(length)[:-1],
        bend=bend,
        bent=bent,
        advance=advance,
        heading_rad=heading_rad[:-1],
        x_m=_sums(advance * x_m)[:-1],
        y_m=_sums(advance * y_m)[:-1],
    )


def along(x_m: Array, y_m: Array, heading_rad: Array, *, advance: Array, bend: Array, bent: Array) -> Kinematics:
    """A level body (K,) that goes along its own x axis alone, as wheels do: its derivatives by progress."""
    still = np.zeros_like(x_m)
    return Kinematics(
        T_world_body=level(x_m, y_m, heading_rad),
        velocity_mps=np.stack([advance, still, still], -1),
        turn_radps=np.stack([still, still, bend], -1),
        acceleration_mps2=np.stack([still, advance * bend, still], -1),
        turn_rate_radps2=np.stack([still, still, bent], -1),
    )


def _steps(length: Array, bend: Array, bent: Array, *, heading_rad: Array) -> tuple[Array, Array]:
    """Displacements (K,) over `length` of clothoids that begin at a heading: the integrals of cosine and sine."""
    s = length[:, None] * (NODES + 1) / 2
    heading = heading_rad[:, None] + s * (bend[:, None] + bent[:, None] * s / 2)
    weights = WEIGHTS / 2
    return np.cos(heading) @ weights * length, np.sin(heading) @ weights * length


def _sums(steps: ArrayLike) -> Array:
    """Sums of the first 0, 1, ... all of the steps."""
    return np.concatenate([[0.0], np.cumsum(steps)])
