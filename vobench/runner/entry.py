"""Entries of the store: folders of files, with a manifest of the sizes and hashes of the files."""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from shutil import copyfile

from pydantic import TypeAdapter

from vobench import stop
from vobench.errors import InputError

MANIFEST = "manifest.json"
CHUNK = 1 << 20
# The number of hashes that a process caches. If the store is read-only, each file is hashed only once in a run.
KEPT_HASHES = 1 << 14


@dataclass(frozen=True, slots=True)
class File:
    """The size and hash of a file when it was written."""

    bytes: int
    sha256: str


# For each path in an entry: the size, the time of the last change in ns, and the inode. Equal states mean equal bytes.
States = Mapping[str, tuple[int, int, int]]
FILES = TypeAdapter(dict[str, File])
STATES = TypeAdapter(dict[str, tuple[int, int, int]])


def file_hash(path: Path) -> str:
    """The SHA-256 hash of a file."""
    state = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(CHUNK):
            stop.check()
            state.update(chunk)
    return state.hexdigest()


@lru_cache(KEPT_HASHES)
def _hash_of(path: Path, _: tuple[int, int, int]) -> str:
    return file_hash(path)


def seal(folder: Path) -> States:
    """Flush all files of a finished folder to the disk, write its manifest, and return the states of the files."""
    names = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    for name in names:
        _sync(folder / name)
    states = _states(folder, names)
    files = {name: File(states[name][0], file_hash(folder / name)) for name in names}
    (folder / MANIFEST).write_bytes(_text(files))
    _sync(folder / MANIFEST)
    _sync(folder)
    return {**states, **_states(folder, [MANIFEST])}


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _text(files: Mapping[str, File]) -> bytes:
    return FILES.dump_json(dict(sorted(files.items())), indent=1) + b"\n"


def _states(folder: Path, names: Iterable[str]) -> States:
    found = {name: (folder / name).stat() for name in names}
    return {name: (stat.st_size, stat.st_mtime_ns, stat.st_ino) for name, stat in found.items()}


def _files_of(folder: Path) -> dict[str, File]:
    """The files of an entry according to its manifest. Raises OSError or ValueError if the manifest is damaged."""
    text = (folder / MANIFEST).read_bytes()
    files = FILES.validate_json(text, strict=True)
    if _text(files) != text:
        raise ValueError
    return files


def fault(folder: Path, checked: Path | None = None) -> str:
    """What is wrong with an entry; empty if its files agree with its manifest.

    Sizes are always compared. Hashes are compared unless the file `checked` contains the states of the files.
    """
    try:
        files = _files_of(folder)
        states = _states(folder, [*files, MANIFEST])
        difference = _size_difference(files, states)
        if difference or (checked and states == _remembered(checked)):
            return difference
        difference = _content_difference(folder, files, states, uses_hash_cache=checked is not None)
        if difference:
            return difference
    except ValueError:
        return f"{MANIFEST} is not as it was written"
    except OSError as error:
        return f"{Path(error.filename or folder).name} cannot be read ({error.strerror})"
    if checked:
        remember(checked, states)
    return ""


def _size_difference(files: Mapping[str, File], states: States) -> str:
    for name, file in files.items():
        size = states[name][0]
        if size != file.bytes:
            return f"{name} has {size} bytes, should have {file.bytes}"
    return ""


def _content_difference(folder: Path, files: Mapping[str, File], states: States, *, uses_hash_cache: bool) -> str:
    for name, file in files.items():
        path = folder / name
        content_hash = _hash_of(path, states[name]) if uses_hash_cache else file_hash(path)
        if content_hash != file.sha256:
            return f"{name} holds other bytes than were written"
    return ""


def _remembered(checked: Path) -> States | None:
    with suppress(OSError, ValueError):
        return STATES.validate_json(checked.read_bytes(), strict=False)
    return None


def remember(checked: Path, states: States) -> None:
    """Record in the file `checked`, if it can be written, that files with these states agree with the manifest."""
    with suppress(OSError):
        checked.parent.mkdir(parents=True, exist_ok=True)
        part = checked.with_suffix(f".{os.getpid()}")
        part.write_text(json.dumps(states), encoding="utf-8")
        part.replace(checked)


def copy_files(folder: Path, names: Iterable[str], target: Path) -> None:
    """Copy some files of an entry. Raises InputError if a copy does not agree with the manifest."""
    files = dict[str, File]()
    with suppress(OSError, ValueError):
        files = _files_of(folder)
    for name in names:
        if name in files:
            copyfile(folder / name, target / name)
        if name not in files or file_hash(target / name) != files[name].sha256:
            raise InputError(f"differs from what was written; run the suite again to recreate it: {folder / name}")
