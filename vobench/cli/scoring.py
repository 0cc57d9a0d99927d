"""vobench score."""

import csv
import sys
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, get_args

from vobench.cli import terminal
from vobench.errors import AlignmentError, InputError, UnknownNameError
from vobench.metric.score import Score, score
from vobench.metric.settings import LIKE, ScoreSettings, Side, Unit
from vobench.pipeline.pair import Source, read_pair
from vobench.trajectory.align import Kind
from vobench.trajectory.associate import Method

MAX_WINDOW_S = 1e6
MAX_OFFSET_S = 2e9  # from a clock that starts at 0 to one that counts from 1970
COLUMNS = ("n", "rmse", "mean", "median", "std", "min", "max", "sse", "p95", "p99")
SHOWN = ("n", "rmse", "mean", "median", "std", "min", "max", "p95", "p99")


@dataclass(frozen=True, slots=True)
class Asked:
    """The settings asked for; None leaves them to the preset `like`, or to our own defaults without one."""

    like: str | None = None
    alignment: str | None = None
    align_n: int | None = None
    association: str | None = None
    max_diff_s: float | None = None
    offset_s: float | None = None
    rpe_delta: float | None = None
    rpe_unit: str | None = None
    rpe_all_pairs: bool | None = None
    rpe_pairs_from: str | None = None
    full: bool | None = None

    def settings(self) -> ScoreSettings:
        """What to score with. Raises UnknownNameError, InputError or AlignmentError for what can't be asked."""
        _require_known("preset", self.like, tuple(LIKE))
        _require_known("alignment", self.alignment, get_args(Kind))
        _require_known("association", self.association, get_args(Method))
        _require_known("unit", self.rpe_unit, get_args(Unit))
        _require_known("side", self.rpe_pairs_from, get_args(Side))
        if self.rpe_delta is not None and not 0 < self.rpe_delta < float("inf"):
            raise InputError(f"--delta should be more than 0 and finite, got {self.rpe_delta:g}")
        own = {field.name for field in fields(ScoreSettings)} & set(self.__slots__)
        asked = {name: getattr(self, name) for name in own}
        asked["max_diff_ns"] = _ns("--t-max-diff", self.max_diff_s, 0, MAX_WINDOW_S)
        asked["offset_ns"] = _ns("--t-offset", self.offset_s, -MAX_OFFSET_S, MAX_OFFSET_S)
        base = LIKE[self.like] if self.like else ScoreSettings()
        if base.rpe_rule == "tum" and not _are_tums(self.rpe_unit, self.rpe_all_pairs, self.rpe_pairs_from):
            asked["rpe_rule"] = ScoreSettings().rpe_rule  # other pairs than TUM's script has are ours
        return replace(base, **{name: value for name, value in asked.items() if value is not None})


def show(gt: Source, est: Source, asked: Asked, *, times: Path | None, form: str) -> None:
    """Score two trajectories and print every metric with its identity, as a table, json, csv or md."""
    settings = asked.settings()
    pair = read_pair(gt, est, times=times)
    if pair.notes and settings.rpe_unit == "s":
        raise InputError("a delta in seconds needs stamps, and neither file has any; name one with --times")
    scored = score(pair.gt.trajectory, pair.est.trajectory, settings=settings)
    content = scored.as_dict()
    content["warnings"] = [*pair.notes, *content["warnings"]]
    _require_finite(content["metrics"])
    FORMS[form](content, scored)


def _are_tums(unit: str | None, all_pairs: bool | None, side: str | None) -> bool:
    """Whether the pairs asked for are those of TUM's script, the only ones that its rule knows."""
    return unit in (None, "s") and all_pairs is not False and side in (None, "est")


def _require_known(what: str, name: str | None, known: tuple[str, ...]) -> None:
    if name is not None and name not in known:
        from vobench.catalog.catalog import unknown

        raise UnknownNameError(unknown(what, name, list(known)))


def _ns(option: str, value_s: float | None, least_s: float, most_s: float) -> int | None:
    if value_s is None:
        return None
    if not least_s <= value_s <= most_s:
        raise InputError(f"{option} should be {least_s:g} to {most_s:g} seconds, got {value_s:g}")
    return round(value_s * 1e9)


def _require_finite(metrics: list[dict[str, Any]]) -> None:
    """No score is printed with a nan in it. Raises AlignmentError."""
    for metric in metrics:
        for name in COLUMNS:
            if not abs(metric[name]) < float("inf"):
                raise AlignmentError(f"the {name} of {metric['name']} is {metric[name]}: positions are too far apart")


def _print_json(content: dict[str, Any], scored: Score) -> None:
    del scored
    terminal.print_json(content)


def _print_csv(content: dict[str, Any], scored: Score) -> None:
    del scored
    writer = csv.DictWriter(sys.stdout, ["name", "unit", *COLUMNS, "id"], extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(content["metrics"])


def _print_md(content: dict[str, Any], scored: Score) -> None:
    print(f"| metric | unit | {' | '.join(SHOWN)} |\n|---|---|{'---:|' * len(SHOWN)}")
    for metric in content["metrics"]:
        print(f"| {metric['name']} | {metric['unit']} | {' | '.join(_cells(metric))} |")
    print()
    for sentence in [*_ids(content), _summary(scored), *(f"warning: {w}" for w in content["warnings"])]:
        print(f"- {sentence}")


def _print_table(content: dict[str, Any], scored: Score) -> None:
    rows = [[metric["name"], metric["unit"], *_cells(metric)] for metric in content["metrics"]]
    out = terminal.console()
    out.print(terminal.table("", ["metric", "unit", *SHOWN], rows))
    for identity in _ids(content):
        out.print(identity, style="dim", soft_wrap=True)
    out.print(_summary(scored), soft_wrap=True)
    for warning in content["warnings"]:
        out.print(f"warning: {warning}", style="yellow", soft_wrap=True)


def _cells(metric: dict[str, Any]) -> list[str]:
    return [str(metric["n"]), *(f"{metric[name]:.6g}" for name in SHOWN[1:])]


def _ids(content: dict[str, Any]) -> list[str]:
    return [metric["id"] for metric in content["metrics"]]


def _summary(scored: Score) -> str:
    met, ratio, failed = scored.association, scored.coverage.ratio, scored.failure
    lost_aware = "" if failed.lost_aware is None else f", lost-aware score {failed.lost_aware:.3f}"
    return (
        f"{met.pairs} pairs of {met.gt_poses} true and {met.est_poses} estimated poses, coverage {ratio:.3f}"
        f"{lost_aware} ({'survived' if failed.survived else 'not survived'})"
    )


FORMS = {"table": _print_table, "json": _print_json, "csv": _print_csv, "md": _print_md}
