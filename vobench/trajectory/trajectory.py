"""A trajectory is two arrays: when, and where."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.errors import TrajectoryError
from vobench.geometry.se3 import Array

Stamps = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Poses of one moving frame in one fixed frame, in order of time.

    t_ns is (N,) int64, strictly increasing; T_world_frame is (N, 4, 4) in metres.
    Raises TrajectoryError where shapes, order or finiteness are wrong.
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
        bad = np.flatnonzero(~np.isfinite(self.T_world_frame).all((1, 2)))
        if bad.size:
            raise TrajectoryError(f"pose {bad[0]} is not finite")

    def __len__(self) -> int:
        return len(self.t_ns)

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
