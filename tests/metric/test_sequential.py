"""Laws of comparisons that are looked at after every unit: their errors are bounded however often one looks."""

from itertools import combinations

import numpy as np
import pytest

from vobench.metric.sequential import (
    BOUND,
    LARGEST_RATIO,
    MIN_UNITS,
    PairState,
    PairVerdict,
    e_value,
    interval,
    known_differences,
    log_wealth,
    log_wealths,
    open_pairs,
    pair_verdicts,
)
from vobench.metric.significance import paired_difference

ALPHA = 0.02
UNITS = 120


def verdict_on(differences, *, ratio=1.5):
    return PairVerdict(0, 1, tuple(differences), ALPHA, ratio)


def test_the_wealth_of_a_bet_on_a_mean_of_zero_is_1_on_average():
    """The law behind all of it, for differences that are rarely -BOUND: over all that 10 units may show."""
    probability = 0.1  # of -BOUND; the others are such that the mean is zero
    gain = BOUND * probability / (1 - probability)
    expected = 0.0
    for failures in range(11):
        differences = np.array([-BOUND] * failures + [gain] * (10 - failures))
        likelihood = probability**failures * (1 - probability) ** (10 - failures)
        orders = len(list(combinations(range(10), failures)))
        expected += orders * likelihood * np.exp(log_wealth(differences, 0.0))
    assert expected == pytest.approx(1.0)


def test_the_wealth_depends_on_no_order_and_grows_as_units_come():
    differences = np.random.default_rng(0).normal(0.3, 0.6, 30)
    assert log_wealth(differences, 0.0) == pytest.approx(log_wealth(differences[::-1], 0.0))
    by_unit = [log_wealth(differences[: count + 1], 0.1) for count in range(30)]
    np.testing.assert_allclose(log_wealths(differences, 0.1), by_unit)
    assert log_wealth(np.array([]), 0.0) == 0.0


def test_the_interval_ends_where_the_wealth_reaches_2_over_alpha():
    differences = np.random.default_rng(0).normal(0.3, 0.6, 40)
    low, high = interval(differences, ALPHA)
    assert low < differences.mean() < high
    assert log_wealth(differences, low) == pytest.approx(np.log(2 / ALPHA))
    assert log_wealth(-differences, -high) == pytest.approx(np.log(2 / ALPHA))
    mirrored = interval(-differences, ALPHA)
    assert mirrored == pytest.approx((-high, -low))


def test_an_interval_begins_with_all_there_is_and_shrinks_more_slowly_than_that_of_a_chosen_number():
    assert interval(np.array([]), ALPHA) == pytest.approx((-BOUND, BOUND))
    differences = np.tile([0.5, -0.5], 200)
    widths = [interval(differences[:units], ALPHA)[1] for units in (20, 50, 100, 400)]
    assert widths == sorted(widths, reverse=True)
    for units, width in zip((20, 50, 100, 400), widths, strict=True):
        _, fixed = paired_difference(differences[:units]).interval(ALPHA)
        assert fixed < width


def test_a_unit_counts_for_the_largest_ratio_at_most():
    differences = np.full(20, 0.1)
    differences[3] = BOUND
    beyond = differences.copy()
    beyond[3] = 100.0
    assert log_wealth(differences, 0.0) == log_wealth(beyond, 0.0)
    assert np.log(LARGEST_RATIO) == BOUND


def test_few_units_state_nothing_however_much_they_differ():
    few = verdict_on([100.0] * (MIN_UNITS - 1))
    assert (few.verdict, few.has_interval, few.units_needed(1000)) == (PairState.OPEN, False, None)
    assert verdict_on([100.0] * (MIN_UNITS + 2)).verdict is PairState.FIRST_BETTER


def test_equal_losses_are_alike_once_rare_failures_are_excluded():
    assert verdict_on([0.0] * 10).verdict is PairState.OPEN
    assert verdict_on([0.0] * 90).verdict is PairState.EQUIVALENT
    assert e_value(np.zeros(90)) == pytest.approx(1)


