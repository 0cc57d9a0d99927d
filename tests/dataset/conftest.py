"""Small sequences with textured pictures, made as a test asks for them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
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
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.rig import ImuCalibration, Rig, WheelGeometry, mounted_rig, side_by_side
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.sensor.pixel_truth import TruthFrame
from vobench.sequence import Sequence, SequenceWriter, read_truth

START_NS = 1_403_636_579_763_555_584  # EuRoC's first stamp: float64 would round it
IMU = ImuCalibration(
    se3.transform(Rotation.from_rotvec([0.3, -0.2, 1.1]).as_matrix(), [0.06, -0.02, 0.31]),
    200.0,
    1.7e-4,
    2e-3,
    1e-5,
    3e-3,
)
PLAIN = Pinhole(64, 48, 55.5, 54.25, 31.25, 24.5)


@dataclass(frozen=True, slots=True)
class Made:
    """A sequence as it was written: its folder and all that went into it, by frame."""

    folder: Path
    rig: Rig
    t_ns: NDArray[np.int64]
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    truth_ns: NDArray[np.int64]
    T_world_body: Array
    twist: Array
    imu: ImuReadings
    depth_m: NDArray[np.float32]

    @property
    def T_world_left(self) -> Array:
        return self.T_world_body @ self.rig.T_body_left


def make_rig(lens: Camera = PLAIN, *, T_left_right: Array | None = None, stereo: bool = True, imu: bool = False) -> Rig:
    T_left_right = side_by_side(0.117) if T_left_right is None else T_left_right
    rig = mounted_rig(lens, lens, T_left_right, pitch_deg=21.0, wheels=WheelGeometry(0.1, 0.3, 4096))
    rig = rig if stereo else replace(rig, right=None, T_body_right=None)
    return replace(rig, imu=IMU) if imu else rig


def texture(rng: np.random.Generator, camera: Camera, count: int) -> NDArray[np.uint8]:
    """Smooth random pictures (N, H, W), so that resampling means something."""
    noise = rng.integers(0, 256, (count, camera.height_px, camera.width_px), np.uint8)
    return np.stack([cv2.GaussianBlur(picture, (0, 0), 1.5) for picture in noise])


def uneven(count: int, start_ns: int = START_NS) -> NDArray[np.int64]:
    """Stamps about 50 ms apart, each by another odd number of nanoseconds."""
    gaps = 50_000_000 + np.random.default_rng(5).integers(-3_000_001, 3_000_001, count)
    return start_ns + np.concatenate([[0], np.cumsum(gaps)[:-1]])


def make_poses(t_ns: NDArray[np.int64]) -> Array:
    """A path (N, 4, 4) that turns about all axes."""
    s = (t_ns - t_ns[:1]) / 1e9
    R = Rotation.from_rotvec(np.stack([0.1 * np.sin(s), 0.3 * s, 2.0 * s], -1)).as_matrix()
    return se3.transform(R, np.stack([np.cos(s), 3.0 + s, 0.1 * s * s], -1))


def make(folder: Path, rig: Rig, count: int, start_ns: int, truth_ns: NDArray[np.int64] | None) -> Made:
    """What goes into a sequence, not yet written; the truth at the frames' stamps unless it has its own."""
    rng, t_ns = np.random.default_rng(11), uneven(count, start_ns)
    truth_ns = t_ns if truth_ns is None else truth_ns
    imu_ns = np.arange(t_ns[0] - 4_999_999, t_ns[-1] + 1, 5_000_001)
    depth_m = rng.uniform(0.5, 20.0, (count, rig.left.height_px, rig.left.width_px)).astype(np.float32)
    depth_m[:, 0, 0] = np.nan
    return Made(
        folder,
        rig,
        t_ns,
        texture(rng, rig.left, count),
        texture(rng, rig.right or rig.left, count),
        truth_ns,
        make_poses(truth_ns),
        rng.normal(size=(len(truth_ns), 6)),
        ImuReadings(imu_ns, rng.normal(size=(len(imu_ns), 3)), rng.normal(size=(len(imu_ns), 3))),
        depth_m,
    )


def write_sequence(
    folder: Path,
    rig: Rig,
    *,
    count: int = 5,
    start_ns: int = START_NS,
    truth_ns: NDArray[np.int64] | None = None,
    exposures: tuple[float, ...] = (0.002, 0.005, 0.0125, 0.004, 0.003),
    gain_db: float = 6.0,
    depth: bool = False,
    with_twist: bool = True,
    case_json: bytes | None = b'{"seed": 7}',
    **writing: Any,
) -> Made:
    made = make(folder, rig, count, start_ns, truth_ns)
    first_ns = min(int(t_ns[0]) for t_ns in (made.imu.t_ns, made.truth_ns) if len(t_ns))
    channels = ("depth",) if depth else ()
    with SequenceWriter(
        folder, rig, case_json=case_json, truth_channels=channels, start_ns=max(first_ns, 0), **writing
    ) as writer:
        for i, t in enumerate(made.t_ns.tolist()):
            write_readings(writer, made, i)
            writer.write_frame(t, made.left[i], made.right[i] if rig.right else None)
            if exposures:
                writer.write_exposure(t, exposures[i % len(exposures)], gain_db)
            write_truth(writer, made, i, with_twist=with_twist)
            for side in rig.sides if depth else ():
                writer.write_truth_frame(t, side, TruthFrame(depth=made.depth_m[i]))
    return made


