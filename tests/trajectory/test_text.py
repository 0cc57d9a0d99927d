"""TUM text: exact stamps, tolerant of layout, strict about numbers."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.trajectory.text import format_tum, parse_tum, seconds
from vobench.trajectory.trajectory import Trajectory

POSE = "0 0 0 0 0 0 1"


def random_trajectory(n: int, seed: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(n, 4))
    rotations = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    t_ns = np.cumsum(rng.integers(1, 10**10, n)).astype(np.int64)
    return Trajectory(t_ns, se3.transform(rotations, rng.normal(scale=100, size=(n, 3))))


def test_text_is_the_inverse_of_parsing():
    before = random_trajectory(500, seed=1)
    after = parse_tum(format_tum(before), name="x")
    np.testing.assert_array_equal(after.t_ns, before.t_ns)
    np.testing.assert_array_equal(after.positions_m, before.positions_m)
    np.testing.assert_allclose(after.T_world_frame, before.T_world_frame, rtol=0, atol=1.5e-15)


def test_an_empty_trajectory_is_empty_text_and_back():
    assert format_tum(parse_tum("# nothing\n", name="x")) == ""


@given(st.integers(-(2**63) + 1, 2**63 - 1))
def test_a_stamp_keeps_every_nanosecond(t_ns):
    assert parse_tum(f"{seconds(t_ns)} {POSE}", name="x").t_ns.tolist() == [t_ns]


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


def test_layout_is_free():
    text = f"\ufeff# a comment\r\n\r\n  1.0\t{POSE}  \r\n2.0   0 0\t0 0 0 0 1 # and why\n   \n\t3.0 {POSE}"
    assert parse_tum(text, name="x").t_ns.tolist() == [10**9, 2 * 10**9, 3 * 10**9]


def test_quaternions_printed_with_few_digits_are_normalised():
    rotation = parse_tum("1 0 0 0 0.6132 0.5962 -0.3311 -0.3986", name="x").T_world_frame[:, :3, :3]
    assert se3.is_rotation(rotation, tolerance=1e-15)


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
