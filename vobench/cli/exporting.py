"""vobench export."""

from pathlib import Path

from vobench.cli import terminal


def show(sequence: Path, out: Path, *, form: str, as_json: bool) -> None:
    """Write a sequence in another layout, and print what was converted or lost."""
    from vobench.dataset.export import export

    exported = export(sequence, out, form)
    if as_json:
        terminal.print_json({"form": form, "path": str(out), "files": len(exported.files), "notes": exported.notes})
        return
    for note in exported.notes:
        print(f"- {note}")
    print(f"{len(exported.files)} files in the form '{form}': {out}")
