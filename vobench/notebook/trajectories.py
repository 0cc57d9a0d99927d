"""Trajectories of any form, their scores, and what is wrong between two of them."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from vobench.analysis import diagnose as diagnosis
from vobench.analysis.diagnose import Finding
from vobench.metric import score as scoring
from vobench.metric.comparison import DEFAULTS
from vobench.metric.score import Score
from vobench.metric.settings import ScoreSettings
from vobench.runner.trajectory_pair import TrajectoryPair, TrajectorySource, read_one, read_pair
from vobench.trajectory.formats import Reading
from vobench.trajectory.trajectory import Trajectory

Given = Trajectory | Path | str


def read_trajectory(
    path: Path | str, *, topic: str | None = None, read_as: Iterable[str] = (), times: Path | str | None = None
) -> Trajectory:
    """The trajectory in a file of any form, or the true path of a sequence's left camera.

    `topic` chooses among a recording's; `read_as` are the words of `--gt-as`, such as ns or wxyz; `times` is a file
    of stamps for forms without (KITTI, TartanAir). Raises InputError.
    """
    return read_one(TrajectorySource(Path(path), topic, tuple(read_as)), times=_paths(times)).trajectory


def score(gt: Given, est: Given, *, settings: ScoreSettings = DEFAULTS, times: Path | str | None = None) -> Score:
    """Score an estimate against ground truth, each a trajectory or its file, as `vobench score` does.

    `settings=LIKE["evo"]` measures as evo would. Raises InputError or AlignmentError.
    """
    pair = _pair(gt, est, times)
    scored = scoring.score(pair.gt.trajectory, pair.est.trajectory, settings=settings)
    notes = (*pair.notes, pair.by_frame) if pair.by_frame else pair.notes
    return replace(scored, warnings=(*notes, *scored.warnings))


def diagnose(gt: Given, est: Given, *, times: Path | str | None = None) -> tuple[Finding, ...]:
    """What is wrong between two trajectories or their files; nothing where they only differ by errors.

    Files tell more than trajectories: in which unit their stamps and in which order their quaternions were written.
    Raises InputError or AlignmentError.
    """
    pair = _pair(gt, est, times, any_unit=True)
    return diagnosis.diagnose(pair.gt, pair.est)


def _pair(gt: Given, est: Given, times: Path | str | None, *, any_unit: bool = False) -> TrajectoryPair:
    if isinstance(gt, Trajectory) or isinstance(est, Trajectory):
        return TrajectoryPair(_reading(gt, times, any_unit=any_unit), _reading(est, times, any_unit=any_unit))
    return read_pair(TrajectorySource(Path(gt)), TrajectorySource(Path(est)), times=_paths(times), any_unit=any_unit)


def _reading(given: Given, times: Path | str | None, *, any_unit: bool) -> Reading:
    if isinstance(given, Trajectory):
        return Reading(given, unit="ns", form_unit="ns", order=None)
    return read_one(TrajectorySource(Path(given)), times=_paths(times), any_unit=any_unit)


def _paths(file: Path | str | None) -> tuple[Path, ...]:
    return () if file is None else (Path(file),)
