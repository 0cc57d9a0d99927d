"""Two virtual pinholes side by side, in place of a pair that is almost so."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import unit
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array

PARALLEL_RAD = 1e-6  # a pair this straight is rectified as it stands
MAX_TURN_RAD = np.deg2rad(30)  # beyond it the two would hardly look at the same things


@dataclass(frozen=True, slots=True)
class Rectification:
    """Views from the two optical centres that are parallel to each other and across the baseline.

    K is that of both views. A point's rows agree in them, and its columns differ by
    K[0, 0] · baseline_m / z.
    """

    K: Array
    baseline_m: float
    R_view_left: Array
    R_view_right: Array

    @property
    def P_left(self) -> Array:
        """The (3, 4) matrix that sends points in metres, in the left view's axes, to its pixels."""
        return projection(self.K, 0.0)

    @property
    def P_right(self) -> Array:
        """The (3, 4) matrix that sends points in metres, in the left view's axes, to the right view's pixels."""
        return projection(self.K, self.baseline_m)


def projection(K: Array, shift_m: float) -> Array:
    """The (3, 4) matrix of a pinhole `shift_m` to the right of the axes that points are given in."""
    return np.hstack([K, [[-K[0, 0] * shift_m], [0.0], [0.0]]])


def rectification(rig: Rig) -> Rectification | None:
    """The views of a pair, turned as little as may be; None where there is no right camera, or it is not to the right.

    Their x runs along the baseline, their z as near as possible to the mean of the optical axes.
    Source: Fusiello, Trucco and Verri (2000).
    """
    if rig.right is None:
        return None
    R_left_right, t = rig.T_left_right[:3, :3], rig.T_left_right[:3, 3]
    if t[0] <= 0:
        return None
    x, ahead = unit(t), np.array([0.0, 0.0, 1.0]) + R_left_right[:, 2]
    z = ahead - (ahead @ x) * x
    if not z.any():
        return None
    z = unit(z)
    R_view_left = np.stack([x, np.cross(z, x), z])
    turns = [R_view_left, R_view_left @ R_left_right]
    angles = [float(se3.rotation_angle(R)) for R in turns]
    if max(angles) > MAX_TURN_RAD:
        return None
    if max(angles) <= PARALLEL_RAD:
        turns = [np.eye(3), np.eye(3)]
    return Rectification(rig.left.K, rig.baseline_m, turns[0], turns[1])
