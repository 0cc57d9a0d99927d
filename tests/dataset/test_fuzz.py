"""A thousand spoilt text files and more: each is read or refused in a sentence, and none takes long or much memory."""

import resource

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vobench.dataset.calibration_file import read_yaml
from vobench.dataset.euroc import SensorYamlImu, read_imu_csv, sensor_camera
from vobench.dataset.kalibr import ImuDensities, read_camchain, read_imu
from vobench.dataset.kitti_calibration import read_calibration
from vobench.dataset.picture import read_text
from vobench.dataset.picture_list import read_list
from vobench.dataset.truth_file import read_truth_file
from vobench.errors import VobenchError
from vobench.trajectory.kitti import parse_times
from vobench.trajectory.trajectory import Trajectory

MANY, SOME = (
    settings(max_examples=count, suppress_health_check=[HealthCheck.function_scoped_fixture]) for count in (200, 80)
)
MORE_BYTES = 300 << 20  # what a few kilobytes of text may make a process grow by, and never do

TUM = "# t x y z qx qy qz qw\n1305031102.1753 1.3 0.6 1.6 0 0 0.6 0.8\n1305031102.2758 1.3 0.6 1.6 0 0 0 1\n"
EUROC = (
    "#timestamp [ns], p_x\n"
    "1403636579763555584,4.6,-1.7,0.8,1,0,0,0,1,2,3\n"
    "1403636579813555456,4.6,-1.7,0.8,1,0,0,0,1,2,3\n"
)
KITTI = "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1e-2 0 1 0 2 0 0 1 3\n"
TARTANAIR = "1 2 3 0 0 0 1\n1.5 2 3 0 0 0.6 0.8\n"
TIMES = "0.0\n1.036224e-01\n2.1e-01\n"
LIST = "#timestamp [ns],filename\n1403636579763555584,a.png\n1403636579813555456,b.png\n"
IMU = "#timestamp [ns],w\n1403636579758555392,-0.09,0.14,0.07,8.1,-0.3,-3.1\n1403636579763555584,-0.1,0.1,0,8,0,-3\n"
CALIB = "P0: 718.8 0 607.1 0 0 718.8 185.2 0 0 0 1 0\nP1: 718.8 0 607.1 -386.1 0 718.8 185.2 0 0 0 1 0\n"
SENSOR = """\
sensor_type: camera
T_BS: {rows: 4, cols: 4, data: [1, 0, 0, 0.1, 0, 1, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]}
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.6, 457.2, 367.2, 248.3]
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 1.9e-4, 1.7e-05]
gyroscope_noise_density: 1.6968e-04
gyroscope_random_walk: 1.9393e-05
accelerometer_noise_density: 2.0e-3
accelerometer_random_walk: 3.0e-3
update_rate: 200.0
"""
CHAIN = """\
cam0:
  T_cam_imu:
  - [1.0, 0.0, 0.0, 0.1]
  - [0.0, 1.0, 0.0, 0.2]
  - [0.0, 0.0, 1.0, 0.3]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [0.003, 0.0007, -0.002, 0.0002]
  distortion_model: equidistant
  intrinsics: [190.9, 190.9, 254.9, 256.8]
  resolution: [512, 512]
"""
# What breaks readers: signs of every grammar, numbers at every edge, other scripts, other line ends.
SIGNS = [
    "",
    "\n",
    "\r\n",
    "\r",
    "\t",
    " ",
    ",",
    ",,",
    ";",
    "#",
    ":",
    ": ",
    "- ",
    "[",
    "]",
    "{",
    "}",
    "|",
    ">",
    "%",
    "'",
    '"',
]
NUMBERS = ["nan", "inf", "-inf", "1e999", "-1e400", "1e-999", "0x1F", "1_000", "1e+", ".", "-", "-0.0"]
LONG = ["9" * 30, "0" * 400, "1" * 5000]
WORDS = ["&a ", "*a", "!!int ", "<<: ", "../../x", "/etc/passwd", "C:\\x"]
LETTERS = ["\0", "\ufeff", "\u2028", "\x85", "\u0663", "\u00bd", "\uff45", "\ud7ff", "\u00e9"]
ODD = st.sampled_from([*SIGNS, *NUMBERS, *LONG, *WORDS, *LETTERS])


