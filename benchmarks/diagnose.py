"""How often `vobench diagnose` is wrong: false alarms on clean pairs, and unrelated pairs that it does not name.

    python benchmarks/diagnose.py [--seed 0] [--pairs 30]

Ground truth is drawn by seed: cars on winding and on nearly straight roads, hands, and drones. A clean estimate is the
same motion with errors of 1 % and drift in rotation. An unrelated estimate is that of another drive, of the same drive
backwards in time, or a random walk, with the same time stamps. Further rows plant known faults.
"""

import argparse
from collections import Counter
from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from vobench.analysis.diagnose import diagnose
from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.runner.trajectory_pair import TrajectoryReading
from vobench.trajectory.trajectory import Trajectory, parse_pose_convention

STEP_NS = 100_000_000  # 10 Hz
TRANSLATION_ERROR = 0.01  # of each step
ROTATION_ERROR_RAD = 5e-4  # of each step
KINDS = ("winding road", "straight road", "hand", "drone")


def main() -> None:
    """Print what is named in clean, unrelated, and faulty pairs."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pairs", type=int, default=30)
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.pairs)

    for kind in KINDS:
        _print_row(f"clean, {kind}", [_named(*clean_pair(kind, seed)) for seed in seeds])
    for name, pair in UNRELATED.items():
        _print_row(f"unrelated, {name}", [_named(*pair(seed)) for seed in seeds])
    for name, pair in FAULTS.items():
        _print_row(f"fault, {name}", [_named(*pair(seed)) for seed in seeds])


def _print_row(name: str, named: list[str]) -> None:
    counts = ", ".join(f"{faults or 'nothing'} {count}" for faults, count in Counter(named).most_common())
    print(f"{name:40} {counts}", flush=True)


def _named(gt: Trajectory, est: Trajectory) -> str:
    """The faults that are named in a pair, joined by +."""
    try:
        findings = diagnose(TrajectoryReading(gt, "s", "s"), TrajectoryReading(est, "s", "s"))
    except AlignmentError as error:
        return f"error: {error}"
    return "+".join(finding.fault for finding in findings)


# --- Trajectories ---


def drive(kind: str, seed: int, count: int = 600) -> Trajectory:
    """A trajectory (count poses, 10 Hz) of a body of this kind."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    if kind == "hand":
        return _smooth_motion(rng, count, amplitude_m=0.6, tilt_rad=0.5)
    if kind == "drone":
        return _smooth_motion(rng, count, amplitude_m=4.0, tilt_rad=0.15)
    turn_rad_s = 0.15 if kind == "winding road" else 0.004
    return _car(rng, count, turn_rad_s)


def _car(rng: np.random.Generator, count: int, turn_rad_s: float) -> Trajectory:
    """A car with camera axes (z ahead), on a road with bumps and slopes."""
    step_s = STEP_NS / 1e9
    turn_rate = _smooth_noise(rng, count, correlation_frames=40)[:, 0]
    yaw_rad = np.cumsum(turn_rad_s * turn_rate) * step_s
    pitch_rad = 0.02 * _smooth_noise(rng, count, correlation_frames=60)[:, 0]
    roll_rad = 0.01 * _smooth_noise(rng, count, correlation_frames=15)[:, 0]
    speed_m_s = 9 + 3 * np.tanh(_smooth_noise(rng, count, correlation_frames=50)[:, 0])

    angles_rad = np.column_stack([yaw_rad, pitch_rad, roll_rad])
    R_world_body = Rotation.from_euler("ZYX", angles_rad).as_matrix()
    steps_m = (speed_m_s * step_s)[:, None] * R_world_body[:, :, 0]
    positions_m = np.cumsum(steps_m, axis=0)
    R_body_camera = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    return _trajectory(R_world_body @ R_body_camera, positions_m)


def _smooth_motion(rng: np.random.Generator, count: int, *, amplitude_m: float, tilt_rad: float) -> Trajectory:
    """A body that moves and turns smoothly in all directions."""
    positions_m = amplitude_m * _smooth_noise(rng, count, correlation_frames=25, axes=3)
    angles_rad = _smooth_noise(rng, count, correlation_frames=30, axes=3) * [tilt_rad, tilt_rad, 1.0]
    return _trajectory(Rotation.from_euler("xyz", angles_rad).as_matrix(), positions_m)


