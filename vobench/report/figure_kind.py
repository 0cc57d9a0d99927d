"""The kinds of figures, drawn from a run or from files of trajectories."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from typing import TYPE_CHECKING

from vobench.errors import InputError, UnknownNameError, require_known, unknown_name_sentence
from vobench.report.board_table import DEFAULT_METRIC
from vobench.report.breakdown_figure import breakdown_figure
from vobench.report.cost_figure import cost_figure
from vobench.report.cumulative_figure import cumulative_figure, pose_distributions, trial_distributions
from vobench.report.error_figure import error_figure
from vobench.report.estimator_order import estimator_positions
from vobench.report.figure_style import COLUMN_INCHES, PAGE_INCHES, Abscissa
from vobench.report.matrix_figure import matrix_figure
from vobench.report.page import run_board
from vobench.report.path_figure import axes_figure, path_figure
from vobench.report.scored_case import ScoredCase, scored_case
from vobench.report.segment_figure import segment_figure
from vobench.report.strip_figure import strip_figure
from vobench.report.trial_choice import pick
from vobench.runner.folder import NOT_APPLICABLE, RunFolder, TrialScore, with_sequence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vobench.report.leaderboard import Board

RUN_KINDS: Mapping[str, str] = {
    "path": "trajectories from above, of one case",
    "axes": "x, y and z over time, of one case",
    "error": "position and rotation errors over time or path, of one case",
    "segments": "box plots of segment errors per length, as of KITTI",
    "cumulative": "share of trials with at most an error, as of ETH3D",
    "breakdown": "score over the severity of each scenario",
    "cost": "error over CPU time per frame",
    "matrix": "cases × estimators as a heat map",
    "strip": "pictures of one trial with its tracks and failures, above its error",
}
BOARD_KINDS = ("cumulative", "breakdown", "cost", "matrix")
WIDE_KINDS = ("breakdown", "strip")
MOST_COLUMNS = 5  # of a matrix that is as wide as a column of a paper
FILE_KINDS = ("path", "axes", "error", "segments", "cumulative")


@dataclass(frozen=True, slots=True)
class FigureOptions:
    """Options of figures: their width, what errors are drawn over, and the metric of the matrix.

    Without a width, a figure is as wide as a column of a paper, or as a page if it needs that.
    """

    width_inches: float | None = None
    over: Abscissa = "time"
    metric: str = DEFAULT_METRIC

    def width_of(self, kind: str) -> float:
        """The width of a figure of a kind in inches."""
        if self.width_inches is not None:
            return self.width_inches
        return PAGE_INCHES if kind in WIDE_KINDS else COLUMN_INCHES


DEFAULTS = FigureOptions()


class FileFigures:
    """The figures of files of estimates with their ground truth."""

    kinds = FILE_KINDS

    def __init__(self, case: ScoredCase, options: FigureOptions = DEFAULTS) -> None:
        self._case = case
        self._options = options

    def draw(self, kind: str) -> "Figure":
        """The figure of a kind. Raises UnknownNameError, and InputError if there is nothing to draw."""
        require_known("kind of figure for files", kind, FILE_KINDS)
        if kind == "segments":
            return segment_figure([self._case], self._options.width_of(kind))
        if kind == "cumulative":
            return cumulative_figure(pose_distributions(self._case), self._options.width_of(kind), over_trials=False)
        return _case_figure(kind, self._case, self._options)


class RunFigures:
    """The figures of a run, or of some of its cases and estimators.

    Figures of one case show the first case that was named, or else that of the trial that is most worth a look.
    An estimator has the same colour in all figures of a run. It is chosen by the position in the suite's list of
    estimators, so that further estimators at the end of the list do not change it.
    """

    kinds = tuple(RUN_KINDS)

    def __init__(
        self,
        folder: RunFolder,
        *,
        cases: Sequence[str] = (),
        estimators: Sequence[str] = (),
        options: FigureOptions = DEFAULTS,
    ) -> None:
        """`cases` and `estimators` are names or patterns such as `"room-*"`; without any, all are chosen.

        Raises InputError if the folder is not a run, and UnknownNameError for a name that the run does not have.
        """
        scores = with_sequence(folder.scores())
        self._folder = folder
        self._options = options
        self._cases = _matching("case", cases, sorted({score.case for score in scores}))
        self._index_of = estimator_positions(folder.estimator_labels(), [score.estimator for score in scores])
        self._estimators = _matching("estimator", estimators, list(self._index_of))
        self._scores = [score for score in scores if score.case in self._cases and score.estimator in self._estimators]
        if not self._scores:
            raise InputError(f"no trial of these cases and estimators is in the run {folder.path}")
        self._is_case_named = bool(cases)

    def draw(self, kind: str) -> "Figure":
        """The figure of a kind. Raises UnknownNameError, and InputError if the run has nothing to draw."""
        require_known("kind of figure", kind, RUN_KINDS)
        if kind in BOARD_KINDS:
            return self._board_figure(kind)
        if kind == "segments":
            cases = [self._scored_case(case) for case in self._applicable_cases()]
            return segment_figure(cases, self._options.width_of(kind))
        if kind == "strip":
            trial = self._telling_trial()
            index = self._index_of[trial.estimator]
            return strip_figure(self._folder, trial, index, self._options.width_of(kind))
        return _case_figure(kind, self.case(), self._options)

    def _board_figure(self, kind: str) -> "Figure":
        """A figure of the board's numbers."""
        width_inches = self._options.width_of(kind)
        if kind == "cumulative":
            distributions = trial_distributions(self._board.cells, self._index_of)
            return cumulative_figure(distributions, width_inches, over_trials=True)
        if kind == "breakdown":
            return breakdown_figure(self._board.cells, self._index_of, width_inches)
        if kind == "cost":
            return cost_figure(self._board.totals, self._index_of, width_inches)
        if self._options.width_inches is None and len(self._board.estimators) > MOST_COLUMNS:
            width_inches = PAGE_INCHES
        return matrix_figure(self._board, self._options.metric, width_inches)

    @cached_property
    def _board(self) -> "Board":
        return run_board(self._folder, self._scores)

    def case(self) -> ScoredCase:
        """The case that figures of one case show."""
        return self._scored_case(self._telling_case())

    def _applicable_cases(self) -> list[str]:
        """The cases for which one of the estimators is. Raises InputError if there is none."""
        applicable = {score.case for score in self._scores if score.status != NOT_APPLICABLE}
        if not applicable:
            raise InputError("none of these estimators is for one of these cases: they lack a sensor that it needs")
        return [case for case in self._cases if case in applicable]

    def _scored_case(self, case: str) -> ScoredCase:
        trials = [score for score in self._scores if score.case == case]
        return scored_case(self._folder, trials, self._index_of)

    def _telling_case(self) -> str:
        """The first case that was named, or else that of the trial that is most worth a look."""
        return self._cases[0] if self._is_case_named else self._telling_trial().case

    def _telling_trial(self) -> TrialScore:
        """The trial that is most worth a look, of the first case if one was named."""
        case = self._cases[0] if self._is_case_named else None
        return pick(self._scores, case=case, estimator=None)


def _case_figure(kind: str, case: ScoredCase, options: FigureOptions) -> "Figure":
    """A figure of one case."""
    if kind == "path":
        return path_figure(case, options.width_of(kind))
    if kind == "axes":
        return axes_figure(case, options.width_of(kind))
    return error_figure(case, options.width_of(kind), over=options.over)


def _matching(kind: str, patterns: Sequence[str], known: Sequence[str]) -> list[str]:
    """The known names that match a pattern, in the order of the patterns; all if there is none.

    Raises UnknownNameError for a pattern that matches no name.
    """
    if not patterns:
        return list(known)
    chosen = dict[str, None]()
    for pattern in patterns:
        matching = [name for name in known if fnmatchcase(name, pattern)]
        if not matching:
            raise UnknownNameError(unknown_name_sentence(kind, pattern, list(known)))
        chosen.update(dict.fromkeys(matching))
    return list(chosen)
