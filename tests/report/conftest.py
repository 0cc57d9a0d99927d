"""Runs made by hand: scores and the few files that reports read."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import stereo_rig
from vobench.report.leaderboard import make_board
from vobench.report.rerun import save_trial
from vobench.report.trial_view import TrialView
from vobench.runner import estimate as estimate_file
from vobench.runner.environment import Environment, Processor
from vobench.runner.folder import NO_SEQUENCE, SCORE, RunFolder, TrialScore
from vobench.runner.frames import COLUMNS, FRAMES, GROUND_TRUTH, TIME_COLUMNS, TIMES, new_table
from vobench.runner.store import write_json
from vobench.sequence import EncodedFrame
from vobench.trajectory.align import Alignment
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

IDENTITY = Alignment("none", np.eye(3), np.zeros(3), 1.0, ()).as_dict()


def make_score(estimator: str, status: str = "ok", *, ate_m: float | None = 0.1, **changes: object) -> TrialScore:
    metrics = [] if ate_m is None else [{"name": "ate_trans", "rmse": ate_m}]
    facts = {
        "case": "down",
        "variant": {"rig": "down"},
        "repeat": 0,
        "reason": "" if status == "ok" else "it went dark",
        "coverage": 1.0,
        "frames": 3,
        "path_m": 1.0,
        "score": None if ate_m is None else {"metrics": metrics, "alignment": IDENTITY},
        **changes,
    }
    return TrialScore(estimator=estimator, status=status, **facts)


def make_run(path: Path, scores: list[TrialScore]) -> RunFolder:
    folder = RunFolder(path)
    T = np.tile(np.eye(4), (3, 1, 1))
    T[:, 0, 3] = [0.0, 0.5, 1.0]
    path_text = format_tum(Trajectory(np.arange(3, dtype=np.int64), T))
    for score in scores:
        place = folder.estimate(score.case, score.estimator, score.repeat)
        place.mkdir(parents=True)
        (folder.case(score.case) / GROUND_TRUTH).write_text(path_text)
        (place / estimate_file.ESTIMATE).write_text(path_text if score.score else "")
        with new_table(place / FRAMES, COLUMNS) as frames, new_table(place / TIMES, TIME_COLUMNS) as times:
            frames.writerow({"frame": 0, "t_ns": 0, **({"status": "ok", "stats": "{}"} if score.score else {})})
            if score.score:
                times.writerow({"frame": 0, "wall_ms": 1.0, "cpu_ms": 2.0, "memory_mib": 3.0})
        write_json(place / SCORE, score.model_dump(mode="json"))
    return folder


@pytest.fixture
def scored() -> Callable[..., TrialScore]:
    """Makes a score."""
    return make_score


@pytest.fixture
def write_run() -> Callable[..., RunFolder]:
    """Writes scores and the files around them."""
    return make_run


@pytest.fixture
def mixed() -> list[TrialScore]:
    """Two cases; one estimator survives both, one loses a case, one dies twice; names and reasons that need care."""
    return [
        make_score("good_one", ate_m=0.002),
        make_score("good_one", ate_m=0.001, case="ahead"),
        make_score("mad", "diverged", ate_m=1e-9),
        make_score("mad", ate_m=1e-9, case="ahead"),
        make_score("dead", "crashed", ate_m=None, coverage=0.0, reason="ValueError: <b>|x|</b> & ° \\n 100 %"),
        make_score("dead", "out_of_memory", ate_m=None, coverage=0.0, case="ahead"),
    ]


@pytest.fixture
def run(tmp_path: Path, mixed: list[TrialScore]) -> RunFolder:
    """The same as a folder."""
    return make_run(tmp_path / "suite" / "stamp", mixed)


COUNT, LOST = 12, (5, 6)
RIG = stereo_rig(Pinhole(48, 32, 40.0, 40.0, 23.5, 15.5), pitch_deg=20)


def make_run_viewer() -> TrialView:
    t_ns = np.arange(COUNT) * 1_000_000_000 // 30
    turn = np.linspace(0, 1, COUNT)
    body = se3.transform(se3.rotation_z(turn), np.stack([3 * np.sin(turn), 3 - 3 * np.cos(turn), 0 * turn], -1))
    truth = Trajectory(t_ns, body).of_mounted(RIG.T_body_left)
    kept = np.setdiff1d(np.arange(COUNT), LOST)
    estimate = Trajectory(t_ns[kept], se3.transform(np.eye(3), [0.1, 0, 0]) @ truth.T_world_frame[kept])
    png = cv2.imencode(".png", np.full((32, 48), 99, np.uint8))[1].tobytes()
    tracks = {i: (np.array([[0.0, 0.0], [3.0, 2.0], [47.0, 31.0]]), np.array([True, True, False])) for i in (1, 3)}
    return TrialView(
        title="room × stereo × 0",
        rig=RIG,
        frames=lambda: (EncodedFrame(i, int(t), "png", png, png) for i, t in enumerate(t_ns)),
        ground_truth=truth,
        estimate=estimate,
        error_m=np.where(np.isin(np.arange(COUNT), kept), 0.1, np.nan),
        statuses=["lost" if i in LOST else "ok" for i in range(COUNT)],
        tracks=tracks,
        summary_md="# score",
    )


@pytest.fixture(scope="session")
def run_viewer() -> TrialView:
    return make_run_viewer()


@pytest.fixture(scope="session")
def rrd(run_viewer: TrialView, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("viewer") / "run.rrd"
    save_trial(path, run_viewer)
    return path


@pytest.fixture
def incomplete(scored):
    """Two estimators on a case that was simulated, and on three that were not, for two causes."""
    causes = {"dark": "no light", "dim": "no light", "far": "too far"}
    return [
        scored(name, case=case, ate_m=ate_m)
        if case == "down"
        else scored(name, NO_SEQUENCE, case=case, ate_m=None, reason=causes[case])
        for name, ate_m in (("a", 0.01), ("b", 0.02))
        for case in ("down", *causes)
    ]


@pytest.fixture
def placed(scored):
    """A board of which is known where it was made."""
    here = Environment(
        vobench="1.0", processors=(Processor("Some_CPU 9", "x86-64-v3"),), drawn_by=("pipe & co",), date="2026-11-24"
    )
    return make_board([scored("a"), scored("b")], {}, environment=here)
