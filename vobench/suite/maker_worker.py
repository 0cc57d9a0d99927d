"""The process that runs the maker of a scene: `python -m vobench.suite.maker_worker MAKER SEED`.

It writes the returned scene to the file `scene.bin` in the working folder, or an error to `error.txt` in one line.
"""

import sys
from pathlib import Path
from runpy import run_path
from typing import Any

from vobench.errors import SuiteError, error_sentence
from vobench.suite.maker_message import MakerScene, checked, encode

SCENE = "scene.bin"
ERROR = "error.txt"


def call(maker: str, seed: int) -> MakerScene:
    """The scene that `make(seed)` of a maker returns. Raises SuiteError if it is not valid, and the maker's errors."""
    # run_path compiles the source. Cached bytecode could be outdated if the file is edited twice within a second.
    make: Any = run_path(maker).get("make")
    if make is None:
        raise SuiteError("has no function make(seed)")
    return checked(make(seed))


def main(maker: str, seed: int) -> None:
    """Run the maker, and write its scene or its error to a file in the working folder."""
    try:
        Path(SCENE).write_bytes(encode(call(maker, seed)))
    except Exception as error:  # the user's code may raise anything
        Path(ERROR).write_text(error_sentence(error), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
