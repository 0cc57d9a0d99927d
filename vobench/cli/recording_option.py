"""Options of commands that read recordings of any form, and the help that lists the forms."""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperOption

from vobench.cli.option import option_group
from vobench.dataset.layout import layouts, writable
from vobench.dataset.recording import ReadOptions, Topics
from vobench.errors import UnknownNameError, unknown_name_sentence

TOPIC_ROLES = tuple(Topics.__dataclass_fields__)

RecordingPath = Annotated[
    Path, typer.Argument(metavar="PATH", help="The folder of a dataset, a bag, or a sequence, detected from content.")
]
ImuFile = Annotated[Path | None, typer.Option("--imu", help="Kalibr's imu.yaml.")]


@option_group
class RecordingOptions:
    """How a recording is read."""

    # FormCommand appends the names of the forms to this help.
    form: Annotated[
        str | None,
        typer.Option(help="The form of the recording, such as a dataset layout; by default detected from the content"),
    ] = None
    calibration: Annotated[
        Path | None, typer.Option(help="Kalibr's camchain.yaml, if the layout has no calibration.")
    ] = None
    truth: Annotated[Path | None, typer.Option(help="A trajectory file with the ground truth.")] = None
    rate: Annotated[float | None, typer.Option(help="Images per second, for layouts without stamps.")] = None
    topic: Annotated[
        list[str] | None,
        typer.Option(
            "--topic", help="left=, right=, left_info=, right_info=, truth= or imu=NAME of a bag; can be repeated."
        ),
    ] = None
    frames: Annotated[
        str | None, typer.Option(metavar="A:B", help="Take only the frames from A to B - 1, as in 40:80.")
    ] = None

    def read_options(self, imu: Path | None = None) -> ReadOptions:
        """The same options for readers of recordings. Raises UnknownNameError."""
        return ReadOptions(
            calibration=self.calibration,
            imu=imu,
            truth=self.truth,
            rate_hz=self.rate,
            topics=parse_topics(self.topic),
            frames=self.frames,
        )


def parse_topics(entries: list[str] | None) -> Topics:
    """The topics of `--topic`. Raises UnknownNameError."""
    name_by_role = dict[str, str]()
    for entry in entries or ():
        role, _, name = entry.partition("=")
        if role not in TOPIC_ROLES or not name:
            sentence = unknown_name_sentence("topic", role, list(TOPIC_ROLES))
            raise UnknownNameError(f"--topic {entry}: {sentence}; as in --topic left=/cam0")
        name_by_role[role] = name
    return Topics(**name_by_role)


class FormCommand(TyperCommand):
    """A command with --form. Its help lists the available forms, which are looked up only when help is requested."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help with the names of the forms."""
        # `vobench export` writes a recording; all other commands with --form read one.
        is_writing = self.name == "export"
        forms = ", ".join(writable() if is_writing else layouts())
        for option in self.params:
            if option.name == "form" and isinstance(option, TyperOption):
                option.help = f"{option.help}: {forms}."
        super().format_help(ctx, formatter)
