"""Explains why a trial fails by running its case again without each of its nuisances."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from vobench.analysis.cause_text import CAUSE_TEXTS
from vobench.analysis.explain import effort, explain
from vobench.analysis.explanation import HALF, MATERIAL, Change, Explanation, is_sufficient
from vobench.analysis.nuisance import NUISANCES, Nuisance, nuisance_named, nuisances_of, without
from vobench.analysis.segment_loss import Outcome
from vobench.analysis.trial_data import read_conditions, read_error_series, read_outcome, read_paths
from vobench.analysis.trial_forecast import TrialForecast, estimator_seconds
from vobench.errors import InputError
from vobench.runner.data_frame import data_frame
from vobench.runner.finished_trial import FinishedTrial, read_finished_trial, run_variants
from vobench.runner.folder import FINISHED_TRIAL, TrialScore
from vobench.runner.key import cache_folder
from vobench.runner.plan_runner import PlanRunner
from vobench.runner.store import SILENT, Progress, Store
from vobench.suite.case import Case
from vobench.trajectory.nanoseconds import NS_PER_S

if TYPE_CHECKING:
    from vobench.runner.data_frame import DataFrame


# What an estimator does whose trial ended with a status. For others, the error is stated.
SYMPTOMS = {
    "lost": "loses track",
    "diverged": "diverges",
    "crashed": "crashes",
    "timeout": "takes too long",
    "out_of_memory": "takes too much memory",
    "invalid_output": "returns an invalid answer",
}
NEVER_TRACKS = 1.0  # the mean error of a trial in which no segment has a pose at both ends


@dataclass(frozen=True, slots=True)
class TrialExplanation:
    """Why an estimator fails on a case.

    `diverges_at_s` is the time from the start of the case to the first frame whose error is far above the others' or
    that has no pose; None if there is none.
    """

    case: str
    estimator: str
    explanation: Explanation
    diverges_at_s: float | None = None

    @property
    def named(self) -> tuple[str, ...]:
        """The nuisances that explain the failure; empty if none does."""
        return self.explanation.named

    @property
    def sentences(self) -> tuple[str, ...]:
        """What fails, why and what to do about it; then what else matters, what harms, and what was ruled out."""
        explanation = self.explanation
        sentences = [_cause_sentence(self.symptom, explanation)]
        if explanation.parts:
            sentences.append(_parts_sentence(explanation.parts))
        if explanation.contributing:
            parts = ", ".join(_with_reduction(change) for change in explanation.contributing)
            sentences.append(f"It also depends on {parts}.")
        for change in explanation.harmful:
            instead = nuisance_named(change.removed[0]).instead
            sentences.append(f"{_upper(instead)} would make it worse: the error grows by {-change.reduction:.0%}.")
        if not explanation.named:
            sentences += _survival_sentences(explanation)
            sentences += _ruled_out_sentences(explanation)
        return tuple(sentences)

    @property
    def symptom(self) -> str:
        """What fails and when, such as "mine loses track at 3.2 s"."""
        explanation = self.explanation
        if explanation.status == "lost" and explanation.loss >= NEVER_TRACKS:
            return f"{self.estimator} never tracks"
        since = "" if self.diverges_at_s is None else f" at {self.diverges_at_s:.1f} s"
        if explanation.status in SYMPTOMS:
            return f"{self.estimator} {SYMPTOMS[explanation.status]}{since}"
        first = "" if self.diverges_at_s is None else f", which begins to grow{since}"
        return f"{self.estimator} has an error of {explanation.loss:.1%} of the path{first},"

    def verdict(self, change: Change) -> str:
        """The effect of a change: "fixes it", "helps", "harms", "does not help", "unconfirmed" or "undecided".

        What seems to differ by the seeds of the screening, but was not run with others, is "unconfirmed".
        """
        if change.is_sure and change.reduction >= MATERIAL:
            return "fixes it" if self._fixes(change) else "helps"
        if change.is_harmful:
            return "harms"
        if change.is_sure or change.is_ruled_out:
            return "does not help"
        seems_to_differ = change.low > 0 or change.high < 0
        return "unconfirmed" if seems_to_differ and not change.is_confirmed else "undecided"

    def _fixes(self, change: Change) -> bool:
        """Whether a change is named as a remedy, or achieves most of what removing all nuisances does."""
        is_named = set(change.removed) == set(self.named)
        is_alternative = change.removed in self.explanation.alternatives
        return is_named or is_alternative or is_sufficient(change, self.explanation.everything)

    def rows(self) -> list[dict[str, Any]]:
        """One row per variant of the case: single nuisances removed, then pairs, then all of them.

        `before` and `loss` are the errors of the same seeds with and without them; `reduction` is the share by which
        the error decreased, and `low` and `high` are its 95 % interval; `survived` of `repeats` trials ended well.
        """
        explanation = self.explanation
        changes = list[Change]()
        for change in explanation.singles:
            changes.append(change)
            if change.removed == self.named:
                changes += explanation.parts
        changes += explanation.pairs
        everything = explanation.everything
        if everything is not None and len(everything.removed) > 1 and everything not in changes:
            changes.append(everything)
        return [self._row(change) for change in changes]

    def _row(self, change: Change) -> dict[str, Any]:
        instead = ""
        if len(change.removed) == 1:
            instead = nuisance_named(change.removed[0]).instead
        return {**asdict(change), "before": change.loss_before, "instead": instead, "verdict": self.verdict(change)}

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench explain --json` prints them."""
        explanation = self.explanation
        return {
            **asdict(explanation),
            "named": explanation.named,
            "relation": explanation.relation,
            "alternatives": explanation.alternatives,
            "contributing": [change.removed for change in explanation.contributing],
            "harmful": [change.removed for change in explanation.harmful],
            "ruled_out": [change.removed for change in explanation.ruled_out],
            "sentences": self.sentences,
        }

    def to_frame(self) -> "DataFrame":
        """A pandas table of `rows`, with the names of the removed nuisances joined by " and "."""
        return data_frame({**row, "removed": " and ".join(row["removed"])} for row in self.rows())


