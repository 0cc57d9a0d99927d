"""A trial that fails for noise is run again, and noise is named."""

import pytest

from tests.analysis.conftest import NoisyRun
from vobench.analysis.explain import Change, Explanation
from vobench.analysis.explain_trial import TrialExplanation, explain_trial
from vobench.errors import InputError, UnknownNameError

slow = pytest.mark.slow  # run by `pytest -m slow`, and by CI


@slow
@pytest.mark.usefixtures("cheap_pictures")
def test_noise_is_named_and_mends_the_trial(noisy_run: NoisyRun) -> None:
    found = explain_trial(
        noisy_run.trial("blind"), run_plan=noisy_run.run_plan, repeats=1, estimator=noisy_run.estimator
    )
    assert (found.case, found.estimator, found.named) == ("short", "blind", ("noise",))
    first = found.rows()[0]
    assert (first["removed"], first["verdict"]) == (("noise",), "mends it")
    assert first["survived"] == first["repeats"] >= 4  # of so few frames one repeat is too little
    assert found.as_dict()["named"] == ("noise",)

    frame = found.to_frame()
    assert frame["removed"].iloc[0] == "noise"
    assert frame["removed"].iloc[-1] == " and ".join(found.explanation.everything.removed)
    assert "no difference" in set(frame["verdict"])


@slow
@pytest.mark.usefixtures("cheap_pictures")
def test_every_variant_is_run_by_the_plan_runner_with_the_estimator_of_the_trial_alone(noisy_run: NoisyRun) -> None:
    plans = []

    def run_plan(plan, /):
        plans.append(plan)
        return noisy_run.run_plan(plan)

    explain_trial(noisy_run.trial("blind"), run_plan=run_plan, repeats=1, estimator=noisy_run.estimator)
    assert {plan.suite.name for plan in plans} == {"explain_short_blind"}
    assert {estimator_entry.label for plan in plans for estimator_entry in plan.estimator_entries} == {"blind"}


def never(plan, /):
    raise AssertionError("nothing should be run")


@slow
def test_an_estimator_that_is_not_found_and_a_trial_that_is_not_there_are_refused(noisy_run: NoisyRun) -> None:
    with pytest.raises(UnknownNameError, match="no estimator named 'blind'"):
        explain_trial(noisy_run.trial("blind"), run_plan=never)
    with pytest.raises(UnknownNameError, match="no estimator named 'wheels'"):
        explain_trial(noisy_run.trial("wheels"), run_plan=never)


@slow
def test_a_sequence_that_is_gone_from_the_cache_is_a_sentence(noisy_run: NoisyRun, tmp_path) -> None:
    import shutil

    copied = tmp_path / "run"
    shutil.copytree(noisy_run.folder.path, copied, symlinks=True)
    (copied / "cases" / "short" / "sequence").unlink()
    with pytest.raises(InputError, match="gone from the cache"):
        explain_trial(copied / "short" / "wheel_odometry", run_plan=never)


# --- Rows and verdicts, without a run ---


def change(*removed: str, mended: float, low: float, high: float = 1.0) -> Change:
    return Change(removed, 0.1, mended, low, high, 2, 3)


EVERYTHING = change("blur", "noise", "gloss", mended=0.9, low=0.8)
SINGLES = (
    change("blur", mended=0.8, low=0.7),
    change("noise", mended=0.2, low=0.1),
    change("gloss", mended=-0.2, low=-0.3, high=-0.1),
)
PAIR = change("blur", "noise", mended=0.3, low=-0.1)


def explained(everything: Change = EVERYTHING, singles: tuple[Change, ...] = SINGLES) -> TrialExplanation:
    return TrialExplanation("walk", "mine", Explanation(0.5, "lost", True, everything, singles, {}, (PAIR,)))


def test_each_variant_has_its_verdict_and_everything_comes_last() -> None:
    rows = explained().rows()
    assert [row["verdict"] for row in rows] == ["mends it", "helps", "harms", "no difference", "mends it"]
    assert [row["removed"] for row in rows][3:] == [PAIR.removed, EVERYTHING.removed]
    assert rows[0]["instead"] == "a short exposure and a sharp lens"
    assert rows[3]["instead"] == ""
    assert (rows[0]["mended"], rows[0]["survived"], rows[0]["repeats"]) == (0.8, 2, 3)


def test_a_single_nuisance_is_listed_once() -> None:
    single = change("blur", mended=0.8, low=0.7)
    assert [row["removed"] for row in explained(single, (single,)).rows()] == [("blur",), PAIR.removed]
