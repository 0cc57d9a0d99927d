"""Errors are permuted without losing what makes them resemble each other."""

import numpy as np
import pytest

from vobench.analysis.error_permutation import (
    log_means,
    make_series_design,
    permuted_log_means,
    resample,
    rotate,
)
from vobench.geometry.se3 import Array


def permuted(losses: list[Array], cases: list[str], places: list[str], drives: list[str], *, draws: int = 50) -> Array:
    """The permuted errors (draws, series, segments) of series of the same length, in segments of one frame."""
    design = make_series_design(cases, places, drives)
    drawn = permuted_log_means(losses, design, segment=1, floor=1e-9, draws=draws)
    return np.exp(drawn.reshape(draws, len(losses), -1))


def numbered(count: int, *, frames: int = 20) -> list[Array]:
    """Series whose values are all different: 1.00 to 1.19, 2.00 to 2.19 and so on."""
    return [number + 1 + np.arange(frames) / 100 for number in range(count)]


def test_a_rotation_keeps_the_order_and_closes_the_circle() -> None:
    values = np.arange(8.0)
    assert rotate(values, 0.25).tolist() == [6, 7, 0, 1, 2, 3, 4, 5]
    assert rotate(values, 0.0).tolist() == values.tolist()


def test_resampling_keeps_the_shape_of_a_longer_and_of_a_shorter_series() -> None:
    assert resample(np.arange(4.0), 8).tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert resample(np.arange(8.0), 4).tolist() == [0, 2, 4, 6]


def test_segments_are_averaged_before_the_logarithm_and_the_last_may_be_shorter() -> None:
    means = np.exp(log_means(np.array([1.0, 3.0, 5.0, 7.0, 4.0]), 2, 1e-9))
    assert means == pytest.approx([2, 6, 4])
    assert np.exp(log_means(np.zeros(2), 2, 0.5)) == pytest.approx([0.5])


def test_series_on_one_drive_are_rotated_together_and_others_separately() -> None:
    shifts = np.argmin(permuted(numbered(3), ["a", "b", "c"], ["x", "x", "y"], ["one", "one", "two"]), axis=2)
    assert (shifts[:, 0] == shifts[:, 1]).all()
    assert (shifts[:, 0] != shifts[:, 2]).any()


def test_no_rotation_leaves_errors_beside_their_conditions() -> None:
    shifts = np.argmin(permuted(numbered(1), ["a"], ["x"], ["one"], draws=300)[:, 0], axis=1)
    assert set(shifts.tolist()) == set(range(1, 20))


def test_cases_are_exchanged_within_their_unit_alone_and_keep_their_repeats_together() -> None:
    losses = numbered(6)
    cases = ["a", "a", "b", "b", "c", "d"]
    drawn = np.floor(permuted(losses, cases, ["x"] * 4 + ["y"] * 2, ["one"] * 6)[:, :, 0] + 1e-9)
    first_unit = {tuple(row) for row in drawn[:, :4].tolist()}
    within = permuted(losses, cases, ["x"] * 6, ["one"] * 6)
    assert within.shape == (50, 6, 20)
    # Levels of units are exchanged too, so the ratio of two cases of a unit tells which series each has.
    assert len(first_unit) > 1
    pairs = {tuple(row) for row in np.floor(within[:, :2, 0] + 1e-9).tolist()}
    assert pairs <= {(1.0, 2.0), (3.0, 4.0), (5.0, 5.0), (6.0, 6.0)}


def test_levels_of_units_are_exchanged_as_factors() -> None:
    losses = [np.full(20, 0.1), np.full(20, 0.4)]
    drawn = permuted(losses, ["a", "b"], ["x", "y"], ["one", "two"])[:, :, 0].round(6)
    assert {tuple(row) for row in drawn.tolist()} == {(0.1, 0.4), (0.4, 0.1)}


def test_equal_seeds_draw_the_same() -> None:
    arguments = (numbered(2), ["a", "b"], ["x", "x"], ["one", "one"])
    np.testing.assert_array_equal(permuted(*arguments), permuted(*arguments))
