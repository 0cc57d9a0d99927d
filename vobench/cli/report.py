"""vobench report, compare, bundle and verify, and leaderboards on a terminal, as many columns as fit."""

import sys
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from vobench.cli import terminal
from vobench.errors import UnknownNameError, printable
from vobench.report import compare, page
from vobench.report.board_formats import FORMATS
from vobench.report.board_metric import METRICS
from vobench.report.board_table import DEFAULT_METRIC, LEGEND, cell_notes, matrix, origin, remarks, totals
from vobench.report.leaderboard import Board
from vobench.report.verify import verify_run
from vobench.runner.bundle import bundle, merged, opened, require_zip, scored_again
from vobench.runner.folder import TrialScore, open_run
from vobench.runner.rescore import Rescored, check, wrong_truths
from vobench.runner.signature import sign as make_signature
from vobench.runner.signature import signed_by

# A narrow terminal goes without these, in this order; every report has them all.
LEAST_FIRST = ("MiB", "mean place", "CPU ms/frame", "ATE %", "failed", "decided", "× first")
# widths: of a table as it would like to be, and of an estimator's name above a column
ENDLESS = 10_000
FOLDED = 12
MOST_CASES = 60  # that a terminal shows
TERMINAL = "terminal"
FORMS = (*FORMATS, "html")
ENDINGS = {".tex": "latex", ".htm": "html", **{f".{form}": form for form in FORMS}}
REGRESSED = 3  # the exit code where something got worse
AllowedSigners = Annotated[
    Path | None,
    typer.Option(
        "--allowed-signers",
        envvar="VOBENCH_ALLOWED_SIGNERS",
        help="Who may sign bundles: a file as ssh-keygen(1) has it.",
    ),
]
MetricName = Annotated[str, typer.Option(help=f"What the matrix shows: {', '.join(METRICS)}.")]


def report_command(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN...", help="Runs or bundles; several are merged into one board.")
    ],
    *,
    form: Annotated[
        str | None, typer.Option("--format", help="terminal, md, csv, json, latex or html; --out's ending says it too.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write to this file instead of the terminal.")] = None,
    metric: MetricName = DEFAULT_METRIC,
    allowed_signers: AllowedSigners = None,
    json: terminal.Json = False,
) -> None:
    """Print a run's leaderboard, in any form; all trials are scored again from their estimates and truths."""
    chosen = _chosen(form, out, as_json=json)
    terminal.known("metric", metric, METRICS)
    with ExitStack() as stack:
        folders = []
        wrong = dict[str, str]()
        signatures = [told for run in runs if (told := _signature(run, allowed_signers))]
        for run in runs:
            folders.append(stack.enter_context(opened(run, terminal.warn)))
            wrong |= wrong_truths(folders[-1]) if run.is_file() else {}
        folder = stack.enter_context(merged(folders, [run.stem for run in runs]))
        checked = check(folder, wrong)
        scores = checked.scores
        board = page.board_of(folder, scores)
        board = replace(board, remarks=(*board.remarks, *checked.notes, *signatures))
        for note in (*checked.notes, *signatures):
            terminal.warn(note)
        if out is None and chosen == TERMINAL:
            print_board(board, metric)
            _print_claimed(checked.claimed)
            return
        beside = out.resolve().parent if out else folder.path
        text = page.html(folder, scores, board, beside) if chosen == "html" else FORMATS[chosen](board, metric)
    if out is None:
        print(text, end="")
        return
    out.write_text(text, encoding="utf-8")
    if json:
        terminal.print_json({"path": str(out), "format": chosen})


def _signature(run: Path, allowed_signers: Path | None) -> str:
    """What is known of a bundle's signature; empty if it has none, or the path is a folder."""
    told = signed_by(run, allowed_signers) if run.is_file() else ""
    return f"{run.name}: {told}" if told else ""


def _print_claimed(claimed: list[Rescored]) -> None:
    """The trials that only claim a score, apart from the board."""
    rows = []
    for trial in claimed:
        score = trial.score
        ate_m = trial.score.value("ate_trans", "rmse")
        rows.append([score.case, score.estimator, score.status, "" if ate_m is None else f"{ate_m:.3g}", trial.claimed])
    if rows:
        headings = ["case", "estimator", "status", "ATE m", "why it cannot be scored again"]
        terminal.console().print(terminal.table("claimed, not ranked", headings, rows))


