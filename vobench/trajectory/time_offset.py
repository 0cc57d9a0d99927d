"""The time offset between two clocks, from how both trajectories turn and move."""

from dataclasses import dataclass

import numpy as np

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.associate import nearest
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at

MIN_OVERLAP = 0.5  # share of the shorter recording that has to overlap
MIN_SAMPLES = 20
WINDOW_STEPS = 5  # that a speed is measured over: noise of single poses goes, the shape in time stays
# each search is 8 times as fine as the one before: 1/500 of a step at last
ROUNDS = 3
TRIES = 17
STRETCHES = 8
INSTANTS = 800  # looked at in a finer search
MIN_INSTANTS = 8
SAME_CLOCK_NS = 1_000_000  # stamps that stay this close to a constant difference come from one clock
RESOLVED = 5  # digits of ns, for a found offset that no stamps make exact: 0.1 ms
FLAT = 1e-3  # a speed that varies by less than this share of its mean says nothing about time
MAX_SAMPLES = 2_000_000


@dataclass(frozen=True, slots=True)
class Offset:
    """offset_ns added to the estimate's stamps makes both move alike; correlation (-1..1) says how much alike."""

    offset_ns: int
    correlation: float


def estimate_offset(gt: Trajectory, est: Trajectory) -> Offset:
    """The offset of the estimate's clock that correlates best the speeds of turning, or else of moving.

    Neither speed depends on the frames or (moving: but for a factor) the scale, so no alignment is needed.
    Every offset that leaves half of the shorter recording in common is tried. Source: Furgale et al. (2013).
    Raises AlignmentError for recordings too short, or that never turn nor move.
    """
    step_ns = int(_step_ns(gt, est))
    _require_samples(gt, est, step_ns)
    window_ns = WINDOW_STEPS * step_ns
    found = []
    grids = [np.arange(t.t_ns[0], t.t_ns[-1] - window_ns, step_ns, dtype=np.int64) for t in (gt, est)]
    for a, b in zip(speeds(gt, grids[0], window_ns), speeds(est, grids[1], window_ns), strict=True):
        correlation = _correlations(a, b)
        best = int(np.argmax(correlation))
        offset_ns = int(gt.t_ns[0] - est.t_ns[0]) + (best - len(b) + 1) * step_ns
        found.append(Offset(offset_ns, float(correlation[best])))
    coarse = max(found, key=lambda offset: offset.correlation)
    if coarse.correlation <= 0:
        raise AlignmentError("an offset in time needs motion, but the trajectories never turn nor move alike")
    offset_ns = _onto_stamps(gt, est, _refined(gt, est, coarse.offset_ns, step_ns), step_ns)
    alike = likeness(gt, est, offset_ns)
    if alike is None:
        raise AlignmentError("an offset in time needs turns or changes of speed, but the trajectories share none")
    return Offset(offset_ns, alike)


def likeness(gt: Trajectory, est: Trajectory, offset_ns: int) -> float | None:
    """How alike (-1..1) both turn and move with the estimate's stamps moved by offset_ns; None where nothing tells."""
    step_ns = int(_step_ns(gt, est))
    found = _likeness(gt, est, np.array([offset_ns]), WINDOW_STEPS * step_ns)
    return found[0] if found else None


def offsets_in_stretches(gt: Trajectory, est: Trajectory, *, within_ns: int) -> Array:
    """The offset (N,) that each of 8 stretches of the estimate's poses shows by itself, of those up to `within_ns`.

    A stretch too short to tell shows 0.
    """
    step_ns = _step_ns(gt, est)
    parts = np.array_split(np.arange(len(est)), STRETCHES)
    stretches = [Trajectory(est.t_ns[part], est.T_world_frame[part]) for part in parts if len(part) > 1]
    return np.array([_refined(gt, part, 0, step_ns, reach_ns=max(step_ns, within_ns)) for part in stretches], float)


def _step_ns(gt: Trajectory, est: Trajectory) -> float:
    """The longer of the median times between poses."""
    for trajectory in (gt, est):
        if len(trajectory) < 2:
            raise AlignmentError(f"an offset in time needs two poses or more, got {len(trajectory)}")
    return max(float(np.median(np.diff(trajectory.t_ns))) for trajectory in (gt, est))


