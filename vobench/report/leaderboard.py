"""Scores as one table of cells, case × estimator, and what comes of it: ranks, marks and where estimators break."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import groupby, pairwise
from math import inf, isnan, nan
from statistics import fmean, median
from typing import Any

import numpy as np

from vobench.metric import ranking
from vobench.metric.coverage import lost_aware_score
from vobench.runner.consistency import Consistency
from vobench.runner.environment import Environment
from vobench.runner.estimate import DROPPED
from vobench.runner.folder import (
    NOT_APPLICABLE,
    STATUSES,
    SURVIVED,
    TrialScore,
    Unmade,
    seen_by,
    unmade_in,
    value_of,
    visible_to,
    with_sequence,
)
from vobench.runner.frames import FrameRow

NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
FAIL_RATIO = 0.1  # of the path, of scores without a lost-aware one
ONLY_ITS_OWN = "only its own files"
BROKEN = 0.75  # the lost-aware score of a survivor that is off by half of what counts as failed


@dataclass(frozen=True, slots=True)
class Metric:
    """One number of a trial that a board shows: its heading, and how it is read off a score."""

    heading: str
    of: Callable[[TrialScore], float | None]
    higher_is_better: bool = False
    of_failures: bool = False  # told of failed trials too


def _read(metric: str, statistic: str, scale: float) -> Callable[[TrialScore], float | None]:
    def read(trial: TrialScore) -> float | None:
        value = None if trial.drift_m is not None else trial.value(metric, statistic)
        return None if value is None else scale * value

    return read


def _ate_percent(trial: TrialScore) -> float | None:
    ate_m = _read("ate_trans", "rmse", 1.0)(trial)
    return 100 * ate_m / trial.path_m if ate_m is not None and trial.path_m > 0 else None


def lost_aware(trial: TrialScore) -> float | None:
    """A trial's lost-aware score, below 1/2 of any that failed; None where the truth stands still."""
    survived = trial.status in SURVIVED
    if trial.drift_m is not None:
        return None
    score = ((trial.score or {}).get("failure") or {}).get("lost_aware")
    if score is None and (ate_m := trial.value("ate_trans", "rmse")) is not None:
        limit_m = FAIL_RATIO * max(trial.path_m, 1e-9)
        score = lost_aware_score(np.array([ate_m]), trial.coverage, survived=survived, fail_m=limit_m)
    return 1.0 - ranking.trial_loss(score, survived=survived)


METRICS: dict[str, Metric] = {
    "ate": Metric("ATE % of path", _ate_percent),
    "ate_mm": Metric("ATE mm", _read("ate_trans", "rmse", 1e3)),
    "segments": Metric("segments %", _read("kitti_t_rel", "mean", 100)),
    "rpe_mm": Metric("RPE mm/frame", _read("rpe_trans", "rmse", 1e3)),
    "rpe_deg": Metric("RPE °/frame", _read("rpe_rot", "rmse", 1)),
    "score": Metric("lost-aware score", lost_aware, higher_is_better=True, of_failures=True),
    "coverage": Metric("coverage", lambda trial: trial.coverage, higher_is_better=True, of_failures=True),
    "cpu_ms": Metric("CPU ms/frame", lambda _: None, of_failures=True),
    "memory_mib": Metric("MiB", lambda _: None, of_failures=True),
}
COSTS = ("cpu_ms", "memory_mib")


@dataclass(frozen=True, slots=True)
class CaseFacts:
    """What a case says of itself: the `group` of its calibration, how severe its scenario is, its truth's noise."""

    group: str = ""
    scenario: str = ""
    severity: int | None = None
    truth_noise: str = ""


@dataclass(frozen=True, slots=True)
class EstimatorStatistics:
    """What an estimator answered on a case: mean CPU time of a frame, and its commonest reason for single frames.

    Its processes held `memory_mib` at most.
    Of all frames so many were `dropped`, as `late` answers came after the next frame.
    """

    ms_per_frame: float | None = None
    reason: str = ""
    count: int = 0
    first: int | None = None
    memory_mib: float | None = None
    frames: int = 0
    dropped: int = 0
    late: int = 0


Answered = Mapping[tuple[str, str], EstimatorStatistics]


