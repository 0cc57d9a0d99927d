"""What a suite's YAML may say: the axes of its cases, and the estimators that run on each."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from vobench.geometry.preset import PRESETS
from vobench.robot.controller import CONTROLLERS
from vobench.robot.pioneer import THETAS
from vobench.robot.slip import SLIPS
from vobench.sensor.encoder import ENCODERS
from vobench.suite.camera_spec import CameraSpec
from vobench.suite.light_spec import LightOverride
from vobench.suite.rendering_spec import ChannelName, RenderingSpec
from vobench.suite.strict import Name, Positive, Strict, one_of


def _named(value: Any) -> Any:
    """A bare name stands for an estimator with its manifest's parameters."""
    return {"name": value} if isinstance(value, str) else value


Point = tuple[float, float]
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
    """A stereo pair on the robot: a preset with both lenses, placed, and how far its calibration is off.

    Without `baseline_m` the cameras stand to each other as the preset has them.
    """

    lens: Annotated[str, one_of("lens", PRESETS)] = "paper_blender"
    pitch_deg: Annotated[float, Field(ge=-90, le=90)]
    baseline_m: Positive | None = None
    forward_m: float = 0.25
    height_m: Positive = 0.4
    calibration_error: CalibrationErrorSpec = CalibrationErrorSpec()


class TrajectorySpec(Strict):
    """Waypoints that the paper's controller steers the Pioneer through."""

    targets_m: Annotated[tuple[Point, ...], Field(min_length=1)]
    start_m: Point = (0.0, 0.0)
    start_heading_deg: float = 0.0
    robot: Annotated[str, one_of("robot parameter set", THETAS)] = "pioneer_3dx"
    controller: Annotated[str, one_of("controller", CONTROLLERS)] = "smooth"
    slip: Annotated[str, one_of("slip", SLIPS)] = "nominal"
    encoders: Annotated[str, one_of("encoder error set", ENCODERS)] = "nominal"
    rate_hz: Annotated[float, Field(gt=0, le=1000)] = 30.0
    tolerance_m: Positive = 0.01
    max_time_s: Annotated[float, Field(gt=0, le=3600)] = 60.0


class EstimatorSpec(Strict):
    """An estimator with parameters other than its manifest's."""

    name: str
    label: Name | None = None
    params: dict[str, Any] = Field(default_factory=dict)


class Suite(Strict):
    """The cases are every combination of scene, lighting, rig, trajectory and camera.

    Each axis names its variants; change one axis to change one factor.
    """

    name: Name
    summary: str = ""
    seed: Annotated[int, Field(ge=0)] = 0
    repeats: Annotated[int, Field(ge=1, le=100)] = 1
    scenes: Annotated[tuple[str, ...], Field(min_length=1)]
    lightings: dict[Name, dict[str, LightOverride]] = Field(default={"as_built": {}}, min_length=1)
    rigs: Annotated[dict[Name, RigSpec], Field(min_length=1)]
    trajectories: Annotated[dict[Name, TrajectorySpec], Field(min_length=1)]
    cameras: dict[Name, CameraSpec] = Field(default={"clean": CameraSpec()}, min_length=1)
    rendering: RenderingSpec = RenderingSpec()
    truth: tuple[ChannelName, ...] = ()
    estimators: Annotated[tuple[Annotated[EstimatorSpec, BeforeValidator(_named)], ...], Field(min_length=1)]
