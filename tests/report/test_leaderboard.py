"""The law of ranking: no estimator whose every trial failed ranks before one whose every trial survived."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.report.boards import CASES, outcomes_of_four, scores_of
from tests.work import Name, work_of
from vobench.report.leaderboard import make_board
from vobench.runner.folder import SURVIVED


def failed(results):
    return sum(status not in SURVIVED for status, _ in results)


@settings(max_examples=25)
@given(outcomes_of_four)
def test_none_whose_every_trial_failed_ranks_before_one_whose_every_trial_survived(outcomes):
    made = make_board(scores_of(outcomes), {})
    for one in made.totals:
        for other in made.totals:
            if not one.failed and other.failed == other.trials:
                assert one.rank <= other.rank
                assert one.score >= other.score


@settings(max_examples=25)
@given(outcomes_of_four)
def test_everyone_who_ran_is_in_the_totals_once_and_in_every_case(outcomes):
    made = make_board(scores_of(outcomes), {})
    assert {total.estimator: total.failed for total in made.totals} == {n: failed(r) for n, r in outcomes.items()}
    assert sorted((cell.case, cell.estimator) for cell in made.cells) == sorted((c, n) for c in CASES for n in outcomes)


@settings(max_examples=25)
@given(outcomes_of_four, st.randoms(use_true_random=False))
def test_the_order_of_scores_does_not_matter(outcomes, random):
    shuffled = scores_of(outcomes)
    random.shuffle(shuffled)
    assert make_board(shuffled, {}) == make_board(scores_of(outcomes), {})


@given(st.floats(0, 0.1), st.floats(0, 0.1))
def test_among_survivors_the_smaller_error_is_first(one, other):
    totals = make_board(scores_of({"p": [("ok", one)] * 2, "q": [("ok", other)] * 2}), {}).totals
    if abs(one - other) > 1e-6:
        assert totals[0].estimator == ("p" if one < other else "q")


def test_cases_without_a_sequence_are_one_sentence_and_change_nothing_else(incomplete):
    made = make_board(incomplete, {})
    complete = make_board([score for score in incomplete if score.case == "down"], {})
    assert (made.cells, made.totals) == (complete.cells, complete.totals)
    assert made.remarks == (
        "3 of 4 cases could not be simulated or imported and count for no estimator: dark, dim: no light; far: too far",
        *complete.remarks,
    )


def test_one_that_never_survived_has_no_error_and_a_reason(mixed):
    made = make_board(mixed, {})
    dead = made.totals[-1]
    assert (dead.estimator, dead.failed, dead.trials, dead.ate_percent) == ("dead", 2, 2, None)
    assert made.cell("down", "dead").status == "crashed"


@settings(max_examples=25)
@given(outcomes_of_four, st.floats(0, 1e3))
def test_a_case_that_stands_still_changes_no_error_and_no_rank(outcomes, drift_m):
    """Nothing but whether it was survived counts of it."""
    moving = scores_of(outcomes)
    still = [
        s.model_copy(update={"case": "still", "drift_m": drift_m, "status": "ok"}) for s in moving if s.case == "a"
    ]
    before, after = (make_board(scores, {}).totals for scores in (moving, [*moving, *still]))
    shown = [[(t.rank, t.estimator, round(t.score, 9), t.ate_percent) for t in each] for each in (before, after)]
    assert shown[0] == shown[1]


def trials_of(cases, estimators):
    """One trial for each case and estimator."""
    one = scores_of({"e": [("ok", 0.1)] * len(CASES)})[0]
    trials = []
    for case in range(cases):
        for estimator in range(estimators):
            ate_m = 0.0001 * (1 + estimator % 97)
            changes = {
                "case": Name(f"c{case}"),
                "estimator": Name(f"e{estimator}"),
                "score": {"metrics": [{"name": "ate_trans", "rmse": ate_m}]},
            }
            trials.append(one.model_copy(update=changes))
    return trials


@pytest.mark.parametrize(("cases", "estimators", "fewer"), [(500, 4, (100, 4)), (5, 400, (5, 80))])
def test_the_work_of_a_board_is_no_square_of_its_cases_or_estimators(cases, estimators, fewer):
    """Five times as many cost five times as much work, and sorting a little more; a square would cost 25 times."""
    more = trials_of(cases, estimators)
    made = make_board(more, {})
    assert len(made.totals) == estimators
    assert len(made.cells) == cases * estimators
    assert work_of(make_board, more, {}) < 5.2 * work_of(make_board, trials_of(*fewer), {})


def listed(names):
    return [name for name in names if name in names]


def compared(names):
    return [[other for other in names if other == name] for name in names]


def hashed(names):
    return [name for name in names if name in set(names)]


def in_arrays(names):
    def lengths():
        return np.array([1] * len(names)).cumsum()

    return [lengths()[0] for _ in names]


@pytest.mark.parametrize("squared", [listed, compared, hashed, in_arrays])
def test_the_measure_of_work_sees_squares_of_every_kind(squared):
    """In comprehensions, in searches through lists, in sets that are made again and again, and in arrays."""
    names = [Name(f"n{k}") for k in range(500)]
    assert work_of(squared, names) > 15 * work_of(squared, names[:100])
