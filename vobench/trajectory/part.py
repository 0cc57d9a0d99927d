"""Parts of trajectories, and several parts merged to one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.trajectory.trajectory import Stamps, Trajectory


@dataclass(frozen=True, slots=True)
class Merged:
    """A trajectory that was merged, and the number of poses that were left out since their stamps occur twice."""

    trajectory: Trajectory
    repeated: int


def between(trajectory: Trajectory, first_ns: int | None, last_ns: int | None) -> Trajectory:
    """The poses from one stamp to another, both included; None for no limit. There may be none."""
    is_inside = np.ones(len(trajectory), dtype=bool)
    if first_ns is not None:
        is_inside &= trajectory.t_ns >= first_ns
    if last_ns is not None:
        is_inside &= trajectory.t_ns <= last_ns
    return Trajectory(trajectory.t_ns[is_inside], trajectory.T_world_frame[is_inside])


def downsampled(trajectory: Trajectory, count: int) -> Trajectory:
    """At most `count` poses (2 or more), evenly over the numbers of poses, with the first and the last pose."""
    if len(trajectory) <= count:
        return trajectory
    kept = np.linspace(0, len(trajectory) - 1, count).round().astype(np.int64)
    return Trajectory(trajectory.t_ns[kept], trajectory.T_world_frame[kept])


def shifted(trajectory: Trajectory, offset_ns: int) -> Trajectory:
    """The same poses at stamps that are later by `offset_ns`."""
    return Trajectory(trajectory.t_ns + offset_ns, trajectory.T_world_frame)


def merged(parts: Sequence[Trajectory]) -> Merged:
    """The poses of all parts in order of time. Of poses with the same stamp, the one in the first part is kept."""
    t_ns: Stamps = np.concatenate([part.t_ns for part in parts])
    T = np.concatenate([part.T_world_frame for part in parts])
    distinct_ns, first_rows = np.unique(t_ns, return_index=True)
    return Merged(Trajectory(distinct_ns, T[first_rows]), len(t_ns) - len(distinct_ns))
