"""A row of a text file is read exactly, or refused with its line and value."""

import re

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vobench.errors import TrajectoryError
from vobench.trajectory.any_format import parse_any
from vobench.trajectory.text_table import NUMBER
from vobench.trajectory.tum import parse_tum

FIELD = st.sampled_from(
    ["0", "1", "-1", "0.5", "1e3", "1e999", "nan", "-inf", "1_0", "0x1p3", "١", "x", "1.", ".5", "+2"]
)


@given(st.lists(FIELD, min_size=8, max_size=8))
@example(["0x1p3", "0", "0", "0", "0", "0", "0", "1"])
def test_a_row_is_read_exactly_or_refused(fields):
    text = " ".join(fields)
    right = all(NUMBER.fullmatch(f) and abs(float(f)) < 1e300 for f in fields)
    q = np.array([float(f) for f in fields[4:]]) if right else np.zeros(4)
    if right and abs(np.linalg.norm(q) - 1) <= 1e-3:
        parsed = parse_any(text, name="x")
        assert parsed.t_ns.tolist() == [round(float(fields[0]) * 1e9)]
        assert parsed.T[0, :3, 3].tolist() == [float(f) for f in fields[1:4]]
    else:
        with pytest.raises(TrajectoryError, match="x:1: "):
            parse_any(text, name="x")


POSE = "0 0 0 0 0 0 1"


def test_layout_is_free():
    text = f"\ufeff# a comment\r\n\r\n  1.0\t{POSE}  \r\n2.0   0 0\t0 0 0 0 1 # and why\n   \n\t3.0 {POSE}"
    assert parse_tum(text, name="x").t_ns.tolist() == [10**9, 2 * 10**9, 3 * 10**9]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("5 0 0 0 0 0 0", "has 7"),
        ("5 0 0 0 0 0 0 1 0", "has 9"),
        ("5,0,0,0,0,0,0,1", "has 1"),
        ("5 0 0 O 0 0 0 1", "z should be a finite number, but is 'O'"),
        ("5 nan 0 0 0 0 0 1", "x should be a finite number, but is 'nan'"),
        ("inf 0 0 0 0 0 0 1", "t should be a finite number, but is 'inf'"),
        ("5 0 0 0 0 0 0 1_0", "qw should be a finite number, but is '1_0'"),
        ("5 0 1e999 0 0 0 0 1", "y should be a finite number, but 1e999 overflows"),
        ("1e11 0 0 0 0 0 0 1", "t should be seconds below 9223372036.854775807, but is 1e11"),
        ("5 0 0 0 0 0 0 0", "norm should be 1 within 0.001, but (0, 0, 0, 0) has 0"),
        ("5 0 0 0 0 0 0 1.002", "has 1.002"),
        ("5 0 0 0 1e200 0 0 1", "has inf"),
        ("2 0 0 0 0 0 0 1", "but 2 follows 2.0"),
        ("1.999999999 0 0 0 0 0 0 1", "but 1.999999999 follows 2.0"),
    ],
)
def test_an_error_names_file_line_and_value(line, message):
    with pytest.raises(TrajectoryError, match=r"run/est\.tum:4: .*" + re.escape(message)) as caught:
        parse_tum(f"# head\n1.0 {POSE}\n2.0 {POSE}\n{line}\n", name="run/est.tum")
    assert "\n" not in str(caught.value)
