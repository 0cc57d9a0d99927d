"""A stamp keeps every nanosecond, in any unit."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import TrajectoryError
from vobench.trajectory.any_format import parse_any
from vobench.trajectory.stamp_text import format_seconds
from vobench.trajectory.tum import parse_tum

POSE = "0 0 0 0 0 0 1"


@given(st.integers(-(2**63) + 1, 2**63 - 1))
def test_a_stamp_keeps_every_nanosecond(t_ns):
    assert parse_tum(f"{format_seconds(t_ns)} {POSE}", name="x").t_ns.tolist() == [t_ns]


@pytest.mark.parametrize(
    ("text", "t_ns"),
    [
        ("1305031098.6659", 1_305_031_098_665_900_000),
        ("1403636579.763555527", 1_403_636_579_763_555_527),  # float64 would be 104 ns off
        ("1.305031098665912345e+09", 1_305_031_098_665_912_345),
        ("-.5", -500_000_000),
        ("3.", 3_000_000_000),
        ("0.0000000015", 2),
        ("0.0000000025", 2),
        ("1e-300", 0),
    ],
)
def test_stamps_are_read_as_decimals(text, t_ns):
    assert parse_tum(f"{text} {POSE}", name="x").t_ns.tolist() == [t_ns]


@pytest.mark.parametrize(
    ("t_ns", "text"),
    [(0, "0.000000000"), (1, "0.000000001"), (-1, "-0.000000001"), (-1_500_000_000, "-1.500000000")],
)
def test_seconds_have_nine_decimals_and_a_sign(t_ns, text):
    assert format_seconds(t_ns) == text


@pytest.mark.parametrize(
    ("unit", "text", "limit"),
    [
        ("s", "9223372036.854775808", "9223372036.854775807"),
        ("ms", "9223372036854.775808", "9223372036854.775807"),
        ("ns", "9223372036854775808", "9223372036854775807"),
    ],
)
def test_a_stamp_beyond_int64_is_refused_and_the_last_one_is_not(unit, text, limit):
    assert parse_any(f"{limit} {POSE}", name="x", unit=unit).t_ns.tolist() == [2**63 - 1]
    with pytest.raises(TrajectoryError, match=re.escape(f"below {limit}, but is {text} (is it in another unit?)")):
        parse_any(f"{text} {POSE}", name="x", unit=unit)
