"""Scores of files as tables: what `vobench score` prints, as headings and rows, CSV or Markdown."""

from collections.abc import Sequence
from typing import Any

from vobench.metric.score import Score
from vobench.report.markdown_table import markdown_table
from vobench.spreadsheet import cell

COLUMNS = ("n", "rmse", "mean", "median", "std", "min", "max", "sse", "p95", "p99")
SHOWN = ("n", "rmse", "mean", "median", "std", "min", "max", "p95", "p99")
WORDS = ("metric", "unit", "sequence")  # headings of columns that hold words
MOST_METRICS = 6  # in one table of sequences
POOLED = "pooled"
Content = dict[str, Any]
Row = list[str]
Table = tuple[Row, list[Row]]


def as_csv(content: Content, *, per_length: bool) -> str:
    """All statistics of every metric, one row each; with the name of the sequence in front if there are several."""
    import pandas as pd

    rows = []
    for name, part in _named_parts(content):
        metrics = [*part["metrics"], *(part["per_length"] if per_length else [])]
        rows += [{"sequence": cell(name), **metric} for metric in metrics]
    columns = ["name", "unit", *COLUMNS, "id"]
    if per_length:
        columns.insert(2, "length_m")
    if "sequences" in content:
        columns.insert(0, "sequence")
    # Objects stay as they are: a column with a gap would otherwise turn whole numbers into floats.
    table = pd.DataFrame(rows, columns=columns, dtype=object)
    text: str = table.to_csv(index=False, lineterminator="\n")
    return text


def _named_parts(content: Content) -> list[tuple[str, Content]]:
    """The scores by sequence, and those of all sequences pooled; or the only score without a name."""
    if "sequences" not in content:
        return [("", content)]
    named = [(part["est"], part) for part in content["sequences"]]
    return [*named, (POOLED, content[POOLED])]


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
    """Headings and rows of each table: the metrics, or the sequences and all of them pooled; then the lengths."""
    metric_tables = _sequence_tables(content) if "sequences" in content else [_metric_table(content)]
    if not per_length:
        return metric_tables
    return [*metric_tables, _length_table(_whole(content))]


def _whole(content: Content) -> Content:
    """The score of all sequences pooled, or the only score."""
    whole: Content = content.get(POOLED, content)
    return whole


def _metric_table(content: Content) -> Table:
    rows = [[metric["name"], metric["unit"], *_statistics(metric)] for metric in content["metrics"]]
    return ["metric", "unit", *SHOWN], rows


def _length_table(content: Content) -> Table:
    """The metrics by length of path."""
    rows = [_length_row(metric) for metric in content["per_length"]]
    return ["metric", "unit", "length m", *SHOWN], rows


def _length_row(metric: Content) -> Row:
    length = f"{metric['length_m']:g}"
    return [metric["name"], metric["unit"], length, *_statistics(metric)]


def _sequence_tables(content: Content) -> list[Table]:
    """One row per sequence and one for all of them, with the statistic of each metric that is usually quoted."""
    parts = [part for _, part in _named_parts(content)]
    metrics = [metric for part in parts for metric in part["metrics"]]
    heading_of = {metric["name"]: _heading(metric) for metric in metrics}
    names = list(heading_of)
    sequence_tables = []
    for first in range(0, len(names), MOST_METRICS):
        shown = names[first : first + MOST_METRICS]
        rows = [_sequence_row(name, part, shown) for name, part in _named_parts(content)]
        headings = [heading_of[name] for name in shown]
        sequence_tables.append((["sequence", "coverage", *headings], rows))
    return sequence_tables


def _heading(metric: Content) -> str:
    """Name, quoted statistic and unit of a metric."""
    unit = "" if metric["unit"] == "1" else f" {metric['unit']}"
    return f"{metric['name']} {_quoted(metric)}{unit}"


def _sequence_row(sequence: str, part: Content, metrics: Sequence[str]) -> Row:
    value_of = {metric["name"]: f"{metric[_quoted(metric)]:.6g}" for metric in part["metrics"]}
    coverage = f"{part['coverage']:.3f}" if "coverage" in part else ""
    return [sequence, coverage, *(value_of.get(name, "") for name in metrics)]


def _quoted(metric: Content) -> str:
    """The statistic of a metric that is usually quoted, which its id names."""
    return str(metric["id"].partition("[")[0].rpartition(".")[2])


def _statistics(metric: Content) -> Row:
    return [str(metric["n"]), *(f"{metric[name]:.6g}" for name in SHOWN[1:])]


def ids(content: Content) -> list[str]:
    """How each metric was computed."""
    return [metric["id"] for metric in _whole(content)["metrics"]]


def warnings(content: Content) -> list[str]:
    """The warnings of each score, with the name of its sequence if there are several."""
    if "sequences" not in content:
        return list(content["warnings"])
    sentences = []
    for part in content["sequences"]:
        sentences += [f"{part['est']}: {warning}" for warning in part["warnings"]]
    return [*sentences, *content[POOLED]["warnings"]]


def summaries(content: Content, scored: Sequence[Score]) -> list[str]:
    """Coverage and survival of each sequence, and the consistency of its covariances if it has any."""
    is_several = "sequences" in content
    parts = content["sequences"] if is_several else [content]
    names = [f"{part['est']}: " if is_several else "" for part in parts]
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
