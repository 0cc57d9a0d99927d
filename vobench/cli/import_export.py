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

# `CommandGroup` uses this class for both commands, so that their help lists the known dataset formats.
COMMAND_CLASS = FormCommand


@with_option_groups
def import_command(
    path: RecordingPath,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder of the new sequence.")],
    *,
    recording_options: RecordingOptions,
    imu: ImuFile = None,
    json: Json = False,
) -> None:
    """Convert a dataset or a bag to a sequence, and print what was assumed and what was left out."""
    options = recording_options.read_options(imu)
    imported = import_dataset(path, out, form=recording_options.form, options=options)
    if json:
        terminal.print_json(
            {
                "form": imported.form,
                "path": str(out),
                "frames": imported.frame_count,
                "notes": imported.notes,
            }
        )
        return
    frames = counted(imported.frame_count, "frame")
    _print_result(imported.notes, f"imported {frames} (form: {imported.form}): {out}")


def export_command(
    sequence: Annotated[Path, typer.Argument(metavar="SEQUENCE", help="The folder of a sequence.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder to write; it must not exist.")],
    *,
    form: Annotated[str, typer.Option(help="The dataset format to write")],
    json: Json = False,
) -> None:
    """Export a sequence to another dataset format, and print what the format cannot store."""
    exported = export_sequence(sequence, out, form)
    if json:
        terminal.print_json(
            {
                "form": form,
                "path": str(out),
                "files": len(exported.files),
                "notes": exported.notes,
            }
        )
        return
    files = counted(len(exported.files), "file")
    _print_result(exported.notes, f"exported {files} (form: {form}): {out}")


def _print_result(notes: Iterable[str], sentence: str) -> None:
    """Print the notes as a list, followed by a sentence about the result."""
    for note in notes:
        print(f"- {note}")
    print(sentence)
