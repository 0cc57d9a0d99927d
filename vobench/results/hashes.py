"""What a run's files were when it ended: one hash for each, so that anybody can see later whether they still are."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

from vobench.errors import InputError
from vobench.results.run_folder import SEQUENCE, RunFolder, write_json

HASHES = "hashes.json"
CHUNK = 1 << 20


def write_hashes(folder: RunFolder) -> None:
    """Hash all that lies in a run's folder, and the sequences that it links to."""
    write_json(folder.path / HASHES, {name: file_hash(folder.path / name) for name in _names(folder.path)})


def read_hashes(folder: RunFolder) -> dict[str, str]:
    """The hash of each file by its path in the folder. Raises InputError where none were kept."""
    path = folder.path / HASHES
    try:
        held = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"this run kept no hashes (its vobench was older, or it is no run): {path}") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"not readable as JSON ({error}): {path}") from None
    if not isinstance(held, dict) or not all(isinstance(value, str) for value in held.values()):
        raise InputError(f"should hold one hash for each file: {path}")
    escaped = [name for name in held if Path(name).is_absolute() or ".." in Path(name).parts]
    if escaped:
        raise InputError(f"names a file outside the run's folder ({escaped[0]!r}): {path}")
    return held


def file_hash(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    state = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(CHUNK):
            state.update(chunk)
    return state.hexdigest()


def _names(root: Path) -> Iterator[str]:
    """Paths of all files below a run's folder; a sequence is a link to a folder in the cache."""
    linked = (file for link in root.glob(f"cases/*/{SEQUENCE}") for file in link.glob("*.mcap"))
    for path in sorted({*(p for p in root.rglob("*") if p.is_file()), *linked}):
        name = str(path.relative_to(root))
        if name != HASHES:
            yield name
