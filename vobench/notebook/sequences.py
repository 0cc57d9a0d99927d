"""Open a sequence from Python."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vobench.sequence import Sequence


def read_sequence(folder: Path | str) -> "Sequence":
    """Open the sequence in a folder; its pictures and readings are read on access. Raises SequenceError."""
    from vobench.sequence import Sequence

    return Sequence.open(Path(folder))
