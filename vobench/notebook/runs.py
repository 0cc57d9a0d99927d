"""Suites from Python: check one, run it, and look at what came of it."""

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.errors import InputError, UnknownNameError, unknown
from vobench.notebook.class_source import write_estimator
from vobench.notebook.display import choose_display
from vobench.runner.folder import open_run
from vobench.runner.launch import run_plan
from vobench.runner.motion import cut
from vobench.runner.preflight import PlanSummary, summarize
from vobench.suite.suite import Plan, read_plan

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from vobench.report.compare import Change
    from vobench.report.leaderboard import Board

Names = str | Iterable[str]
Estimators = str | type | Iterable[str | type]
RUNS = Path("runs")


class Run:
    """A finished run of a suite, by its folder: tables, plots and recordings of its trials."""

    def __init__(self, path: Path | str) -> None:
        """The run at a path, where a suite's folder stands for its latest run. Raises InputError for another folder."""
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
        """One row per trial: case, estimator, repeat, the choices that make the case, status and metrics."""
        from vobench.report.run_tables import trial_frame

        return trial_frame(self._scores)

    @cached_property
    def frames(self) -> "pd.DataFrame":
        """One row per frame of every trial: status, errors after alignment, tracks, exposure and cost."""
        from vobench.report.run_tables import frames_frame

        return frames_frame(self._folder, self._scores)

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

    def plot(self, case: str | None = None, *, estimators: Names | None = None) -> "Figure":
        """Paths from above and errors over time on one case, the first by default, of all or some estimators.

        Raises UnknownNameError for a name that the run does not have.
        """
        from vobench.report.trial_plot import plot_case

        chosen = self._require("case", case or self.cases[0], self.cases)
        names = self.estimators if estimators is None else listed(estimators)
        for name in names:
            self._require("estimator", name, self.estimators)
        trials = [score for score in self._scores if score.case == chosen and score.repeat == 0]
        order = {name: place for place, name in enumerate(names)}
        shown = sorted((trial for trial in trials if trial.estimator in order), key=lambda t: order[t.estimator])
        return plot_case(self._folder, shown)

    def view(
        self,
        case: str | None = None,
        *,
        estimator: str | None = None,
        save: Path | str | None = None,
        web: bool = False,
    ) -> Path:
        """Write one trial as a Rerun recording and open it in the viewer; the path of the recording.

        Without `case` and `estimator` it is the gravest failure, or the worst error. With `save` the recording is
        written there and no viewer is opened; `web` serves it to a browser on this machine until interrupted. Raises
        MissingDependencyError where there is no display, and UnknownNameError.
        """
        from vobench.report.viewer import open_viewer, save_recordings

        recordings = save_recordings(
            self._folder, case=case, estimator=estimator, save=None if save is None else Path(save)
        )
        paths = [recording.path for recording in recordings]
        if save is None or web:
            open_viewer(paths, web=web)
        return paths[0]

    def __repr__(self) -> str:
        return f"Run({self.path}, {len(self._scores)} trials of {len(self.estimators)} estimators)"

    def _repr_html_(self) -> str:
        from vobench.report import board_table
        from vobench.report.board_metric import METRICS

        title = METRICS[board_table.DEFAULT_METRIC].heading
        parts = [_html_table(["case", *self.estimators], _matrix_rows(self._board), title)]
        for over, (headings, *rows) in board_table.totals(self._board):
            parts.append(_html_table(headings, rows, f"totals over {over}"))
        notes = [*board_table.remarks(self._board), *board_table.cell_notes(self._board), str(self.path)]
        parts += [f"<small>{html.escape(note)}</small><br>" for note in notes]
        return "\n".join(parts)

    @cached_property
    def _board(self) -> "Board":
        from vobench.report import page

        return page.board_of(self._folder, self._scores)

    def _require(self, kind: str, name: str, known: Sequence[str]) -> str:
        if name not in known:
            raise UnknownNameError(f"{unknown(kind, name, list(known))} in the run {self.path}")
        return name


