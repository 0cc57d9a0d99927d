"""The leaderboard as one HTML page that needs no network, and the reports in the folder of a run."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import Any

from vobench import stop
from vobench.errors import printable
from vobench.report import board_table, leaderboard
from vobench.report.board_formats import FORMATS
from vobench.report.board_metric import METRICS
from vobench.report.case_facts import case_facts, design_remarks
from vobench.report.cell import CaseFacts, trials_by_cell
from vobench.report.determinism import determinism_remarks, repeated_answers
from vobench.report.frame_statistics import EstimatorStatistics, StatisticsByCell, summarize_frames
from vobench.report.json_file import read_object
from vobench.report.leaderboard import Board
from vobench.report.page_data import page_data
from vobench.report.run_tables import trial_csv
from vobench.report.thumbnail import Thumbnails
from vobench.report.until_decided import recorded_ratio
from vobench.runner.environment import Environment, read_environment
from vobench.runner.folder import (
    CASE,
    NOT_APPLICABLE,
    PAGE,
    SUITE,
    SURVIVED,
    RunFolder,
    TrialScore,
    visible_to,
    with_sequence,
)
from vobench.runner.frames import TIMES, FrameRow, new_table, read_frames

TEMPLATES = Path(__file__).parent / "templates"
STEM = "leaderboard"
TRIALS = "trials.csv"
COST_COLUMNS = ("case", "estimator", "wall_ms", "cpu_ms", "memory_mib")
MOST_RIGS = 4  # of which the page shows a picture
RIG_WIDTH_PX = 256


@dataclass(frozen=True, slots=True)
class CellFrames:
    """The frame statistics of an estimator on a case, and its mean costs per frame as text."""

    case: str
    estimator: str
    statistics: EstimatorStatistics
    costs: dict[str, str]


def run_board(folder: RunFolder, scores: list[TrialScore]) -> Board:
    """The board of a run, with costs per frame and the reasons that estimators report."""
    return _board(folder, scores, _answered(_cell_frames(folder, scores)))


def _board(folder: RunFolder, scores: list[TrialScore], answered: StatisticsByCell) -> Board:
    facts = _facts(folder, scores)
    repeated = repeated_answers(folder, scores)
    title = folder.path.resolve().parent.name
    return leaderboard.make_board(
        scores,
        answered,
        facts,
        title=title,
        environment=read_environment(folder),
        remarks=[
            *design_remarks(facts.values(), base_seed=_base_seed(folder)),
            *determinism_remarks(repeated),
        ],
        not_deterministic=[answers.estimator for answers in repeated if not answers.are_equal],
        until_ratio=recorded_ratio(folder),
    )


def _facts(folder: RunFolder, scores: Sequence[TrialScore]) -> dict[str, CaseFacts]:
    """The facts of the cases of trials, by name."""
    cases = dict.fromkeys(score.case for score in scores)
    return {case: case_facts(folder, case) for case in cases}


def _base_seed(folder: RunFolder) -> int:
    """The base seed of the suite of a run; 0 if it is unknown, as in runs of an older vobench."""
    base_seed = read_object(folder.path / SUITE).get("base_seed", 0)
    return base_seed if isinstance(base_seed, int) else 0


def _answered(frames: Iterator[CellFrames] | list[CellFrames]) -> StatisticsByCell:
    return {(cell.case, cell.estimator): cell.statistics for cell in frames}


def write_reports(folder: RunFolder, scores: list[TrialScore]) -> None:
    """Write the reports of a run to its folder: leaderboard.md, .json and .csv, trials.csv, times.csv and the page.

    Costs and dates differ between equal runs, so only times.csv and the page have them.
    """
    cells = list(_cell_frames(folder, scores))
    answered = _answered(cells)
    without_costs = {key: _costless(statistics) for key, statistics in answered.items()}
    repeatable = _undated(_board(folder, scores, without_costs))
    for suffix in ("md", "json", "csv"):
        stop.check()
        text = FORMATS[suffix](repeatable, board_table.DEFAULT_METRIC)
        (folder.path / f"{STEM}.{suffix}").write_text(text, encoding="utf-8")

    (folder.path / TRIALS).write_text(trial_csv(scores, _facts(folder, scores)), encoding="utf-8")

    with new_table(folder.path / TIMES, COST_COLUMNS) as table:
        for cell in cells:
            table.writerow({"case": cell.case, "estimator": cell.estimator, **cell.costs})

    board = _board(folder, scores, answered)
    page = board_page(folder, scores, board, folder.path)
    (folder.path / PAGE).write_text(page, encoding="utf-8")


def _costless(statistics: EstimatorStatistics) -> EstimatorStatistics:
    return replace(statistics, ms_per_frame=None, memory_mib=None)


def _undated(board: Board) -> Board:
    if not board.environment:
        return board
    return replace(board, environment=replace(board.environment, date=""))


def _cell_frames(folder: RunFolder, scores: list[TrialScore]) -> Iterator[CellFrames]:
    """The statistics and costs of each case and estimator; only the frames of one cell are in memory."""
    by_cell = trials_by_cell(with_sequence(scores), _facts(folder, scores))
    for (case, estimator), trials in by_cell.items():
        stop.check()
        frames = [read_frames(folder.estimate(trial.case, estimator, trial.repeat)) for trial in trials]
        rows = [row for trial_rows in frames for row in trial_rows]
        yield CellFrames(case, estimator, summarize_frames(frames), _costs(rows))


def _costs(rows: Sequence[FrameRow]) -> dict[str, str]:
    """The mean times per frame and the maximum memory; empty text for a cost that no frame has."""
    wall_ms = [row.wall_ms for row in rows if row.wall_ms is not None]
    cpu_ms = [row.cpu_ms for row in rows if row.cpu_ms is not None]
    memory_mib = [row.memory_mib for row in rows if row.memory_mib is not None]
    return {
        "wall_ms": f"{fmean(wall_ms):.3f}" if wall_ms else "",
        "cpu_ms": f"{fmean(cpu_ms):.3f}" if cpu_ms else "",
        "memory_mib": f"{max(memory_mib):.3f}" if memory_mib else "",
    }


def board_page(folder: RunFolder, scores: list[TrialScore], board: Board, beside: Path | None) -> str:
    """The page of a board; its links are relative to `beside`, the folder where the page will be.

    It links to no files if `beside` is None, as for runs that are only unpacked for a while.
    """
    from jinja2 import Environment as Templates
    from jinja2 import FileSystemLoader

    templates = Templates(loader=FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True)
    matrices = {name: board_table.matrix(board, name) for name in board.metrics}
    if not matrices:
        matrices = {board_table.DEFAULT_METRIC: []}
    metric = board_table.DEFAULT_METRIC
    if metric not in matrices:
        metric = next(iter(matrices))

    # The pictures of rigs come first: thumbnails stop at a limit of bytes for the whole page.
    thumbnails = Thumbnails(folder)
    rigs = _rigs(folder, board, thumbnails)
    data = page_data(folder, scores, board, matrices, thumbnails=thumbnails, beside=beside)
    return templates.get_template("leaderboard.html").render(
        title=board.title,
        header=_header(folder, scores),
        rigs=rigs,
        board=board,
        metric=metric,
        headings={name: METRICS[name].heading for name in matrices},
        rows=matrices[metric],
        named=board_table.named,
        claims={cell.estimator: cell.claims for cell in board.cells},
        totals=board_table.totals(board),
        remarks=[printable(note) for note in board_table.board_notes(board)],
        legend=board_table.LEGEND,
        data=_script_json(data),
    )


def _script_json(data: Any) -> str:
    """JSON that is safe inside a script element: it cannot end the script or begin a comment."""
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _header(folder: RunFolder, scores: list[TrialScore]) -> dict[str, Any]:
    """What was run, when and on which machine; facts that the files of the run lack are left out."""
    suite = read_object(folder.path / SUITE)
    environment = read_environment(folder) or Environment()
    facts = {**_suite_facts(suite, scores), **_machine_facts(environment, scores)}
    known_facts = {name: value for name, value in facts.items() if value not in (None, "")}

    libraries = dict(environment.libraries)
    if environment.python:
        libraries = {"Python": environment.python, **libraries}
    return {
        "summary": suite.get("summary", ""),
        "facts": known_facts,
        "libraries": libraries,
    }


def _suite_facts(suite: dict[str, Any], scores: list[TrialScore]) -> dict[str, Any]:
    trials = with_sequence(scores)
    applicable = [trial for trial in trials if trial.status != NOT_APPLICABLE]
    failed = sum(trial.status not in SURVIVED for trial in applicable)
    left_out = len(trials) - len(applicable)
    not_applicable = f", {left_out} not applicable" if left_out else ""
    return {
        "trials": f"{len(trials)}, {failed} failed{not_applicable}",
        "seed": suite.get("seed"),
        "repeats": suite.get("repeats"),
    }


def _machine_facts(environment: Environment, scores: list[TrialScore]) -> dict[str, Any]:
    """Date, versions and hardware; None for an unknown fact."""
    return {
        "date": environment.date,
        "vobench": environment.release if environment.vobench else None,
        "processor": " and ".join(map(str, environment.processors)),
        "cores": f"{environment.cores} of {environment.cores_total}" if environment.cores else None,
        "driver": environment.driver,
        "portable": "yes" if environment.portable else None,
        "estimators": visible_to(with_sequence(scores)).removeprefix("Estimators "),
        "system": environment.platform,
        "CPU time": f"taken {environment.timed}" if environment.timed else None,
    }


def _rigs(folder: RunFolder, board: Board, thumbnails: Thumbnails) -> list[tuple[str, str]]:
    """The names of the first rigs of a board, each with the first picture of its first case as a data URI."""
    pictures = dict[str, str]()
    for case in board.cases:
        if len(pictures) == MOST_RIGS:
            break
        description = read_object(folder.case(case) / CASE)
        variant = description.get("variant") or {}
        rig = str(variant.get("rig", ""))
        if not rig or rig in pictures:
            continue

        picture = thumbnails.get(case, 0, RIG_WIDTH_PX)
        if picture:
            pictures[rig] = picture
    return list(pictures.items())
