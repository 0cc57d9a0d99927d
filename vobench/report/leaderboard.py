"""The leaderboard: scores as one table of cells, case × estimator, with totals, breakdown curves and remarks."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from vobench.report.board_metric import METRICS
from vobench.report.breakdown import BreakdownCurve, breakdown_curves
from vobench.report.cell import CaseFacts, Cell, make_cell, trials_by_cell
from vobench.report.division import divisions, truth_copy_remarks, with_truth_copies
from vobench.report.frame_statistics import EstimatorStatistics, StatisticsByCell
from vobench.report.pair_sentence import named_pairs
from vobench.report.total import Total, rank_division
from vobench.runner.environment import Environment
from vobench.runner.folder import (
    NOT_DETERMINISTIC,
    TrialScore,
    UnavailableCases,
    unavailable_cases,
    visible_to,
    with_sequence,
)


@dataclass(frozen=True, slots=True)
class Board:
    """The table of cells with the totals and curves derived from it; `remarks` state what the numbers do not show.

    `visible` states what the estimators could access. `unmade` are the cases that could not be simulated or imported:
    they have no cells and count for no estimator. `environment` is where the numbers come from, as far as it is known.
    """

    title: str
    cells: tuple[Cell, ...]
    totals: tuple[Total, ...]
    curves: tuple[BreakdownCurve, ...]
    remarks: tuple[str, ...]
    unmade: tuple[UnavailableCases, ...] = ()
    environment: Environment | None = None
    visible: str = ""
    _cell_of: dict[tuple[str, str], Cell] = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        self._cell_of.update({(cell.case, cell.estimator): cell for cell in self.cells})

    def cell(self, case: str, estimator: str) -> Cell | None:
        """The cell of a case and an estimator, None if there is no such trial."""
        return self._cell_of.get((case, estimator))

    @property
    def cases(self) -> list[str]:
        """The names of all cases."""
        return list(dict.fromkeys(cell.case for cell in self.cells))

    @property
    def estimators(self) -> list[str]:
        """The names of all estimators, the best first."""
        ranked = [total.estimator for total in self.totals]
        return list(dict.fromkeys([*ranked, *(cell.estimator for cell in self.cells)]))

    @property
    def metrics(self) -> list[str]:
        """The metrics that at least one cell has."""
        return [name for name in METRICS if self._has(name)]

    def _has(self, metric: str) -> bool:
        return any(cell.spread(metric) for cell in self.cells)


def make_board(
    scores: Iterable[TrialScore],
    answered: StatisticsByCell,
    facts: Mapping[str, CaseFacts] | None = None,
    *,
    title: str = "",
    environment: Environment | None = None,
    remarks: Sequence[str] = (),
    refuted: Collection[str] = (),
    until_ratio: float | None = None,
) -> Board:
    """The board of trials.

    `answered` are the statistics of frames by case and estimator, `facts` those of cases; entries may be missing.
    `remarks` are shown before all others.
    `refuted` are the estimators that claim to be deterministic, but gave different estimates for one sequence. Their
    cells state that they are not deterministic.
    `until_ratio` is the ratio of losses up to which two estimators count as equivalent in a sequential run. Tests and
    intervals then remain valid whenever the run stops.
    """
    scores = list(scores)
    unmade = unavailable_cases(scores)
    trials = list(with_sequence(scores))
    cells = [_corrected(cell, refuted) for cell in make_cells(trials, answered, facts or {})]
    all_remarks = [
        *remarks,
        *truth_copy_remarks(trials),
        *_unmade_remark(unmade, cases=len({score.case for score in scores})),
    ]

    totals, division_remarks = _rank(cells, is_sequential=until_ratio is not None)
    all_remarks += _until_remarks(cells, until_ratio)
    all_remarks += division_remarks
    all_remarks += _truth_noise_remarks(cells)
    return Board(
        title=title,
        cells=tuple(cells),
        totals=tuple(totals),
        curves=tuple(breakdown_curves(cells)),
        remarks=tuple(all_remarks),
        unmade=unmade,
        environment=environment,
        visible=visible_to(trials),
    )


def _rank(cells: Sequence[Cell], *, is_sequential: bool) -> tuple[list[Total], list[str]]:
    """The totals of every division, and the remarks on them; a remark that holds for all of them is made once."""
    cells_of = divisions(cells)
    totals = list[Total]()
    labels_of: dict[str, list[str]] = {}
    for division, division_cells in cells_of.items():
        label = division.label(list(cells_of))
        division_totals, remarks = rank_division(label, division_cells, is_sequential=is_sequential)
        totals += division_totals
        for remark in remarks:
            labels_of.setdefault(remark, []).append(label)

    sentences = []
    for remark, labels in labels_of.items():
        is_general = len(labels) == len(cells_of)
        sentences.append(remark if is_general else f"{remark} ({'; '.join(labels)})")
    return totals, sentences


def _corrected(cell: Cell, refuted: Collection[str]) -> Cell:
    """The cell, which states that its estimator is not deterministic if it is one of those refuted."""
    if cell.estimator not in refuted:
        return cell
    return replace(cell, claims=(*cell.claims, NOT_DETERMINISTIC))


def make_cells(trials: Iterable[TrialScore], answered: StatisticsByCell, facts: Mapping[str, CaseFacts]) -> list[Cell]:
    """One cell for each case and estimator, in order of their names. A truth copy is one in all of its cells."""
    marked_trials = with_truth_copies(list(trials))
    cells = []
    for (case, estimator), members in trials_by_cell(marked_trials, facts).items():
        statistics = answered.get((case, estimator), EstimatorStatistics())
        cells.append(make_cell(members, statistics, facts.get(case, facts.get(members[0].case, CaseFacts()))))
    return cells


def _unmade_remark(unmade: Sequence[UnavailableCases], *, cases: int) -> list[str]:
    """One sentence on the cases that could not be simulated or imported, with each cause once."""
    if not unmade:
        return []
    count = sum(len(group.cases) for group in unmade)
    causes = "; ".join(f"{group.names}: {group.cause}" for group in unmade)
    return [f"{count} of {cases} cases could not be simulated or imported and count for no estimator: {causes}"]


def _until_remarks(cells: Sequence[Cell], ratio: float | None) -> list[str]:
    """How units were drawn and what that means for tests, and one sentence for each pair; nothing for other runs."""
    if ratio is None:
        return []
    pairs = named_pairs(cells, ratio=ratio)
    drawn = f"Units were drawn until each pair was decided or alike within {ratio:g} ×"
    meaning = "all intervals hold together at 98 %, whenever one stops"
    return [f"{drawn}; {meaning}", *(pair.sentence for pair in pairs)]


def _truth_noise_remarks(cells: Iterable[Cell]) -> list[str]:
    """One sentence for each noise of the ground truth that scores are computed with."""
    noises = {cell.facts.truth_noise for cell in cells if cell.facts.truth_noise}
    return sorted(f"The ground truth used for scoring is perturbed by {noise}" for noise in noises)
