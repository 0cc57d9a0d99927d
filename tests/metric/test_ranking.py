"""Laws of ranks: what is decided holds for other places, what is alike is not decided, and failures cost their loss."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from vobench.metric.ranking import DECIDED, MIN_LOSS, TrialTable, beside, rank, trial_loss
from vobench.metric.significance import holm
from vobench.metric.unit import make_design, separate_places


def losses_of(rng, ratios, *, cases=12, repeats=4, place_std=0.0, noise=0.3):
    """Losses (E, C, R) of estimators that differ by these ratios, over cases that differ by more."""
    shape = len(ratios), cases, repeats
    of_place = rng.normal(0, place_std, (len(ratios), cases, 1)) if place_std else 0
    log_loss = rng.normal(-5, 1.5, (1, cases, 1)) + of_place + rng.normal(0, noise, shape)
    return np.exp(log_loss + np.log(ratios)[:, None, None])


def table(loss, design=None, *, error=None):
    return TrialTable(loss, loss / 5 if error is None else error, design or separate_places(loss.shape[1]))


def ranked(loss, design=None, *, error=None):
    return rank(table(loss, design, error=error))


@settings(max_examples=30)
@given(arrays(float, (4, 3, 2), elements=st.floats(1e-9, 1)))
def test_estimators_are_ordered_by_the_geometric_mean_of_their_losses(loss):
    found = ranked(loss)
    means = np.exp(np.log(loss).mean((1, 2)))
    assert [each.loss for each in found] == pytest.approx(sorted(means))
    assert sorted(each.index for each in found) == [0, 1, 2, 3]
    assert all(above.rank <= below.rank for above, below in pairwise(found))
    assert {each.rank_interval for each in found} == {None}  # three places are too few for a test


@given(st.floats(0, 1), st.floats(0, 1))
def test_a_failed_trial_loses_no_less_than_any_survivor(failed, survived):
    assert trial_loss(failed, survived=False) >= 0.5
    assert trial_loss(0.5 + survived / 2, survived=True) <= 0.5
    assert trial_loss(None, survived=False) == 1


@pytest.mark.parametrize(
    ("lost_aware", "survived", "loss"),
    [(0.9, True, 0.1), (0.3, False, 0.7), (0.9, False, 0.6), (1.0, True, MIN_LOSS), (None, True, 0.5), (0.5, False, 1)],
)
def test_the_loss_of_a_trial_is_1_minus_its_score(lost_aware, survived, loss):
    assert trial_loss(lost_aware, survived=survived) == pytest.approx(loss)


def test_one_crash_in_many_trials_does_not_cost_a_far_better_estimator_the_first_place():
    loss = losses_of(np.random.default_rng(0), [1.0, 5.0], cases=25)
    loss[0, 0, 0] = 0.9
    assert ranked(loss)[0].index == 0


def test_an_estimator_that_never_answers_badly_enough_to_fail_is_behind_one_that_works_and_fails_once():
    """Standing still loses nearly 1/2 on every case."""
    still = np.full((3, 1), 0.45)
    works = np.array([[0.004], [0.006], [0.7]])
    assert [each.index for each in ranked(np.stack([still, works]))] == [1, 0]


def test_two_equally_good_estimators_that_differ_from_place_to_place_are_decided_in_2_of_100_boards():
    rng = np.random.default_rng(0)
    boards = [ranked(losses_of(rng, [1, 1], place_std=0.3)) for _ in range(400)]
    decided = sum(bool(second.decided_above) for _, second in boards)
    assert decided <= 400 * DECIDED + 2.33 * np.sqrt(400 * DECIDED * (1 - DECIDED))


def test_cases_that_share_a_place_are_one_piece_of_evidence():
    """24 cases on drives of their own in four places: a test over cases would decide in 4 of 10 boards."""
    rng = np.random.default_rng(1)
    place = np.repeat(np.arange(4), 6)
    design = make_design(place.tolist(), list(range(24)))
    decided = 0
    for _ in range(300):
        of_place = rng.normal(0, 0.3, (2, 4))[:, place, None]
        loss = np.exp(-5 + of_place + rng.normal(0, 0.1, (2, 24, 4)))
        decided += bool(ranked(loss, design)[1].decided_above)
    assert decided <= 300 * DECIDED + 2.33 * np.sqrt(300 * DECIDED * (1 - DECIDED))


def test_repeats_in_one_place_decide_nothing_however_many():
    loss = losses_of(np.random.default_rng(0), [1, 50], cases=1, repeats=100)
    second = ranked(loss)[1]
    assert (second.decided_above, second.p_above, second.error_interval) == (None, None, None)
    assert second.rank_interval is None


@pytest.mark.parametrize(
    ("places", "drives", "is_tested"), [(7, 1, True), (6, 1, False), (4, 2, True), (3, 4, False), (4, 1, False)]
)
def test_a_test_takes_seven_drives_in_four_places(places, drives, is_tested):
    place = np.repeat(np.arange(places), drives)
    design = make_design(place.tolist(), list(range(places * drives)))
    loss = losses_of(np.random.default_rng(0), [1, 3], cases=places * drives)
    assert (ranked(loss, design)[1].decided_above is not None) == is_tested


def test_the_chance_is_that_of_a_paired_t_test_over_places_corrected_by_holm():
    loss = losses_of(np.random.default_rng(3), [1, 1.3, 1.5], repeats=2)
    found = ranked(loss)
    means = np.log(loss).mean(2)
    ordered = means[[each.index for each in found]]
    expected = holm([float(stats.ttest_rel(below, above).pvalue) for above, below in pairwise(ordered)])
    assert [each.p_above for each in found[1:]] == pytest.approx(expected)
    assert found[0].p_above is None
    assert found[0].decided_above is None


def test_a_large_difference_is_decided_and_its_ratio_is_in_its_interval():
    second = ranked(losses_of(np.random.default_rng(2), [1, 2], place_std=0.2, cases=15))[1]
    low, high = second.error_interval
    assert second.decided_above
    assert low < 2 < high
    assert second.rank_interval == (2, 2)
    assert 1 < second.smallest_ratio < 2


def test_intervals_of_ratios_hold_the_true_ratio_in_about_95_of_100_boards():
    rng = np.random.default_rng(4)
    held = []
    for _ in range(400):
        first, second = ranked(losses_of(rng, [1, 1], place_std=0.3))
        low, high = second.error_interval
        held.append(low <= 1 <= high)
        assert first.error_ratio == 1
    assert np.mean(held) == pytest.approx(0.95, abs=0.03)


def test_error_ratios_are_over_cases_where_both_survive():
    loss = np.full((2, 3, 1), 0.01)
    loss[1, 0] = 0.8
    error = np.array([[[0.002], [0.002], [0.002]], [[np.nan], [0.006], [0.006]]])
    second = ranked(loss, error=error)[1]
    assert second.error_ratio == pytest.approx(3)
    none_survives = np.where(np.arange(2)[:, None, None] == 1, np.nan, error)
    assert ranked(loss, error=none_survives)[1].error_ratio is None


def test_an_undecided_neighbour_is_among_the_possible_places_of_both():
    found = ranked(losses_of(np.random.default_rng(0), [1, 1.01, 9], place_std=0.3))
    assert [each.rank_interval for each in found] == [(1, 2), (1, 2), (3, 3)]


@given(st.permutations(range(4)))
@settings(max_examples=10)
def test_names_do_not_matter(order):
    loss = losses_of(np.random.default_rng(5), [1, 1.5, 2, 4])
    assert [each.loss for each in ranked(loss[list(order)])] == pytest.approx([each.loss for each in ranked(loss)])


def test_equal_ones_share_a_place():
    loss = np.full((3, 4, 1), 0.1)
    loss[2] = 0.2
    assert [each.rank for each in ranked(loss)] == [1, 1, 3]


def test_cases_that_stand_still_have_no_loss_and_change_none():
    loss = losses_of(np.random.default_rng(6), [1, 2])
    still = np.concatenate([loss, np.full((2, 3, 4), np.nan)], axis=1)
    assert [each.loss for each in ranked(still)] == pytest.approx([each.loss for each in ranked(loss)])
    assert [each.rank for each in ranked(np.full((2, 3, 4), np.nan))] == [1, 1]


def test_unequal_numbers_of_repeats_weigh_cases_alike():
    loss = np.full((1, 2, 4), np.nan)
    loss[0, 0] = 0.1
    loss[0, 1, 0] = 0.4
    assert ranked(loss)[0].loss == pytest.approx(0.2)


def test_an_estimator_beside_the_ranking_has_its_loss_and_its_ratio():
    loss = losses_of(np.random.default_rng(7), [1, 4])
    standing = beside(table(loss))
    assert standing.index == 1
    assert standing.loss == pytest.approx(np.exp(np.log(loss[1]).mean()))
    assert standing.error_ratio == pytest.approx(np.exp(np.log(loss[1] / loss[0]).mean()))
    assert standing.p_above is None


def test_alone_an_estimator_is_first_and_tested_against_nobody():
    (only,) = ranked(losses_of(np.random.default_rng(8), [1]))
    assert (only.rank, only.rank_interval, only.p_above, only.smallest_ratio, only.places_needed(1.5)) == (
        1,
        (1, 1),
        None,
        None,
        None,
    )


def test_the_places_that_are_named_decide_the_ratio_in_nine_of_ten_boards():
    rng = np.random.default_rng(9)
    found = []
    for _ in range(120):
        pilot = ranked(losses_of(rng, [1, 1.5], place_std=0.2))[1]
        cases = max(pilot.places_needed(1.5), 7)
        first, second = ranked(losses_of(rng, [1, 1.5], place_std=0.2, cases=cases))
        found.append(bool(second.decided_above) and first.index == 0)
    assert np.mean(found) >= 0.9
