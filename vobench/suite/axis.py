"""What the axes of a suite hold: rigs, lightings and cameras, as its YAML has them."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Ge, Gt, Le

from vobench.errors import InputError, SettingError
from vobench.geometry.rig import PRESETS, RESIDUALS, CalibrationError, OwnPair, Rig, mounted, own_pair, resized
from vobench.sensor.image_sensor import SENSOR_PRESETS, CameraSettings
from vobench.sensor.imu import IMUS, ImuSettings
from vobench.setting import Like, OneOf, Positive, Short, settings

LENSES = ("own", "calib", "camchain")  # in the preset's place
HONEST = CalibrationError()
Camera = Annotated[CameraSettings, SENSOR_PRESETS]


def _levelled(value: Any) -> Any:
    return {"level": value} if isinstance(value, str) else value


Calibration = Annotated[CalibrationError, Short(_levelled, {"type": "string", "enum": ["none", *RESIDUALS]})]


@settings()
class RigSettings:
    """A stereo pair on the body: a preset with both lenses, placed, how far its calibration is off, and an IMU.

    In the preset's place are `own` lenses, or those of a file: KITTI's `calib`, whose pictures are of `size_px`, or
    Kalibr's `camchain`.
    Without `baseline_m` the cameras stand to each other as the preset has them; `picture_scale` .5 has half the pixels.
    """

    lens: Annotated[str, OneOf("lens", PRESETS)] = "paper_blender"
    own: OwnPair | None = None
    calib: str | None = None
    size_px: tuple[Annotated[int, Gt(0)], Annotated[int, Gt(0)]] | None = None
    camchain: str | None = None
    picture_scale: Annotated[float, Gt(0), Le(4)] = 1.0
    pitch_deg: Annotated[float, Ge(-90), Le(90)]
    baseline_m: Positive | None = None
    forward_m: float = 0.25
    height_m: float = 0.4
    calibration_error: Calibration = HONEST
    imu: Annotated[ImuSettings, Like("IMU", IMUS)] | None = None

    def __post_init__(self) -> None:
        if len(given := [key for key in LENSES if getattr(self, key) is not None]) > 1:
            raise SettingError(f"gives the lenses, which {given[0]} gives; leave one of them out", given[1])
        if self.size_px and not self.calib:
            raise SettingError("belongs to calib, and there is none", "size_px")

    def read(self, folder: Path) -> "RigSettings":
        """The rig with the lenses of its file, whose path starts in a folder. Raises InputError."""
        if not (self.calib or self.camchain):
            return self
        from vobench.dataset import kalibr, kitti

        if self.calib:
            pair = kitti.read_pair(folder / self.calib, self.size_px)
        else:
            pair = kalibr.read_pair(folder / str(self.camchain))
        return replace(self, own=own_pair(pair), calib=None, size_px=None, camchain=None)

    def build(self) -> Rig:
        """The sensors on the body as their calibration has them. Raises InputError where its file was not read."""
        if file := self.calib or self.camchain:
            raise InputError(f"the lenses are those of a file that was not read: {file}")
        preset = self.own.preset() if self.own else PRESETS[self.lens]
        cameras = mounted(
            resized(preset.left, self.picture_scale),
            resized(preset.right, self.picture_scale),
            preset.T_left_right if self.baseline_m is None else preset.at_baseline(self.baseline_m),
            pitch_deg=self.pitch_deg,
            forward_m=self.forward_m,
            height_m=self.height_m,
        )
        return replace(cameras, imu=self.imu.calibration if self.imu else None)