def _require_samples(gt: Trajectory, est: Trajectory, step_ns: int) -> None:
    spans = [int(t.t_ns[-1] - t.t_ns[0]) // step_ns for t in (gt, est)]
    if min(spans) < (fewest := MIN_SAMPLES + WINDOW_STEPS) or max(spans) > MAX_SAMPLES:
        raise AlignmentError(
            f"an offset in time needs {fewest} to {MAX_SAMPLES} steps of {step_ns / 1e9:g} s on either side, "
            f"but the recordings hold {spans[0]} and {spans[1]}"
        )


def speeds(trajectory: Trajectory, t_ns: Stamps, window_ns: int) -> tuple[Array, Array]:
    """Angle turned and distance moved, each (N,), in the window that begins at each instant."""
    T_begin = poses_at(trajectory, t_ns)
    T_end = poses_at(trajectory, t_ns + window_ns)
    turned = se3.rotation_angle(np.swapaxes(T_begin[:, :3, :3], -1, -2) @ T_end[:, :3, :3])
    return turned, np.linalg.norm(T_end[:, :3, 3] - T_begin[:, :3, 3], axis=1)


def _correlations(a: Array, b: Array) -> Array:
    """Pearson's correlation of a[k + lag] with b[k] for each lag from 1 - len(b); -1 with too little overlap."""
    ones_a = np.ones(len(a))
    ones_b = np.ones(len(b))
    n = np.round(_slide(ones_a, ones_b))
    a = _normalised(a)
    b = _normalised(b)
    sum_a = _slide(a, ones_b)
    sum_b = _slide(ones_a, b)
    covariance = n * _slide(a, b) - sum_a * sum_b
    spread = (n * _slide(a * a, ones_b) - sum_a**2) * (n * _slide(ones_a, b * b) - sum_b**2)
    enough = (n >= max(MIN_OVERLAP * min(len(a), len(b)), MIN_SAMPLES)) & (spread > 1e-9 * n**4)
    correlation: Array = np.where(enough, covariance / np.sqrt(np.where(enough, spread, 1.0)), -1.0)
    return correlation


def _normalised(signal: Array) -> Array:
    centred = signal - signal.mean()
    scale = centred.std()
    return centred / scale if scale > 1e-12 else np.zeros_like(signal)


def _slide(a: Array, b: Array) -> Array:
    """Σ_k a[k + lag] b[k] for every lag, by the fast Fourier transform."""
    n = len(a) + len(b) - 1
    size = 1 << (n - 1).bit_length()
    product: Array = np.fft.irfft(np.fft.rfft(a, size) * np.fft.rfft(b[::-1], size), size)[:n]
    return product


def _refined(gt: Trajectory, est: Trajectory, coarse_ns: int, step_ns: float, *, reach_ns: float | None = None) -> int:
    """Search around the coarse offset, finer and finer, up to a step or `reach_ns` away."""
    best_ns = coarse_ns
    reach_ns = step_ns if reach_ns is None else reach_ns
    for _ in range(ROUNDS):
        tries = best_ns + np.linspace(-reach_ns, reach_ns, TRIES).round().astype(np.int64)
        found = _likeness(gt, est, tries, round(WINDOW_STEPS * step_ns))
        if found is None:
            return coarse_ns
        best_ns = int(tries[int(np.argmax(found))])
        reach_ns = reach_ns / 8
    return best_ns


def _likeness(gt: Trajectory, est: Trajectory, offsets_ns: Stamps, window_ns: int) -> list[float] | None:
    """For each offset the mean correlation of the speeds of turning and of moving, at the same instants.

    None where hardly anything is in common, or nothing changes speed.
    """
    begin = max(int(gt.t_ns[0]) - int(offsets_ns.min()), int(est.t_ns[0]))
    end = min(int(gt.t_ns[-1]) - int(offsets_ns.max()), int(est.t_ns[-1])) - window_ns
    grid = np.arange(begin, end, max(window_ns // WINDOW_STEPS, (end - begin) // INSTANTS, 1), dtype=np.int64)
    if len(grid) < MIN_INSTANTS:
        return None
    est_speeds = speeds(est, grid, window_ns)
    found = [_alike(speeds(gt, grid + offset, window_ns), est_speeds) for offset in offsets_ns.tolist()]
    return None if None in found else [likeness for likeness in found if likeness is not None]


def _alike(gt_speeds: tuple[Array, Array], est_speeds: tuple[Array, Array]) -> float | None:
    pairs = zip(gt_speeds, est_speeds, strict=True)
    found = [_correlation(a, b) for a, b in pairs if min(a.std() - FLAT * a.mean(), b.std() - FLAT * b.mean()) > 0]
    return float(np.mean(found)) if found else None


def _correlation(a: Array, b: Array) -> float:
    a = a - a.mean()
    b = b - b.mean()
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))


def _onto_stamps(gt: Trajectory, est: Trajectory, offset_ns: int, step_ns: float) -> int:
    """The offset that lays stamps on stamps exactly, where both were plainly taken at the same instants."""
    moved = est.t_ns + offset_ns
    moved = moved[(moved >= gt.t_ns[0]) & (moved <= gt.t_ns[-1])]
    left_ns = gt.t_ns[nearest(moved, gt.t_ns)] - moved
    middle = float(np.median(left_ns)) if len(left_ns) else 0.0
    together = len(left_ns) > 0 and np.percentile(np.abs(left_ns - middle), 90) <= SAME_CLOCK_NS
    return offset_ns + round(middle) if together and abs(middle) < step_ns / 2 else round(offset_ns, -RESOLVED)
