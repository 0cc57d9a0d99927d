"""Forms told by content; what is no trajectory gets one sentence with its file and line."""

import re

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.trajectory.formats import (
    NUMBER,
    csv_rows,
    format_euroc,
    format_kitti,
    format_times,
    format_tum,
    parse_any,
    parse_times,
    parse_tum,
    seconds,
)
from vobench.trajectory.trajectory import Trajectory

# ruff: noqa: E501 - a sentence stands in one line


TUM = "1.5 1 2 3 0 0 0.6 0.8\n2.5 2 3 4 0 0 0 1\n"
KITTI = "1 0 0 5 0 0 -1 6 0 1 0 7\n"
TARTANAIR = "1 2 3 0 0 0.6 0.8\n"
EUROC = "#timestamp [ns],px,py,pz,qw,qx,qy,qz,vx\n1500000000,1,2,3,0.8,0,0,0.6,9\n"
MIRRORED = "1 0 0 0 0 1 0 0 0 0 -1 0\n"


def test_one_pose_is_the_same_in_every_form():
    turned = parse_any(TUM, name="x").T[0]
    np.testing.assert_allclose(turned, parse_any(TARTANAIR, name="x").T[0], atol=1e-15)
    np.testing.assert_allclose(turned, parse_any(EUROC, name="x").T[0], atol=1e-15)
    matrix = " ".join(f"{value!r}" for value in turned[:3].ravel().tolist())
    np.testing.assert_array_equal(turned, parse_any(matrix, name="x").T[0])


def test_the_form_says_unit_and_order_and_words_override_it():
    tum, csv, kitti = (parse_any(text, name="x") for text in (TUM, EUROC, KITTI))
    assert (tum.unit, tum.order, tum.t_ns.tolist()) == ("s", "xyzw", [1_500_000_000, 2_500_000_000])
    assert (csv.unit, csv.order, csv.t_ns.tolist()) == ("ns", "wxyz", [1_500_000_000])
    assert (kitti.unit, kitti.order, kitti.t_ns) == (None, None, None)
    other = parse_any("1500 1 2 3 0.8 0 0 0.6", name="x", unit="ms", order="wxyz")
    assert other.t_ns.tolist() == [1_500_000_000]
    np.testing.assert_allclose(other.T[0], tum.T[0], atol=1e-15)


def test_kittis_matrices_stay_as_they_are_given():
    # Six digits leave a rotation 2e-7 off; tools that don't orthonormalise would else score otherwise.
    skew = "1.000001 0 0 0 0 1 0 0 0 0 1 0"
    assert parse_any(skew, name="x").T[0, 0, 0] == 1.000001


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


