"""vobench score, diagnose and metrics."""

import csv as csv_module
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import entry_points
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from vobench.analysis.diagnose import Finding, diagnose
from vobench.cli import terminal
from vobench.errors import AlignmentError, InputError, SettingError, UnknownNameError, unknown
from vobench.metric.comparison import MetricDefinition
from vobench.metric.definitions import DEFINITIONS
from vobench.metric.score import Score, pooled, score
from vobench.metric.settings import LIKE, PAIRS_OF_RULE, Plane, ScoreSettings, Side, Unit
from vobench.run.trajectory_pair import TrajectorySource, read_pair
from vobench.setting import hints
from vobench.trajectory.align import Kind
from vobench.trajectory.associate import Method

GROUP = "vobench.metrics"  # of entry points, each a MetricDefinition

Gt = Annotated[Path, typer.Argument(metavar="GT", help="Ground truth: a file of any form, or a sequence's folder.")]
Est = Annotated[
    Path, typer.Argument(metavar="EST", help="Estimate: TUM, KITTI, TartanAir, EuRoC, MCAP or ROS bag, by content.")
]
Topic = Annotated[str | None, typer.Option(help="The topic with the poses, or /tf:parent.child.")]
As = Annotated[
    list[str] | None,
    typer.Option(
        help="s|ms|us|ns, xyzw|wxyz, inverse, rotations:inverse, axes:z,-x,-y, positions:y,x,z or "
        "mount:x,y,z,qx,qy,qz,qw; repeatable."
    ),
]
Times = Annotated[
    list[Path] | None,
    typer.Option(help="Stamps in seconds, one a line, for files without (KITTI); repeatable: each takes what fits it."),
]


def metrics_command(
    metric: Annotated[str | None, typer.Argument(metavar="[ID]", help="All where left out.")] = None,
    *,
    json: terminal.Json = False,
) -> None:
    """Define a metric: formula, source, settings, and what it cannot see."""
    definitions = _definitions()
    found = None if metric is None else _find(metric, definitions).as_dict()
    if json:
        terminal.print_json(found or {"metrics": [definition.as_dict() for definition in definitions]})
    elif found is None:
        rows = [[d.id, d.unit, d.headline, d.title, "--full" if d.full else ""] for d in definitions]
        terminal.console().print(terminal.table("", ["metric", "unit", "headline", "is", "with"], rows))
    else:
        out = terminal.console()
        for name, value in found.items():
            stated = ", ".join(value) if isinstance(value, tuple) else str(value)
            out.print(f"{name:9}  {stated}", soft_wrap=True)


def _definitions() -> list[MetricDefinition]:
    """Our own metrics, and those installed as entry points."""
    installed = [point.load() for point in entry_points(group=GROUP)]
    return [*DEFINITIONS.values(), *(metric for metric in installed if metric.id not in DEFINITIONS)]


def _find(metric: str, known: list[MetricDefinition]) -> MetricDefinition:
    """The definition of a metric's name, or of the start of an id such as ate.trans.rmse[…]."""
    stem = metric.partition("[")[0]
    for definition in known:
        if definition.id == metric.lower() or definition.identity in (stem, stem.rpartition(".")[0]):
            return definition
    raise UnknownNameError(unknown("metric", metric, [definition.id for definition in known]))


WITHOUT_OPTION = {
    "swapped_inputs": "give the two files in the other order",
    "unrelated": "none; see whether both files are of the same recording",
}


def diagnose_command(
    gt: Gt,
    est: Est,
    *,
    gt_topic: Topic = None,
    est_topic: Topic = None,
    gt_as: As = None,
    est_as: As = None,
    times: Times = None,
    json: terminal.Json = False,
) -> None:
    """Say what is wrong between two trajectories (frames, axes, scale, clocks, quaternions), and what mends it."""
    truth, estimate = _source(gt, gt_topic, gt_as), _source(est, est_topic, est_as)
    pair = read_pair(truth, estimate, times=times or (), any_unit=True)
    findings = diagnose(pair.gt, pair.est)

    def command(findings: Sequence[Finding]) -> str | None:
        return None if is_unrelated or not findings else _command(truth, estimate, times or (), findings)

    is_unrelated = any(finding.fault == "unrelated" for finding in findings)
    content = {
        "findings": [{**finding.as_dict(), "command": command([finding])} for finding in findings],
        "command": command(findings),
        "warnings": [pair.by_frame] if pair.by_frame else [],
        "notes": list(pair.notes),
    }
    if json:
        terminal.print_json(content)
        return
    for note in pair.notes:
        print(f"note: {note}", file=sys.stderr)
    _print_diagnosis(content)


