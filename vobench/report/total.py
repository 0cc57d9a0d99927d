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

CHOSEN_RATIO = 1.5  # of losses, for which a board says how many places decide it


@dataclass(frozen=True, slots=True)
class Total:
    """One estimator over the cases of a division that every ranked estimator has: its rank, score and cost.

    `group` is the division's label. `score` is the lost-aware score, 1 minus the geometric mean of the losses.
    `ate_percent` is a median over cases. `error_ratio` is the error relative to the first-ranked estimator's on cases
    where both survive, with its confidence interval. `rank` is None for baselines and oracles, which are not ranked.
    `ranks`, its 95 % interval, and `decided_above` are None if nothing is tested. `smallest_ratio` of losses to the
    estimator above would have been decided, and `places_needed` would decide a ratio of 1.5. `is_efficient` states
    that no ranked estimator with a better score used less CPU time.
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


def ranked_table(cells: Sequence[Cell]) -> tuple[list[str], ranking.TrialTable | None]:
    """The ranked estimators of a division by name, and their trials on the cases that all of them have, if any."""
    ranked = [cell for cell in _applicable(cells) if is_ranked(cell)]
    names = sorted({cell.estimator for cell in ranked})
    by_case = _grouped(ranked, lambda cell: cell.case)
    common = [case for case, members in by_case.items() if len(members) == len(names)]
    if not common:
        return names, None
    by_estimator = _grouped([cell for cell in ranked if cell.case in set(common)], lambda cell: cell.estimator)
    design = _design([by_case[case][0] for case in common])
    return names, _trial_table(by_estimator, names, common, design)


def rank_division(label: str, cells: Sequence[Cell], *, is_sequential: bool = False) -> tuple[list[Total], list[str]]:
    """The totals of a division, the best estimator first, and remarks on what they cover.

    `is_sequential` states that the number of units depends on what they showed. Baselines and oracles follow without a
    rank. Cases without a sensor that an estimator requires are excluded for that estimator. If no case has it, the
    estimator counts as failed.
    """
    applicable = _applicable(cells)
    ranked = [cell for cell in applicable if is_ranked(cell)]
    competitors = ranked or applicable
    names = sorted({cell.estimator for cell in competitors})
    by_case = _grouped(competitors, lambda cell: cell.case)
    common = [case for case, members in by_case.items() if len(members) == len(names)]
    remarks = []
    if len(common) < len(by_case):
        remarks.append(_shared_cases_remark(competitors, shared=len(common), cases=len(by_case)))
    if not common:
        return [], remarks

    beside = _beside(applicable, common) if ranked else []
    ranked_names = names if ranked else []
    design = _design([by_case[case][0] for case in common])
    unranked = beside if ranked else names
    totals = _totals(
        label, applicable, common, design, ranked=ranked_names, unranked=unranked, is_sequential=is_sequential
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
    """The totals of the ranked estimators in their order, then those of the others by score."""
    shared = set(cases)
    by_estimator = _grouped([cell for cell in cells if cell.case in shared], lambda cell: cell.estimator)

    def total_of(name: str, standing: ranking.Standing, *, has_rank: bool) -> Total:
        return _total(label, by_estimator[name], standing, design, has_rank=has_rank)

    totals = list[Total]()
    first: list[str] = []
    if ranked:
        table = _trial_table(by_estimator, ranked, cases, design, is_sequential=is_sequential)
        for standing in ranking.rank(table):
            totals.append(total_of(ranked[standing.index], standing, has_rank=True))
        first = [totals[0].estimator]

    others = list[Total]()
    for name in unranked:
        table = _trial_table(by_estimator, [*first, name], cases, design, is_sequential=is_sequential)
        standing = ranking.beside(table)
        others.append(total_of(name, standing, has_rank=False))
    return totals + sorted(others, key=lambda total: -total.score)


def _beside(cells: Sequence[Cell], cases: Sequence[str]) -> list[str]:
    """The unranked estimators that have all of the cases."""
    cases_of = _grouped([cell for cell in cells if not is_ranked(cell)], lambda cell: cell.estimator)
    names = []
    for name, members in sorted(cases_of.items()):
        if {cell.case for cell in members} >= set(cases):
            names.append(name)
    return names


def _design(cells: Sequence[Cell]) -> Design:
    """Where the cases take place, by one cell of each; a case of an unknown place is a place of its own."""
    places = [cell.facts.place or f"case {cell.case}" for cell in cells]
    drives = [cell.facts.drive for cell in cells]
    return make_design(places, drives)


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


def _untested_remark(design: Design) -> list[str]:
    """The remark that there are too few drives or places for a test."""
    if design.drives >= ranking.MIN_DRIVES and design.places >= ranking.MIN_PLACES:
        return []
    seen = f"{counted(design.drives, 'drive')} in {counted(design.places, 'place')}"
    required = f"{ranking.MIN_DRIVES} drives in {ranking.MIN_PLACES} places"
    return [f"Nothing is tested: {seen}, and a test requires {required}; ranks hold for these cases only"]


def _trial_table(
    by_estimator: Mapping[str, Sequence[Cell]],
    names: Sequence[str],
    cases: Sequence[str],
    design: Design,
    *,
    is_sequential: bool = False,
) -> ranking.TrialTable:
    """The trials of some estimators on the cases."""
    row_of = {name: row for row, name in enumerate(names)}
    column_of = {case: column for column, case in enumerate(cases)}
    cells = [cell for name in names for cell in by_estimator[name]]
    repeats = max(cell.trials for cell in cells)
    losses = np.full((len(names), len(cases), repeats), np.nan)
    errors = losses.copy()
    for cell in cells:
        index = row_of[cell.estimator], column_of[cell.case]
        losses[index][: cell.trials] = cell.losses
        errors[index][: cell.trials] = cell.errors
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
        rank=standing.place if has_rank else None,
        ranks=standing.places,
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
    least_ms = inf
    efficient = set[str]()
    for total in best_first:
        if _cpu_ms(total) < least_ms:
            least_ms = _cpu_ms(total)
            efficient.add(total.estimator)
    return [replace(total, is_efficient=total.estimator in efficient) for total in totals]


def _cpu_ms(total: Total) -> float:
    return inf if total.cpu_ms is None else total.cpu_ms
