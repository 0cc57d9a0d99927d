"""How well the built-in estimators do, and what a frame costs them: segments in % per case, CPU ms a frame.

    python benchmarks/estimators.py [--runs FOLDER] [--rectangles FOLDER] [-e NAME or FOLDER]... [-c CASE]...
    python benchmarks/estimators.py --fusions [--runs FOLDER]

--fusions compares wheel_visual and imu_visual with what they are made of, over five seeds of each case (slip, noise of
every sensor, the hand's shake): mean error, the 95 % interval of the ratio to each seed's better parent (Student's t of
the logarithms), in how many seeds it won, and how likely so many wins are by chance (Wilcoxon, one-sided).

Sequences come from the suites in benchmarks/estimators; what is missing in --runs is rendered first (some minutes).
--rectangles is the folder of runs of the same suites `office` and `hand`, and of `quickstart`, by the commit ce32e00,
whose office has no furniture but rectangles; without it these cases are left out. An estimator is a
built-in's name, or a folder with an estimator.yaml, say another version's. Estimators run in this process, with one
thread; a frame costs its process's CPU time, pictures decoded before.
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from scipy import stats

from vobench import ScoreSettings, Sequence, Trajectory, read_sequence, read_trajectory, score
from vobench.errors import VobenchError
from vobench.estimator import EncoderReadings, Frame, ImuReadings, Result
from vobench.estimator.manifest import Manifest
from vobench.estimator.worker import load
from vobench.geometry import se3
from vobench.sequence.picture import grey
from vobench.suite.manifest import read_manifest

HERE = Path(__file__).parent
BUILT_IN = HERE.parent / "estimators"
SUITES = HERE / "estimators"
Frames = list[Frame]
Readings = TypeVar("Readings", EncoderReadings, ImuReadings)


def as_filmed(frames: Frames) -> Frames:
    """The pictures as they are."""
    return frames


def right_dimmer(frames: Frames) -> Frames:
    """The right eye's gain is 0.84 of the left one's, as EuRoC's is."""
    return [replace(f, right=np.round(f.right * 0.84).astype(np.uint8)) for f in frames]


def standing(frames: Frames) -> Frames:
    """The first pair 95 times, each with its own noise of 2 grey levels."""
    rng = np.random.default_rng(3)
    first = frames[0]

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
    seed: int = 0  # 0: the suite's own

    @property
    def run_name(self) -> str:
        """The folder of the suite's runs."""
        return f"{self.suite}_{self.seed}" if self.seed else self.suite


CASES = [
    Case("quick down", "quick", "down"),
    Case("quick ahead", "quick", "ahead"),
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
    Case("gain down", "quick", "down", altered=right_dimmer),
    Case("gain ahead", "quick", "ahead", altered=right_dimmer),
    Case("gain drive", "office", "clean", altered=right_dimmer),
    Case("old gain down", "quickstart", "down", is_of_rectangles=True, altered=right_dimmer),
    Case("old gain ahead", "quickstart", "ahead", is_of_rectangles=True, altered=right_dimmer),
    Case("old gain drive", "office", "clean", is_of_rectangles=True, altered=right_dimmer),
    Case("still down", "quick", "down", altered=standing),
    Case("still ahead", "quick", "ahead", altered=standing),
    Case("still drive", "office", "clean", altered=standing),
]

SEEDS = range(1, 6)
WHEELS = ("wheel_visual", "stereo_pnp", "wheel_odometry")
INERTIAL = ("imu_visual", "stereo_pnp", "imu_dead_reckoning")
IN_LIGHT = ("lit-clean", "lit-dark")
BLINKING = ("blinking-clean", "blinking-dark")
FUSIONS = (
    ("wheels", WHEELS, (*IN_LIGHT, *BLINKING)),
    ("sparse", WHEELS, ("clean", "dark")),
    ("inertial", INERTIAL, (*IN_LIGHT, *BLINKING)),
)


