"""Laws of ranks: what is decided is real, what is alike is not decided, and no failure is hidden by a mean."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import mannwhitneyu

from vobench.metric.ranking import difference_p, holm, mean_places, permutation_p, rank, repeats_to_decide, trial_loss


def losses_of(rng, ratios, *, cases=12, repeats=4, noise=0.3):
    """Losses (E, C, R) of estimators that differ by these ratios, over cases that differ by more."""
    shape = len(ratios), cases, repeats
    log_loss = rng.normal(-5, 1.5, (1, cases, 1)) + rng.normal(0, noise, shape) + np.log(ratios)[:, None, None]
    return np.exp(log_loss)


def ranked(loss, failed=None):
    return rank(loss, np.zeros_like(loss) if failed is None else failed)


@settings(max_examples=30)
@given(arrays(float, (4, 3, 2), elements=st.floats(1e-9, 1)), arrays(bool, (4, 3, 2)))
def test_no_estimator_that_failed_more_often_ranks_before_another_however_exact_it_was(loss, failed):
    found = rank(loss, failed.astype(float))
    assert all(above.failed <= below.failed + 1e-12 for above, below in pairwise(found))
    assert sorted(each.index for each in found) == [0, 1, 2, 3]
    assert all(each.places[0] <= each.place <= each.places[1] for each in found)


@given(st.floats(0, 1), st.floats(0, 1))
def test_a_failed_trial_loses_no_less_than_any_survivor(failed, survived):
    assert trial_loss(failed, survived=False) >= 0.5
    assert trial_loss(0.5 + survived / 2, survived=True) <= 0.5
    assert trial_loss(None, survived=False) == 1


def test_two_copies_of_one_estimator_are_not_decided_in_95_of_100_boards():
    rng = np.random.default_rng(0)
    boards = [ranked(losses_of(rng, [1, 1], repeats=2)) for _ in range(200)]
    assert sum(second.decided_above for _, second in boards) <= 10


def test_one_that_is_10_percent_better_is_found_with_the_repeats_that_the_board_asks_for():
    rng, found = np.random.default_rng(1), []
    for _ in range(25):
        asked = ranked(losses_of(rng, [1, 1.1]))[1].repeats
        if asked:
            first, second = ranked(losses_of(rng, [1, 1.1], repeats=asked))
            found.append(first.index == 0 and second.decided_above)
    assert len(found) >= 18
    assert np.mean(found) >= 0.8


def test_five_levels_of_noise_are_ranked_in_order_and_their_places_do_not_overlap():
    found = ranked(losses_of(np.random.default_rng(2), [8, 1, 16, 2, 4], cases=8, noise=0.1))
    assert [each.index for each in found] == [1, 3, 4, 0, 2]
    assert [each.places for each in found] == [(k, k) for k in range(1, 6)]
    for each, ratio in zip(found[1:], (2, 4, 8, 16), strict=True):
        low, high = each.ratio_interval
        assert low < each.loss_ratio < high
        assert each.loss_ratio == pytest.approx(ratio, rel=0.1)


def test_too_few_trials_decide_nothing():
    found = ranked(losses_of(np.random.default_rng(3), [1, 100, 10000], cases=6, repeats=1))
    assert [each.places for each in found] == [(1, 3)] * 3
    assert not any(each.decided_above or each.ratio_interval for each in found)


def test_repeats_that_are_all_alike_count_once():
    few = losses_of(np.random.default_rng(4), [1, 3], cases=5, repeats=1, noise=0)
    assert not ranked(np.repeat(few, 9, axis=2))[1].decided_above


def test_one_crash_in_many_cases_costs_the_first_place_and_is_not_called_decided():
    loss = losses_of(np.random.default_rng(5), [1, 2], repeats=1)
    failed = np.zeros_like(loss)
    failed[0, 0] = 1
    first, second = ranked(loss, failed)
    assert (first.index, second.index, second.decided_above) == (1, 0, False)


@given(st.permutations(range(4)))
@settings(max_examples=10)
def test_names_do_not_matter(order):
    loss = losses_of(np.random.default_rng(6), [1, 2, 4, 8])
    assert [order[each.index] for each in ranked(loss[order])] == [0, 1, 2, 3]


def test_equal_ones_share_a_place():
    loss = losses_of(np.random.default_rng(7), [1])
    assert [each.place for each in ranked(np.concatenate([loss, loss, 2 * loss]))] == [1, 1, 3]


def test_cases_that_stand_still_have_no_loss_and_change_none():
    loss = losses_of(np.random.default_rng(8), [1, 2])
    still = np.concatenate([loss, np.full_like(loss[:, :1], np.nan)], axis=1)
    before, after = ranked(loss), rank(still, np.zeros_like(still))
    assert [(a.index, pytest.approx(a.loss)) for a in before] == [(b.index, b.loss) for b in after]


@pytest.mark.parametrize(("n", "p"), [(1, 1.0), (6, 2 / 64), (7, 2 / 128)])
def test_that_all_signs_agree_has_the_chance_of_a_coin(n, p):
    rng = np.random.default_rng(0)
    assert permutation_p(np.arange(1.0, n + 1), rng) == p == permutation_p(-np.arange(1.0, n + 1), rng)


@pytest.mark.parametrize("n", [60, 300])
def test_drawn_signs_and_the_normal_law_are_near_the_t_test_for_many(n):
    from scipy.stats import ttest_1samp

    d = np.random.default_rng(n).normal(0.15, 1, n)
    assert permutation_p(d, np.random.default_rng(0)) == pytest.approx(ttest_1samp(d, 0).pvalue, abs=0.02)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=6))
def test_holm_raises_every_chance_and_keeps_their_order(p):
    corrected = holm(p)
    assert all(q >= min(before, 1) for q, before in zip(corrected, p, strict=True))
    assert min(corrected) == pytest.approx(min(1, len(p) * min(p)))
    assert np.all(np.diff(np.array(corrected)[np.argsort(p, kind="stable")]) >= 0)


@pytest.mark.parametrize(("n", "m"), [(4, 4), (5, 7), (9, 6)])
def test_chances_on_one_case_are_those_of_mann_and_whitney(n, m):
    rng = np.random.default_rng(n)
    a, b = rng.normal(0, 1, n), rng.normal(1, 1, m)
    expected = mannwhitneyu(a, b, method="exact").pvalue
    assert difference_p(a, b) == pytest.approx(expected) == pytest.approx(difference_p(b, a))


def test_three_trials_on_one_case_decide_nothing_and_four_do_though_some_failed():
    assert difference_p(np.arange(3.0), np.arange(10.0, 13.0)) == 1
    assert difference_p(np.arange(4.0), np.array([10.0, 11.0, np.inf, np.inf])) < 0.05


@given(arrays(float, (3, 4, 2), elements=st.floats(1e-6, 1)))
def test_places_of_a_case_add_up(loss):
    assert mean_places(loss, np.zeros_like(loss)).sum() == pytest.approx(1 + 2 + 3)


def test_more_noise_asks_for_more_repeats_and_unlike_cases_for_more_cases():
    rng = np.random.default_rng(9)
    asked = [repeats_to_decide(rng.normal(0, noise, (12, 6))) for noise in (0.01, 0.3, 1.0)]
    assert asked == sorted(asked)
    assert asked[0] < asked[2]
    unlike = rng.normal(0, 0.1, (12, 6)) + rng.normal(0, 1, (12, 1))
    assert repeats_to_decide(unlike) is None
