"""Estimates the time offset between two clocks from angular speeds and speeds."""

from dataclasses import dataclass

import numpy as np

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.associate import nearest
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at

MIN_OVERLAP = 0.5  # the smallest share of the shorter recording that must overlap
MIN_SAMPLES = 20
WINDOW_STEPS = 5  # the number of steps over which a speed is measured, to average the noise of single poses
# Each search is REFINEMENT times as fine as the one before: 1/500 of a step at the end.
ROUNDS = 3
TRIES = 17
REFINEMENT = 8
STRETCHES = 8
INSTANTS = 800  # compared in a finer search
MIN_INSTANTS = 8
SAME_CLOCK_NS = 1_000_000  # stamps that stay this close to a constant difference come from one clock
RESOLVED = 5  # digits of ns that an offset is rounded to if stamps do not make it exact: 0.1 ms
FLAT = 1e-3  # a speed that varies by less than this share of its mean does not determine an offset
MAX_SAMPLES = 2_000_000
CONSTANT_STD = 1e-12
NO_VARIANCE = 1e-9  # of two standardised signals: below it either is constant within the overlap


@dataclass(frozen=True, slots=True)
class TimeOffset:
    """The time to add to the stamps of the estimate, and the correlation (-1..1) of both motions after that."""

    offset_ns: int
    correlation: float


def estimate_offset(gt: Trajectory, est: Trajectory) -> TimeOffset:
    """The offset of the estimate's clock for which angular speeds, or otherwise speeds, correlate best.

    Neither depends on the frames, and correlation does not depend on the scale, so no alignment is needed.
    All offsets are tried for which half of the shorter recording overlaps. Source: Furgale et al. (2013).
    Raises AlignmentError for recordings that are too short or without motion.
    """
    step_ns = int(_step_ns(gt, est))
    _require_samples(gt, est, step_ns)
    window_ns = WINDOW_STEPS * step_ns
    gt_speeds = speeds(gt, _grid_ns(gt, step_ns, window_ns), window_ns)
    est_speeds = speeds(est, _grid_ns(est, step_ns, window_ns), window_ns)
    start_ns = int(gt.t_ns[0] - est.t_ns[0])
    offsets = []
    for gt_speed, est_speed in zip(gt_speeds, est_speeds, strict=True):
        correlations = _correlations(gt_speed, est_speed)
        best = int(np.argmax(correlations))
        lag = best - len(est_speed) + 1
        offsets.append(TimeOffset(start_ns + lag * step_ns, float(correlations[best])))

    coarse = max(offsets, key=lambda offset: offset.correlation)
    if coarse.correlation <= 0:
        raise AlignmentError("a time offset needs motion, but the trajectories have no correlated motion")
    refined_ns = _refined(gt, est, coarse.offset_ns, step_ns)
    offset_ns = _snapped_to_stamps(gt, est, refined_ns, step_ns)
    correlation = motion_correlation(gt, est, offset_ns)
    if correlation is None:
        raise AlignmentError("a time offset needs turns or changes of speed, but the trajectories share none")
    return TimeOffset(offset_ns, correlation)


def _grid_ns(trajectory: Trajectory, step_ns: int, window_ns: int) -> Stamps:
    """Starts of the windows (N,) that fit into a trajectory, one per step."""
    first = trajectory.t_ns[0]
    last = trajectory.t_ns[-1] - window_ns
    return np.arange(first, last, step_ns, dtype=np.int64)


def motion_correlation(gt: Trajectory, est: Trajectory, offset_ns: int) -> float | None:
    """The correlation (-1..1) of both motions with the estimate's stamps shifted; None if it is undetermined."""
    step_ns = int(_step_ns(gt, est))
    correlations = _likeness(gt, est, np.array([offset_ns]), WINDOW_STEPS * step_ns)
    return correlations[0] if correlations else None


def offsets_in_stretches(gt: Trajectory, est: Trajectory, *, within_ns: int) -> Array:
    """The offset (N,) of each of 8 parts of the estimate, of offsets up to `within_ns`.

    It is 0 for a part that is too short to determine an offset.
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
    """The longer of the median times between poses."""
    for trajectory in (gt, est):
        if len(trajectory) < 2:
            raise AlignmentError(f"a time offset needs two poses or more, got {len(trajectory)}")
    return max(float(np.median(np.diff(trajectory.t_ns))) for trajectory in (gt, est))


def _require_samples(gt: Trajectory, est: Trajectory, step_ns: int) -> None:
    """Raise AlignmentError for recordings of too few or too many steps."""
    gt_steps = int(gt.t_ns[-1] - gt.t_ns[0]) // step_ns
    est_steps = int(est.t_ns[-1] - est.t_ns[0]) // step_ns
    fewest = MIN_SAMPLES + WINDOW_STEPS
    if min(gt_steps, est_steps) < fewest or max(gt_steps, est_steps) > MAX_SAMPLES:
        raise AlignmentError(
            f"a time offset needs {fewest} to {MAX_SAMPLES} steps of {step_ns / 1e9:g} s on either side, "
            f"but the recordings have {gt_steps} and {est_steps}"
        )


def speeds(trajectory: Trajectory, t_ns: Stamps, window_ns: int) -> tuple[Array, Array]:
    """The angles (N,) and distances (N,) that a body moves in the windows that begin at instants (N,)."""
    T_begin = poses_at(trajectory, t_ns)
    T_end = poses_at(trajectory, t_ns + window_ns)
    R_begin_end = se3.transposed(T_begin[:, :3, :3]) @ T_end[:, :3, :3]
    moved_m = T_end[:, :3, 3] - T_begin[:, :3, 3]
    return se3.rotation_angle(R_begin_end), np.linalg.norm(moved_m, axis=1)


def _correlations(a: Array, b: Array) -> Array:
    """Pearson's correlation of a[k + lag] with b[k] for each lag from 1 - len(b); -1 with too little overlap."""
    ones_a = np.ones(len(a))
    ones_b = np.ones(len(b))
    n = np.round(_sliding_products(ones_a, ones_b))
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
    is_determined = has_overlap & (variances > NO_VARIANCE * n**4)
    spread = np.sqrt(np.where(is_determined, variances, 1.0))
    return np.asarray(np.where(is_determined, covariance / spread, -1.0))


