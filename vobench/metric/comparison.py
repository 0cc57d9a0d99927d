"""Truth and estimate as matched and aligned, and what a metric is: a definition that measures such a comparison."""

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
from vobench.trajectory.formats import seconds
from vobench.trajectory.trajectory import Trajectory

Found = TypeVar("Found")
DEFAULTS = ScoreSettings()
STILL_M = 1e-4  # TartanAir's least step that has a speed


@dataclass(frozen=True, slots=True)
class Comparison:
    """Truth and estimate as matched and aligned, with settings that leave nothing open.

    T_aligned is (K, 4, 4), T_moving (K, 4, 4) the poses whose motions are compared, which differ from them only
    where scale_rule gives motions another scale; distances_m (N,) is the true path to each pose of the truth;
    `covariance` (N, 6, 6) is what the estimator states of its poses, if it does.
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
    _found: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    def once(self, work: Callable[["Comparison"], Found]) -> Found:
        """What `work` finds in this comparison, worked out when it is first asked for."""
        if work not in self._found:
            self._found[work] = work(self)
        found: Found = self._found[work]
        return found

    def __repr__(self) -> str:
        matched = f"{len(self.matched)} pairs of {len(self.gt)} true and {len(self.est)} estimated poses"
        return f"Comparison({matched}, alignment {self.settings.alignment})"


@dataclass(frozen=True, slots=True)
class OverLengths:
    """Errors (N,) of segments or parts of the path, each of a nominal length (N,) in m.

    `drift` (N,): segments' errors as their mean is taken of them, which for the devkit is float32, in 1 or rad/m.
    """

    errors: Array
    length_m: Array
    drift: Any = None


@dataclass(frozen=True, slots=True)
class MetricDefinition:
    """One metric: the settings that change it, what it is blind to, the statistic to quote, and how it is measured.

    `full`: it is measured where every metric is asked for; `measure` gives its errors (N,) in its unit, none
    where there is nothing to measure. What is of recordings and not of poses, such as coverage, measures nothing.
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
        """How the ids of its numbers begin: family.rest."""
        return self.id.replace("_", ".", 1)

    def as_dict(self) -> dict[str, Any]:
        """What there is to say of it, as plain values."""
        return {stated.name: getattr(self, stated.name) for stated in fields(self) if stated.name != "measure"}


# The settings that change poses, which all metrics of poses hang on.
POSES = ("alignment", "align_n", "scale_rule", "project", "association", "max_diff_ns", "offset_ns")
OURS = "this project"
STURM_ATE = "Sturm et al. (2012), section V-B"
STURM_RPE = "Sturm et al. (2012), section V-A"
ZHANG = "Zhang and Scaramuzza (2018), section IV"
HARTLEY = "Hartley et al. (2013), section 4.3; evo's rot_part"


def compare(
    gt: Trajectory, est: Trajectory, settings: ScoreSettings = DEFAULTS, *, covariance: Array | None = None
) -> Comparison:
    """Match and align, ready to be measured. Raises AlignmentError where no poses match in time."""
    if covariance is not None:
        _require_covariances(covariance, len(est), settings)
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
    whole = settled(settings, float(distances_m[-1]))
    return Comparison(gt, est, matched, alignment, T_aligned, T_moving, distances_m, whole, covariance)


def _require_covariances(covariance: Array, n: int, settings: ScoreSettings) -> None:
    if settings.project:
        raise AlignmentError(f"covariances should be of poses in space, but project={settings.project} is asked for")
    if covariance.shape != (n, 6, 6):
        raise AlignmentError(f"covariance should be ({n}, 6, 6), one a pose, but is {covariance.shape}")


def _aligned(matched: Matched, settings: ScoreSettings) -> tuple[Alignment, Array, Array]:
    """The alignment, and the poses (K, 4, 4) that it makes: to compare as they are, and to compare their motions."""
    T_est = matched.T_est
    T_gt = matched.T_gt
    if settings.scale_rule == "alignment":
        alignment = align(T_est, T_gt, kind=settings.alignment, first_n=settings.align_n)
        T_aligned = alignment.apply(T_est)
        return alignment, T_aligned, T_aligned
    scale = ate_scale(T_gt, T_est)
    scaled = se3.transform(T_est[:, :3, :3], scale * T_est[:, :3, 3])
    alignment = replace(align(scaled, T_gt, kind=settings.alignment, first_n=settings.align_n), scale=scale)
    return alignment, alignment.apply(T_est), replace(alignment, scale=motion_scale(T_gt, T_est)).apply(T_est)


def ate_scale(T_gt: Array, T_est: Array) -> float:
    """TartanAir's factor on the estimate (K, 4, 4) before an SE(3) alignment: Σ‖gt‖² / Σ gt·est about the means.

    Umeyama's is Σ gt·est / Σ‖est‖², and never larger; 1 where either side stands still.
    Source: Wang et al. (2020), the evaluation script.
    """
    gt_m = T_gt[:, :3, 3]
    est_m = T_est[:, :3, 3]
    fit = align_positions(gt_m, est_m, kind="se3")
    x = (gt_m - gt_m.mean(axis=0)) @ fit.rotation.T
    y = est_m - est_m.mean(axis=0)
    return 1.0 if "rotation" in fit.unobservable else float(np.sum(x * x) / np.sum(x * y))


def motion_scale(T_gt: Array, T_est: Array) -> float:
    """TartanAir's factor on the estimate (K, 4, 4) before relative and segment errors.

    It is 1 / mean of the estimate's steps over the truth's, 1 where either side stands still.
    Source: Wang et al. (2020), the evaluation script.
    """
    gt_m, est_m = (np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1) for T in (T_gt, T_est))
    moving = gt_m > STILL_M
    ratio = float(np.mean(est_m[moving] / gt_m[moving])) if moving.any() else 0.0
    return 1.0 / ratio if ratio > 0 else 1.0


def in_plane(T: Array, plane: Plane) -> Array:
    """Poses (N, 4, 4) without what leaves a plane of the world: on it, and turned about its normal alone.

    The angle is the normal's one of `roll_pitch_yaw_rad`. Source: evo's project_to_plane.
    """
    normal = {"yz": 0, "xz": 1, "xy": 2}[plane]
    axes = np.roll(range(3), normal + 1)  # where x, y and z stand when the normal takes the place of z
    turned = se3.rotation_z(se3.roll_pitch_yaw_rad(T[:, :3, :3])[:, normal])[:, axes][:, :, axes]
    return se3.transform(turned, np.where(np.arange(3) == normal, 0.0, T[:, :3, 3]))


def _no_overlap(gt: Trajectory, est: Trajectory, settings: ScoreSettings) -> str:
    moved = f" moved by {settings.offset_ns / 1e9:g} s" if settings.offset_ns else ""
    return (
        f"no pose of the estimate{moved} is within {settings.max_diff_ns / 1e6:g} ms of a ground-truth pose: "
        f"the truth has {_span(gt)}, the estimate {_span(est)}"
    )


def _span(trajectory: Trajectory) -> str:
    if not len(trajectory):
        return "no pose"
    first = seconds(int(trajectory.t_ns[0]))
    last = seconds(int(trajectory.t_ns[-1]))
    return f"{len(trajectory)} poses from {first} s to {last} s"
