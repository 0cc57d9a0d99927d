"""A trial that fails for noise is run again, and noise is named."""

import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

from tests.analysis.conftest import NoisyRun
from vobench.analysis import explain_trial as explain_trial_module
from vobench.analysis.explain_trial import TrialExplanation, explain_trial
from vobench.analysis.explanation import Change, Explanation
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
    assert (first["removed"], first["verdict"]) == (("noise",), "fixes it")
    assert first["survived"] == first["repeats"] == 6  # those that confirm it
    first_sentence = "blind never tracks because the images are noisy. With a chip without noise, the error drops by "
    assert found.sentences[0].startswith(first_sentence)
    assert found.as_dict()["named"] == ("noise",)

    frame = found.to_frame()
    assert frame["removed"].iloc[0] == "noise"
    assert frame["removed"].iloc[-1] == " and ".join(found.explanation.everything.removed)
    assert {"does not help", "undecided"} & set(frame["verdict"])


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


def trial_score(status, reason=""):
    return SimpleNamespace(status=status, reason=reason, estimator="mine")


@pytest.mark.parametrize(
    ("explained", "ended"),
    [("ok", ["crashed", "lost"]), ("crashed", ["crashed", "crashed"]), ("diverged", ["ok", "ok"])],
)
def test_trials_that_fail_as_the_explained_one_or_in_part_are_compared(explained, ended):
    explain_trial_module._require_answers(trial_score(explained), [trial_score(status) for status in ended])


def test_an_estimator_that_no_longer_answers_is_not_explained_by_the_case():
    ended = [trial_score("crashed", "ImportError: no module named 'torch'"), trial_score("crashed")]
    with pytest.raises(
        InputError, match=r"all of 2 trials .* 'crashed' \(ImportError.*has mine or what it needs changed"
    ):
        explain_trial_module._require_answers(trial_score("ok"), ended)


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


@slow
@pytest.mark.usefixtures("cheap_pictures")
def test_the_number_of_trials_is_announced_before_each_stage(noisy_run: NoisyRun) -> None:
    said = []
    progress = SimpleNamespace(say=said.append)
    found = explain_trial(
        noisy_run.trial("blind"), run_plan=noisy_run.run_plan, estimator=noisy_run.estimator, progress=progress
    )
    announced = r"trials 1 to \d+ of at most \d+, about \d+ s: each of \d+ nuisances removed, with 3 seeds"
    assert re.match(announced, said[0])
    assert said[-1].startswith("trials ")
    assert f"to {found.explanation.trials} of at most" in said[-1]


# --- Rows and verdicts, without a run ---


def change(*removed: str, reduction: float, is_sure: bool = True, high: float = 1.0) -> Change:
    low = reduction - 0.1 if is_sure else reduction - 0.5
    return Change(
        removed,
        loss=0.1,
        reduction=reduction,
        low=low,
        high=high,
        survived=2,
        repeats=6,
        p_less=0.01 if is_sure and reduction > 0 else 0.5,
        p_more=0.01 if is_sure and reduction < 0 else 0.5,
        is_confirmed=is_sure,
    )


EVERYTHING = change("blur", "noise", "gloss", reduction=0.9)
BLUR = change("blur", reduction=0.8)
NOISE = change("noise", reduction=0.2)
GLOSS = change("gloss", reduction=-0.2)
FLARE = change("flare", reduction=0.05, is_sure=False, high=0.1)
JPEG = change("JPEG", reduction=0.1, is_sure=False, high=0.6)
PAIR = change("blur", "noise", reduction=0.3, is_sure=False)
ALL_SINGLES = (BLUR, NOISE, JPEG, FLARE, GLOSS)


def explained(
    everything: Change = EVERYTHING,
    singles: tuple[Change, ...] = ALL_SINGLES,
    pairs: tuple[Change, ...] = (PAIR,),
    status: str = "lost",
    diverges_at_s: float | None = 3.24,
) -> TrialExplanation:
    explanation = Explanation(0.5, status, True, everything, singles, {}, pairs, 40)
    return TrialExplanation("walk", "mine", explanation, diverges_at_s)


def test_each_variant_has_its_verdict_and_everything_comes_last() -> None:
    rows = explained().rows()
    verdicts = [row["verdict"] for row in rows]
    assert verdicts == ["fixes it", "helps", "undecided", "does not help", "harms", "undecided", "fixes it"]
    assert [row["removed"] for row in rows][5:] == [PAIR.removed, EVERYTHING.removed]
    assert rows[0]["instead"] == "a short exposure and a sharp lens"
    assert rows[5]["instead"] == ""
    assert (rows[0]["reduction"], rows[0]["survived"], rows[0]["repeats"]) == (0.8, 2, 6)


def test_what_seems_to_help_but_was_not_confirmed_is_neither_named_nor_a_difference() -> None:
    seeming = replace(change("flare", reduction=0.4), is_confirmed=False)
    found = explained(singles=(BLUR, seeming))
    assert [row["verdict"] for row in found.rows()][:2] == ["fixes it", "unconfirmed"]
    assert found.explanation.contributing == ()


def test_a_single_nuisance_is_listed_once() -> None:
    single = change("blur", reduction=0.8)
    assert [row["removed"] for row in explained(single, (single,)).rows()] == [("blur",), PAIR.removed]


