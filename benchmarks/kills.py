"""Kill vobench at random moments, and see that nothing outlives it and that the same command resumes.

    python benchmarks/kills.py [--jobs 2] [--kills 40] [--dask-kills 10] [--seed 1] [--folder FOLDER]

Each kill starts a tiny suite on an empty cache, sends SIGKILL to vobench at a random moment, and looks two seconds
later which processes that it started are still alive. Then the same command runs to its end: its run folder must have
the hashes of a run that was never killed, and nothing may be left in its TMPDIR or unfinished in its cache. With Dask,
on two workers, the client is killed in one half of the runs and one of the workers in the other half.

One estimator of the suite is slow and starts a process in a session of its own, which sleeps for an hour.
"""

import argparse
import ctypes
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h: orphans become our children, so that none escapes the count
GONE_S = 2.0
EARLIEST_S = 0.2
SCENE = """name: closet
white_cd_m2: 50
materials: {grain: {pattern: plain, albedo: 0.5, resolution_px: 8}}
room: {size_m: [2, 2, 1.5], floor: grain, wall: grain, ceiling: grain}
lamps: [{name: lamp, center_m: [0, 0, 1.4], size_m: [0.4, 0.4], power_lm: 600}]
"""
SUITE = """name: tiny
scenes: [closet]
lightings: {full: {}, dim: {lamp: {power_lm: 150}}}
rigs: {down: {pitch_deg: 90}}
trajectories: {short: {targets_m: [[0.25, 0]], tolerance_m: 0.04, rate_hz: 5}}
estimators: [wheel_odometry, slow]
"""
MANIFEST = "name: slow\nversion: '1'\nclass: estimator:Slow\npose_of: body\nsummary: Answers late.\n"
ESTIMATOR = """
import subprocess, time
import numpy as np
from vobench.estimator import Result, Status

class Slow:
    def start(self, rig, params, seed):
        subprocess.Popen(["sleep", "3600"], start_new_session=True)

    def process(self, frame):
        time.sleep(0.1)
        return Result(T_odom_frame=np.eye(4), status=Status.OK)
"""


@dataclass(frozen=True, slots=True)
class Kill:
    """What came of one kill: who lived on, how the resumed run ended, and what it left."""

    whom: str
    after_s: float
    survivors: list[str]
    exit_code: int
    same_bytes: bool
    left_behind: list[str]

    @property
    def is_clean(self) -> bool:
        """Whether all was as it should be."""
        return not (self.survivors or self.exit_code or self.left_behind) and self.same_bytes


class Place:
    """A folder with the suite, in which vobench runs with a cache and a temporary folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.cache = folder / "cache"
        self.runs = folder / "runs"
        self.temporary = folder / "tmp"
        plugin = folder / "estimators" / "slow"
        for path in (folder / "suites", folder / "scenes", plugin):
            path.mkdir(parents=True)
        (folder / "suites" / "tiny.yaml").write_text(SUITE)
        (folder / "scenes" / "closet.yaml").write_text(SCENE)
        (plugin / "estimator.yaml").write_text(MANIFEST)
        (plugin / "estimator.py").write_text(ESTIMATOR)
        self.empty()

    def empty(self) -> None:
        """Forget all results."""
        for path in (self.cache, self.runs, self.temporary):
            shutil.rmtree(path, ignore_errors=True)
            path.mkdir()

    def start(self, *options: str) -> "subprocess.Popen[bytes]":
        """Start a run."""
        environment = os.environ | {"VOBENCH_CACHE": str(self.cache), "TMPDIR": str(self.temporary)}
        command = [sys.executable, "-c", "from vobench.cli import main; main()", "run", "tiny", *options]
        with (self.folder / "log.txt").open("wb") as log:
            return subprocess.Popen(command, cwd=self.folder, env=environment, stdout=log, stderr=log)

    def hashes(self) -> dict[str, str]:
        """The hashes of the latest run's files, those of times left out."""
        return json.loads((self.runs / "tiny" / "latest" / "hashes.json").read_text())

    def left_behind(self) -> list[str]:
        """What lies in the temporary folder, and what is unfinished elsewhere."""
        unfinished = [*self.cache.rglob(".*"), *self.runs.rglob(".*")]
        return sorted(str(path.relative_to(self.folder)) for path in [*self.temporary.iterdir(), *unfinished])