@dataclass(frozen=True, slots=True)
class Cell:
    """All trials of one estimator on one case.

    `values` has each metric's of every trial, infinitely bad where it failed, None where it has none; `status` and
    `reason` are the gravest. `consistency`, `revised_…` and `scale_drift_…` are of the survivors.
    `saw` is what its trials could see.
    """

    case: str
    estimator: str
    facts: CaseFacts
    failures: tuple[bool, ...]
    status: str
    reason: str
    values: Mapping[str, tuple[float | None, ...]]
    losses: tuple[float, ...]
    answered: EstimatorStatistics
    claims: tuple[str, ...] = ()
    drift_mm: float | None = None
    scale_gap: float | None = None
    consistency: str = ""
    revised_ate_mm: float | None = None
    revised_segment_percent: float | None = None
    scale_drift_percent_per_m: float | None = None
    saw: str = ""

    @property
    def trials(self) -> int:
        """How many trials there are."""
        return len(self.failures)

    @property
    def failed(self) -> int:
        """How many of them failed."""
        return sum(self.failures)

    def spread(self, metric: str) -> tuple[float, float, float] | None:
        """Median, least and largest of a metric over the trials that have it, None where none has."""
        has = [value for value in self.values[metric] if value is not None and abs(value) < inf]
        return (median(has), min(has), max(has)) if has else None


@dataclass(frozen=True, slots=True)
class Total:
    """One estimator over all cases of a group that everybody has: its standing, and what it cost.

    `score` is the lost-aware one, 1 minus the geometric mean of what trials lack of 1; `ate_percent` a median over
    cases, `mean_place` a mean over them; `is_efficient`: nobody with a better score took less CPU time.
    """

    group: str
    estimator: str
    claims: tuple[str, ...]
    place: int
    places: tuple[int, int]
    score: float
    loss_ratio: float
    ratio_interval: tuple[float, float] | None
    p_above: float | None
    decided_above: bool
    repeats: int | None
    trials: int
    failed: int
    cases: int
    ate_percent: float | None
    mean_place: float | None
    cpu_ms: float | None
    memory_mib: float | None
    is_efficient: bool = False


@dataclass(frozen=True, slots=True)
class Curve:
    """An estimator's median lost-aware score over the severities of a scenario, and the first at which it is broken."""

    group: str
    scenario: str
    estimator: str
    severities: tuple[int, ...]
    scores: tuple[float, ...]
    breaks_at: int | None


@dataclass(frozen=True, slots=True)
class Board:
    """The table of cells and what is derived from it; `remarks` say what its numbers do not.

    `visible` says what the estimators could see.
    `unmade` are the cases that could not be simulated or imported: they have no cells, and count for no estimator.
    `environment` is where the figures come from, as far as it is known.
    """

    title: str
    cells: tuple[Cell, ...]
    totals: tuple[Total, ...]
    curves: tuple[Curve, ...]
    remarks: tuple[str, ...]
    unmade: tuple[Unmade, ...] = ()
    environment: Environment | None = None
    visible: str = ""
    _at: dict[tuple[str, str], Cell] = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        self._at.update({(cell.case, cell.estimator): cell for cell in self.cells})

    def cell(self, case: str, estimator: str) -> Cell | None:
        """The cell of a case and an estimator, if there is such a trial."""
        return self._at.get((case, estimator))

    @property
    def cases(self) -> list[str]:
        """Names of all cases."""
        return list(dict.fromkeys(cell.case for cell in self.cells))

    @property
    def estimators(self) -> list[str]:
        """All estimators, the best first."""
        return list(dict.fromkeys([*(t.estimator for t in self.totals), *(c.estimator for c in self.cells)]))

    @property
    def metrics(self) -> list[str]:
        """The metrics that any cell has."""
        return [name for name in METRICS if any(cell.spread(name) for cell in self.cells)]


