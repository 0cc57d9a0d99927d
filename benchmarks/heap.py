"""Look for the fault that corrupts the heap once in hundreds of sequences: many tiny sequences in one process.

    python benchmarks/heap.py [--sequences 1000] [--budget 600] [--folder FOLDER]

Three processes, one after the other, each make up to so many sequences and, for every tenth of them, the light of their
scene: with one thread of Mesa's llvmpipe (`LP_NUM_THREADS=1`), with two, and with two on a single core, where Embree
has one thread, as TBB counts the cores that a process may use. A sequence has two stereo pairs of 72 × 48 pixels. The
budget, in seconds, is of all three together; they take turns of a third each. Printed is how many sequences each made,
how it ended, and what glibc and faulthandler said. The sequences of every process must have the same bytes; a corrupted
heap may show there before it ends a process.
"""

import argparse
import faulthandler
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

SCENE = """name: closet
white_cd_m2: 50
materials:
  grain: {pattern: terrazzo, albedo: 0.5, contrast: 0.6, resolution_px: 64}
  shine: {kind: polished, pattern: plain, albedo: 0.3, resolution_px: 8}
room: {size_m: [2, 2, 1.5], floor: shine, wall: grain, ceiling: grain}
lamps: [{name: lamp, center_m: [0, 0, 1.4], size_m: [0.4, 0.4], power_lm: 600}]
"""
SUITE = """name: tiny
scenes: [closet]
rigs: {down: {pitch_deg: 60, picture_scale: 0.1}}
frames: [0, 2]
trajectories: {short: {targets_m: [[0.1, 0]], tolerance_m: 0.04, rate_hz: 3}}
truth: [depth, flow]
estimators: [stand_still]
"""
EVERY = 10  # sequences to one computation of light


@dataclass(frozen=True, slots=True)
class Setting:
    """How many threads llvmpipe and Embree have."""

    name: str
    mesa_threads: int
    cores: int


SETTINGS = (
    Setting("Mesa on 1 thread", 1, 2),
    Setting("Mesa on 2 threads", 2, 2),
    Setting("Mesa on 2 threads, Embree on 1", 2, 1),
)


def main() -> None:
    """Run the three processes and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sequences", type=int, default=1000)
    parser.add_argument("--budget", type=float, default=600.0)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--work", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.work:
        work(arguments.work, arguments.sequences, arguments.budget)
        return
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, Python {sys.version.split()[0]}", flush=True)
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        for kind, name, text in (("suites", "tiny", SUITE), ("scenes", "closet", SCENE)):
            place = Path(folder, kind)
            place.mkdir()
            (place / f"{name}.yaml").write_text(text)
        for setting in SETTINGS:
            run(setting, Path(folder), arguments.sequences, arguments.budget / len(SETTINGS))


def run(setting: Setting, folder: Path, sequences: int, budget_s: float) -> None:
    """One process, and how it ended."""
    environment = os.environ | {"LP_NUM_THREADS": str(setting.mesa_threads), "LIBC_FATAL_STDERR_": "1"}
    environment |= {"VOBENCH_CACHE": str(folder / "cache")}
    cores = sorted(os.sched_getaffinity(0))[: setting.cores]
    command = ["taskset", "-c", ",".join(map(str, cores)), sys.executable, __file__, "--work", str(folder)]
    command += ["--sequences", str(sequences), "--budget", str(budget_s)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_before_s = before.ru_utime + before.ru_stime
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    facts = [json.loads(line) for line in done.stdout.splitlines()]
    lights = sum("light_s" in fact for fact in facts)
    made = [fact for fact in facts if "bytes" in fact]
    kinds = Counter(fact["bytes"] for fact in made)
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = usage.ru_utime + usage.ru_stime - cpu_before_s
    print(
        f"{setting.name}: {len(made)} sequences and {lights} lights in {cpu_s:.0f} s of CPU, "
        f"{len(kinds)} kind(s) of bytes {[*kinds][:3]}, exit code {done.returncode}",
        flush=True,
    )
    if done.returncode:
        print(done.stderr[-4000:], flush=True)


def work(folder: Path, sequences: int, budget_s: float) -> None:
    """Make sequences in this process, one JSON object a line for each thing made."""
    faulthandler.enable()
    from vobench.runner.key import cache_folder
    from vobench.runner.simulate import bake_scene, simulate
    from vobench.runner.store import SilentProgress
    from vobench.runner.task import bake_task, perform
    from vobench.suite.suite import read_plan

    case = read_plan(str(folder / "suites" / "tiny.yaml")).simulated[0]
    light = perform(bake_task(case.scene), cache_folder())
    ends_s = time.monotonic() + budget_s
    for number in range(sequences):
        if time.monotonic() > ends_s:
            return
        with tempfile.TemporaryDirectory(dir=folder) as place:
            if number % EVERY == 0:
                began = time.monotonic()
                bake_scene(case.scene, Path(place), SilentProgress())
                print(json.dumps({"light_s": time.monotonic() - began}), flush=True)
        with tempfile.TemporaryDirectory(dir=folder) as place:
            simulate(case, Path(place), light=light, progress=SilentProgress())
            content = b"".join(path.read_bytes() for path in sorted(Path(place).glob("*.mcap")))
            print(json.dumps({"bytes": hashlib.sha256(content).hexdigest()[:12]}), flush=True)


if __name__ == "__main__":
    main()