@dataclass(frozen=True, slots=True)
class Check:
    """A valid suite before it is run: its cases and estimators as tables, and the plan itself."""

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
    """Validate a suite and say what running it comes to; nothing is rendered.

    The options are those of `run`. Raises SuiteError, which lists all that is wrong, and UnknownNameError.
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
) -> Run:
    """Run a suite: simulate, estimate, score. What the cache holds already is not made again.

    Args:
        suite: A suite's name, or the path of its YAML file.
        estimators: Names, patterns, folders or classes of estimators to run in place of the suite's. A class is saved
            as `estimators/<name>` in the working folder, from where every command finds it, too.
        only: Patterns such as `"room-*"` of the cases, scenes or estimators that are run, out of the suite's.
        changes: Values in place of the suite's, by their keys, as in `{"repeats": 3, "rigs.ahead.pitch_deg": 20}`.
        jobs: Tasks at once; by default one a core, and no more than 8.
        out: Where the folders of runs go.
        frames: Of each simulated case only so many frames, from its first on.
        fresh: Whether everything is made again, whatever the cache holds.
        quiet: Whether to show no progress.

    Raises:
        SuiteError: The suite is wrong; the message lists every mistake.
        UnknownNameError: No suite, case or estimator has that name.
        MissingDependencyError: This machine cannot draw.
    """
    from vobench.report import page

    planned = plan(suite, estimators=estimators, only=only, changes=changes)
    if frames is not None:
        planned = cut(planned, frames)
    folder = run_plan(
        planned,
        out=Path(out),
        finish=page.write_reports,
        display=choose_display(is_quiet=quiet),
        jobs=jobs,
        is_fresh=fresh,
    )
    return Run(folder.path)


def read_run(path: Path | str) -> Run:
    """The run in a folder, or the latest of runs/<suite>. Raises InputError where the folder is none of a run."""
    return Run(path)


def read_board(path: Path | str) -> "pd.DataFrame":
    """The leaderboard of a run's folder, or of the latest of runs/<suite>: a row per cell, then one per total.

    Raises InputError where the folder is none of a run.
    """
    from vobench.report import board_records, page

    folder = open_run(Path(path))
    return board_records.data_frame(page.board_of(folder, folder.scores()))


def compare(old: Run | Path | str, new: Run | Path | str, *, at_most: float | None = None) -> "pd.DataFrame":
    """What became better or worse from one run to another: one row per estimator, then one per case and estimator.

    A ratio of losses beyond `at_most` counts as worse. A run is given by itself, its folder or a bundle. Raises
    InputError where the two have nothing in common.
    """
    import pandas as pd

    from vobench.report import compare as comparison
    from vobench.report import page
    from vobench.runner.bundle import opened

    boards = []
    for given in (old, new):
        with opened(run_path(given)) as folder:
            boards.append(page.board_of(folder, folder.scores()))
    changes = comparison.compare(boards[0], boards[1], at_most=at_most)
    return pd.DataFrame([_change_row(change) for change in changes])


def bundle(run: Run | Path | str, out: Path | str) -> Path:
    """Pack a run into one zip file that others can score again and merge. Raises InputError for another name."""
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
) -> Plan:
    """The plan of a suite, as `run` takes it. Raises SuiteError and UnknownNameError."""
    names = tuple(_estimator_name(each) for each in listed(estimators))
    stated = {key: _as_yaml(value) for key, value in (changes or {}).items()}
    planned = read_plan(str(suite), only_estimators=names, changes=stated)
    return _only(planned, listed(only))


def _only(planned: Plan, patterns: Sequence[str]) -> Plan:
    """The cases and estimators that match; a pattern is of cases, of scenes or of estimators."""
    labels = [entrant.label for entrant in planned.entrants]
    cases: list[str] = []
    scenes: list[str] = []
    wanted: list[str] = []
    for pattern in patterns:
        if any(fnmatch(case.name, pattern) for case in planned.cases):
            cases.append(pattern)
        elif any(fnmatch(case.variant.get("scene", ""), pattern) for case in planned.cases):
            scenes.append(pattern)
        elif any(fnmatch(label, pattern) for label in labels):
            wanted.append(pattern)
        else:
            known = sorted({*(case.name for case in planned.cases), *labels})
            raise UnknownNameError(unknown("case, scene or estimator", pattern, known))
    entrants = planned.entrants
    if wanted:
        entrants = tuple(each for each in entrants if any(fnmatch(each.label, pattern) for pattern in wanted))
    return replace(planned.only(cases, scenes), entrants=entrants)


def listed(given: Any) -> list[Any]:
    """One or several things, as a list; nothing for None."""
    if given is None:
        return []
    if isinstance(given, (str, type, Path)):
        return [given]
    return list(given)


def _estimator_name(given: str | type | Path) -> str:
    """The name or folder of an estimator; a class gets a folder first."""
    if isinstance(given, type):
        return str(write_estimator(given).resolve())
    return str(given)


def _as_yaml(value: Any) -> str:
    """A value as the command line's --set has it."""
    import json

    if isinstance(value, str):
        return value
    try:
        return json.dumps(value)
    except TypeError:
        raise InputError(f"a change should be a number, a text, a list or a dict, got {value!r}") from None


def run_path(given: Run | Path | str) -> Path:
    """The folder or the bundle of a run that is given in any form."""
    return given.path if isinstance(given, Run) else Path(given)


def _change_row(change: "Change") -> dict[str, Any]:
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
    from vobench.report import board_table

    return [[case, *map(str, cells)] for case, cells in board_table.matrix(board, board_table.DEFAULT_METRIC)]


def _html_table(headings: Sequence[str], rows: Iterable[Sequence[str]], title: str) -> str:
    import pandas as pd

    table = pd.DataFrame([list(row) for row in rows], columns=list(headings))
    return f"<b>{html.escape(title)}</b>\n{table.to_html(index=False)}"
