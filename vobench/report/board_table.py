"""A board as text: its matrix and its totals for a terminal, and all of it as Markdown, CSV, JSON or LaTeX."""

import csv
import io
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import floor, log10
from typing import TYPE_CHECKING, Any

from vobench.errors import printable
from vobench.report.leaderboard import COSTS, METRICS, Board, Cell, Curve, Total, marks, notes
from vobench.runner.folder import NO_SEQUENCE

if TYPE_CHECKING:
    import pandas as pd

NONE = "–"
DEFAULT_METRIC = "ate"
LEGEND = (
    "* best of its case; ~ not decided against the best, which takes four trials a cell. Several trials: median and "
    "range. ATE: RMSE of position after SE(3) alignment, Sim(3) for those marked so. Totals: by failed trials, then by "
    "the lost-aware score, 1 for perfect; × first: what trials lack of 1, as a ratio to the first's, with the interval "
    "of a paired bootstrap; places: those of 95 % of it; decided: against the one above, by permutation (2 %, Holm)."
)


@dataclass(frozen=True, slots=True)
class Shown:
    """A cell as people read it: its number or how it failed, the range of its trials, and its mark."""

    text: str
    range: str = ""
    mark: str = ""
    failed: bool = False

    def __str__(self) -> str:
        return f"{self.text}{self.mark}{f' ({self.range})' if self.range else ''}"


def matrix(made: Board, metric: str) -> list[tuple[str, list[Shown]]]:
    """Each case with its cells, one an estimator, the best estimator first."""
    marked = marks(made, metric)
    names = made.estimators
    rows = []
    for case in made.cases:
        of_case = [made.cell(case, name) for name in names]
        shown = [_shown(c, metric, marked.get((case, c.estimator), "")) if c else Shown("") for c in of_case]
        rows.append((case, shown))
    return rows


def _shown(cell: Cell, metric: str, mark: str) -> Shown:
    spread = cell.spread(metric)
    lost = f"{cell.failed}/{cell.trials} {cell.status}"
    if cell.failed == cell.trials and metric not in COSTS:
        return Shown(cell.status if cell.trials == 1 else lost, failed=True)
    if spread is None:
        return Shown(NONE)
    middle, low, high = (f"{v:.4f}" if METRICS[metric].higher_is_better else number(v) for v in spread)
    within = [f"{low}–{high}"] if low != high else []
    return Shown(middle, ", ".join([*within, *([lost] if cell.failed else [])]), mark, failed=cell.failed > 0)


def number(value: float | None) -> str:
    """A number with three digits, and no more than five decimals."""
    if value is None:
        return NONE
    return f"{value:.{min(max(2 - floor(log10(max(abs(value), 1e-9))), 0), 5)}f}" if value else "0"


def named(estimator: str, claims: Sequence[str]) -> str:
    """An estimator with what its manifest claims."""
    return f"{estimator} [{', '.join(claims)}]" if claims else estimator


def _places(total: Total) -> str:
    low, high = total.places
    return f"{total.place}" if low == high else f"{total.place} ({low}–{high})"


def _ratio(total: Total) -> str:
    if total.ratio_interval is None:
        return number(total.loss_ratio)
    low, high = map(number, total.ratio_interval)
    return f"{number(total.loss_ratio)} [{low}, {high}]"


def _score(total: Total) -> str:
    return f"{total.score:.{min(max(1 - floor(log10(max(1 - total.score, 1e-9))), 3), 7)}f}"


def _decided(total: Total) -> str:
    if total.p_above is None:
        return NONE
    return "yes" if total.decided_above else "not decided"


COST = "CPU ms/frame"
MEMORY = "MiB"
# Heading and cell of each column of the totals, as people read them.
COLUMNS: tuple[tuple[str, Callable[[Total], str]], ...] = (
    ("#", _places),
    ("estimator", lambda total: named(total.estimator, total.claims)),
    ("score", _score),
    ("× first", _ratio),
    ("decided", _decided),
    ("failed", lambda total: f"{total.failed}/{total.trials}"),
    ("ATE %", lambda total: number(total.ate_percent)),
    ("mean place", lambda total: NONE if total.mean_place is None else f"{total.mean_place:.1f}"),
    (COST, lambda total: f"{number(total.cpu_ms)}{' ◆' if total.is_efficient else ''}"),
    (MEMORY, lambda total: number(total.memory_mib)),
)
HEADINGS = tuple(heading for heading, _ in COLUMNS)


def totals(made: Board) -> list[tuple[str, list[list[str]]]]:
    """Of each group its name, and the headings and cells of its totals; columns of costs only where there are some."""
    timed = any(total.cpu_ms is not None for total in made.totals)
    columns = [column for column in COLUMNS if timed or column[0] not in (COST, MEMORY)]
    found = []
    groups = dict.fromkeys(total.group for total in made.totals)
    for group in groups:
        rows = [[cell(total) for _, cell in columns] for total in made.totals if total.group == group]
        cases = next(total.cases for total in made.totals if total.group == group)
        named_group = [group or "none"] if len(groups) > 1 else []
        over = ", ".join([*named_group, f"{cases} case{'s' if cases > 1 else ''}"])
        found.append((over, [[heading for heading, _ in columns], *rows]))
    return found


