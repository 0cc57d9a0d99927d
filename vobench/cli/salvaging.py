"""vobench salvage."""

from dataclasses import asdict
from pathlib import Path

from vobench.cli import terminal
from vobench.dataset.files import require_free
from vobench.errors import InputError
from vobench.sequence.salvage import Salvaged, salvage, salvage_sequence


def show(torn: Path, out: Path, *, as_json: bool) -> None:
    """Recover a torn file, or both files of a torn sequence, and print what came and what is lost."""
    if torn.is_dir():
        require_free(out)
        found = salvage_sequence(torn, out)
    else:
        if out.exists():
            raise InputError(f"should be a new file, but there is something: {out}")
        found = {out.name: salvage(torn, out)}
    if as_json:
        terminal.print_json({"path": str(out), "files": {name: asdict(what) for name, what in found.items()}})
        return
    for name, what in found.items():
        _print(name, what)


def _print(name: str, what: Salvaged) -> None:
    out = terminal.console()
    rows = [[topic, str(count)] for topic, count in sorted(what.messages.items())]
    out.print(terminal.table(name, ["name", "messages"], rows) if rows else f"{name}: nothing")
    for sentence in what.lost:
        out.print(f"lost: {sentence}")
    if not what.lost:
        out.print("nothing was lost")
