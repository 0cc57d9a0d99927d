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

from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.rig import ImuCalibration, Rig, WheelGeometry, mounted, side_by_side
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.sensor.pixel_truth import TruthFrame
from vobench.sequence import SequenceWriter

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
    rig = mounted(lens, lens, T_left_right, pitch_deg=21.0, wheels=WheelGeometry(0.1, 0.3, 4096))
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
