"""As many points as a plot can show, and no peak lost."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.report.plot_points import MOST_POINTS, path_points, peak_indices, spread_indices


def test_the_details_of_a_hundred_cells_of_a_thousand_frames_are_small():
    """Each curve and each path has no more points than a plot can show."""
    errors = np.abs(np.random.default_rng(0).normal(size=5000))
    assert len(peak_indices(errors)) <= MOST_POINTS >= len(path_points(errors[:, None].repeat(2, 1)))
    assert np.argmax(errors) in peak_indices(errors)


@given(st.integers(0, 2000))
def test_indices_are_few_increasing_and_hold_both_ends(count):
    indices = spread_indices(count)
    assert len(indices) == min(count, MOST_POINTS)
    assert indices == sorted(set(indices))
    if count:
        assert (indices[0], indices[-1]) == (0, count - 1)


def test_a_short_path_and_a_short_curve_are_shown_whole():
    path_m = np.random.default_rng(0).normal(size=(MOST_POINTS, 2))
    assert path_points(path_m) == pytest.approx(path_m, abs=5.1e-5)
    assert path_points(np.array([[0.123456, -2.0]])) == [[0.1235, -2.0]]
    assert peak_indices(path_m[:, 0]) == list(range(MOST_POINTS))
    assert peak_indices(np.zeros(0)) == []
    assert path_points(np.zeros((0, 2))) == []


@given(st.integers(1, 1000), st.data())
def test_a_peak_anywhere_is_kept(count, data):
    errors = np.zeros(count)
    peak = data.draw(st.integers(0, count - 1))
    errors[peak] = 1.0
    assert peak in peak_indices(errors)
    assert len(peak_indices(errors)) == min(count, MOST_POINTS)