def _cause_sentence(symptom: str, explanation: Explanation) -> str:
    """What fails, the cause, what removes it, and what to do, in one sentence."""
    changes = {change.removed: change for change in (*explanation.singles, *explanation.pairs)}
    if explanation.relation == "none":
        return f"{symptom} and none of these explains it: the cause is the estimator, its path or the scene."

    cause = changes[explanation.named]
    if explanation.relation == "together":
        reasons = " and ".join(_because(name) for name in explanation.named)
        remedies = ", and ".join(_advice(name) for name in explanation.named)
        return f"{symptom} because {reasons}, each by itself. Without both, {_reduction(cause)}: {remedies}."
    if explanation.relation == "either":
        names = [explanation.named[0], *(removed[0] for removed in explanation.alternatives)]
        reasons = " while ".join(_because(name) for name in names)
        reductions = ", ".join(_with_reduction(changes[(name,)]) for name in names)
        remedies = "; or ".join(_advice(name) for name in names)
        return f"{symptom} because {reasons}. Either change suffices ({reductions}): {remedies}."
    (name,) = explanation.named
    instead = nuisance_named(name).instead
    advice = "" if _decisive_part(explanation.parts) else f": {_advice(name)}"
    return f"{symptom} because {_because(name)}. With {instead}, {_reduction(cause)}{advice}."


def _parts_sentence(parts: Sequence[Change]) -> str:
    """How much of a cause is due to each of its parts, and what to do if one of them decides."""
    shares = [f"with {nuisance_named(change.removed[0]).instead} alone {_drop(change)}" for change in parts]
    decisive = _decisive_part(parts)
    advice = f": {_advice(decisive)}" if decisive else ""
    return f"{_upper(', and '.join(shares))}{advice}."


def _decisive_part(parts: Sequence[Change]) -> str:
    """The only part that surely achieves half of the reduction; empty if there is none, or several."""
    helping = [change.removed[0] for change in parts if change.is_sure and change.reduction >= HALF]
    return helping[0] if len(helping) == 1 else ""


def _drop(change: Change) -> str:
    if change.reduction < 0:
        return f"it grows by {-change.reduction:.0%}"
    return f"it drops by {change.reduction:.0%}"


def _because(name: str) -> str:
    return CAUSE_TEXTS[name].because


def _advice(name: str) -> str:
    return CAUSE_TEXTS[name].advice


def _survival_sentences(explanation: Explanation) -> list[str]:
    """Which changes let all runs end well that did not, although their errors remain."""
    if explanation.status not in SYMPTOMS:
        return []
    surviving = [change for change in explanation.singles if change.survived == change.repeats]
    sentences = []
    for change in surviving:
        instead = _upper(f"with {nuisance_named(change.removed[0]).instead}")
        sentences.append(
            f"{instead}, all {change.repeats} runs end well, but their error is still {change.loss:.1%} of the path."
        )
    return sentences


def _ruled_out_sentences(explanation: Explanation) -> list[str]:
    """What was ruled out, by how much at most it matters, and what was left open."""
    sentences = []
    if explanation.everything is not None:
        everything = explanation.everything
        interval = f"95 % CI {everything.low:.0%} to {everything.high:.0%}"
        sentences.append(f"With all nuisances removed, the error drops by {everything.reduction:.0%} ({interval}).")
    if explanation.ruled_out:
        parts = ", ".join(f"{change.removed[0]} (at most {change.high:.0%})" for change in explanation.ruled_out)
        sentences.append(f"Ruled out, by the share of the error that they can cost: {parts}.")
    unclear = [change for change in explanation.singles if not (change.is_ruled_out or change.is_sure)]
    if unclear:
        parts = ", ".join(f"{change.removed[0]} (up to {change.high:.0%})" for change in unclear)
        sentences.append(f"Not decided with so few repeats: {parts}.")
    return sentences


