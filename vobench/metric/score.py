"""Scores an estimate against a ground truth: associates, aligns and measures."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.errors import counted
from vobench.geometry.se3 import Array
from vobench.metric import nees
from vobench.metric.ate import errors_of_comparison
from vobench.metric.comparison import DEFAULTS, Comparison, MetricDefinition, OverLengths, compare
from vobench.metric.coverage import SLOT_NS, Coverage, coverage, slots
from vobench.metric.definitions import DEFINITIONS, identity
from vobench.metric.lost_aware import TrackingResult, tracking_result
from vobench.metric.segment import mean_drift
from vobench.metric.settings import ScoreSettings
from vobench.trajectory.align import Alignment
from vobench.trajectory.trajectory import Stamps, Trajectory

PERCENTILES = np.array([0.5, 0.95, 0.99])
UNIT_NAMES = {"m": "m", "s": "s", "d": "°", "r": "rad"}


@dataclass(frozen=True, slots=True)
class Statistics:
    """The statistics of n errors in the unit of the errors. `sse` is in the unit squared."""

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
    """The statistics of errors (N,). Percentiles are interpolated linearly. `std` uses `ddof`, or 0 for one error.

    Raises ValueError if there are no errors, because that does not mean that the error is 0.
    """
    e = np.sort(np.asarray(errors, float).ravel())
    if not e.size:
        raise ValueError("statistics need one error or more, got none")
    position = (e.size - 1) * PERCENTILES
    below = position.astype(int)
    above = np.minimum(below + 1, e.size - 1)
    share = position - below
    median, p95, p99 = (e[below] + share * (e[above] - e[below])).tolist()
    sse = float(np.sum(e * e))
    return Statistics(
        n=e.size,
        rmse=float(np.sqrt(sse / e.size)),
        mean=float(e.mean()),
        median=median,
        std=float(e.std(ddof=ddof)) if e.size > ddof else 0.0,
        min=float(e[0]),
        max=float(e[-1]),
        sse=sse,
        p95=p95,
        p99=p99,
    )


@dataclass(frozen=True, slots=True)
class MetricResult:
    """The statistics of a metric. `id` identifies how it was computed; numbers with equal ids are comparable."""

    id: str
    name: str
    unit: str
    statistics: Statistics

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values: id, name, unit and each statistic."""
        return {"id": self.id, "name": self.name, "unit": self.unit, **asdict(self.statistics)}


