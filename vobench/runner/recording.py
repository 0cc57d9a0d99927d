"""Recordings as analyses take them: a dataset's folder, a bag, a sequence, or a case of a run."""

from pathlib import Path

from vobench.dataset.layout import read
from vobench.dataset.recording import ReadOptions, Recording
from vobench.errors import InputError
from vobench.runner.folder import SEQUENCE

NOTHING_MORE = ReadOptions()  # a recording states everything that is needed itself


def read_recording(path: Path, *, form: str | None = None, options: ReadOptions = NOTHING_MORE) -> Recording:
    """Read the recording at a path; of a case of a run, its sequence. `form` is told by content unless it is given.

    Raises InputError where nothing there can be read, or where the sequence of a case is no longer in the cache.
    """
    return read(sequence_path(path), form=form, options=options)


def sequence_path(path: Path) -> Path:
    """The path itself or, for the folder of a run's case, its sequence. Raises InputError where that one is gone."""
    linked = path / SEQUENCE
    if linked.is_dir():
        return linked
    if linked.is_symlink():
        raise InputError(f"this case's sequence is not in the cache any more; run the suite again: {path}")
    return path
