"""How much of a result depends on the processor: quickstart with the libraries' faster instruction sets switched off.

    python benchmarks/processors.py [--only NAME ...] [--out FOLDER]

Libraries choose their code by what the processor offers. Each row of the table runs quickstart in a cache of its own
with one library, or all of them, held back to an older instruction set, and says which stage is the first whose bytes
differ from those of the unchanged run, the ATE of two estimators in mm, and the CPU time relative to it. This emulates
another processor by switching code off. It cannot emulate another make: instructions whose result makers may choose,
such as approximate reciprocals, stay those of this machine.

Embree reads its instruction set from no variable, so a small library written in C is loaded in front of it; those rows
are left out where there is no C compiler. Each row takes a minute or two.
"""

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import mkdtemp

from vobench.runner.folder import open_run

ESTIMATORS = ("lk_epipolar", "stereo_pnp")
STAGES = ("bakes", "sequences", "estimates")
# The first of what differs in a stage; a sequence's manifest names its recording, an estimate's its trajectory.
FILES = {"bakes": None, "sequences": "sensors.mcap", "estimates": "estimate.tum"}

MESA_SSE = {"GALLIUM_OVERRIDE_CPU_CAPS": "sse4.1", "LP_NATIVE_VECTOR_WIDTH": "128"}
MESA_AVX = {"GALLIUM_OVERRIDE_CPU_CAPS": "avx", "LP_NATIVE_VECTOR_WIDTH": "256"}
OPENCV_AVX2 = {"OPENCV_CPU_DISABLE": "AVX512-SKX"}
OPENCV_SSE = {"OPENCV_CPU_DISABLE": "AVX512-SKX,AVX2,FMA3,FP16,AVX"}
NO_IPP = {"OPENCV_IPP": "disabled"}
NUMPY_AVX2 = {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"}
NUMPY_SSE = {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"}
BLAS_AVX2 = {"OPENBLAS_CORETYPE": "Haswell"}
BLAS_SSE = {"OPENBLAS_CORETYPE": "Nehalem"}
EMBREE_AVX2 = {"EMBREE_CONFIG": "isa=avx2"}
EMBREE_SSE = {"EMBREE_CONFIG": "isa=sse4.2"}
LIBM_SSE = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX2,-FMA,-FMA4,-AVX"}

SWITCHES: dict[str, Mapping[str, str]] = {
    "unchanged": {},
    "unchanged, again": {"VOBENCH_AGAIN": "1"},
    "Mesa, vectors of 128 bits": {"LP_NATIVE_VECTOR_WIDTH": "128"},
    "Mesa, vectors of 512 bits": {"LP_NATIVE_VECTOR_WIDTH": "512"},
    "Mesa, SSE4.1": MESA_SSE,
    "OpenCV, AVX2": OPENCV_AVX2,
    "OpenCV, SSE3": OPENCV_SSE,
    "OpenCV, without IPP": NO_IPP,
    "numpy, x86-64-v3": NUMPY_AVX2,
    "numpy, x86-64-v2": NUMPY_SSE,
    "OpenBLAS, Haswell": BLAS_AVX2,
    "OpenBLAS, Zen": {"OPENBLAS_CORETYPE": "Zen"},
    "OpenBLAS, Nehalem": BLAS_SSE,
    "Embree, AVX2": EMBREE_AVX2,
    "Embree, SSE4.2": EMBREE_SSE,
    "glibc's libm, SSE2": LIBM_SSE,
    "all, AVX2": {**OPENCV_AVX2, **NUMPY_AVX2, **BLAS_AVX2, **EMBREE_AVX2},
    "portable": {"VOBENCH_PORTABLE": "1"},
    "all, SSE4": {**MESA_SSE, **OPENCV_SSE, **NO_IPP, **NUMPY_SSE, **BLAS_SSE, **EMBREE_SSE, **LIBM_SSE},
}

SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
void *rtcNewDevice(const char *config) {
  void *embree = dlopen(getenv("EMBREE_LIBRARY"), RTLD_NOW | RTLD_NOLOAD);
  void *(*create)(const char *) = (void *(*)(const char *))dlsym(embree, "rtcNewDevice");
  const char *chosen = getenv("EMBREE_CONFIG");
  return create(chosen ? chosen : config);
}
"""


@dataclass(frozen=True)
class Measured:
    """One run: hashes of each stage's results by key, ATE in mm by estimator and case, and its CPU time."""

    hashes: dict[str, dict[str, str]]
    ate_mm: dict[str, dict[str, float]]
    cpu_s: float

    def first_difference(self, other: "Measured") -> str:
        """The first stage whose bytes differ, and in how many of its results."""
        for stage in STAGES:
            mine = self.hashes[stage]
            theirs = other.hashes[stage]
            differing = [key for key in mine if mine[key] != theirs.get(key)]
            if differing:
                return f"{stage} ({len(differing)} of {len(mine)})"
        return "none"


def embree_shim(folder: Path) -> dict[str, str]:
    """What loads the library in front of Embree; empty where it cannot be built."""
    package = find_spec("embreex")
    compiler = shutil.which("cc")
    if package is None or package.origin is None or compiler is None:
        return {}
    source = folder / "shim.c"
    source.write_text(SHIM)
    library = folder / "shim.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    (embree,) = Path(package.origin).parent.parent.glob("embreex.libs/libembree4*")
    return {"LD_PRELOAD": str(library), "EMBREE_LIBRARY": str(embree)}


def measure(folder: Path, changes: Mapping[str, str]) -> Measured:
    """Run quickstart in a new cache with these variables."""
    environment = {**os.environ, **changes, "VOBENCH_CACHE": str(folder / "cache")}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, __file__, "--run", str(folder), "--keep", *changes]
    subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Measured(_hashes(folder / "cache"), _ate_mm(folder / "runs"), cpu_s)


def _hashes(cache: Path) -> dict[str, dict[str, str]]:
    hashes: dict[str, dict[str, str]] = {}
    for stage in STAGES:
        hashes[stage] = {}
        for manifest in cache.glob(f"{stage}/*/manifest.json"):
            files = json.loads(manifest.read_text())
            chosen = {name: file["sha256"] for name, file in files.items() if FILES[stage] in (None, name)}
            hashes[stage][manifest.parent.name] = json.dumps(chosen, sort_keys=True)
    return hashes


def _ate_mm(runs: Path) -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = {name: {} for name in ESTIMATORS}
    for score in open_run(runs / "quickstart").scores():
        ate_m = score.value("ate_trans", "rmse")
        found[score.estimator][score.case] = float("nan") if ate_m is None else 1e3 * ate_m
    return found


def run_once(folder: Path, variables: list[str]) -> None:
    """Run quickstart in this process, whose estimators see these variables too."""
    from vobench import cli
    from vobench.estimator import program

    program.KEPT_ENVIRONMENT = (*program.KEPT_ENVIRONMENT, *variables)
    chosen = [word for name in ESTIMATORS for word in ("--estimator", name)]
    sys.argv = ["vobench", "run", "quickstart", "--jobs", "1", "--out", str(folder / "runs"), *chosen]
    cli.main()


def main() -> None:
    """Run what is asked for and print a row for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=list(SWITCHES), choices=list(SWITCHES), metavar="NAME")
    parser.add_argument("--out", type=Path, default=None, help="where caches and runs are kept")
    parser.add_argument("--run", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--keep", nargs="*", default=[], help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.run:
        run_once(given.run, given.keep)
        return

    out = given.out or Path(mkdtemp(prefix="processors-"))
    out.mkdir(parents=True, exist_ok=True)
    shim = embree_shim(out)
    reference = None
    for number, name in enumerate(dict.fromkeys(["unchanged", *given.only])):
        changes = dict(SWITCHES[name])
        if "EMBREE_CONFIG" in changes:
            if not shim:
                print(f"| {name} | left out: no C compiler |", flush=True)
                continue
            changes |= shim
        measured = measure(out / str(number), changes)
        reference = reference or measured
        print(_row(name, measured, reference, is_first=number == 0), flush=True)


def _row(name: str, measured: Measured, reference: Measured, *, is_first: bool) -> str:
    cases = sorted(reference.ate_mm[ESTIMATORS[0]])
    cells = [name, measured.first_difference(reference)]
    for estimator in ESTIMATORS:
        cells += [f"{measured.ate_mm[estimator][case]:.4g}" for case in cases]
    cells.append(f"{measured.cpu_s / reference.cpu_s:.2f}")
    row = f"| {' | '.join(cells)} |"
    if not is_first:
        return row
    headings = ["switched", "first stage to differ", *(f"{e} {case}" for e in ESTIMATORS for case in cases), "CPU time"]
    return f"| {' | '.join(headings)} |\n|{'---|' * len(headings)}\n{row}"


if __name__ == "__main__":
    main()
