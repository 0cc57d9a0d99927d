"""Laws of units: what shares a place counts once, and no place outweighs another."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.metric.unit import make_design, mean_of_known, separate_places


def test_drives_of_one_name_in_two_places_are_two():
    design = make_design(["room", "street", "room", "room"], ["circle", "circle", "circle", "wander"])
    assert design.drive_of_case.tolist() == [0, 1, 0, 2]
    assert design.place_of_drive.tolist() == [0, 1, 0]
    assert (design.drives, design.places) == (3, 2)


def test_a_place_is_the_mean_of_its_drives_and_a_drive_that_of_its_cases():
    design = make_design(["room"] * 4 + ["street"], ["a", "a", "a", "b", "a"])
    means = design.means(np.array([1.0, 2.0, 3.0, 10.0, 7.0]))
    assert means == pytest.approx([6.0, 7.0])  # (2 + 10) / 2, and the street's own


@given(st.integers(1, 5), st.integers(1, 4))
def test_cases_that_say_the_same_again_change_nothing(copies, places):
    values = np.arange(float(places))
    once = separate_places(places)
    again = make_design(np.repeat(np.arange(places), copies).tolist(), ["drive"] * (places * copies))
    assert again.means(np.repeat(values, copies)) == pytest.approx(once.means(values))


def test_missing_values_are_left_out_at_every_level():
    design = make_design(["room", "room", "street"], ["a", "b", "a"])
    values = np.array([[np.nan, 4.0, 1.0], [np.nan, np.nan, 3.0]])
    means = design.means(values)
    assert means[0] == pytest.approx([4.0, 1.0])
    assert np.isnan(means[1, 0])
    assert mean_of_known(means)[1] == 3.0
    repeats = np.array([[1.0, 3.0, np.nan], [np.nan, np.nan, np.nan]])
    assert mean_of_known(repeats)[0] == 2.0
    assert np.isnan(mean_of_known(repeats)[1])


def test_no_case_is_no_place():
    assert (make_design([], []).drives, make_design([], []).places) == (0, 0)
