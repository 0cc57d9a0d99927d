"""Reads the two paths of a finished trial, its errors, and the conditions of its frames."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vobench.analysis.causes import ErrorSeries
from vobench.analysis.conditions import FEW_TRACKS, conditions
from vobench.analysis.segment_loss import Outcome, loss_between, segment_loss
from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.runner.estimate import ESTIMATE
from vobench.runner.folder import ESTIMATES, SEQUENCE, SURVIVED, RunFolder, TrialScore, read_tum
from vobench.runner.frames import GROUND_TRUTH, read_frames
from vobench.sequence import Sequence
from vobench.suite.case import Case
from vobench.trajectory.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class TrialPaths:
    """Ground truth and estimate of a trial, and the scale that the score's alignment puts on the estimate."""

    gt: Trajectory
    est: Trajectory
    scale: float


def read_paths(folder: RunFolder, score: TrialScore) -> TrialPaths:
    """Read the paths of a trial; the estimate is empty if it has no pose."""
    gt = read_tum(folder.case(score.case) / GROUND_TRUTH)
    est = read_tum(folder.estimate(score.case, score.estimator, score.repeat) / ESTIMATE)
    scale = float(score.score["alignment"]["scale"]) if score.score else 1.0
    return TrialPaths(gt, est, scale)


def read_outcome(folder: RunFolder, score: TrialScore) -> Outcome:
    """Read how a trial ended and its error in each segment of the path."""
    paths = read_paths(folder, score)
    survived = score.status in SURVIVED
    return Outcome(score.status, survived, segment_loss(paths.gt, paths.est, scale=paths.scale))


def read_error_series(folder: RunFolder, score: TrialScore, frame_conditions: Mapping[str, Array]) -> ErrorSeries:
    """Read the error of a trial frame by frame; `frame_conditions` are those of its case, by `read_conditions`."""
    paths = read_paths(folder, score)
    every_frame = np.arange(len(paths.gt))
    loss = loss_between(paths.gt, paths.est, every_frame, scale=paths.scale)
    loss = np.append(0.0, loss)  # the first frame has no predecessor
    return ErrorSeries(
        score.case,
        score.repeat,
        frame_conditions,
        loss,
        place=score.variant.get("scene", ""),
        drive=score.variant.get("trajectory", ""),
    )


def read_symptoms(folder: RunFolder, score: TrialScore) -> dict[str, Array]:
    """Read what an estimator reports of the frames (N,) of a trial, by name; empty if it does not report it."""
    rows = read_frames(folder.estimate(score.case, score.estimator, score.repeat))
    tracks = [row.tracks for row in rows]
    if all(count is None for count in tracks):
        return {}
    counts = np.array([count or 0 for count in tracks])
    return {FEW_TRACKS: 1 / (1.0 + counts)}


def read_conditions(folder: RunFolder, case: Case) -> dict[str, Array]:
    """Compute the conditions (N,) of the N frames of a case, by their names in `CONDITIONS`.

    Raises InputError if the sequence of the case is no longer in the cache.
    """
    link = folder.case(case.name) / SEQUENCE
    if not link.exists():
        raise InputError(f"the sequence is gone from the cache; run the suite again to recreate it: {link}")

    # The exposures of frames are properties of the sequence, so they are the same in the tables of all trials.
    any_trial = next(folder.case(case.name).glob(f"{ESTIMATES}/*/*"))
    exposures = {}
    for row in read_frames(any_trial):
        exposures[row.t_ns] = (row.exposure_s or 0.0, row.gain_db or 0.0)

    gt = read_tum(folder.case(case.name) / GROUND_TRUTH)
    return conditions(case, gt, Sequence.open(link).frames(), exposures)
