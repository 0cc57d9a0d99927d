"""Paths, outcomes, courses and conditions of trials in a run's folder."""

from types import SimpleNamespace

import numpy as np

from tests.analysis.conftest import NoisyRun
from vobench.analysis import trial_data
from vobench.analysis.conditions import CONDITIONS
from vobench.analysis.trial_data import (
    read_conditions,
    read_error_series,
    read_outcome,
    read_paths,
    read_symptoms,
)
from vobench.runner.finished_trial import read_simulated_case


def test_a_trial_that_lost_every_frame_has_no_poses_and_the_largest_error(noisy_run: NoisyRun) -> None:
    score = noisy_run.score("blind")
    paths = read_paths(noisy_run.folder, score)
    assert (len(paths.est), paths.scale) == (0, 1.0)
    outcome = read_outcome(noisy_run.folder, score)
    assert (outcome.status, outcome.survived) == ("lost", False)
    assert (outcome.loss == 1).all()


def test_good_wheels_survive_with_small_errors(noisy_run: NoisyRun) -> None:
    outcome = read_outcome(noisy_run.folder, noisy_run.score("wheel_odometry"))
    assert outcome.survived
    assert outcome.loss.mean() < 0.2


def test_a_course_has_one_error_per_frame_and_none_at_the_first(noisy_run: NoisyRun) -> None:
    case = read_simulated_case(noisy_run.folder, "short")
    of_frames = read_conditions(noisy_run.folder, case)
    score = noisy_run.score("wheel_odometry")
    course = read_error_series(noisy_run.folder, score, of_frames)
    assert len(course.loss) == score.frames
    assert course.loss[0] == 0
    assert course.conditions is of_frames
    assert (course.place, course.drive) == ("closet", "short")


def test_every_condition_is_known_of_every_frame_and_noise_is_seen(noisy_run: NoisyRun) -> None:
    case = read_simulated_case(noisy_run.folder, "short")
    of_frames = read_conditions(noisy_run.folder, case)
    assert set(of_frames) == set(CONDITIONS)
    assert {len(values) for values in of_frames.values()} == {noisy_run.score("blind").frames}
    assert (of_frames["noise"] > 0.3).all()
    assert np.any(of_frames["missing_frames"] > 0)


def test_tracks_are_a_symptom_only_where_an_estimator_reports_them(noisy_run: NoisyRun, monkeypatch) -> None:
    score = noisy_run.score("wheel_odometry")
    assert read_symptoms(noisy_run.folder, score) == {}
    rows = [SimpleNamespace(tracks=count) for count in (9, None, 99)]
    monkeypatch.setattr(trial_data, "read_frames", lambda _: rows)
    assert read_symptoms(noisy_run.folder, score)["few_tracks"].tolist() == [0.1, 1.0, 0.01]
