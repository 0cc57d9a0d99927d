"""One estimate against one ground truth: associate, align, measure, and say what the numbers mean."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.ate import absolute_errors
from vobench.metric.coverage import SLOT_NS, Coverage, coverage, slots
from vobench.metric.failure import Failure, failure
from vobench.metric.identity import identity
from vobench.metric.measure import Comparison, LengthMetric, Metric, Samples, joined, measured
from vobench.metric.nees import consistency
from vobench.metric.pose_error import in_plane
from vobench.metric.scale import ate_scale, motion_scale
from vobench.metric.settings import ScoreSettings, settled
from vobench.trajectory.align import Alignment, align
from vobench.trajectory.associate import Matched, match
from vobench.trajectory.text import seconds
from vobench.trajectory.trajectory import Stamps, Trajectory

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["DEFAULTS", "Association", "LengthMetric", "Metric", "Pooled", "Score", "ScoreSettings", "pooled", "score"]


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
    `settings` leave nothing open; `samples` are the errors behind the metrics, in their order.
    """

    metrics: tuple[Metric, ...]
    association: Association
    coverage: Coverage
    failure: Failure
    lost_aware_id: str
    alignment: Alignment
    warnings: tuple[str, ...]
    gt_frames: Stamps
    gt_t_ns: Stamps
    ate_trans_m: Array
    ate_rot_deg: Array
    aligned_positions_m: Array
    settings: ScoreSettings
    samples: tuple[Samples, ...] = field(repr=False)

    @property
    def per_length(self) -> tuple[LengthMetric, ...]:
        """The metrics that go by lengths of path, over each length alone."""
        return tuple(row for samples in self.samples for row in samples.per_length(self.settings))

    def metric(self, name: str) -> Metric | None:
        """The metric of that name, None where the trajectories gave it no sample."""
        return next((metric for metric in self.metrics if metric.name == name), None)

    def __repr__(self) -> str:
        shown = [f"{m.name} {m.statistics.rmse:.4g} {m.unit}" for m in self.metrics[:3]]
        said = f"{len(self.metrics)} metrics, {len(self.warnings)} warning{'' if len(self.warnings) == 1 else 's'}"
        return f"Score({', '.join(shown)}, coverage {self.coverage.ratio:.3f}; {said})"

    def noted(self, notes: tuple[str, ...]) -> "Score":
        """The same with notes on how its files were read before the warnings."""
        return replace(self, warnings=(*notes, *self.warnings))

    def to_frame(self) -> "pd.DataFrame":
        """A pandas table, one row a metric by its name: unit, every statistic, and the id."""
        import pandas as pd

        rows = [{"name": m.name, "unit": m.unit, **asdict(m.statistics), "id": m.id} for m in self.metrics]
        return pd.DataFrame(rows).set_index("name")

    def as_dict(self) -> dict[str, Any]:
        """The score as plain JSON values, without the series; coverage is the ratio, its details go to failure."""
        covered = asdict(self.coverage)
        return {
            "metrics": [metric.as_dict() for metric in self.metrics],
            "association": asdict(self.association),
            "coverage": covered.pop("ratio"),
            "alignment": self.alignment.as_dict(),
            "failure": {"id": self.lost_aware_id, **asdict(self.failure), "coverage_of": covered.pop("of"), **covered},
            "warnings": list(self.warnings),
        }


DEFAULTS = ScoreSettings()


