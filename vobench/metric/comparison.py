"""Comparisons, which are matched and aligned pairs of trajectories, and the definitions of metrics."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.settings import Plane, ScoreSettings, settled
from vobench.trajectory.align import Alignment, align, align_positions
from vobench.trajectory.associate import Matched, match
from vobench.trajectory.stamp_text import format_seconds
from vobench.trajectory.trajectory import Trajectory, step_lengths_m

Found = TypeVar("Found")
DEFAULTS = ScoreSettings()
STILL_M = 1e-4  # TartanAir's script counts a shorter step as no motion


@dataclass(frozen=True, slots=True)
class Comparison:
    """A matched and aligned pair of ground truth and estimate, with all settings.

    `T_aligned` (K, 4, 4) are the aligned poses.
    `T_moving` (K, 4, 4) are the poses whose motions are compared. They differ from `T_aligned` only if `scale_rule`
    gives motions another scale.
    `distances_m` (N,) are the path lengths to the true poses.
    `covariance` (N, 6, 6) are the covariances of the estimated poses, if the estimator reports them.
    """

    gt: Trajectory
    est: Trajectory
    matched: Matched
    alignment: Alignment
    T_aligned: Array
    T_moving: Array
    distances_m: Array
    settings: ScoreSettings
    covariance: Array | None = None
    _results: dict[Any, Any] = field(
        default_factory=dict,
        init=False,
        repr=False,
        compare=False,
    )

    def once(self, work: Callable[["Comparison"], Found]) -> Found:
        """The result of `work` for this comparison, computed on the first call."""
        if work not in self._results:
            self._results[work] = work(self)
        result: Found = self._results[work]
        return result

    def __repr__(self) -> str:
        pairs = f"{len(self.matched)} pairs of {len(self.gt)} true and {len(self.est)} estimated poses"
        return f"Comparison({pairs}, alignment {self.settings.alignment})"


@dataclass(frozen=True, slots=True)
class OverLengths:
    """Errors (N,) of segments or parts of the path, each of a nominal length (N,) in m.

    `drift` (N,) are the errors from which the mean is computed, in 1 or rad/m; they are float32 for KITTI's devkit.
    """

    errors: Array
    length_m: Array
    drift: Any = None


@dataclass(frozen=True, slots=True)
class MetricDefinition:
    """A metric: how it is computed, and what a reader has to know about it.

    `formula` and `source` are its equation and its origin in the literature.
    `settings` are the names of the settings on which it depends.
    `blind` describes the errors that it does not show.
    `headline` is its main statistic.
    `full` is whether it is measured only if all metrics are requested.
    `measure` returns its errors (N,) in its unit. It is None for a metric of recordings instead of poses, such as
    coverage.
    """

    id: str
    title: str
    unit: str
    formula: str
    source: str
    settings: tuple[str, ...]
    blind: str
    headline: str = "rmse"
    full: bool = True
    measure: Callable[[Comparison], Array | OverLengths] | None = None

    @property
    def identity(self) -> str:
        """The beginning of the ids of its results: `ate_trans` becomes `ate.trans`."""
        return self.id.replace("_", ".", 1)

    def as_dict(self) -> dict[str, Any]:
        """The definition without its measure, as plain values."""
        names = [field.name for field in fields(self) if field.name != "measure"]
        return {name: getattr(self, name) for name in names}


# The names of the settings that change poses, and therefore all metrics of poses.
POSES = ("alignment", "align_n", "scale_rule", "project", "association", "max_diff_ns", "offset_ns")
OURS = "this project"
STURM_ATE = "Sturm et al. (2012), section V-B"
STURM_RPE = "Sturm et al. (2012), section V-A"
ZHANG = "Zhang and Scaramuzza (2018), section IV"
HARTLEY = "Hartley et al. (2013), section 4.3; evo's rot_part"


def compare(
    gt: Trajectory,
    est: Trajectory,
    settings: ScoreSettings = DEFAULTS,
    *,
    covariance: Array | None = None,
) -> Comparison:
    """Match and align two trajectories. Raises AlignmentError if no poses match in time."""
    if covariance is not None:
        _require_covariances(covariance, len(est), settings)
    matched = match(
        gt,
        est,
        method=settings.association,
        max_diff_ns=settings.max_diff_ns,
        offset_ns=settings.offset_ns,
    )
    if not len(matched):
        raise AlignmentError(_no_overlap(gt, est, settings))

    alignment, T_aligned, T_moving = _aligned(matched, settings)
    if settings.project:  # poses are projected after the alignment, as in evo
        gt = Trajectory(gt.t_ns, in_plane(gt.T_world_frame, settings.project))
        matched = replace(matched, T_gt=in_plane(matched.T_gt, settings.project))
        T_aligned = in_plane(T_aligned, settings.project)
        T_moving = in_plane(T_moving, settings.project)
    distances_m = gt.distances_m()
    path_m = float(distances_m[-1])
    return Comparison(
        gt=gt,
        est=est,
        matched=matched,
        alignment=alignment,
        T_aligned=T_aligned,
        T_moving=T_moving,
        distances_m=distances_m,
        settings=settled(settings, path_m),
        covariance=covariance,
    )


def _require_covariances(covariance: Array, n: int, settings: ScoreSettings) -> None:
    """Raise AlignmentError for covariances that do not belong to n poses in space."""
    if settings.project:
        raise AlignmentError(f"covariances need poses in space, but the setting project is {settings.project}")
    if covariance.shape != (n, 6, 6):
        raise AlignmentError(f"covariance should be ({n}, 6, 6), one a pose, but is {covariance.shape}")


def _aligned(matched: Matched, settings: ScoreSettings) -> tuple[Alignment, Array, Array]:
    """The alignment, the aligned poses (K, 4, 4), and the poses (K, 4, 4) whose motions are compared."""
    T_est = matched.T_est
    T_gt = matched.T_gt
    if settings.scale_rule == "alignment":
        alignment = align(T_est, T_gt, kind=settings.alignment, first_n=settings.align_n)
        T_aligned = alignment.apply(T_est)
        return alignment, T_aligned, T_aligned

    # TartanAir's rule: poses and motions have different scales, and share the rigid part of the alignment.
    scale = ate_scale(T_gt, T_est)
    T_scaled = se3.transform(T_est[:, :3, :3], scale * T_est[:, :3, 3])
    rigid = align(T_scaled, T_gt, kind=settings.alignment, first_n=settings.align_n)
    alignment = replace(rigid, scale=scale)
    motion_alignment = replace(rigid, scale=motion_scale(T_gt, T_est))
    return alignment, alignment.apply(T_est), motion_alignment.apply(T_est)


def ate_scale(T_gt: Array, T_est: Array) -> float:
    """TartanAir's scale of the estimate (K, 4, 4) before an SE(3) alignment: Σ‖gt‖² / Σ gt·est about the means.

    Umeyama's scale is Σ gt·est / Σ‖est‖², which is never larger. The result is 1 if either side is stationary.
    Source: Wang et al. (2020), the evaluation script.
    """
    gt_m = T_gt[:, :3, 3]
    est_m = T_est[:, :3, 3]
    fit = align_positions(gt_m, est_m, kind="se3")
    if "rotation" in fit.unobservable:
        return 1.0
    centred_est_m = est_m - est_m.mean(axis=0)
    centred_gt_m = gt_m - gt_m.mean(axis=0)
    rotated_gt_m = centred_gt_m @ fit.rotation.T
    return float(np.sum(rotated_gt_m * rotated_gt_m) / np.sum(rotated_gt_m * centred_est_m))


def motion_scale(T_gt: Array, T_est: Array) -> float:
    """TartanAir's scale of the estimate (K, 4, 4) before relative and segment errors are computed.

    It is 1 / mean(step of the estimate / step of the truth), and 1 if either side is stationary.
    Source: Wang et al. (2020), the evaluation script.
    """
    gt_m = step_lengths_m(T_gt[:, :3, 3])
    est_m = step_lengths_m(T_est[:, :3, 3])
    is_moving = gt_m > STILL_M
    if not is_moving.any():
        return 1.0
    mean_ratio = float(np.mean(est_m[is_moving] / gt_m[is_moving]))
    return 1.0 / mean_ratio if mean_ratio > 0 else 1.0


def in_plane(T: Array, plane: Plane) -> Array:
    """Poses (N, 4, 4) projected to a plane through the origin: positions in it, rotations about its normal.

    The angle is the one about the normal of `roll_pitch_yaw_rad`. Source: evo's project_to_plane.
    """
    normal = {"yz": 0, "xz": 1, "xy": 2}[plane]
    angles_rad = se3.roll_pitch_yaw_rad(T[:, :3, :3])[:, normal]
    # A rotation about z becomes one about the normal if its rows and columns are permuted cyclically.
    about_z = se3.rotation_z(angles_rad)
    axes = np.roll(range(3), normal + 1)  # the new places of x, y and z if the normal takes the place of z
    about_normal = about_z[:, axes][:, :, axes]

    is_normal = np.arange(3) == normal
    positions_m = np.where(is_normal, 0.0, T[:, :3, 3])
    return se3.transform(about_normal, positions_m)


def _no_overlap(gt: Trajectory, est: Trajectory, settings: ScoreSettings) -> str:
    """The message that no poses match in time."""
    shift = f" shifted by {settings.offset_ns / 1e9:g} s" if settings.offset_ns else ""
    return (
        f"no pose of the estimate{shift} is within {settings.max_diff_ns / 1e6:g} ms of a ground-truth pose: "
        f"the truth has {_span(gt)}, the estimate {_span(est)}"
    )


def _span(trajectory: Trajectory) -> str:
    """The number of poses and the time that they span, for messages."""
    if not len(trajectory):
        return "no pose"
    first = format_seconds(int(trajectory.t_ns[0]))
    last = format_seconds(int(trajectory.t_ns[-1]))
    return f"{len(trajectory)} poses from {first} s to {last} s"
