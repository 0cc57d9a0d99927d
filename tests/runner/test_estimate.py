"""An estimator gets what it needs of a recording, in time and no sooner; one that cannot be served is refused."""

import io
import json
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.errors import TrajectoryError
from vobench.estimator.process import EstimatorProcess
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import ImuCalibration, Rig, stereo_rig
from vobench.runner import estimate as estimate_file
from vobench.runner.estimate import estimate
from vobench.runner.folder import read_tum
from vobench.runner.frames import ANSWERS, read_table
from vobench.runner.store import SilentProgress
from vobench.sensor.imu import ImuReadings
from vobench.sequence import SequenceWriter
from vobench.suite.estimator_entry import EstimatorEntry
from vobench.suite.manifest import read_manifest
from vobench.suite.plan import Trial
from vobench.suite.suite_spec import Mode

LENS = Pinhole(64, 48, 50.0, 50.0, 31.5, 23.5)
STEREO = replace(stereo_rig(LENS, pitch_deg=15), imu=ImuCalibration(np.eye(4), 100.0, 1e-4, 1e-3, 1e-5, 1e-4))
MONO = Rig(LENS, None, STEREO.T_body_left, None)
# What the estimator saw, as numbers: pictures' grey, readings' count, first and last stamp in ms.
SEES = """
        stats = {}
        for name in ("left", "right"):
            if getattr(frame, name) is not None:
                stats[name] = getattr(frame, name).mean()
        for name in ("encoders", "imu"):
            readings = getattr(frame, name)
            if readings is not None:
                stats[name] = len(readings.t_ns)
                if len(readings.t_ns):
                    stats[name + "_first_ms"], stats[name + "_last_ms"] = readings.t_ns[[0, -1]] / 1e6
        if frame.imu is not None and len(frame.imu.t_ns):
            stats["gyro"], stats["accel"] = frame.imu.gyro_radps[-1, 2], frame.imu.accel_mps2[-1, 0]
        return Result(np.eye(4), stats=stats)
"""


@dataclass(frozen=True, slots=True)
class Named:
    """All that an estimate needs of a case."""

    name: str = "case"


def recorded(folder: Path, rig: Rig, *, frames: int = 3) -> Path:
    """Frames 100 ms apart of a grey that grows; the IMU at 0, 10, .. ms reads its own index; two ticks a frame."""
    index = np.arange(10 * (frames - 1) + 1, dtype=np.int64)
    with SequenceWriter(folder, rig, case_json=b"{}") as writer:
        for k in range(frames):
            t_ns = k * 100_000_000
            new = index[(index > 10 * (k - 1)) & (index <= 10 * k)]
            if rig.imu:
                turns = np.zeros((len(new), 3)) + new[:, None]
                writer.write_imu(ImuReadings(new * 10_000_000, turns, -turns))
            if rig.wheels:
                writer.write_encoders(np.array([t_ns]), np.array([[k, k]]))
            left = np.full((48, 64), 10 * k, np.uint8)
            writer.write_frame(t_ns, left, left + 1 if rig.right else None)
            writer.write_truth(t_ns, np.eye(4), np.zeros(6))
    return folder


def estimated(tmp_path: Path, sequence: Path, plugin: Path, *, mode: Mode = "step") -> Path:
    estimator_entry = EstimatorEntry("mine", plugin, read_manifest(plugin), {}, mode=mode)
    folder = tmp_path / "estimate"
    folder.mkdir()
    estimate(Trial(Named(), estimator_entry, 0), sequence, folder, SilentProgress())
    return folder


def seen(folder: Path) -> list[dict[str, float]]:
    return [json.loads(row["stats"]) for row in read_table(folder / ANSWERS)]


def test_the_imu_comes_in_pieces_up_to_each_frames_stamp_and_not_twice(tmp_path, plugin):
    sequence = recorded(tmp_path / "sequence", STEREO)
    stats = seen(estimated(tmp_path, sequence, plugin(SEES, needs="[imu]")))
    assert [s["imu"] for s in stats] == [1, 10, 10]
    assert [(s["imu_first_ms"], s["imu_last_ms"]) for s in stats] == [(0, 0), (10, 100), (110, 200)]
    assert [(s["gyro"], s["accel"]) for s in stats] == [(0, 0), (10, -10), (20, -20)]


@pytest.mark.parametrize(
    ("needs", "said"),
    [
        ("[]", set()),
        ("[mono]", {"left"}),
        ("[stereo]", {"left", "right"}),
        ("[mono, encoders]", {"left", "encoders"}),
        ("[imu, stereo, encoders]", {"left", "right", "imu", "encoders"}),
    ],
)
def test_an_estimator_gets_what_it_needs_and_nothing_else(tmp_path, plugin, needs, said):
    sequence = recorded(tmp_path / "sequence", STEREO)
    last = seen(estimated(tmp_path, sequence, plugin(SEES, needs=needs)))[-1]
    assert {"left", "right", "imu", "encoders"} & set(last) == said
    assert last.get("left", 20) == 20
    assert last.get("right", 21) == 21


@pytest.mark.parametrize("needs", ["[]", "[mono]"])
def test_one_camera_is_enough_for_those_who_need_no_more(tmp_path, plugin, needs):
    folder = estimated(tmp_path, recorded(tmp_path / "sequence", MONO), plugin(SEES, needs=needs))
    assert estimate_file.read_outcome(folder).kind == estimate_file.FINISHED
    assert len(seen(folder)) == 3


