"""The check of answers: what the contract allows passes unchanged, and each breach has a sentence."""

import numpy as np
import pytest

from vobench.estimator.check import (
    FARTHEST_M,
    InvalidOutputError,
    checked,
    checked_revision,
    in_one_line,
)
from vobench.estimator.protocol import Result, Status, Tracks
from vobench.geometry import se3

I = np.eye(4)  # noqa: E741
SQUARES = np.diag([1.0, 2, 3, 4, 5, 6])


def at(x_m: float) -> np.ndarray:
    return se3.transform(np.eye(3), [0.0, x_m, 0.0])


def test_lists_and_integers_become_arrays_of_float64():
    result = checked(Result(I.astype(int).tolist(), "ok", stats={"n": np.int64(3)}, points=[[1, 2, 3]]), 0)
    assert result.T_odom_frame.dtype == result.points.dtype == np.float64
    assert result.status is Status.OK
    assert result.stats == {"n": 3.0}


@pytest.mark.parametrize("status", [Status.LOST, Status.INIT])
def test_without_a_pose_an_answer_is_lost_or_first(status):
    assert checked(Result(None, status), 0).T_odom_frame is None


@pytest.mark.parametrize("status", [Status.OK, Status.STATIONARY, Status.DEGRADED])
def test_any_other_status_needs_a_pose(status):
    with pytest.raises(InvalidOutputError, match=f"frame 4: status '{status}' needs a pose"):
        checked(Result(None, status), 4)


def test_a_pose_may_be_as_far_as_the_limit_and_no_farther():
    assert checked(Result(at(-FARTHEST_M)), 0).T_odom_frame[1, 3] == -FARTHEST_M
    with pytest.raises(InvalidOutputError, match=r"the pose is farther than 1e\+12 m away"):
        checked(Result(at(-1.01 * FARTHEST_M)), 0)


def with_entry(matrix, row, column, value):
    changed = matrix.copy()
    changed[row, column] = value
    return changed


@pytest.mark.parametrize(
    ("answer", "sentence"),
    [
        (None, "must return a vobench.estimator.Result, got NoneType"),
        (Result(I * np.nan), "should be a finite"),
        (Result(np.eye(3)), r"got shape \(3, 3\)"),
        (Result(with_entry(I, 3, 0, 1e-3)), "not a rigid transform"),
        (Result(with_entry(I, 0, 0, -1.0)), "not a rigid transform"),
        (Result(I, covariance=np.eye(5)), r"covariance should be a finite \(6, 6\) array, got shape \(5, 5\)"),
        (Result(I, covariance=np.full((6, 6), np.inf)), "covariance should be a finite"),
        (Result(I, covariance=with_entry(SQUARES, 0, 1, 0.1)), "not symmetric and positive definite"),
        (Result(I, covariance=with_entry(SQUARES, 5, 5, 0.0)), "not symmetric and positive definite"),
        (Result(I, covariance=with_entry(SQUARES, 5, 5, -1.0)), "not symmetric and positive definite"),
        (Result(I, points=np.zeros((3, 2))), r"points should be \(N, 3\), got \(3, 2\)"),
        (Result(I, points=np.zeros(3)), r"points should be \(N, 3\), got \(3,\)"),
        (Result(I, points=[["a", "b", "c"]]), "points should be an array of real numbers"),
        (Result(I, points=np.zeros((1, 3), complex)), "real numbers, got complex128"),
        (Result(I, "fine"), "no status 'fine'. Known: init, ok"),
        (Result(I, tracks=[1]), "tracks must be a vobench.estimator.Tracks, got list"),
        (Result(I, tracks=Tracks(np.zeros((2, 2)), np.zeros((3, 2)), np.ones(3))), r"tracks should be \(N, 2\)"),
        (Result(I, tracks=Tracks(np.zeros((3, 2)), np.zeros((2, 2)), np.ones(3))), r"tracks should be \(N, 2\)"),
        (Result(I, tracks=Tracks(np.zeros((1, 2)), np.zeros((1, 2)), np.ones((1, 1)))), r"tracks should be \(N, 2\)"),
        (Result(I, tracks=Tracks(np.zeros((1, 2)), np.zeros((1, 2)), True)), r"tracks should be \(N, 2\)"),
        (Result(I, stats=[1]), "stats should be numbers by name, got list"),
        (Result(I, stats={"a": "x"}), "stats should be numbers by name"),
    ],
)
def test_a_breach_of_the_contract_is_named_with_its_frame(answer, sentence):
    with pytest.raises(InvalidOutputError, match=f"frame 9: .*{sentence}"):
        checked(answer, 9)


def test_the_rounding_of_a_covariance_is_relative_to_its_size():
    large = 1e12 * SQUARES
    large[0, 1] = 10.0
    assert checked(Result(I, covariance=large), 0).covariance[0, 1] == 10.0
    small = 1e-12 * SQUARES
    small[0, 1] = 1e-13
    with pytest.raises(InvalidOutputError, match="not symmetric"):
        checked(Result(I, covariance=small), 0)


def test_rounding_in_a_covariance_is_no_breach():
    P = with_entry(SQUARES, 0, 1, 1e-10)
    assert checked(Result(I, covariance=P), 0).covariance[0, 1] == 1e-10


def test_tracks_of_any_number_pass():
    for n in (0, 1, 3):
        tracks = Tracks(np.zeros((n, 2)), np.ones((n, 2)), np.ones(n, int))
        assert checked(Result(I, tracks=tracks), 0).tracks.inlier.tolist() == [True] * n


def test_a_number_that_is_not_finite_is_left_out_of_the_stats():
    assert checked(Result(I, stats={"a": np.nan, "b": np.inf, "c": 1}), 0).stats == {"c": 1.0}


def test_revised_poses_are_checked_each_by_its_frame():
    assert list(checked_revision({3: I, np.int64(5): at(1.0)})) == [3, 5]
    with pytest.raises(InvalidOutputError, match=r"finish\(\): the pose is not a rigid transform"):
        checked_revision({3: 2 * I})
    with pytest.raises(InvalidOutputError, match="poses by their frame's index, got list"):
        checked_revision([I])


def test_a_text_from_outside_becomes_one_printable_line_of_limited_length():
    assert in_one_line(" a\n\tb\x1b[31m  c\ud800 ").startswith("a b")
    assert "\x1b" not in in_one_line("a\x1b[31m")
    assert in_one_line("x" * 10, 4) == "xxxx"
    assert in_one_line("x" * 4, 4) == "xxxx"
    assert in_one_line(" " * 15 + "y" * 10, 4) == "y"  # only the first 16 letters are looked at