def score(
    gt: Trajectory, est: Trajectory, *, settings: ScoreSettings = DEFAULTS, covariance: Array | None = None
) -> Score:
    """Score an estimate of the motion of one frame against the truth of the same frame.

    `covariance` (N, 6, 6) of the estimate's poses adds their consistency (see `nees`). A metric without
    samples is left out and a warning says why, never a zero. Raises AlignmentError where no poses match in time.
    """
    of = compare(gt, est, settings)
    ate = absolute_errors(of.matched.T_gt, of.T_aligned)
    samples = tuple(found for found in (*measured(of, ate), *_consistency(of, covariance)) if len(found.errors))
    metrics = tuple(found.metric(of.settings, n=len(of.matched), of=len(gt)) for found in samples)
    frames = of.matched.pairs.gt
    covered, slot = coverage(gt.t_ns, frames, of=settings.coverage_of), slots(gt.t_ns, settings.coverage_of)[frames]
    return Score(
        metrics=metrics,
        association=Association(len(frames), len(gt), len(est), settings.max_diff_ns / 1e9),
        coverage=covered,
        failure=failure(ate.trans_m, slot, covered, fail_m=settings.fail_ratio * float(of.distances_m[-1])),
        lost_aware_id=identity("lost.aware.score", of.settings, n=len(frames), of=len(gt)),
        alignment=of.alignment,
        warnings=(*_matching_warnings(of, covered), *_missing_warnings(of, metrics)),
        gt_frames=frames,
        gt_t_ns=gt.t_ns[frames],
        ate_trans_m=ate.trans_m,
        ate_rot_deg=np.rad2deg(ate.rot_rad),
        aligned_positions_m=of.T_aligned[:, :3, 3],
        settings=of.settings,
        samples=samples,
    )


@dataclass(frozen=True, slots=True)
class Pooled:
    """Several sequences as one: the statistics of all their errors together, and what could not be pooled."""

    metrics: tuple[Metric, ...]
    per_length: tuple[LengthMetric, ...]
    warnings: tuple[str, ...]


def pooled(scores: Sequence[Score]) -> Pooled:
    """The statistics over all errors of all sequences, so that each counts by its number of errors.

    For segments this is the mean of KITTI's table. A metric that the sequences measured in different ways, such
    as over other lengths of path, is left out with a warning.
    """
    n, of = (sum(getattr(scored.association, side) for scored in scores) for side in ("pairs", "gt_poses"))
    metrics: list[Metric] = []
    lengths: list[LengthMetric] = []
    warnings: list[str] = []
    for name in dict.fromkeys(metric.name for scored in scores for metric in scored.metrics):
        found = [(part, scored.settings) for scored in scores for part in scored.samples if part.name == name]
        ids = {part.metric(settings, n=0, of=0).id for part, settings in found}
        if len(ids) > 1:
            warnings.append(f"{name} is not pooled, for the sequences measure it in different ways: compare their ids")
            continue
        together = joined([part for part, _ in found])
        metrics.append(together.metric(found[0][1], n=n, of=of))
        lengths += together.per_length(found[0][1])
    return Pooled(tuple(metrics), tuple(lengths), tuple(warnings))


def compare(gt: Trajectory, est: Trajectory, settings: ScoreSettings = DEFAULTS) -> Comparison:
    """Match and align, ready to be measured. Raises AlignmentError where no poses match in time."""
    window = {"max_diff_ns": settings.max_diff_ns, "offset_ns": settings.offset_ns}
    matched = match(gt, est, method=settings.association, **window)
    if not len(matched):
        raise AlignmentError(_no_overlap(gt, est, settings))
    alignment, T_aligned, T_moving = _aligned(matched, settings)
    if settings.project:
        gt = Trajectory(gt.t_ns, in_plane(gt.T_world_frame, settings.project))
        matched = replace(matched, T_gt=in_plane(matched.T_gt, settings.project))
        T_aligned, T_moving = (in_plane(T, settings.project) for T in (T_aligned, T_moving))
    distances_m = gt.distances_m()
    return Comparison(
        gt=gt,
        est=est,
        matched=matched,
        alignment=alignment,
        T_aligned=T_aligned,
        T_moving=T_moving,
        distances_m=distances_m,
        settings=settled(settings, float(distances_m[-1])),
    )


def _aligned(matched: Matched, settings: ScoreSettings) -> tuple[Alignment, Array, Array]:
    """The alignment, and the poses (K, 4, 4) that it makes: to compare as they are, and to compare their motions."""
    T_est, T_gt = matched.T_est, matched.T_gt
    if settings.scale_rule == "alignment":
        alignment = align(T_est, T_gt, kind=settings.alignment, first_n=settings.align_n)
        T_aligned = alignment.apply(T_est)
        return alignment, T_aligned, T_aligned
    scale = ate_scale(T_gt, T_est)
    scaled = se3.transform(T_est[:, :3, :3], scale * T_est[:, :3, 3])
    alignment = replace(align(scaled, T_gt, kind=settings.alignment, first_n=settings.align_n), scale=scale)
    return alignment, alignment.apply(T_est), replace(alignment, scale=motion_scale(T_gt, T_est)).apply(T_est)


