"""Identification of theta from a drive by least squares, since (18) is linear in it. Source: Martins et al. (2009)."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.motion.pioneer import Theta

# The largest growth of a relative error of the drive into theta. A drive through waypoints has 2 to 4; above this
# limit, noise of a thousandth would be as large as the result.
WORST_CONDITION = 1e3
# A parameter with less than this share of an undetermined combination is determined well enough by itself.
SHARE = 0.1
MIN_ROWS = 3
# A window's weight and its first five derivatives are 0 at its ends, -1 and 1; its integral is 1.
BUMP = Polynomial([1.0, 0.0, -1.0]) ** 6
WEIGHT = BUMP / float(BUMP.integ()(1) - BUMP.integ()(-1))
WEIGHT_INTEGRAL = WEIGHT.integ()
WEIGHT_SLOPE = WEIGHT.deriv()
WEIGHT_CURVATURE = WEIGHT.deriv(2)
WINDOW_S = 1.0


@dataclass(frozen=True, slots=True)
class Fit:
    """Theta of a drive, the RMS residuals of the references, and the condition number of the fit."""

    theta: Theta
    u_ref_rms_mps: float
    omega_ref_rms_radps: float
    condition: float


def identify(speeds: ArrayLike, accelerations: ArrayLike, references: ArrayLike) -> Fit:
    """Theta from N instants of (u, omega), (u', omega') and (u_ref, omega_ref), each (N, 2), in m, rad and s.

    Raises MotionError if the drive does not determine all six parameters, with their names.
    """
    pairs = [np.asarray(pair, float) for pair in (speeds, accelerations, references)]
    shapes = [pair.shape for pair in pairs]
    first_shape = shapes[0]
    is_equal = all(shape == first_shape for shape in shapes)
    is_table = len(first_shape) == 2 and first_shape[0] >= MIN_ROWS and first_shape[1] == 2
    if not is_equal or not is_table:
        raise MotionError(f"a drive to identify needs three arrays (N, 2) of one length, 3 or more, got {shapes}")
    if not np.isfinite(pairs).all():
        raise MotionError("a drive to identify must be finite everywhere; leave out the instants that are not")
    instants = [*pairs, _products(pairs[0])]
    return _fit(np.array(instants))


def _products(speeds: Array) -> Array:
    """The products omega^2 and u omega (N, 2) of speeds (N, 2), by which (18) couples both axes."""
    u, omega = speeds.T
    return np.stack([omega**2, u * omega], -1)


def identify_odometry(
    t_s: Array,
    odometry: Array,
    held_s: Array,
    references: Array,
) -> Fit:
    """Theta from distance rolled in m and heading in rad (M, 2) by the wheels at t_s (M,), in windows of WINDOW_S.

    references (N, 2) of u in m/s and omega in rad/s apply from held_s (N,) on. Each window is one row of the fit: (18)
    times a smooth weight, integrated by parts, so that no reading is differentiated. Raises MotionError as `identify`.
    """
    is_first_inside = held_s >= t_s[0]
    is_last_inside = held_s + WINDOW_S <= t_s[-1]
    starts_s = held_s[is_first_inside & is_last_inside]
    if len(starts_s) < MIN_ROWS:
        duration_s = t_s[-1] - t_s[0]
        raise MotionError(
            f"a drive to identify lasts {WINDOW_S:g} s and three periods of control or more, got {duration_s:.3g} s"
        )
    ends_s = np.append(held_s[1:], np.inf)
    held_intervals_s = np.stack([held_s, ends_s])
    products = _products(np.gradient(odometry, t_s, axis=0))
    rows = []
    for middle_s in starts_s + WINDOW_S / 2:
        x = _in_window(t_s, middle_s)
        is_inside = np.abs(x) <= 1
        x = x[is_inside]
        moved = odometry[is_inside] - odometry[is_inside][0]

        # Each reference weighs as much as the weight's integral over the time that it applies.
        begin, end = np.clip(_in_window(held_intervals_s, middle_s), -1, 1)
        share = WEIGHT_INTEGRAL(end) - WEIGHT_INTEGRAL(begin)
        by_slope = np.trapezoid(WEIGHT_SLOPE(x)[:, None] * moved, x, axis=0)
        by_curvature = np.trapezoid(WEIGHT_CURVATURE(x)[:, None] * moved, x, axis=0)
        speeds = -by_slope * 2 / WINDOW_S
        rates = by_curvature * (2 / WINDOW_S) ** 2
        mean_products = np.trapezoid(WEIGHT(x)[:, None] * products[is_inside], x, axis=0)
        rows.append([speeds, rates, share @ references, mean_products])
    return _fit(np.array(rows).transpose(1, 0, 2))


def _in_window(t_s: Array, middle_s: float) -> Array:
    """Times as places in a window, from -1 at its start to 1 at its end."""
    return np.asarray((t_s - middle_s) * 2 / WINDOW_S)


def _fit(instants: Array) -> Fit:
    """Theta of (4, N, 2): speeds, their rates, references, and omega^2 with u omega."""
    speeds, rates, references, products = instants
    u, omega = speeds.T
    u_rate, omega_rate = rates.T
    omega_squared, u_omega = products.T
    zero = np.zeros(len(speeds))
    u_rows = np.stack([u_rate, zero, -omega_squared, u, zero, zero], -1)
    omega_rows = np.stack([zero, omega_rate, zero, zero, u_omega, omega], -1)
    rows = np.concatenate([u_rows, omega_rows])
    values, condition = _solved(rows, references.T.ravel())

    fitted = np.stack([u_rows @ values, omega_rows @ values], -1)
    residuals = fitted - references
    u_rms, omega_rms = np.sqrt(np.mean(residuals**2, 0)).tolist()
    theta = Theta(*values.tolist())
    return Fit(theta, u_rms, omega_rms, condition)


def _solved(rows: Array, references: Array) -> tuple[Array, float]:
    """Six parameters and the condition number, with every column scaled to length 1."""
    lengths = np.linalg.norm(rows, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    left, strengths, right = np.linalg.svd(rows / lengths, full_matrices=False)
    largest = max(strengths[0], 1.0)
    is_weak = strengths * WORST_CONDITION < largest
    has_share = np.abs(right[is_weak]) > SHARE
    undetermined = np.flatnonzero(has_share.any(0)) + 1
    if len(undetermined):
        names = ", ".join(f"theta_{number}" for number in undetermined)
        raise MotionError(
            f"the drive does not determine {names}: "
            f"drive with speed and turn that both change, not in step with each other"
        )
    scaled_values = right.T @ (left.T @ references / strengths)
    condition = float(strengths[0] / strengths[-1])
    return scaled_values / lengths, condition
