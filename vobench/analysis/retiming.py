"""Changes when a body is where along its path: the same path, more slowly, or in more pictures."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from vobench.geometry.se3 import Array
from vobench.motion.replay import Replay
from vobench.runner.motion import body_motion
from vobench.suite.case import Case
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

SAMPLE_HZ = 100.0  # of the motion that is replayed
KNOT_HZ = 25.0  # of the spline through the samples: shakes of a hand stay below 10 Hz
SMOOTHING_S = 0.3  # over which the turn rate is averaged

# The duration (N,) of each instant after the change, relative to its duration before, from the turn rates (N,).
Stretch = Callable[[Array], Array]


def at_half_speed(case: Case) -> Case:
    """The same path at half the speed, in pictures at the same rate."""
    return _retimed(case, "half_speed", lambda turn_radps: np.full(len(turn_radps), 2.0))


def at_half_turn_rate(case: Case) -> Case:
    """The same path, slowed down where the body turns by more than half of its largest turn rate."""

    def stretch(turn_radps: Array) -> Array:
        half_radps = turn_radps.max() / 2
        if half_radps == 0:
            return np.ones(len(turn_radps))
        return np.asarray(np.maximum(turn_radps / half_radps, 1.0))

    return _retimed(case, "half_turn_rate", stretch)


def at_twice_the_rate(case: Case) -> Case:
    """The same motion in twice as many pictures."""
    if case.frames is not None:
        return case
    unchanged = _retimed(case, "twice_the_rate", lambda turn_radps: np.ones(len(turn_radps)))
    trajectory = replace(unchanged.trajectory, rate_hz=2 * case.trajectory.rate_hz)
    return replace(unchanged, trajectory=trajectory)


def _retimed(case: Case, name: str, stretch: Stretch) -> Case:
    """Replay the motion of a case with other times. A part of a case, by `frames`, stays as it is.

    Raises MotionError if the case has no motion.
    """
    if case.frames is not None:
        return case
    motion = body_motion(case).motion
    duration_s = (motion.end_ns - motion.start_ns) / NS_PER_S
    count = max(int(duration_s * SAMPLE_HZ), 2) + 1
    t_s = np.linspace(0, duration_s, count)
    at_samples = motion.at(np.rint(t_s * NS_PER_S).astype(np.int64) + motion.start_ns)

    turn_radps = np.linalg.norm(at_samples.angular_velocity_radps, axis=1)
    stretched_s = cumulative_trapezoid(stretch(_smoothed(turn_radps)), t_s, initial=0.0)
    t_ns = np.rint(stretched_s * NS_PER_S).astype(np.int64)
    replayed = Trajectory(t_ns, at_samples.T_world_body)
    trajectory = Replay(
        file=f"{name}.tum",
        knot_hz=KNOT_HZ,
        rate_hz=case.trajectory.rate_hz,
        max_gap_s=max(1.0, float(np.diff(stretched_s).max()) * 2),
    )
    variant = {**case.variant, "trajectory": f"{case.variant.get('trajectory', 'path')}_{name}"}
    return replace(case, trajectory=trajectory, replayed=format_tum(replayed), variant=variant)


def _smoothed(values: Array) -> Array:
    """A moving average of values (N,) over SMOOTHING_S."""
    width = max(1, round(SMOOTHING_S * SAMPLE_HZ))
    if len(values) <= width:
        return values
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.ones(width) / width, mode="valid")