def _standardised(signal: Array) -> Array:
    """A signal with mean 0 and standard deviation 1, or 0 if it is constant."""
    centred = signal - signal.mean()
    std = centred.std()
    return centred / std if std > CONSTANT_STD else np.zeros_like(signal)


def _sliding_products(a: Array, b: Array) -> Array:
    """Σ_k a[k + lag] b[k] for every lag, by the fast Fourier transform."""
    n = len(a) + len(b) - 1
    size = 1 << (n - 1).bit_length()
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
    """The best offset within a step or `reach_ns` of the coarse one, from a search that is refined several times."""
    best_ns = coarse_ns
    reach_ns = step_ns if reach_ns is None else reach_ns
    window_ns = round(WINDOW_STEPS * step_ns)
    for _ in range(ROUNDS):
        shifts_ns = np.linspace(-reach_ns, reach_ns, TRIES).round()
        offsets_ns = best_ns + shifts_ns.astype(np.int64)
        correlations = _likeness(gt, est, offsets_ns, window_ns)
        if correlations is None:
            return coarse_ns
        best_ns = int(offsets_ns[np.argmax(correlations)])
        reach_ns = reach_ns / REFINEMENT
    return best_ns


def _likeness(
    gt: Trajectory,
    est: Trajectory,
    offsets_ns: Stamps,
    window_ns: int,
) -> list[float] | None:
    """The mean correlation of angular speeds and of speeds for each offset, at the same instants.

    None if the trajectories hardly overlap, or if no speed changes.
    """
    first = max(int(gt.t_ns[0]) - int(offsets_ns.min()), int(est.t_ns[0]))
    end = min(int(gt.t_ns[-1]) - int(offsets_ns.max()), int(est.t_ns[-1]))
    last = end - window_ns
    spacing = max(window_ns // WINDOW_STEPS, (last - first) // INSTANTS, 1)
    grid = np.arange(first, last, spacing, dtype=np.int64)
    if len(grid) < MIN_INSTANTS:
        return None

    est_speeds = speeds(est, grid, window_ns)
    correlations = []
    for offset_ns in offsets_ns.tolist():
        gt_speeds = speeds(gt, grid + offset_ns, window_ns)
        correlation = _mean_correlation(gt_speeds, est_speeds)
        if correlation is None:
            return None
        correlations.append(correlation)
    return correlations


def _mean_correlation(gt_speeds: tuple[Array, Array], est_speeds: tuple[Array, Array]) -> float | None:
    """The mean correlation of the speeds that vary on both sides; None if none does."""
    correlations = []
    for gt_speed, est_speed in zip(gt_speeds, est_speeds, strict=True):
        if _varies(gt_speed) and _varies(est_speed):
            correlations.append(_correlation(gt_speed, est_speed))
    return float(np.mean(correlations)) if correlations else None


def _varies(speed: Array) -> bool:
    """Whether a speed (N,) varies enough to determine a time offset."""
    return bool(speed.std() - FLAT * speed.mean() > 0)


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
    """The nearby offset that makes stamps equal, if both trajectories have poses at the same instants."""
    shifted_ns = est.t_ns + offset_ns
    is_inside = (shifted_ns >= gt.t_ns[0]) & (shifted_ns <= gt.t_ns[-1])
    shifted_ns = shifted_ns[is_inside]
    rounded_ns = round(offset_ns, -RESOLVED)
    if not len(shifted_ns):
        return rounded_ns
    left_ns = gt.t_ns[nearest(shifted_ns, gt.t_ns)] - shifted_ns
    median_ns = float(np.median(left_ns))
    spread_ns = np.percentile(np.abs(left_ns - median_ns), 90)
    is_same_clock = spread_ns <= SAME_CLOCK_NS
    is_nearby = abs(median_ns) < step_ns / 2
    return offset_ns + round(median_ns) if is_same_clock and is_nearby else rounded_ns
