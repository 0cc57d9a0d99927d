"""Parts of trajectories, and parts that are merged."""

import numpy as np
import pytest

from vobench.trajectory.part import between, downsampled, merged, shifted
from vobench.trajectory.trajectory import Trajectory


def path(*t_ns, x=0.0):
    poses = np.tile(np.eye(4), (len(t_ns), 1, 1))
    poses[:, 0, 3] = x
    return Trajectory(np.array(t_ns, dtype=np.int64), poses)


@pytest.mark.parametrize(
    ("first", "last", "kept"),
    [(None, None, [1, 2, 3]), (2, None, [2, 3]), (None, 2, [1, 2]), (2, 2, [2])],
)
def test_both_ends_belong_to_a_part(first, last, kept):
    assert between(path(1, 2, 3), first, last).t_ns.tolist() == kept


def test_a_part_may_be_empty():
    assert len(between(path(1, 2), 3, None)) == 0


@pytest.mark.parametrize(("count", "kept"), [(2, [0, 9]), (4, [0, 3, 6, 9]), (10, [*range(10)]), (99, [*range(10)])])
def test_poses_are_left_out_evenly_but_never_the_first_and_the_last(count, kept):
    assert downsampled(path(*range(10)), count).t_ns.tolist() == kept


def test_a_shift_changes_stamps_only():
    moved = shifted(path(1, 2, x=3.0), -5)
    assert moved.t_ns.tolist() == [-4, -3]
    assert moved.positions_m[:, 0].tolist() == [3.0, 3.0]


def test_of_equal_stamps_the_first_part_counts():
    whole = merged([path(2, 4, x=1.0), path(1, 2, 3, x=2.0)])
    assert whole.trajectory.t_ns.tolist() == [1, 2, 3, 4]
    assert whole.trajectory.positions_m[:, 0].tolist() == [2.0, 1.0, 2.0, 1.0]
    assert whole.repeated == 1