def _consistency(of: Comparison, covariance: Array | None) -> Iterator[Samples]:
    if covariance is None:
        return
    if of.settings.project:
        raise AlignmentError(f"covariances should be of poses in space, but project={of.settings.project} is asked for")
    if covariance.shape != (len(of.est), 6, 6):
        raise AlignmentError(f"covariance should be ({len(of.est)}, 6, 6), one a pose, but is {covariance.shape}")
    of_pose = covariance[of.matched.pairs.est]
    nees = consistency(of.matched.T_gt, of.matched.T_est, of_pose, of.alignment)
    yield Samples("nees_pose", nees.pose)
    yield Samples("nees_trans", nees.trans)
    yield Samples("nees_rot", nees.rot)


def _matching_warnings(of: Comparison, covered: Coverage) -> Iterator[str]:
    if of.alignment.unobservable:
        yield (
            f"the positions leave open: {', '.join(of.alignment.unobservable)}; "
            f"the first matched orientation decides, so rotation errors are relative to it"
        )
    if covered.of == "time":
        yield _time_warning(covered)
    elif covered.gaps:
        yield (
            f"the estimate has {len(of.matched)} of {_frames(len(of.gt))}; the first lost is "
            f"{covered.first_lost_frame}, the longest gap {_frames(covered.longest_gap_frames)} "
            f"({covered.longest_gap_s:.3f} s)"
        )
    if len(of.matched) < len(of.est):
        yield f"{len(of.est) - len(of.matched)} of {len(of.est)} estimated poses have no ground truth of their own"


def _time_warning(covered: Coverage) -> str:
    gaps = f"{covered.gaps} gap{'' if covered.gaps == 1 else 's'}"
    longest = f", the longest of {covered.longest_gap_s:.3f} s" if covered.gaps else ""
    return (
        f"the truth is too dense to have a pose a frame, so coverage counts time, in slots of {SLOT_NS / 1e9:g} s: "
        f"{covered.ratio:.1%}, the first pose after {covered.time_to_first_pose_s:.3f} s, {gaps}{longest}"
    )


def _missing_warnings(of: Comparison, metrics: tuple[Metric, ...]) -> Iterator[str]:
    present = {metric.name for metric in metrics}
    settings, path_m = of.settings, float(of.distances_m[-1])
    if "rpe_trans" not in present:
        yield f"no relative pose error: no two matched poses are {_delta(settings)} apart"
    if "kitti_t_rel" not in present:
        yield (
            f"no segment error: no two matched poses are more than {min(settings.segment_lengths_m or (0.0,)):g} m of "
            f"path apart; the whole path is {path_m:.3g} m"
        )
    if not path_m:
        yield "no lost-aware score: the truth stands still, so no error can be measured against its path"


def _no_overlap(gt: Trajectory, est: Trajectory, settings: ScoreSettings) -> str:
    moved = f" moved by {settings.offset_ns / 1e9:g} s" if settings.offset_ns else ""
    return (
        f"no pose of the estimate{moved} is within {settings.max_diff_ns / 1e6:g} ms of a ground-truth pose: "
        f"the truth has {_span(gt)}, the estimate {_span(est)}"
    )


def _span(trajectory: Trajectory) -> str:
    if not len(trajectory):
        return "no pose"
    first, last = seconds(int(trajectory.t_ns[0])), seconds(int(trajectory.t_ns[-1]))
    return f"{len(trajectory)} poses from {first} s to {last} s"


def _frames(count: int) -> str:
    return f"{count} frame{'' if count == 1 else 's'}"


def _delta(settings: ScoreSettings) -> str:
    if settings.rpe_unit == "f":
        return _frames(int(settings.rpe_delta))
    return f"{settings.rpe_delta:g} { {'m': 'm', 's': 's', 'd': '°', 'r': 'rad'}[settings.rpe_unit] }"
