"""What a suite's YAML may say: the axes of its cases, and the estimators that run on each."""

from collections.abc import Collection
from dataclasses import replace
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from vobench.geometry.calibration import CalibrationError, true_rig
from vobench.geometry.preset import PRESETS
from vobench.geometry.rig import Rig, mounted
from vobench.suite.camera_spec import CameraSpec
from vobench.suite.imu_spec import ImuSpec
from vobench.suite.imu_spec import named as named_imu
from vobench.suite.light_spec import LightOverride
from vobench.suite.rendering_spec import ChannelName, RenderingSpec
from vobench.suite.source_spec import SourceSpec, as_sources
from vobench.suite.strict import Name, Point, Positive, Strict, one_of
from vobench.suite.trajectory_spec import TrajectorySpec


def _named(value: Any) -> Any:
    """A bare name stands for an estimator with its manifest's parameters."""
    return {"name": value} if isinstance(value, str) else value


NEEDED = ("scenes", "rigs", "trajectories")
Ratio = Annotated[float, Field(gt=-1, lt=1)]
Angle = Annotated[float, Field(ge=-10, le=10)]


class CalibrationErrorSpec(Strict):
    """How the true rig differs from the one that estimators are told; see `geometry.calibration`."""

    focal_ratio: Ratio = 0.0
    center_px: Point = (0.0, 0.0)
    distortion_ratio: Ratio = 0.0
    baseline_ratio: Ratio = 0.0
    right_roll_deg: Angle = 0.0
    right_pitch_deg: Angle = 0.0
    right_yaw_deg: Angle = 0.0


class RigSpec(Strict):
    """A stereo pair on the body: a preset with both lenses, placed, how far its calibration is off, and an IMU.

    Without `baseline_m` the cameras stand to each other as the preset has them.
    """

    lens: Annotated[str, one_of("lens", PRESETS)] = "paper_blender"
    pitch_deg: Annotated[float, Field(ge=-90, le=90)]
    baseline_m: Positive | None = None
    forward_m: float = 0.25
    height_m: float = 0.4
    calibration_error: CalibrationErrorSpec = CalibrationErrorSpec()
    imu: Annotated[ImuSpec, BeforeValidator(named_imu)] | None = None

    def build(self) -> Rig:
        """The sensors on the body as their calibration has them."""
        preset = PRESETS[self.lens]
        cameras = mounted(
            preset.left,
            preset.right,
            preset.T_left_right if self.baseline_m is None else preset.at_baseline(self.baseline_m),
            pitch_deg=self.pitch_deg,
            forward_m=self.forward_m,
            height_m=self.height_m,
        )
        return replace(cameras, imu=self.imu.build().calibration if self.imu else None)

    def made_true(self, nominal: Rig) -> Rig:
        """The rig as it is, of one as its calibration has it. Raises VobenchError, as `true_rig` does."""
        return true_rig(nominal, CalibrationError(**self.calibration_error.model_dump()))


class EstimatorSpec(Strict):
    """An estimator with parameters other than its manifest's."""

    name: str
    label: Name | None = None
    params: dict[str, Any] = Field(default_factory=dict)


class Suite(Strict):
    """The cases are every combination of scene, lighting, rig, trajectory and camera, and every recording of `source`.

    Each axis names its variants; change one axis to change one factor. A suite of recordings alone has no axes.
    """

    name: Name
    summary: str = ""
    seed: Annotated[int, Field(ge=0)] = 0
    repeats: Annotated[int, Field(ge=1, le=100)] = 1
    source: Annotated[tuple[SourceSpec, ...], BeforeValidator(as_sources)] = ()
    scenes: Annotated[tuple[str, ...], Field(min_length=1)] = ()
    lightings: dict[Name, dict[str, LightOverride]] = Field(default={"as_built": {}}, min_length=1)
    rigs: dict[Name, RigSpec] = Field(default={}, min_length=1)
    trajectories: dict[Name, TrajectorySpec] = Field(default={}, min_length=1)
    cameras: dict[Name, CameraSpec] = Field(default={"clean": CameraSpec()}, min_length=1)
    rendering: RenderingSpec = RenderingSpec()
    truth: tuple[ChannelName, ...] = ()
    estimators: Annotated[tuple[Annotated[EstimatorSpec, BeforeValidator(_named)], ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _has_cases(self) -> Self:
        if missing := missing_axis({name for name in type(self).model_fields if getattr(self, name)}):
            raise ValueError(missing)
        return self


def missing_axis(given: Collection[str]) -> str | None:
    """What a suite with these keys lacks: it has scenes, rigs and trajectories, or none of them and a source."""
    missing = [name for name in NEEDED if name not in given]
    if missing and not ("source" in given and len(missing) == len(NEEDED)):
        said = "this key is missing" if len(missing) == 1 else "these keys are missing"
        return f"{', '.join(missing)}: {said}; a suite has {', '.join(NEEDED)}, or a source alone"
    return None
