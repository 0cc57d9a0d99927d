"""Runs a test file again as an ordinary user, and on a machine whose kernel refuses namespaces or Landlock."""

import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest

from vobench.estimator import isolation
from vobench.estimator.readable_folders import READ_VARIABLE

ROOT = Path(__file__).parents[1]
RERUN = "VOBENCH_TEST_RERUN"
NOBODY = "65534"  # the id of the user that owns no files, and of its group
# Starts a program without the system calls whose numbers are the second argument, and without unshare.
WITHOUT = """
import ctypes, errno, os, struct, sys
sys.path.append(sys.argv.pop(1))
import isolation
column, architecture = isolation.MACHINES[os.uname().machine]
refused = [isolation.REFUSED['unshare'][column], *map(int, filter(None, sys.argv.pop(1).split(',')))]
program = [(0x20, 0, 0, 0)]
for number in refused:
    program += [(0x15, 0, 1, number), (0x06, 0, 0, isolation.FAIL | errno.EPERM)]
program += [(0x06, 0, 0, isolation.ALLOW)]
code = ctypes.create_string_buffer(b''.join(struct.pack('HBBI', *one) for one in program))
whole = struct.pack('HxxxxxxQ', len(program), ctypes.addressof(code))
isolation.libc.prctl(38, 1, 0, 0, 0)
assert isolation.libc.prctl(22, ctypes.c_ulong(2), whole) == 0
os.execv(sys.argv[1], sys.argv[1:])
"""
LANDLOCK = str(isolation.LANDLOCK_CREATE_RULESET)
KERNELS = {"no namespaces": "", "neither namespaces nor landlock": LANDLOCK}

first_time = pytest.mark.skipif(bool(os.environ.get(RERUN)), reason="this is the second time")
on_poorer_kernels = pytest.mark.parametrize("refused", KERNELS.values(), ids=KERNELS.keys())


def refusing(refused):
    """The start of a command line whose program runs without namespaces and other system calls."""
    folder = str(Path(isolation.__file__).parent)
    return [sys.executable, "-I", "-S", "-c", WITHOUT, folder, refused]


def rerun(file, before, *, python=sys.executable, environment=None):
    """Run a test file again, started in another way."""
    with tempfile.TemporaryDirectory(prefix="vobench-test-", dir="/tmp", ignore_cleanup_errors=True) as temporary:
        Path(temporary).chmod(0o777)
        options = ["-n", "0", "-q", "-x", "-m", "slow", "-p", "no:cacheprovider", "--basetemp", f"{temporary}/tests"]
        argv = [*before, python, "-m", "pytest", *options, file]
        variables = {
            **os.environ,
            RERUN: "1",
            "TMPDIR": temporary,
            "HOME": temporary,
            "PYTHONDONTWRITEBYTECODE": "1",
            **(environment or {}),
        }
        done = subprocess.run(argv, env=variables, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]


def rerun_as_ordinary_user(file, *, needed="numpy, pytest, vobench.estimator.program"):
    """Run a test file again as a user without rights, by an interpreter that this user may execute.

    `needed` lists the modules that the interpreter must be able to import.
    """
    if os.getuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("this is an ordinary user already")
    # env, because setpriv keeps root's rights until it has found a program.
    drop = ["setpriv", "--reuid", NOBODY, "--regid", NOBODY, "--clear-groups", "env"]
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    search = os.pathsep.join(dict.fromkeys(path for path in sys.path if path.endswith("packages") or path == str(ROOT)))
    pythons = [sys.executable, f"/usr/bin/python{version}", f"/usr/local/bin/python{version}"]
    environment = {"PYTHONPATH": search, "HOME": "/", "PYTHONDONTWRITEBYTECODE": "1"}
    for python in pythons:
        with suppress(OSError):
            tried = subprocess.run(
                [*drop, python, "-c", f"import {needed}"],
                env={**os.environ, **environment},
                cwd="/",
                capture_output=True,
                check=False,
            )
            if tried.returncode == 0:
                rerun(file, drop, python=python, environment={"PYTHONPATH": search, READ_VARIABLE: search})
                return
    pytest.skip("no interpreter that an ordinary user may execute")