@pytest.mark.parametrize("text", [TUM, KITTI, TARTANAIR, EUROC])
def test_crlf_blank_lines_tabs_and_comments_change_nothing(text):
    loose = "\ufeff" + text.replace(" ", "\t").replace("\n", "  \r\n\r\n# note\r\n")
    first, second = (parse_any(t, name="x") for t in (text.replace(" [ns]", "[ns]"), loose))
    np.testing.assert_array_equal(first.T, second.T)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "no pose, because the file is empty: run.txt"),
        ("\n \r\n", "no pose, because the file is empty: run.txt"),
        ("# only\n# comments\n", "no pose, because all lines are comments: run.txt"),
        ("version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "a Git-LFS pointer, not the file itself; fetch it with git lfs pull: run.txt"),
        ("a b c\n", "run.txt:1: no form of trajectory has 3 columns: TUM has 8 (t x y z qx qy qz qw), KITTI 12, or 13 with a frame number first, TartanAir 7, EuRoC 8 and commas"),
        (TUM + "3.5 1 2 3 0", "run.txt:3: a pose has 8 columns (t x y z qx qy qz qw), this line has 5 (the last row: was the file cut off?)"),
        (KITTI + "1 0 0", "this line has 3 (the last row: was the file cut off?)"),
        (EUROC + "1600000000,1,2", "run.txt:3: a pose has 8 columns (t x y z qw qx qy qz), this line has 3 (the last row: was the file cut off?)"),
        (KITTI + MIRRORED, "run.txt:2: the rotation is mirrored (its determinant is -1)"),
        (KITTI + KITTI.replace("1 0 0 5", "1.01 0 0 5"), "run.txt:2: the first three columns of the matrix should be a rotation within 0.001, but R^T R is 0.0201 off the identity"),
        (KITTI.replace("7", "nan"), "run.txt:1: t3 should be a finite number, but is 'nan'"),
        (TARTANAIR + "1 2 inf 0 0 0 1", "run.txt:2: z should be a finite number, but is 'inf'"),
        (TARTANAIR + "1 2 3 0 0 0 0", "run.txt:2: the quaternion's norm should be 1 within 0.001, but (0, 0, 0, 0) has 0"),
        (TARTANAIR + "1 2 3 0 0 0 2", "(0, 0, 0, 2) has 2"),
        (EUROC + "1499999999,1,2,3,1,0,0,0", "run.txt:3: stamps must increase, but 1499999999 follows 1500000000"),
        (TUM + "2.4 0 0 0 0 0 0 1", "run.txt:3: stamps must increase, but 2.4 follows 2.5"),
        ("0 " + KITTI + "0.5 " + KITTI, "run.txt:2: the first of 13 columns should be the number of a frame, an integer from 0, but is 0.5"),
        ("-1 " + KITTI, "run.txt:1: the first of 13 columns should be the number of a frame, an integer from 0, but is -1"),
        ("7 " + KITTI + "6 " + KITTI, "run.txt:2: frame numbers must increase, but 6 follows 7"),
        ("1305031102160407000 0 0 0 0 0 0 1", "run.txt:1: t should be seconds below 9223372036.854775807, but is 1305031102160407000 (is it in another unit?)"),
    ],
)  # fmt: skip
def test_what_is_no_trajectory_is_named_with_its_line(text, sentence):
    with pytest.raises(TrajectoryError) as caught:
        parse_any(text, name="run.txt")
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_of_rows_that_repeat_a_stamp_the_first_counts_and_that_is_said():
    again = TUM + "2.500000000 9 9 9 0 0 0 1\n2.5 8 8 8 0 0 0 1\n3.5 3 4 5 0 0 0 1\n"
    parsed = parse_any(again, name="run.txt")
    assert parsed.t_ns.tolist() == [1_500_000_000, 2_500_000_000, 3_500_000_000]
    assert parsed.T[:, 0, 3].tolist() == [1.0, 2.0, 3.0]
    said = "rows that repeat the stamp of the row before were left out: 2 of 5, the first at run.txt:3"
    assert parsed.notes == (said,)
    assert parse_any(TUM, name="run.txt").notes == ()
    assert parse_any(EUROC + EUROC.splitlines()[1], name="run.txt").T.shape == (1, 4, 4)


def test_kitti_may_have_the_frames_number_first_and_frames_missing():
    turned = "0 -1 0 5 1 0 0 6 0 0 1 7\n"
    parsed = parse_any(f"0 {KITTI}3.000000e+00 {turned}3 {KITTI}12 {turned}", name="run.txt")
    assert (parsed.t_ns, parsed.frames.tolist()) == (None, [0, 3, 12])
    np.testing.assert_array_equal(parsed.T[1], parse_any(turned, name="x").T[0])
    said = "rows that repeat the frame number of the row before were left out: 1 of 4, the first at run.txt:3"
    assert parsed.notes == (said,)


def test_stamps_of_frames_go_to_those_rows_that_have_the_number_or_the_place():
    clock = np.arange(0, 130, 10, dtype=np.int64)
    numbered = parse_any(f"0 {KITTI}12 {KITTI}", name="x")
    assert numbered.stamped_by(clock).tolist() == [0, 120]
    assert numbered.stamped_by(clock[:12]) is None
    assert parse_any(KITTI * 13, name="x").stamped_by(clock).tolist() == clock.tolist()
    assert parse_any(KITTI * 12, name="x").stamped_by(clock) is None


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


