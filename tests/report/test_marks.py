"""The best of a case, and those that are not decided against it."""

import pytest

from vobench.report.frame_statistics import EstimatorStatistics
from vobench.report.leaderboard import make_board
from vobench.report.marks import marks
from vobench.runner.folder import TRUTH_COPY


def test_the_best_of_a_case_is_marked_and_whoever_is_not_decided_against_it(scored):
    def trials(name, errors):
        return [scored(name, repeat=n, ate_m=ate) for n, ate in enumerate(errors)]

    few = make_board([*trials("a", [0.01]), *trials("b", [0.02])], {})
    assert marks(few, "ate") == {("down", "a"): "*"}
    near = trials("b", [0.0105, 0.0125, 0.0135, 0.0145])
    many = make_board([*trials("a", [0.01, 0.011, 0.012, 0.013]), *near, *trials("c", [0.2, 0.3, 0.4, 0.5])], {})
    assert marks(many, "ate") == {("down", "a"): "*~", ("down", "b"): "~", ("down", "c"): "~"}
    assert marks(
        make_board([s for s in near if s.estimator == "b"] + trials("c", [0.2, 0.3, 0.4, 0.5]), {}), "ate"
    ) == {("down", "b"): "*"}


def repeated(scored, name, errors, **changes):
    return [scored(name, repeat=n, ate_m=ate, **changes) for n, ate in enumerate(errors)]


def test_of_a_score_the_highest_is_the_best(scored):
    made = make_board([scored("a", ate_m=0.01), scored("b", ate_m=0.02)], {})
    assert marks(made, "score") == {("down", "a"): "*"}
    made = make_board([scored("a", coverage=0.5), scored("b", coverage=0.9)], {})
    assert marks(made, "coverage") == {("down", "b"): "*"}


def test_two_with_the_same_median_are_both_the_best(scored):
    errors = [0.01, 0.02, 0.03, 0.04]
    made = make_board([*repeated(scored, "a", errors), *repeated(scored, "b", errors)], {})
    assert marks(made, "ate") == {("down", "a"): "*~", ("down", "b"): "*"}


@pytest.mark.parametrize(("trials", "is_marked"), [(3, False), (4, True)])
def test_a_tie_is_marked_from_four_trials_on(scored, trials, is_marked):
    errors = [0.010, 0.012, 0.014, 0.016][:trials]
    made = make_board([*repeated(scored, "a", errors), *repeated(scored, "b", [e + 1e-3 for e in errors])], {})
    assert (("down", "b") in marks(made, "ate")) == is_marked


def test_a_failed_trial_is_the_worst_of_all(scored):
    made = make_board([scored("a", ate_m=0.02), scored("b", "lost", ate_m=1e-6), scored("c", ate_m=0.03)], {})
    assert marks(made, "ate") == {("down", "a"): "*"}


def test_a_copy_of_the_truth_is_not_the_best_of_a_case(scored):
    copy = scored("copy", ate_m=1e-12, claims=(TRUTH_COPY,))
    made = make_board([scored("a", ate_m=0.02), copy, scored("b", ate_m=0.03)], {})
    assert marks(made, "ate") == {("down", "a"): "*"}


def test_the_only_survivor_of_several_is_the_best_of_a_case(scored):
    assert marks(make_board([scored("a"), scored("b", "lost")], {}), "ate") == {("down", "a"): "*"}
    survivor = repeated(scored, "a", [0.01, 0.02, 0.03, 0.04])
    lost = repeated(scored, "b", [0.1, 0.2, 0.3, 0.4], status="lost")
    assert marks(make_board([*survivor, *lost], {}), "ate") == {("down", "a"): "*"}


def test_where_all_fail_none_is_the_best(scored):
    assert marks(make_board([scored("a", "crashed"), scored("b", "lost")], {}), "ate") == {}


def test_an_estimator_without_its_sensors_does_not_make_another_the_best(scored):
    board = make_board([scored("a"), scored("b", "not_applicable", ate_m=None)], {})
    assert marks(board, "ate") == {}


def test_one_estimator_alone_and_costs_have_no_mark(scored):
    assert marks(make_board([scored("a")], {}), "ate") == {}
    answered = {("down", name): EstimatorStatistics(cost) for name, cost in (("a", 1.0), ("b", 2.0))}
    assert marks(make_board([scored("a"), scored("b")], answered), "cpu_ms") == {}


def test_a_stationary_case_has_no_best(scored):
    assert marks(make_board([scored("a", drift_m=0.1), scored("b", drift_m=0.2)], {}), "coverage") == {}
