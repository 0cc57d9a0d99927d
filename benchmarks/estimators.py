"""How well the built-in estimators do, and what a frame costs them: segments in % per case, CPU ms a frame.

    python benchmarks/estimators.py [--runs FOLDER] [--rectangles FOLDER] [-e NAME or FOLDER]... [-c CASE]...

Sequences come from the suites in benchmarks/estimators and the built-in quickstart; what is missing in --runs is
rendered first (some minutes). --rectangles is the folder of runs of the same suites `office` and `hand` by the
commit ce32e00, whose office has no furniture but rectangles; without it these cases are left out. An estimator is a
built-in's name, or a folder with an estimator.yaml, say another version's. Estimators run in this process, with one
thread; a frame costs its process's CPU time, pictures decoded before.
"""

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from vobench import ScoreSettings, Sequence, Trajectory, read_sequence, read_trajectory, score
from vobench.estimator import Frame, Result
from vobench.estimator.worker import load
from vobench.geometry import se3
from vobench.run.estimate import _between
from vobench.estimator.protocol import EncoderReadings
from vobench.sequence.picture import grey
from vobench.suite.manifest import Manifest, read_manifest

HERE = Path(__file__).parent
BUILT_IN = HERE.parent / "estimators"
SUITES = HERE / "estimators"
Frames = list[Frame]
WITHOUT_SCALE = {"mono_vo"}  # their paths are scaled to the truth's before they are scored


def as_filmed(frames: Frames) -> Frames:
    """The pictures as they are."""
    return frames


def right_dimmer(frames: Frames) -> Frames:
    """The right eye's gain is 0.84 of the left one's, as EuRoC's is."""
    return [replace(f, right=np.round(f.right * 0.84).astype(np.uint8)) for f in frames]


def standing(frames: Frames) -> Frames:
    """The first pair 95 times, each with its own noise of 2 grey levels."""
    rng, first = np.random.default_rng(3), frames[0]

    def grainy(image: np.ndarray) -> np.ndarray:
        return np.clip(np.round(image + rng.normal(0, 2, image.shape)), 0, 255).astype(np.uint8)

    moments = (frames[0].t_ns + k * 33_333_333 for k in range(95))
    return [
        Frame(k, t_ns, grainy(first.left), grainy(first.right), first.encoders, first.imu)
        for k, t_ns in enumerate(moments)
    ]


@dataclass(frozen=True, slots=True)
class Case:
    """A sequence of a suite, and what is done to its pictures."""

    name: str
    suite: str
    case: str
    is_of_rectangles: bool = False
    altered: Callable[[Frames], Frames] = as_filmed


CASES = [
    Case("quick down", "quickstart", "down"),
    Case("quick ahead", "quickstart", "ahead"),
    Case("old quick down", "quickstart", "down", is_of_rectangles=True),
    Case("old quick ahead", "quickstart", "ahead", is_of_rectangles=True),
    Case("old drive", "office", "clean", is_of_rectangles=True),
    Case("old dark", "office", "dark", is_of_rectangles=True),
    Case("old fast", "hand", "fast", is_of_rectangles=True),
    Case("drive", "office", "clean"),
    Case("dark", "office", "dark"),
    Case("fast", "hand", "fast"),
    Case("far", "far", "perfect"),
    Case("far inward", "far", "inward"),
    Case("far outward", "far", "outward"),
    Case("gain down", "quickstart", "down", altered=right_dimmer),
    Case("gain ahead", "quickstart", "ahead", altered=right_dimmer),
    Case("gain drive", "office", "clean", altered=right_dimmer),
    Case("still down", "quickstart", "down", altered=standing),
    Case("still ahead", "quickstart", "ahead", altered=standing),
    Case("still drive", "office", "clean", altered=standing),
]


