"""Estimators ranked over the cases that all of them have, with the score and the cost of each."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf
from statistics import fmean, median

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric import ranking
from vobench.report.cell import Cell
from vobench.runner.folder import NOT_APPLICABLE


@dataclass(frozen=True, slots=True)
class Total:
    """One estimator over the cases of a calibration group that every estimator has: its rank, score and cost.

    `score` is the lost-aware score, 1 minus the geometric mean of the losses. `ate_percent` is a median over cases,
    `mean_place` a mean over cases. `is_efficient` states that no estimator with a better score used less CPU time.
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


def rank_group(group: str, cells: Sequence[Cell]) -> tuple[list[Total], list[str]]:
    """The totals of a calibration group, the best estimator first, and remarks on what they cover.

    Cases without a sensor that an estimator requires are excluded for that estimator. If no case has it, the estimator
    counts as failed.
    """
    names = sorted({cell.estimator for cell in cells})
    applicable = _applicable(cells)
    by_case = _grouped(applicable, lambda cell: cell.case)
    common = [case for case, members in by_case.items() if len(members) == len(names)]
    remarks = []
    if len(common) < len(by_case):
        remarks.append(_shared_cases_remark(applicable, shared=len(common), cases=len(by_case)))
    if not common:
        return [], remarks

    ranked = [cell for case in common for cell in by_case[case]]
    losses, failures = _trial_arrays(ranked, names, common)
    mean_places = ranking.mean_places(losses, failures)
    by_estimator = _grouped(ranked, lambda cell: cell.estimator)
    totals = []
    for standing in ranking.rank(losses, failures):
        estimator_cells = by_estimator[names[standing.index]]
        mean_place = float(mean_places[standing.index])
        totals.append(_total(group, estimator_cells, standing, mean_place))
    if len(names) > 1:
        remarks += _few_trials_remark(cases=len(common), pairs=len(common) * losses.shape[2])
    return _mark_efficient(totals), remarks


def _applicable(cells: Sequence[Cell]) -> list[Cell]:
    """The cells without those that lack a required sensor, unless that is so of all cells of their estimator."""
    able = {cell.estimator for cell in cells if cell.status != NOT_APPLICABLE}
    return [cell for cell in cells if cell.estimator not in able or cell.status != NOT_APPLICABLE]


def _grouped(cells: Sequence[Cell], key: Callable[[Cell], str]) -> dict[str, list[Cell]]:
    """Cells by a key, in their order."""
    groups: dict[str, list[Cell]] = {}
    for cell in cells:
        groups.setdefault(key(cell), []).append(cell)
    return groups


def _shared_cases_remark(cells: Sequence[Cell], *, shared: int, cases: int) -> str:
    """The remark that not every estimator has every case, with the estimator that has the fewest."""
    cases_of = Counter(cell.estimator for cell in cells)
    fewest = min(cases_of, key=lambda name: (cases_of[name], name))
    if not shared:
        return f"No estimator is ranked because no case is shared by all estimators ({fewest} has {cases_of[fewest]})"
    return f"Totals cover the {shared} of {cases} cases that all estimators share ({fewest} has {cases_of[fewest]})"


def _few_trials_remark(*, cases: int, pairs: int) -> list[str]:
    """The remark that there are too few trials for a test, or too few cases for a general statement."""
    least = ranking.MIN_UNITS
    if pairs < least:
        return [f"Too few trials to decide any order: {pairs} per pair of estimators, at least {least} are required"]
    if cases < least:
        return [f"Fewer than {least} cases: ranks hold for repeats of these cases and may differ on other cases"]
    return []


def _trial_arrays(cells: Sequence[Cell], names: Sequence[str], cases: Sequence[str]) -> tuple[Array, Array]:
    """The losses and failures of trials, both (estimators, cases, repeats), NaN for no trial."""
    row_of = {name: row for row, name in enumerate(names)}
    column_of = {case: column for column, case in enumerate(cases)}
    repeats = max(cell.trials for cell in cells)
    losses = np.full((len(names), len(cases), repeats), np.nan)
    failures = losses.copy()
    for cell in cells:
        index = row_of[cell.estimator], column_of[cell.case]
        losses[index][: cell.trials] = cell.losses
        failures[index][: cell.trials] = cell.failures
    return losses, failures


def _total(group: str, cells: Sequence[Cell], standing: ranking.Standing, mean_place: float) -> Total:
    """The total of one estimator, from its cells and its standing among the others."""
    ates_percent = _medians(cells, "ate")
    costs_ms = _medians(cells, "cpu_ms")
    memory_mib = _medians(cells, "memory_mib")
    return Total(
        group=group,
        estimator=cells[0].estimator,
        claims=cells[0].claims,
        place=standing.place,
        places=standing.places,
        score=1.0 - standing.loss,
        loss_ratio=standing.loss_ratio,
        ratio_interval=standing.ratio_interval,
        p_above=standing.p_above,
        decided_above=standing.decided_above,
        repeats=standing.repeats,
        trials=sum(cell.trials for cell in cells),
        failed=sum(cell.failed for cell in cells),
        cases=len(cells),
        ate_percent=median(ates_percent) if ates_percent else None,
        mean_place=mean_place,
        cpu_ms=fmean(costs_ms) if costs_ms else None,
        memory_mib=max(memory_mib, default=None),
    )


def _medians(cells: Sequence[Cell], metric: str) -> list[float]:
    """The median of a metric in each cell that has it."""
    spreads = [cell.spread(metric) for cell in cells]
    return [spread[0] for spread in spreads if spread is not None]


def _mark_efficient(totals: Sequence[Total]) -> list[Total]:
    """The same totals, marked as efficient if no estimator with a better score used less CPU time."""
    best_first = sorted(totals, key=lambda total: (-total.score, _cpu_ms(total)))
    least_ms = inf
    efficient = set[str]()
    for total in best_first:
        if _cpu_ms(total) < least_ms:
            least_ms = _cpu_ms(total)
            efficient.add(total.estimator)
    return [replace(total, is_efficient=total.estimator in efficient) for total in totals]


def _cpu_ms(total: Total) -> float:
    return inf if total.cpu_ms is None else total.cpu_ms
