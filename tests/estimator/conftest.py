"""The system's C++ compiler, for programs that are run as estimators."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Compiles C++ to a program `run` in a folder of its own, which is returned."""
    compiler = next(filter(None, map(shutil.which, ("c++", "g++", "clang++"))), None)
    if compiler is None:
        pytest.skip("no C++ compiler (c++, g++ or clang++) on this machine")

    def make(source: str) -> Path:
        folder = tmp_path_factory.mktemp("program")
        (folder / "run.cpp").write_text(source)
        subprocess.run(
            [compiler, "-std=c++17", "-Wall", "-Werror", "-o", folder / "run", folder / "run.cpp"], check=True
        )
        return folder

    return make
