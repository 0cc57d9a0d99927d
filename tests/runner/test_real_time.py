"""At the camera's pace: what comes while an estimator is busy is lost to it, and the board says so."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.estimator.process import EstimatorProcess
from vobench.runner import estimate as estimate_file
from vobench.runner.estimate import DROPPED
from vobench.runner.frames import read_frames

BOTH = ("estimators: [wheel_odometry, stand_still]", "modes: [step, real_time]\nestimators: [wheel_odometry]")
RATE_5 = "tolerance_m: 0.03, rate_hz: 5"
RATE_30 = (RATE_5, "tolerance_m: 0.03, rate_hz: 30")


class Slow(EstimatorProcess):
    """Takes 60 ms for each frame, by the clock of its answers."""

    wall_ms = 60.0

    def process(self, frame):
        return replace(super().process(frame), wall_ms=self.wall_ms)


@pytest.fixture
def slow(monkeypatch):
    monkeypatch.setattr(estimate_file, "EstimatorProcess", Slow)


@pytest.mark.slow
def test_60_ms_at_30_hz_loses_every_other_frame_and_the_board_says_so(bench, slow):
    run = bench.run(BOTH, RATE_30, cache="slow")
    trial = run.estimate("full", "wheel_odometry.real_time", 0)
    statuses = [row.status for row in read_frames(trial)]
    assert len(statuses) > 20
    assert [status == DROPPED for status in statuses] == [bool(index % 2) for index in range(len(statuses))]
    fast, late = (
        next(s for s in run.scores() if s.estimator == f"wheel_odometry{tail}") for tail in ("", ".real_time")
    )
    assert (fast.status, late.status) == ("ok", "partial")
    dropped = len(statuses) // 2
    assert late.reason == f"it was too late for {dropped} of {len(statuses)} frames"
    assert late.coverage == pytest.approx(1 - dropped / len(statuses))
    board = (run.path / "leaderboard.md").read_text()
    assert "| wheel_odometry.real_time [real time] |" in board
    said = f"real time: {dropped} deadlines missed, {dropped} of {len(statuses)} frames dropped"
    assert f"wheel_odometry.real_time: {said}" in board
    # Nothing that was measured on the way is lost with a frame: the wheels' path ends where it did.
    assert late.value("ate_trans", "rmse") == pytest.approx(fast.value("ate_trans", "rmse"), abs=1e-3)


def test_who_is_in_time_loses_nothing(bench, first):
    run = bench.run(BOTH)
    scores = {score.estimator: score for score in run.scores() if score.case == "full"}
    assert scores["wheel_odometry.real_time"].status == "ok"
    assert scores["wheel_odometry.real_time"].score == scores["wheel_odometry"].score
    assert "deadline" not in (run.path / "leaderboard.md").read_text()


@pytest.mark.slow
def test_the_readings_of_lost_frames_come_with_the_next(bench, slow):
    folder = bench.run(BOTH, RATE_30, cache="slow").estimate("full", "wheel_odometry.real_time", 0)
    assert np.isfinite([row.position_error_m for row in read_frames(folder) if row.status != DROPPED]).all()
