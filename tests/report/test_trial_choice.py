"""Which trials of a run are most worth a look."""

import pytest

from vobench.errors import InputError, UnknownNameError
from vobench.report.cell import CaseFacts
from vobench.report.trial_choice import pick, ranked, sentence, story


def names(trials):
    return [(trial.estimator, trial.case) for trial in trials]


@pytest.fixture
def trials(scored):
    return [
        scored("good", ate_m=0.1),
        scored("good", case="ahead", ate_m=0.2),
        scored("poor", ate_m=0.15),
        scored("poor", case="ahead", ate_m=0.9),
    ]


def test_without_failures_it_is_the_worst_case_of_the_best_estimator(trials):
    assert names([pick(trials, case=None, estimator=None)]) == [("good", "ahead")]
    assert names([pick(trials, case=None, estimator="poor")]) == [("poor", "ahead")]
    assert names([pick(trials, case="down", estimator=None)]) == [("good", "down")]


def test_the_gravest_failure_comes_first(scored, trials):
    failures = [scored("good", "lost", case="far"), scored("good", "crashed", ate_m=None, case="dark")]
    assert names([pick([*trials, *failures], case=None, estimator=None)]) == [("good", "dark")]
    order = names(ranked([*trials, *failures], case=None, estimator=None))
    assert order[:2] == [("good", "dark"), ("good", "far")]


def test_of_equal_failures_the_one_with_the_lowest_score_comes_first(scored, trials):
    longer = scored("good", "lost", case="a_late_loss", ate_m=0.01)
    shorter = scored("good", "lost", case="early_loss", ate_m=0.05)
    everything = [*trials, longer, shorter]
    assert names([pick(everything, case=None, estimator=None)]) == [("good", "early_loss")]
    assert names(ranked(everything, case=None, estimator=None))[:2] == [("good", "early_loss"), ("good", "a_late_loss")]


def test_an_estimator_that_sees_is_preferred_to_one_that_does_not_and_both_to_a_baseline(scored):
    baseline = scored("still", "lost", claims=("baseline",))
    wheels = scored("wheels", "diverged", sensors=("encoders",))
    seeing = scored("seeing", sensors=("stereo",))
    assert names([pick([baseline, wheels, seeing], case=None, estimator=None)]) == [("seeing", "down")]
    assert names([pick([baseline, wheels], case=None, estimator=None)]) == [("wheels", "down")]
    assert names([pick([baseline], case=None, estimator=None)]) == [("still", "down")]
    assert names([pick([baseline, seeing], case=None, estimator="still")]) == [("still", "down")]


def test_how_a_trial_went_is_a_sentence(scored):
    assert sentence(scored("a", ate_m=0.0123)) == "a on down is off by 1.23 % of the path"
    assert sentence(scored("a", "lost")) == "a on down: lost: it went dark"
    assert sentence(scored("a", "lost", reason="")) == "a on down: lost"
    assert sentence(scored("a", ate_m=None)) == "a on down: ok"


def test_trials_are_ranked_by_error_where_none_failed(trials):
    assert names(ranked(trials, case=None, estimator=None)) == [
        ("poor", "ahead"),
        ("good", "ahead"),
        ("poor", "down"),
        ("good", "down"),
    ]
    assert names(ranked(trials, case="down", estimator=None)) == [("poor", "down"), ("good", "down")]
    assert names(ranked(trials, case="down", estimator="good")) == [("good", "down")]


def test_a_trial_without_an_error_is_the_worst(scored, trials):
    unknown = scored("good", case="far", ate_m=None)
    assert names(ranked([*trials, unknown], case=None, estimator=None))[0] == ("good", "far")
    assert names([pick([*trials, unknown], case=None, estimator=None)]) == [("poor", "ahead")]


def test_names_that_are_not_in_the_run_are_answered_with_those_that_are(trials):
    with pytest.raises(UnknownNameError, match=r"no case 'up' in this run\. Known: ahead, down"):
        pick(trials, case="up", estimator=None)
    with pytest.raises(UnknownNameError, match=r"no estimator 'best' in this run\. Known: good, poor"):
        ranked(trials, case=None, estimator="best")


def test_a_case_without_a_sequence_is_left_out_and_said_where_it_is_asked_for(scored, trials):
    unmade = scored("good", "no_sequence", case="dark", ate_m=None, reason="no light")
    assert ("good", "dark") not in names(ranked([*trials, unmade], case=None, estimator=None))
    message = "'dark' has no sequence to show because it could not be simulated or imported: no light"
    with pytest.raises(InputError, match=message):
        pick([*trials, unmade], case="dark", estimator=None)


@pytest.mark.parametrize(
    ("status", "words"),
    [("lost", "loses track"), ("diverged", "diverges"), ("crashed", "crashes"), ("refused", "fails (refused)")],
)
def test_the_story_of_a_failure_names_the_scenario_the_severity_and_the_place(scored, status, words):
    facts = CaseFacts(scenario="low_light", severity=3, place="room")
    assert story(scored("poor", status), facts) == f"poor {words} at severity 3 of low_light, in room"


def test_the_story_of_any_other_trial_is_its_sentence(scored):
    survivor = scored("good")
    assert story(survivor, CaseFacts(scenario="low_light", severity=3)) == sentence(survivor)
    failed = scored("poor", "lost")
    assert story(failed, CaseFacts()) == sentence(failed)


def test_a_trial_whose_recording_lacks_a_sensor_is_not_the_one_to_look_at(scored):
    refused = scored("fused", "not_applicable")
    worst = scored("seeing", ate_m=0.05)
    assert pick([refused, worst], case=None, estimator=None) == worst
    assert pick([refused], case=None, estimator=None) == refused