def main() -> None:
    """Kill, resume, count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", default="2")
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--dask-kills", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path)
    arguments = parser.parse_args()
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    dice = random.Random(arguments.seed)
    kills = []
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        place = Place(Path(folder) / "place")
        options = ("-j", arguments.jobs)
        whole_s = timed(place, *options)
        reference = place.hashes()
        print(
            f"a whole run with {arguments.jobs} jobs takes {whole_s:.1f} s, load {os.getloadavg()[0]:.1f}", flush=True
        )
        for _ in range(arguments.kills):
            kills.append(kill_vobench(place, reference, dice.uniform(EARLIEST_S, whole_s), "vobench", *options))
            report(kills[-1])
        if arguments.dask_kills:
            kills += with_dask(place, reference, dice, arguments.dask_kills)
    for whom, number in Counter(kill.whom for kill in kills).items():
        clean = sum(kill.is_clean for kill in kills if kill.whom == whom)
        print(f"{whom}: {clean} of {number} kills left nothing, and resumed to the same bytes")
    raise SystemExit(not all(kill.is_clean for kill in kills))


def with_dask(place: Place, reference: dict[str, str], dice: random.Random, kills: int) -> list[Kill]:
    """Kill the client and one of two workers of a Dask cluster, by turns."""
    import dask
    from distributed import LocalCluster

    found = []
    dask.config.set({"temporary-directory": str(place.folder / "dask")})
    os.environ["VOBENCH_CACHE"] = str(place.cache)  # of the workers
    os.environ["TMPDIR"] = str(place.temporary)
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, worker_dashboard_address=None,
    ) as cluster:  # fmt: skip
        options = ("--scheduler", cluster.scheduler_address)
        whole_s = timed(place, *options)
        if place.hashes() != reference:
            raise SystemExit("a run with Dask has other bytes than one without")
        print(f"a whole run with Dask takes {whole_s:.1f} s", flush=True)
        for number in range(kills):
            after_s = dice.uniform(EARLIEST_S, whole_s)
            if number % 2:
                found.append(kill_worker(place, cluster, reference, after_s, *options))
            else:
                found.append(kill_vobench(place, reference, after_s, "Dask's client", *options))
            report(found[-1])
    return found


def timed(place: Place, *options: str) -> float:
    """The seconds that a run on an empty cache takes."""
    place.empty()
    began = time.monotonic()
    require(place, place.start(*options).wait())
    return time.monotonic() - began


def require(place: Place, exit_code: int) -> None:
    """Stop where a run that nobody kills fails."""
    if exit_code:
        raise SystemExit(f"a run ended with {exit_code}:\n{(place.folder / 'log.txt').read_text()}")


def kill_vobench(place: Place, reference: dict[str, str], after_s: float, whom: str, *options: str) -> Kill:
    """Kill vobench itself, then resume."""
    place.empty()
    vobench = place.start(*options)
    time.sleep(after_s)
    vobench.kill()
    vobench.wait()
    time.sleep(GONE_S)
    survivors = [told for _, told in started()]
    exit_code = place.start(*options).wait()
    return outcome(place, reference, whom, after_s=after_s, survivors=survivors, exit_code=exit_code)


def kill_worker(place: Place, cluster: object, reference: dict[str, str], after_s: float, *options: str) -> Kill:
    """Kill one of Dask's workers, whose tasks go to another one; the run is not resumed but goes on."""
    place.empty()
    vobench = place.start(*options)
    time.sleep(after_s)
    victim = next(iter(cluster.workers.values())).pid
    below = {pid for pid, _ in started(victim)}
    os.kill(victim, signal.SIGKILL)
    time.sleep(GONE_S)
    survivors = [told for pid, told in started() if pid in below]
    exit_code = vobench.wait()
    if exit_code:  # killed so early that vobench was still asking the workers for their versions
        exit_code = place.start(*options).wait()
    return outcome(place, reference, "Dask's worker", after_s=after_s, survivors=survivors, exit_code=exit_code)


def outcome(
    place: Place, reference: dict[str, str], whom: str, *, after_s: float, survivors: list[str], exit_code: int
) -> Kill:
    """What is to be said once the run is through."""
    same_bytes = not exit_code and place.hashes() == reference
    until_s = time.monotonic() + GONE_S
    while started() and time.monotonic() < until_s:  # Dask's workers end what they started for a client
        time.sleep(0.05)
    survivors += [f"after the run: {told}" for _, told in started()]
    return Kill(whom, after_s, survivors, exit_code, same_bytes, place.left_behind())


def report(kill: Kill) -> None:
    """One line for each kill."""
    verdict = "clean"
    if not kill.is_clean:
        verdict = f"alive {kill.survivors}, exit code {kill.exit_code}, left {kill.left_behind}"
        if not kill.same_bytes:
            verdict += ", OTHER BYTES"
    print(f"{kill.whom} killed after {kill.after_s:5.2f} s: {verdict}", flush=True)


def started(ancestor: int | None = None) -> list[tuple[int, str]]:
    """The living processes below one, with their command lines; those of Dask's cluster itself left out."""
    children: dict[int, list[int]] = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, parent = path.read_text(errors="replace").rpartition(")")[2].split()[:2]
            if state not in "ZX":
                children.setdefault(int(parent), []).append(int(path.parent.name))
    found = []
    below = list(children.get(ancestor or os.getpid(), []))
    for pid in below:  # which grows as we go
        below += children.get(pid, [])
        with suppress(OSError):
            told = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            if "from multiprocessing" not in told:
                found.append((pid, f"{pid} {told[-80:]}"))
    return found


if __name__ == "__main__":
    main()
