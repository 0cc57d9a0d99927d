"""Estimates the time offset between the clocks of two trajectories, by correlating angular speeds and speeds.

The angular speed and the speed of a body do not depend on the frame of a trajectory, and a correlation does not depend
on the scale, so that the trajectories need not be aligned.
"""

from dataclasses import dataclass

import numpy as np

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.associate import nearest
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at

# The search over all offsets
MIN_OVERLAP = 0.5  # the smallest overlap, as a share of the shorter recording
MIN_SAMPLES = 20  # the smallest number of samples of the speed in the overlap
MAX_SAMPLES = 2_000_000  # the largest number of samples of a recording
WINDOW_STEPS = 5  # a speed is measured over this many steps, to average the noise of single poses

# The refinement around an offset. Each round divides the search range by REFINEMENT. The last round has a resolution of
# about 1/500 of a step.
ROUNDS = 3
TRIES = 17  # the number of offsets that each round tries
REFINEMENT = 8
MAX_INSTANTS = 800  # the approximate largest number of instants at which speeds are compared
MIN_INSTANTS = 8  # the smallest number of these instants

STRETCHES = 8  # the number of parts of a trajectory whose offsets are estimated separately
SAME_CLOCK_NS = 1_000_000  # both trajectories have one clock if their stamps differ by a constant up to this error
ROUNDED_DIGITS = 5  # with different clocks, offsets are rounded to 10^5 ns = 0.1 ms

MIN_VARIATION = 1e-3  # a speed determines no offset if its standard deviation is a smaller share of its mean
CONSTANT_STD = 1e-12  # a signal with a smaller standard deviation is constant
MIN_VARIANCE_PRODUCT = 1e-9  # if the variances of two standardised signals have a smaller product, one is constant


@dataclass(frozen=True, slots=True)
class TimeOffset:
    """The time offset of an estimate.

    `offset_ns` is the time to add to the stamps of the estimate.
    `correlation` is the correlation of both motions after this correction, from -1 to 1.
    """

    offset_ns: int
    correlation: float


def estimate_offset(gt: Trajectory, est: Trajectory) -> TimeOffset:
    """The time offset for which the motions correlate best.

    All offsets are tried for which at least half of the shorter recording overlaps. Angular speeds and speeds are
    correlated separately, and the better of the two results is refined.

    Raises AlignmentError if a recording is too short, or if the trajectories have no correlated motion.

    Source: Furgale et al. (2013).
    """
    step_ns = int(_step_ns(gt, est))
    _require_samples(gt, est, step_ns)
    window_ns = WINDOW_STEPS * step_ns
    gt_grid_ns = _grid_ns(gt, step_ns, window_ns)
    est_grid_ns = _grid_ns(est, step_ns, window_ns)
    gt_speeds = speeds(gt, gt_grid_ns, window_ns)
    est_speeds = speeds(est, est_grid_ns, window_ns)
    start_ns = int(gt.t_ns[0] - est.t_ns[0])  # the offset for which both trajectories start together
    candidates = []
    for gt_speed, est_speed in zip(gt_speeds, est_speeds, strict=True):
        correlations = _correlations(gt_speed, est_speed)
        best = int(np.argmax(correlations))
        lag = best - len(est_speed) + 1
        offset_ns = start_ns + lag * step_ns
        candidates.append(TimeOffset(offset_ns, float(correlations[best])))

    coarse = max(candidates, key=lambda candidate: candidate.correlation)
    if coarse.correlation <= 0:
        raise AlignmentError("a time offset needs motion, but the trajectories have no correlated motion")
    refined_ns = _refined(gt, est, coarse.offset_ns, step_ns)
    offset_ns = _snapped_to_stamps(gt, est, refined_ns, step_ns)
    correlation = motion_correlation(gt, est, offset_ns)
    if correlation is None:
        raise AlignmentError("a time offset needs turns or changes of speed, but the trajectories share none")
    return TimeOffset(offset_ns, correlation)


def _grid_ns(trajectory: Trajectory, step_ns: int, window_ns: int) -> Stamps:
    """The starts (N,) in ns of all windows that fit into a trajectory, one step apart."""
    first = trajectory.t_ns[0]
    last = trajectory.t_ns[-1] - window_ns
    return np.arange(first, last, step_ns, dtype=np.int64)


def motion_correlation(gt: Trajectory, est: Trajectory, offset_ns: int) -> float | None:
    """The correlation of both motions, from -1 to 1.

    `offset_ns` is added to the stamps of the estimate first.

    Returns None if the trajectories hardly overlap, or if no speed changes.
    """
    step_ns = int(_step_ns(gt, est))
    correlations = _mean_correlations(gt, est, np.array([offset_ns]), WINDOW_STEPS * step_ns)
    return correlations[0] if correlations else None


