"""The Python files of a scene's maker or generator: the file itself, and all that it may import from its folder."""

import hashlib
from collections.abc import Iterator
from pathlib import Path


def code_files(file: Path) -> list[Path]:
    """A maker or a generator, followed by all other Python files in its folder and subfolders, in order."""
    others = [path for path in file.parent.rglob("*.py") if path != file and path.is_file()]
    return [file, *sorted(others)]


def sources(file: Path) -> Iterator[bytes]:
    """The name and content of each of the `code_files`; names are relative to the folder."""
    for path in code_files(file):
        yield str(path.relative_to(file.parent)).encode()
        yield path.read_bytes()


def code_identity(file: Path) -> str:
    """The name of a maker or a generator, and a hash of all its `code_files`. It does not depend on the folder."""
    digest = hashlib.sha256()
    for source in sources(file):
        digest.update(len(source).to_bytes(8, "little"))
        digest.update(source)
    return f"{file.name} {digest.hexdigest()}"
