"""What the errors of a run depend on, for each of its estimators."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.analysis.conftest import NoisyRun
from vobench.analysis import run_causes
from vobench.analysis.causes import ErrorSeries, attribute
from vobench.analysis.run_causes import EstimatorCauses, RunCauses, _symptoms, find_causes
from vobench.errors import UnknownNameError


def planted() -> RunCauses:
    """Causes of an estimator whose error grows with blur and with nothing else."""
    rng = np.random.default_rng(0)
    blur, depth = rng.uniform(0.1, 4, 200), rng.uniform(1, 2, 200)
    loss = np.append(0.0, 0.01 * np.exp(np.sqrt(blur[1:])))
    course = ErrorSeries("walk", 0, {"blur": blur, "depth": depth}, loss)
    found = EstimatorCauses("mine", ("ok",), (course,), attribute([course]))
    return RunCauses(Path("runs"), (found,))


def test_the_table_has_a_row_per_cause_with_the_strongest_first() -> None:
    frame = planted().to_frame()
    assert frame["conditions"].tolist() == ["blur", "depth"]
    assert frame["low"].iloc[0] > 1.2
    assert frame["low"].iloc[1] < 1 < frame["high"].iloc[1]


def test_the_dictionary_lists_as_many_segments_as_are_asked_for_and_the_worst_first() -> None:
    (facts,) = planted().as_dict(worst=3)["estimators"]
    losses = [segment["loss"] for segment in facts["worst"]]
    assert len(losses) == 3
    assert losses == sorted(losses, reverse=True)
    assert [trial["status"] for trial in facts["trials"]] == ["ok"]


def test_of_too_few_frames_trials_are_listed_and_no_cause_is_named(noisy_run: NoisyRun) -> None:
    found = find_causes(noisy_run.folder.path)
    assert [each.estimator for each in found.estimators] == ["blind", "wheel_odometry"]
    blind = found.estimators[0]
    assert blind.attribution is None
    assert blind.trials() == [{"case": "short", "repeat": 0, "status": "lost", "first_divergence_frame": 1}]
    assert "causes" not in blind.as_dict()
    assert "are too few to learn causes from" in blind.as_dict()["reason"]
    assert found.to_frame().empty


def test_one_estimator_may_be_chosen_and_another_name_is_refused(noisy_run: NoisyRun) -> None:
    found = find_causes(noisy_run.folder.path, estimator="wheel_odometry")
    assert [each.estimator for each in found.estimators] == ["wheel_odometry"]
    with pytest.raises(UnknownNameError, match="Did you mean 'wheel_odometry'"):
        find_causes(noisy_run.folder.path, estimator="wheel_odometer")


def test_progress_hears_of_every_case(noisy_run: NoisyRun) -> None:
    heard = []

    class Counting:
        def track(self, items, what, *, total):
            heard.append((what, total))
            return iter(items)

    find_causes(noisy_run.folder.path, progress=Counting())
    assert heard == [("look at", 1)]


def test_each_trial_is_listed_with_the_frame_at_which_it_diverges() -> None:
    (found,) = planted().estimators
    loss = found.courses[0].loss.copy()
    loss[50] = 1.0
    diverged = EstimatorCauses("mine", ("lost",), (ErrorSeries("walk", 1, found.courses[0].conditions, loss),), None)
    assert diverged.trials() == [{"case": "walk", "repeat": 1, "status": "lost", "first_divergence_frame": 50}]


def test_the_dictionary_has_the_factors_of_cases_and_eight_segments_unless_more_are_asked_for() -> None:
    (facts,) = planted().as_dict()["estimators"]
    attribution = planted().estimators[0].attribution
    assert len(facts["worst"]) == 8
    assert facts["explained"] == attribution.explained
    (factors,) = facts["cases"].values()
    assert factors == [[cause.conditions, factor] for cause, factor in attribution.cases["walk"]]


def test_nothing_is_said_of_an_oracle_or_a_baseline(monkeypatch) -> None:
    (course,) = planted().estimators[0].courses
    monkeypatch.setattr(run_causes, "read_error_series", lambda *_: course)
    monkeypatch.setattr(run_causes, "read_symptoms", lambda *_: {})
    for claims, sentence in ((("oracle",), "given the ground truth"), (("baseline",), "it is a baseline")):
        score = SimpleNamespace(case="walk", status="ok", claims=claims)
        found = run_causes._causes_of(None, "mine", [score], {"walk": {}})
        assert found.attribution is None
        assert sentence in found.reason
    score = SimpleNamespace(case="walk", status="ok", claims=("Sim(3)",))
    assert run_causes._causes_of(None, "mine", [score], {"walk": {}}).attribution is not None


def test_what_the_estimator_reports_is_a_symptom_and_takes_nothing_from_the_causes() -> None:
    (found,) = planted().estimators
    (course,) = found.courses
    few_tracks = 1 / (1 + 100 / np.sqrt(course.conditions["blur"]))
    (symptom,) = _symptoms([course], [{"few_tracks": few_tracks}])
    assert "few_tracks" in symptom.conditions
    assert symptom.factor > 1
    assert _symptoms([course], [{}]) == ()
    assert found.attribution.causes[0].conditions == ("blur",)


def test_cases_on_one_drive_are_recognised() -> None:
    (found,) = planted().estimators
    (course,) = found.courses
    same = replace(course, case="other", place="hall", drive="round")
    assert found.has_one_drive
    assert not replace(found, courses=(course, same)).has_one_drive
    assert replace(found, courses=(replace(course, drive="round"), same)).has_one_drive
