"""A csv file says itself which unit and order it has."""

import numpy as np
import pytest

from vobench.trajectory.any_format import parse_any
from vobench.trajectory.csv_layout import csv_layout


@pytest.mark.parametrize(
    ("text", "unit", "order"),
    [
        ("1500000000,1,2,3,1,0,0,0", "ns", "wxyz"),
        ("1.5,1,2,3,1,0,0,0", "s", "wxyz"),
        ("t [s],x,y,z,qw,qx,qy,qz\n1,1,2,3,1,0,0,0", "s", "wxyz"),
        ("# made by x, y\n# and z\nt [s],x,y,z,qx,qy,qz,qw\n1,1,2,3,0,0,0,1", "s", "xyzw"),
        ("#time(ns), tx, ty, tz, qx, qy, qz, qw\n1,1,2,3,0,0,0,1", "ns", "xyzw"),
    ],
)
def test_a_csv_is_believed_what_it_says_of_itself(text, unit, order):
    parsed = parse_any(text, name="x")
    assert (parsed.unit, parsed.order) == (unit, order)
    np.testing.assert_array_equal(parsed.T[0, :3, :3], np.eye(3))


@pytest.mark.parametrize(
    "header",
    ["#timestamp [ns],x,y,z,qx,qy,qz,qw\n", "t,x,y,z,qx,qy,qz,qw\n", "# in March\nt,x,y,z,qx,qy,qz,qw\n"],
)
def test_a_header_is_a_comment_or_the_first_row_or_the_row_below_a_comment(header):
    layout = csv_layout(header + "1,1,2,3,0,0,0,1\n")
    assert [line.text for line in layout.lines] == ["1,1,2,3,0,0,0,1"]
    assert layout.order == "xyzw"


def test_numbers_with_an_exponent_are_no_header():
    layout = csv_layout("1e9,1,2,3,1,0,0,0\n2e9,1,2,3,1,0,0,0\n")
    assert [line.number for line in layout.lines] == [1, 2]
    assert (layout.unit, layout.order) == ("ns", "wxyz")