def _source(path: Path, topic: str | None, words: list[str] | None) -> TrajectorySource:
    return TrajectorySource(path, topic, tuple(words or ()))


def _command(gt: TrajectorySource, est: TrajectorySource, times: Sequence[Path], findings: Sequence[Finding]) -> str:
    """The score that all these findings mend: of swapped files each is named for what it is."""
    is_swapped = any(finding.fault == "swapped_inputs" for finding in findings)
    files = [str(gt.path), str(est.path)]
    words = [part for side in (("gt", gt), ("est", est)) for part in _source_words(*side)]
    words += [option for finding in findings for option in finding.options]
    if is_swapped:
        files.reverse()
        words = [_exchanged(word) for word in words]
    words += [part for path in times for part in ("--times", str(path))]
    return shlex.join(["vobench", "score", *files, *words])


def _exchanged(word: str) -> str:
    """An option as it reads once truth and estimate have changed places."""
    for side, other in (("gt", "est"), ("est", "gt")):
        if word.startswith(f"--{side}-"):
            return f"--{other}-{word.removeprefix(f'--{side}-')}"
    if word.startswith("--t-offset="):
        offset = word.removeprefix("--t-offset=")
        return f"--t-offset={offset[1:] if offset.startswith('-') else f'-{offset}'}"
    return word


def _source_words(side: str, source: TrajectorySource) -> list[str]:
    topic = [f"--{side}-topic", source.topic] if source.topic else []
    return [*topic, *(part for word in source.words for part in (f"--{side}-as", word))]


def _print_diagnosis(content: dict[str, Any]) -> None:
    out = terminal.console()
    for warning in content["warnings"]:
        out.print(f"warning: {warning}", style="yellow", soft_wrap=True)
    if not content["findings"]:
        out.print("nothing wrong was found: what differs are errors of the estimate")
        return
    for finding in content["findings"]:
        out.print(f"{finding['fault']}: {finding['sentence']}", style="bold", soft_wrap=True)
        for figure in finding["evidence"]:
            unit = "" if figure["unit"] == "1" else f" {figure['unit']}"
            before = "none" if figure["before"] is None else f"{figure['before']:.4g}{unit}"
            out.print(f"  {figure['name']}: {before}, mended {figure['after']:.4g}{unit}", soft_wrap=True)
        out.print(f"  mend: {' '.join(finding['options']) or WITHOUT_OPTION[finding['fault']]}", soft_wrap=True)
    if content["command"]:
        out.print(f"all of it: {content['command']}", soft_wrap=True)


# Settings that are one of a few names, what these are names of, and the names.
CHOSEN = {
    "alignment": ("alignment", get_args(Kind)),
    "association": ("association", get_args(Method)),
    "rpe_unit": ("unit", get_args(Unit)),
    "rpe_pairs_from": ("side", get_args(Side)),
    "project": ("plane", get_args(Plane)),
}
OPTIONS = {"alignment": "--align", "align_n": "--align-n", "rpe_delta": "--delta"}
COLUMNS = ("n", "rmse", "mean", "median", "std", "min", "max", "sse", "p95", "p99")
SHOWN = ("n", "rmse", "mean", "median", "std", "min", "max", "p95", "p99")
WORDS = ("metric", "unit", "sequence")  # headings of columns that hold words
ABREAST = 6  # metrics in one table of sequences
Content = dict[str, Any]
Rows = list[list[str]]


