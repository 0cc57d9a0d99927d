"""Poses between the stamps: positions on straight lines, rotations at constant speed."""

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Stamps, Trajectory


def poses_at(trajectory: Trajectory, t_ns: Stamps) -> Array:
    """Poses (N, 4, 4) of a trajectory of one pose or more at t_ns (N,); before and after it its ends.

    Source: Shoemake (1985), eq. of slerp, along the shorter way round.
    """
    stamps, T = trajectory.t_ns, trajectory.T_world_frame
    before = np.clip(np.searchsorted(stamps, t_ns, side="right") - 1, 0, max(len(stamps) - 2, 0))
    after = np.minimum(before + 1, len(stamps) - 1)
    step_ns = np.maximum(stamps[after] - stamps[before], 1)
    share = np.clip((t_ns - stamps[before]) / step_ns, 0.0, 1.0)[:, None]
    positions = (1 - share) * T[before, :3, 3] + share * T[after, :3, 3]
    return se3.transform(_slerp(T[before, :3, :3], T[after, :3, :3], share), positions)


def _slerp(R_begin: Array, R_end: Array, share: Array) -> Array:
    a, b = se3.to_quaternion(R_begin), se3.to_quaternion(R_end)
    cosine = np.sum(a * b, axis=-1, keepdims=True)
    b, cosine = np.where(cosine < 0, -b, b), np.abs(cosine)
    sine = np.linalg.norm(b - cosine * a, axis=-1, keepdims=True)
    angle = np.arctan2(sine, cosine)
    near = sine < 1e-9  # there the weights of a straight line are exact
    safe = np.where(near, 1.0, sine)
    q = np.where(near, 1 - share, np.sin((1 - share) * angle) / safe) * a
    q = q + np.where(near, share, np.sin(share * angle) / safe) * b
    return se3.from_quaternion(q / np.linalg.norm(q, axis=-1, keepdims=True))
