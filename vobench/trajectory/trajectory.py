"""A trajectory is two arrays: when, and where."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.errors import TrajectoryError
from vobench.geometry.se3 import Array

Stamps = NDArray[np.int64]
SKEW = 1e-2  # text with three digits leaves RᵀR up to 3e-3 off the identity; what is no rotation by far more
LARGEST_M = 1e18  # a hundred light years; beyond it squares overflow float32, which the KITTI devkit sums in
BLOCK = 1 << 14  # poses looked at together: little memory, and they stay in the processor's cache


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Poses of one moving frame in one fixed frame, in order of time.

    t_ns is (N,) int64, strictly increasing; T_world_frame is (N, 4, 4) in metres.
    Raises TrajectoryError where shapes, order or size are wrong, or a rotation is none.
    """

    t_ns: Stamps
    T_world_frame: Array

    def __post_init__(self) -> None:
        if self.T_world_frame.shape != (len(self.t_ns), 4, 4) or self.t_ns.dtype != np.int64:
            raise TrajectoryError(
                f"a trajectory needs (N,) int64 stamps and (N, 4, 4) poses, "
                f"got {self.t_ns.shape} {self.t_ns.dtype} and {self.T_world_frame.shape}"
            )
        late = np.flatnonzero(np.diff(self.t_ns) <= 0)
        if late.size:
            raise TrajectoryError(f"stamps must increase, but pose {late[0] + 1} is not later than the one before it")
        for begin in range(0, len(self.t_ns), BLOCK):
            _require_poses(self.T_world_frame[begin : begin + BLOCK], begin)

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        if not len(self):
            return "Trajectory(no pose)"
        first, last = (f"{t_ns / 1e9:.3f}" for t_ns in (self.t_ns[0], self.t_ns[-1]))
        return f"Trajectory({len(self)} poses from {first} s to {last} s, path {self.distances_m()[-1]:.4g} m)"

    @property
    def positions_m(self) -> Array:
        """Positions (N, 3)."""
        return self.T_world_frame[:, :3, 3]

    def distances_m(self) -> Array:
        """Path length (N,) from the first pose to each pose."""
        steps = np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])[: len(self)]

    def of_mounted(self, T_frame_mounted: Array) -> "Trajectory":
        """The trajectory of something fixed to this frame, such as a camera on a body."""
        return Trajectory(self.t_ns, self.T_world_frame @ T_frame_mounted)


def _require_poses(T: Array, begin: int) -> None:
    """Raise TrajectoryError for the first of poses (N, 4, 4) that is none; `begin` is the number of the first."""
    if not (np.abs(T) < LARGEST_M).all():  # which nan isn't either
        bad = int(np.flatnonzero(~(np.abs(T) < LARGEST_M).all((1, 2)))[0])
        what = "is not finite" if not np.isfinite(T[bad]).all() else f"is {np.abs(T[bad]).max():.3g} m away"
        raise TrajectoryError(f"pose {begin + bad} {what}; positions should be finite and below {LARGEST_M:g} m")
    R = T[:, :3, :3]
    skew = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max((1, 2))
    mirrors = np.sum(np.cross(R[:, :, 0], R[:, :, 1]) * R[:, :, 2], axis=1) < 0
    wrong = np.flatnonzero(mirrors | (skew > SKEW))
    if wrong.size:
        bad = int(wrong[0])
        what = "is mirrored (determinant -1)" if mirrors[bad] else f"is off by {skew[bad]:.3g} (RᵀR - 1)"
        raise TrajectoryError(f"the rotation of pose {begin + bad} {what}; it should be orthonormal and right-handed")
