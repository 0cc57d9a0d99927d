"""Suites from Python: validate one, run it, and look at its results."""

import fnmatch
import html
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from vobench.errors import InputError, UnknownNameError, unknown_name_sentence
from vobench.notebook.class_source import write_estimator
from vobench.notebook.display import choose_display
from vobench.report.figure_style import Abscissa
from vobench.runner.folder import open_run
from vobench.runner.launch import run_plan
from vobench.runner.motion import cut
from vobench.runner.preflight import PlanSummary, summarize
from vobench.suite.draw import Draws
from vobench.suite.plan import Plan
from vobench.suite.suite import read_plan

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from vobench.report.compare import ScoreChange
    from vobench.report.leaderboard import Board
    from vobench.runner.folder import RunFolder
    from vobench.runner.run import Finish

Names = str | Iterable[str]
Estimators = str | type | Iterable[str | type]
RUNS = Path("runs")


class Run:
    """A finished run of a suite, by its folder: tables, plots and recordings of its trials."""

    def __init__(self, path: Path | str) -> None:
        """The run in a folder, or the latest run in the folder of a suite. Raises InputError if there is no run."""
        self._folder = open_run(Path(path))
        self._scores = self._folder.scores()

    @property
    def path(self) -> Path:
        """The folder of the run."""
        return self._folder.path

    @cached_property
    def board(self) -> "pd.DataFrame":
        """The leaderboard: one row per estimator over all cases, the best first."""
        from vobench.report.run_tables import board_frame

        return board_frame(self._board)

    @cached_property
    def cells(self) -> "pd.DataFrame":
        """One row per case and estimator, with the median and range of each metric over its trials."""
        from vobench.report.run_tables import cell_frame

        return cell_frame(self._board)

    @cached_property
    def trials(self) -> "pd.DataFrame":
        """One row per trial: case, estimator, repeat, the choices that make the case, its seeds, status and metrics."""
        from vobench.report.case_facts import case_facts
        from vobench.report.run_tables import trial_frame

        facts = {case: case_facts(self._folder, case) for case in self.cases}
        return trial_frame(self._scores, facts)

    @cached_property
    def frames(self) -> "pd.DataFrame":
        """One row per frame of every trial: status, errors after alignment, tracks, exposure and cost."""
        from vobench.report.run_tables import frames_frame

        return frames_frame(self._folder, self._scores)

    @cached_property
    def pairs(self) -> "pd.DataFrame":
        """One row per pair of estimators: the comparison of their losses, in a run with `until="decided"`.

        `ratio` is the loss of the second estimator relative to that of the first.
        `low` and `high` are the ends of its confidence interval.
        Raises InputError if the run was not made with `until="decided"`.
        """
        import pandas as pd

        from vobench.report.pair_sentence import named_pairs
        from vobench.report.until_decided import recorded_ratio

        ratio = recorded_ratio(self._folder)
        if ratio is None:
            raise InputError(f"only a run with until='decided' has pairs: {self.path}")
        return pd.DataFrame([pair.as_dict() for pair in named_pairs(self._board.cells, ratio=ratio)])

    @property
    def cases(self) -> list[str]:
        """The names of the cases."""
        return list(dict.fromkeys(score.case for score in self._scores))

    @property
    def estimators(self) -> list[str]:
        """The labels of the estimators, the best first."""
        return self._board.estimators

    def case(self, name: str) -> Path:
        """The folder of a case, with its ground truth and its sequence. Raises UnknownNameError."""
        self._require("case", name, self.cases)
        return self._folder.case(name)

    def plot(
        self,
        case: str | None = None,
        *,
        kind: str | None = None,
        estimators: Names | None = None,
        over: Abscissa = "time",
        metric: str = "ate",
        width_inches: float | None = None,
    ) -> "Figure":
        """A figure of the run, of all or some estimators.

        Args:
            case: The case that is shown. Without it, figures of a `kind` show all cases, or the most informative one;
                the figure without a `kind` shows the first case.
            kind: One of those of `vobench plot`: path, axes, error, segments, cumulative, breakdown, cost, matrix or
                strip. Without it, paths in top view and errors over time are drawn.
            estimators: Names of the estimators that are shown; all by default.
            over: The axis over which errors are drawn: time or path.
            metric: The metric of the matrix.
            width_inches: The width of the figure; by default that of its kind.

        Raises:
            UnknownNameError: The run has no case or estimator with that name.
            InputError: There is nothing to draw.
        """
        from vobench.report.figure_kind import FigureOptions, RunFigures
        from vobench.report.trial_plot import plot_case

        names = () if estimators is None else listed(estimators)
        for name in names:
            self._require("estimator", name, self.estimators)
        if case is None and kind is None:
            case = self.cases[0]
        if case is not None:
            self._require("case", case, self.cases)
        cases = [] if case is None else [case]
        options = FigureOptions(width_inches=width_inches, over=over, metric=metric)
        figures = RunFigures(self._folder, cases=cases, estimators=names, options=options)
        return figures.draw(kind) if kind else plot_case(figures.case())

    def view(
        self,
        case: str | None = None,
        *,
        estimator: str | None = None,
        save: Path | str | None = None,
        web: bool = False,
    ) -> Path:
        """Write one trial as a Rerun recording, open it in the viewer, and return the path of the recording.

        If `case` and `estimator` are not given, the most severe failure is chosen. If no trial failed, the trial with
        the largest error is chosen.

        Args:
            case: The case of the trial.
            estimator: The estimator of the trial.
            save: The path to which the recording is written; no viewer is opened.
            web: Whether to serve the recording to a browser on this machine until interrupted.

        Raises:
            MissingDependencyError: There is no display.
            UnknownNameError: The run has no case or estimator with that name.
        """
        from vobench.report.viewer import open_viewer, save_recordings

        target = None if save is None else Path(save)
        recordings = save_recordings(self._folder, case=case, estimator=estimator, save=target)
        paths = [recording.path for recording in recordings]
        if save is None or web:
            open_viewer(paths, web=web)
        return paths[0]

    def __repr__(self) -> str:
        return f"Run({self.path}, {len(self._scores)} trials of {len(self.estimators)} estimators)"

    def _repr_html_(self) -> str:
        from vobench.report import board_table
        from vobench.report.board_metric import METRICS

        board = self._board
        title = METRICS[board_table.DEFAULT_METRIC].heading
        parts = [_html_table(["case", *self.estimators], _matrix_rows(board), title)]
        for scope, (headings, *rows) in board_table.totals(board):
            parts.append(_html_table(headings, rows, f"totals over {scope}"))
        sentences = [*board_table.board_notes(board), str(self.path)]
        parts += [f"<small>{html.escape(sentence)}</small><br>" for sentence in sentences]
        return "\n".join(parts)

    @cached_property
    def _board(self) -> "Board":
        from vobench.report import page

        return page.run_board(self._folder, self._scores)

    def _require(self, kind: str, name: str, known: Sequence[str]) -> str:
        if name not in known:
            raise UnknownNameError(f"{unknown_name_sentence(kind, name, list(known))} in the run {self.path}")
        return name


