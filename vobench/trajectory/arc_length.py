"""The parameter of a curve by its arc length, where no formula gives it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from vobench.geometry.se3 import Array

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

BLUNT = 0.05  # a curve whose derivative falls below this share of its largest all but comes to a point
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, slots=True)
class ArcLength:
    """parameter(s) is the curve's parameter at arc length s, up to `length`."""

    parameter: "BSpline"
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