def test_one_cause_is_said_with_its_remedy_what_else_helps_and_what_harms() -> None:
    assert explained().sentences == (
        "mine loses track at 3.2 s because the images are blurred. With a short exposure and a sharp lens, the error "
        "drops by 80% (95 % CI 70% to 100%), to 10.0%, and 2 of 6 runs end well: expose shorter and focus the lens.",
        "It also depends on noise (20% less).",
        "Diffuse surfaces would make it worse: the error grows by 20%.",
    )


def test_alternatives_and_pairs_are_said_as_such() -> None:
    either = explained(singles=(BLUR, change("noise", reduction=0.7)))
    assert either.sentences[0] == (
        "mine loses track at 3.2 s because the images are blurred while the images are noisy. Either change suffices "
        "(blur (80% less), noise (70% less)): expose shorter and focus the lens; or add light, expose longer with less "
        "gain, or smooth the images."
    )
    assert [row["verdict"] for row in either.rows()][:2] == ["fixes it", "fixes it"]
    singles = (change("blur", reduction=0.2, is_sure=False), NOISE)
    together = explained(singles=singles, pairs=(change("blur", "noise", reduction=0.85),))
    assert together.sentences == (
        "mine loses track at 3.2 s because the images are blurred and the images are noisy, each by itself. Without "
        "both, the error drops by 85% (95 % CI 75% to 100%), to 10.0%, and 2 of 6 runs end well: expose shorter and "
        "focus the lens, and add light, expose longer with less gain, or smooth the images.",
    )
    assert together.rows()[2]["verdict"] == "fixes it"


def test_the_parts_of_a_cause_are_said_with_the_advice_for_the_one_that_matters() -> None:
    brightness = change("unlike brightness", reduction=-0.04, is_sure=False)
    lenses = change("unlike lenses", reduction=0.7)
    found = explained(singles=(change("unlike eyes", reduction=0.8), FLARE))
    found = replace(found, explanation=replace(found.explanation, parts=(lenses, brightness)))
    assert found.sentences[0].endswith("2 of 6 runs end well.")
    assert found.sentences[1] == (
        "With two equally sharp and clean lenses alone it drops by 70%, and with two equally bright cameras alone it "
        "grows by 4%: focus and clean both lenses, or use the sharper camera alone."
    )
    assert [row["removed"] for row in found.rows()][:4] == [
        ("unlike eyes",),
        lenses.removed,
        brightness.removed,
        FLARE.removed,
    ]


def test_parts_that_both_help_leave_the_advice_to_the_cause() -> None:
    parts = (change("unlike lenses", reduction=0.7), change("unlike brightness", reduction=0.6))
    found = explained(singles=(change("unlike eyes", reduction=0.8),))
    found = replace(found, explanation=replace(found.explanation, parts=parts))
    assert found.sentences[0].endswith(
        "give both cameras the same exposure and focus, or match independently of brightness."
    )
    assert found.sentences[1].endswith("with two equally bright cameras alone it drops by 60%.")


def test_an_estimator_without_a_single_pose_does_not_lose_track_at_some_time() -> None:
    found = explained()
    without_pose = replace(found, explanation=replace(found.explanation, loss=1.0))
    assert without_pose.symptom == "mine never tracks"


def test_where_nothing_is_named_it_is_said_what_was_ruled_out_and_what_is_open() -> None:
    nothing = change("blur", "flare", reduction=0.02, is_sure=False, high=0.2)
    assert explained(nothing, (JPEG, FLARE), ()).sentences == (
        "mine loses track at 3.2 s and none of these explains it: the cause is the estimator, its path or the scene.",
        "With all nuisances removed, the error drops by 2% (95 % CI -48% to 20%).",
        "Ruled out, by the share of the error that they can cost: flare (at most 10%).",
        "Not decided with so few repeats: JPEG (up to 60%).",
    )


def test_a_change_that_lets_runs_end_well_but_leaves_their_error_is_said() -> None:
    nothing = change("blur", "flare", reduction=0.02, is_sure=False, high=0.2)
    surviving = replace(change("flare", reduction=0.05, is_sure=False, high=0.1), survived=6, loss=0.8)
    assert explained(nothing, (surviving, JPEG), ()).sentences[1] == (
        "With a lens without stray light, all 6 runs end well, but their error is still 80.0% of the path."
    )
    assert len(explained(nothing, (surviving, JPEG), (), status="ok").sentences) == 4


@pytest.mark.parametrize(
    ("status", "diverges_at_s", "symptom"),
    [
        ("ok", 3.24, "mine has an error of 50.0% of the path, which begins to grow at 3.2 s,"),
        ("partial", None, "mine has an error of 50.0% of the path,"),
        ("diverged", 0.5, "mine diverges at 0.5 s"),
        ("crashed", None, "mine crashes"),
    ],
)
def test_the_symptom_states_what_fails_and_when(status: str, diverges_at_s: float | None, symptom: str) -> None:
    found = explained(status=status, diverges_at_s=diverges_at_s)
    assert found.symptom == symptom
    assert found.sentences[0].startswith(f"{symptom} because the images are blurred. With")


def test_the_dictionary_has_what_is_concluded() -> None:
    facts = explained().as_dict()
    assert (facts["named"], facts["relation"], facts["alternatives"]) == (("blur",), "one", ())
    assert (facts["contributing"], facts["harmful"]) == ([("noise",)], [("gloss",)])
    assert facts["ruled_out"] == [("flare",)]
