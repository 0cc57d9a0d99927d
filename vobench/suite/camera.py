"""What YAML may say of cameras, IMUs and rendering."""

from dataclasses import replace
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from vobench.errors import InputError, unknown
from vobench.geometry import se3
from vobench.sensor.exposure import AutoExposure, Exposure, Shutter, ShutterKind
from vobench.sensor.image_sensor import CAMERAS, CameraSensor
from vobench.sensor.imu import IMUS, ImuSettings, Triad
from vobench.sensor.lens import LensEffects
from vobench.sensor.pixel_truth import CHANNELS
from vobench.sensor.response import RESPONSES, Power, Response, Table
from vobench.setting import NonNegative, Positive, Share, tupled
from vobench.suite.yaml_file import Strict, one_of

ResponseKey = str | float | tuple[float, ...]


def _known_response(value: Any) -> Any:
    """Let pass what `_response` understands, lists as tuples. Raises ValueError."""
    numbers = value if isinstance(value, list | tuple) else [0.0 if isinstance(value, str) else value]
    if not all(isinstance(number, int | float) and not isinstance(number, bool) for number in numbers):
        raise ValueError(f"should be linear, srgb, a gamma such as 2.2 or a list of rising signals (got {value!r})")
    try:
        _response(value)
    except InputError as error:
        raise ValueError(str(error)) from None
    return tuple(value) if isinstance(value, list) else value


def _response(key: ResponseKey) -> Response:
    if isinstance(key, str):
        if key not in RESPONSES:
            raise InputError(unknown("response", key, list(RESPONSES)))
        return RESPONSES[key]
    return Power(float(key)) if isinstance(key, int | float) else Table(tuple(map(float, key)))


class ChipOverride(Strict):
    """Single properties of the chip, in place of those that `sensor` has."""

    full_well_e: Positive | None = None
    shot_noise: bool | None = None
    read_noise_e: NonNegative | None = None
    prnu: Share | None = None
    dsnu_e: NonNegative | None = None
    column_e: NonNegative | None = None
    dark_e_per_s: NonNegative | None = None
    hot_share: Share | None = None
    hot_e_per_s: NonNegative | None = None
    black_dn: Annotated[float, Field(ge=0, le=128)] | None = None
    adc_bits: Literal[8, 10, 12] | None = None
    response: Annotated[ResponseKey, BeforeValidator(_known_response)] | None = None

    def build(self, sensor: CameraSensor) -> CameraSensor:
        """The sensor with these properties."""
        changes = self.model_dump(exclude_none=True, exclude={"response"})
        if self.response is not None:
            changes["response"] = _response(self.response)
        return replace(sensor, **changes)


class AutoExposureSpec(Strict):
    """The loop that sets exposure time and gain from the pictures; it starts at the camera's `exposure_ms`."""

    target_share: Annotated[float, Field(gt=0, lt=1)] = 0.18
    percentile: Annotated[float, Field(gt=0, le=100)] | None = None
    lag_frames: Annotated[int, Field(ge=1, le=10)] = 2
    damping: Annotated[float, Field(ge=0, lt=1)] = 0.2
    t_min_ms: Positive = 0.05
    t_max_ms: Positive = 20.0
    gain_max_db: Annotated[float, Field(ge=0, le=48)] = 12.0

    @model_validator(mode="after")
    def _limits_rise(self) -> Self:
        if self.t_min_ms > self.t_max_ms:
            raise ValueError(f"t_min_ms should be at most t_max_ms, but is {self.t_min_ms:g} against {self.t_max_ms:g}")
        return self

    def build(self) -> AutoExposure:
        """The loop's settings."""
        return AutoExposure(
            target_share=self.target_share,
            percentile=self.percentile,
            lag_frames=self.lag_frames,
            damping=self.damping,
            t_min_s=self.t_min_ms / 1e3,
            t_max_s=self.t_max_ms / 1e3,
            gain_max_db=self.gain_max_db,
        )


class CameraSpec(Strict):
    """The chip behind the lenses, how it is exposed, and what the lenses do to the light."""

    sensor: Annotated[str, one_of("camera sensor", CAMERAS)] = "clean"
    chip: ChipOverride = ChipOverride()
    exposure_gain: Positive = 1.0
    exposure_ms: Annotated[float, Field(ge=0.001, le=1000)] = 5.0
    gain_db: Annotated[float, Field(ge=0, le=48)] = 0.0
    auto_exposure: AutoExposureSpec | None = None
    shutter: Literal["global", "rolling"] = "global"
    readout_ms: Annotated[float, Field(ge=0, le=1000)] | None = None
    motion_blur: bool = False
    vignetting: Annotated[float, Field(ge=0, le=4)] = 0.0
    vignetting_cutoff_deg: Annotated[float, Field(gt=0, lt=90)] | None = None
    blur_sigma_px: Annotated[float, Field(ge=0, le=100)] = 0.0
    defocus_px: Annotated[float, Field(ge=0, le=100)] = 0.0
    dirt: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] | None = None

    @model_validator(mode="after")
    def _readout_with_rolling(self) -> Self:
        if self.shutter == "rolling" and self.readout_ms is None:
            raise ValueError("a rolling shutter needs readout_ms: rows × the time from one row to the next, such as 20")
        if self.shutter == "global" and self.readout_ms is not None:
            raise ValueError("readout_ms belongs to a rolling shutter; add shutter: rolling")
        return self

    def build_chip(self) -> CameraSensor:
        """The chip with its overrides, its aperture set for this camera's exposure."""
        sensor = self.chip.build(CAMERAS[self.sensor])
        return replace(sensor, exposure_gain=self.exposure_gain, nominal_s=self.exposure_ms / 1e3)

    def build_exposure(self) -> Exposure:
        """The exposure of every picture, or of the first ones where auto-exposure follows."""
        return Exposure(self.exposure_ms / 1e3, self.gain_db)

    def build_auto_exposure(self) -> AutoExposure | None:
        """The exposure loop's settings, where there is one."""
        return self.auto_exposure.build() if self.auto_exposure else None

    def build_shutter(self) -> Shutter:
        """The shutter and its time of readout."""
        return Shutter(ShutterKind(self.shutter), (self.readout_ms or 0.0) / 1e3)

    def build_lens(self) -> LensEffects:
        """What the lens does to light."""
        return LensEffects(
            vignetting=self.vignetting,
            vignetting_cutoff_deg=self.vignetting_cutoff_deg,
            blur_sigma_px=self.blur_sigma_px,
            defocus_px=self.defocus_px,
            dirt=self.dirt,
        )


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


ENGINES = ("raster", "path")
MOST_SAMPLES = 65536
ChannelName = Annotated[str, one_of("ground-truth channel", CHANNELS)]


class RenderingSpec(Strict):
    """The engine: `raster` draws with light computed once, `path` traces `samples` light paths through each pixel.

    None are as many as the path tracer takes by itself.
    """

    engine: Annotated[str, one_of("engine", ENGINES)] = "raster"
    samples: Annotated[int, Field(ge=1, le=MOST_SAMPLES)] | None = None

    @model_validator(mode="after")
    def _samples_are_of_paths(self) -> "RenderingSpec":
        if self.engine != "path" and self.samples is not None:
            raise ValueError(f"samples belongs to engine path, but the engine is {self.engine}; leave samples out")
        return self
