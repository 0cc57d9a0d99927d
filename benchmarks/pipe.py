"""What it costs to hand an estimator a stereo pair in a process of its own, against calling the class directly.

Frames go through shared memory where the kernel has it; the second column is what a pipe takes instead.

    python benchmarks/pipe.py [--frames 500] [--repeats 3] [--starts 20]

The estimator answers with a pose, 300 tracks and two numbers. Medians of the best repeat.
With VOBENCH_SANDBOX=off a start is one without the sandbox.
"""

import argparse
import platform
import resource
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np

from vobench.estimator import Frame
from vobench.estimator.manifest import Limits
from vobench.estimator.process import EstimatorProcess
from vobench.estimator.program import sandbox_here
from vobench.estimator.worker import load
from vobench.geometry.rig import LENSES, stereo_rig

SIZES = {"720 x 480": (480, 720), "1920 x 1080": (1080, 1920), "1920 x 1080 colour": (1080, 1920, 3)}
CODE = """
import numpy as np
from vobench.estimator import Result, Tracks
class Idle:
    def start(self, rig, params, seed):
        self.tracks = Tracks(np.ones((300, 2)), np.ones((300, 2)), np.ones(300, bool))
    def process(self, frame):
        return Result(np.eye(4), tracks=self.tracks, stats={"flow_px": 1.0, "inliers": 300.0})
"""


def started(folder: Path) -> EstimatorProcess:
    """The class in a process of its own."""
    return EstimatorProcess.of_class(folder, "idle:Idle", name="idle", log=folder / "log", limits=Limits())


def median_ms(process, picture: np.ndarray, frames: int) -> float:
    """The median time of a call of `process`."""
    spent = []
    for index in range(frames):
        frame = Frame(index, index * 10**8, picture, picture)
        began = time.perf_counter()
        process(frame)
        spent.append(time.perf_counter() - began)
    return 1e3 * float(np.median(spent))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=500)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--starts", type=int, default=20)
    args = parser.parse_args()
    lens = LENSES["paper_blender"]
    rig = stereo_rig(lens, pitch_deg=90)
    rng = np.random.default_rng(0)
    print(f"{platform.machine()}, Python {platform.python_version()}; ms a pair")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "idle.py").write_text(CODE)
        direct = load(folder, "idle:Idle", name="idle")
        direct.start(rig, {}, 0)
        for size, shape in SIZES.items():
            picture = rng.integers(0, 255, shape).astype(np.uint8)
            height_px, width_px = shape[:2]
            rig = stereo_rig(replace(lens, width_px=width_px, height_px=height_px), pitch_deg=90)
            shared_ms = []
            piped_ms = []
            frames = max(args.frames * 480 * 720 // picture.size, 20)
            for _ in range(args.repeats):
                with started(folder) as shared, started(folder) as piped:
                    shared.start(rig, {}, 0)
                    with mock.patch("vobench.estimator.process.frame_memory", return_value=None):
                        piped.start(rig, {}, 0)
                    shared_ms.append(median_ms(shared.process, picture, frames))
                    piped_ms.append(median_ms(piped.process, picture, frames))
            alone = median_ms(direct.process, picture, frames)
            shown = f"{min(shared_ms):7.3f} shared, {min(piped_ms):7.3f} piped, {alone:7.3f} direct"
            print(f"{size:>20}: {shown}")
        spent = []
        for _ in range(args.starts):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            with started(folder) as process:
                process.start(rig, {}, 0)
                process.finish()
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        quickest_ms = 1e3 * min(spent)
        median_ms_of_starts = 1e3 * float(np.median(spent))
        print(f"a start and an end without frames: {median_ms_of_starts:.0f} ms of CPU, {quickest_ms:.0f} at best,")
        print(f"the guard with it; the estimator {sandbox_here().sentence}")


if __name__ == "__main__":
    main()
