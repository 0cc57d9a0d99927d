"""Recordings in the layout of kapture."""

import numpy as np
import pytest

from tests.dataset.conftest import T_BODY_LEFT, T_LEFT_RIGHT, chain_yaml, with_everything_of
from vobench.dataset.layout import read, sniff
from vobench.dataset.recording import ReadOptions
from vobench.errors import VobenchError
from vobench.geometry.camera import BrownConrady, KannalaBrandt, Pinhole


def replaced(folder, name, old, new):
    """The folder with a text replaced in one of its files."""
    path = folder / "sensors" / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return folder


def test_everything_of_a_recording_arrives(scene, tmp_path, imported):
    path = scene.kapture(tmp_path / "in")
    assert sniff(path) == "kapture"
    folder = imported(path)
    sequence = with_everything_of(scene, folder)
    assert np.abs(sequence.rig.T_body_left - T_BODY_LEFT).max() < 1e-9
    assert np.abs(sequence.rig.T_left_right - T_LEFT_RIGHT).max() < 1e-9
    assert sequence.rig.left == KannalaBrandt(48, 32, 40.5, 41.25, 23.5, 15.25, -0.28, 0.07, 2e-4, 1.5e-5)


@pytest.mark.parametrize(("unit_ns", "unit"), [(10**3, "microseconds"), (10**6, "milliseconds")])
def test_the_unit_of_stamps_is_known_by_their_size(scene, tmp_path, unit_ns, unit):
    recording = read(scene.kapture(tmp_path / "in", unit_ns=unit_ns))
    assert recording.t_ns.tolist() == (scene.t_ns // unit_ns * unit_ns).tolist()
    assert f"The stamps were taken for {unit}, by their size." in recording.notes


def test_numbered_images_need_their_rate(scene, tmp_path):
    path = scene.kapture(tmp_path / "in", unit_ns=50_000_001 * 10**3)
    for name in ("records_camera.txt", "trajectories.txt"):
        text = (path / "sensors" / name).read_text()
        first = int(scene.t_ns[0]) // (50_000_001 * 10**3)
        assert str(first) in text
    with pytest.raises(VobenchError, match=r"are no times since 1970 in ns, µs or ms .* give the rate"):
        read(path)


def test_numbers_of_images_and_a_rate_are_times_from_0(scene, tmp_path):
    path = scene.kapture(tmp_path / "in")
    for name in ("records_camera.txt", "trajectories.txt"):
        file = path / "sensors" / name
        text = file.read_text()
        for index, stamp in enumerate(scene.t_ns.tolist()):
            text = text.replace(f"{stamp},", f"{7 + index},")
        file.write_text(text)
    recording = read(path, options=ReadOptions(rate_hz=8.0))
    assert recording.t_ns.tolist() == [125_000_000 * index for index in range(5)]
    assert recording.truth.t_ns.tolist() == recording.t_ns.tolist()


def test_poses_of_a_camera_are_moved_to_the_rig(scene, tmp_path):
    path = scene.kapture(tmp_path / "in")
    usual = read(path).truth
    replaced(path, "trajectories.txt", "ship,", "starboard,")
    moved = read(path).truth
    assert np.abs(moved.T_world_frame @ T_BODY_LEFT @ T_LEFT_RIGHT - usual.T_world_frame).max() < 1e-9


@pytest.mark.parametrize(
    ("row", "camera"),
    [
        ("SIMPLE_PINHOLE, 48, 32, 40, 23, 15", Pinhole(48, 32, 40.0, 40.0, 23.0, 15.0)),
        ("PINHOLE, 48, 32, 40, 41, 23, 15", Pinhole(48, 32, 40.0, 41.0, 23.0, 15.0)),
        ("SIMPLE_RADIAL, 48, 32, 40, 23, 15, -.1", BrownConrady(48, 32, 40.0, 40.0, 23.0, 15.0, -0.1, 0, 0, 0)),
        ("RADIAL, 48, 32, 40, 23, 15, -.1, .02", BrownConrady(48, 32, 40.0, 40.0, 23.0, 15.0, -0.1, 0.02, 0, 0)),
        (
            "OPENCV, 48, 32, 40, 41, 23, 15, -.1, .02, .001, .002",
            BrownConrady(48, 32, 40.0, 41.0, 23.0, 15.0, -0.1, 0.02, 0.001, 0.002),
        ),
        (
            "FULL_OPENCV, 48, 32, 40, 41, 23, 15, -.1, .02, .001, .002, .003, 0, 0, 0",
            BrownConrady(48, 32, 40.0, 41.0, 23.0, 15.0, -0.1, 0.02, 0.001, 0.002, 0.003),
        ),
    ],
)
def test_cameras_of_colmaps_models(scene, tmp_path, row, camera):
    path = scene.kapture(tmp_path / "in")
    (path / "sensors" / "sensors.txt").write_text(f"port, , camera, {row}\nstarboard, , camera, {row}\n")
    assert read(path).rig.left == camera


def test_one_camera_is_the_body(scene, tmp_path):
    path = scene.kapture(tmp_path / "in")
    (path / "sensors" / "rigs.txt").unlink()
    lines = (path / "sensors" / "records_camera.txt").read_text().splitlines(keepends=True)
    (path / "sensors" / "records_camera.txt").write_text("".join(line for line in lines if "starboard" not in line))
    replaced(path, "trajectories.txt", "ship,", "port,")
    recording = read(path)
    assert recording.rig.right is None
    assert np.array_equal(recording.rig.T_body_left, np.eye(4))
    assert np.abs(recording.truth.T_world_frame - scene.T_world_body).max() < 1e-9


def test_a_camera_without_parameters_needs_a_camchain(scene, tmp_path):
    path = scene.kapture(tmp_path / "in")
    unknown = "port, , camera, UNKNOWN_CAMERA, 48, 32\nstarboard, , camera, UNKNOWN_CAMERA, 48, 32\n"
    (path / "sensors" / "sensors.txt").write_text(unknown)
    with pytest.raises(VobenchError, match="camchain"):
        read(path)
    (path / "camchain.yaml").write_text(chain_yaml(imu=False))
    assert np.abs(read(path).rig.T_left_right - T_LEFT_RIGHT).max() < 1e-9


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("sensors.txt", "OPENCV_FISHEYE", "THIN_PRISM"), "sensors.txt:3: no camera model 'THIN_PRISM' in vobench"),
        (
            ("sensors.txt", ", 0.000015\nport", "\nport"),
            "OPENCV_FISHEYE has a size and 8 parameters, here 7",
        ),
        (("sensors.txt", "41.25", "wide"), "sensors.txt:3: should be a number, but is 'wide'"),
        (("sensors.txt", "camera,", "lidar,"), "no sensor of the type 'camera'"),
        (("rigs.txt", "ship, port", "boat, port"), "one rig is read, and there are 2 in .*: boat, ship"),
        (("rigs.txt", "ship, port", "ship, mast"), "rigs.txt should say where port is on the rig"),
        (("records_camera.txt", "port/", "../../port/"), "a file's name should stay inside"),
        (("trajectories.txt", "ship, ", "ship, 2"), "the quaternion should have norm 1"),
        (("trajectories.txt", "ship, ", "ship; "), "a row should have a stamp, a device"),
    ],
)
def test_what_is_wrong_is_named(scene, tmp_path, change, message):
    path = replaced(scene.kapture(tmp_path / "in"), *change)
    with pytest.raises(VobenchError, match=message):
        read(path)


def test_images_of_a_camera_that_is_no_sensor_are_not_read(scene, tmp_path):
    path = replaced(scene.kapture(tmp_path / "in"), "records_camera.txt", ", port,", ", bow,")
    assert read(path).rig.right is None


def test_two_images_of_one_stamp_are_refused(scene, tmp_path):
    path = scene.kapture(tmp_path / "in")
    first, second = scene.t_ns[:2].tolist()
    replaced(path, "records_camera.txt", f"{second}, port,", f"{first}, port,")
    with pytest.raises(VobenchError, match=f"two images of one camera have the stamp {first}"):
        read(path)
