"""What a suite's YAML may say: the axes of its cases, and the estimators that run on each."""

from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from vobench.geometry.preset import PRESETS
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
        """Scenes, rigs and trajectories are all there, or none of them and a source."""
        axes = {"scenes": self.scenes, "rigs": self.rigs, "trajectories": self.trajectories}
        missing = [name for name, variants in axes.items() if not variants]
        if missing and not (self.source and len(missing) == len(axes)):
            raise ValueError(f"{missing[0]}: this key is missing; a suite has {', '.join(axes)}, or a source alone")
        return self
