"""vobench score, diagnose and metrics."""

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
from vobench.report import score_table
from vobench.report.score_table import COLUMNS, Content
from vobench.runner.trajectory_pair import TrajectorySource, read_pair
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
    """Our own metrics, and those installed as entry points. Raises InputError for one that is no metric."""
    installed = []
    for point in entry_points(group=GROUP):
        try:
            metric = point.load()
        except Exception as error:  # somebody else's code may raise anything
            raise InputError(f"the metric {point.value} does not load ({type(error).__name__}: {error})") from error
        if not isinstance(metric, MetricDefinition):
            raise InputError(f"{point.value} should be a MetricDefinition, but is {type(metric).__name__}")
        installed.append(metric)
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


def score_command(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="GT EST",
            help="Ground truth and estimate: TUM, KITTI, TartanAir, EuRoC, MCAP or ROS bag, by content, or the truth "
            "of a sequence's folder. Several pairs are scored one by one and all together. Or a bundle of a run.",
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
    covariances: Annotated[
        list[Path] | None,
        typer.Option("--cov", help="The covariances that EST states (docs/score.md), one file a pair; repeatable."),
    ] = None,
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
    if len(paths) == 1 and paths[0].suffix.lower() == ".zip":
        from vobench.cli.report import score_bundle

        score_bundle(paths[0], as_json=json)
        return
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
    stated: list[Path | None] = [*covariances] if covariances else [None] * len(pairs)
    if len(stated) != len(pairs):
        raise typer.BadParameter(f"--cov comes once for each pair of files, {len(pairs)} times (got {len(stated)})")
    _show_score(pairs, stated, settings, times=times or (), form=form, per_length=per_length)


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
    covariances: Sequence[Path | None],
    settings: ScoreSettings,
    *,
    times: Sequence[Path],
    form: str,
    per_length: bool,
) -> None:
    """Score one pair of trajectories, or several and all of them together, and print every metric with its identity."""
    metrics = tuple(_definitions() if settings.full else DEFINITIONS.values())
    both = zip(pairs, covariances, strict=True)
    scored = [_scored(gt, est, settings, times, metrics, covariance=covariance) for (gt, est), covariance in both]
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
    results = [result for result, _ in scored]
    if form == "csv":
        print(score_table.as_csv(content, per_length=per_length), end="")
    elif form == "md":
        print(score_table.as_markdown(content, results, per_length=per_length), end="")
    else:
        _print_table(content, results, per_length=per_length)


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
    *,
    covariance: Path | None,
) -> tuple[Score, Content]:
    pair = read_pair(gt, est, times=times)
    if pair.by_frame and settings.rpe_unit == "s":
        raise InputError("a delta in seconds needs stamps, and neither file has any; name one with --times")
    P = None
    if covariance:
        from vobench.runner.consistency import Consistency, read_covariances

        P = read_covariances(covariance, pair.est.trajectory.t_ns)
    scored = score(pair.gt.trajectory, pair.est.trajectory, settings=settings, metrics=metrics, covariance=P)
    content = scored.as_dict()
    if covariance:
        found = Consistency.of(next(each.errors for each in scored.samples if each.of.id == "nees_pose"))
        content["consistency"] = {**found.model_dump(), "sentence": found.sentence}
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


def _print_table(content: Content, scored: Sequence[Score], *, per_length: bool) -> None:
    out = terminal.console()
    for headings, rows in score_table.tables(content, per_length=per_length):
        out.print(terminal.table("", headings, rows))
    for identity in score_table.ids(content):
        out.print(identity, style="dim", soft_wrap=True)
    for summary in score_table.summaries(content, scored):
        out.print(summary, soft_wrap=True)
    for warning in score_table.warnings(content):
        out.print(f"warning: {warning}", style="yellow", soft_wrap=True)
