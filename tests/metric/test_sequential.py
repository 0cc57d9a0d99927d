"""Laws of comparisons that are looked at after every unit: their errors are bounded however often one looks."""

import numpy as np
import pytest
from scipy import integrate, stats

from vobench.metric.sequential import (
    MIN_UNITS,
    PRIOR_VARIANCE,
    PairState,
    PairVerdict,
    bayes_factor,
    half_width,
    open_pairs,
    pair_verdicts,
)
from vobench.metric.significance import PairedDifference, paired_difference

ALPHA = 0.02
LOOKS = range(MIN_UNITS, 81)


def test_the_bayes_factor_is_the_likelihood_of_a_normal_prior_on_the_effect_over_that_of_none():
    difference = PairedDifference(12, 0.4, 0.7)
    t = np.sqrt(12) * 0.4 / 0.7

    def weighted_likelihood(effect):
        prior = stats.norm.pdf(effect, scale=np.sqrt(PRIOR_VARIANCE))
        return prior * stats.nct.pdf(t, 11, effect * np.sqrt(12))

    expected = integrate.quad(weighted_likelihood, -6, 6)[0] / stats.t.pdf(t, 11)
    assert bayes_factor(difference) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("units", [12, 40, 300])
def test_the_sequence_ends_where_the_bayes_factor_reaches_1_over_alpha(units):
    std = 0.6
    end = half_width(PairedDifference(units, 0.0, std), ALPHA)
    assert bayes_factor(PairedDifference(units, end, std)) == pytest.approx(1 / ALPHA)


def test_a_sequence_is_wider_than_the_interval_of_a_chosen_number_and_shrinks():
    widths = [half_width(PairedDifference(units, 0.0, 1.0), ALPHA) for units in (10, 20, 50, 200)]
    assert widths == sorted(widths, reverse=True)
    for units, width in zip((10, 20, 50, 200), widths, strict=True):
        _, fixed = PairedDifference(units, 0.0, 1.0).interval(ALPHA)
        assert fixed < width < 2.5 * fixed


def test_nothing_is_stated_below_the_least_number_of_units():
    few = PairedDifference(MIN_UNITS - 1, 5.0, 0.1)
    assert half_width(few, ALPHA) == np.inf
    assert bayes_factor(few) == 1
    assert PairVerdict(0, 1, few, ALPHA, 1.5).verdict is PairState.OPEN
    assert PairVerdict(0, 1, few, ALPHA, 1.5).units_needed(1000) is None


def test_equal_differences_are_certain():
    assert bayes_factor(PairedDifference(MIN_UNITS, 0.1, 0.0)) == np.inf
    assert bayes_factor(PairedDifference(MIN_UNITS, 0.0, 0.0)) == 1
    alike = PairVerdict(0, 1, PairedDifference(12, 0.0, 0.0), ALPHA, 1.5)
    assert alike.verdict is PairState.ALIKE


def statements(differences):
    """The lower and the upper end of the sequence (B, L) of boards of differences (B, N), after each look."""
    units = np.array(LOOKS)
    means = differences.cumsum(axis=1)[:, units - 1] / units
    squares = (differences**2).cumsum(axis=1)[:, units - 1]
    stds = np.sqrt((squares - units * means**2) / (units - 1))
    of_unit_std = np.array([half_width(PairedDifference(count, 0.0, 1.0), ALPHA) for count in LOOKS])
    return means - of_unit_std * stds, means + of_unit_std * stds


def false_rate(differences, mean):
    """The share of boards that claim an order or a likeness, at any look, that a true mean contradicts."""
    low, high = statements(mean + differences)
    limit = np.log(1.5)
    is_second_better = (high < 0) & (mean >= 0)
    is_first_better = (low > 0) & (mean <= 0)
    is_alike = (low > -limit) & (high < limit) & (abs(mean) >= limit)
    return (is_second_better | is_first_better | is_alike).any(axis=1).mean()


def test_looking_after_every_unit_claims_a_falsehood_in_2_of_100_at_most():
    """Short form of `benchmarks/error_rates.py`: 2000 boards, so 2 % and three standard errors are 2.9 %."""
    rng = np.random.default_rng(4)
    shape = 2000, LOOKS[-1]
    assert false_rate(rng.normal(0, 0.6, shape), 0.0) <= 0.029
    assert false_rate(rng.normal(0, 0.6, shape), np.log(1.5)) <= 0.029
    assert false_rate(0.3 * rng.standard_t(2, shape), 0.0) <= 0.029


def test_a_t_test_that_is_repeated_after_every_unit_would_be_wrong_far_more_often():
    """The simulation above can fail: it finds what looking does to an interval that was made for one look."""
    rng = np.random.default_rng(4)
    wrong = 0
    for _ in range(100):
        differences = rng.normal(0, 0.6, LOOKS[-1])
        wrong += any(paired_difference(differences[:units]).p < ALPHA for units in LOOKS)
    assert wrong / 100 > 0.05


def test_what_differs_is_decided_and_what_does_not_is_found_alike():
    rng = np.random.default_rng(5)
    worse = rng.normal(np.log(2), 0.6, 60)
    same = rng.normal(0.0, 0.6, 300)
    assert pair_verdicts(np.array([np.zeros(60), worse]), ratio=1.5, alpha=ALPHA)[0].verdict is PairState.FIRST_BETTER
    assert pair_verdicts(np.array([worse, np.zeros(60)]), ratio=1.5, alpha=ALPHA)[0].verdict is PairState.SECOND_BETTER
    assert pair_verdicts(np.array([np.zeros(300), same]), ratio=1.5, alpha=ALPHA)[0].verdict is PairState.ALIKE


def test_all_pairs_share_the_error():
    verdicts = pair_verdicts(np.random.default_rng(0).normal(size=(4, 20)), ratio=1.5, alpha=ALPHA)
    assert len(verdicts) == 6
    assert {pair.alpha for pair in verdicts} == {ALPHA / 6}
    assert open_pairs(verdicts) == verdicts


def test_units_that_an_estimator_lacks_do_not_count():
    log_losses = np.random.default_rng(0).normal(size=(2, 20))
    log_losses[1, 3] = np.nan
    (pair,) = pair_verdicts(log_losses, ratio=1.5, alpha=ALPHA)
    assert pair.difference.units == 19


def test_the_units_needed_are_the_first_that_decide_at_the_same_mean_and_deviation():
    pair = PairVerdict(0, 1, PairedDifference(10, np.log(1.5), 0.6), ALPHA, 1.5)
    needed = pair.units_needed(1000)
    assert pair.verdict is PairState.OPEN
    later = PairVerdict(0, 1, PairedDifference(needed, np.log(1.5), 0.6), ALPHA, 1.5)
    earlier = PairVerdict(0, 1, PairedDifference(needed - 1, np.log(1.5), 0.6), ALPHA, 1.5)
    assert (earlier.verdict, later.verdict) == (PairState.OPEN, PairState.FIRST_BETTER)
    assert pair.units_needed(needed - 1) is None
