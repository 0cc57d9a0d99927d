"""Totals: which cases they cover, and what they add up."""

import pytest

from vobench.report.board_markdown import markdown
from vobench.report.cell import CaseFacts
from vobench.report.frame_statistics import EstimatorStatistics
from vobench.report.leaderboard import make_board
from vobench.runner.folder import TRUTH_COPY


def test_who_lacks_a_sensor_in_some_cases_is_ranked_on_the_others_and_in_all_of_them_behind(scored):
    trials = [scored("blind", ate_m=0.9), scored("blind", case="flat", ate_m=0.9), scored("wheels", ate_m=0.01)]
    unfit = scored("wheels", "not_applicable", case="flat", ate_m=None, coverage=0.0)
    made = make_board([*trials, unfit], {})
    assert [(total.estimator, total.failed, total.cases) for total in made.totals] == [
        ("wheels", 0, 1),
        ("blind", 0, 1),
    ]
    assert "Totals cover the 1 of 2 cases that all estimators share (wheels has 1)" in made.remarks[0]
    everywhere = [scored("wheels", "not_applicable", case=case, ate_m=None, coverage=0.0) for case in ("down", "flat")]
    last = make_board([*trials[:2], *everywhere], {}).totals[-1]
    assert (last.estimator, last.failed) == ("wheels", 2)


def test_totals_are_over_the_cases_that_all_have_and_say_so(scored):
    made = make_board([scored("a"), scored("a", case="ahead"), scored("b")], {})
    assert {total.cases for total in made.totals} == {1}
    assert "Totals cover the 1 of 2 cases that all estimators share (b has 1)" in made.remarks[0]


def test_estimators_that_share_no_case_are_not_ranked(scored):
    made = make_board([scored("a"), scored("b", case="ahead")], {})
    assert made.totals == ()
    assert "No estimator is ranked" in made.remarks[0]
    assert "| ahead |" in markdown(made)


def test_calibrations_have_totals_of_their_own(scored):
    facts = {"down": CaseFacts(group=""), "ahead": CaseFacts(group="worn")}
    made = make_board([scored(n, case=case) for n in "ab" for case in facts], {}, facts)
    labels = [("calibration none", 1)] * 2 + [("calibration worn", 1)] * 2
    assert [(total.group, total.cases) for total in made.totals] == labels


def test_estimators_with_other_sensors_or_without_scale_have_totals_of_their_own(scored):
    sensors = {"a": ("stereo",), "b": ("stereo", "imu"), "c": ("stereo",)}
    trials = [scored(name, sensors=needed) for name, needed in sensors.items()]
    made = make_board([*trials, scored("d", sensors=("stereo",), claims=("Sim(3)",))], {})
    assert {total.estimator: (total.group, total.rank) for total in made.totals} == {
        "a": ("stereo, SE(3)", 1),
        "c": ("stereo, SE(3)", 1),
        "d": ("stereo, Sim(3)", 1),
        "b": ("stereo + imu, SE(3)", 1),
    }


def test_baselines_and_oracles_stand_beside_the_ranking(scored):
    trials = [scored("good", ate_m=0.01), scored("bad", ate_m=0.05)]
    beside = [scored("still", ate_m=0.02, claims=("baseline",)), scored("cheat", ate_m=0.001, claims=("oracle",))]
    made = make_board([*trials, *beside], {})
    assert [(total.estimator, total.rank) for total in made.totals] == [
        ("good", 1),
        ("bad", 2),
        ("cheat", None),
        ("still", None),
    ]
    ratios = {total.estimator: total.error_ratio for total in made.totals}
    assert ratios == pytest.approx({"good": 1, "bad": 5, "still": 2, "cheat": 0.1})
    alone = make_board(beside, {}).totals
    assert [(total.estimator, total.rank) for total in alone] == [("cheat", None), ("still", None)]


def test_who_equals_the_truth_on_one_case_stands_beside_the_ranking_on_all(scored):
    trials = [scored(name, case=case, ate_m=0.01) for name in ("good", "fair") for case in ("down", "ahead")]
    copy = [scored("copy", ate_m=1e-12, claims=(TRUTH_COPY,)), scored("copy", case="ahead", ate_m=0.02)]
    made = make_board([*trials, *copy], {})
    honest = make_board(trials, {})
    assert made.totals[:2] == honest.totals
    assert (made.totals[2].estimator, made.totals[2].rank, made.totals[2].claims) == ("copy", None, (TRUTH_COPY,))
    assert [remark for remark in made.remarks if "copy" in remark] == [
        "copy is not ranked: on down, its motion equals the ground truth to rounding (1 µm and 1 µrad a frame), "
        "which cannot be measured"
    ]
    assert not [remark for remark in honest.remarks if "not ranked" in remark]


def test_a_baseline_that_lacks_a_case_takes_none_from_the_ranking(scored):
    trials = [scored("a"), scored("a", case="ahead"), scored("still", claims=("baseline",))]
    made = make_board(trials, {})
    assert [(total.estimator, total.cases) for total in made.totals] == [("a", 2)]
    assert made.remarks == ()


def test_an_estimator_that_works_and_fails_once_is_ahead_of_one_that_never_moves(scored):
    works = [scored("works", case=case, ate_m=0.002) for case in ("down", "ahead")]
    fails = scored("works", "lost", case="far", ate_m=0.002, coverage=0.6)
    still = [scored("still", case=case, ate_m=0.09) for case in ("down", "ahead", "far")]
    made = make_board([*works, fails, *still], {})
    assert [(total.estimator, total.failed) for total in made.totals] == [("works", 1), ("still", 0)]


