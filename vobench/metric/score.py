"""One estimate against one ground truth: associate, align, measure, and say what the numbers mean."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vobench.errors import AlignmentError
from vobench.geometry.se3 import Array
from vobench.metric.ate import absolute_errors
from vobench.metric.coverage import Coverage, coverage
from vobench.metric.pose_error import PoseErrors
from vobench.metric.rpe import relative_errors
from vobench.metric.segment import INDOOR_LENGTHS_M, SegmentErrors, segment_errors
from vobench.metric.statistic import Statistics, statistics
from vobench.trajectory.align import Alignment, Kind, align
from vobench.trajectory.associate import MAX_DIFF_NS, Pairs, associate
from vobench.trajectory.text import seconds
from vobench.trajectory.trajectory import Stamps, Trajectory


@dataclass(frozen=True, slots=True)
class ScoreSettings:
    """Everything that changes a score besides the two trajectories; it is written into each metric's id."""

    alignment: Kind = "se3"
    max_diff_ns: int = MAX_DIFF_NS
    rpe_delta_frames: int = 1
    segment_lengths_m: tuple[float, ...] = INDOOR_LENGTHS_M
    segment_step_frames: int = 1

    def __post_init__(self) -> None:
        if self.max_diff_ns < 0:
            raise AlignmentError(f"max_diff_ns should be 0 or more, but is {self.max_diff_ns}")
        if min(self.rpe_delta_frames, self.segment_step_frames) < 1:
            raise AlignmentError(
                f"rpe_delta_frames and segment_step_frames should be 1 or more, "
                f"but are {self.rpe_delta_frames} and {self.segment_step_frames}"
            )
        if not self.segment_lengths_m or min(self.segment_lengths_m) <= 0:
            raise AlignmentError(f"segment_lengths_m should be positive, but are {self.segment_lengths_m}")


