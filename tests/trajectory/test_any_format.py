"""The format is detected from the content; what is no trajectory gets one sentence with its file and line."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import TrajectoryError
from vobench.geometry import se3
from vobench.trajectory.any_format import parse_any

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
        ("a b c\n", "run.txt:1: no format of trajectories has 3 columns: TUM has 8 columns (t x y z qx qy qz qw); KITTI has 12, or 13 with a frame number in front; TartanAir has 7; EuRoC has 8, separated by commas"),
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


def test_stamps_of_frames_go_to_those_rows_that_have_the_number_or_the_place():
    clock = np.arange(0, 130, 10, dtype=np.int64)
    numbered = parse_any(f"0 {KITTI}12 {KITTI}", name="x")
    assert numbered.stamped_by(clock).tolist() == [0, 120]
    assert numbered.stamped_by(clock[:12]) is None
    assert parse_any(KITTI * 13, name="x").stamped_by(clock).tolist() == clock.tolist()
    assert parse_any(KITTI * 12, name="x").stamped_by(clock) is None


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
