"""A short run with a loss in its middle."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import stereo_rig
from vobench.sequence import EncodedFrame
from vobench.trajectory.trajectory import Trajectory
from vobench.viewer import RunView, save_run

COUNT, LOST = 12, (5, 6)
RIG = stereo_rig(Pinhole(48, 32, 40.0, 40.0, 23.5, 15.5), pitch_deg=20)


def make_run() -> RunView:
    t_ns = np.arange(COUNT) * 1_000_000_000 // 30
    turn = np.linspace(0, 1, COUNT)
    body = se3.transform(se3.rotation_z(turn), np.stack([3 * np.sin(turn), 3 - 3 * np.cos(turn), 0 * turn], -1))
    truth = Trajectory(t_ns, body).of_mounted(RIG.T_body_left)
    kept = np.setdiff1d(np.arange(COUNT), LOST)
    estimate = Trajectory(t_ns[kept], se3.transform(np.eye(3), [0.1, 0, 0]) @ truth.T_world_frame[kept])
    png = cv2.imencode(".png", np.full((32, 48), 99, np.uint8))[1].tobytes()
    tracks = {i: (np.array([[0.0, 0.0], [3.0, 2.0], [47.0, 31.0]]), np.array([True, True, False])) for i in (1, 3)}
    return RunView(
        title="room × stereo × 0",
        rig=RIG,
        frames=lambda: (EncodedFrame(i, int(t), "png", png, png) for i, t in enumerate(t_ns)),
        ground_truth=truth,
        estimate=estimate,
        error_t_ns=estimate.t_ns,
        error_m=np.full(len(kept), 0.1),
        statuses=["lost" if i in LOST else "ok" for i in range(COUNT)],
        tracks=tracks,
        summary_md="# score",
    )


@pytest.fixture(scope="session")
def run() -> RunView:
    return make_run()


@pytest.fixture(scope="session")
def rrd(run: RunView, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("viewer") / "run.rrd"
    save_run(path, run)
    return path
