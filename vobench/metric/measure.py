"""Every metric of two trajectories laid side by side, by the names of `DEFINITIONS`."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from vobench.geometry.se3 import Array
from vobench.metric.ate import absolute_matrix_errors, axis_errors
from vobench.metric.definitions import DEFINITIONS
from vobench.metric.identity import identity
from vobench.metric.pairs import IndexPairs, select_pairs
from vobench.metric.pose_error import PoseErrors
from vobench.metric.relative import part_errors, relative_lengths
from vobench.metric.rpe import distance_errors, relative_errors, relative_matrix_errors, tum_errors
from vobench.metric.scale import scale_errors
from vobench.metric.segment import SegmentErrors, devkit_distances, mean_drift, segment_errors
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
class Comparison:
    """Truth and estimate as matched and aligned, with settings that leave nothing open.

    T_aligned is (K, 4, 4), distances_m (N,) the true path to each pose of the truth.
    """

    gt: Trajectory
    est: Trajectory
    matched: Matched
    alignment: Alignment
    T_aligned: Array
    distances_m: Array
    settings: ScoreSettings

    def __repr__(self) -> str:
        matched = f"{len(self.matched)} pairs of {len(self.gt)} true and {len(self.est)} estimated poses"
        return f"Comparison({matched}, alignment {self.settings.alignment})"

    def metric(self, name: str, errors: Array, *, mean: float | None = None) -> Iterator[Metric]:
        """The metric of errors (N,) in its own unit, none where N is 0; `mean` replaces the plain mean."""
        if not len(errors):
            return
        defined = DEFINITIONS[name]
        found = statistics(errors, ddof=self.settings.std_ddof)
        if mean is not None:
            found = replace(found, mean=mean)
        metric = f"{defined.identity}.{defined.headline}"
        text = identity(metric, self.settings, n=len(self.matched), of=len(self.gt))
        yield Metric(text, name, defined.unit, found)


def measured(of: Comparison, ate: PoseErrors) -> Iterator[Metric]:
    """The headline metrics, and with `full` the others; those without samples are left out."""
    pairs = _rpe_pairs(of)
    segments = _segments(of)
    yield from of.metric("ate_trans", ate.trans_m)
    yield from of.metric("ate_rot", np.rad2deg(ate.rot_rad))
    rpe = _rpe(of, pairs)
    yield from of.metric("rpe_trans", rpe.trans_m)
    yield from of.metric("rpe_rot", np.rad2deg(rpe.rot_rad))
    yield from _drift(of, segments)
    if of.settings.full:
        yield from _more_absolute(of)
        yield from _more_relative(of, pairs)
        yield from _parts(of)
        yield from _scale(of, segments)


def _rpe_pairs(of: Comparison) -> IndexPairs:
    s = of.settings
    return select_pairs(
        of.matched.T_gt if s.rpe_pairs_from == "gt" else of.T_aligned,
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
    return relative_errors(of.matched.T_gt, of.T_aligned, pairs)


def _segments(of: Comparison) -> SegmentErrors:
    s = of.settings
    return segment_errors(
        of.matched.T_gt,
        of.T_aligned,
        of.matched.pairs.gt,
        devkit_distances(of.gt.positions_m) if s.segment_precision == "devkit" else of.distances_m,
        lengths_m=s.segment_lengths_m or (),
        step_frames=s.segment_step_frames or 1,
        precision=s.segment_precision,
    )


def _drift(of: Comparison, segments: SegmentErrors) -> Iterator[Metric]:
    if not len(segments):
        return
    how = of.settings.segment_mean
    trans, rot = (mean_drift(e, segments.length_m, mean=how) for e in (segments.trans_ratio, segments.rot_radpm))
    yield from of.metric("kitti_t_rel", segments.trans_ratio, mean=trans)
    yield from of.metric("kitti_r_rel", np.rad2deg(segments.rot_radpm, dtype=float), mean=float(np.rad2deg(rot)))


def _more_absolute(of: Comparison) -> Iterator[Metric]:
    norms = absolute_matrix_errors(of.matched.T_gt, of.T_aligned)
    yield from of.metric("ate_rot_chordal", norms.rot)
    yield from of.metric("ate_full", norms.full)
    axes = axis_errors(of.matched.T_gt, of.T_aligned)
    for name, errors in zip("xyz", axes.xyz_m.T, strict=True):
        yield from of.metric(f"ate_{name}", errors)
    for name, errors in zip(("roll", "pitch", "yaw"), np.rad2deg(axes.rpy_rad).T, strict=True):
        yield from of.metric(f"ate_{name}", errors)


def _more_relative(of: Comparison, pairs: IndexPairs) -> Iterator[Metric]:
    if of.settings.rpe_rule == "tum":  # their script pairs other poses, and has no other forms
        return
    norms = relative_matrix_errors(of.matched.T_gt, of.T_aligned, pairs)
    yield from of.metric("rpe_rot_chordal", norms.rot)
    yield from of.metric("rpe_full", norms.full)
    distances = distance_errors(of.matched.T_gt, of.T_aligned, pairs)
    yield from of.metric("rpe_point", distances.point_m)
    yield from of.metric("rpe_point_percent", distances.percent)


def _parts(of: Comparison) -> Iterator[Metric]:
    rule = of.settings.relative_rule
    T_gt = of.matched.T_gt
    path_m = float(np.linalg.norm(np.diff(T_gt[:, :3, 3], axis=0), axis=1).sum())
    errors = part_errors(T_gt, of.T_aligned, relative_lengths(path_m, rule), rule=rule)
    rot_deg = np.rad2deg(errors.rot_rad)
    yield from of.metric("rel_trans", errors.trans_m)
    yield from of.metric("rel_trans_percent", 100 * errors.trans_m / errors.length_m)
    yield from of.metric("rel_rot", rot_deg)
    yield from of.metric("rel_rot_per_m", rot_deg / errors.length_m)
    yield from of.metric("rel_yaw", np.rad2deg(errors.yaw_rad))
    yield from of.metric("rel_gravity", np.rad2deg(errors.gravity_rad))


def _scale(of: Comparison, segments: SegmentErrors) -> Iterator[Metric]:
    frames = of.matched.pairs.gt
    first, last = (np.searchsorted(frames, ends) for ends in (segments.first, segments.last))
    found = scale_errors(of.matched.T_gt, of.T_aligned, of.distances_m[frames], first, last)
    yield from of.metric("scale_error", found.error)
    if len(found):
        yield from of.metric("scale_drift", np.array([found.drift_per_m]))
