"""Short recordings to try an estimator on: a drive over a textured floor, seen from above, with something unusual."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vobench.estimator.protocol import Image
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import ImuCalibration, stereo_rig
from vobench.geometry.se3 import transform
from vobench.runner.ground_truth import write_ground_truth
from vobench.sensor.imu import ImuReadings
from vobench.sequence import SequenceWriter

WIDTH_PX = 320
HEIGHT_PX = 240
FOCAL_PX = 240
LENS = Pinhole(WIDTH_PX, HEIGHT_PX, float(FOCAL_PX), float(FOCAL_PX), 159.5, 119.5)
HEIGHT_M = 0.4
BASELINE_M = 0.05
STEP_M = 0.005
STEP_NS = 50_000_000
FRAMES = 20
FIRST_CHANGED = 10
LAST_CHANGED = 13  # excluded
RIG = stereo_rig(LENS, pitch_deg=90, baseline_m=BASELINE_M, height_m=HEIGHT_M)
IMU_STEP_NS = 5_000_000
IMU_READINGS_PER_FRAME = STEP_NS // IMU_STEP_NS
IMU = ImuCalibration(
    T_body_imu=np.eye(4),
    rate_hz=200.0,
    gyro_noise=1e-4,
    accel_noise=1e-3,
    gyro_walk=1e-5,
    accel_walk=1e-4,
)
GRAVITY_MPS2 = 9.81

FLOOR_SEED = 7
TILE_ROWS = 60
TILE_COLUMNS = 42
TILE_PX = 12
MIN_TILE_DN = 30
MAX_TILE_DN = 220  # excluded
NOISE_DN = 2  # the largest, of single pixels
# Where the first picture of the left camera lies on the floor.
START_TOP_PX = 300
LEFT_COLUMN_PX = 60

ChangePicture = Callable[[int, Image], Image | None]


def unchanged(_: int, picture: Image) -> Image:
    """The picture itself."""
    return picture


def changed_from_middle(change: Callable[[Image], Image | None], *, until: int = LAST_CHANGED) -> ChangePicture:
    """A function that changes the pictures from FIRST_CHANGED up to `until`, excluded."""

    def change_if_in_range(index: int, picture: Image) -> Image | None:
        is_in_range = FIRST_CHANGED <= index < until
        return change(picture) if is_in_range else picture

    return change_if_in_range


def _upside_down(picture: Image) -> Image:
    return picture[::-1]


def _removed(_: Image) -> None:
    return None


@dataclass(frozen=True, slots=True)
class Practice:
    """A recording of a drive over a textured floor; `change` makes some of its pictures unusual."""

    is_stationary: bool = False
    change: ChangePicture = unchanged

    def write(self, folder: Path) -> Path:
        """Record the drive in a folder. A frame whose pictures `change` turns into None is missing."""
        floor = _floor()
        with SequenceWriter(folder, replace(RIG, imu=IMU), case_json=b"{}") as writer:
            for index in range(FRAMES):
                steps = 0 if self.is_stationary else index
                _write_readings(writer, index, steps)

                pair = _pair(floor, index, steps)
                left = self.change(index, pair.left)
                right = self.change(index, pair.right)
                if left is None:
                    continue
                t_ns = index * STEP_NS
                T_world_left = transform(np.eye(3), [STEP_M * steps, 0.0, 0.0])
                writer.write_frame(t_ns, left, right)
                writer.write_truth(t_ns, T_world_left, np.zeros(6))
        write_ground_truth(folder)
        return folder


def _floor() -> NDArray[np.int64]:
    """The grey values of the floor, whose square tiles have random brightness."""
    rng = np.random.default_rng(FLOOR_SEED)
    tiles = rng.integers(MIN_TILE_DN, MAX_TILE_DN, (TILE_ROWS, TILE_COLUMNS))
    return tiles.repeat(TILE_PX, 0).repeat(TILE_PX, 1)


class _Pair(NamedTuple):
    """The two pictures of a frame."""

    left: Image
    right: Image


def _pair(floor: NDArray[np.int64], index: int, steps: int) -> _Pair:
    """The two pictures of a frame after a number of steps forward, with the noise of frame `index`."""
    disparity_px = round(FOCAL_PX * BASELINE_M / HEIGHT_M)
    step_px = round(FOCAL_PX * STEP_M / HEIGHT_M)
    top_px = START_TOP_PX - step_px * steps
    left_noise, right_noise = np.random.default_rng(index).integers(-NOISE_DN, NOISE_DN + 1, (2, HEIGHT_PX, WIDTH_PX))
    return _Pair(
        left=_picture(floor, top_px, LEFT_COLUMN_PX, left_noise),
        right=_picture(floor, top_px, LEFT_COLUMN_PX + disparity_px, right_noise),
    )


def _picture(floor: NDArray[np.int64], top_px: int, left_column_px: int, noise: NDArray[np.int64]) -> Image:
    """The part of the floor below and to the right of a pixel, with noise."""
    visible = floor[top_px : top_px + HEIGHT_PX, left_column_px : left_column_px + WIDTH_PX]
    return (visible + noise).astype(np.uint8)


def _write_readings(writer: SequenceWriter, index: int, steps: int) -> None:
    """Write the readings of a level IMU since the last frame, and those of the wheels."""
    # The last reading is at the time of the frame; before the first frame, there are no others.
    readings = IMU_READINGS_PER_FRAME if index else 1
    t_ns = index * STEP_NS + np.arange(1 - readings, 1) * IMU_STEP_NS
    force_mps2 = np.tile([0.0, 0.0, GRAVITY_MPS2], (len(t_ns), 1))
    writer.write_imu(ImuReadings(t_ns, np.zeros_like(force_mps2), force_mps2))

    wheels = RIG.wheels
    assert wheels
    revolutions = STEP_M * steps / (2 * np.pi * wheels.radius_m)
    ticks = round(revolutions * wheels.ticks_per_revolution)
    writer.write_encoders([index * STEP_NS], [[ticks, ticks]])


PRACTICES = {
    "drive": Practice(),
    # It begins as `drive` and ends differently. The first poses of a causal estimator are the same in both.
    "other end": Practice(change=changed_from_middle(_upside_down, until=FRAMES)),
    "black": Practice(change=changed_from_middle(np.zeros_like)),
    "missing": Practice(change=changed_from_middle(_removed)),
    "standstill": Practice(is_stationary=True),
}