def breakdown(curve: Curve) -> str:
    """Where an estimator breaks as a scenario grows more severe, in a sentence."""
    over = f"{curve.scenario} {curve.severities[0]} to {curve.severities[-1]}"
    group = f"{curve.group}, " if curve.group else ""
    ends = "holds out" if curve.breaks_at is None else f"breaks at {curve.breaks_at}"
    return f"{group}{over}: {curve.estimator} {ends} ({', '.join(f'{score:.2f}' for score in curve.scores)})"


def remarks(made: Board) -> list[str]:
    """What is to know of the totals: what they leave out, and what would decide the undecided."""
    said = list(made.remarks)
    above = None
    for total in made.totals:
        if (
            above
            and above.group == total.group
            and not total.decided_above
            and total.cases * total.trials > total.cases
        ):
            asked = f"{total.repeats} repeats of each case" if total.repeats else "more cases, not more repeats,"
            said.append(
                f"{above.estimator} before {total.estimator} is not decided (p = {total.p_above or 1:.2g}); "
                f"{asked} would find a difference of 10 %"
            )
        above = total
    return said + [breakdown(curve) for curve in made.curves]


def cell_notes(made: Board) -> list[str]:
    """What went wrong in each cell, with its case in front where there are several; what is the same is said once."""
    said = dict[str, list[str]]()
    for cell in made.cells:
        for note in notes(cell):
            said.setdefault(note, []).append(cell.case)
    if len(made.cases) == 1:
        return list(said)
    return [f"{cases[0]}{f' and {len(cases) - 1} more' * (len(cases) > 1)}: {note}" for note, cases in said.items()]


def origin(made: Board) -> str:
    """Processor, driver and versions that the figures come from, in one line; empty where they are not known."""
    return f"Made on {made.environment.line()}" if made.environment and made.environment.line() else ""


def markdown(made: Board, metric: str = DEFAULT_METRIC) -> str:
    """The matrix of a metric, the totals, and what to know of them."""
    rows = [[case, *map(str, cells)] for case, cells in matrix(made, metric)]
    lines = [f"## {METRICS[metric].heading}", "", *_md_table([["case", *made.estimators], *rows], words=1)]
    for over, table in totals(made):
        lines += [f"## Totals: {_md(over)}", "", *_md_table(table, words=2)]
    lines += [*(f"- {_md(said)}" for said in (*remarks(made), *cell_notes(made))), "", LEGEND.replace("~", "\\~"), ""]
    lines += [_md(line) + "\n" for line in (made.visible, origin(made)) if line]
    return "\n".join(lines)


def _md_table(table: list[list[str]], *, words: int) -> list[str]:
    headings, *rows = ["| " + " | ".join(map(_md, cells)) + " |" for cells in table]
    return [headings, "|" + "---|" * words + "---:|" * (len(table[0]) - words), *rows, ""]


def _md(text: str) -> str:
    plain = printable(text).replace("\n", " ").replace("&", "&amp;").replace("<", "&lt;")
    return re.sub(r"([\\|*~`])", r"\\\1", plain)


def as_json(made: Board) -> str:
    """The whole board as one JSON object, numbers in full; what is infinitely bad is null."""
    content = {
        "title": made.title,
        "cells": [_row(cell) for cell in made.cells],
        "totals": [asdict(total) for total in made.totals],
        "curves": [asdict(curve) for curve in made.curves],
        "remarks": remarks(made),
        "visible": made.visible,
        "unmade": [asdict(group) for group in made.unmade],
        "environment": asdict(made.environment) if made.environment else None,
    }
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _row(cell: Cell) -> dict[str, Any]:
    """A cell as plain values: of each metric the median, least and largest."""
    spreads = {name: cell.spread(name) or (None, None, None) for name in METRICS}
    numbers = {f"{name}{end}": spreads[name][k] for name in METRICS for k, end in enumerate(("", "_min", "_max"))}
    facts = {**asdict(cell.facts), "trials": cell.trials, "failed": cell.failed}
    said = {name: getattr(cell, name) for name in ("status", "reason", "saw", "drift_mm", "scale_gap", "consistency")}
    frames = cell.answered
    gave = {"frame_reason": frames.reason, "frame_reason_count": frames.count, "frame_reason_first": frames.first}
    dropped = {"frames": frames.frames, "frames_dropped": frames.dropped, "deadlines_missed": frames.late}
    late = {name: getattr(cell, name) for name in ("revised_ate_mm", "revised_segment_percent")}
    drift = {"scale_drift_percent_per_m": cell.scale_drift_percent_per_m}
    return {
        "case": cell.case,
        "estimator": cell.estimator,
        **facts,
        **numbers,
        **said,
        **gave,
        **dropped,
        **late,
        **drift,
    }


def cell_rows(made: Board) -> list[dict[str, Any]]:
    """One flat row for each cell."""
    return [_row(cell) for cell in made.cells]