def offsets_in_stretches(gt: Trajectory, est: Trajectory, *, within_ns: int) -> Array:
    """The time offsets (N,) in ns of the parts of the estimate.

    The estimate is divided into STRETCHES parts with the same number of poses. A part with fewer than two poses is
    omitted. If a part does not determine an offset, its offset is 0.

    `within_ns` is the largest offset that is tried. Offsets of up to one step are always tried.
    """
    step_ns = _step_ns(gt, est)
    reach_ns = max(step_ns, within_ns)
    offsets_ns = []
    for rows in np.array_split(np.arange(len(est)), STRETCHES):
        if len(rows) > 1:
            stretch = Trajectory(est.t_ns[rows], est.T_world_frame[rows])
            offsets_ns.append(_refined(gt, stretch, 0, step_ns, reach_ns=reach_ns))
    return np.array(offsets_ns, float)


def _step_ns(gt: Trajectory, est: Trajectory) -> float:
    """The median time in ns between successive poses. Of the two trajectories, the longer median counts."""
    for trajectory in (gt, est):
        if len(trajectory) < 2:
            raise AlignmentError(f"a time offset needs two poses or more, got {len(trajectory)}")
    gt_step_ns = float(np.median(np.diff(gt.t_ns)))
    est_step_ns = float(np.median(np.diff(est.t_ns)))
    return max(gt_step_ns, est_step_ns)


def _require_samples(gt: Trajectory, est: Trajectory, step_ns: int) -> None:
    """Raise AlignmentError if a recording has too few or too many steps."""
    gt_steps = int(gt.t_ns[-1] - gt.t_ns[0]) // step_ns
    est_steps = int(est.t_ns[-1] - est.t_ns[0]) // step_ns
    fewest = MIN_SAMPLES + WINDOW_STEPS
    if min(gt_steps, est_steps) < fewest or max(gt_steps, est_steps) > MAX_SAMPLES:
        raise AlignmentError(
            f"a time offset needs {fewest} to {MAX_SAMPLES} steps of {step_ns / 1e9:g} s on either side, "
            f"but the recordings have {gt_steps} and {est_steps}"
        )


def speeds(trajectory: Trajectory, t_ns: Stamps, window_ns: int) -> tuple[Array, Array]:
    """The angles (N,) in rad and the distances (N,) in m by which a body moves in windows of time.

    `t_ns` (N,) are the starts of the windows.
    `window_ns` is the duration of a window.
    """
    T_world_begin = poses_at(trajectory, t_ns)
    T_world_end = poses_at(trajectory, t_ns + window_ns)
    R_begin_end = se3.transposed(T_world_begin[:, :3, :3]) @ T_world_end[:, :3, :3]
    angles_rad = se3.rotation_angle(R_begin_end)
    displacements_m = T_world_end[:, :3, 3] - T_world_begin[:, :3, 3]
    distances_m = np.linalg.norm(displacements_m, axis=1)
    return angles_rad, distances_m


def _correlations(a: Array, b: Array) -> Array:
    """Pearson's correlation of a[k + lag] with b[k], for all lags from 1 - len(b) to len(a) - 1.

    It is -1 if the overlap is too short or if a signal is constant in it.
    """
    ones_a = np.ones(len(a))
    ones_b = np.ones(len(b))
    n = np.round(_sliding_products(ones_a, ones_b))  # the number of samples in the overlap, for each lag
    a = _standardised(a)
    b = _standardised(b)
    sum_a = _sliding_products(a, ones_b)
    sum_b = _sliding_products(ones_a, b)
    sum_aa = _sliding_products(a * a, ones_b)
    sum_bb = _sliding_products(ones_a, b * b)

    covariance = n * _sliding_products(a, b) - sum_a * sum_b
    variance_a = n * sum_aa - sum_a**2
    variance_b = n * sum_bb - sum_b**2
    variances = variance_a * variance_b
    shortest = min(len(a), len(b))
    has_overlap = n >= max(MIN_OVERLAP * shortest, MIN_SAMPLES)
    has_variance = variances > MIN_VARIANCE_PRODUCT * n**4
    is_determined = has_overlap & has_variance
    std_product = np.sqrt(np.where(is_determined, variances, 1.0))
    correlation = covariance / std_product
    return np.asarray(np.where(is_determined, correlation, -1.0))


def _standardised(signal: Array) -> Array:
    """A signal, shifted and scaled to mean 0 and standard deviation 1. A constant signal becomes 0."""
    centred = signal - signal.mean()
    std = centred.std()
    return centred / std if std > CONSTANT_STD else np.zeros_like(signal)