def score_command(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="GT EST",
            help="Ground truth and estimate: TUM, KITTI, TartanAir, EuRoC, MCAP or ROS bag, by content, or the truth "
            "of a sequence's folder. Several pairs are scored one by one and all together.",
        ),
    ] = None,
    *,
    listed: Annotated[
        Path | None, typer.Option("--list", help="A file with GT and EST on each line, besides those given here.")
    ] = None,
    like: Annotated[
        str | None, typer.Option(help="Set what evo, kitti, rpg, tum, openvins, tartanair or tartanair_mono would.")
    ] = None,
    alignment: Annotated[
        str | None, typer.Option("--align", "-a", help="none, origin, se3 (our default), sim3, scale or yaw.")
    ] = None,
    align_n: Annotated[int | None, typer.Option(help="Align by the first so many matched poses.")] = None,
    rpe_delta: Annotated[
        float | None, typer.Option("--delta", "-d", help="RPE over so much, more than 0; 1 by default.")
    ] = None,
    rpe_unit: Annotated[
        str | None, typer.Option("--delta-unit", "-u", help="f (frames), m, s, d (degrees) or r (radians).")
    ] = None,
    rpe_all_pairs: Annotated[
        bool | None, typer.Option("--all-pairs/--consecutive", help="RPE over all pairs, or end to end.")
    ] = None,
    rpe_pairs_from: Annotated[
        str | None, typer.Option("--pairs-from", help="RPE's pairs are chosen on gt or est.")
    ] = None,
    t_max_diff: Annotated[float | None, typer.Option(help="Poses further apart are no pair, in s; 0.01.")] = None,
    t_offset: Annotated[float | None, typer.Option(help="Added to the estimate's stamps, in s.")] = None,
    association: Annotated[
        str | None, typer.Option("--assoc", help="nearest, evo, interpolate, greedy or in_order.")
    ] = None,
    project: Annotated[
        str | None, typer.Option(help="Compare in the plane xy, xz or yz of the truth, once aligned.")
    ] = None,
    full: Annotated[bool | None, typer.Option("--full", help="Every metric, not only the headlines.")] = None,
    per_length: Annotated[
        bool, typer.Option("--per-length", help="Segments and parts over each length too; --json always has them.")
    ] = False,
    gt_topic: Topic = None,
    est_topic: Topic = None,
    gt_as: As = None,
    est_as: As = None,
    times: Times = None,
    json: terminal.Json = False,
    csv: Annotated[bool, typer.Option("--csv", help="Print CSV.")] = False,
    md: Annotated[bool, typer.Option("--md", help="Print Markdown.")] = False,
) -> None:
    """Score estimates against ground truth: ATE, RPE, segments, coverage."""
    form = _form(json=json, csv=csv, md=md)
    paths = [*(files or ()), *(_read_list(listed) if listed else ())]
    if not paths or len(paths) % 2:
        raise typer.BadParameter(
            f"files come in pairs, GT EST, but there {'is' if len(paths) == 1 else 'are'} {len(paths)}"
        )
    settings = _settings(
        like,
        alignment=alignment,
        align_n=align_n,
        association=association,
        max_diff_ns=_ns("--t-max-diff", t_max_diff, "max_diff_ns"),
        offset_ns=_ns("--t-offset", t_offset, "offset_ns"),
        rpe_delta=rpe_delta,
        rpe_unit=rpe_unit,
        rpe_all_pairs=rpe_all_pairs,
        rpe_pairs_from=rpe_pairs_from,
        full=full,
        project=project,
    )
    truths, estimates = [_source(gt, gt_topic, gt_as) for gt in paths[::2]], paths[1::2]
    pairs = [(gt, _source(est, est_topic, est_as)) for gt, est in zip(truths, estimates, strict=True)]
    _show_score(pairs, settings, times=times or (), form=form, per_length=per_length)


def _form(**asked: bool) -> str:
    forms = [form for form, is_asked in asked.items() if is_asked]
    if len(forms) > 1:
        raise typer.BadParameter(f"choose one of --{' and --'.join(forms)}")
    return forms[0] if forms else "table"


