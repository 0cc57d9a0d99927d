"""Small folders in other people's layouts, written by hand and not by our exporters."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vobench.dataset.layout import read
from vobench.dataset.recording import ReadOptions
from vobench.dataset.sequence import convert
from vobench.geometry import se3
from vobench.geometry.se3 import Array

COUNT = 5
START_NS = 1_403_636_579_763_555_584  # EuRoC's first stamp: float64 would round it
T_BODY_LEFT = se3.transform(Rotation.from_rotvec([0.2, -1.1, 0.4]).as_matrix(), [0.02, -0.06, 0.01])
T_LEFT_RIGHT = se3.transform(Rotation.from_rotvec([0.003, -0.004, 0.002]).as_matrix(), [0.11, 0.001, -0.0005])
INTRINSICS, BENDS = [40.5, 41.25, 23.5, 15.25], [-0.28, 0.07, 2e-4, 1.5e-5]


def matrix(T: Array) -> str:
    return f"[{', '.join(repr(float(value)) for value in T.ravel())}]"


def camera_yaml(T_BS: Array, *, size: tuple[int, int] = (48, 32)) -> str:
    return (
        f"#camera\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: {matrix(T_BS)}\nrate_hz: 20\n"
        f"resolution: [{size[0]}, {size[1]}]\ncamera_model: pinhole\nintrinsics: {INTRINSICS}\n"
        f"distortion_model: radial-tangential\ndistortion_coefficients: {BENDS}\n"
    )


IMU_YAML = (
    f"sensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  data: {matrix(np.eye(4))}\nrate_hz: 200\n"
    "gyroscope_noise_density: 1.6968e-04\ngyroscope_random_walk: 1.9393e-05\n"
    "accelerometer_noise_density: 2.0000e-3\naccelerometer_random_walk: 3.0000e-3\n"
)


def chain_yaml(*, cameras: int = 2, imu: bool = True, size: tuple[int, int] = (48, 32)) -> str:
    text = ""
    for index in range(cameras):
        T_body_cam = T_BODY_LEFT if index == 0 else T_BODY_LEFT @ T_LEFT_RIGHT
        rows = se3.inverse(T_body_cam).tolist()
        text += f"cam{index}:\n"
        text += f"  T_cam_imu: {rows}\n" if imu else ""
        text += f"  T_cn_cnm1: {se3.inverse(T_LEFT_RIGHT).tolist()}\n" if index else ""
        text += (
            f"  camera_model: pinhole\n  distortion_coeffs: {BENDS}\n  distortion_model: radtan\n"
            f"  intrinsics: {INTRINSICS}\n  resolution: [{size[0]}, {size[1]}]\n"
        )
    return text


@dataclass(frozen=True, slots=True)
class Scene:
    """What every layout is made of: pictures (N, H, W), stamps, true poses of the body, an IMU's rows (M, 6)."""

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    t_ns: NDArray[np.int64]
    T_world_body: Array
    imu_ns: NDArray[np.int64]
    imu: Array

    def euroc(self, folder: Path, *, widen: Callable[[Any], Any] = lambda picture: picture) -> Path:
        """mav0 with two cameras, an IMU and the batch estimate of the truth."""
        mav = folder / "mav0"
        mounts = (T_BODY_LEFT, T_BODY_LEFT @ T_LEFT_RIGHT)
        for name, pictures, T in zip(("cam0", "cam1"), (self.left, self.right), mounts, strict=True):
            put(mav / name / "sensor.yaml", camera_yaml(T))
            put(
                mav / name / "data.csv", "#timestamp [ns],filename\r\n" + "".join(f"{t},{t}.png\r\n" for t in self.t_ns)
            )
            for t, pixels in zip(self.t_ns, pictures, strict=True):
                png(mav / name / "data" / f"{t}.png", widen(pixels))
        put(mav / "imu0" / "sensor.yaml", IMU_YAML)
        rows = zip(self.imu_ns.tolist(), self.imu.tolist(), strict=True)
        put(
            mav / "imu0" / "data.csv",
            "#timestamp [ns],w\n" + "".join(f"{t},{','.join(map(repr, r))}\n" for t, r in rows),
        )
        put(mav / "state_groundtruth_estimate0" / "data.csv", self.state())
        return folder

    def state(self) -> str:
        q = se3.to_quaternion(self.T_world_body[:, :3, :3])[:, [3, 0, 1, 2]]
        values = np.hstack([self.T_world_body[:, :3, 3], q, np.zeros((len(q), 9))]).tolist()
        rows = zip(self.t_ns.tolist(), values, strict=True)
        return "#timestamp, p_x\n" + "".join(f"{t},{','.join(map(repr, row))}\n" for t, row in rows)

    def kitti(self, folder: Path, *, pair: tuple[str, str] = ("image_0", "image_1"), colour: bool = False) -> Path:
        """sequences/00 and poses/00.txt, the poses those of the left grey camera."""
        sequence = folder / "sequences" / "00"
        for name, pictures in zip(pair, (self.left, self.right), strict=True):
            for index, pixels in enumerate(pictures):
                png(sequence / name / f"{index:06d}.png", np.dstack([pixels] * 3) if colour else pixels)
        seconds = [(t - START_NS) / 1e9 for t in self.t_ns.tolist()]
        put(sequence / "times.txt", "".join(f"{s:.9e}\n" for s in seconds))
        shifts = {"P0": 0.0, "P1": -0.5, "P2": 0.06, "P3": -0.48}
        rows = {name: [40.0, 0, 23.5, 40.0 * x, 0, 40.0, 15.5, 0, 0, 0, 1, 0] for name, x in shifts.items()}
        rows["Tr"] = [0.0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0]
        put(sequence / "calib.txt", "".join(f"{name}: {' '.join(map(repr, row))}\n" for name, row in rows.items()))
        poses = self.T_world_body[:, :3].reshape(-1, 12)
        put(folder / "poses" / "00.txt", "".join(" ".join(f"{value:.9e}" for value in row) + "\n" for row in poses))
        return sequence

    def tum(self, folder: Path) -> Path:
        """rgbd_dataset_freiburg1_xyz as the benchmark has it, with its four digits in the truth."""
        folder = folder / "rgbd_dataset_freiburg1_xyz"
        stamps = [f"130503110{2 + i}.{175_304 + i:06d}" for i in range(COUNT)]
        for stamp, pixels in zip(stamps, self.left, strict=True):
            png(folder / "rgb" / f"{stamp}.png", np.dstack([cv2.resize(pixels, (640, 480))] * 3))
        head = "# color images\n# file: 'rgbd_dataset_freiburg1_xyz.bag'\n# timestamp filename\n"
        put(folder / "rgb.txt", head + "".join(f"{stamp} rgb/{stamp}.png\n" for stamp in stamps))
        put(folder / "depth.txt", "# depth maps\n")
        rows = [f"130503110{1 + i}.5000 1.0 {i}.25 0.5 0.0 0.0 0.7071 0.7071" for i in range(COUNT + 3)]
        put(folder / "groundtruth.txt", "# ground truth trajectory\n" + "\n".join(rows) + "\n")
        return folder

    def tartanair(self, folder: Path) -> Path:
        """P000 of the first TartanAir, 640 x 480 in colour."""
        for name, side, pictures in (("image_left", "left", self.left), ("image_right", "right", self.right)):
            for index, pixels in enumerate(pictures):
                colour = np.dstack([cv2.resize(pixels, (640, 480))] * 3)
                png(folder / name / f"{index:06d}_{side}.png", colour)
        q = se3.to_quaternion(self.T_world_body[:, :3, :3])
        rows = np.hstack([self.T_world_body[:, :3, 3], q]).tolist()
        put(folder / "pose_left.txt", "".join(" ".join(map(repr, row)) + "\n" for row in rows))
        return folder