def test_whoever_is_cheaper_than_all_before_is_efficient(scored):
    costs = {"a": 10.0, "b": 20.0, "c": 5.0}
    answered = {("down", name): EstimatorStatistics(cost) for name, cost in costs.items()}
    made = make_board([scored(n, ate_m=ate) for n, ate in (("a", 0.001), ("b", 0.002), ("c", 0.003))], answered)
    assert [(total.estimator, total.is_efficient) for total in made.totals] == [("a", True), ("b", False), ("c", True)]


def test_an_error_is_never_averaged_over_paths_of_other_lengths(scored):
    """The one that is a tenth of its path off on 1 m and exact on 1 km is no better than the other way round."""
    ways = [("short", 1.0, "down", 0.09), ("short", 1000.0, "ahead", 1.0), ("long", 1.0, "down", 0.001)]
    ways.append(("long", 1000.0, "ahead", 90.0))
    made = make_board([scored(name, case=case, path_m=path, ate_m=ate) for name, path, case, ate in ways], {})
    assert [total.rank for total in made.totals] == [1, 1]
    assert [total.ate_percent for total in made.totals] == pytest.approx([4.55, 4.55])


def test_a_total_adds_up_its_cells(scored):
    costs = {("down", "a"): EstimatorStatistics(2.0, memory_mib=30.0)}
    costs["ahead", "a"] = EstimatorStatistics(4.0, memory_mib=10.0)
    costs["far", "a"] = EstimatorStatistics(9.0, memory_mib=20.0)
    trials = [scored("a", case=case, ate_m=ate) for case, ate in (("down", 0.01), ("ahead", 0.02), ("far", 0.06))]
    (total,) = make_board([*trials, scored("a", "lost", case="far", repeat=1)], costs).totals
    assert (total.trials, total.failed, total.cases) == (4, 1, 3)
    assert total.ate_percent == pytest.approx(2.0)
    assert (total.cpu_ms, total.memory_mib) == (5.0, 30.0)
    assert (total.rank, total.ranks, total.drives, total.places) == (1, None, 3, 3)


def test_a_score_is_one_minus_the_geometric_mean_of_the_losses(scored):
    losses = (0.1, 0.4)
    trials = [
        scored("a", case=case, score={"metrics": [], "failure": {"lost_aware": 1 - loss}})
        for case, loss in zip(("down", "ahead"), losses, strict=True)
    ]
    (total,) = make_board(trials, {}).totals
    assert total.score == pytest.approx(1 - (losses[0] * losses[1]) ** 0.5)
    assert total.error_ratio is None


@pytest.mark.parametrize(
    ("places", "drives", "seen"),
    [(6, 1, "6 drives in 6 places"), (3, 4, "12 drives in 3 places"), (1, 1, "1 drive in 1 place"), (7, 1, None)],
)
def test_that_nothing_is_tested_is_a_remark(scored, places, drives, seen):
    facts = {}
    for place in range(places):
        for drive in range(drives):
            facts[f"c{place}{drive}"] = CaseFacts(place=f"place {place}", drive=f"drive {drive}")
    trials = [scored(name, case=case, repeat=repeat) for name in "ab" for case in facts for repeat in range(3)]
    remark = f"Nothing is tested: {seen}, and a test requires 7 drives in 4 places; ranks hold for these cases only"
    made = make_board(trials, {}, facts)
    assert made.remarks == ((remark,) if seen else ())
    assert (made.totals[0].drives, made.totals[0].places) == (places * drives, places)
    alone = [trial for trial in trials if trial.estimator == "a"]
    assert make_board(alone, {}, facts).remarks == ()


def test_cases_of_an_unknown_place_are_places_of_their_own(scored):
    trials = [scored("a", case=f"c{k}", ate_m=0.01) for k in range(3)]
    assert make_board(trials, {}).totals[0].places == 3


def test_the_estimator_with_the_fewest_cases_is_named_the_first_of_several(scored):
    trials = [scored("c", case=case) for case in ("down", "ahead", "far")]
    trials += [scored("b", case=case) for case in ("down", "ahead")]
    trials += [scored("a", case=case) for case in ("down", "far")]
    assert make_board(trials, {}).remarks[0] == "Totals cover the 1 of 3 cases that all estimators share (a has 2)"


def test_without_a_cost_nobody_is_efficient_and_an_equal_cost_is_not_less(scored):
    scores = [scored("a", ate_m=0.001), scored("b", ate_m=0.002)]
    assert [total.is_efficient for total in make_board(scores, {}).totals] == [False, False]
    equal = {("down", name): EstimatorStatistics(3.0) for name in "ab"}
    assert [total.is_efficient for total in make_board(scores, equal).totals] == [True, False]
    one = {("down", "b"): EstimatorStatistics(3.0)}
    assert [total.is_efficient for total in make_board(scores, one).totals] == [False, True]


def test_of_two_with_the_same_score_the_cheaper_one_is_efficient(scored):
    costs = {("down", "a"): EstimatorStatistics(3.0), ("down", "b"): EstimatorStatistics(2.0)}
    made = make_board([scored("a"), scored("b")], costs)
    assert {total.estimator: total.is_efficient for total in made.totals} == {"a": False, "b": True}


def test_the_error_of_a_total_is_that_of_the_median_repeat(scored):
    repeats = [scored("a", repeat=repeat, ate_m=ate_m) for repeat, ate_m in enumerate((0.01, 0.02, 0.09))]
    (total,) = make_board(repeats, {}).totals
    assert total.ate_percent == pytest.approx(2.0)