def answers(trials: Sequence[list[FrameRow]]) -> EstimatorStatistics:
    """What the frames of all trials of one estimator on one case come to.

    Reasons that differ in numbers alone, as `too few tracks (7)` and `(5)`, are one.
    """
    rows = [row for trial in trials for row in trial]
    costs_ms = [row.cpu_ms for row in rows if row.cpu_ms is not None]
    given = [row for row in rows if row.reason]
    cost_ms = fmean(costs_ms) if costs_ms else None
    statuses = [[row.status for row in trial] for trial in trials]
    late = sum(now == DROPPED != before for each in statuses for before, now in pairwise(each))
    memory_mib = max((row.memory_mib for row in rows if row.memory_mib), default=None)
    pace: dict[str, Any] = {
        "memory_mib": memory_mib,
        "frames": len(rows),
        "dropped": sum(row.status == DROPPED for row in rows),
        "late": late,
    }
    if not given:
        return EstimatorStatistics(cost_ms, **pace)
    kinds = Counter(NUMBER.sub("0", row.reason) for row in given)
    kind, count = min(kinds.items(), key=lambda item: (-item[1], item[0]))
    first = min((row for row in given if NUMBER.sub("0", row.reason) == kind), key=lambda row: row.frame)
    return EstimatorStatistics(cost_ms, first.reason, count, first.frame, **pace)


def board(
    scores: Iterable[TrialScore],
    answered: Answered,
    facts: Mapping[str, CaseFacts] | None = None,
    *,
    title: str = "",
    environment: Environment | None = None,
) -> Board:
    """The board of these trials; `answered` is per (case, estimator), `facts` per case, and both may lack some."""

    def place(score: TrialScore) -> tuple[str, str]:
        return score.case, score.estimator

    facts = facts or {}
    scores = list(scores)
    unmade = unmade_in(scores)
    grouped = groupby(sorted(with_sequence(scores), key=lambda score: (*place(score), score.repeat)), key=place)
    cells = [
        _cell(list(trials), answered.get(key, EstimatorStatistics()), facts.get(key[0], CaseFacts()))
        for key, trials in grouped
    ]
    groups = sorted({cell.facts.group for cell in cells})
    totals = list[Total]()
    remarks = _without_sequence(unmade, of=len({score.case for score in scores}))
    for group in groups:
        found, said = _totals(group, [cell for cell in cells if cell.facts.group == group])
        totals += found
        remarks += said
    if len(groups) > 1:
        remarks.append(f"each calibration has totals of its own: {', '.join(group or 'none' for group in groups)}")
    remarks += sorted(
        {f"the truth that is scored is off by {each}" for cell in cells if (each := cell.facts.truth_noise)}
    )
    return Board(
        title,
        tuple(cells),
        tuple(totals),
        tuple(_curves(cells)),
        tuple(remarks),
        unmade,
        environment,
        visible_to(with_sequence(scores)),
    )


def _without_sequence(unmade: Sequence[Unmade], *, of: int) -> list[str]:
    """One sentence on the cases that could not be made, each cause once; none if there are no such cases."""
    if not unmade:
        return []
    count = sum(len(group.cases) for group in unmade)
    causes = "; ".join(f"{group.names}: {group.cause}" for group in unmade)
    return [f"{count} of {of} cases could not be simulated or imported and count for no estimator: {causes}"]


def _cell(trials: list[TrialScore], found: EstimatorStatistics, facts: CaseFacts) -> Cell:
    survivors = [trial for trial in trials if trial.status in SURVIVED]
    moving = [trial for trial in survivors if trial.drift_m is None]
    worst = max(trials, key=lambda trial: STATUSES.index(trial.status))
    drifts = [1e3 * trial.drift_m for trial in trials if trial.drift_m is not None]
    scored = [lost_aware(trial) for trial in trials]
    costs: dict[str, tuple[float | None, ...]] = {
        "cpu_ms": (found.ms_per_frame or None,),
        "memory_mib": (found.memory_mib,),
    }
    return Cell(
        case=worst.case,
        estimator=worst.estimator,
        facts=facts,
        failures=tuple(trial.status not in SURVIVED for trial in trials),
        status=worst.status,
        reason=worst.reason,
        values={
            **{name: tuple(_value(metric, trial) for trial in trials) for name, metric in METRICS.items()},
            **costs,
        },
        losses=tuple(nan if score is None else max(1.0 - score, ranking.MIN_LOSS) for score in scored),
        answered=found,
        claims=worst.claims,
        saw="; ".join(sorted({seen_by(trial) or ONLY_ITS_OWN for trial in trials})),
        drift_mm=max(drifts, default=None),
        scale_drift_percent_per_m=_mean(moving, "scale_drift", "mean", 100),
        revised_ate_mm=_mean(moving, "ate_trans", "rmse", 1e3, revised=True),
        revised_segment_percent=_mean(moving, "kitti_t_rel", "mean", 100, revised=True),
        **_consistency([trial.consistency for trial in survivors if trial.consistency]),
    )


