"""The axes of a suite, and the settings of two of them: rigs and cameras."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge, Gt, Le

from vobench.errors import InputError, SettingError
from vobench.geometry.rig import (
    PRESETS,
    RESIDUALS,
    CalibrationError,
    CustomStereoPair,
    Rig,
    custom_stereo_pair,
    mounted_rig,
    resized,
)
from vobench.sensor.image_sensor import SENSOR_PRESETS, CameraSettings
from vobench.sensor.imu import IMUS, ImuSettings
from vobench.setting import FromPreset, OneOf, Positive, ShortForm, settings
from vobench.suite.trajectory import TrajectorySpec

AXES = ("scene", "lighting", "rig", "trajectory", "camera")
LENS_KEYS = ("own", "calib", "camchain")  # replace the preset
EXACT_CALIBRATION = CalibrationError()
Camera = Annotated[CameraSettings, SENSOR_PRESETS]


def _as_level(value: Any) -> Any:
    return {"level": value} if isinstance(value, str) else value


Calibration = Annotated[CalibrationError, ShortForm(_as_level, {"type": "string", "enum": ["none", *RESIDUALS]})]


@settings()
class RigSettings:
    """A stereo pair on a body: its lenses and mounting, its calibration error, and an IMU.

    The lenses are those of the preset, unless they are given by `own` or by a file: `calib` is a file of KITTI, for
    images of `size_px`, and `camchain` a file of Kalibr. Without `baseline_m`, the baseline is that of the preset.
    `picture_scale` multiplies the width and the height of images.
    """

    lens: Annotated[str, OneOf("lens", PRESETS)] = "paper_blender"
    own: CustomStereoPair | None = None
    calib: str | None = None
    size_px: tuple[Annotated[int, Gt(0)], Annotated[int, Gt(0)]] | None = None
    camchain: str | None = None
    picture_scale: Annotated[float, Gt(0), Le(4)] = 1.0
    pitch_deg: Annotated[float, Ge(-90), Le(90)]
    baseline_m: Positive | None = None
    forward_m: float = 0.25
    height_m: float = 0.4
    calibration_error: Calibration = EXACT_CALIBRATION
    imu: Annotated[ImuSettings, FromPreset("IMU", IMUS)] | None = None

    def __post_init__(self) -> None:
        given = [key for key in LENS_KEYS if getattr(self, key) is not None]
        if len(given) > 1:
            raise SettingError(f"gives the lenses, which {given[0]} gives as well; remove one of them", given[1])
        if self.size_px and not self.calib:
            raise SettingError("requires calib, and there is none", "size_px")

    def read(self, folder: Path) -> "RigSettings":
        """The rig with the lenses from its file. Relative paths start at `folder`. Raises InputError."""
        if not (self.calib or self.camchain):
            return self
        from vobench.dataset import kalibr, kitti_calibration

        if self.calib:
            pair = kitti_calibration.read_pair(folder / self.calib, self.size_px)
        else:
            pair = kalibr.read_pair(folder / str(self.camchain))
        return replace(self, own=custom_stereo_pair(pair), calib=None, size_px=None, camchain=None)

    def mounted_on(self, trajectory: TrajectorySpec) -> "RigSettings":
        """The rig on the body of a trajectory, which may carry its cameras elsewhere."""
        mount = trajectory.mount
        return replace(self, **mount.replaced) if mount else self

    def build(self) -> Rig:
        """The sensors with their nominal calibration. Raises InputError if the lenses have not been read."""
        unread_file = self.calib or self.camchain
        if unread_file:
            raise InputError(f"the lenses are in a file that was not read: {unread_file}")
        preset = self.own.preset() if self.own else PRESETS[self.lens]
        T_left_right = preset.T_left_right if self.baseline_m is None else preset.at_baseline(self.baseline_m)
        cameras = mounted_rig(
            resized(preset.left, self.picture_scale),
            resized(preset.right, self.picture_scale),
            T_left_right,
            pitch_deg=self.pitch_deg,
            forward_m=self.forward_m,
            height_m=self.height_m,
        )
        return replace(cameras, imu=self.imu.calibration if self.imu else None)
