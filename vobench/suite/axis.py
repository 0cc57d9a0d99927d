"""What the axes of a suite hold: rigs, lightings and cameras, as its YAML has them."""

from dataclasses import replace
from typing import Annotated, Any

from annotated_types import Ge, Gt, Le

from vobench.geometry.rig import PRESETS, RESIDUALS, CalibrationError, OwnPair, Rig, mounted, resized
from vobench.sensor.image_sensor import SENSOR_PRESETS, CameraSettings
from vobench.sensor.imu import IMUS, ImuSettings
from vobench.setting import Like, OneOf, Positive, Short, settings

HONEST = CalibrationError()
Camera = Annotated[CameraSettings, SENSOR_PRESETS]


def _levelled(value: Any) -> Any:
    return {"level": value} if isinstance(value, str) else value


Calibration = Annotated[CalibrationError, Short(_levelled, {"type": "string", "enum": ["none", *RESIDUALS]})]


@settings()
class RigSettings:
    """A stereo pair on the body: a preset with both lenses, placed, how far its calibration is off, and an IMU.

    `own` are lenses of one's own in the preset's place.
    Without `baseline_m` the cameras stand to each other as the preset has them; `picture_scale` .5 has half the pixels.
    """

    lens: Annotated[str, OneOf("lens", PRESETS)] = "paper_blender"
    own: OwnPair | None = None
    picture_scale: Annotated[float, Gt(0), Le(4)] = 1.0
    pitch_deg: Annotated[float, Ge(-90), Le(90)]
    baseline_m: Positive | None = None
    forward_m: float = 0.25
    height_m: float = 0.4
    calibration_error: Calibration = HONEST
    imu: Annotated[ImuSettings, Like("IMU", IMUS)] | None = None

    def build(self) -> Rig:
        """The sensors on the body as their calibration has them."""
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