@dataclass(frozen=True, slots=True)
class Check:
    """A valid suite before it is run: tables of its cases and estimators, and the plan."""

    summary: PlanSummary

    @property
    def plan(self) -> Plan:
        """The plan: cases × estimators × repeats."""
        return self.summary.plan

    @property
    def cases(self) -> "pd.DataFrame":
        """One row per case: frames, seconds, and whether its sequence is in the cache."""
        import pandas as pd

        return pd.DataFrame([case.as_dict() for case in self.summary.cases])

    @property
    def estimators(self) -> "pd.DataFrame":
        """One row per estimator: version, the sensors that it needs, and its folder."""
        import pandas as pd

        return pd.DataFrame(self.summary.estimators())

    @property
    def tasks(self) -> "pd.DataFrame":
        """One row per stage: tasks, those to do, and an estimate of the seconds that they take on one core."""
        import pandas as pd

        return pd.DataFrame(self.summary.tasks())

    def __repr__(self) -> str:
        summary = self.summary
        return f"Check({summary.plan.suite.name}: {len(summary.cases)} cases, {summary.trials} trials)"

    def _repr_html_(self) -> str:
        title = f"<b>{html.escape(self.plan.suite.name)}</b>: {self.summary.trials} trials"
        tables = [table.to_html(index=False) for table in (self.cases, self.estimators, self.tasks)]
        return "\n".join([title, *tables])


def check(
    suite: str | Path,
    *,
    estimators: Estimators | None = None,
    only: Names | None = None,
    changes: Mapping[str, Any] | None = None,
) -> Check:
    """Validate a suite and report what a run of it would do; nothing is rendered.

    The options are those of `run`. Raises SuiteError, which lists every mistake, and UnknownNameError.
    """
    planned = plan(suite, estimators=estimators, only=only, changes=changes)
    return Check(summarize(planned, with_stages=True))


