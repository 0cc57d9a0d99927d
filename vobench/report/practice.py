"""Short recordings to try an estimator on: a drive over a textured floor, seen from above, with something unusual."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.estimator.protocol import Image
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import ImuCalibration, Rig, stereo_rig
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
IMU = ImuCalibration(np.eye(4), 200.0, 1e-4, 1e-3, 1e-5, 1e-4)
IMU_STEP_NS = 5_000_000
GRAVITY_MPS2 = 9.81

FLOOR_SEED = 7
TILES = (60, 42)
TILE_PX = 12
START_ROW_PX = 300  # of the floor, at the top of the first picture
LEFT_COLUMN_PX = 60

ChangePicture = Callable[[int, Image], Image | None]


def unchanged(_: int, picture: Image) -> Image:
    """The picture itself."""
    return picture


def changed_from_middle(change: Callable[[Image], Image | None], *, until: int = LAST_CHANGED) -> ChangePicture:
    """A function that changes the pictures from FIRST_CHANGED up to `until`, excluded."""

    def change_some(index: int, picture: Image) -> Image | None:
        return change(picture) if FIRST_CHANGED <= index < until else picture

    return change_some


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
        """Record the drive in a folder. A picture that `change` turns into None is missing."""
        floor = _floor()
        rig = Rig(RIG.left, RIG.right, RIG.T_body_left, RIG.T_body_right, RIG.wheels, IMU)
        with SequenceWriter(folder, rig, case_json=b"{}") as writer:
            for index in range(FRAMES):
                steps = 0 if self.is_stationary else index
                _write_readings(writer, index, steps)
                left, right = (self.change(index, picture) for picture in _pair(floor, index, steps))
                if left is not None:
                    t_ns = index * STEP_NS
                    writer.write_frame(t_ns, left, right)
                    T_world_left = transform(np.eye(3), [STEP_M * steps, 0.0, 0.0])
                    writer.write_truth(t_ns, T_world_left, np.zeros(6))
        write_ground_truth(folder)
        return folder


def _floor() -> NDArray[np.int64]:
    """Grey values of the floor, in tiles."""
    tiles = np.random.default_rng(FLOOR_SEED).integers(30, 220, TILES)
    return tiles.repeat(TILE_PX, 0).repeat(TILE_PX, 1)


def _pair(floor: NDArray[np.int64], index: int, steps: int) -> list[Image]:
    """The left and the right picture of a frame, after the robot moved by some steps."""
    disparity_px = round(FOCAL_PX * BASELINE_M / HEIGHT_M)
    step_px = round(FOCAL_PX * STEP_M / HEIGHT_M)
    top = START_ROW_PX - step_px * steps
    noise = np.random.default_rng(index).integers(-2, 3, (2, HEIGHT_PX, WIDTH_PX))
    pictures = []
    for eye, left in enumerate((LEFT_COLUMN_PX, LEFT_COLUMN_PX + disparity_px)):
        seen = floor[top : top + HEIGHT_PX, left : left + WIDTH_PX]
        pictures.append((seen + noise[eye]).astype(np.uint8))
    return pictures


def _write_readings(writer: SequenceWriter, index: int, steps: int) -> None:
    """Write the readings of a level IMU since the last frame, and those of the wheels."""
    first = -9 if index else 0
    t_ns = index * STEP_NS + np.arange(first, 1) * IMU_STEP_NS
    force_mps2 = np.tile([0.0, 0.0, GRAVITY_MPS2], (len(t_ns), 1))
    writer.write_imu(ImuReadings(t_ns, np.zeros_like(force_mps2), force_mps2))
    wheels = RIG.wheels
    assert wheels
    revolutions = STEP_M * steps / (2 * np.pi * wheels.radius_m)
    ticks = round(revolutions * wheels.ticks_per_revolution)
    writer.write_encoders([index * STEP_NS], [[ticks, ticks]])


PRACTICES = {
    "drive": Practice(),
    "other end": Practice(change=changed_from_middle(_upside_down, until=FRAMES)),
    "black": Practice(change=changed_from_middle(np.zeros_like)),
    "missing": Practice(change=changed_from_middle(_removed)),
    "standstill": Practice(is_stationary=True),
}
