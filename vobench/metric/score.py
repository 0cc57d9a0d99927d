"""One estimate scored against one ground truth: associate, align, measure."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.se3 import Array
from vobench.metric import nees
from vobench.metric.ate import absolute
from vobench.metric.comparison import DEFAULTS, Comparison, MetricDefinition, OverLengths, compare
from vobench.metric.coverage import SLOT_NS, Coverage, Failure, coverage, failure, slots
from vobench.metric.definitions import DEFINITIONS, identity
from vobench.metric.segment import mean_drift
from vobench.metric.settings import ScoreSettings
from vobench.trajectory.align import Alignment
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
    """All errors (N,) of one metric, in its unit; `over` has their lengths where each is of a stretch of the path."""

    of: MetricDefinition
    errors: Array
    over: OverLengths | None = None

    @classmethod
    def measured(cls, metric: MetricDefinition, of: Comparison) -> "Samples":
        """The errors of a metric in a comparison; there may be none."""
        found = metric.measure(of) if metric.measure else np.zeros(0)
        return cls(metric, found.errors, found) if isinstance(found, OverLengths) else cls(metric, found)

    def statistics(self, settings: ScoreSettings) -> Statistics:
        """The statistics of one error or more."""
        found = statistics(self.errors, ddof=settings.std_ddof)
        if self.over is None or self.over.drift is None:
            return found
        mean = mean_drift(self.over.drift, self.over.length_m, mean=settings.segment_mean)
        return replace(found, mean=float(np.rad2deg(mean)) if self.of.unit == "deg/m" else mean)

    def metric(self, settings: ScoreSettings, *, n: int, of: int) -> Metric:
        """The metric of errors of n matched out of so many true poses."""
        text = identity(self.of, settings, n=n, of=of)
        return Metric(text, self.of.id, self.of.unit, self.statistics(settings))

    def per_length(self, settings: ScoreSettings) -> Iterator[LengthMetric]:
        """The metric over each length alone, none where it has no lengths."""
        lengths_m = np.zeros(0) if self.over is None else self.over.length_m
        for length in np.unique(lengths_m):
            of_length = _joined([self], lengths_m == length)
            yield LengthMetric(self.of.id, self.of.unit, float(length), of_length.statistics(settings))


def _joined(parts: Sequence[Samples], which: "NDArray[np.bool_] | slice" = slice(None)) -> Samples:
    """The samples of one metric of several sequences one after the other, or `which` of them."""
    errors = np.concatenate([part.errors for part in parts])[which]
    overs = [part.over for part in parts if part.over is not None]
    if not overs:
        return Samples(parts[0].of, errors)
    length_m = np.concatenate([over.length_m for over in overs])[which]
    drifts = [over.drift for over in overs if over.drift is not None]
    drift = np.concatenate(drifts)[which] if drifts else None
    return Samples(parts[0].of, errors, OverLengths(errors, length_m, drift))


if TYPE_CHECKING:
    import pandas as pd


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


def score(
    gt: Trajectory,
    est: Trajectory,
    *,
    settings: ScoreSettings = DEFAULTS,
    covariance: Array | None = None,
    metrics: Iterable[MetricDefinition] = tuple(DEFINITIONS.values()),
) -> Score:
    """Score an estimate of the motion of one frame against the truth of the same frame.

    `covariance` (N, 6, 6) of the estimate's poses adds their consistency (see `nees`). A metric without
    samples is left out and a warning says why, never a zero. Raises AlignmentError where no poses match in time.
    """
    of = compare(gt, est, settings, covariance=covariance)
    ate = of.once(absolute)
    asked = [metric for metric in metrics if settings.full or not metric.full or metric in nees.METRICS]
    headlines_first = sorted(asked, key=lambda metric: metric.full)
    samples = tuple(found for metric in headlines_first if len((found := Samples.measured(metric, of)).errors))
    scored = tuple(found.metric(of.settings, n=len(of.matched), of=len(gt)) for found in samples)
    frames = of.matched.pairs.gt
    covered = coverage(gt.t_ns, frames, of=settings.coverage_of)
    slot = slots(gt.t_ns, settings.coverage_of)[frames]
    return Score(
        metrics=scored,
        association=Association(len(frames), len(gt), len(est), settings.max_diff_ns / 1e9),
        coverage=covered,
        failure=failure(ate.trans_m, slot, covered, fail_m=settings.fail_ratio * float(of.distances_m[-1])),
        lost_aware_id=identity(DEFINITIONS["lost_aware"], of.settings, n=len(frames), of=len(gt)),
        alignment=of.alignment,
        warnings=(*_matching_warnings(of, covered), *_missing_warnings(of, scored)),
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
        found = [(part, scored.settings) for scored in scores for part in scored.samples if part.of.id == name]
        ids = {part.metric(settings, n=0, of=0).id for part, settings in found}
        if len(ids) > 1:
            warnings.append(f"{name} is not pooled, for the sequences measure it in different ways: compare their ids")
            continue
        together = _joined([part for part, _ in found])
        metrics.append(together.metric(found[0][1], n=n, of=of))
        lengths += together.per_length(found[0][1])
    return Pooled(tuple(metrics), tuple(lengths), tuple(warnings))


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
    settings = of.settings
    path_m = float(of.distances_m[-1])
    if "rpe_trans" not in present:
        yield f"no relative pose error: no two matched poses are {_delta(settings)} apart"
    if "kitti_t_rel" not in present:
        yield (
            f"no segment error: no two matched poses are more than {min(settings.segment_lengths_m or (0.0,)):g} m of "
            f"path apart; the whole path is {path_m:.3g} m"
        )
    if not path_m:
        yield "no lost-aware score: the truth stands still, so no error can be measured against its path"


def _frames(count: int) -> str:
    return f"{count} frame{'' if count == 1 else 's'}"


def _delta(settings: ScoreSettings) -> str:
    if settings.rpe_unit == "f":
        return _frames(int(settings.rpe_delta))
    return f"{settings.rpe_delta:g} { {'m': 'm', 's': 's', 'd': '°', 'r': 'rad'}[settings.rpe_unit] }"