def run(
    suite: str | Path,
    *,
    estimators: Estimators | None = None,
    only: Names | None = None,
    changes: Mapping[str, Any] | None = None,
    jobs: int | None = None,
    out: Path | str = RUNS,
    frames: int | None = None,
    fresh: bool = False,
    quiet: bool = False,
    until: Literal["decided"] | None = None,
    ratio: float = 1.5,
    budget: str | None = None,
) -> Run:
    """Run a suite: simulate, estimate, score. Results that are in the cache are reused.

    Args:
        suite: A suite's name, or the path of its YAML file.
        estimators: Names, patterns, folders or classes of estimators to run instead of those of the suite. A class is
            saved as `estimators/<name>` in the working folder, where every command finds it.
        only: Patterns such as `"room-*"` that select cases, scenes or estimators of the suite.
        changes: Values to use instead of those of the suite, by key, as in
            `{"repeats": 3, "rigs.ahead.pitch_deg": 20}`.
        jobs: Number of simultaneous tasks; by default one per core, and at most 8.
        out: Parent folder of the folders of runs.
        frames: Number of frames of each simulated case, from the first one; all by default.
        fresh: Whether to recompute everything instead of using the cache.
        quiet: Whether to hide the progress.
        until: With "decided", fresh places are drawn until each pair of estimators is decided, or alike within the
            ratio; `Run.pairs` has the result for each pair. After an interruption, the same call resumes from the
            cache.
        ratio: With `until`, the ratio of losses that is of interest.
        budget: With `until`, the time after which no more places are drawn, as in "40min".

    Raises:
        SuiteError: The suite is wrong; the message lists every mistake. Or it has no places that can be drawn.
        UnknownNameError: No suite, case or estimator has that name.
        MissingDependencyError: This machine cannot draw.
    """
    from vobench.report import page

    _check_until(until, ratio, budget)

    def plan_of_draw(draw: int | None) -> Plan:
        planned = plan(suite, estimators=estimators, only=only, changes=changes, draw=draw)
        return planned if frames is None else cut(planned, frames)

    def run_in(planned: Plan, parent: Path, finish: "Finish") -> "RunFolder":
        display = choose_display(is_quiet=quiet)
        return run_plan(planned, out=parent, finish=finish, display=display, jobs=jobs, is_fresh=fresh)

    if until is None:
        return Run(run_in(plan_of_draw(None), Path(out), page.write_reports).path)

    from vobench.report.until_decided import parse_duration_s
    from vobench.report.until_decided_run import run_draws

    budget_s = inf if budget is None else parse_duration_s(budget)
    show_message = _ignore_message if quiet else print
    decided = run_draws(plan_of_draw, run_in, out=Path(out), ratio=ratio, budget_s=budget_s, tell=show_message)
    if not quiet:
        print(decided.cost)
    return Run(decided.folder.path)


def _check_until(until: str | None, ratio: float, budget: str | None) -> None:
    """Raise InputError if the options of `until` are invalid or do not fit together."""
    if until not in (None, "decided"):
        raise InputError(f"until should be 'decided' or None, got {until!r}")
    if until is None and budget is not None:
        raise InputError("budget requires until='decided'")
    if ratio <= 1:
        raise InputError(f"ratio should be above 1, got {ratio:g}")


def _ignore_message(message: str) -> None:
    del message


def read_run(path: Path | str) -> Run:
    """The run in a folder, or the latest of runs/<suite>. Raises InputError if the folder is not a run."""
    return Run(path)


def read_board(path: Path | str) -> "pd.DataFrame":
    """The leaderboard of a run's folder, or of the latest of runs/<suite>: one row per cell, then one per total.

    Raises InputError if the folder is not a run.
    """
    from vobench.report import board_records, page

    folder = open_run(Path(path))
    return board_records.data_frame(page.run_board(folder, folder.scores()))


def compare(old: Run | Path | str, new: Run | Path | str, *, at_most: float | None = None) -> "pd.DataFrame":
    """The changes of scores from one run to another: one row per estimator, then one per case and estimator.

    All trials are scored again from their estimates and ground truths. A UserWarning names those whose stored score
    differs.

    Args:
        old: The earlier run: a `Run`, its folder or a bundle.
        new: The later run.
        at_most: The largest ratio of losses that does not count as worse.

    Raises:
        InputError: The two runs have nothing in common, or have different cases with the same name.
    """
    import pandas as pd

    from vobench.report.run_comparison import compare_runs

    notes: list[str] = []
    comparison = compare_runs(run_path(old), run_path(new), notes.append, at_most=at_most)
    for note in notes:
        warnings.warn(note, stacklevel=2)
    return pd.DataFrame([_change_row(change) for change in comparison.changes])


def leaderboard(
    suite: str | None = None, *, runs: Sequence[Run | Path | str] = (), results: Path | str | None = None
) -> "pd.DataFrame":
    """The leaderboards of published results, with runs of one's own among them: one row per suite and estimator.

    Everything is scored again. A UserWarning names what is refused, and runs that may not be compared with the
    published ones, which have another number in the column `board`.

    Args:
        suite: The only suite that is shown; all by default.
        runs: Runs, their folders or bundles to show among the published results.
        results: The folder of published bundles, `results`/<suite>/*.zip; by default the one included with vobench.

    Raises:
        InputError: There is no such folder.
        UnknownNameError: There are no results of that suite.
    """
    import pandas as pd

    from vobench.report.published import board_rows, published_boards

    root = None if results is None else Path(results)
    paths = [run_path(run) for run in runs]
    with published_boards(suite, runs=paths, results=root) as published:
        rows = board_rows(published)
        sentences = [*published.refused, *(shown.apart for shown in published.boards if shown.apart)]
    for sentence in sentences:
        warnings.warn(sentence, stacklevel=2)
    return pd.DataFrame(rows)


