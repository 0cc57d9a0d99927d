"""Reads and writes the covariances that an estimator reports, and compares them with its errors."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.nees import consistency, independent_samples, median_interval
from vobench.trajectory.align import Alignment
from vobench.trajectory.stamp_text import format_seconds, stamps_ns
from vobench.trajectory.text_table import content_lines, read_table
from vobench.trajectory.trajectory import Stamps, Trajectory

COVARIANCE = "covariance.txt"
UPPER = np.triu_indices(6)
ENTRIES = tuple(f"c{row}{column}" for row, column in zip(*UPPER, strict=True))
COLUMNS = ("t", *ENTRIES)
HEAD = "# timestamp, then the upper triangle by rows: position in m, rotation vector in rad, about the axes of odom\n"
# Median and 90 % quantile of χ² with six degrees of freedom.
MEDIAN = 5.348121
NINETY_PERCENT = 10.644641
DEGREES_OF_FREEDOM = 6


def format_covariances(rows: Iterable[tuple[int, Array]]) -> str:
    """Stamps in ns and covariances (6, 6) as text, without loss of digits."""
    lines = [HEAD]
    for t_ns, covariance in rows:
        entries = " ".join(map(repr, covariance[UPPER].tolist()))
        lines.append(f"{format_seconds(t_ns)} {entries}\n")
    return "".join(lines)


def read_covariances(path: Path, t_ns: Stamps) -> Array:
    """The covariances (N, 6, 6) of poses with stamps t_ns (N,), NaN for a pose without one. Raises InputError."""
    try:
        lines = content_lines(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read {path}: {error}") from None
    covariances = np.full((len(t_ns), 6, 6), np.nan)
    if not lines:
        return covariances
    table = read_table(lines, name=str(path), columns=COLUMNS, row="a covariance")
    entries = dict(zip(stamps_ns(table, "s").tolist(), table.values[:, 1:], strict=True))
    if entries.keys().isdisjoint(t_ns.tolist()):
        raise InputError(f"none of {len(entries)} covariances has the stamp of a pose: {path}")
    for covariance, stamp in zip(covariances, t_ns.tolist(), strict=True):
        if stamp in entries:
            covariance[UPPER] = entries[stamp]
            covariance.T[UPPER] = entries[stamp]
    return covariances


class CovarianceConsistency(BaseModel):
    """The consistency of errors with reported covariances, from the NEES of poses.

    `scale_gap` is the square root of the median NEES over that of its distribution, χ² with six degrees of freedom:
    1 for consistent covariances, and within `gap_low` and `gap_high` for 95 % of consistent estimators whose errors are
    as correlated along the path. `covered_90` is the share of poses inside the region that should hold 90 %.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    poses: int
    nees_mean: float
    nees_median: float
    scale_gap: float
    covered_90: float
    gap_low: float = 0.5
    gap_high: float = 2.0

    @classmethod
    def of(cls, nees: Array) -> "CovarianceConsistency":
        """The consistency of normalised errors squared (K,) of at least one pose."""
        median = float(np.median(nees))
        low, high = median_interval(independent_samples(nees), DEGREES_OF_FREEDOM)
        return cls(
            poses=len(nees),
            nees_mean=float(np.mean(nees)),
            nees_median=median,
            scale_gap=(median / MEDIAN) ** 0.5,
            covered_90=float(np.mean(nees <= NINETY_PERCENT)),
            gap_low=(low / MEDIAN) ** 0.5,
            gap_high=(high / MEDIAN) ** 0.5,
        )

    @property
    def sentence(self) -> str:
        """The verdict, and the numbers on which it is based."""
        verdict = "claims what it holds"
        if self.scale_gap > self.gap_high:
            verdict = "claims too much"
        elif self.scale_gap < self.gap_low:
            verdict = "claims too little"
        return (
            f"{verdict}: errors are {self.scale_gap:.2g} x the deviations it states, and {self.gap_low:.2g} to "
            f"{self.gap_high:.2g} x would be consistent (median NEES {self.nees_median:.3g}, {MEDIAN:.3g} by its law; "
            f"the 90 % region holds {self.covered_90:.0%})"
        )


def trial_consistency(
    estimate: Path, gt: Trajectory, est: Trajectory, *, start_ns: int, scale: float
) -> CovarianceConsistency | None:
    """The consistency of a trial's covariances with its errors; None if it reported no covariances.

    The covariances are those of poses in odom, which is the left camera at the first frame, so only the scale is
    fitted. If the truth of that frame is unknown, the first frame with truth and pose is the reference instead.
    """
    if not (estimate / COVARIANCE).is_file():
        return None
    covariances = read_covariances(estimate / COVARIANCE, est.t_ns)
    with_covariance = np.flatnonzero(np.isfinite(covariances).all((1, 2)))
    _, in_gt, in_stated = np.intersect1d(gt.t_ns, est.t_ns[with_covariance], return_indices=True)
    if not len(in_gt):
        return None
    in_est = with_covariance[in_stated]

    T_world_odom = gt.T_world_frame[0]
    if gt.t_ns[0] != start_ns:
        T_odom_left = est.T_world_frame[in_est[0]]
        scaled_T_odom_left = se3.transform(T_odom_left[:3, :3], scale * T_odom_left[:3, 3])
        T_world_odom = gt.T_world_frame[in_gt[0]] @ se3.inverse(scaled_T_odom_left)
    T_odom_true = (se3.inverse(T_world_odom) @ gt.T_world_frame)[in_gt]
    alignment = Alignment("scale", np.eye(3), np.zeros(3), scale, ())
    nees = consistency(T_odom_true, est.T_world_frame[in_est], covariances[in_est], alignment)
    return CovarianceConsistency.of(nees.pose)
