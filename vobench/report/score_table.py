"""Scores of files as tables: what `vobench score` prints, as headings and rows, CSV or Markdown."""

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from vobench.metric.score import Score
from vobench.report.markdown_table import markdown_table
from vobench.spreadsheet import cell

COLUMNS = ("n", "rmse", "mean", "median", "std", "min", "max", "sse", "p95", "p99")
SHOWN = ("n", "rmse", "mean", "median", "std", "min", "max", "p95", "p99")
WORDS = ("metric", "unit", "sequence", "estimate")  # headings of columns that hold words
MOST_METRICS = 6  # in one table of sequences or estimates
POOLED = "pooled"
POSE_COUNT = re.compile(r"; n=[^;\]]+")  # in the id of a metric
Content = dict[str, Any]
Row = list[str]
Table = tuple[Row, list[Row]]


class Several(NamedTuple):
    """Where the scores of several files stand in the content, and the heading of the column of their names."""

    key: str
    heading: str


SEQUENCES = Several("sequences", "sequence")
ESTIMATES = Several("estimates", "estimate")


def _several(content: Content) -> Several | None:
    """What the scores are of: sequences, or estimates of one ground truth; None if there is only one score."""
    for several in (SEQUENCES, ESTIMATES):
        if several.key in content:
            return several
    return None


def as_csv(content: Content, *, per_length: bool) -> str:
    """All statistics of every metric, one row each; with the name of the file in front if there are several."""
    import pandas as pd

    several = _several(content)
    heading = several.heading if several else ""
    rows = []
    for name, part in _named_parts(content):
        metrics = [*part["metrics"], *(part["per_length"] if per_length else [])]
        rows += [{heading: cell(name), **metric} for metric in metrics]
    columns = ["name", "unit", *COLUMNS, "id"]
    if per_length:
        columns.insert(2, "length_m")
    if several:
        columns.insert(0, heading)
    # Objects stay as they are: a column with a gap would otherwise turn whole numbers into floats.
    table = pd.DataFrame(rows, columns=columns, dtype=object)
    text: str = table.to_csv(index=False, lineterminator="\n")
    return text


def _named_parts(content: Content) -> list[tuple[str, Content]]:
    """The scores by estimate, and those of all sequences pooled; or the only score without a name."""
    several = _several(content)
    if several is None:
        return [("", content)]
    named = [(part["est"], part) for part in content[several.key]]
    if POOLED in content:
        named.append((POOLED, content[POOLED]))
    return named


def as_markdown(content: Content, scored: Sequence[Score], *, per_length: bool) -> str:
    """The tables, and below them how the metrics were computed, with warnings."""
    lines = []
    for headings, rows in tables(content, per_length=per_length):
        words = sum(heading in WORDS for heading in headings)
        lines += [*markdown_table([headings, *rows], words=words), ""]
    sentences = [*ids(content), *summaries(content, scored)]
    sentences += [f"warning: {warning}" for warning in warnings(content)]
    lines += [f"- {sentence}" for sentence in sentences]
    return "\n".join([*lines, ""])


def tables(content: Content, *, per_length: bool) -> list[Table]:
    """Headings and rows of each table: the metrics, or a row per sequence or estimate; then the lengths.

    Lengths are those of all sequences pooled, or of each estimate.
    """
    several = _several(content)
    metric_tables = _side_by_side(content, several.heading) if several else [_metric_table(content)]
    if not per_length:
        return metric_tables
    return [*metric_tables, _length_table(content)]


def _wholes(content: Content) -> list[tuple[str, Content]]:
    """The scores of whole files, with their names: all sequences pooled, each estimate, or the only score."""
    if POOLED in content:
        return [("", content[POOLED])]
    return _named_parts(content)


def _metric_table(content: Content) -> Table:
    rows = [[metric["name"], metric["unit"], *_statistics(metric)] for metric in content["metrics"]]
    return ["metric", "unit", *SHOWN], rows


