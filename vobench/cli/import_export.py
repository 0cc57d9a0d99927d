"""The commands vobench import and vobench export."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.option import Json, with_option_groups
from vobench.cli.recording_option import FormCommand, ImuFile, RecordingOptions, RecordingPath
from vobench.dataset.export import export as export_sequence
from vobench.errors import counted
from vobench.runner.import_recording import import_dataset

COMMAND_CLASS = FormCommand  # `CommandGroup` reads it: both commands list the known forms in their help


@with_option_groups
def import_command(
    path: RecordingPath,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder of the new sequence.")],
    *,
    recording_options: RecordingOptions,
    imu: ImuFile = None,
    json: Json = False,
) -> None:
    """Convert a dataset's folder or a bag to a sequence, and print what was assumed or left out."""
    options = recording_options.read_options(imu)
    imported = import_dataset(path, out, form=recording_options.form, options=options)
    if json:
        content = {"form": imported.form, "path": str(out), "frames": imported.frame_count, "notes": imported.notes}
        terminal.print_json(content)
        return
    frames = counted(imported.frame_count, "frame")
    _print_result(imported.notes, f"imported {frames} (form: {imported.form}): {out}")


def export_command(
    sequence: Annotated[Path, typer.Argument(metavar="SEQUENCE", help="The folder of a sequence.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder to write; it must not exist.")],
    *,
    form: Annotated[str, typer.Option(help="The form to write")],
    json: Json = False,
) -> None:
    """Write a sequence in another layout, and print what was lost."""
    exported = export_sequence(sequence, out, form)
    if json:
        content = {"form": form, "path": str(out), "files": len(exported.files), "notes": exported.notes}
        terminal.print_json(content)
        return
    files = counted(len(exported.files), "file")
    _print_result(exported.notes, f"exported {files} (form: {form}): {out}")


def _print_result(notes: Iterable[str], sentence: str) -> None:
    for note in notes:
        print(f"- {note}")
    print(sentence)
