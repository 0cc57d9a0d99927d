"""Faults between an estimate and its ground truth: units, clocks, frames, scale; each with evidence and its mend."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from textwrap import shorten
from typing import Any, Literal

import numpy as np

from vobench.analysis.mismatch import Mismatch, find_mismatch, misfit
from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.settings import Side
from vobench.trajectory.align import align
from vobench.trajectory.associate import MAX_DIFF_NS, associate
from vobench.trajectory.formats import DIGITS, WORDS, Reading, seconds
from vobench.trajectory.time_offset import estimate_offset, likeness, offsets_in_stretches
from vobench.trajectory.trajectory import Move, Trajectory

AT_ORIGIN = 1e-6  # m, and the same of a rotation's elements: odometry begins at the identity, a truth seldom
DENSER = 2.0  # truth from a tracker has more poses a second than frames have
NOISIER = 1.5
PLAINLY_NOISIER = 2.0
NOISE = 5e-3  # of a step; below it motion itself is what is seen
ENOUGH = 2  # signs that have to agree; each alone has an innocent explanation
MIN_POSES_SWAP = 8

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
MAX_POSES = 1000
# Real pairs without a fault (KITTI, TUM, TartanAir) keep clear of these.
SCALE_OFF = 0.02
SCALE_MENDED = 0.5
LAG_NS = 10_000_000
LAG_MENDED = 0.75
LAG_BY = 5e-4
LAG_ALIKE = 0.5
LONGEST_REPR = 100  # characters of a finding in one line
# fr1/xyz has 10 ms, the same in all of its stretches
STEADY_LAG_NS = 25_000_000
STEADY_SHARE = 0.875
UNRELATED = 0.5  # of the extent, left by the best mend
SAME_SPAN = 30.0  # times; units are 1000 apart


@dataclass(frozen=True, slots=True)
class Evidence:
    """One figure as it is, and as it is once the fault is mended; `before` is None where there was none."""

    name: str
    unit: str
    before: float | None
    after: float


@dataclass(frozen=True, slots=True)
class Finding:
    """A fault, a sentence about it, its evidence, and the options of `vobench score` that mend it.

    Swapped inputs are mended by swapping them, for which there is no option; nothing mends unrelated ones.
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


def diagnose(gt: Reading, est: Reading) -> tuple[Finding, ...]:
    """The faults between two trajectories of one motion; none where they only differ by errors.

    Each is looked for with those before it mended. Raises AlignmentError where fewer than 8 poses match
    and no fault of the clocks says why.
    """
    findings: list[Finding] = []
    if gt.unit and est.unit:
        gt, est = _in_right_units(gt, est, findings)
        est = _on_one_clock(gt, est, findings)
    T_gt, T_est = _matched(gt, est)
    if len(T_gt) < MIN_POSES:
        if findings:
            return tuple(findings)
        raise AlignmentError(f"a diagnosis needs {MIN_POSES} matched poses or more, but {len(T_gt)} match")
    if min(_extent_m(T_gt), _extent_m(T_est)) > 0:
        given = misfit(T_gt, T_est).trans
        T_gt, T_est = _in_right_frames(T_gt, T_est, gt, est, findings)
        left = misfit(T_gt, T_est).trans
        if left >= UNRELATED:
            return (*(finding for finding in findings if finding.fault == "stamp_unit"), _unrelated(given, left))
        findings += _wrong_scale(T_gt, T_est)
        findings += _swapped(gt, est)
    return tuple(findings)


def _unrelated(given: float, left: float) -> Finding:
    return Finding(
        "unrelated",
        "these trajectories are not of one motion, or the estimate lost it: no mend brings them together",
        (Evidence("position left, of the path's extent (rms)", "%", 100 * given, 100 * left),),
    )


def _in_right_units(gt: Reading, est: Reading, findings: list[Finding]) -> tuple[Reading, Reading]:
    """Both in units in which they last about equally long; first those in which they could be read at all."""
    right = _right_unit(gt, est), _right_unit(est, gt)
    if right[0].unit != gt.form_unit:
        findings.append(_unit_finding("gt", gt, right[0], est))
    if right[1].unit != est.form_unit:
        findings.append(_unit_finding("est", est, right[1], gt))
    return right


def _right_unit(read: Reading, other: Reading) -> Reading:
    """Read in the finer unit that makes durations fit, where steps and durations are both far too long.

    Lost track shortens the one and keyframes lengthen the other, but neither does both.
    """
    duration = _duration_ns(read)
    wanted = max(_duration_ns(other), 1)
    if read.unit is None or read.is_unit_told or min(duration / wanted, _step_ns(read) / _step_ns(other)) < SAME_SPAN:
        return read
    finer = [unit for unit in DIGITS if DIGITS[unit] < DIGITS[read.unit]]
    factors = {unit: 10 ** (DIGITS[read.unit] - DIGITS[unit]) for unit in finer}
    best = min(finer, key=lambda unit: abs(np.log(duration / factors[unit] / wanted)), default=None)
    if best is None or not 1 / SAME_SPAN < duration / factors[best] / wanted < SAME_SPAN:
        return read
    t_ns = read.trajectory.t_ns // factors[best]
    if np.any(np.diff(t_ns) <= 0):
        return read
    return replace(read, trajectory=Trajectory(t_ns, read.trajectory.T_world_frame), unit=best)


