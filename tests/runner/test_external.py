"""Programs of other languages on a board: by command, which reads files, and by stream."""

import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.dataset.rectified_view import rectified
from vobench.geometry import se3
from vobench.geometry.rig import LENSES, PRESETS, ImuCalibration, stereo_rig
from vobench.report import page
from vobench.runner.estimate import DROPPED, ESTIMATE, LOG, estimate, read_outcome
from vobench.runner.folder import read_tum
from vobench.runner.frames import read_frames
from vobench.runner.store import SilentProgress
from vobench.sensor.imu import ImuReadings
from vobench.sequence import SequenceWriter
from vobench.suite.estimator_entry import EstimatorEntry
from vobench.suite.manifest import read_manifest
from vobench.suite.plan import Trial
from vobench.suite.source import RecordedCase, Source
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

ESTIMATORS = "[wheel_odometry, stand_still]"
EXAMPLES = Path(__file__).parents[2] / "examples"
# Follows nothing, but shows what it finds, and writes a pose for each picture.
READS = """
import os, sys
folder, out, form = sys.argv[1:]
print(sorted(os.path.relpath(os.path.join(at, name), folder) for at, _, names in os.walk(folder) for name in names))
if form == "kitti":
    stamps = open(f"{folder}/times.txt").read().split()
elif form == "tum":
    stamps = [line.split()[0] for line in open(f"{folder}/rgb.txt") if line[0] != "#"]
else:
    stamps = [str(int(line.split(",")[0]) / 1e9) for line in open(f"{folder}/mav0/cam0/data.csv") if line[0] != "#"]
open(out, "w").write("".join(f"{t} {float(t)} 0 0 0 0 0 1\\n" for t in stamps))
"""


def manifest(folder, **keys):
    folder.mkdir(parents=True, exist_ok=True)
    stated = {
        "name": folder.name,
        "version": "'1'",
        "needs": "[stereo]",
        "pose_of": "left_camera",
        "summary": "x",
        **keys,
    }
    (folder / "estimator.yaml").write_text("".join(f"{key}: {value}\n" for key, value in stated.items()))
    return folder


@pytest.fixture
def reader(tmp_path):
    def make(form, needs="[stereo]"):
        folder = manifest(
            tmp_path / form,
            command=f"[{sys.executable}, ./reads.py, '{{dataset}}', '{{out}}', {form}]",
            dataset=form,
            needs=needs,
        )
        (folder / "reads.py").write_text(READS)
        return folder

    return make


@pytest.mark.parametrize(
    ("form", "right"), [("kitti", "image_1/000000.png"), ("euroc", "mav0/cam1/data/0.png"), ("tum", None)]
)
def test_a_program_finds_a_dataset_without_the_truth(bench, first, reader, form, right):
    run = bench.run((ESTIMATORS, f"[{reader(form)}]"))
    score = run.scores()[0]
    log = (run.estimate(score.case, form, 0) / LOG).read_text()
    assert score.status in ("ok", "diverged"), score.reason
    assert score.coverage == 1
    assert not re.search("truth|pose|depth|case", log), log
    assert (right in log) if right else ("image_1" not in log)
    assert "camchain.yaml" in log
    assert f"| {form} [whole recording] |" in (run.path / "leaderboard.md").read_text()


def test_who_needs_one_eye_finds_one(bench, first, reader):
    run = bench.run((ESTIMATORS, f"[{reader('kitti', '[mono]')}]"))
    log = (run.estimate("full", "kitti", 0) / LOG).read_text()
    assert "image_0/" in log
    assert "image_1/" not in log


def test_whole_recordings_are_not_for_real_time(bench, first, reader):
    change = (f"estimators: {ESTIMATORS}", f"modes: [real_time]\nestimators: [{reader('kitti')}]")
    assert {score.status for score in bench.run(change).scores()} == {"refused"}


def test_a_program_by_stream_stands_where_the_null_hypothesis_stands(bench, first, tmp_path):
    folder = manifest(tmp_path / "streamed", stream=f"[{sys.executable}, ./stream_client.py]")
    shutil.copy(EXAMPLES / "stream_client.py", folder)
    run = bench.run((ESTIMATORS, f"[{folder}, stand_still]"))
    cells = {cell.estimator: cell for cell in page.run_board(run, run.scores()).cells}
    assert cells["streamed"].status == cells["stand_still"].status
    assert cells["streamed"].values["ate_mm"] == cells["stand_still"].values["ate_mm"]
    frames = read_frames(run.estimate("full", "streamed", 0))
    assert all(frame.status == "ok" and frame.wall_ms > 0 and frame.memory_mib > 1 for frame in frames)