@st.composite
def spoilt(draw, *texts):
    """One of the texts with a few cuts, copies and odd pieces; or any bytes at all."""
    if draw(st.integers(0, 9)) == 0:
        return draw(st.binary(max_size=300))
    text = draw(st.sampled_from(texts))
    for _ in range(draw(st.integers(1, 6))):
        begin = draw(st.integers(0, len(text)))
        end = min(len(text), begin + draw(st.integers(0, 12)))
        piece = draw(st.one_of(ODD, st.just(text[end : end + 40] * 3), st.text(max_size=8)))
        text = text[:begin] + piece + text[end:]
    return text.encode("utf-8", "surrogatepass")


def tried(read, path, data):
    """What a reader makes of some bytes, or None where it says in one line that it is nothing."""
    path.write_bytes(data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    result, said = None, "read"
    try:
        result = read(path)
    except VobenchError as error:
        said = str(error)
    assert said.strip()
    assert "\n" not in said
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) << 10 < MORE_BYTES
    return result


def assert_sound(trajectory):
    if trajectory is not None:
        assert isinstance(trajectory, Trajectory)
        assert np.isfinite(trajectory.T_world_frame).all()
        assert (np.diff(trajectory.t_ns) > 0).all()


@MANY
@given(spoilt(TUM))
def test_tum_trajectories(tmp_path, data):
    assert_sound(tried(lambda path: read_truth_file(path, np.arange(2))[0], tmp_path / "t.txt", data))


@MANY
@given(spoilt(EUROC))
def test_euroc_trajectories(tmp_path, data):
    assert_sound(tried(lambda path: read_truth_file(path, np.arange(2))[0], tmp_path / "t.csv", data))


@MANY
@given(spoilt(KITTI))
def test_kitti_trajectories(tmp_path, data):
    assert_sound(tried(lambda path: read_truth_file(path, np.arange(2))[0], tmp_path / "t.txt", data))


@MANY
@given(spoilt(TARTANAIR))
def test_tartanair_trajectories(tmp_path, data):
    assert_sound(tried(lambda path: read_truth_file(path, np.arange(2))[0], tmp_path / "t.txt", data))


@MANY
@given(spoilt(TUM, EUROC, KITTI, TARTANAIR, TIMES))
def test_trajectories_cut_from_each_other(tmp_path, data):
    assert_sound(tried(lambda path: read_truth_file(path, np.arange(3))[0], tmp_path / "t.txt", data))


@SOME
@given(spoilt(TIMES))
def test_files_of_times(tmp_path, data):
    t_ns = tried(lambda path: parse_times(read_text(path), name=str(path)), tmp_path / "times.txt", data)
    assert t_ns is None or (np.diff(t_ns) > 0).all()


@SOME
@given(spoilt(LIST))
def test_lists_of_pictures(tmp_path, data):
    folder = tmp_path / "data"
    folder.mkdir(exist_ok=True)
    for name in ("a.png", "b.png"):
        (folder / name).touch()
    found = tried(lambda path: read_list(path, folder, separator=",", unit="ns"), tmp_path / "data.csv", data)
    assert found is None or all(path.is_relative_to(folder) and ".." not in path.parts for path in found.paths)


@SOME
@given(spoilt(IMU))
def test_readings_of_an_imu(tmp_path, data):
    readings = tried(read_imu_csv, tmp_path / "data.csv", data)
    assert readings is None or (np.isfinite(readings.gyro_radps).all() and (np.diff(readings.t_ns) > 0).all())


@SOME
@given(spoilt(CALIB))
def test_matrices_of_kitti(tmp_path, data):
    matrices = tried(read_calibration, tmp_path / "calib.txt", data)
    assert matrices is None or all(np.isfinite(P).all() for P in matrices.values())


@SOME
@given(spoilt(SENSOR, CHAIN))
def test_calibrations(tmp_path, data):
    path = tmp_path / "any.yaml"
    for read in (
        sensor_camera,
        lambda p: read_yaml(p).checked(SensorYamlImu),
        lambda p: read_yaml(p).checked(ImuDensities),
        read_camchain,
        lambda p: read_imu(p, np.eye(4)),
    ):
        tried(read, path, data)
