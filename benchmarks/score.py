"""What a score costs: vobench against evo on the same trajectories, in one run.

    pip install evo; python benchmarks/score.py [--sizes 1000 10000 100000] [--repeats 3]
    python benchmarks/score.py --alone 1000000        (vobench only, with its peak of memory)
    python benchmarks/score.py --pairs                (all pairs half a metre apart: how the time grows)

Both begin with stamps, positions and quaternions in memory, and associate, align with SE(3), and take ATE and
RPE over a frame, translation and rotation. The best of the repeats counts. Compare within a run only.
"""

import argparse
import os
import platform
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.ate import absolute_errors
from vobench.metric.motion_error import errors_between
from vobench.metric.pose_pairs import select_pairs
from vobench.metric.score import ScoreSettings, score, statistics
from vobench.trajectory.align import align
from vobench.trajectory.associate import match
from vobench.trajectory.trajectory import Stamps, Trajectory

HZ = 100
NAMES = ("ate_trans", "ate_rot", "rpe_trans", "rpe_rot")


@dataclass(frozen=True, slots=True)
class Rows:
    """A trajectory as a file has it: stamps (N,), positions (N, 3), quaternions (N, 4) with the scalar last."""

    t_ns: Stamps
    positions_m: Array
    q_xyzw: Array


def walk(n: int, rng: np.random.Generator) -> tuple[Rows, Rows]:
    """A smooth path of n poses at 100 Hz and an estimate of it that drifts, trembles and is 2 ms late."""
    t_ns = np.arange(n, dtype=np.int64) * (10**9 // HZ)
    turn_rad = np.cumsum(rng.normal(scale=0.01, size=n))
    positions = np.cumsum(np.stack([np.cos(turn_rad), np.sin(turn_rad), 0.1 * np.sin(turn_rad)], -1) * 0.01, axis=0)
    truth = Rows(t_ns, positions, se3.to_quaternion(se3.rotation_z(turn_rad)))
    moved = positions * 1.01 + rng.normal(scale=0.002, size=(n, 3)) + [3.0, -1.0, 0.5]
    noisy = truth.q_xyzw + rng.normal(scale=0.002, size=(n, 4))
    return truth, Rows(t_ns + 2_000_000, moved, noisy / np.linalg.norm(noisy, axis=1, keepdims=True))


def as_trajectory(rows: Rows) -> Trajectory:
    """The rows as vobench holds them."""
    return Trajectory(rows.t_ns, se3.transform(se3.from_quaternion(rows.q_xyzw), rows.positions_m))


def with_vobench(gt: Rows, est: Rows) -> list[float]:
    """The four RMSE of NAMES."""
    matched = match(as_trajectory(gt), as_trajectory(est))
    T_est = align(matched.T_est, matched.T_gt, kind="se3").apply(matched.T_est)
    pairs = select_pairs(matched.T_gt, matched.t_ns, delta=1, unit="f", all_pairs=False)
    ate = absolute_errors(matched.T_gt, T_est)
    rpe = errors_between(matched.T_gt, T_est, *pairs)
    errors = [ate.trans_m, np.rad2deg(ate.rot_rad), rpe.trans_m, np.rad2deg(rpe.rot_rad)]
    return [statistics(e).rmse for e in errors]


def with_evo(gt: Rows, est: Rows) -> list[float]:
    """The same by evo's library, as its commands call it."""
    from evo.core import metrics, sync
    from evo.core.trajectory import PoseTrajectory3D
    from evo.core.units import Unit

    held = [PoseTrajectory3D(r.positions_m, np.roll(r.q_xyzw, 1, axis=1), r.t_ns / 1e9) for r in (gt, est)]
    truth, estimate = sync.associate_trajectories(*held, max_diff=0.01)
    estimate.align(truth)
    angle = metrics.PoseRelation.rotation_angle_deg
    trans = metrics.PoseRelation.translation_part
    found = [
        metrics.APE(trans),
        metrics.APE(angle),
        *(metrics.RPE(part, delta=1, delta_unit=Unit.frames) for part in (trans, angle)),
    ]
    for metric in found:
        metric.process_data((truth, estimate))
    return [metric.get_all_statistics()["rmse"] for metric in found]


def best_s(work: Callable[[], object], repeats: int) -> float:
    """The shortest of so many runs, in seconds."""
    spent = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        spent.append(time.perf_counter() - begin)
    return min(spent)


def compare(sizes: list[int], repeats: int) -> None:
    """Print a row for each number of poses."""
    print(f"{'poses':>8} {'evo ms':>10} {'vobench ms':>11} {'ratio':>7}   largest relative difference of the four RMSE")
    for n in sizes:
        gt, est = walk(n, np.random.default_rng(1))
        ours = np.array(with_vobench(gt, est))
        theirs = np.array(with_evo(gt, est))
        ours_s = best_s(lambda: with_vobench(gt, est), 3 * repeats)  # noqa: B023  (called before gt changes)
        theirs_s = best_s(lambda: with_evo(gt, est), repeats if n < 10**5 else 1)  # noqa: B023
        off = np.max(np.abs(ours / theirs - 1))
        print(f"{n:8d} {1e3 * theirs_s:10.1f} {1e3 * ours_s:11.2f} {theirs_s / ours_s:6.0f}x   {off:.1e}")


def alone(n: int) -> None:
    """Print time and memory of the whole `score` and of the four RMSE for n poses."""
    gt, est = walk(n, np.random.default_rng(1))
    four_s = best_s(lambda: with_vobench(gt, est), 1)
    settings = ScoreSettings(rpe_delta=0.5, rpe_unit="m", rpe_all_pairs=True)
    score_s = best_s(lambda: score(as_trajectory(gt), as_trajectory(est), settings=settings), 1)
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{n} poses: the four {four_s:.2f} s, score() with RPE over all pairs by metres {score_s:.2f} s", end="")
    print(f", peak {peak_mib:.0f} MiB")


def growth() -> None:
    """Print how the search of all pairs by metres grows; n log n means a factor of about 11 a row."""
    for n in (10**3, 10**4, 10**5, 10**6):
        path = as_trajectory(walk(n, np.random.default_rng(1))[0])
        T = path.T_world_frame
        t_ns = path.t_ns
        spent = best_s(lambda: select_pairs(T, t_ns, delta=0.5, unit="m", all_pairs=True), 3)  # noqa: B023
        print(f"{n:8d} poses {1e3 * spent:9.2f} ms")


def main() -> None:
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(description="What a score costs, beside evo.")
    parser.add_argument("--sizes", type=int, nargs="+", default=[10**3, 10**4, 10**5])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--alone", type=int)
    parser.add_argument("--pairs", action="store_true")
    asked = parser.parse_args()
    print(f"Python {platform.python_version()}, numpy {np.__version__}, {os.cpu_count()} cores")
    if asked.alone:
        alone(asked.alone)
    elif asked.pairs:
        growth()
    else:
        print(f"evo {metadata.version('evo')}")
        compare(asked.sizes, asked.repeats)


if __name__ == "__main__":
    main()
