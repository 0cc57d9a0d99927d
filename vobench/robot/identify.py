"""Which theta a robot has: least squares on a run, because (18) is linear in the six parameters.

[u_ref    ] = [u'  0       -omega^2  u  0        0    ]
[omega_ref]   [0   omega'  0         0  u omega  omega] (theta_1 .. theta_6)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.robot.pioneer import Theta

# By how much a relative error of the run may grow on its way into theta. A drive through waypoints has 2 to 4;
# from here on, noise of a thousandth would leave nothing of the answer.
WORST_CONDITION = 1e3
# A parameter with less than this share of an undetermined combination is told well enough by itself.
SHARE = 0.1


@dataclass(frozen=True, slots=True)
class Fit:
    """Theta of a run, what it leaves of the references (RMS), and how ill the fit is conditioned (1: not at all)."""

    theta: Theta
    u_ref_rms_mps: float
    omega_ref_rms_radps: float
    condition: float


def identify(speeds: ArrayLike, accelerations: ArrayLike, references: ArrayLike) -> Fit:
    """Theta from N instants of (u, omega), (u', omega') and (u_ref, omega_ref), each (N, 2), in m, rad and s.

    Raises MotionError where the run does not tell all six parameters, and says which.
    Source: Martins et al. (2009), the regression of equation (18).
    """
    u, omega, u_rate, omega_rate, u_ref, omega_ref = _checked(speeds, accelerations, references)
    no = np.zeros_like(u)
    on_u = np.stack([u_rate, no, -(omega**2), u, no, no], -1)
    on_omega = np.stack([no, omega_rate, no, no, u * omega, omega], -1)
    values, condition = _solved(np.concatenate([on_u, on_omega]), np.concatenate([u_ref, omega_ref]))
    return Fit(Theta(*values.tolist()), _rms(on_u @ values - u_ref), _rms(on_omega @ values - omega_ref), condition)


def _solved(rows: Array, asked: Array) -> tuple[Array, float]:
    """Six parameters and the condition number, with every column scaled to length 1."""
    lengths = np.linalg.norm(rows, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    left, strengths, right = np.linalg.svd(rows / lengths, full_matrices=False)
    weak = strengths * WORST_CONDITION < max(strengths[0], 1.0)
    untold = np.flatnonzero((np.abs(right[weak]) > SHARE).any(0)) + 1
    if len(untold):
        raise MotionError(
            f"the run does not tell {', '.join(f'theta_{number}' for number in untold)}: "
            f"drive with speed and turn that both change, not in step with each other"
        )
    return right.T @ (left.T @ asked / strengths) / lengths, float(strengths[0] / strengths[-1])


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _checked(*pairs: ArrayLike) -> Array:
    """The columns of all pairs (N, 2), as rows."""
    arrays = [np.asarray(pair, float) for pair in pairs]
    shapes = [array.shape for array in arrays]
    if len(set(shapes)) != 1 or len(shapes[0]) != 2 or shapes[0][0] < 3 or shapes[0][1] != 2:
        raise MotionError(f"a run to identify needs three arrays (N, 2) of one length, 3 or more, got {shapes}")
    if not np.isfinite(arrays).all():
        raise MotionError("a run to identify must be finite everywhere; leave out the instants that are not")
    return np.concatenate(arrays, -1).T
