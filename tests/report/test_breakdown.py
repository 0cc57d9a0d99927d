"""Where estimators break down as a scenario grows more severe."""

from vobench.report import board_table
from vobench.report.breakdown import BREAKDOWN_SCORE, breakdown_curves
from vobench.report.cell import CaseFacts
from vobench.report.leaderboard import make_board


def test_a_scenario_says_at_which_severity_each_estimator_breaks(scored):
    facts = {f"s{k}": CaseFacts(scenario="blur", severity=k) for k in range(4)}
    strong = [scored("strong", case=case, ate_m=0.001) for case in facts]
    weak = [scored("weak", "ok" if k < 2 else "lost", case=f"s{k}", ate_m=0.001) for k in range(4)]
    made = make_board([*strong, *weak], {}, facts)
    assert {curve.estimator: curve.breaks_at for curve in made.curves} == {"strong": None, "weak": 2}
    assert "blur, severity 0 to 3: weak breaks down at 2 (scores 0.99, 0.99, 0.49, 0.49)" in board_table.remarks(made)


def curves_of(scored, scores, **facts):
    """The curves of an estimator with these lost-aware scores at severities 0, 1, …"""
    known = {f"s{k}": CaseFacts(scenario="blur", severity=k, **facts) for k in range(len(scores))}
    trials = []
    for case, score in zip(known, scores, strict=True):
        content = {"metrics": [], "failure": {"lost_aware": score}}
        trials.append(scored("a", case=case, score=content))
    return breakdown_curves(make_board(trials, {}, known).cells)


def test_a_score_at_the_limit_is_no_breakdown_and_one_just_below_it_is(scored):
    (curve,) = curves_of(scored, [0.9, BREAKDOWN_SCORE, 0.8])
    assert curve.breaks_at is None
    assert curve.scores == (0.9, BREAKDOWN_SCORE, 0.8)
    (curve,) = curves_of(scored, [0.9, 0.8, BREAKDOWN_SCORE - 1e-3, 0.6])
    assert (curve.breaks_at, curve.severities) == (2, (0, 1, 2, 3))


def test_a_score_is_the_median_over_the_trials_of_all_cases_of_a_severity(scored):
    facts = {"x": CaseFacts(scenario="blur", severity=0), "y": CaseFacts(scenario="blur", severity=0)}
    facts["z"] = CaseFacts(scenario="blur", severity=1)
    scores = {("x", 0): 0.9, ("x", 1): 0.6, ("y", 0): 0.8, ("z", 0): 0.7}
    trials = [
        scored("a", case=case, repeat=repeat, score={"metrics": [], "failure": {"lost_aware": score}})
        for (case, repeat), score in scores.items()
    ]
    (curve,) = make_board(trials, {}, facts).curves
    assert curve.scores == (0.8, 0.7)


def test_one_severity_is_no_curve_and_neither_is_a_case_without_a_scenario(scored):
    assert curves_of(scored, [0.9]) == []
    facts = {"down": CaseFacts(severity=1), "ahead": CaseFacts(scenario="blur")}
    assert make_board([scored("a"), scored("a", case="ahead")], {}, facts).curves == ()


def test_a_severity_at_which_nothing_moves_is_left_out(scored):
    facts = {f"s{k}": CaseFacts(scenario="blur", severity=k) for k in range(3)}
    trials = [scored("a", case="s0"), scored("a", case="s1", drift_m=0.1), scored("a", case="s2")]
    (curve,) = make_board(trials, {}, facts).curves
    assert curve.severities == (0, 2)


def test_the_sentence_names_the_calibration_group(scored):
    (curve,) = curves_of(scored, [0.9, 0.8], group="worn")
    assert curve.sentence == "worn, blur, severity 0 to 1: a does not break down (scores 0.90, 0.80)"