def _with_reduction(change: Change) -> str:
    return f"{change.removed[0]} ({change.reduction:.0%} less)"


def _reduction(change: Change) -> str:
    """By how much a change reduces the error, and how many runs end well with it."""
    interval = f"95 % CI {change.low:.0%} to {change.high:.0%}"
    ending_well = f"{change.survived} of {change.repeats} runs end well"
    return f"the error drops by {change.reduction:.0%} ({interval}), to {change.loss:.1%}, and {ending_well}"


def _upper(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]


def explain_trial(
    trial: Path,
    *,
    run_plan: PlanRunner,
    repeats: int = 3,
    estimator: Path | None = None,
    progress: Progress = SILENT,
) -> TrialExplanation:
    """Run a trial again without each nuisance of its case, and find which of them its error depends on.

    Args:
        trial: the trial as RUN/CASE/ESTIMATOR, or its folder in the run.
        run_plan: runs the variants of the case.
        repeats: how many seeds each variant is screened with; more for an estimator that is not deterministic.
        estimator: the folder of the estimator, if it cannot be found by its name.
        progress: hears what the explanation will cost, and whether the estimator has changed since the run.

    Raises:
        InputError: there is no such trial, it is of a recording, its case has no nuisance, or the estimator answered in
            the trial and no longer does.
        UnknownNameError: the run has no such case or estimator.
        SuiteError: a variant cannot be simulated.
    """
    finished = read_finished_trial(trial, estimator=estimator, progress=progress)
    nuisances = _present_nuisances(finished)
    suite_name = f"explain_{finished.score.case.replace('-', '_')}_{finished.score.estimator}"
    seeds = effort(repeats, is_deterministic=finished.estimator_entry.manifest.deterministic)
    parts = {nuisance.name: _part_names(nuisance, finished.case) for nuisance in nuisances}
    forecast = TrialForecast(
        progress,
        seeds,
        len(nuisances),
        _seconds_per_trial(finished),
        removed="nuisances",
        parts=max(map(len, parts.values())),
    )

    def measure(cases: Mapping[str, Case]) -> dict[str, list[Outcome]]:
        with forecast.stage(len(cases)):
            folder = run_variants(finished, cases, name=suite_name, run_plan=run_plan)
            scores = folder.scores()
            _require_answers(finished.score, scores)
            return {score.case: [read_outcome(folder, score)] for score in scores}

    explanation = explain(finished.case, nuisances, measure, seeds=seeds, remove=without, parts=parts)
    return TrialExplanation(
        finished.score.case,
        finished.score.estimator,
        explanation,
        diverges_at_s=_divergence_s(finished),
    )


def _part_names(nuisance: Nuisance, case: Case) -> list[str]:
    return [part.name for part in nuisance.parts_of(case)]


def _divergence_s(trial: FinishedTrial) -> float | None:
    """The time from the start of a trial to the first frame with a large error or without a pose.

    None if there is no such frame, or if the estimator did not answer to the end.
    """
    if trial.score.status not in FINISHED_TRIAL:
        return None
    first_frame = read_error_series(trial.folder, trial.score, {}).first_divergence
    if first_frame is None:
        return None
    t_ns = read_paths(trial.folder, trial.score).gt.t_ns
    return float(t_ns[first_frame] - t_ns[0]) / NS_PER_S


def _require_answers(explained: TrialScore, scores: Sequence[TrialScore]) -> None:
    """Raise InputError if an estimator answered to the end in the trial, and in none of the trials of a stage.

    Then it is not the case that makes it fail.
    """
    is_answered = any(score.status in FINISHED_TRIAL for score in scores)
    if is_answered or explained.status not in FINISHED_TRIAL:
        return
    first = scores[0]
    cause = f"in '{first.status}' ({first.reason})"
    raise InputError(
        f"the trial ended in '{explained.status}', but all of {len(scores)} trials without a nuisance {cause}: "
        f"has {explained.estimator} or what it needs changed since?"
    )


def _seconds_per_trial(trial: FinishedTrial) -> float:
    """How long a trial takes: a typical simulation on this machine, and the estimator for the frames of this trial."""
    earlier_s = Store(cache_folder()).seconds("sequence")
    simulation_s = median(earlier_s) if earlier_s else 0.0
    return simulation_s + estimator_seconds(trial.path)


def _present_nuisances(trial: FinishedTrial) -> tuple[Nuisance, ...]:
    """The nuisances that the frames of a trial show. Raises InputError if there are none."""
    frame_conditions = read_conditions(trial.folder, trial.case)
    largest = {name: float(values.max()) for name, values in frame_conditions.items()}
    nuisances = nuisances_of(trial.case, largest, trial.estimator_entry.manifest.needs)
    if not nuisances:
        known = ", ".join(nuisance.name for nuisance in NUISANCES)
        raise InputError(f"'{trial.case.name}' has nothing that can be removed. Known: {known}")
    return nuisances
