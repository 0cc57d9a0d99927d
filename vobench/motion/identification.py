"""Theta found in a drive by least squares: (18) is linear in it. Source: Martins et al. (2009)."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.motion.pioneer import Theta

# By how much a relative error of the drive may grow on its way into theta. A drive through waypoints has 2 to 4;
# from here on, noise of a thousandth would leave nothing of the answer.
WORST_CONDITION = 1e3
# A parameter with less than this share of an undetermined combination is told well enough by itself.
SHARE = 0.1
# A window's weight and its first five derivatives are 0 at its ends, -1 and 1; its integral is 1.
BUMP = Polynomial([1.0, 0.0, -1.0]) ** 6
WEIGHT = BUMP / float(BUMP.integ()(1) - BUMP.integ()(-1))
WINDOW_S = 1.0


@dataclass(frozen=True, slots=True)
class Fit:
    """Theta of a drive, what it leaves of the references (RMS), and how ill the fit is conditioned (1: not at all)."""

    theta: Theta
    u_ref_rms_mps: float
    omega_ref_rms_radps: float
    condition: float


def identify(speeds: ArrayLike, accelerations: ArrayLike, references: ArrayLike) -> Fit:
    """Theta from N instants of (u, omega), (u', omega') and (u_ref, omega_ref), each (N, 2), in m, rad and s.

    Raises MotionError where the drive does not tell all six parameters, and says which.
    """
    pairs = [np.asarray(pair, float) for pair in (speeds, accelerations, references)]
    shapes = [pair.shape for pair in pairs]
    if len(set(shapes)) != 1 or len(shapes[0]) != 2 or shapes[0][0] < 3 or shapes[0][1] != 2:
        raise MotionError(f"a drive to identify needs three arrays (N, 2) of one length, 3 or more, got {shapes}")
    if not np.isfinite(pairs).all():
        raise MotionError("a drive to identify must be finite everywhere; leave out the instants that are not")
    u, omega = pairs[0].T
    return _fit(np.array([*pairs, np.stack([omega**2, u * omega], -1)]))


def identify_odometry(t_s: Array, odometry: Array, held_s: Array, references: Array) -> Fit:
    """Theta from distance rolled in m and heading in rad (M, 2) by the wheels at t_s (M,), in windows of WINDOW_S.

    references (N, 2) of u in m/s and omega in rad/s hold from held_s (N,) on. Each window is one row of the fit: (18)
    times a smooth weight, integrated by parts, so that no reading is differentiated. Raises MotionError as `identify`.
    """
    ends_s = np.append(held_s[1:], np.inf)
    starts_s = held_s[(held_s >= t_s[0]) & (held_s + WINDOW_S <= t_s[-1])]
    if len(starts_s) < 3:
        lasts_s = t_s[-1] - t_s[0]
        raise MotionError(
            f"a drive to identify lasts {WINDOW_S:g} s and three periods of control or more, got {lasts_s:.3g} s"
        )
    u, omega = np.gradient(odometry, t_s, axis=0).T
    products = np.stack([omega**2, u * omega], -1)
    rows = []
    for middle_s in starts_s + WINDOW_S / 2:
        x = (t_s - middle_s) * 2 / WINDOW_S
        inside = np.abs(x) <= 1
        x = x[inside]
        moved = (odometry - odometry[inside][0])[inside]
        held = np.clip((np.stack([held_s, ends_s]) - middle_s) * 2 / WINDOW_S, -1, 1)
        share = WEIGHT.integ()(held[1]) - WEIGHT.integ()(held[0])
        speeds = -np.trapezoid(WEIGHT.deriv()(x)[:, None] * moved, x, axis=0) * 2 / WINDOW_S
        rates = np.trapezoid(WEIGHT.deriv(2)(x)[:, None] * moved, x, axis=0) * (2 / WINDOW_S) ** 2
        products_mean = np.trapezoid(WEIGHT(x)[:, None] * products[inside], x, axis=0)
        rows.append([speeds, rates, share @ references, products_mean])
    return _fit(np.array(rows).transpose(1, 0, 2))


def _fit(instants: Array) -> Fit:
    """Theta of (4, N, 2): speeds, their rates, references, and omega^2 with u omega."""
    no = np.zeros(instants.shape[1])
    references = instants[2]
    (u, omega), (u_rate, omega_rate), _, (squared, crossed) = instants.transpose(0, 2, 1)
    on_u = np.stack([u_rate, no, -squared, u, no, no], -1)
    on_omega = np.stack([no, omega_rate, no, no, crossed, omega], -1)
    values, condition = _solved(np.concatenate([on_u, on_omega]), references.T.ravel())
    left = np.stack([on_u @ values, on_omega @ values], -1) - references
    u_rms, omega_rms = np.sqrt(np.mean(left**2, 0)).tolist()
    return Fit(Theta(*values.tolist()), u_rms, omega_rms, condition)


def _solved(rows: Array, asked: Array) -> tuple[Array, float]:
    """Six parameters and the condition number, with every column scaled to length 1."""
    lengths = np.linalg.norm(rows, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    left, strengths, right = np.linalg.svd(rows / lengths, full_matrices=False)
    weak = strengths * WORST_CONDITION < max(strengths[0], 1.0)
    untold = np.flatnonzero((np.abs(right[weak]) > SHARE).any(0)) + 1
    if len(untold):
        raise MotionError(
            f"the drive does not tell {', '.join(f'theta_{number}' for number in untold)}: "
            f"drive with speed and turn that both change, not in step with each other"
        )
    return right.T @ (left.T @ asked / strengths) / lengths, float(strengths[0] / strengths[-1])
