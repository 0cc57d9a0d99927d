"""A failed trial is shrunk to a suite that still fails in the same way."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.analysis.conftest import NoisyRun
from vobench.analysis import shrink_trial as shrink_trial_module
from vobench.analysis.shrink import Failure
from vobench.analysis.shrink_trial import (
    AccuracyFailure,
    StatusFailure,
    _fails,
    _first_without_pose_ns,
    _likely_windows,
    _part,
    failure_of,
    shrink_trial,
)
from vobench.analysis.trial_data import TrialPaths, read_paths
from vobench.errors import InputError
from vobench.runner.finished_trial import FinishedTrial, read_finished_trial
from vobench.suite.suite import read_plan


@pytest.mark.usefixtures("cheap_pictures")
def test_a_failure_shrinks_to_a_suite_of_its_own(noisy_run: NoisyRun, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("VOBENCH_PATH", str(tmp_path))
    (tmp_path / "estimators").mkdir()
    (tmp_path / "estimators" / "blind").symlink_to(noisy_run.estimator)
    found = shrink_trial(noisy_run.trial("blind"), run_plan=noisy_run.run_plan, trials=2, folder=tmp_path / "small")

    first, end = found.found.window
    assert end - first <= found.frame_count / 2
    assert found.frame_count > found.score.frames  # the trajectory has more frames than came
    assert found.summary.startswith("blind: lost, ")
    assert found.as_dict()["frames"] == [first, end]
    assert found.to_frame()["fails_alike"].tolist() == [fails for _, fails in found.found.tried]

    (case,) = read_plan(str(found.suite)).simulated
    assert case.frames == (first, end)
    (again,) = noisy_run.run_plan(read_plan(str(found.suite))).scores()
    assert again.status == "lost"


def test_a_trial_that_does_not_fail_is_refused_before_anything_is_run(noisy_run: NoisyRun, tmp_path) -> None:
    def never(plan, /):
        raise AssertionError("nothing should be run")

    with pytest.raises(
        InputError, match=r"wheel_odometry on short is ok, with an error of 0\.\d\d% of the path: nothing fails"
    ):
        shrink_trial(noisy_run.trial("wheel_odometry"), run_plan=never, folder=tmp_path / "small")
    assert not (tmp_path / "small").exists()


# --- Windows that are likely to fail ---


@dataclass(frozen=True)
class Row:
    t_ns: int
    status: str


@pytest.fixture
def finished(noisy_run: NoisyRun) -> FinishedTrial:
    return read_finished_trial(noisy_run.trial("wheel_odometry"))


def stamps_of(trial: FinishedTrial) -> dict[int, int]:
    """The stamps of the frames that have a true pose, numbered from 5 on."""
    gt = read_paths(trial.folder, trial.score).gt
    return dict(enumerate(gt.t_ns.tolist(), 5))


@pytest.mark.parametrize("failing", [0, 2, -1])
def test_after_a_crash_windows_with_the_first_frame_without_a_pose_are_likely(finished, monkeypatch, failing) -> None:
    stamps_ns = stamps_of(finished)
    numbers = list(stamps_ns)
    failed = numbers[failing]
    rows = [Row(t_ns, "ok" if number < failed else "") for number, t_ns in stamps_ns.items()]
    monkeypatch.setattr(shrink_trial_module, "read_frames", lambda _: rows)
    crash = StatusFailure(Failure.of("crashed", "it does not say"), "")
    is_likely = _likely_windows(finished, stamps_ns, crash)
    for first in numbers:
        for end in range(first + 1, numbers[-1] + 2):
            assert is_likely((first, end)) == (first <= failed < end), (first, end)


def test_where_every_frame_has_a_pose_the_first_is_taken(finished, monkeypatch) -> None:
    stamps_ns = stamps_of(finished)
    paths = read_paths(finished.folder, finished.score)
    monkeypatch.setattr(shrink_trial_module, "read_frames", lambda _: [Row(t, "ok") for t in stamps_ns.values()])
    assert _first_without_pose_ns(finished, paths) == min(stamps_ns.values())
    lost = [Row(1, "ok"), Row(2, "lost"), Row(3, "")]
    monkeypatch.setattr(shrink_trial_module, "read_frames", lambda _: lost)
    assert _first_without_pose_ns(finished, paths) == 2


def test_windows_are_judged_by_the_poses_that_the_trial_has_in_them(finished: FinishedTrial) -> None:
    stamps_ns = stamps_of(finished)
    first, last = min(stamps_ns), max(stamps_ns)
    as_before = StatusFailure(Failure.of(finished.score.status, finished.score.reason), "")
    is_likely = _likely_windows(finished, stamps_ns, as_before)
    assert finished.score.status == "ok"
    assert is_likely((first, last + 1))
    assert is_likely((first, first + 4))
    assert not is_likely((first, first + 3))  # too short to be judged


def test_a_part_has_the_poses_from_one_stamp_to_another(finished: FinishedTrial) -> None:
    paths = read_paths(finished.folder, finished.score)
    t_ns = paths.gt.t_ns
    part = _part(paths, first_ns=int(t_ns[1]), last_ns=int(t_ns[3]))
    assert part.gt.t_ns.tolist() == t_ns[1:4].tolist()
    np.testing.assert_array_equal(part.gt.T_world_frame, paths.gt.T_world_frame[1:4])
    assert set(part.est.t_ns.tolist()) <= set(t_ns[1:4].tolist())
    assert part.scale == paths.scale


@pytest.mark.parametrize(
    ("status", "reason", "fails"),
    [("ok", "", False), ("partial", "", False), ("partial", "a gap", True), ("lost", "", True), ("crashed", "x", True)],
)
def test_a_partial_trial_fails_if_it_has_a_reason(status: str, reason: str, fails: bool) -> None:
    assert _fails(SimpleNamespace(status=status, reason=reason)) == fails


# --- Failures of accuracy ---


def drifting(paths: TrialPaths, *, from_frame: int) -> TrialPaths:
    """Paths with an estimate whose steps are 40 % too long from some frame on."""
    T = paths.gt.T_world_frame.copy()
    steps_m = np.diff(T[:, :3, 3], axis=0)
    steps_m[from_frame:] *= 1.4
    T[1:, :3, 3] = T[0, :3, 3] + np.cumsum(steps_m, axis=0)
    return TrialPaths(paths.gt, replace(paths.gt, T_world_frame=T), 1.0)


def test_a_trial_that_ends_well_with_a_large_error_fails_in_accuracy(finished, monkeypatch) -> None:
    paths = read_paths(finished.folder, finished.score)
    monkeypatch.setattr(shrink_trial_module, "read_paths", lambda *_: drifting(paths, from_frame=0))
    failure = failure_of(finished)
    assert isinstance(failure, AccuracyFailure)
    assert failure.loss == pytest.approx(0.4, abs=0.05)
    assert failure.summary == f"wheel_odometry: ok, but with an error of {failure.loss:.1%} of the path"


def test_a_part_and_another_trial_fail_alike_from_half_of_the_error_on(finished, monkeypatch) -> None:
    paths = read_paths(finished.folder, finished.score)
    late = drifting(paths, from_frame=len(paths.gt) // 2)
    stamps_ns = paths.gt.t_ns.tolist()
    middle = len(stamps_ns) // 2
    early_part = _part(late, first_ns=stamps_ns[0], last_ns=stamps_ns[middle])
    late_part = _part(late, first_ns=stamps_ns[middle], last_ns=stamps_ns[-1])
    failure = AccuracyFailure(0.2, "")
    assert failure.is_in_part(finished, late_part)
    assert not failure.is_in_part(finished, early_part)

    monkeypatch.setattr(shrink_trial_module, "read_paths", lambda *_: late_part)
    for status, is_alike in (("ok", True), ("partial", True), ("lost", False), ("crashed", False)):
        assert failure.is_in(finished.folder, SimpleNamespace(status=status)) == is_alike
    assert not AccuracyFailure(0.9, "").is_in(finished.folder, SimpleNamespace(status="ok"))


@pytest.mark.usefixtures("cheap_pictures")
def test_a_failure_of_accuracy_shrinks_to_a_part_with_half_of_its_error(noisy_run, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(shrink_trial_module, "MIN_SHRUNK_LOSS", 0.0)
    found = shrink_trial(
        noisy_run.trial("wheel_odometry"), run_plan=noisy_run.run_plan, trials=3, folder=tmp_path / "small"
    )
    first, end = found.found.window
    assert end - first < found.frame_count
    assert "but with an error of" in found.summary
    assert any(fails for _, fails in found.found.tried)
