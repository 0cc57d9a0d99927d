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
    """The table of cells, with the totals and curves that are derived from it.

    `title` is the title of the board.
    `cells` are the cells, each of one case and one estimator.
    `totals` are the totals of the estimators by division, the best estimator first.
    `curves` are the breakdown curves.
    `remarks` are sentences about what the numbers do not show.
    `unmade` are the cases that could not be simulated or imported. They have no cells and count for no estimator.
    `environment` describes the machine and the versions that the numbers come from, or is None if they are unknown.
    `visible` is a sentence about what the estimators could access.
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
        """The names of all estimators: the best first, then those without a rank."""
        ranked = [total.estimator for total in self.totals if total.rank is not None]
        all_totals = [total.estimator for total in self.totals]
        without_total = [cell.estimator for cell in self.cells]
        return list(dict.fromkeys([*ranked, *all_totals, *without_total]))

    @property
    def metrics(self) -> list[str]:
        """The metrics that at least one cell has."""
        return [name for name in METRICS if self._has(name)]

    def _has(self, metric: str) -> bool:
        return any(cell.spread(metric) for cell in self.cells)


def make_board(
    scores: Iterable[TrialScore],
    frame_statistics: StatisticsByCell,
    facts: Mapping[str, CaseFacts] | None = None,
    *,
    title: str = "",
    environment: Environment | None = None,
    remarks: Sequence[str] = (),
    not_deterministic: Collection[str] = (),
    until_ratio: float | None = None,
) -> Board:
    """The board of trials.

    `scores` are the scores of the trials.
    `frame_statistics` are the statistics of frames by case and estimator. Entries may be missing.
    `facts` are the facts of cases by name. Entries may be missing.
    `title` is the title of the board.
    `environment` describes the machine and the versions that the numbers come from, or is None if they are unknown.
    `remarks` are shown before all others.
    `not_deterministic` are the estimators that claim to be deterministic, but gave different estimates for one
    sequence. Their cells state that they are not deterministic.
    `until_ratio` is the ratio of losses up to which two estimators count as equivalent in a sequential run. Tests and
    intervals then remain valid whenever the run stops.
    """
    scores = list(scores)
    unavailable = unavailable_cases(scores)
    trials = list(with_sequence(scores))
    claimed_cells = make_cells(trials, frame_statistics, facts or {})
    cells = [_corrected(cell, not_deterministic) for cell in claimed_cells]
    case_names = {score.case for score in scores}
    all_remarks = [
        *remarks,
        *truth_copy_remarks(trials),
        *_unavailable_remark(unavailable, cases=len(case_names)),
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
        unmade=unavailable,
        environment=environment,
        visible=visible_to(trials),
    )


def _rank(cells: Sequence[Cell], *, is_sequential: bool) -> tuple[list[Total], list[str]]:
    """The totals of all divisions, and the remarks on them.

    A remark is listed once. It ends with the labels of its divisions, unless it is about all of them.
    """
    cells_by_division = divisions(cells)
    totals = list[Total]()
    labels_by_remark = dict[str, list[str]]()
    for division, division_cells in cells_by_division.items():
        label = division.label(list(cells_by_division))
        division_totals, remarks = rank_division(label, division_cells, is_sequential=is_sequential)
        totals += division_totals
        for remark in remarks:
            labels_by_remark.setdefault(remark, []).append(label)

    sentences = []
    for remark, labels in labels_by_remark.items():
        is_general = len(labels) == len(cells_by_division)
        if is_general:
            sentences.append(remark)
        else:
            sentences.append(f"{remark} ({'; '.join(labels)})")
    return totals, sentences


def _corrected(cell: Cell, not_deterministic: Collection[str]) -> Cell:
    """The cell. It states that its estimator is not deterministic if this is one of `not_deterministic`."""
    if cell.estimator not in not_deterministic:
        return cell
    return replace(cell, claims=(*cell.claims, NOT_DETERMINISTIC))


def make_cells(
    trials: Iterable[TrialScore],
    frame_statistics: StatisticsByCell,
    facts: Mapping[str, CaseFacts],
) -> list[Cell]:
    """One cell for each case and estimator, in the order of their names.

    An estimator that copies the truth is marked as a truth copy in all of its cells.

    `frame_statistics` are the statistics of frames by case and estimator. Entries may be missing.
    `facts` are the facts of cases by name. Entries may be missing.
    """
    marked_trials = with_truth_copies(list(trials))
    cells = []
    for (case, estimator), members in trials_by_cell(marked_trials, facts).items():
        statistics = frame_statistics.get((case, estimator), EstimatorStatistics())
        facts_of_first_trial = facts.get(members[0].case, CaseFacts())
        case_facts = facts.get(case, facts_of_first_trial)
        cells.append(make_cell(case, members, statistics, case_facts))
    return cells


def _unavailable_remark(unavailable: Sequence[UnavailableCases], *, cases: int) -> list[str]:
    """The sentence about the cases that could not be simulated or imported, or no sentence if there are none."""
    if not unavailable:
        return []
    count = sum(len(group.cases) for group in unavailable)
    causes = "; ".join(f"{group.names}: {group.cause}" for group in unavailable)
    return [f"{count} of {cases} cases could not be simulated or imported and count for no estimator: {causes}"]


def _until_remarks(cells: Sequence[Cell], ratio: float | None) -> list[str]:
    """The sentences about a sequential run: how units were drawn, and the result of each pair of estimators.

    `ratio` is the ratio of losses up to which two estimators count as equivalent, or None if the run is not sequential.
    There are no sentences then.
    """
    if ratio is None:
        return []
    pairs = named_pairs(cells, ratio=ratio)
    drawn = f"Units were drawn until each pair was decided or alike within {ratio:g} ×"
    meaning = "all intervals hold together at 98 %, whenever one stops"
    return [f"{drawn}; {meaning}", *(pair.sentence for pair in pairs)]


def _truth_noise_remarks(cells: Iterable[Cell]) -> list[str]:
    """One sentence for each kind of noise that was added to the ground truth before scoring."""
    noises = {cell.facts.truth_noise for cell in cells if cell.facts.truth_noise}
    return sorted(f"The ground truth used for scoring is perturbed by {noise}" for noise in noises)
