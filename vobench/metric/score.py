"""One estimate scored against one ground truth: associate, align, measure."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.ate import PoseErrors, absolute_errors, absolute_matrix_errors, axis_errors, in_plane
from vobench.metric.coverage import SLOT_NS, Coverage, Failure, coverage, failure, slots
from vobench.metric.definitions import DEFINITIONS, identity
from vobench.metric.nees import consistency
from vobench.metric.rpe import (
    IndexPairs,
    distance_errors,
    every_pair,
    part_errors,
    relative_errors,
    relative_lengths,
    relative_matrix_errors,
    select_pairs,
    tum_errors,
)
from vobench.metric.scale import ate_scale, motion_scale, scale_errors
from vobench.metric.segment import Float32, SegmentErrors, devkit_distances, mean_drift, segment_errors
from vobench.metric.settings import ScoreSettings, settled
from vobench.trajectory.align import Alignment, align
from vobench.trajectory.associate import Matched, match
from vobench.trajectory.formats import seconds
from vobench.trajectory.trajectory import Stamps, Trajectory

PERCENTILES = np.array([0.5, 0.95, 0.99])


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of n errors in the errors' unit; sse is in the unit squared."""

    n: int
    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float
    sse: float
    p95: float
    p99: float


def statistics(errors: ArrayLike, *, ddof: int = 0) -> Statistics:
    """Statistics of one or more errors (N,); percentiles interpolate linearly, std has `ddof`, 0 for one error.

    Raises ValueError without errors: nothing measured is not an error of zero.
    """
    e = np.asarray(errors, float).ravel()
    if not e.size:
        raise ValueError("statistics need one error or more, got none")
    e = np.sort(e)
    at = (e.size - 1) * PERCENTILES
    below = at.astype(int)
    above = np.minimum(below + 1, e.size - 1)
    median, p95, p99 = e[below] + (at - below) * (e[above] - e[below])
    sse = np.sum(e * e)
    std = e.std(ddof=ddof) if e.size > ddof else 0.0
    numbers = [np.sqrt(sse / e.size), e.mean(), median, std, e[0], e[-1], sse, p95, p99]
    return Statistics(e.size, *map(float, numbers))


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
class LengthMetric:
    """The statistics of one metric over the segments or parts of one nominal length."""

    name: str
    unit: str
    length_m: float
    statistics: Statistics

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values: name, unit, length_m and each statistic."""
        return {"name": self.name, "unit": self.unit, "length_m": self.length_m, **asdict(self.statistics)}


@dataclass(frozen=True, slots=True)
class Samples:
    """All errors (N,) of one metric, in its unit; `length_m` (N,) where each is of a segment or part of the path.

    `drift` (N,): segments' errors as their mean is taken of them, which for the devkit is float32, in 1 or rad/m.
    """

    name: str
    errors: Array
    length_m: Array | None = None
    drift: Array | Float32 | None = None

    def statistics(self, settings: ScoreSettings) -> Statistics:
        """The statistics of one error or more."""
        found = statistics(self.errors, ddof=settings.std_ddof)
        if self.drift is None or self.length_m is None:
            return found
        mean = mean_drift(self.drift, self.length_m, mean=settings.segment_mean)
        return replace(found, mean=float(np.rad2deg(mean)) if self.unit == "deg/m" else mean)

    def metric(self, settings: ScoreSettings, *, n: int, of: int) -> Metric:
        """The metric of errors of n matched out of so many true poses."""
        defined = DEFINITIONS[self.name]
        text = identity(f"{defined.identity}.{defined.headline}", settings, n=n, of=of)
        return Metric(text, self.name, self.unit, self.statistics(settings))

    def per_length(self, settings: ScoreSettings) -> Iterator[LengthMetric]:
        """The metric over each length alone, none where it has no lengths."""
        for length in [] if self.length_m is None else np.unique(self.length_m):
            of_length = self.chosen(self.length_m == length)
            yield LengthMetric(self.name, self.unit, float(length), of_length.statistics(settings))

    def chosen(self, which: NDArray[np.bool_]) -> "Samples":
        """Some of the samples (N,)."""
        length_m = None if self.length_m is None else self.length_m[which]
        return Samples(self.name, self.errors[which], length_m, None if self.drift is None else self.drift[which])

    @property
    def unit(self) -> str:
        """The unit of the errors."""
        return DEFINITIONS[self.name].unit


def joined(parts: Sequence[Samples]) -> Samples:
    """The samples of one metric of several sequences, one after the other."""
    lengths_m = [part.length_m for part in parts if part.length_m is not None]
    drifts: list[Any] = [part.drift for part in parts if part.drift is not None]
    return Samples(
        parts[0].name,
        np.concatenate([part.errors for part in parts]),
        np.concatenate(lengths_m) if lengths_m else None,
        np.concatenate(drifts) if drifts else None,
    )


@dataclass(frozen=True, slots=True)
class Comparison:
    """Truth and estimate as matched and aligned, with settings that leave nothing open.

    T_aligned is (K, 4, 4), T_moving (K, 4, 4) the poses whose motions are compared, which differ from them only
    where scale_rule gives motions another scale; distances_m (N,) is the true path to each pose of the truth.
    """

    gt: Trajectory
    est: Trajectory
    matched: Matched
    alignment: Alignment
    T_aligned: Array
    T_moving: Array
    distances_m: Array
    settings: ScoreSettings

    def __repr__(self) -> str:
        matched = f"{len(self.matched)} pairs of {len(self.gt)} true and {len(self.est)} estimated poses"
        return f"Comparison({matched}, alignment {self.settings.alignment})"


def measured(of: Comparison, ate: PoseErrors) -> Iterator[Samples]:
    """The errors of the headline metrics, and with `full` of the others; some may have none."""
    pairs = _rpe_pairs(of)
    segments = _segments(of)
    yield Samples("ate_trans", ate.trans_m)
    yield Samples("ate_rot", np.rad2deg(ate.rot_rad))
    rpe = _rpe(of, pairs)
    yield Samples("rpe_trans", rpe.trans_m)
    yield Samples("rpe_rot", np.rad2deg(rpe.rot_rad))
    trans, rot, length_m = segments.trans_ratio, segments.rot_radpm, segments.length_m
    yield Samples("kitti_t_rel", trans, length_m, drift=trans)
    yield Samples("kitti_r_rel", np.rad2deg(rot, dtype=float), length_m, drift=rot)
    if of.settings.full:
        yield from _more_absolute(of)
        yield from _more_relative(of, pairs)
        yield from _parts(of)
        yield from _scale(of, segments)


def _rpe_pairs(of: Comparison) -> IndexPairs:
    s = of.settings
    if s.rpe_rule == "tartanair":
        return every_pair(len(of.matched))
    return select_pairs(
        of.matched.T_gt if s.rpe_pairs_from == "gt" else of.T_moving,
        of.matched.t_ns,
        delta=s.rpe_delta,
        unit=s.rpe_unit,
        all_pairs=s.rpe_all_pairs,
        spanning=s.rpe_rule == "spanning",
    )


def _rpe(of: Comparison, pairs: IndexPairs) -> PoseErrors:
    s = of.settings
    if s.rpe_rule == "tum":
        return tum_errors(of.gt, of.est, delta_s=s.rpe_delta, offset_ns=s.offset_ns, scale=of.alignment.scale)
    return relative_errors(of.matched.T_gt, of.T_moving, pairs)


def _segments(of: Comparison) -> SegmentErrors:
    s = of.settings
    return segment_errors(
        of.matched.T_gt,
        of.T_moving,
        of.matched.pairs.gt,
        devkit_distances(of.gt.positions_m) if s.segment_precision == "devkit" else of.distances_m,
        lengths_m=s.segment_lengths_m or (),
        step_frames=s.segment_step_frames or 1,
        precision=s.segment_precision,
    )


def _more_absolute(of: Comparison) -> Iterator[Samples]:
    norms = absolute_matrix_errors(of.matched.T_gt, of.T_aligned)
    yield Samples("ate_rot_chordal", norms.rot)
    yield Samples("ate_full", norms.full)
    axes = axis_errors(of.matched.T_gt, of.T_aligned)
    for name, errors in zip("xyz", axes.xyz_m.T, strict=True):
        yield Samples(f"ate_{name}", errors)
    for name, errors in zip(("roll", "pitch", "yaw"), np.rad2deg(axes.rpy_rad).T, strict=True):
        yield Samples(f"ate_{name}", errors)


def _more_relative(of: Comparison, pairs: IndexPairs) -> Iterator[Samples]:
    if of.settings.rpe_rule == "tum":  # their script pairs other poses, and has no other forms
        return
    norms = relative_matrix_errors(of.matched.T_gt, of.T_moving, pairs)
    yield Samples("rpe_rot_chordal", norms.rot)
    yield Samples("rpe_full", norms.full)
    distances = distance_errors(of.matched.T_gt, of.T_moving, pairs)
    yield Samples("rpe_point", distances.point_m)
    yield Samples("rpe_point_percent", distances.percent)


def _parts(of: Comparison) -> Iterator[Samples]:
    rule = of.settings.relative_rule
    lengths_m = relative_lengths(float(of.distances_m[-1]), rule)
    errors = part_errors(of.matched.T_gt, _part_poses(of), lengths_m, rule=rule)
    length_m, rot_deg = errors.length_m, np.rad2deg(errors.rot_rad)
    yield Samples("rel_trans", errors.trans_m, length_m)
    yield Samples("rel_trans_percent", 100 * errors.trans_m / length_m, length_m)
    yield Samples("rel_rot", rot_deg, length_m)
    yield Samples("rel_rot_per_m", rot_deg / length_m, length_m)
    yield Samples("rel_yaw", np.rad2deg(errors.yaw_rad), length_m)
    yield Samples("rel_gravity", np.rad2deg(errors.gravity_rad), length_m)


def _part_poses(of: Comparison) -> Array:
    """The poses whose parts are compared: rpg turns errors into the estimate's own world, ov_eval into the truth's."""
    if of.settings.relative_rule == "openvins" or of.settings.project:
        return of.T_moving
    T_est = of.matched.T_est
    return se3.transform(T_est[:, :3, :3], of.alignment.scale * T_est[:, :3, 3])


def _scale(of: Comparison, segments: SegmentErrors) -> Iterator[Samples]:
    frames = of.matched.pairs.gt
    first, last = (np.searchsorted(frames, ends) for ends in (segments.first, segments.last))
    found = scale_errors(of.matched.T_gt, of.T_moving, of.distances_m[frames], first, last)
    yield Samples("scale_error", found.error)
    if len(found):
        yield Samples("scale_drift", np.array([found.drift_per_m]))


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
