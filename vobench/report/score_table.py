"""Scores of files as tables: what `vobench score` prints, as headings and rows, CSV or Markdown."""

import csv
import io
from collections.abc import Sequence
from typing import Any

from vobench.metric.score import Score

COLUMNS = ("n", "rmse", "mean", "median", "std", "min", "max", "sse", "p95", "p99")
SHOWN = ("n", "rmse", "mean", "median", "std", "min", "max", "p95", "p99")
WORDS = ("metric", "unit", "sequence")  # headings of columns that hold words
ABREAST = 6  # metrics in one table of sequences
Content = dict[str, Any]
Rows = list[list[str]]


def as_csv(content: Content, *, per_length: bool) -> str:
    """All statistics of every metric, one row each, of several sequences with their names in front."""
    named = [(part["est"], part) for part in content.get("sequences", [])]
    named += [("pooled", content["pooled"])] if named else [("", content)]
    columns = [*(["sequence"] if len(named) > 1 else []), "name", "unit", *(["length_m"] if per_length else [])]
    text = io.StringIO()
    writer = csv.DictWriter(text, [*columns, *COLUMNS, "id"], extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    for name, part in named:
        rows = [*part["metrics"], *(part["per_length"] if per_length else [])]
        writer.writerows({"sequence": name, **row} for row in rows)
    return text.getvalue()


def as_markdown(content: Content, scored: Sequence[Score], *, per_length: bool) -> str:
    """The tables, and below them how the metrics were computed and what to mind."""
    lines = list[str]()
    for headings, rows in tables(content, per_length=per_length):
        words = sum(heading in WORDS for heading in headings)
        lines += [f"| {' | '.join(headings)} |", f"|{'---|' * words}{'---:|' * (len(headings) - words)}"]
        lines += [*(f"| {' | '.join(row)} |" for row in rows), ""]
    said = (*ids(content), *summaries(content, scored), *(f"warning: {w}" for w in warnings(content)))
    return "\n".join([*lines, *(f"- {sentence}" for sentence in said), ""])


def tables(content: Content, *, per_length: bool) -> list[tuple[list[str], Rows]]:
    """Headings and rows of each table: the metrics, or the sequences with all of them pooled, then the lengths."""
    whole = content.get("pooled", content)
    if "sequences" in content:
        found = _sequence_tables(content)
    else:
        rows = [[metric["name"], metric["unit"], *_cells(metric)] for metric in content["metrics"]]
        found = [(["metric", "unit", *SHOWN], rows)]
    if per_length:
        cut = [[row["name"], row["unit"], f"{row['length_m']:g}", *_cells(row)] for row in whole["per_length"]]
        found.append((["metric", "unit", "length m", *SHOWN], cut))
    return found


def _sequence_tables(content: Content) -> list[tuple[list[str], Rows]]:
    """A row for each sequence and one for all of them, with the statistic to quote of each metric."""
    parts = [*content["sequences"], {"est": "pooled", **content["pooled"]}]
    units = {metric["name"]: metric["unit"] for part in parts for metric in part["metrics"]}
    quoted = {metric["name"]: _quoted(metric) for part in parts for metric in part["metrics"]}
    names = list(units)
    tables: list[tuple[list[str], Rows]] = []
    for begin in range(0, len(names), ABREAST):
        chosen = names[begin : begin + ABREAST]
        rows = []
        for part in parts:
            values = {metric["name"]: f"{metric[_quoted(metric)]:.6g}" for metric in part["metrics"]}
            coverage = f"{part['coverage']:.3f}" if "coverage" in part else ""
            rows.append([part["est"], coverage, *(values.get(name, "") for name in chosen)])
        headings = [f"{name} {quoted[name]}{'' if units[name] == '1' else ' ' + units[name]}" for name in chosen]
        tables.append((["sequence", "coverage", *headings], rows))
    return tables


def _quoted(metric: dict[str, Any]) -> str:
    """The statistic of a metric that is quoted, which its id says."""
    return str(metric["id"].partition("[")[0].rpartition(".")[2])


def _cells(metric: dict[str, Any]) -> list[str]:
    return [str(metric["n"]), *(f"{metric[name]:.6g}" for name in SHOWN[1:])]


def ids(content: Content) -> list[str]:
    """How each metric was computed."""
    return [metric["id"] for metric in content.get("pooled", content)["metrics"]]


def warnings(content: Content) -> list[str]:
    """What to mind, of each sequence by its name."""
    if "sequences" not in content:
        return list(content["warnings"])
    said = [f"{part['est']}: {warning}" for part in content["sequences"] for warning in part["warnings"]]
    return [*said, *content["pooled"]["warnings"]]


def summaries(content: Content, scored: Sequence[Score]) -> list[str]:
    """How much of each sequence was covered, and what stated covariances are worth."""
    parts = content.get("sequences", [content])
    names = [f"{part['est']}: " if "sequences" in content else "" for part in parts]
    said = [f"{name}{_summary(result)}" for name, result in zip(names, scored, strict=True)]
    stated = ((name, part.get("consistency")) for name, part in zip(names, parts, strict=True))
    return [*said, *(f"{name}{found['sentence']}" for name, found in stated if found)]


def _summary(scored: Score) -> str:
    met = scored.association
    ratio = scored.coverage.ratio
    failed = scored.failure
    lost_aware = "" if failed.lost_aware is None else f", lost-aware score {failed.lost_aware:.3f}"
    return (
        f"{met.pairs} pairs of {met.gt_poses} true and {met.est_poses} estimated poses, coverage {ratio:.3f}"
        f"{lost_aware} ({'survived' if failed.survived else 'not survived'})"
    )