def false_rate(differences, mean):
    """The share of boards (B, N) that claim an order or a likeness, at any look, that a true mean contradicts."""
    threshold = np.log(2 / ALPHA)
    limit = np.log(1.5)
    claims_more = log_wealths(differences, 0.0) >= threshold
    claims_less = log_wealths(-differences, 0.0) >= threshold
    is_alike = (log_wealths(differences, -limit) >= threshold) & (log_wealths(-differences, -limit) >= threshold)
    is_false = claims_less & (mean >= 0) | claims_more & (mean <= 0) | is_alike & (abs(mean) >= limit)
    return is_false.any(axis=1).mean()


def one_fails(rng, share):
    """Differences of mean 0 where one estimator fails in a share of units at 4 log units, and is better elsewhere."""
    shape = 2000, UNITS
    return rng.normal(0, 0.4, shape) + 4.0 * (rng.random(shape) < share) - 4.0 * share


def test_looking_after_every_unit_claims_a_falsehood_in_2_of_100_at_most():
    """Short form of `benchmarks/error_rates.py`: 2000 boards, so 2 % and three standard errors are 2.9 %."""
    rng = np.random.default_rng(4)
    shape = 2000, UNITS
    assert false_rate(rng.normal(0, 0.6, shape), 0.0) <= 0.029
    assert false_rate(rng.normal(np.log(1.5), 0.6, shape), np.log(1.5)) <= 0.029
    assert false_rate(0.3 * rng.standard_t(2, shape), 0.0) <= 0.029
    assert false_rate(0.6 * (rng.exponential(size=shape) - 1), 0.0) <= 0.029
    assert false_rate(one_fails(rng, 0.1), 0.0) <= 0.029
    assert false_rate(one_fails(rng, 1 / 30), 0.0) <= 0.029


def test_a_t_test_that_is_repeated_after_every_unit_would_be_wrong_far_more_often():
    """The simulation above can fail: it finds what looking does to an interval that was made for one look."""
    rng = np.random.default_rng(4)
    differences = one_fails(rng, 0.1)[:200]
    wrong = 0
    for of_board in differences:
        wrong += any(paired_difference(of_board[:units]).p < ALPHA for units in range(7, UNITS, 3))
    assert wrong / 200 > 0.2


def test_what_differs_is_decided_and_what_does_not_is_found_alike():
    rng = np.random.default_rng(5)
    worse = rng.normal(np.log(2.5), 0.6, 60)
    same = rng.normal(0.0, 0.6, 300)
    assert pair_verdicts(np.array([np.zeros(60), worse]), ratio=1.5, alpha=ALPHA)[0].verdict is PairState.FIRST_BETTER
    assert pair_verdicts(np.array([worse, np.zeros(60)]), ratio=1.5, alpha=ALPHA)[0].verdict is PairState.SECOND_BETTER
    assert pair_verdicts(np.array([np.zeros(300), same]), ratio=1.5, alpha=ALPHA)[0].verdict is PairState.EQUIVALENT


def test_all_pairs_share_the_error():
    verdicts = pair_verdicts(np.random.default_rng(0).normal(size=(4, 20)), ratio=1.5, alpha=ALPHA)
    assert len(verdicts) == 6
    assert {pair.alpha for pair in verdicts} == {ALPHA / 6}
    assert open_pairs(verdicts) == verdicts


def test_units_that_an_estimator_lacks_do_not_count():
    log_losses = np.random.default_rng(0).normal(size=(2, 20))
    log_losses[1, 3] = np.nan
    (pair,) = pair_verdicts(log_losses, ratio=1.5, alpha=ALPHA)
    assert pair.units == 19 == len(known_differences(log_losses[1] - log_losses[0]))


@pytest.mark.parametrize("pattern", [(1.1, 0.1, 0.4, 0.2), (0.05, -0.05)])
def test_the_units_needed_are_about_the_first_that_settle_if_the_others_are_like_those_seen(pattern):
    pair = verdict_on(np.resize(pattern, 8))
    needed = pair.units_needed(1000)
    assert pair.verdict is PairState.OPEN
    settled = next(units for units in range(2, 1000) if is_settled(pattern, units))
    assert settled <= needed <= settled + 2 + 0.05 * settled
    assert pair.units_needed(needed - 1) is None


def is_settled(pattern, units):
    differences = np.resize(pattern, units)
    return verdict_on(differences).verdict is not PairState.OPEN
