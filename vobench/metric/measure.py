"""Every metric of two trajectories laid side by side, by the names of `DEFINITIONS`."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.ate import absolute_matrix_errors, axis_errors
from vobench.metric.definitions import DEFINITIONS
from vobench.metric.identity import identity
from vobench.metric.pairs import IndexPairs, every_pair, select_pairs
from vobench.metric.pose_error import PoseErrors
from vobench.metric.relative import part_errors, relative_lengths
from vobench.metric.rpe import distance_errors, relative_errors, relative_matrix_errors, tum_errors
from vobench.metric.scale import scale_errors
from vobench.metric.segment import Float32, SegmentErrors, devkit_distances, mean_drift, segment_errors
from vobench.metric.settings import ScoreSettings
from vobench.metric.statistic import Statistics, statistics
from vobench.trajectory.align import Alignment
from vobench.trajectory.associate import Matched
from vobench.trajectory.trajectory import Trajectory


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