@dataclass(frozen=True, slots=True)
class LengthMetric:
    """The statistics of a metric over the segments or parts of one nominal length."""

    name: str
    unit: str
    length_m: float
    statistics: Statistics

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values: name, unit, length_m and each statistic."""
        return {"name": self.name, "unit": self.unit, "length_m": self.length_m, **asdict(self.statistics)}


@dataclass(frozen=True, slots=True)
class Samples:
    """All errors (N,) of a metric in its unit. `over` has their nominal lengths, if they are errors of segments."""

    of: MetricDefinition
    errors: Array
    over: OverLengths | None = None

    @classmethod
    def measured(cls, metric: MetricDefinition, comparison: Comparison) -> "Samples":
        """The errors of a metric in a comparison, which may be empty."""
        if metric.measure is None:
            return cls(metric, np.zeros(0))
        measurement = metric.measure(comparison)
        if isinstance(measurement, OverLengths):
            return cls(metric, measurement.errors, measurement)
        return cls(metric, measurement)

    def statistics(self, settings: ScoreSettings) -> Statistics:
        """The statistics of the errors. Raises ValueError if there are none."""
        result = statistics(self.errors, ddof=settings.std_ddof)
        if self.over is None or self.over.drift is None:
            return result
        mean = mean_drift(self.over.drift, self.over.length_m, mean=settings.segment_mean)
        is_angle = self.of.unit == "deg/m"
        return replace(result, mean=float(np.rad2deg(mean)) if is_angle else mean)

    def metric(self, settings: ScoreSettings, *, n: int, of: int) -> MetricResult:
        """The metric with the statistics of the errors, from `n` matched poses of `of` true poses."""
        metric_id = identity(self.of, settings, n=n, of=of)
        return MetricResult(metric_id, self.of.id, self.of.unit, self.statistics(settings))

    def per_length(self, settings: ScoreSettings) -> Iterator[LengthMetric]:
        """The metric for each length separately; empty for a metric without lengths."""
        if self.over is None:
            return
        for length_m in np.unique(self.over.length_m):
            of_length = self.selected(self.over.length_m == length_m)
            yield LengthMetric(
                name=self.of.id,
                unit=self.of.unit,
                length_m=float(length_m),
                statistics=of_length.statistics(settings),
            )

    def selected(self, mask: NDArray[np.bool_]) -> "Samples":
        """The samples (N,) that a mask selects."""
        errors = self.errors[mask]
        if self.over is None:
            return Samples(self.of, errors)
        drift = None if self.over.drift is None else self.over.drift[mask]
        return Samples(self.of, errors, OverLengths(errors, self.over.length_m[mask], drift))


def _joined(parts: Sequence[Samples]) -> Samples:
    """The concatenated samples of one metric of several sequences."""
    definition = parts[0].of
    errors = np.concatenate([part.errors for part in parts])
    overs = [part.over for part in parts if part.over is not None]
    if not overs:
        return Samples(definition, errors)
    length_m = np.concatenate([over.length_m for over in overs])
    drifts = [over.drift for over in overs if over.drift is not None]
    drift = np.concatenate(drifts) if drifts else None
    return Samples(definition, errors, OverLengths(errors, length_m, drift))


if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True)
class Association:
    """The numbers of pairs, of true poses and of estimated poses, and the largest time difference of a pair."""

    pairs: int
    gt_poses: int
    est_poses: int
    max_diff_s: float


@dataclass(frozen=True, slots=True)
class Score:
    """The metrics of an estimate, and for plots, the error and the aligned position of every matched frame.

    gt_frames, gt_t_ns, ate_trans_m and ate_rot_deg are (K,), aligned_positions_m is (K, 3), in truth's frame.
    `settings` are complete; `samples` are the errors of the metrics, in the same order.
    """

    metrics: tuple[MetricResult, ...]
    association: Association
    coverage: Coverage
    failure: TrackingResult
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
        """The metrics that are measured over lengths of path, for each length separately."""
        metrics = list[LengthMetric]()
        for samples in self.samples:
            metrics.extend(samples.per_length(self.settings))
        return tuple(metrics)

    def metric(self, name: str) -> MetricResult | None:
        """The metric with a name; None if it has no samples."""
        return next((metric for metric in self.metrics if metric.name == name), None)

    def __repr__(self) -> str:
        first = [f"{metric.name} {metric.statistics.rmse:.4g} {metric.unit}" for metric in self.metrics[:3]]
        counts = f"{len(self.metrics)} metrics, {counted(len(self.warnings), 'warning')}"
        return f"Score({', '.join(first)}, coverage {self.coverage.ratio:.3f}; {counts})"

    def to_frame(self) -> "pd.DataFrame":
        """A pandas table with one row per metric, by its name: unit, every statistic, and the id."""
        import pandas as pd

        rows = []
        for metric in self.metrics:
            start = {"name": metric.name, "unit": metric.unit}
            rows.append({**start, **asdict(metric.statistics), "id": metric.id})
        return pd.DataFrame(rows).set_index("name")

    def as_dict(self) -> dict[str, Any]:
        """The score as plain JSON values, without the values of frames. The coverage is part of the failure."""
        coverage_details = asdict(self.coverage)
        ratio = coverage_details.pop("ratio")
        coverage_of = coverage_details.pop("slot_kind")
        failure = {"id": self.lost_aware_id, **asdict(self.failure), "coverage_of": coverage_of, **coverage_details}
        return {
            "metrics": [metric.as_dict() for metric in self.metrics],
            "association": asdict(self.association),
            "coverage": ratio,
            "alignment": self.alignment.as_dict(),
            "failure": failure,
            "warnings": list(self.warnings),
        }


def score(
    gt: Trajectory,
    est: Trajectory,
    *,
    settings: ScoreSettings = DEFAULTS,
    covariance: Array | None = None,
    metrics: Iterable[MetricDefinition] = tuple(DEFINITIONS.values()),
) -> Score:
    """Score an estimate against the true trajectory of the same frame.

    With `covariance` (N, 6, 6) of the estimated poses, their consistency is scored too (see `nees`). A metric without
    samples is omitted, and a warning says why. Raises AlignmentError if no poses match in time.
    """
    comparison = compare(gt, est, settings, covariance=covariance)
    complete_settings = comparison.settings
    frames = comparison.matched.pairs.gt
    n = len(frames)
    samples = _samples(comparison, metrics)
    scored = tuple(part.metric(complete_settings, n=n, of=len(gt)) for part in samples)

    ate = comparison.once(errors_of_comparison)
    covered = coverage(gt.t_ns, frames, rule=settings.coverage_of)
    slot = slots(gt.t_ns, settings.coverage_of).of_frame[frames]
    path_m = float(comparison.distances_m[-1])
    warnings = (*_matching_warnings(comparison, covered), *_missing_warnings(comparison, scored))
    return Score(
        metrics=scored,
        association=Association(n, len(gt), len(est), settings.max_diff_ns / 1e9),
        coverage=covered,
        failure=tracking_result(ate.trans_m, slot, covered, fail_m=settings.fail_ratio * path_m),
        lost_aware_id=identity(DEFINITIONS["lost_aware"], complete_settings, n=n, of=len(gt)),
        alignment=comparison.alignment,
        warnings=warnings,
        gt_frames=frames,
        gt_t_ns=gt.t_ns[frames],
        ate_trans_m=ate.trans_m,
        ate_rot_deg=np.rad2deg(ate.rot_rad),
        aligned_positions_m=comparison.T_aligned[:, :3, 3],
        settings=complete_settings,
        samples=samples,
    )


def _samples(comparison: Comparison, metrics: Iterable[MetricDefinition]) -> tuple[Samples, ...]:
    """The samples of the requested metrics, headline metrics first. Metrics without samples are omitted."""
    requested = []
    for metric in metrics:
        is_headline = not metric.full
        is_of_covariance = metric in nees.METRICS
        if comparison.settings.full or is_headline or is_of_covariance:
            requested.append(metric)
    headlines_first = sorted(requested, key=lambda metric: metric.full)
    measured = [Samples.measured(metric, comparison) for metric in headlines_first]
    return tuple(samples for samples in measured if len(samples.errors))


@dataclass(frozen=True, slots=True)
class Pooled:
    """The pooled metrics of several sequences, and warnings about metrics that could not be pooled."""

    metrics: tuple[MetricResult, ...]
    per_length: tuple[LengthMetric, ...]
    warnings: tuple[str, ...]


def pooled(scores: Sequence[Score]) -> Pooled:
    """The metrics over all errors of all sequences. Each sequence is weighted by its number of errors.

    For segments, this is the mean in KITTI's table. A metric that was computed in different ways, for example over
    different lengths of path, is omitted with a warning.
    """
    n = sum(score.association.pairs for score in scores)
    n_true = sum(score.association.gt_poses for score in scores)
    metrics: list[MetricResult] = []
    lengths: list[LengthMetric] = []
    warnings: list[str] = []
    for name, samples in _samples_by_metric(scores).items():
        settings = [score.settings for score in scores if score.metric(name)]
        ids = {part.metric(each, n=0, of=0).id for part, each in zip(samples, settings, strict=True)}
        if len(ids) > 1:
            warnings.append(f"{name} is not pooled, for the sequences measure it in different ways: compare their ids")
            continue
        joined = _joined(samples)
        metrics.append(joined.metric(settings[0], n=n, of=n_true))
        lengths += joined.per_length(settings[0])
    return Pooled(tuple(metrics), tuple(lengths), tuple(warnings))


def _samples_by_metric(scores: Sequence[Score]) -> dict[str, list[Samples]]:
    """The samples of each metric, in the order of the scores and their metrics."""
    by_metric: dict[str, list[Samples]] = {}
    for score in scores:
        for samples in score.samples:
            by_metric.setdefault(samples.of.id, []).append(samples)
    return by_metric


def _matching_warnings(comparison: Comparison, covered: Coverage) -> Iterator[str]:
    n = len(comparison.matched)
    n_estimated = len(comparison.est)
    unobservable = comparison.alignment.unobservable
    if unobservable:
        yield (
            f"the positions leave open: {', '.join(unobservable)}; "
            f"the first matched orientation decides, so rotation errors are relative to it"
        )
    if covered.slot_kind == "time":
        yield _time_warning(covered)
    elif covered.gaps:
        yield (
            f"the estimate has {n} of {counted(len(comparison.gt), 'frame')}; the first lost is "
            f"{covered.first_lost_frame}, the longest gap {counted(covered.longest_gap_frames, 'frame')} "
            f"({covered.longest_gap_s:.3f} s)"
        )
    if n < n_estimated:
        yield f"{n_estimated - n} of {n_estimated} estimated poses have no ground truth of their own"


def _time_warning(covered: Coverage) -> str:
    longest = f", the longest of {covered.longest_gap_s:.3f} s" if covered.gaps else ""
    return (
        f"the truth is too dense to have a pose a frame, so coverage counts time, in slots of {SLOT_NS / 1e9:g} s: "
        f"{covered.ratio:.1%}, the first pose after {covered.time_to_first_pose_s:.3f} s, "
        f"{counted(covered.gaps, 'gap')}{longest}"
    )


def _missing_warnings(comparison: Comparison, metrics: tuple[MetricResult, ...]) -> Iterator[str]:
    measured = {metric.name for metric in metrics}
    settings = comparison.settings
    path_m = float(comparison.distances_m[-1])
    if "rpe_trans" not in measured:
        yield f"no relative pose error: no two matched poses are {_delta(settings)} apart"
    if "kitti_t_rel" not in measured:
        shortest_m = min(settings.segment_lengths_m or (0.0,))
        yield (
            f"no segment error: no two matched poses are more than {shortest_m:g} m of "
            f"path apart; the whole path is {path_m:.3g} m"
        )
    if not path_m:
        yield "no lost-aware score: the truth is stationary, so its path has no length to compare errors with"


def _delta(settings: ScoreSettings) -> str:
    """The distance between the poses of a pair, as text with its unit."""
    if settings.rpe_unit == "f":
        return counted(int(settings.rpe_delta), "frame")
    return f"{settings.rpe_delta:g} {UNIT_NAMES[settings.rpe_unit]}"