@dataclass(frozen=True, slots=True)
class Metric:
    """One metric's statistics; `id` says how it was computed, so equal ids may be compared."""

    id: str
    name: str
    unit: str
    statistics: Statistics

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values: id, name, unit and each statistic."""
        return {"id": self.id, "name": self.name, "unit": self.unit, **asdict(self.statistics)}


@dataclass(frozen=True, slots=True)
class Association:
    """How many poses met: pairs, all poses on either side, and how far apart a pair may be."""

    pairs: int
    gt_poses: int
    est_poses: int
    max_diff_s: float


@dataclass(frozen=True, slots=True)
class Score:
    """An estimate's metrics, and for plots the error and aligned position of every matched frame.

    gt_frames, gt_t_ns, ate_trans_m and ate_rot_deg are (K,), aligned_positions_m is (K, 3), in truth's frame.
    """

    metrics: tuple[Metric, ...]
    association: Association
    coverage: Coverage
    alignment: Alignment
    warnings: tuple[str, ...]
    gt_frames: Stamps
    gt_t_ns: Stamps
    ate_trans_m: Array
    ate_rot_deg: Array
    aligned_positions_m: Array

    def metric(self, name: str) -> Metric | None:
        """The metric of that name, None where the trajectories gave it no sample."""
        return next((metric for metric in self.metrics if metric.name == name), None)

    def as_dict(self) -> dict[str, Any]:
        """The score as plain JSON values, without the series; coverage is the ratio."""
        return {
            "metrics": [metric.as_dict() for metric in self.metrics],
            "association": asdict(self.association),
            "coverage": self.coverage.ratio,
            "alignment": self.alignment.as_dict(),
            "warnings": list(self.warnings),
        }


DEFAULTS = ScoreSettings()


def score(gt: Trajectory, est: Trajectory, *, settings: ScoreSettings = DEFAULTS) -> Score:
    """Score an estimate of the motion of one frame against the truth of the same frame.

    A metric without samples is left out and a warning says why, never a zero.
    Raises AlignmentError where no poses match in time.
    """
    pairs = associate(gt.t_ns, est.t_ns, max_diff_ns=settings.max_diff_ns)
    if not len(pairs):
        raise AlignmentError(_no_overlap(gt, est, settings))
    T_gt, T_est = gt.T_world_frame[pairs.gt], est.T_world_frame[pairs.est]
    alignment = align(T_est, T_gt, kind=settings.alignment)
    T_aligned = alignment.apply(T_est)
    ate = absolute_errors(T_gt, T_aligned)
    rpe = relative_errors(T_gt, T_aligned, pairs.gt, delta=settings.rpe_delta_frames)
    segments = segment_errors(
        T_gt,
        T_aligned,
        pairs.gt,
        gt.distances_m(),
        lengths_m=settings.segment_lengths_m,
        step_frames=settings.segment_step_frames,
    )
    metrics = tuple(_metrics(ate, rpe, segments, _identity(gt, pairs, settings), settings))
    covered = coverage(gt.t_ns, pairs.gt)
    return Score(
        metrics=metrics,
        association=Association(len(pairs), len(gt), len(est), settings.max_diff_ns / 1e9),
        coverage=covered,
        alignment=alignment,
        warnings=(
            *_matching_warnings(gt, est, pairs, covered, alignment),
            *_missing_warnings(gt, metrics, settings),
        ),
        gt_frames=pairs.gt,
        gt_t_ns=gt.t_ns[pairs.gt],
        ate_trans_m=ate.trans_m,
        ate_rot_deg=np.rad2deg(ate.rot_rad),
        aligned_positions_m=T_aligned[:, :3, 3],
    )


def _metrics(
    ate: PoseErrors, rpe: PoseErrors, segments: SegmentErrors, identity: str, settings: ScoreSettings
) -> Iterator[Metric]:
    lengths = ",".join(f"{length:g}" for length in settings.segment_lengths_m)
    delta, step = f"delta={_frames(settings.rpe_delta_frames)}", f"step={_frames(settings.segment_step_frames)}"
    of_segment = f"lengths={lengths} m; {step}; {identity}"
    rows = [
        ("ate_trans", "ate.trans.rmse", "m", identity, ate.trans_m),
        ("ate_rot", "ate.rot.rmse", "deg", identity, np.rad2deg(ate.rot_rad)),
        ("rpe_trans", "rpe.trans.rmse", "m", f"{delta}; {identity}", rpe.trans_m),
        ("rpe_rot", "rpe.rot.rmse", "deg", f"{delta}; {identity}", np.rad2deg(rpe.rot_rad)),
        ("segment_trans", "segment.trans.mean", "1", of_segment, segments.trans_ratio),
        ("segment_rot", "segment.rot.mean", "deg/m", of_segment, np.rad2deg(segments.rot_radpm)),
    ]
    for name, headline, unit, how, errors in rows:
        if len(errors):
            yield Metric(f"{headline}[{how}]", name, unit, statistics(errors))


def _identity(gt: Trajectory, pairs: Pairs, settings: ScoreSettings) -> str:
    window = f"nearest<={settings.max_diff_ns / 1e6:g}ms"
    return f"align={settings.alignment}; assoc={window}; n={len(pairs)}/{len(gt)}"


def _matching_warnings(
    gt: Trajectory, est: Trajectory, pairs: Pairs, covered: Coverage, alignment: Alignment
) -> Iterator[str]:
    if alignment.unobservable:
        yield (
            f"the positions leave open: {', '.join(alignment.unobservable)}; "
            f"the first matched orientation decides, so rotation errors are relative to it"
        )
    if covered.gaps:
        yield (
            f"the estimate has {len(pairs)} of {_frames(len(gt))}; the first lost is {covered.first_lost_frame}, "
            f"the longest gap {_frames(covered.longest_gap_frames)} ({covered.longest_gap_s:.3f} s)"
        )
    if len(pairs) < len(est):
        yield f"{len(est) - len(pairs)} of {len(est)} estimated poses have no ground truth of their own"


def _missing_warnings(gt: Trajectory, metrics: tuple[Metric, ...], settings: ScoreSettings) -> Iterator[str]:
    present = {metric.name for metric in metrics}
    if "rpe_trans" not in present:
        yield f"no relative pose error: no two matched poses are {_frames(settings.rpe_delta_frames)} apart"
    if "segment_trans" not in present:
        yield (
            f"no segment error: no two matched poses are more than {min(settings.segment_lengths_m):g} m of path "
            f"apart; the whole path is {gt.distances_m()[-1]:.3g} m"
        )


def _no_overlap(gt: Trajectory, est: Trajectory, settings: ScoreSettings) -> str:
    return (
        f"no pose of the estimate is within {settings.max_diff_ns / 1e6:g} ms of a ground-truth pose: "
        f"the truth has {_span(gt)}, the estimate {_span(est)}"
    )


def _span(trajectory: Trajectory) -> str:
    if not len(trajectory):
        return "no pose"
    first, last = seconds(int(trajectory.t_ns[0])), seconds(int(trajectory.t_ns[-1]))
    return f"{len(trajectory)} poses from {first} s to {last} s"


def _frames(count: int) -> str:
    return f"{count} frame{'' if count == 1 else 's'}"
