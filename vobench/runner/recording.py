"""Reads recordings for analyses: the folder of a dataset, a bag, a sequence, or a case of a run."""

from pathlib import Path

from vobench.dataset.layout import read
from vobench.dataset.recording import ReadOptions, Recording
from vobench.errors import InputError
from vobench.runner.folder import SCORE, SEQUENCE

DEFAULT_OPTIONS = ReadOptions()  # without further files: the recording contains everything that is needed


def read_recording(path: Path, *, form: str | None = None, options: ReadOptions = DEFAULT_OPTIONS) -> Recording:
    """Read the recording at a path, or the sequence of a case of a run. `form` is detected if it is None.

    Raises InputError if it cannot be read, or if the sequence of a case is no longer in the cache.
    """
    return read(sequence_path(path), form=form, options=options)


def sequence_path(path: Path) -> Path:
    """The path, or for the folder of a run's case, the path of its sequence. Raises InputError if that is missing."""
    linked = path / SEQUENCE
    if linked.is_dir():
        return linked
    if linked.is_symlink():
        raise InputError(f"this case's sequence is not in the cache any more; run the suite again: {path}")
    return path


def may_be_recording(path: Path) -> bool:
    """Whether a path may be of a recording: there is a file or a folder, which is not the folder of a trial."""
    return path.exists() and not (path / SCORE).is_file()
