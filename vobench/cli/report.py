"""vobench report."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.board import print_board
from vobench.cli.option import Json
from vobench.errors import UnknownNameError, require_known
from vobench.report import page
from vobench.report.board_formats import FORMATS
from vobench.report.board_metric import METRICS
from vobench.report.board_table import DEFAULT_METRIC
from vobench.report.leaderboard import Board
from vobench.runner.bundle import merged, opened
from vobench.runner.folder import RunFolder, TrialScore
from vobench.runner.rescore import Rescored, check, wrong_truths
from vobench.runner.signature import signature_sentence

TERMINAL = "terminal"
FILE_FORMATS = (*FORMATS, "html")
FORMAT_BY_ENDING = {".tex": "latex", ".htm": "html", **{f".{name}": name for name in FILE_FORMATS}}
CLAIMED_HEADINGS = ("case", "estimator", "status", "ATE m", "why it cannot be scored again")

AllowedSigners = Annotated[
    Path | None,
    typer.Option(
        "--allowed-signers",
        envvar="VOBENCH_ALLOWED_SIGNERS",
        help="Who may sign bundles: a file in the form of ssh-keygen(1).",
    ),
]
BoardFormat = Annotated[
    str | None,
    typer.Option("--format", help="terminal, md, csv, json, latex or html; by default that of the ending of --out."),
]
BoardFile = Annotated[Path | None, typer.Option(help="Write to this file instead of the terminal.")]
MetricName = Annotated[str, typer.Option(help=f"The metric of the matrix: {', '.join(METRICS)}.")]


@dataclass(frozen=True, slots=True)
class _CheckedBoard:
    """The board of runs that were scored again, and the trials that only claim a score."""

    board: Board
    scores: list[TrialScore]
    claimed: list[Rescored]


def report_command(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Runs or bundles; several are merged into one board.")
    ],
    *,
    form: BoardFormat = None,
    out: BoardFile = None,
    metric: MetricName = DEFAULT_METRIC,
    allowed_signers: AllowedSigners = None,
    json: Json = False,
) -> None:
    """Print the leaderboard of runs; all trials are scored again from their estimates and ground truth."""
    format_name = choose_format(form, out, as_json=json)
    require_known("metric", metric, METRICS)
    with ExitStack() as stack:
        signatures = [signature for run in runs if (signature := _signature(run, allowed_signers))]
        wrong_truth_by_case = dict[str, str]()
        folders = list[RunFolder]()
        for run in runs:
            run_folder = stack.enter_context(opened(run, terminal.warn))
            folders.append(run_folder)
            if run.is_file():
                wrong_truth_by_case |= wrong_truths(run_folder)
        folder = stack.enter_context(merged(folders, [run.stem for run in runs]))
        checked = _checked_board(folder, wrong_truth_by_case, signatures)

        if out is None and format_name == TERMINAL:
            print_board(checked.board, metric)
            _print_claimed(checked.claimed)
            return
        is_kept = not any(run.is_file() for run in runs) and len(runs) == 1  # not only unpacked or merged for a while
        text = _report_text(format_name, folder, checked, metric, out, is_kept=is_kept)

    if out is None:
        print(text, end="")
        return
    out.write_text(text, encoding="utf-8")
    if json:
        terminal.print_json({"path": str(out), "format": format_name})


def choose_format(form: str | None, out: Path | None, *, as_json: bool) -> str:
    """The format of --json, --format, or the file's ending. Raises UnknownNameError."""
    if out is None:
        if as_json:
            return "json"
        return require_known("format", form or TERMINAL, (TERMINAL, *FILE_FORMATS))
    if form is not None:
        return require_known("format", form, FILE_FORMATS)
    if out.suffix.lower() not in FORMAT_BY_ENDING:
        known = ", ".join(FILE_FORMATS)
        raise UnknownNameError(f"no format has the ending of '{out.name}'; choose one with --format: {known}")
    return FORMAT_BY_ENDING[out.suffix.lower()]


def _signature(run: Path, allowed_signers: Path | None) -> str:
    """A sentence about the signature of a bundle; empty if it has none, or if the path is a folder."""
    sentence = signature_sentence(run, allowed_signers) if run.is_file() else ""
    return f"{run.name}: {sentence}" if sentence else ""


def _checked_board(folder: RunFolder, wrong_truth_by_case: dict[str, str], signatures: Sequence[str]) -> _CheckedBoard:
    """Score all trials again, warn about those that differ, and make the board."""
    checked = check(folder, wrong_truth_by_case)
    remarks = (*checked.notes, *signatures)
    for remark in remarks:
        terminal.warn(remark)
    board = page.run_board(folder, checked.scores)
    board = replace(board, remarks=(*board.remarks, *remarks))
    return _CheckedBoard(board, checked.scores, checked.claimed)


def _report_text(
    format_name: str, folder: RunFolder, checked: _CheckedBoard, metric: str, out: Path | None, *, is_kept: bool
) -> str:
    if format_name != "html":
        return FORMATS[format_name](checked.board, metric)
    where_links_start = out.resolve().parent if out else folder.path
    page_folder = where_links_start if is_kept else None
    return page.board_page(folder, checked.scores, checked.board, page_folder)


def _print_claimed(claimed: Sequence[Rescored]) -> None:
    """Print the trials that only claim a score, apart from the board."""
    rows = list[list[str]]()
    for trial in claimed:
        score = trial.score
        ate_m = score.value("ate_trans", "rmse")
        ate_text = "" if ate_m is None else f"{ate_m:.3g}"
        rows.append([score.case, score.estimator, score.status, ate_text, trial.claimed])
    if rows:
        terminal.console().print(terminal.table("claimed, not ranked", CLAIMED_HEADINGS, rows))
