"""Finds faults between an estimate and its ground truth (units, clocks, frames, scale), and their corrections."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from textwrap import shorten
from typing import Any, Literal

import numpy as np

from vobench.analysis.common_motion import motion_disagreement
from vobench.analysis.mismatch import Mismatch, find_mismatch, misfit
from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.settings import Side
from vobench.runner.trajectory_pair import TrajectoryReading
from vobench.trajectory.align import align
from vobench.trajectory.associate import MAX_DIFF_NS, associate
from vobench.trajectory.stamp_text import DECIMALS_OF_UNIT, UNIT_NAMES, format_seconds
from vobench.trajectory.time_offset import estimate_offset, motion_correlation, offsets_in_stretches
from vobench.trajectory.trajectory import PoseConvention, Trajectory

Fault = Literal[
    "stamp_unit",
    "time_offset",
    "quaternion_order",
    "axis_swap",
    "mirrored_axes",
    "inverse_poses",
    "inverse_rotations",
    "body_frame_offset",
    "scale",
    "swapped_inputs",
    "unrelated",
]
WHO: dict[Side, str] = {"gt": "ground truth", "est": "estimate"}

MIN_POSES = 8
MAX_POSES = 1000  # that frames are compared by
# Real pairs without a fault (KITTI, TUM, TartanAir) are clear of this limit, and of those of scale and clock below.
UNRELATED_MISFIT = 0.5  # share of the extent that is left after the best correction
# Of made-up drives with 10 % of error in scale and heavy noise, the short motions disagree by 0.1 at most; of drives
# that have nothing to do with each other, by 0.4 on winding roads and by 0.05 on straight ones at least.
UNRELATED_DISAGREEMENT = 0.3
DOUBTFUL_DISAGREEMENT = 0.05
DOUBTFUL_PRODUCT = 0.0036  # of the disagreement and the misfit, as a share of the extent
# The largest of many correlations at any offset is up to 0.9 for drives that have nothing to do with each other.
SURE_CORRELATION = 0.95  # of the speeds, at the offset of the clocks that was found
MAX_MISFIT_WITHOUT_IT = 0.1  # share of the extent
LONGEST_REPR = 100  # characters


@dataclass(frozen=True, slots=True)
class Evidence:
    """A number before and after the correction of a fault. `before` is None if it could not be computed."""

    name: str
    unit: str
    before: float | None
    after: float


@dataclass(frozen=True, slots=True)
class Finding:
    """A fault, a sentence about it, its evidence, and the options of `vobench score` that correct it.

    Swapped inputs have no option: exchange the files. Nothing corrects unrelated ones.
    """

    fault: Fault
    sentence: str
    evidence: tuple[Evidence, ...]
    options: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"Finding({shorten(f'{self.fault}: {self.sentence}', LONGEST_REPR, placeholder=' …')})"

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "fault": self.fault,
            "sentence": self.sentence,
            "evidence": [asdict(evidence) for evidence in self.evidence],
            "options": list(self.options),
        }


def diagnose(gt: TrajectoryReading, est: TrajectoryReading) -> tuple[Finding, ...]:
    """Find the faults between two trajectories of the same motion. Errors of the estimate are not faults.

    Each fault is searched after the previous ones are corrected. Raises AlignmentError if fewer than MIN_POSES poses
    match, and no fault of the clocks explains that.
    """
    findings: list[Finding] = []
    has_clocks = bool(gt.unit and est.unit)
    if has_clocks:
        gt, est = _in_right_units(gt, est, findings)
    unshifted = est
    if has_clocks:
        est = _on_one_clock(gt, unshifted, findings)

    T_gt, T_est = _matched_poses(gt, est)
    if len(T_gt) < MIN_POSES:
        if findings:
            return tuple(findings)
        raise AlignmentError(f"a diagnosis needs {MIN_POSES} matched poses or more, but {len(T_gt)} match")

    is_stationary = min(_extent_m(T_gt), _extent_m(T_est)) == 0
    if is_stationary:
        return tuple(findings)

    misfit_before = misfit(T_gt, T_est).trans
    mismatch = find_mismatch(T_gt, T_est, gt_order=gt.order, est_order=est.order)
    if mismatch is not None:
        findings.append(_mismatch_finding(mismatch, gt, est))
        T_gt = mismatch.correction.T_gt
        T_est = mismatch.correction.T_est
    if has_clocks and mismatch is not None and mismatch.kind == "inverse_poses":
        # The time offset was estimated from inverted poses, so it is estimated again.
        findings = [finding for finding in findings if finding.fault != "time_offset"]
        T_gt, T_est = _on_one_clock_when_inverted(mismatch, gt, unshifted, findings)

    unrelated = _find_unrelated(T_gt, T_est, misfit_before, has_unsure_offset=_has_unsure_offset(findings))
    if unrelated is not None:
        units = (finding for finding in findings if finding.fault == "stamp_unit")
        return (*units, unrelated)
    findings += _wrong_scale(T_gt, T_est)
    findings += _swapped_inputs(gt, est)
    return tuple(findings)


def _find_unrelated(T_gt: Array, T_est: Array, misfit_before: float, *, has_unsure_offset: bool) -> Finding | None:
    """The finding that corrected poses (K, 4, 4) have nothing in common; None if they have."""
    misfit_after = misfit(T_gt, T_est).trans
    disagreement = motion_disagreement(T_gt, T_est)
    is_chance = has_unsure_offset and misfit_after > MAX_MISFIT_WITHOUT_IT
    if is_chance or _is_unrelated(misfit_after, disagreement):
        return _unrelated(misfit_before, misfit_after, disagreement)
    return None


def _is_unrelated(misfit_after: float, disagreement: float | None) -> bool:
    """Whether two trajectories have nothing in common: their positions never agree, or their short motions do not."""
    if misfit_after >= UNRELATED_MISFIT:
        return True
    if disagreement is None:
        return False
    is_doubtful = disagreement >= DOUBTFUL_DISAGREEMENT and disagreement * misfit_after >= DOUBTFUL_PRODUCT
    return disagreement >= UNRELATED_DISAGREEMENT or is_doubtful


def _has_unsure_offset(findings: list[Finding]) -> bool:
    """Whether an offset between the clocks was found that trajectories of different motions could show by chance."""
    offsets = [finding for finding in findings if finding.fault == "time_offset"]
    return any(offset.evidence[0].after < SURE_CORRELATION for offset in offsets)


def _unrelated(before: float, after: float, disagreement: float | None) -> Finding:
    evidence = [Evidence("position left, of the path's extent (rms)", "%", 100 * before, 100 * after)]
    if disagreement is not None:
        name = "disagreement of short motions, relative to motions at other times"
        evidence.append(Evidence(name, "1", None, disagreement))
    return Finding(
        "unrelated",
        "these trajectories are not of one motion, or the estimate lost it: no correction makes them agree",
        tuple(evidence),
    )


# --- Units of time stamps ---

MAX_DURATION_RATIO = 30.0  # between recordings in one unit; units differ by a factor of 1000


def _in_right_units(
    gt: TrajectoryReading, est: TrajectoryReading, findings: list[Finding]
) -> tuple[TrajectoryReading, TrajectoryReading]:
    """Both trajectories in units in which their durations are similar."""
    gt_in_unit = _in_right_unit(gt, est)
    est_in_unit = _in_right_unit(est, gt)
    if gt_in_unit.unit != gt.format_unit:
        findings.append(_unit_finding("gt", gt, gt_in_unit, est))
    if est_in_unit.unit != est.format_unit:
        findings.append(_unit_finding("est", est, est_in_unit, gt))
    return gt_in_unit, est_in_unit


def _in_right_unit(reading: TrajectoryReading, other: TrajectoryReading) -> TrajectoryReading:
    """The trajectory in the finer unit that makes the durations similar, if its steps and duration are far too long.

    Lost tracking shortens the duration, and keyframes lengthen the steps, but neither of them does both.
    """
    if reading.unit is None or reading.is_unit_given:
        return reading
    duration_ns = _duration_ns(reading)
    other_duration_ns = max(_duration_ns(other), 1)
    duration_ratio = duration_ns / other_duration_ns
    step_ratio = _step_ns(reading) / _step_ns(other)
    if min(duration_ratio, step_ratio) < MAX_DURATION_RATIO:
        return reading

    digits = DECIMALS_OF_UNIT[reading.unit]
    finer_units = {unit: other for unit, other in DECIMALS_OF_UNIT.items() if other < digits}
    factors = {unit: 10 ** (digits - other) for unit, other in finer_units.items()}
    ratios = {unit: duration_ns / factor / other_duration_ns for unit, factor in factors.items()}
    best_unit = min(ratios, key=lambda unit: abs(np.log(ratios[unit])), default=None)
    if best_unit is None or not 1 / MAX_DURATION_RATIO < ratios[best_unit] < MAX_DURATION_RATIO:
        return reading

    t_ns = reading.trajectory.t_ns // factors[best_unit]
    has_equal_stamps = np.any(np.diff(t_ns) <= 0)
    if has_equal_stamps:
        return reading
    return replace(reading, trajectory=Trajectory(t_ns, reading.trajectory.T_world_frame), unit=best_unit)


def _unit_finding(
    side: Side, as_read: TrajectoryReading, corrected: TrajectoryReading, other: TrajectoryReading
) -> Finding:
    """The finding that time stamps are not in the default unit of their format."""
    assert as_read.format_unit is not None
    assert as_read.unit is not None
    assert corrected.unit is not None
    digits = DECIMALS_OF_UNIT[as_read.format_unit] - DECIMALS_OF_UNIT[as_read.unit]
    other_duration_ns = max(_duration_ns(other), 1)
    before = _duration_ns(as_read) * 10.0**digits / other_duration_ns
    after = float(_duration_ns(corrected)) / other_duration_ns

    other_side: Side = "est" if side == "gt" else "gt"
    return Finding(
        "stamp_unit",
        f"the {WHO[side]}'s time stamps are {UNIT_NAMES[corrected.unit]}, not {UNIT_NAMES[as_read.format_unit]}",
        (Evidence(f"duration over that of the {WHO[other_side]}", "1", before, after),),
        (f"--{side}-as", corrected.unit),
    )


# --- Clocks ---

MIN_OFFSET_NS = 10_000_000
MIN_CORRELATION = 0.5  # of the speeds on one clock
# An offset counts where it leaves at most this share of the missing correlation, and adds this much to it.
MAX_CORRELATION_LEFT = 0.75
MIN_CORRELATION_GAIN = 5e-4
# A smaller gain also counts if most parts of the recording show the same offset.
MIN_STEADY_OFFSET_NS = 25_000_000  # fr1/xyz of TUM has 10 ms, the same in all of its stretches
MIN_STEADY_SHARE = 0.875
STEADY_TOLERANCE = 0.5  # of the offset
STRETCH_SEARCH = 1.5  # of the offset


def _on_one_clock(gt: TrajectoryReading, est: TrajectoryReading, findings: list[Finding]) -> TrajectoryReading:
    """The estimate on the clock of the ground truth."""
    try:
        lag = estimate_offset(gt.trajectory, est.trajectory)
    except AlignmentError:  # too little motion to compare clocks
        return est
    before = motion_correlation(gt.trajectory, est.trajectory, 0)
    after = lag.correlation
    if abs(lag.offset_ns) <= MIN_OFFSET_NS or after < MIN_CORRELATION:
        return est
    if not (_is_clear_gain(before, after) or _is_steady(gt.trajectory, est.trajectory, lag.offset_ns)):
        return est

    offset = format_seconds(lag.offset_ns).rstrip("0").rstrip(".")
    direction = "behind" if lag.offset_ns > 0 else "ahead"
    sentence = f"the estimate's clock is {abs(lag.offset_ns) / 1e9:.3f} s {direction}"
    evidence = Evidence("correlation of the speeds", "1", before, after)
    findings.append(Finding("time_offset", sentence, (evidence,), (f"--t-offset={offset}",)))
    t_ns = est.trajectory.t_ns + lag.offset_ns
    return replace(est, trajectory=Trajectory(t_ns, est.trajectory.T_world_frame))


def _is_clear_gain(before: float | None, after: float) -> bool:
    """Whether an offset clearly increases the correlation of the speeds. `before` is None without an overlap."""
    if before is None:
        return True
    gain = after - before
    missing_before = 1 - before
    return 1 - after <= MAX_CORRELATION_LEFT * missing_before and gain >= MIN_CORRELATION_GAIN


def _is_steady(gt: Trajectory, est: Trajectory, offset_ns: int) -> bool:
    """Whether nearly all parts of the recording show the same offset."""
    if abs(offset_ns) <= MIN_STEADY_OFFSET_NS:
        return False
    of_stretches_ns = offsets_in_stretches(gt, est, within_ns=round(STRETCH_SEARCH * abs(offset_ns)))
    is_similar = np.abs(of_stretches_ns - offset_ns) <= STEADY_TOLERANCE * abs(offset_ns)
    return len(of_stretches_ns) > 0 and bool(np.mean(is_similar) >= MIN_STEADY_SHARE)


# --- Frames ---


def _matched_poses(gt: TrajectoryReading, est: TrajectoryReading) -> tuple[Array, Array]:
    """At most MAX_POSES evenly spaced matched poses (K, 4, 4), which differ by at most half a step of the truth."""
    steps_ns = np.diff(gt.trajectory.t_ns)
    half_step_ns = int(np.median(steps_ns)) // 2 if len(steps_ns) else 0
    pairs = associate(gt.trajectory.t_ns, est.trajectory.t_ns, max_diff_ns=max(MAX_DIFF_NS, half_step_ns))
    count = min(len(pairs), MAX_POSES)
    chosen = np.linspace(0, len(pairs) - 1, count).round().astype(int)
    T_gt = gt.trajectory.T_world_frame[pairs.gt[chosen]]
    T_est = est.trajectory.T_world_frame[pairs.est[chosen]]
    return T_gt, T_est


def _mismatch_finding(mismatch: Mismatch, gt: TrajectoryReading, est: TrajectoryReading) -> Finding:
    """The finding of a fault of frames."""
    before = mismatch.before
    after = mismatch.correction.misfit
    angles_deg = np.rad2deg([before.rot_rad, after.rot_rad]).tolist()
    evidence = [
        Evidence("rotation left after alignment (rms)", "deg", *angles_deg),
        Evidence("position left, of the path's extent (rms)", "%", 100 * before.trans, 100 * after.trans),
    ]
    lever = mismatch.lever
    if lever:
        evidence.append(Evidence("translation of short motions left (rms)", "m", lever.before_m, lever.after_m))
    sentence, options = _frame_sentence(mismatch, gt, est)
    return Finding(mismatch.kind, sentence, tuple(evidence), options)


def _on_one_clock_when_inverted(
    mismatch: Mismatch, gt: TrajectoryReading, est: TrajectoryReading, findings: list[Finding]
) -> tuple[Array, Array]:
    """The matched poses (K, 4, 4) with inverse poses corrected, after another search for an offset of the clocks.

    The speeds of inverse poses are not those of the body, so the first search could not find an offset.
    """
    move = mismatch.correction.move
    assert move is not None
    if mismatch.correction.side == "gt":
        gt = _moved(gt, move)
    else:
        est = _moved(est, move)
    est = _on_one_clock(gt, est, findings)
    return _matched_poses(gt, est)


def _moved(reading: TrajectoryReading, move: PoseConvention) -> TrajectoryReading:
    trajectory = reading.trajectory
    return replace(reading, trajectory=Trajectory(trajectory.t_ns, move.apply(trajectory.T_world_frame)))


def _frame_sentence(
    mismatch: Mismatch,
    gt: TrajectoryReading,
    est: TrajectoryReading,
) -> tuple[str, tuple[str, ...]]:
    """A sentence about a fault of frames, and the options that correct it."""
    side = mismatch.correction.side
    move = mismatch.correction.move
    if move is None:
        read_as = (gt if side == "gt" else est).order
        order = "wxyz" if read_as == "xyzw" else "xyzw"
        return f"the {WHO[side]}'s quaternions are {order}", (f"--{side}-as", order)

    options = (f"--{side}-as", str(move))
    if mismatch.kind == "inverse_poses":
        return f"the {WHO[side]}'s poses are inverse: they map world to frame (T_cw)", options
    if mismatch.kind == "inverse_rotations":
        return f"the {WHO[side]}'s rotations are inverse (JPL's, not Hamilton's), but its positions are not", options
    if move.kind == "mount":
        return _mount_sentence(move), options
    return _axes_sentence(mismatch.kind, move), options


def _mount_sentence(move: PoseConvention) -> str:
    angle_rad = se3.rotation_angle(move.matrix[:3, :3])
    angle_deg = float(np.rad2deg(angle_rad))
    length_m = float(np.linalg.norm(move.matrix[:3, 3]))
    return (
        f"the estimate is of another frame of the same body, rotated by {angle_deg:.1f} deg and {length_m:.2g} m away, "
        f"for example the camera's instead of the body's"
    )


def _axes_sentence(kind: Fault, move: PoseConvention) -> str:
    values = "positions and rotations" if move.kind == "axes" else "positions, but not its rotations,"
    axes = str(move).partition(":")[2]
    if kind == "mirrored_axes":
        verb = "mirrored"
    elif np.count_nonzero(np.diag(move.matrix)) == 3:
        verb = "turned by half a turn"
    else:
        verb = "swapped"
    return f"the axes of the estimate's {values} are {verb}: the truth's x,y,z are its {axes}"


# --- Scale ---

MIN_LOG_SCALE = 0.02
MAX_ERROR_LEFT = 0.5  # share of the ATE that is left once the scale is corrected


def _wrong_scale(T_gt: Array, T_est: Array) -> Iterator[Finding]:
    """Yield a finding if the estimate has another scale than the ground truth."""
    rigid = align(T_est, T_gt, kind="se3")
    similar = align(T_est, T_gt, kind="sim3")
    if not similar.scale > 0:
        return
    before_m = _ate_m(rigid.apply(T_est), T_gt)
    after_m = _ate_m(similar.apply(T_est), T_gt)
    is_scaled = abs(np.log(similar.scale)) > MIN_LOG_SCALE
    if is_scaled and after_m <= MAX_ERROR_LEFT * before_m:
        yield Finding(
            "scale",
            f"the estimate is {1 / similar.scale:.4g} times as large as the truth",
            (Evidence("ATE (rmse)", "m", before_m, after_m),),
            ("-a", "sim3"),
        )


# --- Swapped inputs ---

MIN_POSES_SWAP = 8
MIN_SIGNS = 2  # that agree; each alone has an innocent explanation
IDENTITY_TOLERANCE = 1e-6  # m, and of a rotation's elements: odometry begins at the identity, ground truth seldom
RATE_RATIO = 2.0  # a tracker has more poses per second than a camera has frames
MIN_NOISE = 5e-3  # of a step; smaller values are motion rather than noise
NOISE_RATIO = 1.5
CLEAR_NOISE_RATIO = 2.0


def _swapped_inputs(gt: TrajectoryReading, est: TrajectoryReading) -> Iterator[Finding]:
    """Yield a finding if enough signs show that ground truth and estimate are exchanged."""
    pairs = associate(gt.trajectory.t_ns, est.trajectory.t_ns)
    gt_noise = _noise(gt.trajectory.positions_m[pairs.gt])
    est_noise = _noise(est.trajectory.positions_m[pairs.est])
    if len(pairs) < MIN_POSES_SWAP or not min(gt_noise, est_noise) > 0:
        return

    noise_ratio = gt_noise / est_noise
    rate_ratio = _step_ns(est) / _step_ns(gt)
    begins_at_identity = (_begins_at_identity(gt.trajectory), _begins_at_identity(est.trajectory))
    are_named_truth = (gt.mentions_ground_truth, est.mentions_ground_truth)

    # Ground truth at exactly the times of the estimate was interpolated, which makes it smooth.
    is_noisy = gt_noise > MIN_NOISE
    has_same_times = len(gt.trajectory) == len(est.trajectory) == len(pairs)
    signs = [
        int(is_noisy and noise_ratio > NOISE_RATIO),
        int(is_noisy and noise_ratio > CLEAR_NOISE_RATIO and has_same_times),
        int(rate_ratio < 1 / RATE_RATIO) - int(rate_ratio > RATE_RATIO),
        int(begins_at_identity == (True, False)) - int(begins_at_identity == (False, True)),
        int(are_named_truth == (False, True)) - int(are_named_truth == (True, False)),
    ]
    if sum(signs) < MIN_SIGNS:
        return

    evidence = (
        Evidence("noise of the truth over that of the estimate", "1", noise_ratio, 1 / noise_ratio),
        Evidence("poses a second of the truth over those of the estimate", "1", rate_ratio, 1 / rate_ratio),
    )
    clauses = ["ground truth and estimate seem to be exchanged"]
    if begins_at_identity == (True, False):
        clauses.append("the truth begins at the identity and the estimate does not")
    if are_named_truth == (False, True):
        clauses.append("the estimate's file calls itself ground truth")
    yield Finding("swapped_inputs", "; ".join(clauses), evidence)


def _noise(positions_m: Array) -> float:
    """Median third difference relative to the median step: nearly 0 for steady motion, up to 20 for noise."""
    if len(positions_m) < MIN_POSES_SWAP:
        return 0.0
    steps_m = np.diff(positions_m, axis=0)
    third_differences_m = np.diff(positions_m, 3, axis=0)
    median_step_m = np.median(np.linalg.norm(steps_m, axis=1))
    median_third_m = np.median(np.linalg.norm(third_differences_m, axis=1))
    return float(median_third_m / max(median_step_m, 1e-300))


def _begins_at_identity(trajectory: Trajectory) -> bool:
    difference = np.abs(trajectory.T_world_frame[0] - np.eye(4))
    return bool(difference.max() <= IDENTITY_TOLERANCE)


# --- Sizes of trajectories ---


def _ate_m(T_est: Array, T_gt: Array) -> float:
    """The absolute trajectory error (rms) of aligned poses (K, 4, 4)."""
    errors_m = (T_est - T_gt)[:, :3, 3]
    return float(np.sqrt(np.sum(errors_m**2, axis=1).mean()))


def _extent_m(T: Array) -> float:
    """The rms distance of positions from their mean."""
    return float(np.sqrt(T[:, :3, 3].var(axis=0).sum()))


def _step_ns(reading: TrajectoryReading) -> float:
    steps_ns = np.diff(reading.trajectory.t_ns)
    return float(np.median(steps_ns)) if len(steps_ns) else 1.0


def _duration_ns(reading: TrajectoryReading) -> int:
    t_ns = reading.trajectory.t_ns
    return int(t_ns[-1] - t_ns[0]) if len(t_ns) else 0