def _length_table(content: Content) -> Table:
    """The metrics by length of path; of several estimates, those of one length stand together."""
    headings = ["metric", "unit", "length m", *SHOWN]
    wholes = _wholes(content)
    if len(wholes) == 1:
        _, whole = wholes[0]
        return headings, [_length_row(metric) for metric in whole["per_length"]]

    rows_of_length = dict[tuple[str, float], list[Row]]()
    for name, whole in wholes:
        for metric in whole["per_length"]:
            rows = rows_of_length.setdefault((metric["name"], metric["length_m"]), [])
            rows.append([name, *_length_row(metric)])
    return [ESTIMATES.heading, *headings], [row for rows in rows_of_length.values() for row in rows]


def _length_row(metric: Content) -> Row:
    length = f"{metric['length_m']:g}"
    return [metric["name"], metric["unit"], length, *_statistics(metric)]


def _side_by_side(content: Content, heading: str) -> list[Table]:
    """One row per sequence or estimate, with the statistic of each metric that is usually quoted.

    Sequences have one more row for all of them.
    """
    parts = [part for _, part in _named_parts(content)]
    metrics = [metric for part in parts for metric in part["metrics"]]
    heading_of = {metric["name"]: _heading(metric) for metric in metrics}
    names = list(heading_of)
    found = []
    for first in range(0, len(names), MOST_METRICS):
        shown = names[first : first + MOST_METRICS]
        rows = [_quoted_row(name, part, shown) for name, part in _named_parts(content)]
        headings = [heading_of[name] for name in shown]
        found.append(([heading, "coverage", *headings], rows))
    return found


def _heading(metric: Content) -> str:
    """Name, quoted statistic and unit of a metric."""
    unit = "" if metric["unit"] == "1" else f" {metric['unit']}"
    return f"{metric['name']} {_quoted(metric)}{unit}"


def _quoted_row(name: str, part: Content, metrics: Sequence[str]) -> Row:
    value_of = {metric["name"]: f"{metric[_quoted(metric)]:.6g}" for metric in part["metrics"]}
    coverage = f"{part['coverage']:.3f}" if "coverage" in part else ""
    return [name, coverage, *(value_of.get(metric, "") for metric in metrics)]


def _quoted(metric: Content) -> str:
    """The statistic of a metric that is usually quoted, which its id names."""
    return str(metric["id"].partition("[")[0].rpartition(".")[2])


def _statistics(metric: Content) -> Row:
    return [str(metric["n"]), *(f"{metric[name]:.6g}" for name in SHOWN[1:])]


def ids(content: Content) -> list[str]:
    """How each metric was computed. Of several estimates, the number of poses is left out, which differs."""
    found = [metric["id"] for _, whole in _wholes(content) for metric in whole["metrics"]]
    if _several(content) is ESTIMATES:
        found = [POSE_COUNT.sub("", identity) for identity in found]
    return list(dict.fromkeys(found))


def warnings(content: Content) -> list[str]:
    """The warnings of each score, with the name of its estimate if there are several."""
    sentences = []
    for name, part in _named_parts(content):
        prefix = "" if name in ("", POOLED) else f"{name}: "
        sentences += [f"{prefix}{warning}" for warning in part["warnings"]]
    return sentences


def summaries(content: Content, scored: Sequence[Score]) -> list[str]:
    """Coverage and survival of each estimate, and the consistency of its covariances if it has any."""
    several = _several(content)
    parts = content[several.key] if several else [content]
    names = [f"{part['est']}: " if several else "" for part in parts]
    sentences = [f"{name}{_summary(score)}" for name, score in zip(names, scored, strict=True)]
    for name, part in zip(names, parts, strict=True):
        consistency = part.get("consistency")
        if consistency:
            sentences.append(f"{name}{consistency['sentence']}")
    return sentences


def _summary(scored: Score) -> str:
    association = scored.association
    failure = scored.failure
    lost_aware = "" if failure.lost_aware is None else f", lost-aware score {failure.lost_aware:.3f}"
    survived = "survived" if failure.survived else "not survived"
    return (
        f"{association.pairs} pairs of {association.gt_poses} true and {association.est_poses} estimated poses, "
        f"coverage {scored.coverage.ratio:.3f}{lost_aware} ({survived})"
    )