def _value(metric: Metric, trial: TrialScore) -> float | None:
    if trial.status in SURVIVED or metric.of_failures:
        return metric.of(trial)
    return None if trial.drift_m is not None else inf


def _consistency(found: list[Consistency]) -> dict[str, Any]:
    """What the covariances of these trials are worth together: the median trial's, for errors of one path go along."""
    if not found:
        return {}
    middle = sorted(found, key=lambda each: each.scale_gap)[len(found) // 2]
    return {"scale_gap": middle.scale_gap, "consistency": middle.sentence}


def _mean(
    trials: list[TrialScore], metric: str, statistic: str, scale: float, *, revised: bool = False
) -> float | None:
    scores = [trial.revised if revised else trial.score for trial in trials]
    values = [value for score in scores if (value := value_of(score, metric, statistic)) is not None]
    return scale * fmean(values) if values else None


def _totals(group: str, cells: Sequence[Cell]) -> tuple[list[Total], list[str]]:
    """The estimators ranked over the cases that all of them have, and what to know of that.

    Whose sensors some of the cases lack has not got these; whose sensors all of them lack fails them.
    """
    names = sorted({cell.estimator for cell in cells})
    able = {cell.estimator for cell in cells if cell.status != NOT_APPLICABLE}
    cells = [cell for cell in cells if cell.estimator not in able or cell.status != NOT_APPLICABLE]
    of_case: dict[str, list[Cell]] = {}
    for cell in cells:
        of_case.setdefault(cell.case, []).append(cell)
    common = [case for case, of in of_case.items() if len(of) == len(names)]
    remarks = list[str]()
    if len(common) < len(of_case):
        lacks = Counter(cell.estimator for cell in cells)
        least = min(lacks, key=lambda name: (lacks[name], name))
        over = f"totals are over the {len(common)} of {len(of_case)} cases that every estimator has"
        over = over if common else "nobody is ranked, for no case has every estimator"
        remarks.append(f"{over} ({least} has {lacks[least]})")
    if not common:
        return [], remarks
    shown = [cell for case in common for cell in of_case[case]]
    rows, columns = ({name: k for k, name in enumerate(each)} for each in (names, common))
    loss = np.full((len(names), len(common), max(cell.trials for cell in shown)), np.nan)
    failed = loss.copy()
    by_name: dict[str, list[Cell]] = {name: [] for name in names}
    for cell in shown:
        place = rows[cell.estimator], columns[cell.case]
        loss[place][: cell.trials] = cell.losses
        failed[place][: cell.trials] = cell.failures
        by_name[cell.estimator].append(cell)
    places = ranking.mean_places(loss, failed)
    standings = ranking.rank(loss, failed)
    found = [_total(group, by_name[names[each.index]], each, float(places[each.index])) for each in standings]
    pairs = len(common) * loss.shape[2]
    if len(names) > 1 and pairs < ranking.MIN_UNITS:
        remarks.append(f"too few trials to decide anything: {pairs} a pair of estimators, {ranking.MIN_UNITS} at least")
    elif len(names) > 1 and len(common) < ranking.MIN_UNITS:
        remarks.append(f"fewer than {ranking.MIN_UNITS} cases: ranks say what repeats of these show, not other cases")
    return _efficient(found), remarks


def _total(group: str, cells: Sequence[Cell], standing: ranking.Standing, mean_place: float) -> Total:
    ates = [each[0] for cell in cells if (each := cell.spread("ate"))]
    costs = [each[0] for cell in cells if (each := cell.spread("cpu_ms"))]
    memory = [each[0] for cell in cells if (each := cell.spread("memory_mib"))]
    stated = asdict(standing)
    return Total(
        group=group,
        estimator=cells[0].estimator,
        claims=cells[0].claims,
        score=1.0 - standing.loss,
        trials=sum(cell.trials for cell in cells),
        cases=len(cells),
        ate_percent=median(ates) if ates else None,
        mean_place=mean_place,
        cpu_ms=fmean(costs) if costs else None,
        memory_mib=max(memory, default=None),
        **{name: stated[name] for name in ("place", "places", "loss_ratio", "ratio_interval", "p_above")},
        decided_above=standing.decided_above,
        repeats=standing.repeats,
        failed=sum(cell.failed for cell in cells),
    )


def _efficient(ranked: Sequence[Total]) -> list[Total]:
    """The same, those marked than whom nobody with a better score took less CPU time."""
    costs = {total.estimator: inf if total.cpu_ms is None else total.cpu_ms for total in ranked}
    least = inf
    marked = set[str]()
    for total in sorted(ranked, key=lambda total: (-total.score, costs[total.estimator])):
        if costs[total.estimator] < least:
            least = costs[total.estimator]
            marked.add(total.estimator)
    return [replace(total, is_efficient=total.estimator in marked) for total in ranked]


def _curves(cells: Iterable[Cell]) -> list[Curve]:
    """How each estimator fares as each scenario grows more severe."""
    found: dict[tuple[str, str, str], dict[int, list[float]]] = {}
    for cell in cells:
        if cell.facts.scenario and cell.facts.severity is not None:
            key = cell.facts.group, cell.facts.scenario, cell.estimator
            known = [1.0 - loss for loss in cell.losses if not isnan(loss)]
            found.setdefault(key, {}).setdefault(cell.facts.severity, []).extend(known)
    curves = list[Curve]()
    for key, by_severity in sorted(found.items()):
        levels = sorted(severity for severity, known in by_severity.items() if known)
        scores = tuple(median(by_severity[level]) for level in levels)
        broken = next((level for level, score in zip(levels, scores, strict=True) if score < BROKEN), None)
        if len(levels) > 1:
            curves.append(Curve(*key, tuple(levels), scores, broken))
    return curves


def marks(made: Board, metric: str) -> dict[tuple[str, str], str]:
    """Of each case the best estimator's mark `*`, and `~` of those, it too, that are not decided against the best.

    A cell with a failed trial counts it as worst of all; costs are not marked.
    """
    found = dict[tuple[str, str], str]()
    sign = -1.0 if METRICS[metric].higher_is_better else 1.0
    for case, group in groupby(made.cells if metric not in COSTS else (), key=lambda cell: cell.case):
        values = {
            cell.estimator: np.array([sign * v for v in cell.values[metric] if v is not None])
            for cell in group
            if cell.drift_mm is None
        }
        middle = {name: float(np.median(v)) for name, v in values.items() if len(v) and np.median(v) < inf}
        if len(middle) < 2:
            continue
        best = min(middle, key=lambda name: (middle[name], name))
        others = [name for name in values if name != best and len(values[name])]
        tied = [name for name in others if ranking.difference_p(values[best], values[name]) >= ranking.ALPHA]
        few = len(values[best]) < ranking.MIN_TRIALS
        found[case, best] = "*~" if tied else "*"
        found |= {(case, name): "*" if middle.get(name) == middle[best] else "~" for name in tied if not few}
    return found


def notes(cell: Cell) -> list[str]:
    """What a cell's numbers don't say: how it failed, how far it drifted standing still, what its frames lacked."""
    said = [f"{cell.status}: {cell.reason}"] if cell.reason else []
    frames = cell.answered
    if cell.drift_mm is not None:
        said.append(f"stood still: drift {cell.drift_mm:.1f} mm")
    if frames.dropped:
        missed = f"{frames.late} deadline{'' if frames.late == 1 else 's'} missed"
        said.append(f"real time: {missed}, {frames.dropped} of {frames.frames} frames dropped")
    if cell.revised_ate_mm is not None:
        drift = "–" if cell.revised_segment_percent is None else f"{cell.revised_segment_percent:.3f}"
        said.append(f"after the fact: ATE {cell.revised_ate_mm:.2f} mm, segments {drift} %")
    if cell.scale_drift_percent_per_m is not None:
        said.append(f"aligned with a scale, which drifts by {cell.scale_drift_percent_per_m:+.2g} % a metre")
    if cell.consistency:
        said.append(cell.consistency)
    if frames.reason:
        count = "1 frame" if frames.count == 1 else f"{frames.count} frames"
        over = f" of {cell.trials} trials" if cell.trials > 1 else ""
        said.append(f'{count}{over} "{frames.reason}", first at frame {frames.first}')
    return [f"{cell.estimator}: {sentence}" for sentence in said]
