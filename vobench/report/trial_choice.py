"""The trials of a run that are most worth a look."""

from collections.abc import Sequence
from math import inf
from statistics import fmean

from vobench.errors import InputError, UnknownNameError
from vobench.report.board_metric import lost_aware
from vobench.report.cell import CaseFacts
from vobench.report.division import is_ranked
from vobench.runner.folder import NOT_APPLICABLE, STATUSES, SURVIVED, TrialScore, with_sequence

CAMERAS = ("stereo", "mono", "colour")
# What an estimator does whose trial has this status.
DEEDS = {
    "lost": "loses track",
    "diverged": "diverges",
    "timeout": "runs out of time",
    "out_of_memory": "runs out of memory",
    "crashed": "crashes",
}


def ranked(scores: Sequence[TrialScore], *, case: str | None, estimator: str | None) -> list[TrialScore]:
    """The trials of a case and an estimator, the gravest failure first, then by score and error.

    Without a case or an estimator, those of all. Raises UnknownNameError if no trial is of that case or estimator,
    and InputError if its case has no sequence.
    """
    return sorted(_selected(scores, case, estimator), key=_gravest_first)


def pick(scores: Sequence[TrialScore], *, case: str | None, estimator: str | None) -> TrialScore:
    """The trial most worth a look: the gravest failure, or else the worst case of the best estimator.

    Of failures with the same status, the one with the lowest lost-aware score is chosen; of those, the first.
    Without a case or an estimator, of all trials; without an estimator those that see are preferred to others, and all
    to baselines and oracles. Raises as `ranked`.
    """
    selected = _selected(scores, case, estimator)
    if estimator is None:
        selected = _most_telling(selected)
    selected = _applicable(selected)
    failed = [score for score in selected if score.status not in SURVIVED]
    if failed:
        return min(failed, key=_gravest_first)
    by_estimator: dict[str, list[TrialScore]] = {}
    for score in sorted(selected, key=lambda score: score.estimator):
        by_estimator.setdefault(score.estimator, []).append(score)
    best = min(by_estimator.values(), key=_mean_error_m)
    return max(best, key=_error_m)


def _most_telling(scores: Sequence[TrialScore]) -> list[TrialScore]:
    """The trials of estimators that see; without any those of estimators that are ranked, and else all."""
    ranked_scores = [score for score in scores if is_ranked(score)]
    seeing = [score for score in ranked_scores if set(score.sensors) & set(CAMERAS)]
    return seeing or ranked_scores or list(scores)


def _applicable(scores: Sequence[TrialScore]) -> list[TrialScore]:
    """The trials whose case has all sensors that the estimator needs; all if there are none."""
    applicable = [score for score in scores if score.status != NOT_APPLICABLE]
    return applicable or list(scores)


def _selected(scores: Sequence[TrialScore], case: str | None, estimator: str | None) -> list[TrialScore]:
    """The trials of a case and an estimator that have a sequence to show."""
    _require_known("case", case, {score.case for score in scores})
    _require_known("estimator", estimator, {score.estimator for score in scores})
    selected = list(scores)
    if case is not None:
        selected = [score for score in selected if score.case == case]
    if estimator is not None:
        selected = [score for score in selected if score.estimator == estimator]
    shown = with_sequence(selected)
    if selected and not shown:
        unmade = selected[0]
        raise InputError(
            f"'{unmade.case}' has no sequence to show because it could not be simulated or imported: {unmade.reason}"
        )
    return shown


def _require_known(kind: str, name: str | None, known: set[str]) -> None:
    if name is not None and name not in known:
        raise UnknownNameError(f"no {kind} '{name}' in this run. Known: {', '.join(sorted(known))}")


def _gravest_first(score: TrialScore) -> tuple[bool, int, float, float]:
    """A key that sorts failures by status, then by the lost-aware score, and trials without failure by error."""
    is_failure = score.status not in SURVIVED
    quality = lost_aware(score) if is_failure else None
    return not is_failure, -STATUSES.index(score.status), quality or 0.0, -_error_m(score)


def _error_m(score: TrialScore) -> float:
    """The RMSE of position, infinite if there is none."""
    error_m = score.value("ate_trans", "rmse")
    return inf if error_m is None else error_m


def _mean_error_m(scores: Sequence[TrialScore]) -> float:
    return fmean(_error_m(score) for score in scores)


def story(score: TrialScore, facts: CaseFacts) -> str:
    """How a trial went, in words: what its estimator did, and in which scenario and place, if the case states them."""
    if score.status in SURVIVED or not facts.scenario or facts.severity is None:
        return sentence(score)
    deed = DEEDS.get(score.status, f"fails ({score.status})")
    place = f", in {facts.place}" if facts.place else ""
    return f"{score.estimator} {deed} at severity {facts.severity} of {facts.scenario}{place}"


def sentence(score: TrialScore) -> str:
    """How a trial went, in a sentence: how it failed, or its error."""
    name = f"{score.estimator} on {score.case}"
    if score.status not in SURVIVED:
        reason = f": {score.reason}" if score.reason else ""
        return f"{name}: {score.status}{reason}"
    error_m = _error_m(score)
    if error_m == inf or score.path_m <= 0:
        return f"{name}: {score.status}"
    return f"{name} is off by {100 * error_m / score.path_m:.3g} % of the path"
