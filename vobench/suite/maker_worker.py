"""The process that runs code beside a scene: `python -m vobench.suite.maker_worker FILE FUNCTION ARGUMENTS`.

FUNCTION is `make` of a maker or `generate` of a generator, and ARGUMENTS are its arguments as a JSON list. The process
writes the returned scene to the file `scene.bin` in the working folder, or an error to `error.txt` in one line.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from runpy import run_path
from typing import Any

from vobench.errors import SuiteError, error_sentence
from vobench.scene.generated_place import GeneratedPlace
from vobench.suite.maker_message import checked, checked_place, encode

SCENE_FILE = "scene.bin"
ERROR_FILE = "error.txt"
MAKE = "make"
GENERATE = "generate"
PARAMETERS = {MAKE: "seed", GENERATE: "seed, lighting"}


def call(file: str, function: str, arguments: Sequence[Any]) -> GeneratedPlace:
    """What a function of a file returns. Raises SuiteError if it is not valid, and the errors of the function."""
    # run_path compiles the source. Cached bytecode could be outdated if the file is edited twice within a second.
    called: Any = run_path(file).get(function)
    if called is None:
        raise SuiteError(f"has no function {function}({PARAMETERS[function]})")
    returned = called(*arguments)
    return checked_place(returned) if function == GENERATE else checked(returned)


def main(file: str, function: str, arguments: Sequence[Any]) -> None:
    """Call the function, and write its scene or its error to a file in the working folder."""
    try:
        Path(SCENE_FILE).write_bytes(encode(call(file, function, arguments)))
    except Exception as error:  # the user's code may raise anything
        Path(ERROR_FILE).write_text(error_sentence(error), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], json.loads(sys.argv[3]))
