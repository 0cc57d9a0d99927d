"""The words of `vobench import`, `export`, `info`, `salvage` and `verify`."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.cli.score_command import Json

Recorded = Annotated[
    Path, typer.Argument(metavar="PATH", help="A dataset's folder, a bag, or a sequence; its form is told by content.")
]
Imu = Annotated[Path | None, typer.Option(help="Kalibr's imu.yaml.")]
Truth = Annotated[Path | None, typer.Option(help="A trajectory file with the ground truth.")]
Rate = Annotated[float | None, typer.Option(help="Pictures a second, for layouts without stamps.")]
Form = Annotated[str | None, typer.Option(help="The form, where its content should not tell.")]
Calibration = Annotated[Path | None, typer.Option(help="Kalibr's camchain.yaml, where the layout has none of its own.")]
TopicOf = Annotated[
    list[str] | None,
    typer.Option("--topic", help="left=, right=, left_info=, right_info=, truth= or imu=NAME of a bag; repeatable."),
]


def import_(
    path: Recorded,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder of the new sequence.")],
    *,
    form: Form = None,
    calibration: Calibration = None,
    imu: Imu = None,
    truth: Truth = None,
    rate: Rate = None,
    topic: TopicOf = None,
    json: Json = False,
) -> None:
    """Make a sequence from a dataset's folder or a bag, and say all that was assumed or dropped."""
    from vobench.cli import importing

    given = importing.Given(form, calibration, imu, truth, rate, tuple(topic or ()))
    importing.show(path, out, given, as_json=json)


def export(
    source: Annotated[
        Path, typer.Argument(metavar="SOURCE", help="The folder of a sequence, or the file of a trajectory.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder or file to write, which should be new.")],
    *,
    form: Annotated[str, typer.Option(help="euroc, kitti, tum or, of a sequence, ros2.")],
    json: Json = False,
) -> None:
    """Write a sequence as EuRoC, KITTI, TUM or a ROS 2 bag, or a trajectory as their text; say all that is lost."""
    from vobench.cli import exporting

    exporting.show(source, out, form=form, as_json=json)


def info(
    path: Recorded,
    *,
    form: Form = None,
    calibration: Calibration = None,
    imu: Imu = None,
    truth: Truth = None,
    rate: Rate = None,
    topic: TopicOf = None,
    json: Json = False,
) -> None:
    """Say what is in a recording: topics, rates, duration, calibration, ground truth, hash."""
    from vobench.cli import importing, informing

    given = importing.Given(form, calibration, imu, truth, rate, tuple(topic or ()))
    informing.show(path, given, as_json=json)


def salvage(
    torn: Annotated[
        Path, typer.Argument(metavar="TORN", help="An MCAP file that was cut off, or a sequence's folder.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The whole file or folder to write.")],
    *,
    json: Json = False,
) -> None:
    """Recover what is whole in a torn MCAP file."""
    from vobench.cli import salvaging

    salvaging.show(torn, out, as_json=json)


def verify(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder, or runs/<suite> for its latest.")],
    *,
    json: Json = False,
) -> None:
    """Recompute all hashes and scores of a run from its files; exit code 1 where anything differs."""
    from vobench.cli import verifying

    verifying.show(run, as_json=json)