def rows(made: Board) -> list[dict[str, Any]]:
    """One flat row per cell, then one per total, whose case is `all`, then one per case without a sequence."""
    found = cell_rows(made)
    for total in made.totals:
        stated = {**asdict(total), "case": "all", "ate": total.ate_percent}
        for name, ends in (("places", total.places), ("ratio", total.ratio_interval or (None, None))):
            stated |= {f"{name}_min": ends[0], f"{name}_max": ends[1]}
        gone = ("claims", "places", "ratio_interval", "ate_percent", "repeats", "cases")
        found.append({name: value for name, value in stated.items() if name not in gone})
    for group in made.unmade:
        found += [{"case": case, "status": NO_SEQUENCE, "reason": group.cause} for case in group.cases]
    facts = made.environment.facts() if made.environment else {}
    return [{**row, **facts} for row in found]


def as_csv(made: Board) -> str:
    """Every cell and every total as a row, numbers in full."""
    found = rows(made)
    text = io.StringIO()
    columns = list(dict.fromkeys(name for row in found for name in row))
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _csv_text(value) for name, value in row.items()} for row in found)
    return text.getvalue()


def _csv_text(value: Any) -> Any:
    """A value as a cell; a text that a spreadsheet would take for a formula has an apostrophe before it."""
    if not isinstance(value, str):
        return value
    text = printable(value)
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "|")) else text


def data_frame(made: Board) -> "pd.DataFrame":
    """The same as a pandas table."""
    import pandas as pd

    return pd.DataFrame(rows(made))


TEX = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "–": "--", "×": r"$\times$"}
TEX |= {letter: f"\\{letter}" for letter in "&%$#_{}"} | {"°": r"$^\circ$", "<": "$<$", ">": "$>$", "|": "$|$"}
# columns that fit a page with names as they are, and with the range of each cell
WIDE = 6
NARROW = 3
FEET = (("score", _score), ("place", _places))


def _tex(text: str) -> str:
    return "".join(TEX.get(c, c if c.isascii() else "?") for c in printable(text).replace("\n", " "))


def latex(made: Board, metric: str = DEFAULT_METRIC) -> str:
    """The matrix and the totals as a table with booktabs' rules: best in bold, numbers to the right.

    Whichever are fewer, cases or estimators, are its columns.
    """
    names = made.estimators
    cases = made.cases
    body = matrix(made, metric)
    claims = {cell.estimator: cell.claims for cell in made.cells}
    by_name = {total.estimator: total for total in made.totals} if len(totals(made)) == 1 else {}
    heads = [_tex(named(name, claims[name])) for name in names]
    spans = min(len(names), len(cases)) <= NARROW
    cells = [[_tex_cell(shown, spans=spans) for shown in row] for _, row in body]
    feet = [[title, *(_tex(of(by_name[name])) for name in names)] for title, of in FEET if by_name]
    table = [["", *heads], *([_tex(case), *row] for case, row in zip(cases, cells, strict=True)), *feet]
    if flipped := len(cases) < len(names):
        table = [list(row) for row in zip(*table, strict=True)]
    columns = len(table[0]) - 1
    if columns > WIDE:
        table[0] = ["", *(rf"\rotatebox{{60}}{{{head}}}" for head in table[0][1:])]
    split = len(table) if flipped else len(table) - len(feet)
    several = max((cell.trials for cell in made.cells), default=1) > 1
    trials = f", median{' and range' * spans} of its trials" if several else ""
    seen = f" {made.visible}" if made.visible else ""
    lines = [
        r"% Needs \usepackage{booktabs}" + (r" and \usepackage{graphicx}." if columns > WIDE else "."),
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{_tex(METRICS[metric].heading)} of each case{trials}. "
        rf"Bold: best; $^{{\sim}}$: not decided.{_tex(seen)}}}",
        rf"\label{{tab:{re.sub(r'[^A-Za-z0-9-]+', '-', made.title or 'board')}}}",
        r"\footnotesize\setlength{\tabcolsep}{4pt}",
        r"\begin{tabular}{l" + "r" * columns + "}",
        r"\toprule",
        *_tex_rows(table[:1]),
        r"\midrule",
        *_tex_rows(table[1:split]),
        *([r"\midrule", *_tex_rows(table[split:])] if table[split:] else []),
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]
    if line := origin(made):
        lines.append(f"% {printable(line)}")
    return "\n".join([*lines, ""])


def _tex_rows(table: list[list[str]]) -> list[str]:
    return [f"{' & '.join(cells)} \\\\" for cells in table]


def _tex_cell(shown: Shown, *, spans: bool) -> str:
    text = _tex(shown.text)
    if "*" in shown.mark:
        text = rf"\textbf{{{text}}}"
    elif shown.failed:
        text = rf"\textit{{{text}}}"
    within = rf" {{\tiny {_tex(shown.range)}}}" if shown.range and (spans or shown.failed) else ""
    return text + (r"$^{\sim}$" if "~" in shown.mark else "") + within


FORMATS: dict[str, Callable[[Board, str], str]] = {
    "md": markdown,
    "json": lambda made, _: as_json(made),
    "csv": lambda made, _: as_csv(made),
    "latex": latex,
}