def _smooth_noise(rng: np.random.Generator, count: int, *, correlation_frames: int, axes: int = 1) -> Array:
    """Noise (count, axes) of unit variance, smooth over this many frames."""
    margin = 3 * correlation_frames
    white = rng.normal(size=(count + 2 * margin, axes))
    at = np.arange(-margin, margin + 1)
    kernel = np.exp(-0.5 * (at / correlation_frames) ** 2)
    kernel /= np.sqrt(np.sum(kernel**2))
    return np.column_stack([np.convolve(white[:, axis], kernel, mode="valid") for axis in range(axes)])


def _trajectory(R: Array, positions_m: Array) -> Trajectory:
    t_ns = np.arange(len(R), dtype=np.int64) * STEP_NS
    return Trajectory(t_ns, se3.transform(R, positions_m))


def estimate(gt: Trajectory, seed: int) -> Trajectory:
    """The estimate of an odometry with random errors in each step, which starts at the identity."""
    rng = np.random.default_rng([7, seed])
    steps = se3.inverse(gt.T_world_frame[:-1]) @ gt.T_world_frame[1:]
    length_m = np.linalg.norm(steps[:, :3, 3], axis=1)
    noise_m = TRANSLATION_ERROR * length_m[:, None] * rng.normal(size=(len(steps), 3))
    noise_rad = ROTATION_ERROR_RAD * rng.normal(size=(len(steps), 3))
    T = [np.eye(4)]
    for step, step_noise_m, R_noise in zip(steps, noise_m, Rotation.from_rotvec(noise_rad).as_matrix(), strict=True):
        noise = se3.transform(R_noise, step_noise_m)
        T.append(T[-1] @ step @ noise)
    return Trajectory(gt.t_ns, np.array(T))


# --- Pairs ---


def clean_pair(kind: str, seed: int) -> tuple[Trajectory, Trajectory]:
    """A drive and its estimate."""
    gt = drive(kind, seed)
    return gt, estimate(gt, seed)


def _of_other_drive(kind: str, other_kind: str) -> Callable[[int], tuple[Trajectory, Trajectory]]:
    def pair(seed: int) -> tuple[Trajectory, Trajectory]:
        other = drive(other_kind, seed + 1000)
        return drive(kind, seed), estimate(other, seed)

    return pair


def _reversed_in_time(seed: int) -> tuple[Trajectory, Trajectory]:
    gt, est = clean_pair("winding road", seed)
    return gt, Trajectory(est.t_ns, est.T_world_frame[::-1])


def _random_walk(seed: int) -> tuple[Trajectory, Trajectory]:
    rng = np.random.default_rng([9, seed])
    gt = drive("winding road", seed)
    positions_m = np.cumsum(rng.normal(scale=0.3, size=(len(gt), 3)), axis=0)
    angles_rad = np.cumsum(rng.normal(scale=0.02, size=(len(gt), 3)), axis=0)
    return gt, _trajectory(Rotation.from_euler("xyz", angles_rad).as_matrix(), positions_m)


def _convention(kind: str, word: str) -> Callable[[int], tuple[Trajectory, Trajectory]]:
    def pair(seed: int) -> tuple[Trajectory, Trajectory]:
        gt, est = clean_pair(kind, seed)
        return gt, Trajectory(est.t_ns, parse_pose_convention(word).apply(est.T_world_frame))

    return pair


def _inverse_and_late(seed: int) -> tuple[Trajectory, Trajectory]:
    gt, est = clean_pair("winding road", seed)
    inverse = parse_pose_convention("inverse").apply(est.T_world_frame)
    return gt, Trajectory(est.t_ns + 400_000_000, inverse)


def _inverse_truth(seed: int) -> tuple[Trajectory, Trajectory]:
    gt, est = clean_pair("winding road", seed)
    return Trajectory(gt.t_ns, se3.inverse(gt.T_world_frame)), est


UNRELATED = {
    "another winding road": _of_other_drive("winding road", "winding road"),
    "winding and straight road": _of_other_drive("winding road", "straight road"),
    "another hand": _of_other_drive("hand", "hand"),
    "another drone": _of_other_drive("drone", "drone"),
    "reversed in time": _reversed_in_time,
    "a random walk": _random_walk,
}
FAULTS = {
    "inverse poses, clock 0.4 s late": _inverse_and_late,
    "inverse poses of the truth": _inverse_truth,
    "half turn of the axes (car)": _convention("winding road", "axes:x,-y,-z"),
    "half turn of the axes (hand)": _convention("hand", "axes:x,-y,-z"),
}

if __name__ == "__main__":
    main()
