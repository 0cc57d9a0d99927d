"""Mitsuba in this process: its variant, and the libLLVM that it compiles kernels with."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from vobench import stop
from vobench.errors import MissingDependencyError, SettingError
from vobench.temporary import temporary_folder

VARIABLE = "DRJIT_LIBLLVM_PATH"
VARIANT_VARIABLE = "VOBENCH_MITSUBA_VARIANT"
CPU_VARIANT = "llvm_ad_rgb"
GPU_VARIANT = "cuda_ad_rgb"  # needs an NVIDIA driver with OptiX, and no libLLVM
OLDEST_MAJOR = 15  # Dr.Jit refuses older ones; 15 and 16 cannot compile for some processors
FOLDERS = ("usr/lib/*-linux-gnu", "usr/lib64", "usr/lib", "usr/lib/llvm*/lib", "usr/local/lib")
LLVM_REMEDY = "apt-get update && apt-get install -y libllvm19"
MITSUBA_REMEDY = f"{sys.executable} -m pip install 'mitsuba>=3.9,<4'"
PROBE_TIMEOUT_S = 120
MOST_CHARACTERS = 200  # of a reason in a message

# Renders for real: a library that loads may still abort when the first kernel is compiled.
PROBE = f"""
import mitsuba as mi
mi.set_variant("{CPU_VARIANT}")
sphere = {{"type": "sphere", "bsdf": {{"type": "roughplastic"}}}}
sensor = {{"type": "perspective", "to_world": mi.ScalarTransform4f().translate([0, 0, -5])}}
parts = {{"sphere": sphere, "sensor": sensor, "sky": {{"type": "constant"}}, "integrator": {{"type": "path"}}}}
scene = mi.load_dict({{"type": "scene", **parts}})
mean = float(mi.TensorXf(mi.render(scene, spp=1)).array.numpy().mean())
assert 0.5 < mean < 1.5, mean
"""


@cache
def prepare() -> None:
    """Make `import mitsuba` safe in this process, and set the variant of VOBENCH_MITSUBA_VARIANT or that for CPUs.

    Raises SettingError for a variant that is not supported, and MissingDependencyError if Mitsuba is missing, or for
    the variant for CPUs a libLLVM that works.
    """
    variant = wanted_variant()
    if variant == CPU_VARIANT:
        os.environ[VARIABLE] = str(working_library())
    elif find_spec("mitsuba") is None:
        raise MissingDependencyError(f"path tracing needs Mitsuba; run: {MITSUBA_REMEDY}")
    import mitsuba as mi

    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)


def wanted_variant() -> str:
    """The variant of Mitsuba that the environment requests, otherwise that for CPUs.

    Raises SettingError for a variant other than CPU_VARIANT and GPU_VARIANT.
    """
    variant = os.environ.get(VARIANT_VARIABLE) or CPU_VARIANT
    if variant not in (CPU_VARIANT, GPU_VARIANT):
        raise SettingError(f"{VARIANT_VARIABLE} should be {CPU_VARIANT} or {GPU_VARIANT}, got {variant!r}")
    return variant


def working_library() -> Path:
    """The first candidate with which Mitsuba renders.

    Raises MissingDependencyError if Mitsuba is not installed, or if no library works, with the reason for each.
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
    """The libraries to try: the one that the environment names, then those of the system, newest first."""
    named = os.environ.get(VARIABLE)
    if named:
        yield Path(named)
    libraries = set[Path]()
    for folder in FOLDERS:
        libraries.update(path.resolve() for path in Path("/").glob(f"{folder}/libLLVM*.so*"))
    for library in sorted(libraries, key=lambda path: (major(path), str(path)), reverse=True):
        if major(library) >= OLDEST_MAJOR and str(library) != named:
            yield library


def major(library: Path) -> int:
    """The major version in the name of a library (libLLVM-15.so.1, libLLVM.so.19.1), 0 if it has none."""
    number = re.search(r"libLLVM(?:-(\d+)|\.so\.(\d+))", library.name)
    return int(number[1] or number[2]) if number else 0


def failure(library: Path) -> str:
    """Why Mitsuba does not render with a library, "" if it does; tried in a process with an empty kernel cache."""
    with temporary_folder() as home:
        environment = os.environ | {VARIABLE: str(library), "HOME": str(home)}
        command = [sys.executable, "-P", "-c", PROBE]
        try:
            done = stop.run(command, env=environment, timeout_s=PROBE_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return f"no image after {PROBE_TIMEOUT_S} s"
    if done.returncode < 0:
        return f"killed by {signal.Signals(-done.returncode).name}"
    if done.returncode == 0:
        return ""
    lines = done.stderr.strip().splitlines()
    reason = lines[-1] if lines else f"died with {done.returncode}"
    return reason[:MOST_CHARACTERS]
