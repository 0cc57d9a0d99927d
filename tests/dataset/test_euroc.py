import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.linalg import expm

from vobench.dataset.euroc import point_velocity, sensor_camera
from vobench.dataset.export import export
from vobench.dataset.layout import read, sniff
from vobench.dataset.recording import ReadOptions
from vobench.errors import VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady
from vobench.geometry.rig import EUROC, Rig, rectification
from vobench.sequence import Sequence, read_truth
from vobench.trajectory.trajectory import Trajectory

Make = Callable[..., Any]


def test_a_velocity_is_the_derivative_of_the_position_of_its_point() -> None:
    twist = np.array([0.7, -0.2, 0.1, 0.3, -0.5, 0.9])  # constant in body axes
    w = twist[3:]
    generator = np.zeros((4, 4))
    generator[:3, :3] = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]
    generator[:3, 3] = twist[:3]
    lever_m, half_s = np.array([0.3, -0.1, 0.2]), 1e-4
    T = np.stack([expm(generator * s) for s in (1 - half_s, 1.0, 1 + half_s)])
    path = Trajectory(np.array([1, 2, 3]), T)
    places = path.of_mounted(se3.transform(np.eye(3), lever_m)).positions_m
    slope = (places[2] - places[0]) / (2 * half_s)
    np.testing.assert_allclose(point_velocity(path, np.tile(twist, (3, 1)), lever_m)[1], slope, atol=1e-7)


def test_the_euroc_truth_has_velocity_and_biases_only_where_they_were_recorded(
    rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path
) -> None:
    widths = []
    for index, (imu, with_twist) in enumerate([(True, True), (False, True), (True, False)]):
        made = make_sequence(rig_of(imu=imu), with_twist=with_twist)
        export(made.folder, tmp_path / f"out{index}", "euroc")
        rows = (tmp_path / f"out{index}/mav0/state_groundtruth_estimate0/data.csv").read_text().splitlines()
        assert len({row.count(",") for row in rows}) == 1, "the header has as many columns as the rows"
        widths.append(rows[1].count(",") + 1)
        if index == 0:
            biases = np.array([row.split(",")[11:] for row in rows[1:]], float)
            np.testing.assert_array_equal(biases, made.twist * np.repeat([1e-2, 1e-1], 3))
    assert widths == [17, 11, 8]


def test_everything_of_a_folder_arrives_with_its_stamps_and_pixels(scene, tmp_path, imported, placed):
    folder = imported(scene.euroc(tmp_path / "V1_01_easy"))
    sequence, truth, imu = Sequence.open(folder), read_truth(folder), Sequence.open(folder).imu()
    assert sequence.frame_stamps().tolist() == scene.t_ns.tolist() == truth.t_ns.tolist()
    for frame, left, right in zip(sequence.frames(), scene.left, scene.right, strict=True):
        assert np.array_equal(frame.left, left)
        assert np.array_equal(frame.right, right)
    assert np.abs(truth.T_world_frame - scene.T_world_body).max() < 1e-12
    assert imu.t_ns.tolist() == scene.imu_ns.tolist()
    assert np.array_equal(np.hstack([imu.gyro_radps, imu.accel_mps2]), scene.imu)
    assert np.abs(sequence.rig.T_body_left - placed[0]).max() < 1e-12
    assert np.abs(sequence.rig.T_left_right - placed[1]).max() < 1e-12
    assert isinstance(sequence.rig.left, BrownConrady)
    assert (sequence.rig.imu.rate_hz, sequence.rig.imu.gyro_noise, sequence.rig.imu.accel_walk) == (
        200,
        1.6968e-4,
        3e-3,
    )