def _chosen(form: str | None, out: Path | None, *, as_json: bool) -> str:
    """The form asked for: --json's, --format's, or that of the file's ending. Raises UnknownNameError."""
    if as_json and out is None:
        return "json"
    if form is None and out is not None and out.suffix.lower() not in ENDINGS:
        raise UnknownNameError(f"no format goes with '{out.name}'; name one with --format: {', '.join(FORMS)}")
    if form is None:
        form = ENDINGS[out.suffix.lower()] if out else TERMINAL
    return terminal.known("format", form, FORMS if out else (TERMINAL, *FORMS))


def compare_command(
    old: Annotated[Path, typer.Argument(metavar="OLD", help="A run or a bundle.")],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="Another of the same suite.")],
    *,
    at_most: Annotated[
        float | None, typer.Option(help="Errors this many times the old ones are worse, decided or not.")
    ] = None,
    json: terminal.Json = False,
) -> None:
    """Say what became better or worse between two runs; exit code 3 where something got worse or fails now."""
    boards = []
    with (
        opened(old, terminal.warn) as before,
        opened(new, terminal.warn) as after,
        merged([before, after], ["old", "new"]),
    ):
        for folder, path in ((before, old), (after, new)):
            checked = check(folder, wrong_truths(folder) if path.is_file() else {})
            for note in checked.notes:
                terminal.warn(f"{path.name}: {note}")
            boards.append(page.board_of(folder, checked.scores))
    changes = compare.compare(*boards, at_most=at_most)
    worse = [change for change in changes if change.verdict in compare.REGRESSIONS]
    differing = compare.environment_differences(*boards)
    if json:
        told = [asdict(change) for change in changes]
        terminal.print_json({"worse": len(worse), "changes": told, "environment": differing})
    else:
        _print_changes(changes)
        if differing:
            terminal.console().print(f"The runs differ in what can change scores: {'; '.join(differing)}")
    if worse:
        raise SystemExit(REGRESSED)


def _print_changes(changes: list[compare.Change]) -> None:
    """The totals, then the cells that are not as they were."""
    out = terminal.console()
    headings = ["estimator", "verdict", "old", "new", "ratio", "p"]
    for title, chosen in (
        ("lost-aware score over all cases", [change for change in changes if not change.case]),
        ("ATE % of path", [change for change in changes if change.case and change.verdict != compare.SAME]),
    ):
        if not chosen:
            continue
        rows = [
            [c.case, c.estimator, c.verdict, c.old, c.new, _ratio(c), "" if c.p is None else f"{c.p:.2g}"]
            for c in chosen
        ]
        kept = slice(0 if chosen[0].case else 1, None)
        out.print(terminal.table(title, ["case", *headings][kept], [row[kept] for row in rows]))
    cells = [change for change in changes if change.case]
    same = sum(change.verdict == compare.SAME for change in cells)
    out.print(
        f"{same} of {len(cells)} cells are the same to the last digit; ratio: new loss to old, 1 - lost-aware score"
    )


def _ratio(change: compare.Change) -> str:
    within = f" [{change.interval[0]:.3g}, {change.interval[1]:.3g}]" if change.interval else ""
    return "" if change.ratio is None else f"{change.ratio:.3g}{within}"


def bundle_command(
    run: terminal.RunPath,
    out: Annotated[Path, typer.Argument(metavar="OUT.zip", help="The file to write.")],
    *,
    sign: Annotated[
        Path | None, typer.Option(metavar="KEY", help="Sign it with this SSH key, in a file beside it.")
    ] = None,
    json: terminal.Json = False,
) -> None:
    """Pack a run's suite, versions, truth, estimates, scores and hashes, for others to score again and to merge."""
    require_zip(out)
    files = bundle(open_run(run), out)
    size = out.stat().st_size
    signature = make_signature(out, sign) if sign else None
    if json:
        signed = {"signature": str(signature)} if signature else {}
        terminal.print_json({"path": str(out), "files": files, "bytes": size, **signed})
        return
    print(f"{files} files, {size / 1e6:.1f} MB: {out}")
    if signature:
        print(f"its signature: {signature}")
    print(f"score it again: vobench score {out}")


