"""What a perfect IMU would say: angular rate and specific force, averaged over each reading's time."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.trajectory.kinematics import STANDARD_GRAVITY_MPS2, Kinematics, Motion
from vobench.trajectory.trajectory import Stamps

AT_ONCE = 4096  # readings: what is held in memory does not grow with the motion's length


def reading_stamps(motion: Motion, rate_hz: float) -> Stamps:
    """Stamps (M,) index / rate from a motion's start up to its end."""
    lasts_ns = motion.end_ns - motion.start_ns
    since_ns = np.rint(np.arange(int(lasts_ns * rate_hz / 1e9) + 2) * 1e9 / rate_hz).astype(np.int64)
    stamps: Stamps = motion.start_ns + since_ns[since_ns <= lasts_ns]
    return stamps


def mean_inertia(motion: Motion, T_body_imu: Array, rate_hz: float, *, count: int) -> Array:
    """Mean angular rate and specific force (2, count, 3) in the IMU's axes, over 1 / rate around each stamp.

    Neighbouring means share their edges, so they add up to the whole motion also where it jerks.
    """
    means = np.empty((2, count, 3))
    breaks_ns = np.append(motion.breaks_ns, [motion.start_ns, motion.end_ns]) - motion.start_ns
    for first in range(0, count, AT_ONCE):
        last = min(first + AT_ONCE, count)
        edges_ns = (np.arange(first, last + 1, dtype=np.float64) - 0.5) * 1e9 / rate_hz
        means[:, first:last] = _means_between(motion, T_body_imu, edges_ns, breaks_ns)
    return means


def _means_between(motion: Motion, T_body_imu: Array, edges_ns: Array, breaks_ns: Array) -> Array:
    """Means (2, M, 3) between edges (M + 1,), in ns since the start: Gauss-Legendre on each smooth piece."""
    within = breaks_ns[(breaks_ns > edges_ns[0]) & (breaks_ns < edges_ns[-1])]
    cuts_ns = np.union1d(edges_ns, within)
    half_ns, middle_ns = np.diff(cuts_ns) / 2, (cuts_ns[1:] + cuts_ns[:-1]) / 2
    nodes, weights = np.polynomial.legendre.leggauss(_order(half_ns.max() * 2e-9))
    t_ns = motion.start_ns + middle_ns[:, None] + half_ns[:, None] * nodes
    felt = _felt(motion.at(t_ns.ravel()).of_mounted(T_body_imu)).reshape(2, *t_ns.shape, 3)
    pieces = np.einsum("apni,n,p->api", felt, weights / 2, 2 * half_ns)
    begin = np.searchsorted(cuts_ns, edges_ns[:-1])
    lasts_ns = np.add.reduceat(2 * half_ns, begin)
    means: Array = np.add.reduceat(pieces, begin, axis=1) / lasts_ns[:, None]
    return means


def _order(lasts_s: float) -> int:
    """Nodes a piece: 3 leave 1e-10 of an 8 Hz shake over 5 ms; longer pieces need more."""
    return min(3 + int(lasts_s / 0.02), 16)


def _felt(imu: Kinematics) -> Array:
    """Angular rate and specific force (2, K, 3): R'(a - g), which is upwards at rest."""
    up = imu.T_world_body[:, 2, :3]  # the world's z axis in the IMU's axes
    return np.stack([imu.turn_radps, imu.acceleration_mps2 + STANDARD_GRAVITY_MPS2 * up])