def test_a_stream_goes_at_the_cameras_pace(bench, first, tmp_path):
    folder = manifest(tmp_path / "slow", stream=f"[{sys.executable}, ./slow.py]")
    code = (EXAMPLES / "stream_client.py").read_text()
    (folder / "slow.py").write_text(
        code.replace("pose = np.eye(4)", "__import__('time').sleep(0.55); pose = np.eye(4)")
    )
    change = (f"estimators: {ESTIMATORS}", f"modes: [real_time]\nestimators: [{folder}]")
    run = bench.run(change, ("rate_hz: 5", "rate_hz: 2"))  # half a second, of which a slow machine may take a part
    statuses = [frame.status for frame in read_frames(run.estimate("full", "slow", 0))]
    assert [status == DROPPED for status in statuses] == [bool(index % 2) for index in range(len(statuses))]


def test_what_a_stream_says_wrong_is_a_row(bench, first, tmp_path):
    folder = manifest(tmp_path / "wrong", stream=f"[{sys.executable}, ./wrong.py]")
    code = (EXAMPLES / "stream_client.py").read_text()
    (folder / "wrong.py").write_text(code.replace('pack("<qII", index', 'pack("<qII", index + (index > 2)'))
    score = bench.run((ESTIMATORS, f"[{folder}]")).scores()[0]
    assert (score.status, score.reason) == ("invalid_output", "frame 3: the answer is to frame 4")


T_BODY_IMU = se3.transform(Rotation.from_euler("xyz", [0.3, -0.2, 0.5]).as_matrix(), [0.1, -0.05, 0.2])
RIG = replace(
    stereo_rig(LENSES["paper_blender"], pitch_deg=20), imu=ImuCalibration(T_BODY_IMU, 100.0, 1e-4, 1e-3, 1e-5, 1e-4)
)
EUROC = PRESETS["euroc"]
BENT = replace(RIG, left=EUROC.left, right=EUROC.right, T_body_right=RIG.T_body_left @ EUROC.T_left_right)


@pytest.mark.parametrize(
    ("rig", "form", "pose_of"),
    [(RIG, "kitti", "left_camera"), (BENT, "kitti", "left_camera"), (BENT, "euroc", "imu"), (BENT, "tum", "body")],
    ids=["kitti", "kitti rectified", "imu", "body"],
)
def test_a_perfect_program_is_perfect_whatever_frame_it_gives_the_poses_of(tmp_path, rig, form, pose_of):
    rng, t_ns = np.random.default_rng(1), np.arange(5) * 10**8
    R = Rotation.from_rotvec(0.2 * rng.normal(size=(5, 3))).as_matrix()
    T_world_body = se3.transform(R, rng.normal(size=(5, 3)))
    with SequenceWriter(tmp_path / "sequence", rig, case_json=b"{}") as writer:
        picture = np.zeros((rig.left.height_px, rig.left.width_px), np.uint8)
        for t, T in zip(t_ns.tolist(), T_world_body, strict=True):
            writer.write_imu(ImuReadings(np.array([t]), np.zeros((1, 3)), np.zeros((1, 3))))
            writer.write_frame(t, picture, picture)
            writer.write_truth(t, T, np.zeros(6))
    shown = rectified(rig).rig if form == "kitti" else rig
    T_body_frame = {"left_camera": shown.T_body_left, "imu": T_BODY_IMU, "body": np.eye(4)}[pose_of]
    command = "[cp, ./answers, '{out}']"
    folder = manifest(tmp_path / "perfect", command=command, dataset=form, pose_of=pose_of, needs="[stereo, imu]")
    (folder / "answers").write_text(format_tum(Trajectory(t_ns, T_world_body @ T_body_frame)))
    case = RecordedCase(name="case", variant={}, source=Source(path="."))
    (tmp_path / "estimate").mkdir()
    estimator_entry = EstimatorEntry("perfect", folder, read_manifest(folder), {})
    estimate(Trial(case, estimator_entry, 0), tmp_path / "sequence", tmp_path / "estimate", SilentProgress())
    assert read_outcome(tmp_path / "estimate").reason == ""
    est, gt = read_tum(tmp_path / "estimate" / ESTIMATE), T_world_body @ rig.T_body_left
    T_first = gt[0] @ se3.inverse(est.T_world_frame[0])
    np.testing.assert_allclose(T_first @ est.T_world_frame, gt, atol=1e-9)
