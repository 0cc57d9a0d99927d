"""Laws of ranks: what is decided is real, what is alike is not decided, and no failure is hidden by a mean."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import mannwhitneyu, norm, permutation_test

from vobench.metric.ranking import (
    MIN_LOSS,
    difference_p,
    holm,
    mean_places,
    permutation_p,
    rank,
    repeats_to_decide,
    trial_loss,
)


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


@pytest.mark.parametrize(
    ("lost_aware", "survived", "loss"),
    [
        (1.0, True, MIN_LOSS),
        (0.75, True, 0.25),
        (0.5, True, 0.5),
        (None, True, 0.5),
        (None, False, 1.0),
        (0.25, False, 0.75),
        (0.75, False, 0.75),  # scored as a survivor, by its poses alone
        (0.5, False, 1.0),
        (0.0, False, 1.0),
    ],
)
def test_the_loss_of_a_trial_is_1_minus_its_score(lost_aware, survived, loss):
    assert trial_loss(lost_aware, survived=survived) == loss


def brute_force_means(loss, failed):
    """Shares of failed trials and geometric mean losses, case by case."""
    shares, means = [], []
    for estimator in range(len(loss)):
        case_failed, case_log_loss = [], []
        for case in range(loss.shape[1]):
            if not np.isnan(failed[estimator, case]).all():
                case_failed.append(np.nanmean(failed[estimator, case]))
            if not np.isnan(loss[estimator, case]).all():
                case_log_loss.append(np.nanmean(np.log(loss[estimator, case])))
        shares.append(np.mean(case_failed))
        means.append(np.exp(np.mean(case_log_loss)))
    return shares, means


@pytest.mark.parametrize("seed", range(6))
def test_estimators_are_ordered_by_failed_share_then_geometric_mean_over_cases_of_means_over_repeats(seed):
    rng = np.random.default_rng(seed)
    loss = np.exp(rng.normal(-3, 1, (4, 5, 3)))
    failed = (rng.random((4, 5, 3)) < 0.1).astype(float)
    missing = rng.random((4, 5, 3)) < 0.2
    missing[:, :, 0] = False
    loss[missing] = np.nan
    failed[missing] = np.nan
    shares, means = brute_force_means(loss, failed)
    standings = rank(loss, failed)

    expected = sorted(range(4), key=lambda e: (round(shares[e], 12), means[e]))
    assert [standing.index for standing in standings] == expected
    for standing in standings:
        assert standing.failed == pytest.approx(shares[standing.index])
        assert standing.loss == pytest.approx(means[standing.index])
        assert standing.loss_ratio == pytest.approx(means[standing.index] / means[expected[0]])


def test_a_loss_of_zero_counts_as_the_smallest_loss():
    loss = losses_of(np.random.default_rng(11), [1, 2])
    loss[0] = 0.0

    assert ranked(loss)[0].loss == pytest.approx(MIN_LOSS)


def test_the_first_has_nobody_above_and_a_ratio_of_1_without_an_interval():
    first, second = ranked(losses_of(np.random.default_rng(12), [1, 1.3]))

    assert (first.p_above, first.decided_above, first.repeats, first.ratio_interval) == (None, False, None, None)
    assert (first.place, first.loss_ratio) == (1, 1.0)
    assert second.p_above is not None
    assert second.ratio_interval is not None


def test_a_ranking_of_one_estimator_or_of_none_that_differ_is_decided_by_nothing():
    loss = losses_of(np.random.default_rng(13), [1])

    assert [(each.place, each.places) for each in ranked(loss)] == [(1, (1, 1))]
    twins = ranked(np.concatenate([loss, loss]))
    assert [(each.place, each.places, each.decided_above) for each in twins] == [(1, (1, 2), False)] * 2
    assert twins[1].p_above == 1.0
    assert twins[1].ratio_interval is None


def test_an_undecided_neighbour_is_among_the_possible_places_of_both():
    found = ranked(losses_of(np.random.default_rng(14), [1, 1.0001, 50], noise=0.2))

    assert [each.decided_above for each in found] == [False, False, True]
    assert [each.places for each in found] == [(1, 2), (1, 2), (3, 3)]


def test_the_interval_of_a_ratio_holds_the_true_one_in_about_95_of_100_boards():
    rng = np.random.default_rng(15)
    held = 0
    for _ in range(200):
        standings = ranked(losses_of(rng, [1, 2], cases=20, repeats=1, noise=0.3))
        low, high = standings[1].ratio_interval
        held += low <= 2 <= high
    assert 180 <= held <= 198


def test_intervals_come_from_repeats_when_cases_are_few():
    rng = np.random.default_rng(16)
    loss = losses_of(rng, [1, 1], cases=3, repeats=20, noise=0.01)
    loss[1] *= np.array([1.0, 4.0, 16.0])[:, None]  # cases differ widely, repeats hardly
    low, high = ranked(loss)[1].ratio_interval

    assert low == pytest.approx(4, rel=0.02)
    assert high == pytest.approx(4, rel=0.02)


def test_intervals_come_from_cases_when_there_are_seven():
    rng = np.random.default_rng(17)
    loss = losses_of(rng, [1, 1], cases=7, repeats=20, noise=0.01)
    loss[1] *= np.geomspace(1, 16, 7)[:, None]
    low, high = ranked(loss)[1].ratio_interval

    assert low < 3
    assert high > 5


@pytest.mark.parametrize(("cases", "repeats", "is_enough"), [(6, 1, False), (7, 1, True), (3, 2, False), (3, 3, True)])
def test_seven_units_of_both_are_enough_to_decide(cases, repeats, is_enough):
    found = ranked(losses_of(np.random.default_rng(18), [1, 1000], cases=cases, repeats=repeats, noise=0.1))

    assert (found[1].ratio_interval is not None) == is_enough
    assert (found[1].places == (2, 2)) == is_enough


def test_more_tests_make_every_chance_larger():
    rng = np.random.default_rng(19)
    loss = losses_of(rng, [1, 1.2], cases=8, repeats=1)
    alone = ranked(loss)[1].p_above
    others = np.concatenate([loss, 100 * loss])

    assert ranked(others)[1].p_above >= alone


@pytest.mark.parametrize("n", [3, 8, 12])
def test_up_to_twelve_differences_the_chance_is_that_of_scipys_exact_permutation_test(n):
    differences = np.random.default_rng(n).normal(0.3, 1, n)
    expected = permutation_test(
        (differences,), np.sum, permutation_type="samples", n_resamples=np.inf, alternative="two-sided"
    )

    assert permutation_p(differences, np.random.default_rng(0)) == pytest.approx(expected.pvalue)


def test_above_two_hundred_differences_the_sum_is_normal():
    differences = np.random.default_rng(0).normal(0.1, 1, 201)
    z = differences.sum() / np.sqrt(np.sum(differences**2))

    assert permutation_p(differences, np.random.default_rng(0)) == pytest.approx(2 * norm.sf(abs(z)))


@pytest.mark.parametrize("n", [13, 200])
def test_drawn_signs_include_the_observed_ones_so_that_no_chance_is_zero(n):
    assert permutation_p(np.full(n, 1.0), np.random.default_rng(0)) == pytest.approx(1 / 4096, abs=1.5 / 4096)
    assert permutation_p(np.full(n, 1.0), np.random.default_rng(0)) >= 1 / 4096


def test_differences_of_zero_do_not_count_and_none_is_no_difference():
    differences = np.array([1.0, 2.0, 4.0])
    padded = np.array([0.0, 1.0, 0.0, 2.0, 4.0, 0.0])

    assert permutation_p(padded, np.random.default_rng(0)) == permutation_p(differences, np.random.default_rng(0))
    assert permutation_p(np.zeros(5), np.random.default_rng(0)) == 1.0


def test_equal_sums_count_as_equal_in_spite_of_rounding():
    assert permutation_p(np.array([0.1, 0.2, 0.3]), np.random.default_rng(0)) == 2 / 8
    assert permutation_p(np.array([0.1, 0.2, -0.3]), np.random.default_rng(0)) == 1.0


def test_holm_multiplies_by_the_number_of_tests_left():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.5, 0.9]) == [1.0, 1.0]
    assert holm([]) == []


def expected_repeats(within, n_cases, *, tests=1):
    """Repeats for a ratio of 1.1 at a power of 95 % with a two-sided level of 2 %, of a variance within cases."""
    z = norm.ppf(0.95) + norm.ppf(1 - 0.02 / 2 / tests)
    return int(np.ceil(within / n_cases * (z / np.log(1.1)) ** 2))


@pytest.mark.parametrize("tests", [1, 5])
def test_repeats_follow_from_the_variance_within_cases(tests):
    half = 0.4
    differences = np.tile([half, -half, half, -half], (5, 1))  # cases alike
    within = 4 * half**2 / 3

    assert repeats_to_decide(differences, tests=tests) == expected_repeats(within, 5, tests=tests)


def test_repeats_are_enough_for_a_permutation_test_at_least():
    assert repeats_to_decide(np.zeros((3, 4))) == 3  # 7 units
    assert repeats_to_decide(np.zeros((8, 4))) == 1
    assert repeats_to_decide(np.zeros((3, 4)), tests=100) == 5  # log2(2 * 100 / 0.02) is 13.3 units


def test_of_a_single_repeat_the_spread_of_cases_stands_for_that_of_repeats():
    differences = np.array([[0.3], [-0.3], [0.3], [-0.3]])

    assert repeats_to_decide(differences) == expected_repeats(np.var(differences, ddof=1), 4)


def test_cases_that_differ_without_chance_cannot_be_averaged_by_repeats():
    differences = np.repeat([[1.0], [-1.0], [1.0], [-1.0]], 3, axis=1)

    assert repeats_to_decide(differences) is None
    assert repeats_to_decide(0.01 * differences) == 2  # small enough to decide, with 7 units


def test_one_case_has_no_spread_between_cases():
    assert repeats_to_decide(np.array([[0.1, -0.1, 0.1]])) == max(
        7, expected_repeats(np.var([0.1, -0.1, 0.1], ddof=1), 1)
    )


def test_repeats_beyond_reason_are_none():
    half = np.log(1.1) / 4 * np.sqrt(1e4)
    differences = np.tile([half, -half], (2, 1))

    assert repeats_to_decide(10 * differences) is None


def test_the_variance_that_repeats_explain_is_taken_from_that_between_cases():
    rng = np.random.default_rng(20)
    within_std, between_std, cases, trials = 0.05, 0.04, 60, 4
    found = []
    for _ in range(20):
        differences = rng.normal(0, within_std, (cases, trials)) + rng.normal(0, between_std, (cases, 1))
        found.append(repeats_to_decide(differences))
    z = norm.ppf(0.95) + norm.ppf(1 - 0.01)
    left = (np.log(1.1) / z) ** 2 - between_std**2 / cases
    assert np.median(found) == max(1, np.ceil(within_std**2 / cases / left))


def test_a_missing_trial_is_left_out_of_the_required_repeats():
    half = 0.4
    differences = np.tile([half, -half, half, -half, np.nan], (5, 1))

    assert repeats_to_decide(differences) == expected_repeats(4 * half**2 / 3, 5)


def test_a_place_counts_failures_before_losses_and_equal_ones_share_it():
    loss = np.array([[[0.9], [0.2]], [[0.1], [0.2]], [[0.2], [0.1]]])
    failed = np.array([[[0.0], [0.0]], [[1.0], [0.0]], [[0.0], [0.0]]])

    np.testing.assert_allclose(mean_places(loss, failed), [(2 + 2.5) / 2, (3 + 2.5) / 2, (1 + 1) / 2])


def test_a_place_is_by_the_median_loss_and_a_case_without_losses_is_shared():
    loss = np.array([[[0.1, 0.1, 0.9]], [[0.2, 0.2, 0.2]]])
    none = np.full((2, 1, 3), np.nan)

    np.testing.assert_array_equal(mean_places(loss, np.zeros_like(loss)), [1, 2])
    np.testing.assert_array_equal(mean_places(none, np.zeros_like(loss)), [1.5, 1.5])


def test_ties_on_one_case_are_half_wins():
    a = np.array([1.0, 2.0, 3.0, 4.0])

    assert difference_p(a, a) == 1.0
    assert difference_p(a, a + 2) == pytest.approx(mannwhitneyu([1, 2, 3.1, 3.9], [3, 4, 5, 6], method="exact").pvalue)


def test_an_order_is_all_that_counts_on_one_case():
    a = np.array([1.0, 2.0, 3.0, 9.0])
    b = np.array([4.0, 5.0, 6.0, 7.0, 8.0])

    assert difference_p(a, b) == difference_p(np.exp(a), np.exp(b)) == difference_p(-a, -b)


def test_the_interval_of_a_ratio_is_that_of_a_paired_bootstrap_over_cases():
    loss = losses_of(np.random.default_rng(21), [1, 1.5], cases=9, repeats=2)
    counts = np.random.default_rng(1).multinomial(9, np.full(9, 1 / 9), size=1000)
    case_log_ratios = (np.log(loss[1]) - np.log(loss[0])).mean(1)
    expected = np.exp(np.quantile(counts @ case_log_ratios / 9, [0.025, 0.975]))

    assert ranked(loss)[1].ratio_interval == pytest.approx(tuple(expected))
    assert ranked(loss) == rank(loss, np.zeros_like(loss), seed=1)
    assert ranked(loss) != rank(loss, np.zeros_like(loss), seed=2)


def test_the_chance_of_neighbours_is_that_of_their_paired_differences_corrected_by_holm():
    loss = losses_of(np.random.default_rng(22), [1, 1.2, 1.5], cases=6, repeats=2)
    standings = ranked(loss)
    order = [standing.index for standing in standings]
    rng = np.random.default_rng(1)
    p_values = []
    for a, b in pairwise(order):
        differences = (np.log(loss[b]) - np.log(loss[a])).ravel() / 12
        p_values.append(permutation_p(differences, rng))

    assert [standing.p_above for standing in standings[1:]] == pytest.approx(holm(p_values))


def test_required_repeats_are_those_of_the_log_losses_of_both():
    loss = losses_of(np.random.default_rng(23), [1, 1.05, 1.1], cases=6, repeats=4)
    standings = ranked(loss)
    for above, standing in pairwise(standings):
        differences = np.log(loss[standing.index]) - np.log(loss[above.index])
        assert standing.repeats == repeats_to_decide(differences, tests=2)


def test_one_more_failure_outweighs_every_difference_of_losses_in_the_draws():
    loss = np.stack([np.full((30, 1), 1.0), np.full((30, 1), 1e-9)])
    failed = np.zeros_like(loss)
    failed[1, :12] = 1.0
    first, second = rank(loss, failed)

    assert (first.index, second.index, second.decided_above) == (0, 1, True)
    assert [first.places, second.places] == [(1, 1), (2, 2)]
    assert second.loss_ratio == pytest.approx(1e-9)