def main() -> None:
    """Render what is missing, run every estimator on every case, print one row each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, default=Path("runs"))
    parser.add_argument("--rectangles", type=Path)
    parser.add_argument("-e", "--estimator", action="append")
    parser.add_argument("-c", "--case", action="append", help="begins with this")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    cases = [case for case in CASES if not case.is_of_rectangles or arguments.rectangles]
    cases = [case for case in cases if not arguments.case or any(case.name.startswith(c) for c in arguments.case)]
    print(f"{'case':16s}{'estimator':22s}{'segm. %':>9s}{'scale':>8s}{'°/m':>8s}{'ATE, away mm':>13s}{'covered':>8s}{'CPU ms':>8s}")
    for case in cases:
        folder = sequence_folder(case, arguments.rectangles if case.is_of_rectangles else arguments.runs)
        for name in arguments.estimator or ["lk_epipolar", "stereo_pnp"]:
            print(f"{case.name:16s}{Path(name).name:22s}{measured(case, folder, name)}", flush=True)


def sequence_folder(case: Case, runs: Path) -> Path:
    """Where the sequence lies; rendered if it is not there."""
    folder = runs / case.suite / "latest" / "cases" / case.case / "sequence"
    if not folder.exists() and case.is_of_rectangles:
        raise SystemExit(f"run the suite {case.suite} by the commit ce32e00 into {runs} first: there is no {folder}")
    if not folder.exists():
        suite = case.suite if case.suite == "quickstart" else str(SUITES / f"{case.suite}.yaml")
        command = [sys.executable, "-c", "from vobench.cli import main; main()", "run", suite, "-e", "stand_still"]
        subprocess.run([*command, "--out", str(runs.resolve())], check=True, cwd=SUITES, stdout=subprocess.DEVNULL)
    return folder


def measured(case: Case, folder: Path, name: str) -> str:
    """One row of the table."""
    home = BUILT_IN / name if (BUILT_IN / name).is_dir() else Path(name)
    manifest = read_manifest(home)
    sequence, frames = read_sequence(folder), case.altered(list(frames_of(folder)))
    short = {"stereo": sequence.rig.right, "encoders": sequence.rig.wheels, "imu": sequence.rig.imu}
    if missing := [need for need in manifest.needs if need in short and not short[need]]:
        return f"needs {', '.join(missing)}"
    results, cpu_ms = run(home, manifest, sequence, frames)
    known = [k for k, result in enumerate(results) if result.T_odom_frame is not None and result.status != "lost"]
    coverage = len(known) / len(frames)
    if len(known) < 2:
        return f"{'-':>9s}{'-':>8s}{'-':>8s}{'-':>13s}{coverage:8.3f}{cpu_ms:8.1f}"
    T_frame_left = np.eye(4) if manifest.pose_of == "left_camera" else sequence.rig.T_body_left
    poses = np.stack([se3.inverse(T_frame_left) @ results[k].T_odom_frame @ T_frame_left for k in known])
    if case.altered is standing:
        farthest_mm = 1e3 * np.linalg.norm(poses[:, :3, 3], axis=1).max()
        return f"{'-':>9s}{'-':>8s}{'-':>8s}{farthest_mm:13.2f}{coverage:8.3f}{cpu_ms:8.1f}"
    estimate = Trajectory(np.array([frames[k].t_ns for k in known], np.int64), poses)
    scale = score(read_trajectory(folder), estimate, settings=ScoreSettings(alignment="sim3")).alignment.scale
    if manifest.name in WITHOUT_SCALE:
        poses[:, :3, 3] *= scale
        estimate = Trajectory(estimate.t_ns, poses)
    scored = score(read_trajectory(folder), estimate)
    values = {m.name: m.statistics.rmse if m.name == "ate_trans" else m.statistics.mean for m in scored.metrics}
    t_rel, r_rel = 1e2 * values.get("kitti_t_rel", np.nan), values.get("kitti_r_rel", np.nan)
    return f"{t_rel:9.3f}{scale:8.4f}{r_rel:8.3f}{1e3 * values['ate_trans']:13.2f}{coverage:8.3f}{cpu_ms:8.1f}"


def run(home: Path, manifest: Manifest, sequence: Sequence, frames: Frames) -> tuple[list[Result], float]:
    """What the estimator says of all frames, and its mean CPU time in ms from the second one on."""
    estimator = load(home, manifest.class_path, name=manifest.name)
    estimator.start(sequence.rig, dict(manifest.params), 0)
    results, spent_ms = [], []
    for frame in frames:
        begun = time.process_time()
        results.append(estimator.process(frame))
        spent_ms.append(1e3 * (time.process_time() - begun))
    return results, float(np.mean(spent_ms[1:]))


@cache
def frames_of(folder: Path) -> tuple[Frame, ...]:
    """All that an estimator may ask for, decoded."""
    sequence, frames, last_ns = read_sequence(folder), [], -1
    encoders = EncoderReadings(*sequence.encoders()) if sequence.rig.wheels else None
    imu = sequence.imu() if sequence.rig.imu else None
    for f in sequence.frames():
        left, right = (None if image is None else grey(image, f.colour) for image in (f.left, f.right))
        readings = _between(encoders, last_ns, f.t_ns), _between(imu, last_ns, f.t_ns)
        frames.append(Frame(f.index, f.t_ns, left, right, *readings))
        last_ns = f.t_ns
    return tuple(frames)


if __name__ == "__main__":
    main()