def test_a_grey_png_of_8_bits_is_not_written_anew(scene, tmp_path, imported):
    folder = scene.euroc(tmp_path / "in")
    kept = cv2.imencode(".png", scene.left[0], [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes()
    (folder / "mav0/cam0/data" / f"{scene.t_ns[0]}.png").write_bytes(kept)
    assert next(Sequence.open(imported(folder)).encoded_frames()).left == kept


def test_mav0_itself_may_be_named(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    assert read(folder / "mav0").frame_count == read(folder).frame_count


def test_pictures_of_16_bits_keep_their_upper_8(scene, tmp_path):
    recording = read(scene.euroc(tmp_path, widen=lambda p: p.astype(np.uint16) * 257))
    for frame, left in zip(recording.frames(), scene.left, strict=True):
        assert np.array_equal(frame.left, left)
    assert any("upper 8 bits" in note for note in recording.notes)


def test_a_picture_without_a_partner_is_dropped_and_said(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    listed = folder / "mav0/cam1/data.csv"
    rows = listed.read_text().splitlines()
    listed.write_text("\n".join(rows[:2] + rows[3:]) + "\n")
    recording = read(folder)
    assert [frame.t_ns for frame in recording.frames()] == np.delete(scene.t_ns, 1).tolist()
    assert "1 left and 0 right images without a partner were dropped." in recording.notes


@pytest.mark.parametrize(
    ("gone", "where"),
    [
        ({"cam1": (3, 4)}, "2 of 5 pairs were dropped because files are missing: 2 at the end."),
        ({"cam0": (0,)}, "1 of 5 pairs were dropped because files are missing: 1 at the start."),
        ({"cam0": (2,), "cam1": (1, 2)}, "2 of 5 pairs .*: 2 between others \\(a gap of up to 0.15 s\\)."),
        ({"cam0": (0, 2), "cam1": (4,)}, "3 of 5 pairs .*: 1 at the start, 1 between .*0.1 s\\), 1 at the end."),
    ],
)
def test_pairs_whose_files_are_missing_are_dropped_and_all_others_arrive(scene, tmp_path, imported, gone, where):
    folder = scene.euroc(tmp_path / "in")
    for eye, indices in gone.items():
        for index in indices:
            (folder / "mav0" / eye / "data" / f"{scene.t_ns[index]}.png").unlink()
    kept = [index for index in range(5) if not any(index in indices for indices in gone.values())]
    assert any(re.match(where, note) for note in read(folder).notes)
    sequence = Sequence.open(imported(folder))
    assert sequence.frame_stamps().tolist() == scene.t_ns[kept].tolist()
    for frame, index in zip(sequence.frames(), kept, strict=True):
        assert np.array_equal(frame.left, scene.left[index])
        assert np.array_equal(frame.right, scene.right[index])


def test_readings_beyond_the_pictures_are_cut_but_for_one_each_side(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    for index in (0, 4):
        (folder / "mav0/cam1/data" / f"{scene.t_ns[index]}.png").unlink()
    recording = read(folder)
    first, last = scene.t_ns[1], scene.t_ns[3]
    begin, end = np.searchsorted(scene.imu_ns, first, "right") - 1, np.searchsorted(scene.imu_ns, last)
    assert recording.imu.t_ns.tolist() == scene.imu_ns[begin : end + 1].tolist()
    assert np.array_equal(recording.imu.gyro_radps, scene.imu[begin : end + 1, :3])
    outside = 42 - (end + 1 - begin)
    said = f"{outside} of 42 IMU readings lie outside the images' time (0.2 s beside 0.1 s); dropped."
    assert said in recording.notes


def test_readings_of_another_clock_are_dropped_and_said(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    (folder / "mav0/imu0/data.csv").write_text("1000,0,0,0,0,0,9.8\n2000,0,0,0,0,0,9.8\n")
    recording = read(folder)
    assert recording.imu is None
    assert recording.rig.imu is None
    assert any(note.startswith("The IMU (1000 to 2000 ns) was dropped: it shares no time") for note in recording.notes)


def test_of_true_poses_with_one_stamp_the_first_is_kept_and_it_is_said(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    path = folder / "mav0/state_groundtruth_estimate0/data.csv"
    rows = path.read_text().splitlines()
    again = rows[3].split(",", 2)
    path.write_text("\n".join([*rows[:4], f"{again[0]},77.0,{again[2]}", *rows[4:]]))
    recording = read(folder)
    assert np.abs(recording.truth.T_world_frame - scene.T_world_body).max() < 1e-12
    said = f"rows that repeat the stamp of the row before were left out: 1 of 6, the first at {path}:5"
    assert said in recording.notes
    path.write_text("\n".join([*rows[:3], rows[1], *rows[3:]]))
    with pytest.raises(VobenchError, match=r"data\.csv:4: stamps must increase"):
        read(folder)


def test_eyes_a_little_apart_are_a_pair_and_it_is_said(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    listed = folder / "mav0/cam1/data.csv"
    listed.write_text("".join(f"{t + 700},{t}.png\n" for t in scene.t_ns))
    recording = read(folder)
    assert [frame.t_ns for frame in recording.frames()] == scene.t_ns.tolist()
    assert any("up to 700 ns apart" in note for note in recording.notes)
    with pytest.raises(VobenchError, match="within 500 ns of each other"):
        read(folder, options=ReadOptions(within_ns=500))


def test_truth_is_moved_from_the_marker_to_the_body(scene, tmp_path, placed):
    folder = scene.euroc(tmp_path)
    state = folder / "mav0/state_groundtruth_estimate0"
    state.rename(folder / "mav0/vicon0")
    cells = ", ".join(map(repr, placed[0].ravel().tolist()))
    (folder / "mav0/vicon0/sensor.yaml").write_text(f"T_BS:\n  rows: 4\n  cols: 4\n  data: [{cells}]\n")
    recording = read(folder)
    expected = scene.T_world_body @ se3.inverse(placed[0])
    assert np.abs(recording.truth.T_world_frame - expected).max() < 1e-12
    assert "The truth is vicon0, moved to the body by its T_BS." in recording.notes


def test_positions_alone_are_no_truth(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    (folder / "mav0/state_groundtruth_estimate0").rename(folder / "mav0/leica0")
    recording = read(folder)
    assert recording.truth is None
    assert any("leica0 was dropped: it has positions without rotations" in note for note in recording.notes)


def test_truth_beyond_the_pictures_is_cut_but_for_one_pose_each_side(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    path = folder / "mav0/state_groundtruth_estimate0/data.csv"
    stamps = np.arange(-4, 12) * 33_000_000 + scene.t_ns[0]
    path.write_text("".join(f"{t},0,0,0,1,0,0,0\n" for t in stamps))
    recording = read(folder)
    inside = (stamps >= scene.t_ns[0]) & (stamps <= scene.t_ns[-1])
    assert len(recording.truth) == inside.sum() + 1  # one after the last picture; the first has one of its stamp
    assert recording.truth.t_ns[-1] >= scene.t_ns[-1]
    assert any("outside the images' time; dropped" in note for note in recording.notes)


def test_truth_of_another_clock_is_dropped(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    (folder / "mav0/state_groundtruth_estimate0/data.csv").write_text("1000,0,0,0,1,0,0,0\n2000,0,0,0,1,0,0,0\n")
    recording = read(folder)
    assert recording.truth is None
    assert any("shares no time with the images" in note for note in recording.notes)


def test_one_camera_is_enough(scene, tmp_path, imported):
    folder = scene.euroc(tmp_path / "in")
    shutil.rmtree(folder / "mav0/cam1")
    sequence = Sequence.open(imported(folder))
    assert sequence.rig.right is None
    assert next(sequence.frames()).right is None


def test_tum_vi_is_told_apart_and_takes_its_calibration_from_dso(scene, tmp_path, camchain, placed):
    folder = scene.euroc(tmp_path)
    for name in ("cam0", "cam1", "imu0"):
        (folder / f"mav0/{name}/sensor.yaml").unlink()
    (folder / "mav0/state_groundtruth_estimate0").rename(folder / "mav0/mocap0")
    (folder / "dso").mkdir()
    (folder / "dso/camchain.yaml").write_text(camchain())
    (folder / "dso/imu_config.yaml").write_text(
        "accelerometer_noise_density: 0.0028\naccelerometer_random_walk: 0.00086\n"
        "gyroscope_noise_density: 0.00016\ngyroscope_random_walk: 2.2e-05\nrostopic: /imu0\nupdate_rate: 200.0\n"
    )
    assert sniff(folder) == "tumvi"
    recording = read(folder)
    assert np.abs(recording.rig.T_body_left - placed[0]).max() < 1e-12
    assert np.abs(recording.rig.T_left_right - placed[1]).max() < 1e-12
    assert recording.rig.imu.accel_noise == 0.0028
    assert len(recording.truth) == len(scene.t_ns)


def test_an_imu_of_unknown_noise_is_dropped_and_said(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    (folder / "mav0/imu0/sensor.yaml").unlink()
    recording = read(folder)
    assert recording.imu is None
    assert any("its noise is not known" in note for note in recording.notes)


def test_a_given_chain_wins_over_the_sensors_own(scene, tmp_path, camchain):
    folder, chain = scene.euroc(tmp_path / "in"), tmp_path / "mine.yaml"
    chain.write_text(camchain().replace("40.5", "44.5"))
    assert read(folder, options=ReadOptions(calibration=chain)).rig.left.fx_px == 44.5


def test_a_clock_that_is_off_by_calibration_is_said(scene, tmp_path, camchain):
    folder, chain = scene.euroc(tmp_path / "in"), tmp_path / "mine.yaml"
    chain.write_text(camchain() + "  timeshift_cam_imu: 0.012\n")
    assert any("cam1 is 0.012 s off" in note for note in read(folder, options=ReadOptions(calibration=chain)).notes)


def test_sensors_that_nobody_asked_for_are_named(scene, tmp_path):
    folder = scene.euroc(tmp_path)
    for name in ("leica0", "pointcloud0", "cam2"):
        (folder / "mav0" / name).mkdir()
    assert "Not read: cam2, leica0, pointcloud0." in read(folder).notes


def test_the_imported_calibration_rectifies_the_pair(scene, tmp_path, imported):
    """Points land on equal rows of both views, by what the sequence's rig says alone."""
    rig = Sequence.open(imported(scene.euroc(tmp_path / "in"))).rig
    views = rectification(rig)
    points = np.random.default_rng(1).uniform([-1, -1, 2], [1, 1, 9], (50, 3))
    right = se3.apply(se3.inverse(rig.T_left_right), points)
    rows = [(turned[:, 1] / turned[:, 2]) for turned in (points @ views.R_view_left.T, right @ views.R_view_right.T)]
    assert np.abs(rows[0] - rows[1]).max() < 1e-12


# As EuRoC's own sensor.yaml of cam0 and cam1 have it, line breaks, comments and all.
OWN_YAML = """\
# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam{number} (MT9M034)

# Sensor extrinsics wrt. the body-frame.
T_BS:
  cols: 4
  rows: 4
  data: [{data}]

# Camera specific definitions.
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [{intrinsics}] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [{bends}]
"""
OWN = (
    (
        "0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,\n"
        "         0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,\n"
        "        -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949,\n"
        "         0.0, 0.0, 0.0, 1.0",
        "458.654, 457.296, 367.215, 248.375",
        "-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05",
    ),
    (
        "0.0125552670891, -0.999755099723, 0.0182237714554, -0.0198435579556,\n"
        "         0.999598781151, 0.0130119051815, 0.0251588363115, 0.0453689425024,\n"
        "        -0.0253898008918, 0.0179005838253, 0.999517347078, 0.00786212447038,\n"
        "         0.0, 0.0, 0.0, 1.0",
        "457.587, 456.134, 379.999, 255.238",
        "-0.28368365, 0.07451284, -0.00010473, -3.55590700e-05",
    ),
)


def test_euroc_s_own_calibration_is_that_of_the_preset(tmp_path):
    cameras = []
    for number, (data, intrinsics, bends) in enumerate(OWN):
        path = tmp_path / f"{number}.yaml"
        path.write_text(OWN_YAML.format(number=number, data=data, intrinsics=intrinsics, bends=bends))
        cameras.append(sensor_camera(path))
    left, right = cameras
    assert (left.camera, right.camera) == (EUROC.left, EUROC.right)
    assert np.allclose(se3.inverse(left.T_body_camera) @ right.T_body_camera, EUROC.T_left_right, rtol=0, atol=1e-12)


def test_links_to_another_disk_are_followed(scene, tmp_path):
    folder = scene.euroc(tmp_path / "in")
    data = (folder / "mav0/cam0/data").rename(tmp_path / "elsewhere")
    (folder / "mav0/cam0/data").symlink_to(data)
    assert np.array_equal(next(read(folder).frames()).left, scene.left[0])


def test_a_pair_the_wrong_way_round_is_said(scene, tmp_path):
    euroc = scene.euroc(tmp_path)
    for was, name in (("cam0", "spare"), ("cam1", "cam0"), ("spare", "cam1")):
        (euroc / "mav0" / was).rename(euroc / "mav0" / name)
    assert any("The pair cannot be rectified" in note for note in read(euroc).notes)
