"""How soon the command line answers: CPU seconds (user and system) of whole processes, and of evo beside them.

    pip install evo; python benchmarks/startup.py [--repeats 5] [--poses 1000] [--evo PATH/TO/evo_ape]

Each command is run once unmeasured, so that Python's compiled files are there; the least of the repeats counts.
`check` is of `quickstart`, which has four cases. Compare within a run only: a busy machine doubles all of it.
"""

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vobench.geometry import se3
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

NS_PER_FRAME = 33_333_333
VOBENCH = (sys.executable, "-c", "from vobench.cli import main; main()")


def write_pair(folder: Path, poses: int) -> tuple[str, str]:
    """The files of a path and of an estimate of it that drifts, as TUM."""
    rng = np.random.default_rng(0)
    turn_rad = np.cumsum(rng.normal(scale=0.01, size=poses))
    steps = np.stack([np.cos(turn_rad), np.sin(turn_rad), 0.1 * np.sin(turn_rad)], -1) * 0.02
    t_ns = np.arange(poses, dtype=np.int64) * NS_PER_FRAME
    names = []
    for name, noise_m in (("gt.tum", 0.0), ("est.tum", 0.002)):
        positions = np.cumsum(steps + rng.normal(scale=noise_m, size=steps.shape), axis=0)
        trajectory = Trajectory(t_ns, se3.transform(se3.rotation_z(turn_rad), positions))
        (folder / name).write_text(format_tum(trajectory))
        names.append(str(folder / name))
    return names[0], names[1]


def cpu_s(command: Sequence[str], repeats: int) -> float:
    """The least CPU time of a process and its children."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    times = []
    for _ in range(repeats + 1):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, stdout=subprocess.DEVNULL, check=True, env=environment)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(times[1:])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--evo", default=shutil.which("evo_ape"), help="evo_ape, where it is not on the path")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        files = write_pair(Path(folder), arguments.poses)
        commands = {
            "python -c pass": (sys.executable, "-c", "pass"),
            "import numpy": (sys.executable, "-c", "import numpy"),
            "vobench --version": (*VOBENCH, "--version"),
            "vobench list": (*VOBENCH, "list"),
            "vobench check quickstart": (*VOBENCH, "check", "quickstart"),
            f"vobench score, {arguments.poses} poses": (*VOBENCH, "score", *files),
            f"vobench score --json, {arguments.poses} poses": (*VOBENCH, "score", *files, "--json"),
        }
        if arguments.evo:
            commands[f"evo_ape tum -a, {arguments.poses} poses"] = (arguments.evo, "tum", *files, "-a")
        print("| command | CPU s |\n|---|---:|")
        for name, command in commands.items():
            print(f"| {name} | {cpu_s(command, arguments.repeats):.2f} |", flush=True)


if __name__ == "__main__":
    main()
