"""Quaternions may have either order; a norm far from 1 is refused."""

import re

import numpy as np
import pytest

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.trajectory.any_format import parse_any
from vobench.trajectory.tum import parse_tum

POSE = "0 0 0 0 0 0 1"


def test_quaternions_printed_with_few_digits_are_normalised():
    rotation = parse_tum("1 0 0 0 0.6132 0.5962 -0.3311 -0.3986", name="x").T_world_frame[:, :3, :3]
    assert se3.is_rotation(rotation, tolerance=1e-15)


def test_the_scalar_may_come_first():
    np.testing.assert_array_equal(
        parse_any("1 2 3 0.8 0 0 0.6", name="p", order="wxyz").T, parse_any("1 2 3 0 0 0.6 0.8", name="p").T
    )


def test_the_row_of_a_wrong_quaternion_is_named_with_its_numbers():
    with pytest.raises(
        TrajectoryError, match=re.escape("x:2: the quaternion's norm should be 1 within 0.001, but (0, 0, 0, 2) has 2")
    ):
        parse_any(f"1 {POSE}\n2 0 0 0 0 0 0 2\n3 0 0 0 0 0 0 3\n", name="x")


@pytest.mark.parametrize(("norm", "is_right"), [(1.0009, True), (0.9991, True), (1.0011, False), (0.9989, False)])
def test_a_norm_may_be_a_thousandth_off(norm, is_right):
    text = f"1 0 0 0 0 0 0 {norm}\n"
    if is_right:
        np.testing.assert_allclose(parse_any(text, name="x").T[0], np.eye(4), atol=1e-15)
        return
    with pytest.raises(TrajectoryError, match="the quaternion's norm should be 1"):
        parse_any(text, name="x")
