"""Laws of tests: p-values as scipy gives them, power that simulation confirms, and corrections that bound errors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from vobench.metric.significance import POWER, PairedDifference, holm, paired_difference, paired_p_values


def test_the_p_value_and_the_interval_are_those_of_scipy():
    differences = np.random.default_rng(0).normal(0.3, 1, 15)
    expected = stats.ttest_1samp(differences, 0)
    found = paired_difference(differences)
    assert found.p == pytest.approx(expected.pvalue)
    ends = expected.confidence_interval(0.9)
    assert found.interval(0.1) == pytest.approx((ends.low, ends.high))


def test_units_without_a_difference_are_left_out():
    assert paired_difference(np.array([1.0, np.nan, 3.0])) == paired_difference(np.array([1.0, 3.0]))


def test_what_one_unit_shows_is_nothing():
    single = paired_difference(np.array([0.7]))
    assert single.p == 1
    assert (single.interval(0.05), single.detectable(0.02), single.units_needed(0.4, 0.02)) == (None, None, None)
    nothing = paired_difference(np.array([]))
    assert (nothing.units, nothing.mean, nothing.p) == (0, 0.0, 1.0)


def test_equal_differences_are_certain_and_no_difference_is_none():
    assert paired_difference(np.full(8, 0.1)).p == 0
    assert paired_difference(np.zeros(8)).p == 1


@pytest.mark.parametrize("units", [7, 12, 40])
def test_the_detectable_difference_is_found_as_often_as_promised(units):
    alpha = 0.02
    effect = PairedDifference(units, 0.0, 0.5).detectable(alpha)
    rng = np.random.default_rng(units)
    draws = rng.normal(effect, 0.5, (4000, units))
    found = stats.ttest_1samp(draws, 0, axis=1).pvalue < alpha
    assert found.mean() == pytest.approx(POWER, abs=0.012)


def test_more_units_detect_less_and_a_stricter_level_more():
    at_seven, at_thirty = (PairedDifference(units, 0.0, 0.5).detectable(0.02) for units in (7, 30))
    assert at_thirty < at_seven < PairedDifference(7, 0.0, 0.5).detectable(0.002)


def test_the_units_that_are_named_find_the_effect_in_nine_of_ten_pilots():
    """The standard deviation that a number of units rests on is itself measured over few."""
    rng = np.random.default_rng(3)
    found = []
    for _ in range(300):
        pilot = paired_difference(rng.normal(0, 0.5, 10))
        units = pilot.units_needed(0.4, 0.02)
        done = paired_difference(rng.normal(0.4, 0.5, units))
        found.append(done.p < 0.02 and done.mean > 0)
    assert np.mean(found) >= 0.9


def test_the_number_of_units_is_the_smallest_that_suffices():
    pilot = PairedDifference(1000, 0.0, 0.5)
    needed = pilot.units_needed(0.4, 0.02)
    enough = PairedDifference(needed, 0.0, 0.5 * np.sqrt(999 / stats.chi2.ppf(0.2, 999)))
    too_few = PairedDifference(needed - 1, 0.0, enough.std)
    assert enough.detectable(0.02) <= 0.4 < too_few.detectable(0.02)


def test_an_effect_that_no_number_of_units_shows_has_none():
    assert PairedDifference(10, 0.0, 1.0).units_needed(1e-6, 0.02) is None


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_corrected_p_values_are_no_smaller_keep_their_order_and_stay_below_one(p_values):
    corrected = holm(p_values)
    assert all(after >= before for before, after in zip(p_values, corrected, strict=True))
    assert max(corrected) <= 1
    order = np.argsort(p_values, kind="stable")
    assert (np.diff(np.array(corrected)[order]) >= 0).all()
    assert min(corrected) == pytest.approx(min(1.0, len(p_values) * min(p_values)))


def test_all_pairs_at_once_have_the_p_values_of_each():
    values = np.random.default_rng(6).normal(0, 1, (4, 9)) + np.arange(4)[:, None]
    values[2, 3] = np.nan
    table = paired_p_values(values)
    for a in range(4):
        for b in range(4):
            both = values[[a, b]][:, ~np.isnan(values).any(axis=0)]
            assert table[a, b] == pytest.approx(paired_difference(both[1] - both[0]).p, abs=1e-12)
