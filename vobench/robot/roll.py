"""What the wheels of any level motion turn by, where they roll without slip."""

import numpy as np

from vobench.geometry.rig import WheelGeometry
from vobench.geometry.se3 import Array
from vobench.robot.pioneer import wheel_speeds
from vobench.trajectory.kinematics import Motion
from vobench.trajectory.trajectory import Stamps

# Pieces no longer than this are integrated with four Gauss-Legendre nodes: exact for polynomials of degree 7.
LONGEST_NS = 2e7


def rolled(motion: Motion, t_ns: Stamps, wheels: WheelGeometry) -> Array:
    """Rim angles (M, 2) in rad, left and right, at rising instants (M,) of a body whose axle's middle moves so.

    Both are 0 at the motion's start. Only the forward speed turns wheels: a body that slides sideways does not.
    """
    knots = _knots(motion, np.asarray(t_ns, float))
    nodes, weights = np.polynomial.legendre.leggauss(4)
    middle, half = (knots[1:] + knots[:-1]) / 2, np.diff(knots) / 2
    moved = motion.at((middle[:, None] + half[:, None] * nodes).ravel())
    speeds = wheel_speeds(moved.velocity_mps[:, 0], moved.turn_radps[:, 2], track_m=wheels.track_m)
    travel = np.stack(speeds, -1).reshape(-1, 4, 2).transpose(0, 2, 1) @ weights * half[:, None] / 1e9
    rims: Array = np.concatenate([np.zeros((1, 2)), np.cumsum(travel, 0)]) / wheels.radius_m
    since_start: Array = rims - rims[np.searchsorted(knots, motion.start_ns)]
    return since_start[np.searchsorted(knots, t_ns)]


def _knots(motion: Motion, t_ns: Array) -> Array:
    """All instants asked, the start, and every break between them; cut where they are too far apart."""
    ends = np.unique(np.append(t_ns, motion.start_ns))
    inside = (motion.breaks_ns > ends[0]) & (motion.breaks_ns < ends[-1])
    knots = np.unique(np.concatenate([ends, motion.breaks_ns[inside]]))
    cuts = np.ceil(np.diff(knots) / LONGEST_NS).astype(int)
    begins = np.repeat(knots[:-1], cuts)
    nth = np.arange(len(begins)) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    return np.append(begins + nth * np.repeat(np.diff(knots) / np.maximum(cuts, 1), cuts), knots[-1])
