"""Trajectories in any format, their scores, and a diagnosis of what is wrong between two of them."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from vobench.analysis import diagnose as diagnosis
from vobench.analysis.diagnose import Finding
from vobench.metric import score as scoring
from vobench.metric.comparison import DEFAULTS
from vobench.metric.score import Score
from vobench.metric.settings import ScoreSettings
from vobench.runner.trajectory_pair import TrajectoryPair, TrajectoryReading, TrajectorySource, read_one, read_pair
from vobench.trajectory.trajectory import Trajectory

Given = Trajectory | Path | str


def read_trajectory(
    path: Path | str, *, topic: str | None = None, read_as: Iterable[str] = (), times: Path | str | None = None
) -> Trajectory:
    """The trajectory in a file of any known format, or the true path of a sequence's left camera.

    `topic` selects one of a recording. `read_as` are words as in `--gt-as`, such as ns or wxyz. `times` is a file of
    stamps for formats that have none (KITTI, TartanAir). Raises InputError.
    """
    source = TrajectorySource(Path(path), topic, tuple(read_as))
    return read_one(source, times=_paths(times)).trajectory


def score(gt: Given, est: Given, *, settings: ScoreSettings = DEFAULTS, times: Path | str | None = None) -> Score:
    """Score an estimate against ground truth, each a trajectory or a file, as `vobench score` does.

    `settings=LIKE["evo"]` gives the numbers of evo. Raises InputError or AlignmentError.
    """
    pair = _pair(gt, est, times)
    scored = scoring.score(pair.gt.trajectory, pair.est.trajectory, settings=settings)
    notes = list(pair.notes)
    if pair.by_frame:
        notes.append(pair.by_frame)
    return replace(scored, warnings=(*notes, *scored.warnings))


def diagnose(gt: Given, est: Given, *, times: Path | str | None = None) -> tuple[Finding, ...]:
    """What is wrong between two trajectories or their files; empty if they differ by estimation errors alone.

    Files give more information than trajectories: the unit of their stamps and the order of their quaternions. Raises
    InputError or AlignmentError.
    """
    pair = _pair(gt, est, times, any_unit=True)
    return diagnosis.diagnose(pair.gt, pair.est)


def _pair(gt: Given, est: Given, times: Path | str | None, *, any_unit: bool = False) -> TrajectoryPair:
    if isinstance(gt, Trajectory) or isinstance(est, Trajectory):
        gt_reading = _reading(gt, times, any_unit=any_unit)
        est_reading = _reading(est, times, any_unit=any_unit)
        return TrajectoryPair(gt_reading, est_reading)
    gt_source = TrajectorySource(Path(gt))
    est_source = TrajectorySource(Path(est))
    return read_pair(gt_source, est_source, times=_paths(times), any_unit=any_unit)


def _reading(given: Given, times: Path | str | None, *, any_unit: bool) -> TrajectoryReading:
    if isinstance(given, Trajectory):
        return TrajectoryReading(given, unit="ns", format_unit="ns", order=None)
    source = TrajectorySource(Path(given))
    return read_one(source, times=_paths(times), any_unit=any_unit)


def _paths(file: Path | str | None) -> tuple[Path, ...]:
    return () if file is None else (Path(file),)
