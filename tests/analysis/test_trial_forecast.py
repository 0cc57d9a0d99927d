"""What is said about the number of trials and their time."""

from types import SimpleNamespace

import pytest

from vobench.analysis import trial_forecast
from vobench.analysis.explain import effort
from vobench.analysis.trial_forecast import TrialForecast

SEEDS = effort(3, is_deterministic=True)


def forecast(said: list[str], *, seconds_per_trial: float | None) -> TrialForecast:
    return TrialForecast(SimpleNamespace(say=said.append), SEEDS, 10, seconds_per_trial, removed="nuisances")


def test_the_time_of_a_stage_follows_from_the_trials_before(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    clock = iter([0.0, 60.0, 60.0, 80.0])
    monkeypatch.setattr(trial_forecast, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    trials = forecast(said, seconds_per_trial=1.5)
    with trials.stage(30):
        pass
    with trials.stage(12):
        pass
    most = SEEDS.most_trials(10)
    assert said[0] == f"trials 1 to 30 of at most {most}, about 45 s: each of 10 nuisances removed, with 3 seeds"
    assert said[1] == f"trials 31 to 42 of at most {most}, about 24 s"


def test_an_unknown_time_is_not_stated() -> None:
    said: list[str] = []
    with forecast(said, seconds_per_trial=None).stage(30):
        pass
    assert said == [f"trials 1 to 30 of at most {SEEDS.most_trials(10)}: each of 10 nuisances removed, with 3 seeds"]