def main() -> None:
    """Render what is missing, run every estimator on every case, print one row each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, default=Path("runs"))
    parser.add_argument("--rectangles", type=Path)
    parser.add_argument("-e", "--estimator", action="append")
    parser.add_argument("-c", "--case", action="append", help="begins with this")
    parser.add_argument("--fusions", action="store_true")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    if arguments.fusions:
        compare_fusions(arguments.runs)
        return
    cases = [case for case in CASES if not case.is_of_rectangles or arguments.rectangles]
    cases = [case for case in cases if not arguments.case or any(case.name.startswith(c) for c in arguments.case)]
    print(f"{'case':17s}{'estimator':20s}   segm.%    scale     °/m   ATE mm  farthest  covered  CPU ms")
    for case in cases:
        folder = sequence_folder(case, arguments.rectangles if case.is_of_rectangles else arguments.runs)
        for name in arguments.estimator or ["lk_epipolar", "stereo_pnp"]:
            row = measured(case.altered, folder, name)
            print(f"{case.name:17s}{Path(name).name:20s}{row or '  needs what this recording has not'}", flush=True)


def compare_fusions(runs: Path) -> None:
    """One row for each case: mean errors of a fusion and its parents, and the ratio to the better parent."""
    print(f"{'case':28s}{'fusion, parents: segm. %':>50s}{'ratio to the better one, 95 %':>36s}{'won':>6s}")
    for suite, names, cases in FUSIONS:
        for case in cases:
            folders = [sequence_folder(Case(case, suite, case, seed=seed), runs) for seed in SEEDS]
            pairs = list(product(folders, names))
            segment_errors = [measured(as_filmed, folder, name).segments for folder, name in pairs]
            errors = np.array(segment_errors).reshape(len(folders), len(names))
            ratio = np.log(errors[:, 0] / errors[:, 1:].min(1))
            half = stats.t.ppf(0.975, len(ratio) - 1) * ratio.std(ddof=1) / np.sqrt(len(ratio))
            said = ", ".join(f"{name} {mean:.3g}" for name, mean in zip(names, errors.mean(0), strict=True))
            middle, low, high = np.exp([ratio.mean(), ratio.mean() - half, ratio.mean() + half])
            by_chance = stats.wilcoxon(ratio, alternative="less").pvalue
            won = f"{(ratio < 0).sum():>4d}/{len(ratio)}  p {by_chance:.2f}"
            print(f"{suite + ' ' + case:24s}{said:>64s}{middle:10.2f} [{low:.2f}, {high:.2f}]{won}", flush=True)


def sequence_folder(case: Case, runs: Path) -> Path:
    """Where the sequence lies; rendered if it is not there. Raises SystemExit where today's code cannot render it."""
    folder = runs / case.run_name / "latest" / "cases" / case.case / "sequence"
    if folder.exists():
        return folder
    if case.is_of_rectangles:
        raise SystemExit(f"run the suite {case.suite} by the commit ce32e00 into {runs} first: there is no {folder}")
    suite = str(SUITES / f"{case.suite}.yaml")
    if case.seed:
        text = Path(suite).read_text(encoding="utf-8").replace("seed: 1\n", f"seed: {case.seed}\n", 1)
        suite = str((runs / f"{case.run_name}.yaml").resolve())
        Path(suite).write_text(text.replace(f"name: {case.suite}\n", f"name: {case.run_name}\n", 1), encoding="utf-8")
    command = [sys.executable, "-c", "from vobench.cli import main; main()", "run", suite, "-e", "stand_still"]
    subprocess.run([*command, "--out", str(runs.resolve())], check=True, cwd=SUITES, stdout=subprocess.DEVNULL)
    return folder


@dataclass(frozen=True, slots=True)
class Row:
    """Segments in %, scale, °/m, RMSE of position and the farthest from the start in mm, frames with a pose, cost."""

    segments: float
    scale: float
    turn: float
    ate_mm: float
    farthest_mm: float
    coverage: float
    cpu_ms: float

    def __str__(self) -> str:
        numbers = f"{self.segments:9.3f}{self.scale:9.4f}{self.turn:8.3f}{self.ate_mm:9.2f}{self.farthest_mm:10.2f}"
        return f"{numbers}{self.coverage:9.3f}{self.cpu_ms:8.1f}"


