"""What a body carries: one or two cameras of any kind, their mounts, wheels and an IMU."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.se3 import Array

# Focal length, sensor and resolution as the paper gives them (section II-B).
PAPER_FOCAL_MM, PAPER_SENSOR_MM, PAPER_SIZE_PX = 32.0, (35.0, 28.18), (720, 480)


@dataclass(frozen=True, slots=True)
class WheelGeometry:
    """Nominal geometry of the two driven wheels, as an odometer believes it. Raises InputError where it is none."""

    radius_m: float
    track_m: float
    ticks_per_revolution: int

    def __post_init__(self) -> None:
        for name in ("radius_m", "track_m", "ticks_per_revolution"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(f"a wheel's {name} must be finite and above 0, got {getattr(self, name)}")


# Radius and track: CoppeliaSim's Pioneer 3-DX; 500 lines x 4 edges x gear 38.3, from the data sheet.
PIONEER_WHEELS = WheelGeometry(radius_m=0.0975, track_m=0.331, ticks_per_revolution=76_600)


@dataclass(frozen=True, slots=True)
class ImuCalibration:
    """An IMU on the body as its calibration has it: where it sits, and how noisy it is said to be.

    White noise as densities in rad/s/√Hz and m/s²/√Hz, the walks of both biases in rad/s²/√Hz and
    m/s³/√Hz: the four numbers of Kalibr's imu.yaml.
    """

    T_body_imu: Array
    rate_hz: float
    gyro_noise: float
    accel_noise: float
    gyro_walk: float
    accel_walk: float


Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = ("left", "right")
ONE_CAMERA = "this rig has one camera, and a stereo pair is asked for"


@dataclass(frozen=True, slots=True)
class Rig:
    """The cameras, where they sit on the body, the wheels and the IMU: all the calibration there is.

    The left camera is the reference; all look along their own z axis. A rig of one camera has no
    right one; wheels and imu are None where the recording has none.
    """

    left: Camera
    right: Camera | None
    T_body_left: Array
    T_body_right: Array | None
    wheels: WheelGeometry | None = None
    imu: ImuCalibration | None = None

    @property
    def sides(self) -> tuple[Side, ...]:
        """The cameras there are."""
        return SIDES if self.right else SIDES[:1]

    def camera(self, side: Side) -> Camera:
        """One of the cameras. Raises InputError where the rig has no right one."""
        camera = self.left if side == "left" else self.right
        if camera is None:
            raise InputError(ONE_CAMERA)
        return camera

    def T_body_camera(self, side: Side) -> Array:
        """Where it sits on the body. Raises InputError where the rig has no right one."""
        T_body_camera = self.T_body_left if side == "left" else self.T_body_right
        if T_body_camera is None:
            raise InputError(ONE_CAMERA)
        return T_body_camera

    @property
    def T_left_right(self) -> Array:
        """Pose of the right camera seen from the left one."""
        return se3.inverse(self.T_body_left) @ self.T_body_camera("right")

    @property
    def baseline_m(self) -> float:
        """Distance between the two optical centres."""
        return float(np.linalg.norm(self.T_left_right[:3, 3]))


def paper_lens(*, square_pixels: bool) -> Pinhole:
    """The paper's 32 mm lens on 35 x 28.18 mm and 720 x 480 pixels, in either reading.

    Taken literally both sensor sides count and pixels are not square (fx 658.3, fy 545.1);
    Blender fits the width alone, which gives fx = fy = 658.3.
    """
    width, height = PAPER_SIZE_PX
    fx = PAPER_FOCAL_MM / PAPER_SENSOR_MM[0] * width
    fy = fx if square_pixels else PAPER_FOCAL_MM / PAPER_SENSOR_MM[1] * height
    return Pinhole(width, height, fx, fy, (width - 1) / 2, (height - 1) / 2)


LENSES = {
    "paper_literal": paper_lens(square_pixels=False),
    "paper_blender": paper_lens(square_pixels=True),
}


def looking(*, pitch_deg: float, position_m: tuple[float, float, float]) -> Array:
    """T_body_camera of a camera that looks ahead and `pitch_deg` below the horizon (90: at the floor)."""
    pitch = np.deg2rad(pitch_deg)
    forward = np.array([np.cos(pitch), 0.0, -np.sin(pitch)])
    right = np.array([0.0, -1.0, 0.0])
    return se3.transform(np.stack([right, np.cross(forward, right), forward], -1), position_m)


def mounted(
    left: Camera,
    right: Camera,
    T_left_right: Array,
    *,
    pitch_deg: float,
    forward_m: float = 0.25,
    height_m: float = 0.4,
    wheels: WheelGeometry = PIONEER_WHEELS,
) -> Rig:
    """A pair astride the robot's middle, `forward_m` ahead of its axle; pitch and height are the left camera's."""
    baseline_m = float(np.linalg.norm(T_left_right[:3, 3]))
    T_body_left = looking(pitch_deg=pitch_deg, position_m=(forward_m, baseline_m / 2, height_m))
    return Rig(left, right, T_body_left, T_body_left @ T_left_right, wheels)


def stereo_rig(
    lens: Camera,
    *,
    pitch_deg: float,
    baseline_m: float = 0.12,
    forward_m: float = 0.25,
    height_m: float = 0.4,
    wheels: WheelGeometry = PIONEER_WHEELS,
) -> Rig:
    """Two equal cameras side by side across the robot, `forward_m` ahead of its axle."""
    place = side_by_side(baseline_m)
    return mounted(lens, lens, place, pitch_deg=pitch_deg, forward_m=forward_m, height_m=height_m, wheels=wheels)


def side_by_side(baseline_m: float) -> Array:
    """T_left_right of two parallel cameras."""
    return se3.transform(np.eye(3), [baseline_m, 0.0, 0.0])
