"""Scores trajectory files: estimates of one ground truth side by side, or several sequences separately and pooled."""

import shlex
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vobench.errors import AlignmentError, InputError
from vobench.geometry.se3 import Array
from vobench.metric.comparison import DEFAULTS, MetricDefinition
from vobench.metric.definitions import DEFINITIONS
from vobench.metric.score import MetricResult, Pooled, Score, pooled, score
from vobench.metric.settings import ScoreSettings
from vobench.runner.data_frame import data_frame
from vobench.runner.metric_catalog import all_metrics
from vobench.runner.trajectory_pair import TrajectorySource, read_pair

if TYPE_CHECKING:
    from vobench.runner.consistency import CovarianceConsistency
    from vobench.runner.data_frame import DataFrame

NEES = "nees_pose"
UNFITTED = ("none", "origin")  # alignments that use no pose but the first
START_SHARE = 0.1  # of the largest variance: a smaller first one is the start of odometry
ALL_TOGETHER = "pooled"  # what the rows of all sequences together are called


@dataclass(frozen=True, slots=True)
class FilePair:
    """The ground truth, the estimate and, if they are reported, the covariances of one sequence, as files."""

    gt: TrajectorySource
    est: TrajectorySource
    covariance: Path | None = None


@dataclass(frozen=True, slots=True)
class ScoredPair:
    """The score of one pair of files.

    `consistency` compares errors with the reported covariances. `by_frame` says how poses were paired if neither file
    has stamps. `notes` say how the files were read.
    """

    pair: FilePair
    score: Score
    consistency: "CovarianceConsistency | None" = None
    by_frame: str | None = None
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench score --json` prints them for one pair."""
        content = self.score.as_dict()
        if self.consistency:
            content["consistency"] = {**self.consistency.model_dump(), "sentence": self.consistency.sentence}
        if self.by_frame:
            content["warnings"] = [self.by_frame, *content["warnings"]]
        content["notes"] = list(self.notes)
        content["per_length"] = [row.as_dict() for row in self.score.per_length]
        return content


@dataclass(frozen=True, slots=True)
class ScoredFiles:
    """The scores of pairs of files.

    If the pairs are sequences of one estimator, `pool` is the score of all their errors together. If they are several
    estimates of one ground truth, it is None.
    """

    pairs: tuple[ScoredPair, ...]
    pool: Pooled | None = None

    @property
    def scores(self) -> tuple[Score, ...]:
        """The score of each pair."""
        return tuple(scored.score for scored in self.pairs)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench score --json` prints them."""
        if len(self.pairs) == 1:
            return self.pairs[0].as_dict()
        if self.pool is None:
            estimates = [{"est": str(scored.pair.est.path), **scored.as_dict()} for scored in self.pairs]
            return {"gt": str(self.pairs[0].pair.gt.path), "estimates": estimates}
        sequences = []
        for scored in self.pairs:
            files = {"gt": str(scored.pair.gt.path), "est": str(scored.pair.est.path)}
            sequences.append({**files, **scored.as_dict()})
        together = {
            "metrics": [metric.as_dict() for metric in self.pool.metrics],
            "per_length": [row.as_dict() for row in self.pool.per_length],
            "warnings": list(self.pool.warnings),
        }
        return {"sequences": sequences, "pooled": together}

    def to_frame(self) -> "DataFrame":
        """A pandas table with one row per estimate and metric, then one per metric of all sequences together.

        The first column is `sequence`, or `estimate` if all estimates are of one ground truth.
        """
        is_comparison = len(self.pairs) > 1 and self.pool is None
        heading = "estimate" if is_comparison else "sequence"
        return data_frame({heading: name, **metric.as_dict()} for name, metric in self._metrics())

    def _metrics(self) -> Iterator[tuple[str, MetricResult]]:
        """All metrics, with the names of their estimates."""
        for scored in self.pairs:
            for metric in scored.score.metrics:
                yield str(scored.pair.est.path), metric
        if self.pool is not None:
            for metric in self.pool.metrics:
                yield ALL_TOGETHER, metric

    def require_finite(self) -> None:
        """Raise AlignmentError if a statistic is infinite or not a number."""
        for _, metric in self._metrics():
            for name, value in asdict(metric.statistics).items():
                if not isfinite(value):
                    raise AlignmentError(f"the {name} of {metric.name} is {value}: positions are too far apart")


def score_files(
    pairs: Sequence[FilePair], *, settings: ScoreSettings = DEFAULTS, times: Sequence[Path] = (), pool: bool = True
) -> ScoredFiles:
    """Score estimates against ground truth.

    Several pairs are sequences whose errors are also pooled; with `pool=False` they are estimates to be compared.
    With `settings.full`, installed metrics are measured too. `times` are files of stamps for files without (KITTI).

    Raises:
        InputError: a file cannot be read, or the two files of a pair do not fit together.
        AlignmentError: a pair cannot be compared as asked, or an error is not finite.
    """
    if not pairs:
        raise InputError("there should be one pair of files or more, got none")
    metrics = all_metrics() if settings.full else tuple(DEFINITIONS.values())
    scored = tuple(_score_pair(pair, settings, times, metrics) for pair in pairs)
    is_pooled = pool and len(scored) > 1
    found = ScoredFiles(scored, pooled([each.score for each in scored]) if is_pooled else None)
    found.require_finite()
    return found


def _score_pair(
    pair: FilePair, settings: ScoreSettings, times: Sequence[Path], metrics: Sequence[MetricDefinition]
) -> ScoredPair:
    read = read_pair(pair.gt, pair.est, times=times)
    gt = read.gt.trajectory
    est = read.est.trajectory
    if read.by_frame and settings.rpe_unit == "s":
        raise InputError("a delta in seconds needs stamps, and neither file has any; name one with --times")
    if pair.covariance is None:
        scored = score(gt, est, settings=settings, metrics=metrics)
        return ScoredPair(pair, scored, None, read.by_frame, read.notes)

    from vobench.runner.consistency import CovarianceConsistency, read_covariances

    covariance = read_covariances(pair.covariance, est.t_ns)
    scored = score(gt, est, settings=settings, metrics=metrics, covariance=covariance)
    held = scored
    if settings.alignment not in UNFITTED and _states_drift(covariance):
        # A fit over the whole path would take away part of the drift that the covariances state.
        at_origin = replace(settings, alignment="origin")
        held = score(gt, est, settings=at_origin, metrics=(DEFINITIONS[NEES],), covariance=covariance)
    nees = next(samples.errors for samples in held.samples if samples.of.id == NEES)
    return ScoredPair(pair, scored, CovarianceConsistency.of(nees), read.by_frame, read.notes)


def _states_drift(covariance: Array) -> bool:
    """Whether covariances (N, 6, 6), NaN for none, grow from nearly nothing, as those of odometry do."""
    variances = np.trace(covariance, axis1=1, axis2=2)
    known = variances[np.isfinite(variances)]
    return bool(len(known) and known[0] < START_SHARE * known.max())


def read_pair_list(path: Path) -> list[tuple[Path, Path]]:
    """Read the pairs of files that a list names: ground truth and estimate on each line, # for comments.

    Relative paths start at the folder of the list. Raises InputError.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        cause = getattr(error, "strerror", None) or "not a text in UTF-8"
        raise InputError(f"cannot read {path}: {cause}") from None

    pairs = []
    for number, line in enumerate(lines, 1):
        words = shlex.split(line, comments=True)
        if not words:
            continue
        if len(words) != 2:
            raise InputError(f"{path}:{number}: a line should name a truth and an estimate, but has {len(words)} words")
        gt, est = words
        pairs.append((path.parent / gt, path.parent / est))
    if not pairs:
        raise InputError(f"no line names a truth and an estimate: {path}")
    return pairs