@given(st.text(max_size=200) | st.text("0123456789.,-e \t\r\n#", max_size=200))
def test_any_text_is_a_trajectory_or_one_sentence(text):
    try:
        parsed = parse_any(text, name="x")
    except TrajectoryError as error:
        sentence = str(error)
        if "\n" in sentence:
            pytest.fail(sentence)
        return
    assert np.isfinite(parsed.T).all()
    assert se3.is_rotation(parsed.T[:, :3, :3], tolerance=1e-2)


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


def test_a_file_of_times_is_exact_to_the_nanosecond():
    assert parse_times("0.000000e+00\n1.037359e-01\n0.2073381019999\n", name="t").tolist() == [0, 103735900, 207338102]


def test_times_must_increase():
    with pytest.raises(TrajectoryError, match=r"t\.txt:3: stamps must increase by 1 ns or more, but 0\.1 follows 0\.1"):
        parse_times("0\n0.1\n0.1\n", name="t.txt")


def test_a_kitti_row_is_the_upper_part_of_the_matrix():
    T = parse_any("0 -1 0 5 1 0 0 6 0 0 1 7\n", name="k").T
    np.testing.assert_array_equal(T[0], [[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])


def test_the_scalar_may_come_first():
    np.testing.assert_array_equal(
        parse_any("1 2 3 0.8 0 0 0.6", name="p", order="wxyz").T, parse_any("1 2 3 0 0 0.6 0.8", name="p").T
    )


def test_huge_numbers_are_no_rotation_and_no_warning():
    with pytest.raises(TrajectoryError, match="should be a rotation"):
        parse_any("1e200 0 0 0 0 1e200 0 0 0 0 1 0", name="k")


def test_euroc_text_has_its_header_the_scalar_first_and_is_read_back():
    before = random_trajectory(50, seed=2)
    text = format_euroc(before)
    header = text.partition("\n")[0]
    parsed = parse_any(text, name="x")

    assert header.startswith("#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x []")
    assert header.count(",") == 7
    assert (parsed.unit, parsed.order) == ("ns", "wxyz")
    np.testing.assert_array_equal(parsed.t_ns, before.t_ns)
    np.testing.assert_allclose(parsed.T, before.T_world_frame, rtol=0, atol=1.5e-15)


@pytest.mark.parametrize(("columns", "last"), [(3, "v_RS_R_z [m s^-1]"), (9, "b_a_RS_S_z [m s^-2]")])
def test_euroc_text_may_have_velocities_and_biases(columns, last):
    before = random_trajectory(3, seed=2)
    more = np.arange(3.0 * columns).reshape(3, columns)
    header, *rows = format_euroc(before, more).splitlines()

    assert header.endswith(last)
    assert [[float(field) for field in row.split(",")[8:]] for row in rows] == more.tolist()


def test_kitti_text_and_times_are_read_back_with_every_digit():
    before = random_trajectory(20, seed=3)
    parsed = parse_any(format_kitti(before.T_world_frame), name="x")

    np.testing.assert_array_equal(parsed.T, before.T_world_frame)
    np.testing.assert_array_equal(parse_times(format_times(before.t_ns), name="x"), before.t_ns)


def test_rows_of_a_csv_have_a_stamp_and_every_digit():
    assert csv_rows(np.array([7, -8]), np.array([[0.1, 2.0], [1e-300, -0.0]])) == "7,0.1,2.0\n-8,1e-300,-0.0\n"


@pytest.mark.parametrize(
    ("t_ns", "text"),
    [(0, "0.000000000"), (1, "0.000000001"), (-1, "-0.000000001"), (-1_500_000_000, "-1.500000000")],
)
def test_seconds_have_nine_decimals_and_a_sign(t_ns, text):
    assert seconds(t_ns) == text


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
