"""Runs made by hand: scores and the few files that reports read."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from vobench.results import estimate_file
from vobench.results.run_folder import GROUND_TRUTH, SCORE, RunFolder, RunScore, write_json
from vobench.trajectory.align import Alignment
from vobench.trajectory.text import format_tum
from vobench.trajectory.trajectory import Trajectory

IDENTITY = Alignment("none", np.eye(3), np.zeros(3), 1.0, ()).as_dict()


def make_score(estimator: str, status: str = "ok", *, ate_m: float | None = 0.1, **changes: object) -> RunScore:
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
    return RunScore(estimator=estimator, status=status, **facts)


def make_run(path: Path, scores: list[RunScore]) -> RunFolder:
    folder = RunFolder(path)
    T = np.tile(np.eye(4), (3, 1, 1))
    T[:, 0, 3] = [0.0, 0.5, 1.0]
    path_text = format_tum(Trajectory(np.arange(3, dtype=np.int64), T))
    for score in scores:
        place = folder.estimate(score.case, score.estimator, score.repeat)
        place.mkdir(parents=True)
        (folder.case(score.case) / GROUND_TRUTH).write_text(path_text)
        (place / estimate_file.ESTIMATE).write_text(path_text if score.score else "")
        (place / estimate_file.FRAMES).write_text(
            ",".join(estimate_file.FrameRow.columns()) + ("\n0,0,ok,,{},1.0,2.0" if score.score else "") + "\n"
        )
        write_json(place / SCORE, score.model_dump(mode="json"))
    return folder


@pytest.fixture
def scored() -> Callable[..., RunScore]:
    """Makes a score."""
    return make_score


@pytest.fixture
def write_run() -> Callable[..., RunFolder]:
    """Writes scores and the files around them."""
    return make_run


@pytest.fixture
def mixed() -> list[RunScore]:
    """Two cases; one estimator survives both, one loses a case, one dies twice; names and reasons that need care."""
    return [
        make_score("good_one", ate_m=0.2),
        make_score("good_one", ate_m=0.1, case="ahead"),
        make_score("mad", "diverged", ate_m=1e-9),
        make_score("mad", ate_m=1e-9, case="ahead"),
        make_score("dead", "crashed", ate_m=None, coverage=0.0, reason="ValueError: <b>|x|</b> & ° \\n 100 %"),
        make_score("dead", "out_of_memory", ate_m=None, coverage=0.0, case="ahead"),
    ]


@pytest.fixture
def run(tmp_path: Path, mixed: list[RunScore]) -> RunFolder:
    """The same as a folder."""
    return make_run(tmp_path / "suite" / "stamp", mixed)