def _unit_finding(side: Side, read: Reading, right: Reading, other: Reading) -> Finding:
    assert read.form_unit is not None
    assert read.unit is not None
    assert right.unit is not None
    stated = DIGITS[read.form_unit] - DIGITS[read.unit]
    lasts = [_duration_ns(read) * 10.0**stated, float(_duration_ns(right))]
    ratios = [duration / max(_duration_ns(other), 1) for duration in lasts]
    return Finding(
        "stamp_unit",
        f"the {WHO[side]}'s stamps are {WORDS[right.unit]}, not {WORDS[read.form_unit]}",
        (Evidence(f"duration over that of the {WHO['est' if side == 'gt' else 'gt']}", "1", ratios[0], ratios[1]),),
        (f"--{side}-as", right.unit),
    )


def _on_one_clock(gt: Reading, est: Reading, findings: list[Finding]) -> Reading:
    """The estimate with its clock set right."""
    try:
        lag = estimate_offset(gt.trajectory, est.trajectory)
    except AlignmentError:  # motion doesn't tell
        return est
    before = likeness(gt.trajectory, est.trajectory, 0)
    after = lag.correlation
    if abs(lag.offset_ns) <= LAG_NS or after < LAG_ALIKE:
        return est
    is_plain = before is None or (1 - after <= LAG_MENDED * (1 - before) and after - before >= LAG_BY)
    if not is_plain and not _is_steady(gt.trajectory, est.trajectory, lag.offset_ns):
        return est
    offset = seconds(lag.offset_ns).rstrip("0").rstrip(".")
    sentence = f"the estimate's clock is {abs(lag.offset_ns) / 1e9:.3f} s {'behind' if lag.offset_ns > 0 else 'ahead'}"
    evidence = Evidence("correlation of the speeds", "1", before, after)
    findings.append(Finding("time_offset", sentence, (evidence,), (f"--t-offset={offset}",)))
    moved = est.trajectory.t_ns + lag.offset_ns
    return replace(est, trajectory=Trajectory(moved, est.trajectory.T_world_frame))


def _is_steady(gt: Trajectory, est: Trajectory, offset_ns: int) -> bool:
    """Whether nearly every stretch of the recording shows the offset by itself, to within half of it."""
    if abs(offset_ns) <= STEADY_LAG_NS:
        return False
    found = offsets_in_stretches(gt, est, within_ns=round(1.5 * abs(offset_ns)))
    alike = np.abs(found - offset_ns) <= 0.5 * abs(offset_ns)
    return len(found) > 0 and bool(np.mean(alike) >= STEADY_SHARE)


