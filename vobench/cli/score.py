"""vobench score, diagnose and metrics."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from vobench.cli import terminal
from vobench.errors import InputError, SettingError
from vobench.metric.settings import ScoreSettings
from vobench.report import score_table
from vobench.runner.trajectory_pair import TrajectorySource
from vobench.setting import hints

if TYPE_CHECKING:
    from vobench.runner.score_files import ScoredFiles

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
    from vobench.runner.metric_catalog import all_metrics, find_metric

    if metric is not None:
        _show_metric(find_metric(metric).as_dict(), as_json=json)
        return
    metrics = all_metrics()
    if json:
        terminal.print_json({"metrics": [definition.as_dict() for definition in metrics]})
        return
    rows = [[d.id, d.unit, d.headline, d.title, "--full" if d.full else ""] for d in metrics]
    terminal.console().print(terminal.table("", ["metric", "unit", "headline", "is", "with"], rows))


def _show_metric(definition: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        terminal.print_json(definition)
        return
    console = terminal.console()
    for name, value in definition.items():
        text = ", ".join(value) if isinstance(value, tuple) else str(value)
        console.print(f"{name:9}  {text}", soft_wrap=True)


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
    from vobench.analysis.diagnose_files import diagnose_files

    found = diagnose_files(_source(gt, gt_topic, gt_as), _source(est, est_topic, est_as), times=times or ())
    if json:
        terminal.print_json(found.as_dict())
        return
    for note in found.notes:
        print(f"note: {note}", file=sys.stderr)
    _print_diagnosis(found.as_dict())


def _source(path: Path, topic: str | None, words: list[str] | None) -> TrajectorySource:
    return TrajectorySource(path, topic, tuple(words or ()))


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


# Options of settings that are not called as the setting is.
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
    from vobench.runner.score_files import FilePair, read_pair_list, score_files

    form = _form(json=json, csv=csv, md=md)
    paths = list(files or ())
    for pair in read_pair_list(listed) if listed else ():
        paths += pair
    if len(paths) == 1 and paths[0].suffix.lower() == ".zip":
        from vobench.cli.report import score_bundle

        score_bundle(paths[0], as_json=json)
        return

    truths, estimates, stated = _paired(paths, covariances or ())
    settings_asked = {
        "alignment": alignment,
        "align_n": align_n,
        "association": association,
        "max_diff_ns": _ns("--t-max-diff", t_max_diff, "max_diff_ns"),
        "offset_ns": _ns("--t-offset", t_offset, "offset_ns"),
        "rpe_delta": rpe_delta,
        "rpe_unit": rpe_unit,
        "rpe_all_pairs": rpe_all_pairs,
        "rpe_pairs_from": rpe_pairs_from,
        "full": full,
        "project": project,
    }
    pairs = []
    for gt, est, covariance in zip(truths, estimates, stated, strict=True):
        pairs.append(FilePair(_source(gt, gt_topic, gt_as), _source(est, est_topic, est_as), covariance))
    found = score_files(pairs, settings=_settings(like, settings_asked), times=times or ())
    _show_score(found, form=form, per_length=per_length)


def _paired(
    paths: Sequence[Path], covariances: Sequence[Path]
) -> tuple[Sequence[Path], Sequence[Path], Sequence[Path | None]]:
    """Truths, estimates and covariances of each pair. Raises BadParameter where files are left over."""
    if not paths or len(paths) % 2:
        are = "is" if len(paths) == 1 else "are"
        raise typer.BadParameter(f"files come in pairs, GT EST, but there {are} {len(paths)}")
    count = len(paths) // 2
    if not covariances:
        return paths[::2], paths[1::2], [None] * count
    if len(covariances) != count:
        raise typer.BadParameter(f"--cov comes once for each pair of files, {count} times (got {len(covariances)})")
    return paths[::2], paths[1::2], covariances


def _form(**asked: bool) -> str:
    forms = [form for form, is_asked in asked.items() if is_asked]
    if len(forms) > 1:
        raise typer.BadParameter(f"choose one of --{' and --'.join(forms)}")
    return forms[0] if forms else "table"


def _settings(like: str | None, asked: dict[str, Any]) -> ScoreSettings:
    """The preset's settings, or our own, with what was asked for. Errors name the option that is wrong."""
    from vobench.runner.score_settings import settings_like

    try:
        return settings_like(like, **asked)
    except SettingError as error:
        setting = str(error.keys[0])
        raise SettingError(error.sentence, OPTIONS.get(setting, setting)) from None


def _ns(option: str, value_s: float | None, setting: str) -> int | None:
    if value_s is None:
        return None
    _, least, most = get_args(hints(ScoreSettings)[setting])
    if not least.ge / 1e9 <= value_s <= most.le / 1e9:
        raise InputError(f"{option} should be {least.ge / 1e9:g} to {most.le / 1e9:g} seconds, got {value_s:g}")
    return round(value_s * 1e9)


def _show_score(found: "ScoredFiles", *, form: str, per_length: bool) -> None:
    """Print every metric with its identity."""
    content = found.as_dict()
    if form == "json":
        terminal.print_json(content)
        return
    for pair in found.pairs:
        for note in pair.notes:
            print(f"note: {note}", file=sys.stderr)
    if form == "csv":
        print(score_table.as_csv(content, per_length=per_length), end="")
    elif form == "md":
        print(score_table.as_markdown(content, found.scores, per_length=per_length), end="")
    else:
        _print_table(found, per_length=per_length)


def _print_table(found: "ScoredFiles", *, per_length: bool) -> None:
    content = found.as_dict()
    console = terminal.console()
    for headings, rows in score_table.tables(content, per_length=per_length):
        console.print(terminal.table("", headings, rows))
    for identity in score_table.ids(content):
        console.print(identity, style="dim", soft_wrap=True)
    for summary in score_table.summaries(content, found.scores):
        console.print(summary, soft_wrap=True)
    for warning in score_table.warnings(content):
        console.print(f"warning: {warning}", style="yellow", soft_wrap=True)