def score_bundle(path: Path, *, as_json: bool) -> None:
    """Score a bundle again and print its board of the new scores; exit code 1 where they are not those it states."""
    with opened(path, terminal.warn) as folder:
        again = list(scored_again(folder, wrong_truths(folder)))
        scores = [score for score, _ in again]
        wrong = [score for score, same in again if not same]
        board = page.board_of(folder, scores)
    if as_json:
        terminal.print_json({"trials": len(again), "differ": [_named(score) for score in wrong]})
    else:
        print_board(board)
        terminal.console().print(f"{len(again) - len(wrong)} of {len(again)} scores are those that the bundle states")
    for score in wrong[:MOST_CASES]:
        print(f"vobench: another score than the bundle states: {_named(score)}", file=sys.stderr)
    if wrong:
        raise SystemExit(1)


def _named(score: TrialScore) -> str:
    return f"{score.estimator} on {score.case}, {score.repeat}"


def verify_command(run: terminal.RunPath, *, json: terminal.Json = False) -> None:
    """Recompute all hashes and scores of a run from its files; exit code 1 where anything differs."""
    findings = list(verify_run(open_run(run)))
    wrong = [finding for finding in findings if finding.wrong]
    if json:
        rows = [asdict(finding) for finding in findings]
        terminal.print_json({"run": str(run), "checked": len(findings), "wrong": len(wrong), "findings": rows})
        raise SystemExit(1 if wrong else 0)
    out = terminal.console()
    for f in wrong:
        out.print(f"{f.kind}: {f.what}: {f.wrong}")
    for kind in dict.fromkeys(f.kind for f in findings):
        of_kind = [f for f in findings if f.kind == kind]
        out.print(f"{kind}: {sum(not f.wrong for f in of_kind)} of {len(of_kind)} as they were")
    if wrong:
        raise SystemExit(1)


def print_board(board: Board, metric: str = DEFAULT_METRIC) -> None:
    """The matrix and the totals, and what their numbers don't say."""
    out = terminal.console()
    rows = matrix(board, metric)
    cells = [[case, *(f"{c.text}{c.mark}{chr(10) + c.range if c.range else ''}" for c in of)] for case, of in rows]
    names = board.estimators
    for shown in range(len(names), 0, -1):
        headings = ["case", *(_folded(name) for name in names[:shown])]
        table = terminal.table(METRICS[metric].heading, headings, [row[: shown + 1] for row in cells[:MOST_CASES]])
        if _fits(table, out):
            break
    out.print(table)
    if left := names[shown:]:
        out.print(f"no room for {', '.join(left)}: use a wider terminal, or --format csv", style="yellow")
    if len(cells) > MOST_CASES:
        out.print(f"{len(cells) - MOST_CASES} more cases: see --format csv", style="yellow")
    for over, (headings, *lines) in totals(board):
        _print_totals(f"totals over {over}", headings, lines, out)
    for remark in remarks(board):
        out.print(f"  {printable(remark)}")
    for note in cell_notes(board):
        out.print(f"  {printable(note)}")
    out.print(LEGEND, style="dim")
    for line in (board.visible, origin(board)):
        if line:
            out.print(printable(line), style="dim")


def _print_totals(title: str, headings: list[str], lines: list[list[str]], out: Console) -> None:
    """The totals without the columns that matter least, where the terminal is too narrow for all of them."""
    for left_out in range(len(LEAST_FIRST) + 1):
        kept = [i for i, heading in enumerate(headings) if heading not in LEAST_FIRST[:left_out]]
        table = terminal.table(title, [headings[i] for i in kept], [[line[i] for i in kept] for line in lines])
        if _fits(table, out):
            break
    out.print(table)
    if gone := [heading for heading in headings if heading in LEAST_FIRST[:left_out]]:
        out.print(f"no room for {', '.join(gone)}: use a wider terminal, or --format csv", style="yellow")


def _fits(table: Table, out: Console) -> bool:
    return bool(Measurement.get(out, out.options.update(max_width=ENDLESS), table).maximum <= out.width)


def _folded(name: str) -> str:
    """A name on as many lines as keep it narrow, broken behind underscores."""
    lines = [""]
    for part in name.replace("_", "_\n").split("\n"):
        if len(lines[-1] + part) > FOLDED and lines[-1]:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)
