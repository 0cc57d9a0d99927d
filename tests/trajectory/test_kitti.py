"""KITTI's poses and times are read back with every digit."""

import numpy as np
import pytest

from tests.trajectory.random_poses import random_trajectory
from vobench.errors import TrajectoryError
from vobench.trajectory.any_format import parse_any
from vobench.trajectory.kitti import format_kitti, format_times, parse_times

KITTI = "1 0 0 5 0 0 -1 6 0 1 0 7\n"


def test_kittis_matrices_stay_as_they_are_given():
    # Six digits leave a rotation 2e-7 off; tools that don't orthonormalise would else score otherwise.
    skew = "1.000001 0 0 0 0 1 0 0 0 0 1 0"
    assert parse_any(skew, name="x").T[0, 0, 0] == 1.000001


def test_kitti_may_have_the_frames_number_first_and_frames_missing():
    turned = "0 -1 0 5 1 0 0 6 0 0 1 7\n"
    parsed = parse_any(f"0 {KITTI}3.000000e+00 {turned}3 {KITTI}12 {turned}", name="run.txt")
    assert (parsed.t_ns, parsed.frames.tolist()) == (None, [0, 3, 12])
    np.testing.assert_array_equal(parsed.T[1], parse_any(turned, name="x").T[0])
    said = "rows that repeat the frame number of the row before were left out: 1 of 4, the first at run.txt:3"
    assert parsed.notes == (said,)


def test_a_file_of_times_is_exact_to_the_nanosecond():
    assert parse_times("0.000000e+00\n1.037359e-01\n0.2073381019999\n", name="t").tolist() == [0, 103735900, 207338102]


def test_times_must_increase():
    with pytest.raises(TrajectoryError, match=r"t\.txt:3: stamps must increase by 1 ns or more, but 0\.1 follows 0\.1"):
        parse_times("0\n0.1\n0.1\n", name="t.txt")


def test_a_kitti_row_is_the_upper_part_of_the_matrix():
    T = parse_any("0 -1 0 5 1 0 0 6 0 0 1 7\n", name="k").T
    np.testing.assert_array_equal(T[0], [[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])


def test_huge_numbers_are_no_rotation_and_no_warning():
    with pytest.raises(TrajectoryError, match="should be a rotation"):
        parse_any("1e200 0 0 0 0 1e200 0 0 0 0 1 0", name="k")


def test_kitti_text_and_times_are_read_back_with_every_digit():
    before = random_trajectory(20, seed=3)
    parsed = parse_any(format_kitti(before.T_world_frame), name="x")

    np.testing.assert_array_equal(parsed.T, before.T_world_frame)
    np.testing.assert_array_equal(parse_times(format_times(before.t_ns), name="x"), before.t_ns)