def _matched(gt: Reading, est: Reading) -> tuple[Array, Array]:
    """At most MAX_POSES matched poses, evenly chosen; as far apart as half a step of the slower truth."""
    steps_ns = np.diff(gt.trajectory.t_ns)
    window_ns = max(MAX_DIFF_NS, int(np.median(steps_ns)) // 2 if len(steps_ns) else 0)
    pairs = associate(gt.trajectory.t_ns, est.trajectory.t_ns, max_diff_ns=window_ns)
    chosen = np.linspace(0, len(pairs) - 1, min(len(pairs), MAX_POSES)).round().astype(int)
    return gt.trajectory.T_world_frame[pairs.gt[chosen]], est.trajectory.T_world_frame[pairs.est[chosen]]


def _in_right_frames(
    T_gt: Array, T_est: Array, gt: Reading, est: Reading, findings: list[Finding]
) -> tuple[Array, Array]:
    """The matched poses (K, 4, 4) without their fault of frames."""
    found = find_mismatch(T_gt, T_est, gt_order=gt.order, est_order=est.order)
    if found is None:
        return T_gt, T_est
    before = found.before
    after = found.suspect.misfit
    evidence = [
        Evidence("rotation left after alignment (rms)", "deg", *np.rad2deg([before.rot_rad, after.rot_rad]).tolist()),
        Evidence("position left, of the path's extent (rms)", "%", 100 * before.trans, 100 * after.trans),
    ]
    if found.lever:
        evidence.append(
            Evidence("translation of short motions left (rms)", "m", found.lever.before_m, found.lever.after_m)
        )
    sentence, options = _frame_words(found, gt, est)
    findings.append(Finding(found.kind, sentence, tuple(evidence), options))
    return found.suspect.T_gt, found.suspect.T_est


def _frame_words(found: Mismatch, gt: Reading, est: Reading) -> tuple[str, tuple[str, ...]]:
    """A sentence about a fault of frames, and the options that mend it."""
    side = found.suspect.side
    move = found.suspect.move
    if move is None:
        read_as = (gt if side == "gt" else est).order
        order = "wxyz" if read_as == "xyzw" else "xyzw"
        return f"the {WHO[side]}'s quaternions are {order}", (f"--{side}-as", order)
    option = (f"--{side}-as", str(move))
    if found.kind == "inverse_poses":
        return (
            f"the {WHO[side]}'s poses take the world to the frame (T_cw): they are the inverse of what is wanted",
            option,
        )
    if found.kind == "inverse_rotations":
        return f"the {WHO[side]}'s rotations are inverse (JPL's, not Hamilton's), but its positions are not", option
    return _move_words(found.kind, move), option


def _move_words(kind: Fault, move: Move) -> str:
    if move.kind == "mount":
        angle = float(np.rad2deg(se3.rotation_angle(move.matrix[:3, :3])))
        length = float(np.linalg.norm(move.matrix[:3, 3]))
        return (
            f"the estimate is of another frame of the same body, turned by {angle:.1f} deg and {length:.2g} m away: "
            f"a camera's, perhaps, against the body's"
        )
    of = "positions and rotations" if move.kind == "axes" else "positions, but not its rotations,"
    axes = str(move).partition(":")[2]
    how = "mirrored" if kind == "mirrored_axes" else "swapped"
    return f"the axes of the estimate's {of} are {how}: the truth's x,y,z are its {axes}"


def _wrong_scale(T_gt: Array, T_est: Array) -> Iterator[Finding]:
    fits = {kind: align(T_est, T_gt, kind=kind) for kind in ("se3", "sim3")}
    scale = fits["sim3"].scale
    if not scale > 0:
        return
    before, after = (_ate_m(fits[kind].apply(T_est), T_gt) for kind in ("se3", "sim3"))
    if abs(np.log(scale)) > SCALE_OFF and after <= SCALE_MENDED * before:
        yield Finding(
            "scale",
            f"the estimate is {1 / scale:.4g} times as large as the truth",
            (Evidence("ATE (rmse)", "m", before, after),),
            ("-a", "sim3"),
        )


def _swapped(gt: Reading, est: Reading) -> Iterator[Finding]:
    """Whether enough signs of two trajectories on one clock, where both have noise, speak for swapped inputs."""
    truth = gt.trajectory
    estimate = est.trajectory
    pairs = associate(truth.t_ns, estimate.t_ns)
    noises = [_noise(t.positions_m[chosen]) for t, chosen in ((truth, pairs.gt), (estimate, pairs.est))]
    if len(pairs) < MIN_POSES_SWAP or not min(noises) > 0:
        return
    noise = noises[0] / noises[1]
    density = _step_ns(est) / _step_ns(gt)
    origins = (_begins_at_origin(truth), _begins_at_origin(estimate))
    says_truth = (gt.says_truth, est.says_truth)
    # Truth that has a pose at exactly each estimated one was interpolated, and that makes it smooth.
    is_noisy = noises[0] > NOISE
    same_instants = len(truth) == len(estimate) == len(pairs)
    votes = [
        int(is_noisy and noise > NOISIER) + int(is_noisy and noise > PLAINLY_NOISIER and same_instants),
        int(density < 1 / DENSER) - int(density > DENSER),
        int(origins == (True, False)) - int(origins == (False, True)),
        int(says_truth == (False, True)) - int(says_truth == (True, False)),
    ]
    if sum(votes) < ENOUGH:
        return
    evidence = (
        Evidence("noise of the truth over that of the estimate", "1", noise, 1 / noise),
        Evidence("poses a second of the truth over those of the estimate", "1", density, 1 / density),
    )
    too = ["the truth begins at the identity and the estimate doesn't"] * (origins == (True, False))
    too += ["the estimate's file calls itself ground truth"] * (says_truth == (False, True))
    sentence = "; ".join(["ground truth and estimate seem to be in each other's place", *too])
    yield Finding("swapped_inputs", sentence, evidence)


def _noise(positions_m: Array) -> float:
    """Median third difference as share of the median step: of steady motion nearly 0, of noise up to 20."""
    if len(positions_m) < MIN_POSES_SWAP:
        return 0.0
    jerks, steps = (np.linalg.norm(np.diff(positions_m, order, axis=0), axis=1) for order in (3, 1))
    return float(np.median(jerks) / max(np.median(steps), 1e-300))


def _begins_at_origin(trajectory: Trajectory) -> bool:
    return bool(np.abs(trajectory.T_world_frame[0] - np.eye(4)).max() <= AT_ORIGIN)


def _ate_m(T_est: Array, T_gt: Array) -> float:
    return float(np.sqrt(np.sum((T_est - T_gt)[:, :3, 3] ** 2, axis=1).mean()))


def _extent_m(T: Array) -> float:
    return float(np.sqrt(T[:, :3, 3].var(axis=0).sum()))


def _step_ns(read: Reading) -> float:
    steps = np.diff(read.trajectory.t_ns)
    return float(np.median(steps)) if len(steps) else 1.0


def _duration_ns(read: Reading) -> int:
    t_ns = read.trajectory.t_ns
    return int(t_ns[-1] - t_ns[0]) if len(t_ns) else 0
