from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from vobench.dataset.export import export
from vobench.dataset.layout import read
from vobench.dataset.recording import ReadOptions
from vobench.dataset.tum import DEPTH_PER_M, FARTHEST_M, depth_values
from vobench.errors import VobenchError
from vobench.geometry.rig import Rig
from vobench.sequence import Sequence, read_truth
from vobench.trajectory.tum import parse_tum

Make = Callable[..., Any]


def test_depth_is_in_steps_of_a_fifth_of_a_millimetre_and_0_where_unknown() -> None:
    depth_m = np.array([[0.0002, 1.0, 2.00009, FARTHEST_M, FARTHEST_M + 1e-3, np.nan, np.inf, -1.0]], np.float32)
    assert depth_values(depth_m).tolist() == [[1, 5000, 10000, 65535, 0, 0, 0, 0]]


def test_depth_pictures_hold_the_true_depth(rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path) -> None:
    made = make_sequence(rig_of(), depth=True)
    export(made.folder, tmp_path / "out", "tum")
    lines = [line.split() for line in (tmp_path / "out/depth.txt").read_text().splitlines() if line[0] != "#"]
    assert len(lines) == len(made.t_ns)
    for (_, name), depth_m in zip(lines, made.depth_m, strict=True):
        stored = cv2.imread(str(tmp_path / "out" / name), cv2.IMREAD_UNCHANGED)
        assert stored.dtype == np.uint16
        near = depth_m <= FARTHEST_M
        assert np.abs(stored[near] / DEPTH_PER_M - depth_m[near]).max() <= 0.5001 / DEPTH_PER_M
        assert not stored[~near].any()


def test_what_an_imu_felt_is_there_with_every_digit(
    rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path
) -> None:
    made = make_sequence(rig_of(imu=True))
    export(made.folder, tmp_path / "out", "tum")
    rows = [line.split() for line in (tmp_path / "out/imu.txt").read_text().splitlines() if line[0] != "#"]
    np.testing.assert_array_equal([int(row[0].replace(".", "")) for row in rows], made.imu.t_ns)
    values = np.array([row[1:] for row in rows], float)
    np.testing.assert_array_equal(values, np.hstack([made.imu.gyro_radps, made.imu.accel_mps2]))
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "out/accelerometer.txt")[:, 1:], made.imu.accel_mps2)


TRUTH = Path(__file__).parents[3] / "shared" / "data" / "trajectories" / "freiburg1_xyz-groundtruth.txt"


def test_everything_of_a_recording_arrives(scene, tmp_path, imported):
    folder = imported(scene.tum(tmp_path / "in"))
    sequence, truth = Sequence.open(folder), read_truth(folder)
    assert sequence.frame_stamps().tolist() == [1305031102_175304000 + i * 1_000_001_000 for i in range(5)]
    assert sequence.rig.right is None
    assert sequence.rig.left.fx_px == 517.3
    assert sequence.rig.left.k3 == 1.1633
    assert truth.t_ns.tolist() == [1305031101_500000000 + i * 10**9 for i in range(6)]  # the seventh is too late


def test_what_was_assumed_and_dropped_is_said(scene, tmp_path):
    notes = read(scene.tum(tmp_path)).notes
    for said in (
        "one camera",
        "freiburg1's colour camera",
        "Depth images were dropped",
        "converted to grey",
        "outside",
    ):
        assert any(said in note for note in notes), said


def test_a_camera_that_nobody_names_needs_a_calibration(scene, tmp_path, camchain):
    folder = scene.tum(tmp_path).rename(tmp_path / "desk")
    listed = folder / "rgb.txt"
    listed.write_text(listed.read_text().replace("freiburg1", "kitchen"))
    with pytest.raises(VobenchError, match="the calibration is missing"):
        read(folder)
    chain = tmp_path / "chain.yaml"
    chain.write_text(camchain(cameras=1, imu=False, size=(640, 480)))
    assert read(folder, options=ReadOptions(calibration=chain)).rig.left.fx_px == 40.5


def test_the_list_names_the_robot_where_the_folder_does_not(scene, tmp_path):
    folder = scene.tum(tmp_path).rename(tmp_path / "desk")
    assert read(folder).rig.left.fx_px == 517.3


@pytest.mark.skipif(not TRUTH.is_file(), reason="no folder ../shared/data with real trajectories")
def test_the_real_truth_of_freiburg1_xyz_goes_through(scene, tmp_path, imported):
    folder = scene.tum(tmp_path / "in")
    (folder / "groundtruth.txt").write_text(TRUTH.read_text())
    truth, given = read_truth(imported(folder)), parse_tum(TRUTH.read_text(), name="truth")
    kept = np.isin(given.t_ns, truth.t_ns)
    assert truth.t_ns.tolist() == given.t_ns[kept].tolist()
    assert np.abs(truth.T_world_frame - given.T_world_frame[kept]).max() < 1e-12


def test_of_true_poses_with_one_stamp_the_first_is_kept_and_a_missing_picture_is_a_gap(scene, tmp_path):
    folder = scene.tum(tmp_path)
    path, whole = folder / "groundtruth.txt", read(folder)
    path.write_text(path.read_text().replace("1305031103.5000 1.0 2.25", "1305031102.5000 1.0 2.25"))
    (folder / "rgb" / "1305031104.175306.png").unlink()
    recording = read(folder)
    said = f"rows that repeat the stamp of the row before were left out: 1 of 8, the first at {path}:4"
    assert said in recording.notes
    assert len(recording.truth) == len(whole.truth) - 1
    assert recording.truth.positions_m[:2, 1].tolist() == [0.25, 1.25]
    assert recording.frame_count == 4
    assert any("1 between others (a gap of up to 2 s)" in note for note in recording.notes)
