"""The covariances that an estimator states of its poses: as a file, and against the errors that it made."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.metric.nees import consistency
from vobench.trajectory.align import Alignment
from vobench.trajectory.formats import content, read_table, seconds, stamps_ns
from vobench.trajectory.trajectory import Stamps, Trajectory

COVARIANCE = "covariance.txt"
UPPER = np.triu_indices(6)
COLUMNS = ("t", *(f"c{row}{column}" for row, column in zip(*UPPER, strict=True)))
HEAD = "# timestamp, then the upper triangle by rows: position in m, rotation vector in rad, about the axes of odom\n"
# Median and 90 % quantile of χ² with six degrees of freedom.
MEDIAN = 5.348121
NINETY_PERCENT = 10.644641
MOST_GAP = 2.0  # an honest estimator's whole path has one error more or less: 2 and 1/2 are beyond 95 % of such


def format_covariances(rows: Iterable[tuple[int, Array]]) -> str:
    """Stamps in ns and covariances (6, 6) as text that gives the same numbers back."""
    return HEAD + "".join(f"{seconds(t)} {' '.join(map(repr, P[UPPER].tolist()))}\n" for t, P in rows)


def read_covariances(path: Path, t_ns: Stamps) -> Array:
    """The covariances (N, 6, 6) of poses stamped t_ns (N,), NaN for a pose without. Raises InputError."""
    try:
        rows = content(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read {path}: {error}") from None
    P = np.full((len(t_ns), 6, 6), np.nan)
    if not rows:
        return P
    table = read_table(rows, name=str(path), columns=COLUMNS, row="a covariance")
    at = {t: row for row, t in enumerate(stamps_ns(table, "s").tolist())}
    if not any(t in at for t in t_ns.tolist()):
        raise InputError(f"none of {len(at)} covariances has the stamp of a pose: {path}")
    for pose, row in ((pose, at[t]) for pose, t in enumerate(t_ns.tolist()) if t in at):
        P[pose][UPPER] = table.values[row, 1:]
        P[pose].T[UPPER] = table.values[row, 1:]
    return P


class Consistency(BaseModel):
    """Errors against stated covariances: NEES of poses, and the factor that errors are larger than deviations stated.

    `scale_gap` is the square root of the median NEES over that of its law, χ² with six degrees of freedom: 1 where
    covariances are honest. `covered_90` is the share of poses inside the region that should hold 90 %.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    poses: int
    nees_mean: float
    nees_median: float
    scale_gap: float
    covered_90: float

    @classmethod
    def of(cls, nees: Array) -> "Consistency":
        """That of the normalised errors (K,) of one pose or more."""
        median = float(np.median(nees))
        return cls(
            poses=len(nees),
            nees_mean=float(np.mean(nees)),
            nees_median=median,
            scale_gap=(median / MEDIAN) ** 0.5,
            covered_90=float(np.mean(nees <= NINETY_PERCENT)),
        )

    @property
    def sentence(self) -> str:
        """The verdict and what it rests on."""
        verdict = "claims what it holds"
        if self.scale_gap > MOST_GAP:
            verdict = "claims too much"
        elif self.scale_gap < 1 / MOST_GAP:
            verdict = "claims too little"
        return (
            f"{verdict}: errors are {self.scale_gap:.2g} x the deviations it states (median NEES "
            f"{self.nees_median:.3g}, {MEDIAN:.3g} by its law; the 90 % region holds {self.covered_90:.0%})"
        )


def trial_consistency(
    estimate: Path, gt: Trajectory, est: Trajectory, *, start_ns: int, scale: float
) -> Consistency | None:
    """What a trial's covariances are worth; None where it stated none.

    They are of poses in odom, the left camera at the first frame's stamp, so nothing is fitted but the scale. Where
    the truth of that is not known, the first frame that has truth and pose stands for it.
    """
    if not (estimate / COVARIANCE).is_file():
        return None
    P = read_covariances(estimate / COVARIANCE, est.t_ns)
    _, true, stated = np.intersect1d(gt.t_ns, est.t_ns[np.isfinite(P).all((1, 2))], return_indices=True)
    if not len(true):
        return None
    which = np.flatnonzero(np.isfinite(P).all((1, 2)))[stated]
    T_world_odom = gt.T_world_frame[0]
    if gt.t_ns[0] != start_ns:
        T_odom_left = est.T_world_frame[which[0]]
        T_odom_left = se3.transform(T_odom_left[:3, :3], scale * T_odom_left[:3, 3])
        T_world_odom = gt.T_world_frame[true[0]] @ se3.inverse(T_odom_left)
    T_odom_true = (se3.inverse(T_world_odom) @ gt.T_world_frame)[true]
    scaled = Alignment("scale", np.eye(3), np.zeros(3), scale, ())
    return Consistency.of(consistency(T_odom_true, est.T_world_frame[which], P[which], scaled).pose)