def put(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode())


def png(path: Path, pixels: NDArray[Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(cv2.imencode(".png", pixels)[1].tobytes())


@pytest.fixture(scope="session")
def scene() -> Scene:
    rng = np.random.default_rng(8)
    left, right = (
        np.stack([cv2.GaussianBlur(p, (0, 0), 1.0) for p in many])
        for many in rng.integers(0, 256, (2, COUNT, 32, 48), np.uint8)
    )
    t_ns = START_NS + np.arange(COUNT) * 50_000_001
    s = np.arange(COUNT)
    R = Rotation.from_rotvec(np.stack([0.1 * s, -0.2 * s, 0.3 * s], -1)).as_matrix()
    poses = se3.transform(R, np.stack([0.5 * s, np.sin(s), 0.1 * s], -1))
    imu_ns = START_NS - 5_000_001 + np.arange(42) * 5_000_003  # one beyond the pictures on either side
    return Scene(left, right, t_ns, poses, imu_ns, rng.normal(size=(42, 6)))


@pytest.fixture
def imported(tmp_path: Path) -> Callable[..., Path]:
    """Read a recording and write it as a sequence: its folder."""

    def through(path: Path, **options: Any) -> Path:
        folder = tmp_path / "imported"
        convert(read(path, options=ReadOptions(**options)), folder)
        return folder

    return through


@pytest.fixture
def camchain() -> Callable[..., str]:
    return chain_yaml


@pytest.fixture
def placed() -> tuple[Array, Array]:
    """T_body_left and T_left_right of the layouts with calibration."""
    return T_BODY_LEFT, T_LEFT_RIGHT
