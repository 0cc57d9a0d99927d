"""What a suite's YAML may say of an IMU: a preset, and what is different about this one."""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from vobench.geometry import se3
from vobench.sensor.imu import ImuSettings
from vobench.sensor.imu_preset import IMUS
from vobench.sensor.triad import Triad
from vobench.suite.strict import Positive, Strict, one_of, tupled

Size = Annotated[float, Field(ge=0, le=1e3)]
Number = Annotated[float, Field(ge=-1e3, le=1e3)]
Triple = tuple[Number, Number, Number]
Gain = tuple[Triple, Triple, Triple]


def named(value: Any) -> Any:
    """A bare name stands for a preset as it is."""
    return {"like": value} if isinstance(value, str) else tupled(value)


class TriadOverride(Strict):
    """Single properties of the gyroscopes (units of rad/s) or accelerometers (m/s²), in place of the preset's."""

    noise: Size | None = None
    walk: Size | None = None
    correlation_s: Positive | None = None
    bias: Triple | None = None
    bias_std: Size | None = None
    gain: Gain | None = None
    limit: Positive | None = None
    step: Size | None = None

    def build(self, triad: Triad) -> Triad:
        """The triad with these properties."""
        return replace(triad, **self.model_dump(exclude_none=True))


class ImuSpec(Strict):
    """An IMU on the body: a preset by name, its place, and what differs from the preset."""

    like: Annotated[str, one_of("IMU", IMUS)] = "exact"
    rate_hz: Annotated[float, Field(ge=1, le=10_000)] | None = None
    position_m: Triple = (0.0, 0.0, 0.0)
    rotation_deg: Triple = (0.0, 0.0, 0.0)
    gyro: TriadOverride = TriadOverride()
    accel: TriadOverride = TriadOverride()

    def build(self) -> ImuSettings:
        """The IMU as it is; `rotation_deg` is roll, pitch and yaw, turned about fixed axes in that order."""
        from scipy.spatial.transform import Rotation

        preset = IMUS[self.like]
        R_body_imu = Rotation.from_euler("xyz", self.rotation_deg, degrees=True).as_matrix()
        return ImuSettings(
            rate_hz=self.rate_hz or preset.rate_hz,
            gyro=self.gyro.build(preset.gyro),
            accel=self.accel.build(preset.accel),
            T_body_imu=se3.transform(R_body_imu, np.array(self.position_m)),
        )