def bundle(run: Run | Path | str, out: Path | str) -> Path:
    """Pack a run into a zip file that others can rescore and merge, and return its path.

    Raises InputError if `out` does not end in .zip.
    """
    from vobench.runner import bundle as packing

    path = Path(out)
    packing.require_zip(path)
    packing.bundle(open_run(run_path(run)), path)
    return path


def plan(
    suite: str | Path,
    *,
    estimators: Estimators | None = None,
    only: Names | None = None,
    changes: Mapping[str, Any] | None = None,
    draw: int | None = None,
) -> Plan:
    """The plan of a suite. The arguments `suite`, `estimators`, `only` and `changes` are those of `run`.

    `draw` is the index of a draw of places, from 0, as in `run` with `until`; None for the places of the suite.
    Raises SuiteError if the suite is invalid, or if it has no places that can be drawn for a `draw`.
    Raises UnknownNameError if no suite, case or estimator has a given name.
    """
    names = tuple(_estimator_name(each) for each in listed(estimators))
    changed_values = {key: _as_yaml(value) for key, value in (changes or {}).items()}
    if draw is None:
        planned = read_plan(str(suite), only_estimators=names, changes=changed_values)
    else:
        planned = Draws(str(suite), changed_values, names).plan(draw)
    return _only(planned, listed(only))


def _only(planned: Plan, patterns: Sequence[str]) -> Plan:
    """The cases and estimators that match; each pattern selects cases, or else scenes, or else estimators."""
    case_names = [case.name for case in planned.cases]
    scene_names = [case.variant.get("scene", "") for case in planned.cases]
    labels = [entry.label for entry in planned.estimator_entries]
    cases: list[str] = []
    scenes: list[str] = []
    estimators: list[str] = []
    for pattern in patterns:
        if fnmatch.filter(case_names, pattern):
            cases.append(pattern)
        elif fnmatch.filter(scene_names, pattern):
            scenes.append(pattern)
        elif fnmatch.filter(labels, pattern):
            estimators.append(pattern)
        else:
            known = sorted({*case_names, *labels})
            raise UnknownNameError(unknown_name_sentence("case, scene or estimator", pattern, known))
    entries = planned.estimator_entries
    if estimators:
        entries = tuple(entry for entry in entries if _matches_any(entry.label, estimators))
    return replace(planned.only(cases, scenes), estimator_entries=entries)


def _matches_any(name: str, patterns: Iterable[str]) -> bool:
    return any(fnmatch.fnmatch(name, pattern) for pattern in patterns)


def listed(given: Any) -> list[Any]:
    """One or several values as a list, empty for None."""
    if given is None:
        return []
    if isinstance(given, (str, type, Path)):
        return [given]
    return list(given)


def _estimator_name(given: str | type | Path) -> str:
    """The name or folder of an estimator; a class is first written to a folder."""
    if isinstance(given, type):
        return str(write_estimator(given).resolve())
    return str(given)


def _as_yaml(value: Any) -> str:
    """A value as text in the syntax of the option --set."""
    import json

    if isinstance(value, str):
        return value
    try:
        return json.dumps(value)
    except TypeError:
        raise InputError(f"a change should be a number, a string, a list or a dict, got {value!r}") from None


def run_path(given: Run | Path | str) -> Path:
    """The folder or the bundle of a run."""
    return given.path if isinstance(given, Run) else Path(given)


def _change_row(change: "ScoreChange") -> dict[str, Any]:
    """The row of a change in the table of `compare`."""
    low, high = change.interval or (None, None)
    return {
        "case": change.case or "all",
        "estimator": change.estimator,
        "verdict": change.verdict,
        "old": change.old,
        "new": change.new,
        "ratio": change.ratio,
        "ratio_low": low,
        "ratio_high": high,
        "p": change.p,
    }


def _matrix_rows(board: "Board") -> list[list[str]]:
    """The rows of the table of cases and estimators, with the default metric."""
    from vobench.report import board_table

    matrix = board_table.matrix(board, board_table.DEFAULT_METRIC)
    return [[case, *map(str, cells)] for case, cells in matrix]


def _html_table(headings: Sequence[str], rows: Iterable[Sequence[str]], title: str) -> str:
    """A table as HTML, with its title above it."""
    import pandas as pd

    table = pd.DataFrame([list(row) for row in rows], columns=list(headings))
    return f"<b>{html.escape(title)}</b>\n{table.to_html(index=False)}"