def _sliding_products(a: Array, b: Array) -> Array:
    """The sum over k of a[k + lag] b[k] for all lags from 1 - len(b), by the fast Fourier transform."""
    n = len(a) + len(b) - 1
    size = 1 << (n - 1).bit_length()  # the next power of two
    spectrum = np.fft.rfft(a, size) * np.fft.rfft(b[::-1], size)
    products: Array = np.fft.irfft(spectrum, size)[:n]
    return products


def _refined(
    gt: Trajectory,
    est: Trajectory,
    coarse_ns: int,
    step_ns: float,
    *,
    reach_ns: float | None = None,
) -> int:
    """The offset near a coarse one for which the motions correlate best.

    `reach_ns` is the largest difference from the coarse offset that is tried. The default is one step.

    Returns the coarse offset if the motions do not determine a better one.
    """
    best_ns = coarse_ns
    reach_ns = step_ns if reach_ns is None else reach_ns
    window_ns = round(WINDOW_STEPS * step_ns)
    for _ in range(ROUNDS):
        shifts_ns = np.linspace(-reach_ns, reach_ns, TRIES).round()
        offsets_ns = best_ns + shifts_ns.astype(np.int64)
        correlations = _mean_correlations(gt, est, offsets_ns, window_ns)
        if correlations is None:
            return coarse_ns
        best_ns = int(offsets_ns[np.argmax(correlations)])
        reach_ns = reach_ns / REFINEMENT
    return best_ns


def _mean_correlations(
    gt: Trajectory,
    est: Trajectory,
    offsets_ns: Stamps,
    window_ns: int,
) -> list[float] | None:
    """The mean of the correlations of angular speeds and of speeds, for each of the offsets (N,).

    All offsets are compared at the same instants of the estimate.

    Returns None if the trajectories hardly overlap, or if no speed changes.
    """
    first = max(int(gt.t_ns[0]) - int(offsets_ns.min()), int(est.t_ns[0]))
    end = min(int(gt.t_ns[-1]) - int(offsets_ns.max()), int(est.t_ns[-1]))
    last = end - window_ns
    step_ns = window_ns // WINDOW_STEPS
    spacing_ns = max(step_ns, (last - first) // MAX_INSTANTS, 1)
    grid_ns = np.arange(first, last, spacing_ns, dtype=np.int64)
    if len(grid_ns) < MIN_INSTANTS:
        return None

    est_speeds = speeds(est, grid_ns, window_ns)
    correlations = []
    for offset_ns in offsets_ns.tolist():
        gt_speeds = speeds(gt, grid_ns + offset_ns, window_ns)
        correlation = _mean_correlation(gt_speeds, est_speeds)
        if correlation is None:
            return None
        correlations.append(correlation)
    return correlations


def _mean_correlation(gt_speeds: tuple[Array, Array], est_speeds: tuple[Array, Array]) -> float | None:
    """The mean correlation over the kinds of speed that vary in both trajectories; None if no kind does."""
    correlations = []
    for gt_speed, est_speed in zip(gt_speeds, est_speeds, strict=True):
        if _varies(gt_speed) and _varies(est_speed):
            correlations.append(_correlation(gt_speed, est_speed))
    return float(np.mean(correlations)) if correlations else None


def _varies(speed: Array) -> bool:
    """Whether a speed (N,) varies enough to determine a time offset."""
    smallest_std = MIN_VARIATION * speed.mean()
    return bool(speed.std() - smallest_std > 0)


def _correlation(a: Array, b: Array) -> float:
    """Pearson's correlation of two signals (N,)."""
    a = a - a.mean()
    b = b - b.mean()
    power = (a @ a) * (b @ b)
    return float(a @ b / np.sqrt(power))


def _snapped_to_stamps(
    gt: Trajectory,
    est: Trajectory,
    offset_ns: int,
    step_ns: float,
) -> int:
    """The offset, corrected so that stamps become equal if both trajectories have poses at the same instants.

    Otherwise, the stamps come from different clocks, and the offset is rounded to ROUNDED_DIGITS.
    """
    shifted_ns = est.t_ns + offset_ns
    is_inside = (shifted_ns >= gt.t_ns[0]) & (shifted_ns <= gt.t_ns[-1])
    shifted_ns = shifted_ns[is_inside]
    rounded_ns = round(offset_ns, -ROUNDED_DIGITS)
    if not len(shifted_ns):
        return rounded_ns

    nearest_ns = gt.t_ns[nearest(shifted_ns, gt.t_ns)]
    residuals_ns = nearest_ns - shifted_ns
    median_ns = float(np.median(residuals_ns))
    spread_ns = np.percentile(np.abs(residuals_ns - median_ns), 90)
    is_same_clock = spread_ns <= SAME_CLOCK_NS
    is_nearby = abs(median_ns) < step_ns / 2
    if not (is_same_clock and is_nearby):
        return rounded_ns
    return offset_ns + round(median_ns)