def measured(altered: Callable[[Frames], Frames], folder: Path, name: str) -> Row | None:
    """One row of the table; None where the recording lacks what the estimator needs."""
    home = BUILT_IN / name if (BUILT_IN / name).is_dir() else Path(name)
    manifest = read_manifest(home)
    sequence = read_sequence(folder)
    frames = altered(list(frames_of(folder)))
    short = {"stereo": sequence.rig.right, "encoders": sequence.rig.wheels, "imu": sequence.rig.imu}
    if any(need in short and not short[need] for need in manifest.needs):
        return None
    try:
        results, cpu_ms = run(home, manifest, sequence, frames)
    except VobenchError:  # a rig that it cannot be used with
        return None
    known = [k for k, result in enumerate(results) if result.T_odom_frame is not None and result.status != "lost"]
    T_frame_left = np.eye(4) if manifest.pose_of == "left_camera" else sequence.rig.T_body_left
    poses = np.stack([se3.inverse(T_frame_left) @ results[k].T_odom_frame @ T_frame_left for k in known])
    farthest_mm = 1e3 * float(np.linalg.norm(poses[:, :3, 3], axis=1).max())
    nan = np.nan
    if altered is standing or len(known) < 3:
        return Row(nan, nan, nan, nan, farthest_mm, len(known) / len(frames), cpu_ms)
    truth = read_trajectory(folder)
    stamps = np.array([frames[k].t_ns for k in known], np.int64)
    scale = score(truth, Trajectory(stamps, poses), settings=ScoreSettings(alignment="sim3")).alignment.scale
    if not manifest.metric:
        poses[:, :3, 3] *= scale
    scored = score(truth, Trajectory(stamps, poses))
    t_rel, r_rel = (scored.metric(name) for name in ("kitti_t_rel", "kitti_r_rel"))
    return Row(
        segments=100 * t_rel.statistics.mean if t_rel else nan,
        scale=scale,
        turn=r_rel.statistics.mean if r_rel else nan,
        ate_mm=1e3 * scored.metric("ate_trans").statistics.rmse,
        farthest_mm=farthest_mm,
        coverage=len(known) / len(frames),
        cpu_ms=cpu_ms,
    )


def run(home: Path, manifest: Manifest, sequence: Sequence, frames: Frames) -> tuple[list[Result], float]:
    """What the estimator says of all frames, and its mean CPU time in ms from the second one on."""
    estimator = load(home, manifest.class_path, name=manifest.name)
    estimator.start(sequence.rig, dict(manifest.params), 0)
    results = []
    spent_ms = []
    for frame in frames:
        begun = time.process_time()
        results.append(estimator.process(frame))
        spent_ms.append(1e3 * (time.process_time() - begun))
    return results, float(np.mean(spent_ms[1:]))


@cache
def frames_of(folder: Path) -> tuple[Frame, ...]:
    """All that an estimator may ask for, decoded."""
    sequence = read_sequence(folder)
    frames = []
    last_ns = -1
    encoders = EncoderReadings(*sequence.encoders()) if sequence.rig.wheels else None
    imu = sequence.imu() if sequence.rig.imu else None
    for f in sequence.frames():
        left, right = (None if image is None else grey(image, f.colour) for image in (f.left, f.right))
        readings = between(encoders, last_ns, f.t_ns), between(imu, last_ns, f.t_ns)
        frames.append(Frame(f.index, f.t_ns, left, right, *readings))
        last_ns = f.t_ns
    return tuple(frames)


def between(readings: Readings | None, last_ns: int, now_ns: int) -> Readings | None:
    """The readings after one frame, up to and including the next."""
    if readings is None:
        return None
    first, end = np.searchsorted(readings.t_ns, [last_ns, now_ns], side="right")
    return type(readings)(*(getattr(readings, f.name)[first:end] for f in fields(readings)))


if __name__ == "__main__":
    main()
