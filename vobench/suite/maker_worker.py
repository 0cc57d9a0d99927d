"""The process that runs the maker of a scene: `python -m vobench.suite.maker_worker MAKER SEED`.

It writes what `make(seed)` returned to the file `scene.bin` of its working folder, or one line to `error.txt`.
"""

import sys
from pathlib import Path
from runpy import run_path
from typing import Any

from vobench.errors import SuiteError, VobenchError
from vobench.suite.maker_message import MakerScene, checked, encode

SCENE = "scene.bin"
ERROR = "error.txt"


def call(maker: str, seed: int) -> MakerScene:
    """What `make(seed)` of a maker's file returns, checked. Raises SuiteError, and whatever the maker raises."""
    # Never from bytecode: that of a file edited twice within a second would be the first one's.
    make: Any = run_path(maker).get("make")
    if make is None:
        raise SuiteError("has no function make(seed)")
    return checked(make(seed))


def sentence(error: Exception) -> str:
    """An exception in one line."""
    text = " ".join(str(error).split())
    return text if isinstance(error, VobenchError) else f"{type(error).__name__}: {text}"


def main(maker: str, seed: int) -> None:
    """Run the maker and leave its scene, or why there is none, in the working folder."""
    try:
        Path(SCENE).write_bytes(encode(call(maker, seed)))
    except Exception as error:  # the user's code may raise anything
        Path(ERROR).write_text(sentence(error), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