def since_last(stamps: NDArray[np.int64], made: Made, i: int) -> slice:
    """Which of some stamps come after frame i - 1 and up to frame i; the last frame takes the rest."""
    begin = int(np.searchsorted(stamps, made.t_ns[i - 1], side="right")) if i else 0
    end = int(np.searchsorted(stamps, made.t_ns[i], side="right"))
    return slice(begin, len(stamps) if i == len(made.t_ns) - 1 else end)


def write_readings(writer: SequenceWriter, made: Made, i: int) -> None:
    imu, new = made.imu, since_last(made.imu.t_ns, made, i)
    if made.rig.imu:
        writer.write_imu(ImuReadings(imu.t_ns[new], imu.gyro_radps[new], imu.accel_mps2[new]))
    if made.rig.wheels:
        writer.write_encoders(made.t_ns[i : i + 1], [[i, -i]])


def write_truth(writer: SequenceWriter, made: Made, i: int, *, with_twist: bool) -> None:
    for k in range(*since_last(made.truth_ns, made, i).indices(len(made.truth_ns))):
        t, twist = int(made.truth_ns[k]), made.twist[k]
        writer.write_truth(t, made.T_world_body[k], twist if with_twist else None)
        if made.rig.imu:
            writer.write_imu_bias(t, twist[:3] * 1e-2, twist[3:] * 1e-1)


@pytest.fixture
def make_sequence(tmp_path: Path) -> Callable[..., Made]:
    """Write a sequence into a folder of its own: `make_sequence(rig, **what)`."""

    def make_one(rig: Rig | None = None, **what: Any) -> Made:
        folder = tmp_path / f"sequence{len(list(tmp_path.iterdir()))}"
        return write_sequence(folder, rig or make_rig(), **what)

    return make_one


@pytest.fixture(name="rig_of")
def rig_fixture() -> Callable[..., Rig]:
    return make_rig


COUNT = 5
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

    def kapture(self, folder: Path, *, unit_ns: int = 1) -> Path:
        """A rig of two cameras with fisheye lenses, and the poses of the rig."""
        sensors = folder / "sensors"
        head = "# kapture format: 1.1\n"
        lens = "camera, OPENCV_FISHEYE, 48, 32, 40.5, 41.25, 23.5, 15.25, -0.28, 0.07, 0.0002, 0.000015"
        put(sensors / "sensors.txt", f"{head}starboard, , {lens}\nport, , {lens}\nantenna, , gnss, EPSG:4326\n")
        mounts = {"starboard": T_BODY_LEFT @ T_LEFT_RIGHT, "port": T_BODY_LEFT}
        rows = [f"ship, {name}, {pose_row(se3.inverse(T))}\n" for name, T in mounts.items()]
        put(sensors / "rigs.txt", head + "".join(rows))
        stamps = (self.t_ns // unit_ns).tolist()
        lines = []
        for name, pictures in (("port", self.left), ("starboard", self.right)):
            for stamp, pixels in zip(stamps, pictures, strict=True):
                lines.append(f"{stamp}, {name}, {name}/{stamp}.png\n")
                png(sensors / "records_data" / name / f"{stamp}.png", pixels)
        put(sensors / "records_camera.txt", head + "".join(reversed(lines)))
        poses = zip(stamps, self.T_world_body, strict=True)
        put(
            sensors / "trajectories.txt",
            head + "".join(f"{stamp}, ship, {pose_row(se3.inverse(T))}\n" for stamp, T in poses),
        )
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


def with_everything_of(scene: Scene, folder: Path) -> Sequence:
    """The sequence in a folder, after a check that it has the pictures, stamps and true poses of a scene."""
    sequence, truth = Sequence.open(folder), read_truth(folder)
    assert sequence.frame_stamps().tolist() == scene.t_ns.tolist() == truth.t_ns.tolist()
    for frame, left, right in zip(sequence.frames(), scene.left, scene.right, strict=True):
        assert np.array_equal(frame.left, left)
        assert np.array_equal(frame.right, right)
    assert np.abs(truth.T_world_frame - scene.T_world_body).max() < 1e-9
    return sequence


def pose_row(T: Array) -> str:
    """A transform as kapture writes it: qw, qx, qy, qz, tx, ty, tz."""
    qx, qy, qz, qw = se3.to_quaternion(T[None, :3, :3])[0].tolist()
    return ", ".join(map(repr, [qw, qx, qy, qz, *T[:3, 3].tolist()]))


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
