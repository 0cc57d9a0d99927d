"""Changes the timing of a motion along an unchanged path: half the speed, half the turn rate, twice the frame rate."""

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

SAMPLE_HZ = 100.0  # the rate at which the original motion is sampled
KNOT_HZ = 25.0  # the rate of the knots of the spline through the samples; hand shake stays below 10 Hz
SMOOTHING_S = 0.3  # the length of the moving average of the angular speed

# A function from the angular speeds (N,) in rad/s to the factors (N,) by which time is stretched at these instants.
Stretch = Callable[[Array], Array]


def at_half_speed(case: Case) -> Case:
    """The case with the same path at half the speed. The frame rate is unchanged."""
    return _retimed(case, "half_speed", lambda angular_speed_radps: np.full(len(angular_speed_radps), 2.0))


def at_half_turn_rate(case: Case) -> Case:
    """The case with the same path, slowed down so that the angular speed is at most half of its largest value."""

    def stretch(angular_speed_radps: Array) -> Array:
        limit_radps = angular_speed_radps.max() / 2
        if limit_radps == 0:
            return np.ones(len(angular_speed_radps))
        return np.asarray(np.maximum(angular_speed_radps / limit_radps, 1.0))

    return _retimed(case, "half_turn_rate", stretch)


def at_twice_the_rate(case: Case) -> Case:
    """The case with the same motion and twice the frame rate."""
    if case.frames is not None:
        return case
    unchanged = _retimed(case, "twice_the_rate", lambda angular_speed_radps: np.ones(len(angular_speed_radps)))
    trajectory = replace(unchanged.trajectory, rate_hz=2 * case.trajectory.rate_hz)
    return replace(unchanged, trajectory=trajectory)


def _retimed(case: Case, name: str, stretch: Stretch) -> Case:
    """The case with a replay of its motion, in which time is stretched.

    `name` is the name of the change, which is added to the name of the trajectory.
    `stretch` returns the factors by which time is stretched.
    A case that is limited to some frames is returned unchanged.
    Raises MotionError if the case has no motion.
    """
    if case.frames is not None:
        return case
    motion = body_motion(case).motion
    duration_s = (motion.end_ns - motion.start_ns) / NS_PER_S
    sample_count = max(int(duration_s * SAMPLE_HZ), 2) + 1
    t_s = np.linspace(0, duration_s, sample_count)
    sample_ns = np.rint(t_s * NS_PER_S).astype(np.int64) + motion.start_ns
    samples = motion.at(sample_ns)

    angular_speed_radps = np.linalg.norm(samples.angular_velocity_radps, axis=1)
    factors = stretch(_smoothed(angular_speed_radps))
    stretched_s = cumulative_trapezoid(factors, t_s, initial=0.0)
    t_ns = np.rint(stretched_s * NS_PER_S).astype(np.int64)
    replayed = Trajectory(t_ns, samples.T_world_body)
    longest_step_s = float(np.diff(stretched_s).max())
    trajectory = Replay(
        file=f"{name}.tum",
        knot_hz=KNOT_HZ,
        rate_hz=case.trajectory.rate_hz,
        max_gap_s=max(1.0, longest_step_s * 2),
    )
    original_name = case.variant.get("trajectory", "path")
    variant = {**case.variant, "trajectory": f"{original_name}_{name}"}
    return replace(case, trajectory=trajectory, replayed=format_tum(replayed), variant=variant)


def _smoothed(values: Array) -> Array:
    """A moving average of values (N,) over SMOOTHING_S."""
    width = max(1, round(SMOOTHING_S * SAMPLE_HZ))
    if len(values) <= width:
        return values
    before = width // 2
    after = width - 1 - before
    padded = np.pad(values, (before, after), mode="edge")
    weights = np.ones(width) / width
    return np.convolve(padded, weights, mode="valid")
