"""Trust in the makers of scenes, from Python."""

from pathlib import Path

from vobench import trust
from vobench.errors import InputError
from vobench.suite.scene_code import sources


def trust_maker(maker: Path | str) -> None:
    """Let the maker of a scene run in this process although this machine has no sandbox, as `--trust` does.

    It applies to this version of the Python file and of the other Python files in its folder. On a machine with a
    sandbox, makers need no trust. Raises InputError if there is no such file.
    """
    path = Path(maker)
    if not path.is_file():
        raise InputError(f"no such file: {path}")
    trust.trust_version(sources(path))
