import re
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from vobench.dataset.kalibr import camchain, imu_yaml, number, read_camchain, read_imu
from vobench.dataset.read_back import check_rig, pixel_difference
from vobench.errors import InputError, SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import DoubleSphere, Equirectangular
from vobench.geometry.rig import PRESETS, ImuCalibration, Rig, mounted_rig
from vobench.sensor.imu import IMUS

# What YAML 1.1 resolves to a float (PyYAML, which Kalibr reads with): a point, and a sign in the exponent.
FLOAT_1_1 = r"[0-9]+\.[0-9]*([eE][-+][0-9]+)?"
MPU = IMUS["mpu6000"].calibration
SPHERES = DoubleSphere(512, 512, 156.8, 156.9, 254.9, 256.9, -0.18, 0.59)


def preset_rig(name: str) -> Rig:
    pair = PRESETS[name]
    return mounted_rig(pair.left, pair.right, pair.T_left_right, pitch_deg=20.0)


def written(folder: Path, text: str) -> Path:
    path = folder / "camchain.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_every_preset_comes_back_with_every_digit(name: str, tmp_path: Path) -> None:
    rig = preset_rig(name)
    assert pixel_difference(rig, read_camchain(written(tmp_path, camchain(rig)))) < 1e-9


def test_a_double_sphere_and_a_lone_camera_come_back(rig_of: Callable[..., Rig], tmp_path: Path) -> None:
    for rig in (rig_of(SPHERES), rig_of(stereo=False), rig_of(SPHERES, stereo=False, imu=True)):
        found = read_camchain(written(tmp_path, camchain(rig)))
        assert found.left == rig.left
        assert found.sides == rig.sides
        assert pixel_difference(rig, found) < 1e-9


def test_the_imu_comes_back_as_the_body_where_it_sat(rig_of: Callable[..., Rig], tmp_path: Path) -> None:
    rig = rig_of(imu=True)
    assert rig.imu
    imu_path = tmp_path / "imu.yaml"
    imu_path.write_text(imu_yaml(rig.imu, topic="/imu0"), encoding="utf-8")
    found = read_camchain(written(tmp_path, camchain(rig)))
    np.testing.assert_allclose(found.T_body_left, se3.inverse(rig.imu.T_body_imu) @ rig.T_body_left, atol=1e-12)
    assert_same_imu(read_imu(imu_path, rig.imu.T_body_imu), rig.imu)
    check_rig("the chain", rig, replace(found, imu=read_imu(imu_path, np.eye(4))))


def assert_same_imu(one: ImuCalibration, other: ImuCalibration) -> None:
    for each in fields(ImuCalibration):
        np.testing.assert_array_equal(getattr(one, each.name), getattr(other, each.name), each.name)


def test_the_chain_takes_points_from_the_camera_before_to_this_one(rig_of: Callable[..., Rig]) -> None:
    yaml = pytest.importorskip("yaml")  # what Kalibr reads with
    rig = preset_rig("euroc")
    rig = replace(rig, imu=rig_of(imu=True).imu)
    chain = yaml.safe_load(camchain(rig))
    T_cam1_cam0 = np.array(chain["cam1"]["T_cn_cnm1"])
    point_left = np.array([[0.3, -0.2, 4.0]])
    seen = rig.camera("right").project(se3.apply(T_cam1_cam0, point_left))
    body_point = se3.apply(rig.T_body_left, point_left)
    there = rig.camera("right").project(se3.apply(se3.inverse(rig.T_body_camera("right")), body_point))
    np.testing.assert_allclose(seen, there, atol=1e-9)
    np.testing.assert_allclose(
        np.array(chain["cam1"]["T_cam_imu"]), T_cam1_cam0 @ np.array(chain["cam0"]["T_cam_imu"]), atol=1e-12
    )
    assert chain["cam0"]["cam_overlaps"] == [1]
    assert chain["cam0"]["timeshift_cam_imu"] == 0.0
    assert all(isinstance(value, float) for value in chain["cam0"]["distortion_coeffs"])


