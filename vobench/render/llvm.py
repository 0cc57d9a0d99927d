"""The libLLVM that Mitsuba compiles with: found by trying, since a wrong one kills Python without a word."""

import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from vobench import stop
from vobench.errors import MissingDependencyError

VARIABLE = "DRJIT_LIBLLVM_PATH"
VARIANT = "llvm_ad_mono"
OLDEST_MAJOR = 15  # Dr.Jit refuses older ones; 15 and 16 cannot compile for some processors
FOLDERS = ("usr/lib/*-linux-gnu", "usr/lib64", "usr/lib", "usr/lib/llvm*/lib", "usr/local/lib")
LLVM_REMEDY = "apt-get update && apt-get install -y libllvm19"
MITSUBA_REMEDY = f"{sys.executable} -m pip install 'mitsuba>=3.9,<4'"
PROBE_TIMEOUT_S = 120

# Renders for real: a library that loads may still abort when the first kernel is compiled.
PROBE = f"""
import mitsuba as mi
mi.set_variant("{VARIANT}")
sphere = {{"type": "sphere", "bsdf": {{"type": "roughplastic"}}}}
sensor = {{"type": "perspective", "to_world": mi.ScalarTransform4f().translate([0, 0, -5])}}
parts = {{"sphere": sphere, "sensor": sensor, "sky": {{"type": "constant"}}, "integrator": {{"type": "path"}}}}
scene = mi.load_dict({{"type": "scene", **parts}})
mean = float(mi.TensorXf(mi.render(scene, spp=1)).array.numpy().mean())
assert 0.5 < mean < 1.5, mean
"""


@cache
def prepare() -> None:
    """Make `import mitsuba` safe in this process, and set its variant.

    Raises MissingDependencyError where Mitsuba or a libLLVM that works is missing.
    """
    os.environ[VARIABLE] = str(working_library())
    import mitsuba as mi

    mi.set_variant(VARIANT)
    mi.set_log_level(mi.LogLevel.Error)


def working_library() -> Path:
    """The first candidate that renders.

    Raises MissingDependencyError where Mitsuba is not installed, or none renders: names them and says why not.
    """
    if find_spec("mitsuba") is None:
        raise MissingDependencyError(f"path tracing needs Mitsuba; run: {MITSUBA_REMEDY}")
    tried = {}
    for library in candidates():
        tried[library.name] = failure(library)
        if not tried[library.name]:
            return library
    reasons = "; ".join(f"{name}: {reason}" for name, reason in tried.items()) or "none found"
    raise MissingDependencyError(f"path tracing needs a libLLVM that works here ({reasons}); run: {LLVM_REMEDY}")


def candidates() -> Iterator[Path]:
    """Libraries worth trying: the one the environment names, then the system's, newest first."""
    named = os.environ.get(VARIABLE)
    if named:
        yield Path(named)
    found = {path.resolve() for folder in FOLDERS for path in Path("/").glob(f"{folder}/libLLVM*.so*")}
    ranked = sorted(found, key=lambda path: (major(path), str(path)), reverse=True)
    yield from (path for path in ranked if major(path) >= OLDEST_MAJOR and str(path) != named)


def major(library: Path) -> int:
    """The version in a library's name (libLLVM-15.so.1, libLLVM.so.19.1), 0 where it has none."""
    number = re.search(r"libLLVM(?:-(\d+)|\.so\.(\d+))", library.name)
    return int(number[1] or number[2]) if number else 0


def failure(library: Path) -> str:
    """Why Mitsuba does not render with this library, "" if it does: tried in a process with an empty kernel cache."""
    home = tempfile.mkdtemp(prefix="vobench-llvm-")
    with stop.undone(lambda: stop.remove(Path(home))):
        environment = os.environ | {VARIABLE: str(library), "HOME": home}
        command = [sys.executable, "-P", "-c", PROBE]
        try:
            done = stop.run(command, env=environment, timeout_s=PROBE_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return f"no picture after {PROBE_TIMEOUT_S} s"
    if done.returncode < 0:
        return f"killed by {signal.Signals(-done.returncode).name}"
    silent = [f"died with {done.returncode}"]
    return (done.stderr.strip().splitlines() or silent)[-1][:200] if done.returncode else ""