def _settings(like: str | None, **asked: Any) -> ScoreSettings:
    """The preset's settings, or our own without one, with what else was asked for, which is not None.

    Raises UnknownNameError or InputError for what can't be asked.
    """
    for name, what, known in [(like, "preset", tuple(LIKE)), *((asked[key], *named) for key, named in CHOSEN.items())]:
        if name is not None:
            terminal.known(what, name, known)
    base = LIKE[like] if like else ScoreSettings()
    if base.rpe_rule in PAIRS_OF_RULE and not _keeps_pairs(base, asked):
        asked["rpe_rule"] = ScoreSettings().rpe_rule  # other pairs than that tool has are ours
    try:
        return replace(base, **{name: value for name, value in asked.items() if value is not None})
    except SettingError as error:
        name = str(error.keys[0])
        raise SettingError(error.sentence, OPTIONS.get(name, name)) from None


def _keeps_pairs(base: ScoreSettings, asked: Mapping[str, Any]) -> bool:
    """Whether the pairs asked for are those of a tool whose rule knows no others."""
    own = dict(zip(("rpe_unit", "rpe_all_pairs", "rpe_pairs_from"), PAIRS_OF_RULE[base.rpe_rule], strict=True))
    are_own = all(asked[name] in (None, value) for name, value in own.items())
    return are_own and asked["project" if base.rpe_rule == "tum" else "rpe_delta"] is None


def _show_score(
    pairs: Sequence[tuple[TrajectorySource, TrajectorySource]],
    settings: ScoreSettings,
    *,
    times: Sequence[Path],
    form: str,
    per_length: bool,
) -> None:
    """Score one pair of trajectories, or several and all of them together, and print every metric with its identity."""
    metrics = tuple(_definitions() if settings.full else DEFINITIONS.values())
    scored = [_scored(gt, est, settings, times, metrics) for gt, est in pairs]
    content = scored[0][1] if len(scored) == 1 else _together(pairs, scored)
    parts = [*content["sequences"], content["pooled"]] if "sequences" in content else [content]
    for metric in (metric for part in parts for metric in part["metrics"]):
        _require_finite(metric)
    if form == "json":
        terminal.print_json(content)
        return
    for part in content.get("sequences", [content]):
        for note in part["notes"]:
            print(f"note: {note}", file=sys.stderr)
    FORMS[form](content, [result for result, _ in scored], per_length)