def test_opencv_reads_the_chain_below_the_line_that_openvins_asks_for() -> None:
    rig = preset_rig("fisheye")
    storage = cv2.FileStorage("%YAML:1.0\n---\n" + camchain(rig), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    cam1 = storage.getNode("cam1")
    linear = [cam1.getNode("intrinsics").at(i).real() for i in range(4)]
    assert linear == rig.camera("right").K[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()
    rows = cam1.getNode("T_cn_cnm1")
    T = np.array([[rows.at(i).at(j).real() for j in range(4)] for i in range(4)])
    np.testing.assert_array_equal(T, se3.inverse(rig.T_body_camera("right")) @ rig.T_body_left)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_keeps_its_bits_and_is_one_to_a_reader_of_yaml_1_1(value: float) -> None:
    yaml = pytest.importorskip("yaml")
    read = yaml.safe_load(number(value))
    assert isinstance(read, float)
    assert read == value


def test_a_camera_that_sees_all_around_is_refused_with_a_sentence(rig_of: Callable[..., Rig]) -> None:
    with pytest.raises(SequenceError, match="sees all around"):
        camchain(rig_of(Equirectangular(128, 64), stereo=False))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("camera_model: pinhole", "camera_model: omni"), "cam0.camera_model should be pinhole .* but is omni with 4"),
        (("  resolution: [752, 480]\n", ""), "cam0.resolution is missing"),
        (("distortion_model: radtan", "distortion_model: fov"), "distortion model 'fov'"),
        (("cam0:", "cam7:"), "the key cam0 is missing; the keys beside it are cam7, cam1"),
    ],
)
def test_a_chain_that_says_something_else_is_refused_by_file_and_key(
    change: tuple[str, str], said: str, tmp_path: Path
) -> None:
    path = written(tmp_path, camchain(preset_rig("euroc")).replace(*change))
    with pytest.raises(InputError, match=said) as caught:
        read_camchain(path)
    assert str(path) in str(caught.value)


def test_an_imu_is_read_under_its_name_too(rig_of: Callable[..., Rig], tmp_path: Path) -> None:
    imu = rig_of(imu=True).imu
    assert imu
    flat = imu_yaml(imu, topic="/imu0")
    path = tmp_path / "imu.yaml"
    path.write_text("imu0:\n" + "".join(f"  {line}\n" for line in flat.splitlines()), encoding="utf-8")
    found = read_imu(path, imu.T_body_imu)
    assert (found.rate_hz, found.gyro_noise, found.accel_walk) == (imu.rate_hz, imu.gyro_noise, imu.accel_walk)


def test_kalibr_finds_all_that_it_asks_for_to_the_last_digit() -> None:
    assert YAML(typ="safe").load(imu_yaml(MPU, topic="/imu")) == {
        "rostopic": "/imu",
        "update_rate": 200.0,
        "accelerometer_noise_density": MPU.accel_noise,
        "accelerometer_random_walk": MPU.accel_walk,
        "gyroscope_noise_density": MPU.gyro_noise,
        "gyroscope_random_walk": MPU.gyro_walk,
    }


@pytest.mark.parametrize("value", [1e-5, 3e-7, 0.002, 1.0, 2.5e-4])
def test_a_number_is_a_number_to_yaml_1_1(value: float) -> None:
    stated = imu_yaml(replace(MPU, gyro_walk=value), topic="/imu").split("gyroscope_random_walk: ")[1].strip()
    assert re.fullmatch(FLOAT_1_1, stated)
    assert float(stated) == value


@pytest.mark.parametrize("value", [0.0, -1e-3, float("nan")])
def test_what_kalibr_refuses_is_refused_by_name(value: float) -> None:
    with pytest.raises(InputError, match="Kalibr reads no IMU whose accelerometer_random_walk is"):
        imu_yaml(replace(MPU, accel_walk=value), topic="/imu")


@pytest.mark.parametrize(("key", "value"), [("gyroscope_noise_density", "-1.0e-4"), ("update_rate", "0.0")])
def test_an_imu_with_less_than_no_noise_or_no_rate_is_none(key: str, value: str, tmp_path: Path) -> None:
    path = tmp_path / "imu.yaml"
    path.write_text(re.sub(f"{key}: .*", f"{key}: {value}", imu_yaml(MPU, topic="/imu")), encoding="utf-8")
    with pytest.raises(InputError, match=rf"imu\.yaml: {key} should be (greater than 0|0 or more), but is"):
        read_imu(path, np.eye(4))


def test_a_head_as_opencv_wants_it_is_passed_over(rig_of: Callable[..., Rig], tmp_path: Path) -> None:
    rig = rig_of(imu=True)
    headed = read_camchain(written(tmp_path, "%YAML:1.0 # for OpenVINS\n\n" + camchain(rig)))
    assert pixel_difference(rig, headed) < 1e-9
