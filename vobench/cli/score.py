"""vobench score."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from vobench.cli import terminal
from vobench.cli.evo_align import EvoAlignCommand
from vobench.cli.option import Json, option_group, with_option_groups
from vobench.cli.trajectory_option import TrajectoryOptions
from vobench.errors import InputError, SettingError
from vobench.metric.settings import ScoreSettings
from vobench.report import score_table
from vobench.setting import hints
from vobench.trajectory.nanoseconds import NS_PER_S

if TYPE_CHECKING:
    from vobench.runner.score_files import FilePair, ScoredFiles

COMMAND_CLASS = EvoAlignCommand
# Options whose names differ from the setting's.
OPTION_BY_SETTING = {"alignment": "--align", "align_n": "--align-n", "rpe_delta": "--delta"}


@option_group
class ScoreOptions:
    """The settings of the score."""

    like: Annotated[
        str | None,
        typer.Option(help="Use the settings of evo, kitti, rpg, tum, openvins, tartanair or tartanair_mono."),
    ] = None
    alignment: Annotated[
        str | None, typer.Option("--align", "-a", help="none, origin, se3 (default), sim3, scale, yaw; or evo's -as.")
    ] = None
    align_n: Annotated[int | None, typer.Option(help="Align with only this many of the first matched poses.")] = None
    rpe_delta: Annotated[
        float | None, typer.Option("--delta", "-d", help="The distance between the poses of RPE; 1 by default.")
    ] = None
    rpe_unit: Annotated[
        str | None,
        typer.Option("--delta-unit", "-u", help="The unit of --delta: f (frames), m, s, d (degrees) or r (radians)."),
    ] = None
    rpe_all_pairs: Annotated[
        bool | None, typer.Option("--all-pairs/--consecutive", help="RPE of all pairs, or of consecutive pairs only.")
    ] = None
    rpe_pairs_from: Annotated[
        str | None, typer.Option("--pairs-from", help="Select the pairs of RPE on gt or est.")
    ] = None
    t_max_diff: Annotated[
        float | None, typer.Option(help="The largest time between matched poses, in seconds; 0.01 by default.")
    ] = None
    t_offset: Annotated[float | None, typer.Option(help="Seconds added to the stamps of the estimate.")] = None
    association: Annotated[
        str | None, typer.Option("--assoc", help="nearest, evo, interpolate, greedy or in_order.")
    ] = None
    project: Annotated[
        str | None, typer.Option(help="Compare in the plane xy, xz or yz of the truth, after alignment.")
    ] = None
    full: Annotated[bool | None, typer.Option("--full", help="Print every metric, not only the headlines.")] = None

    def settings(self) -> ScoreSettings:
        """The settings of `like`, or the defaults, with the other options in their place.

        An error names the option that is wrong.
        """
        from vobench.runner.score_settings import settings_like

        try:
            return settings_like(self.like, **self._given_settings())
        except SettingError as error:
            setting = str(error.keys[0])
            raise SettingError(error.sentence, OPTION_BY_SETTING.get(setting, setting)) from None

    def _given_settings(self) -> dict[str, Any]:
        """The options as fields of ScoreSettings; None for those that were not given."""
        return {
            "alignment": self.alignment,
            "align_n": self.align_n,
            "association": self.association,
            "max_diff_ns": _nanoseconds("--t-max-diff", self.t_max_diff, "max_diff_ns"),
            "offset_ns": _nanoseconds("--t-offset", self.t_offset, "offset_ns"),
            "rpe_delta": self.rpe_delta,
            "rpe_unit": self.rpe_unit,
            "rpe_all_pairs": self.rpe_all_pairs,
            "rpe_pairs_from": self.rpe_pairs_from,
            "full": self.full,
            "project": self.project,
        }


def _nanoseconds(option: str, value_s: float | None, setting: str) -> int | None:
    """The value of an option in nanoseconds. Raises InputError if it is not within the bounds of its setting."""
    if value_s is None:
        return None
    _, least, most = get_args(hints(ScoreSettings)[setting])
    least_s = least.ge / NS_PER_S
    most_s = most.le / NS_PER_S
    if not least_s <= value_s <= most_s:
        raise InputError(f"{option} should be {least_s:g} to {most_s:g} seconds, got {value_s:g}")
    return round(value_s * NS_PER_S)


@option_group
class SequenceOptions:
    """Several sequences, each with its own ground truth."""

    pairs: Annotated[
        bool,
        typer.Option("--pairs", help="The files are GT EST GT EST...: sequences, scored one by one and together."),
    ] = False
    listed: Annotated[
        Path | None, typer.Option("--list", help="A file with GT and EST of a sequence on each line.")
    ] = None

    @property
    def are_given(self) -> bool:
        """Whether the files are sequences, not estimates of one ground truth."""
        return self.pairs or self.listed is not None

    def path_pairs(self, paths: Sequence[Path]) -> list[tuple[Path, Path]]:
        """The ground truth and the estimate of each score. Raises BadParameter."""
        if not self.are_given:
            return _of_one_truth(paths)
        if len(paths) % 2:
            raise typer.BadParameter(f"--pairs and --list take files in pairs, GT EST, but there are {len(paths)}")
        pairs = list(zip(paths[::2], paths[1::2], strict=True))
        if self.listed:
            from vobench.runner.score_files import read_pair_list

            pairs += read_pair_list(self.listed)
        return pairs


def _of_one_truth(paths: Sequence[Path]) -> list[tuple[Path, Path]]:
    """The first file with each of the others. Raises BadParameter."""
    if len(paths) < 2:
        raise typer.BadParameter("name a ground truth and one or more estimates, GT EST...")
    gt, *estimates = paths
    return [(gt, est) for est in estimates]


@option_group
class ScoreOutput:
    """The form of the output."""

    per_length: Annotated[
        bool, typer.Option("--per-length", help="Add errors for each segment length; --json always has them.")
    ] = False
    json: Json = False
    csv: Annotated[bool, typer.Option("--csv", help="Print CSV.")] = False
    md: Annotated[bool, typer.Option("--md", help="Print Markdown.")] = False

    @property
    def form(self) -> str:
        """The one form that was asked for, or a table. Raises BadParameter."""
        requested = {"json": self.json, "csv": self.csv, "md": self.md}
        forms = [form for form, is_requested in requested.items() if is_requested]
        if len(forms) > 1:
            raise typer.BadParameter(f"choose one of --{' and --'.join(forms)}")
        return forms[0] if forms else "table"


@with_option_groups
def score_command(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="GT EST...",
            help="Ground truth and one or more estimates: TUM, KITTI, TartanAir, EuRoC, MCAP or ROS bag, detected from "
            "content, or the folder of a sequence as ground truth. Or one bundle of a run.",
        ),
    ] = None,
    *,
    sequences: SequenceOptions,
    options: ScoreOptions,
    covariances: Annotated[
        list[Path] | None,
        typer.Option("--cov", help="The covariances of EST (docs/score.md), one file for each EST; can be repeated."),
    ] = None,
    trajectories: TrajectoryOptions,
    output: ScoreOutput,
) -> None:
    """Score estimates against ground truth: ATE, RPE, segments, coverage."""
    form = output.form
    paths = files or []
    if len(paths) == 1 and paths[0].suffix.lower() == ".zip":
        from vobench.cli.bundle import score_bundle

        score_bundle(paths[0], as_json=output.json)
        return

    from vobench.runner.score_files import score_files

    pairs = _file_pairs(sequences.path_pairs(paths), covariances or (), trajectories)
    scored = score_files(
        pairs,
        settings=options.settings(),
        times=trajectories.time_files,
        pool=sequences.are_given,
    )
    _print_score(scored, form=form, per_length=output.per_length)


def _file_pairs(
    path_pairs: Sequence[tuple[Path, Path]], covariances: Sequence[Path], trajectories: TrajectoryOptions
) -> list["FilePair"]:
    """The pairs of ground truth and estimate, with covariances if there are any. Raises BadParameter."""
    from vobench.runner.score_files import FilePair

    count = len(path_pairs)
    if covariances and len(covariances) != count:
        raise typer.BadParameter(
            f"--cov should be given once for each estimate, {count} times (got {len(covariances)})"
        )

    pairs = list[FilePair]()
    for index, (gt, est) in enumerate(path_pairs):
        truth = trajectories.truth(gt)
        estimate = trajectories.estimate(est)
        covariance = covariances[index] if covariances else None
        pairs.append(FilePair(truth, estimate, covariance))
    return pairs


def _print_score(scored: "ScoredFiles", *, form: str, per_length: bool) -> None:
    content = scored.as_dict()
    if form == "json":
        terminal.print_json(content)
        return
    for pair in scored.pairs:
        for note in pair.notes:
            print(f"note: {note}", file=sys.stderr)
    if form == "csv":
        print(score_table.as_csv(content, per_length=per_length), end="")
    elif form == "md":
        print(score_table.as_markdown(content, scored.scores, per_length=per_length), end="")
    else:
        _print_table(scored, per_length=per_length)


def _print_table(scored: "ScoredFiles", *, per_length: bool) -> None:
    """Print the metrics, the identity of each, and what limits their meaning."""
    content = scored.as_dict()
    console = terminal.console()
    for headings, rows in score_table.tables(content, per_length=per_length):
        console.print(terminal.table("", headings, rows))
    for identity in score_table.ids(content):
        console.print(identity, style="dim", soft_wrap=True)
    for summary in score_table.summaries(content, scored.scores):
        console.print(summary, soft_wrap=True)
    for warning in score_table.warnings(content):
        console.print(f"warning: {warning}", style="yellow", soft_wrap=True)
