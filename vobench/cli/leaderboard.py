"""The command vobench leaderboard, which prints published results with the user's runs among them."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.board import print_board
from vobench.cli.option import Json
from vobench.cli.report import TERMINAL, BoardFile, BoardFormat, MetricName, choose_format
from vobench.errors import require_known
from vobench.report.board_metric import METRICS
from vobench.report.board_table import DEFAULT_METRIC
from vobench.report.published import PublishedBoard, boards_text, published_boards


def leaderboard_command(
    suite: Annotated[
        str | None, typer.Argument(metavar="[SUITE]", help="The only suite to show; all by default.")
    ] = None,
    *,
    with_runs: Annotated[
        list[Path] | None, typer.Option("--with", metavar="RUN", help="A run or bundle to show among them; repeatable.")
    ] = None,
    results: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="The published bundles, FOLDER/SUITE/*.zip; by default vobench's results/."
        ),
    ] = None,
    form: BoardFormat = None,
    out: BoardFile = None,
    metric: MetricName = DEFAULT_METRIC,
    json: Json = False,
) -> None:
    """Print the leaderboards of published results, all scored again; exit code 1 if one is refused."""
    format_name = choose_format(form, out, as_json=json)
    require_known("metric", metric, METRICS)
    with published_boards(suite, runs=with_runs or (), results=results, tell=terminal.warn) as published:
        for sentence in published.refused:
            terminal.warn(sentence)
        if out is None and format_name == TERMINAL:
            for shown in published.boards:
                _print_board(shown, metric)
        else:
            text = boards_text(published, format_name, metric)
            if out is None:
                print(text, end="")
            else:
                out.write_text(text, encoding="utf-8")
    if out is not None and json:
        terminal.print_json({"path": str(out), "format": format_name})
    if published.refused:
        raise SystemExit(1)


def _print_board(shown: PublishedBoard, metric: str) -> None:
    """Print the name of the suite, what the board has in common with others, the board, and its sources."""
    console = terminal.console()
    console.print(shown.suite, style="bold")
    for sentence in shown.introduction:
        console.print(f"  {sentence}")
    print_board(shown.board, metric)
    for source in shown.sources:
        console.print(source.sentence, style="dim")
    console.print()
