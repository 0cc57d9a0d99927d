"""Estimators ranked over the cases that all of them have, with the score and the cost of each."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from statistics import fmean, median

import numpy as np

from vobench.errors import counted
from vobench.metric import ranking
from vobench.metric.unit import Design, make_design
from vobench.report.cell import Cell
from vobench.report.division import is_ranked
from vobench.runner.folder import NOT_APPLICABLE

CHOSEN_RATIO = 1.5  # the ratio of losses for which a board reports how many places are needed to detect it


@dataclass(frozen=True, slots=True)
class Total:
    """The rank, score and cost of one estimator over the cases of a division that every ranked estimator has.

    `group` is the label of the division.
    `estimator` is the name of the estimator.
    `claims` are the claims of its manifest.
    `rank` is its rank in the division, or None for baselines and oracles, which are not ranked.
    `ranks` is the 95 % confidence interval of the rank, or None if nothing is tested.
    `score` is the lost-aware score, which is 1 minus the geometric mean of the losses.
    `error_ratio` is the error relative to that of the first-ranked estimator, on cases where neither estimator fails.
    `error_interval` is the 95 % confidence interval of `error_ratio`.
    `p_above` is the p-value of the test against the estimator above, corrected for the number of such tests.
    `decided_above` is whether this test is significant, or None if nothing is tested.
    `smallest_ratio` is the smallest ratio of losses to the estimator above that this test detects in 95 % of runs.
    `places_needed` is the number of places that are needed to detect a ratio of losses of CHOSEN_RATIO.
    `trials` is the number of trials.
    `failed` is the number of trials that failed.
    `cases` is the number of cases of the trials.
    `drives` is the number of drives of the trials.
    `places` is the number of places of the trials.
    `ate_percent` is the median ATE over cases, in percent of the length of the path.
    `cpu_ms` is the mean CPU time per frame over cases, in milliseconds.
    `memory_mib` is the largest memory of any case, in MiB.
    `is_efficient` is whether no ranked estimator with a better score used less CPU time.
    `machine` is a letter for the machine that took the times, on a board with several machines; empty on others.
    """

    group: str
    estimator: str
    claims: tuple[str, ...]
    rank: int | None
    ranks: tuple[int, int] | None
    score: float
    error_ratio: float | None
    error_interval: tuple[float, float] | None
    p_above: float | None
    decided_above: bool | None
    smallest_ratio: float | None
    places_needed: int | None
    trials: int
    failed: int
    cases: int
    drives: int
    places: int
    ate_percent: float | None
    cpu_ms: float | None
    memory_mib: float | None
    is_efficient: bool = False
    machine: str = ""


def ranked_table(cells: Sequence[Cell]) -> tuple[list[str], ranking.TrialTable | None]:
    """The sorted names of the ranked estimators of a division, and the table of their trials.

    The table covers the cases that all ranked estimators have. It is None if there is no such case.
    """
    ranked = [cell for cell in _applicable(cells) if is_ranked(cell)]
    names = sorted({cell.estimator for cell in ranked})
    cells_by_case = _grouped(ranked, lambda cell: cell.case)
    shared_cases = _shared_cases(cells_by_case, len(names))
    if not shared_cases:
        return names, None
    shared = set(shared_cases)
    shared_cells = [cell for cell in ranked if cell.case in shared]
    cells_by_estimator = _grouped(shared_cells, lambda cell: cell.estimator)
    design = _design([cells_by_case[case][0] for case in shared_cases])
    return names, _trial_table(cells_by_estimator, names, shared_cases, design)


def rank_division(label: str, cells: Sequence[Cell], *, is_sequential: bool = False) -> tuple[list[Total], list[str]]:
    """The totals of a division, the best estimator first, and remarks on what they cover.

    Baselines and oracles have no rank, and follow the ranked estimators. If no estimator of the division can be ranked,
    all of its estimators are listed without a rank.

    `is_sequential` is whether the number of units was chosen during the run, depending on the results so far.

    Cases without a sensor that an estimator requires are excluded for that estimator. If no case has it, the
    estimator counts as failed.
    """
    applicable = _applicable(cells)
    ranked = [cell for cell in applicable if is_ranked(cell)]
    competitors = ranked or applicable
    names = sorted({cell.estimator for cell in competitors})
    cells_by_case = _grouped(competitors, lambda cell: cell.case)
    shared_cases = _shared_cases(cells_by_case, len(names))
    remarks = []
    if len(shared_cases) < len(cells_by_case):
        remarks.append(_shared_cases_remark(competitors, shared=len(shared_cases), cases=len(cells_by_case)))
    if not shared_cases:
        return [], remarks

    if ranked:
        ranked_names = names
        unranked_names = _unranked_with_all(applicable, shared_cases)
    else:
        ranked_names = []
        unranked_names = names
    design = _design([cells_by_case[case][0] for case in shared_cases])
    totals = _totals(
        label,
        applicable,
        shared_cases,
        design,
        ranked=ranked_names,
        unranked=unranked_names,
        is_sequential=is_sequential,
    )
    if len(ranked_names) > 1:
        remarks += _untested_remark(design)
    return _mark_efficient(totals), remarks


def _totals(
    label: str,
    cells: Sequence[Cell],
    cases: Sequence[str],
    design: Design,
    *,
    ranked: Sequence[str],
    unranked: Sequence[str],
    is_sequential: bool,
) -> list[Total]:
    """The totals of the ranked estimators by rank, followed by those of the unranked estimators by score."""
    shared = set(cases)
    shared_cells = [cell for cell in cells if cell.case in shared]
    cells_by_estimator = _grouped(shared_cells, lambda cell: cell.estimator)

    def total_of(name: str, standing: ranking.Standing, *, has_rank: bool) -> Total:
        return _total(label, cells_by_estimator[name], standing, design, has_rank=has_rank)

    totals = list[Total]()
    first_ranked: list[str] = []  # the name of the first-ranked estimator, if any estimator is ranked
    if ranked:
        table = _trial_table(cells_by_estimator, ranked, cases, design, is_sequential=is_sequential)
        for standing in ranking.rank(table):
            totals.append(total_of(ranked[standing.index], standing, has_rank=True))
        first_ranked = [totals[0].estimator]

    others = list[Total]()
    for name in unranked:
        table = _trial_table(cells_by_estimator, [*first_ranked, name], cases, design, is_sequential=is_sequential)
        standing = ranking.beside(table)
        others.append(total_of(name, standing, has_rank=False))
    return totals + sorted(others, key=lambda total: -total.score)


def _shared_cases(cells_by_case: Mapping[str, Sequence[Cell]], estimator_count: int) -> list[str]:
    """The cases that have a cell of every estimator."""
    return [case for case, cells in cells_by_case.items() if len(cells) == estimator_count]


def _unranked_with_all(cells: Sequence[Cell], cases: Sequence[str]) -> list[str]:
    """The names of the unranked estimators that have all of the cases."""
    unranked_cells = [cell for cell in cells if not is_ranked(cell)]
    cells_by_estimator = _grouped(unranked_cells, lambda cell: cell.estimator)
    names = []
    for name, members in sorted(cells_by_estimator.items()):
        if {cell.case for cell in members} >= set(cases):
            names.append(name)
    return names


def _design(cells: Sequence[Cell]) -> Design:
    """The place and the drive of each case, given one cell of each case.

    A case whose place is unknown counts as a separate place.
    """
    places = [cell.facts.place or f"case {cell.case}" for cell in cells]
    drives = [cell.facts.drive for cell in cells]
    return make_design(places, drives)


def _applicable(cells: Sequence[Cell]) -> list[Cell]:
    """The cells that count for the totals.

    A cell whose case lacks a required sensor is excluded, unless all cells of its estimator are of this kind.
    """
    applicable_estimators = {cell.estimator for cell in cells if cell.status != NOT_APPLICABLE}
    applicable = []
    for cell in cells:
        is_excluded = cell.status == NOT_APPLICABLE and cell.estimator in applicable_estimators
        if not is_excluded:
            applicable.append(cell)
    return applicable


def _grouped(cells: Sequence[Cell], key: Callable[[Cell], str]) -> dict[str, list[Cell]]:
    """The cells grouped by a key. Groups and cells are in the order of the cells."""
    groups: dict[str, list[Cell]] = {}
    for cell in cells:
        groups.setdefault(key(cell), []).append(cell)
    return groups


def _shared_cases_remark(cells: Sequence[Cell], *, shared: int, cases: int) -> str:
    """The remark that not every estimator has every case. It names the estimator that has the fewest cases."""
    case_counts = Counter(cell.estimator for cell in cells)
    fewest = min(case_counts, key=lambda name: (case_counts[name], name))
    if not shared:
        return (
            f"No estimator is ranked because no case is shared by all estimators ({fewest} has {case_counts[fewest]})"
        )
    return f"Totals cover the {shared} of {cases} cases that all estimators share ({fewest} has {case_counts[fewest]})"


def _untested_remark(design: Design) -> list[str]:
    """The remark that there are too few drives or places for a test, or no remark if there are enough."""
    if design.drives >= ranking.MIN_DRIVES and design.places >= ranking.MIN_PLACES:
        return []
    available = f"{counted(design.drives, 'drive')} in {counted(design.places, 'place')}"
    required = f"{ranking.MIN_DRIVES} drives in {ranking.MIN_PLACES} places"
    return [f"Nothing is tested: {available}, and a test requires {required}; ranks hold for these cases only"]


def _trial_table(
    cells_by_estimator: Mapping[str, Sequence[Cell]],
    names: Sequence[str],
    cases: Sequence[str],
    design: Design,
    *,
    is_sequential: bool = False,
) -> ranking.TrialTable:
    """The table of the trials of the named estimators on the cases."""
    row_of = {name: row for row, name in enumerate(names)}
    column_of = {case: column for column, case in enumerate(cases)}
    cells = [cell for name in names for cell in cells_by_estimator[name]]
    repeats = max(cell.trials for cell in cells)
    losses = np.full((len(names), len(cases), repeats), np.nan)  # NaN for a trial that does not exist
    errors = losses.copy()
    for cell in cells:
        row = row_of[cell.estimator]
        column = column_of[cell.case]
        losses[row, column, : cell.trials] = cell.losses
        errors[row, column, : cell.trials] = cell.errors
    return ranking.TrialTable(losses, errors, design, is_sequential)


def _total(label: str, cells: Sequence[Cell], standing: ranking.Standing, design: Design, *, has_rank: bool) -> Total:
    """The total of one estimator, from its cells and its standing among the others."""
    ates_percent = _medians(cells, "ate")
    costs_ms = _medians(cells, "cpu_ms")
    memory_mib = _medians(cells, "memory_mib")
    return Total(
        group=label,
        estimator=cells[0].estimator,
        claims=cells[0].claims,
        rank=standing.rank if has_rank else None,
        ranks=standing.rank_interval,
        score=1.0 - standing.loss,
        error_ratio=standing.error_ratio,
        error_interval=standing.error_interval,
        p_above=standing.p_above,
        decided_above=standing.decided_above,
        smallest_ratio=standing.smallest_ratio,
        places_needed=standing.places_needed(CHOSEN_RATIO),
        trials=sum(cell.trials for cell in cells),
        failed=sum(cell.failed for cell in cells),
        cases=len(cells),
        drives=design.drives,
        places=design.places,
        ate_percent=median(ates_percent) if ates_percent else None,
        cpu_ms=fmean(costs_ms) if costs_ms else None,
        memory_mib=max(memory_mib, default=None),
    )


def _medians(cells: Sequence[Cell], metric: str) -> list[float]:
    """The median of a metric in each cell that has it."""
    spreads = [cell.spread(metric) for cell in cells]
    return [spread[0] for spread in spreads if spread is not None]


def _mark_efficient(totals: Sequence[Total]) -> list[Total]:
    """The same totals, marked as efficient if no ranked estimator with a better score used less CPU time."""
    ranked = [total for total in totals if total.rank is not None]
    best_first = sorted(ranked, key=lambda total: (-total.score, _cpu_ms(total)))
    lowest_ms = inf
    efficient = set[str]()
    for total in best_first:
        if _cpu_ms(total) < lowest_ms:
            lowest_ms = _cpu_ms(total)
            efficient.add(total.estimator)
    return [replace(total, is_efficient=total.estimator in efficient) for total in totals]


def _cpu_ms(total: Total) -> float:
    """The CPU time of an estimator per frame in milliseconds; infinite if it is unknown."""
    return inf if total.cpu_ms is None else total.cpu_ms
