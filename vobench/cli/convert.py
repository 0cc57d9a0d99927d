"""vobench convert."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.option import Json, option_group, with_option_groups
from vobench.cli.trajectory_option import CONVENTIONS_HELP, Topic
from vobench.errors import counted
from vobench.runner.convert_trajectory import TrajectoryEdit, convert_trajectories
from vobench.runner.trajectory_pair import TrajectorySource
from vobench.trajectory.nanoseconds import NS_PER_S

MAX_TIME_S = 9e9  # a stamp is a 64-bit integer in nanoseconds, which can store up to 9.2e9 s


@option_group
class ReadingOptions:
    """Options that specify how trajectory files are read."""

    topic: Topic = None
    read_as: Annotated[list[str] | None, typer.Option("--as", help=CONVENTIONS_HELP)] = None
    times: Annotated[
        list[Path] | None,
        typer.Option(help="A file with a stamp in seconds per line, for formats without stamps; can be repeated."),
    ] = None

    def source(self, path: Path) -> TrajectorySource:
        """A trajectory file, with the options that specify how it is read."""
        return TrajectorySource(path, self.topic, tuple(self.read_as or ()))


@option_group
class EditOptions:
    """Options that edit a trajectory before it is written: time offset, time range and downsampling."""

    t_offset: Annotated[
        float, typer.Option(min=-MAX_TIME_S, max=MAX_TIME_S, help="The time in seconds to add to all stamps.")
    ] = 0.0
    t_start: Annotated[
        float | None,
        typer.Option(min=-MAX_TIME_S, max=MAX_TIME_S, help="Remove the poses before this stamp, in seconds."),
    ] = None
    t_end: Annotated[
        float | None,
        typer.Option(min=-MAX_TIME_S, max=MAX_TIME_S, help="Remove the poses after this stamp, in seconds."),
    ] = None
    downsample: Annotated[int | None, typer.Option(min=2, help="Keep at most this many poses, evenly spaced.")] = None

    @property
    def edit(self) -> TrajectoryEdit:
        """The edit that these options specify, with times in nanoseconds."""
        return TrajectoryEdit(
            offset_ns=round(self.t_offset * NS_PER_S),
            first_ns=_nanoseconds(self.t_start),
            last_ns=_nanoseconds(self.t_end),
            count=self.downsample,
        )


def _nanoseconds(time_s: float | None) -> int | None:
    """A time in nanoseconds; None if no time is given."""
    return None if time_s is None else round(time_s * NS_PER_S)


@with_option_groups
def convert_command(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help="Trajectory files (TUM, KITTI, TartanAir, EuRoC, MCAP or ROS bag, detected from content) or folders "
            "of sequences. Several trajectories are merged in order of time.",
        ),
    ],
    *,
    out: Annotated[Path, typer.Option("--out", "-o", help="The file to write; it must not exist.")],
    form: Annotated[str, typer.Option(help="The format to write: tum, kitti, euroc or tartanair.")] = "tum",
    reading: ReadingOptions,
    editing: EditOptions,
    json: Json = False,
) -> None:
    """Convert trajectory files between formats, frames, axes and units of time, and merge them."""
    sources = [reading.source(file) for file in files]
    converted = convert_trajectories(sources, out, form, times=reading.times or (), edit=editing.edit)
    if json:
        written = [str(file) for file in converted.files]
        terminal.print_json({"files": written, "poses": converted.pose_count, "notes": converted.notes})
        return
    for note in converted.notes:
        print(f"- {note}")
    print(f"{counted(converted.pose_count, 'pose')} (form: {form}): {out}")