@pytest.mark.parametrize(("need", "lacks"), [("stereo", "one camera"), ("encoders", "no wheels"), ("imu", "no IMU")])
def test_what_the_recording_cannot_serve_is_refused_before_it_starts(tmp_path, plugin, need, lacks):
    mine = plugin("import os; os._exit(3)", head="raise RuntimeError('started')", needs=f"[{need}]")
    folder = estimated(tmp_path, recorded(tmp_path / "sequence", MONO), mine)
    outcome = estimate_file.read_outcome(folder)
    assert outcome.kind == "not_applicable"
    assert outcome.reason == f"it needs {need!r}, but this recording has {lacks}"
    assert (folder / estimate_file.LOG).read_text() == ""
    assert (folder / estimate_file.ESTIMATE).read_text() == ""
    assert seen(folder) == []


@pytest.mark.parametrize(("wall_ms", "is_sent"), [(100.0, [True] * 5), (100.1, [True, False] * 2 + [True])])
def test_in_real_time_a_frame_is_dropped_only_if_the_estimator_is_still_busy(
    tmp_path, plugin, monkeypatch, wall_ms, is_sent
):
    class Steady(EstimatorProcess):
        def process(self, frame):
            return replace(super().process(frame), wall_ms=wall_ms)

    monkeypatch.setattr(estimate_file, "EstimatorProcess", Steady)
    sequence = recorded(tmp_path / "sequence", MONO, frames=5)  # 100 ms apart
    folder = estimated(tmp_path, sequence, plugin("return Result(np.eye(4))"), mode="real_time")
    statuses = [row["status"] for row in read_table(folder / ANSWERS)]
    assert [status != estimate_file.DROPPED for status in statuses] == is_sent


def test_tracks_come_back_in_the_order_of_frames(tmp_path):
    tables = {index: np.full((index, 5), index, np.float32) for index in (2, 10, 100)}
    with zipfile.ZipFile(tmp_path / estimate_file.TRACKS, "w") as archive:
        for index, table in tables.items():
            buffer = io.BytesIO()
            np.save(buffer, table)
            archive.writestr(f"{index:08d}.npy", buffer.getvalue())
    read = list(estimate_file.read_tracks(tmp_path))
    assert [index for index, _ in read] == [2, 10, 100]
    assert all(np.array_equal(table, tables[index]) for index, table in read)


def test_an_outcome_with_an_unknown_key_is_refused(tmp_path):
    (tmp_path / estimate_file.OUTCOME).write_text('{"kind": "finished", "reason": "", "mood": "good"}')
    with pytest.raises(ValueError, match="mood"):
        estimate_file.read_outcome(tmp_path)


def test_the_covariance_of_the_left_camera_is_that_of_small_errors_of_the_frame_that_carries_it():
    """An error of a frame's pose moves the camera on it by what the camera's own pose then differs."""
    T_frame_left = se3.transform(Rotation.from_euler("xyz", [-1.7, 0.2, -1.5]).as_matrix(), [0.3, -0.1, 0.7])
    T_odom_frame = se3.transform(Rotation.from_euler("xyz", [0.2, -0.3, 1.1]).as_matrix(), [2.0, 1.0, -0.5])
    size = 1e-6

    def T_start_left(error):
        R = Rotation.from_rotvec(error[3:]).as_matrix() @ T_odom_frame[:3, :3]
        return se3.inverse(T_frame_left) @ se3.transform(R, T_odom_frame[:3, 3] + error[:3]) @ T_frame_left

    before = T_start_left(np.zeros(6))
    derivatives = []
    for error in size * np.eye(6):
        after = T_start_left(error)
        turn = Rotation.from_matrix(after[:3, :3] @ before[:3, :3].T).as_rotvec()
        derivatives.append(np.r_[after[:3, 3] - before[:3, 3], turn] / size)
    jacobian = np.stack(derivatives, 1)

    spread = np.random.default_rng(1).normal(size=(6, 6))
    covariance = spread @ spread.T
    keeper = estimate_file._Keeper(None, None, None, T_frame_left=T_frame_left)
    found = keeper._covariance_of_left(T_odom_frame[:3, :3], covariance)
    np.testing.assert_allclose(found, jacobian @ covariance @ jacobian.T, rtol=1e-4, atol=1e-4)


def test_nobody_can_change_an_outcome_after_the_fact():
    outcome = estimate_file.EstimatorOutcome(kind="crashed", reason="out of tracks")
    with pytest.raises(ValueError, match="frozen"):
        outcome.kind = "finished"
    assert outcome.kind == "crashed"


def test_a_trajectory_with_bytes_of_no_text_is_one_sentence_with_its_place(tmp_path):
    (tmp_path / "a.tum").write_bytes(b"0 0\xff")
    with pytest.raises(TrajectoryError, match=r"^not a text file in UTF-8 \(byte 3\): .*a\.tum$"):
        read_tum(tmp_path / "a.tum")


def test_points_of_the_body_come_back_in_the_left_cameras_axes_beside_the_tracks(tmp_path, plugin):
    mine = plugin("return Result(np.eye(4), points=[[frame.index, 0, 0], [0, 0, 1]])")
    (mine / "estimator.yaml").write_text((mine / "estimator.yaml").read_text().replace("left_camera", "body"))
    folder = estimated(tmp_path, recorded(tmp_path / "sequence", STEREO), mine)
    read = dict(estimate_file.read_tracks(folder, of=estimate_file.POINTS))
    for index, points in read.items():
        expected = se3.apply(se3.inverse(STEREO.T_body_left), [[index, 0, 0], [0, 0, 1]])
        np.testing.assert_allclose(points, expected, atol=1e-6)
    assert sorted(read) == [0, 1, 2]
    assert list(estimate_file.read_tracks(folder)) == []
