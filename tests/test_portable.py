"""Portable results: libraries are held back before they load, and nothing passes for portable that is not."""

import os
import subprocess
import sys

import pytest

from vobench import portable
from vobench.errors import InputError
from vobench.portable import PORTABLE, VARIABLES, require_held

AFTER_IMPORT = f"import os, vobench; print(sum(name in os.environ for name in {list(VARIABLES)}))"


def held(code, **variables):
    plain = {name: value for name, value in os.environ.items() if name not in (PORTABLE, *VARIABLES)}
    environment = {**plain, **variables}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    return int(done.stdout)


def test_importing_vobench_holds_libraries_back_only_if_that_is_asked_for():
    assert held(AFTER_IMPORT) == 0
    assert held(AFTER_IMPORT, VOBENCH_PORTABLE="0") == 0
    assert held(AFTER_IMPORT, VOBENCH_PORTABLE="1") == len(VARIABLES)


def test_a_library_that_is_loaded_already_cannot_be_held_back():
    assert held(f"import numpy; {AFTER_IMPORT}", VOBENCH_PORTABLE="1") == 0


def test_results_are_refused_if_libraries_were_loaded_before(monkeypatch):
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delenv(PORTABLE, raising=False)
    require_held()
    monkeypatch.setenv(PORTABLE, "1")
    with pytest.raises(InputError, match="before numpy and OpenCV"):
        require_held()
    monkeypatch.setattr(portable.sys, "modules", {})
    portable.hold()
    require_held()
    for name in VARIABLES:  # as `hold` set them, not monkeypatch
        os.environ.pop(name, None)


def test_numpy_runs_without_newer_instructions():
    code = (
        "import vobench, numpy._core._multiarray_umath as m;"
        "print(sum(m.__cpu_features__[name] for name in m.__cpu_dispatch__))"
    )
    assert held(code, VOBENCH_PORTABLE="1") == 0
