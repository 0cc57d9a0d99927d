"""Pose files without stamps, and the file of times beside them."""

import numpy as np
import pytest

from vobench.errors import TrajectoryError
from vobench.trajectory.unstamped import parse_kitti, parse_tartanair, parse_times


def test_a_file_of_times_is_exact_to_the_nanosecond():
    assert parse_times("0.000000e+00\n1.037359e-01\n0.2073381019999\n", name="t").tolist() == [0, 103735900, 207338102]


def test_times_must_increase():
    with pytest.raises(TrajectoryError, match=r"t\.txt:3: stamps must increase by 1 ns or more, but 0\.1 follows 0\.1"):
        parse_times("0\n0.1\n0.1\n", name="t.txt")


def test_a_kitti_row_is_the_upper_part_of_the_matrix():
    T = parse_kitti("0 -1 0 5 1 0 0 6 0 0 1 7\n", name="k")
    np.testing.assert_array_equal(T[0], [[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])


def test_the_scalar_may_come_first():
    np.testing.assert_array_equal(
        parse_tartanair("1 2 3 0.8 0 0 0.6", name="p", order="wxyz"), parse_tartanair("1 2 3 0 0 0.6 0.8", name="p")
    )


def test_huge_numbers_are_no_rotation_and_no_warning():
    with pytest.raises(TrajectoryError, match="should be a rotation"):
        parse_kitti("1e200 0 0 0 0 1e200 0 0 0 0 1 0", name="k")