def _read_list(path: Path) -> list[Path]:
    """The files that a list names, truth and estimate on each line, from the list's own folder. Raises InputError."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read {path}: {getattr(error, 'strerror', None) or 'not a text in UTF-8'}") from None
    found: list[Path] = []
    for number, line in enumerate(lines, 1):
        words = shlex.split(line, comments=True)
        if len(words) not in (0, 2):
            raise InputError(f"{path}:{number}: a line should name a truth and an estimate, but has {len(words)} words")
        found += [path.parent / word for word in words]
    if not found:
        raise InputError(f"no line names a truth and an estimate: {path}")
    return found


def _scored(
    gt: TrajectorySource,
    est: TrajectorySource,
    settings: ScoreSettings,
    times: Sequence[Path],
    metrics: Sequence[MetricDefinition],
) -> tuple[Score, Content]:
    pair = read_pair(gt, est, times=times)
    if pair.by_frame and settings.rpe_unit == "s":
        raise InputError("a delta in seconds needs stamps, and neither file has any; name one with --times")
    scored = score(pair.gt.trajectory, pair.est.trajectory, settings=settings, metrics=metrics)
    content = scored.as_dict()
    content["warnings"] = [*([pair.by_frame] if pair.by_frame else []), *content["warnings"]]
    content["notes"] = list(pair.notes)
    content["per_length"] = [row.as_dict() for row in scored.per_length]
    return scored, content


def _together(
    pairs: Sequence[tuple[TrajectorySource, TrajectorySource]], scored: Sequence[tuple[Score, Content]]
) -> Content:
    """Several sequences, and their errors pooled."""
    sequences = [
        {"gt": str(gt.path), "est": str(est.path), **content}
        for (gt, est), (_, content) in zip(pairs, scored, strict=True)
    ]
    pool = pooled([result for result, _ in scored])
    together = {
        "metrics": [metric.as_dict() for metric in pool.metrics],
        "per_length": [row.as_dict() for row in pool.per_length],
        "warnings": list(pool.warnings),
    }
    return {"sequences": sequences, "pooled": together}


def _ns(option: str, value_s: float | None, setting: str) -> int | None:
    if value_s is None:
        return None
    _, least, most = get_args(hints(ScoreSettings)[setting])
    if not least.ge / 1e9 <= value_s <= most.le / 1e9:
        raise InputError(f"{option} should be {least.ge / 1e9:g} to {most.le / 1e9:g} seconds, got {value_s:g}")
    return round(value_s * 1e9)


def _require_finite(metric: dict[str, Any]) -> None:
    """No score is printed with a nan in it. Raises AlignmentError."""
    for name in COLUMNS:
        if not isfinite(metric[name]):
            raise AlignmentError(f"the {name} of {metric['name']} is {metric[name]}: positions are too far apart")


def _print_csv(content: Content, scored: Sequence[Score], per_length: bool) -> None:
    del scored
    named = [(part["est"], part) for part in content.get("sequences", [])]
    named += [("pooled", content["pooled"])] if named else [("", content)]
    columns = [*(["sequence"] if len(named) > 1 else []), "name", "unit", *(["length_m"] if per_length else [])]
    writer = csv_module.DictWriter(sys.stdout, [*columns, *COLUMNS, "id"], extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    for name, part in named:
        rows = [*part["metrics"], *(part["per_length"] if per_length else [])]
        writer.writerows({"sequence": name, **row} for row in rows)


def _print_md(content: Content, scored: Sequence[Score], per_length: bool) -> None:
    for headings, rows in _tables(content, per_length):
        words = sum(heading in WORDS for heading in headings)
        print(f"| {' | '.join(headings)} |\n|{'---|' * words}{'---:|' * (len(headings) - words)}")
        for row in rows:
            print(f"| {' | '.join(row)} |")
        print()
    for sentence in (*_ids(content), *_summaries(content, scored), *(f"warning: {w}" for w in _warnings(content))):
        print(f"- {sentence}")


def _print_table(content: Content, scored: Sequence[Score], per_length: bool) -> None:
    out = terminal.console()
    for headings, rows in _tables(content, per_length):
        out.print(terminal.table("", headings, rows))
    for identity in _ids(content):
        out.print(identity, style="dim", soft_wrap=True)
    for summary in _summaries(content, scored):
        out.print(summary, soft_wrap=True)
    for warning in _warnings(content):
        out.print(f"warning: {warning}", style="yellow", soft_wrap=True)


def _tables(content: Content, per_length: bool) -> list[tuple[list[str], Rows]]:
    """Headings and rows of each table: the metrics, or the sequences with all of them pooled, then the lengths."""
    whole = content.get("pooled", content)
    if "sequences" in content:
        tables = _sequence_tables(content)
    else:
        rows = [[metric["name"], metric["unit"], *_cells(metric)] for metric in content["metrics"]]
        tables = [(["metric", "unit", *SHOWN], rows)]
    if per_length:
        cut = [[row["name"], row["unit"], f"{row['length_m']:g}", *_cells(row)] for row in whole["per_length"]]
        tables.append((["metric", "unit", "length m", *SHOWN], cut))
    return tables


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


def _ids(content: Content) -> list[str]:
    return [metric["id"] for metric in content.get("pooled", content)["metrics"]]


def _warnings(content: Content) -> list[str]:
    if "sequences" not in content:
        return list(content["warnings"])
    said = [f"{part['est']}: {warning}" for part in content["sequences"] for warning in part["warnings"]]
    return [*said, *content["pooled"]["warnings"]]


def _summaries(content: Content, scored: Sequence[Score]) -> list[str]:
    names = [f"{part['est']}: " for part in content.get("sequences", [])] or [""]
    return [f"{name}{_summary(result)}" for name, result in zip(names, scored, strict=True)]


def _summary(scored: Score) -> str:
    met, ratio, failed = scored.association, scored.coverage.ratio, scored.failure
    lost_aware = "" if failed.lost_aware is None else f", lost-aware score {failed.lost_aware:.3f}"
    return (
        f"{met.pairs} pairs of {met.gt_poses} true and {met.est_poses} estimated poses, coverage {ratio:.3f}"
        f"{lost_aware} ({'survived' if failed.survived else 'not survived'})"
    )


FORMS = {"table": _print_table, "csv": _print_csv, "md": _print_md}
