"""What a suite's YAML may say: the axes of its cases, and the estimators that run on each."""

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from vobench.catalog.catalog import unknown
from vobench.catalog.yaml_file import matching
from vobench.geometry.rig import LENSES
from vobench.robot.controller import CONTROLLERS
from vobench.robot.pioneer import THETAS
from vobench.robot.slip import SLIPS
from vobench.sensor.camera import CAMERAS
from vobench.sensor.encoder import ENCODERS


class Strict(BaseModel):
    """A frozen model in which an unknown key is an error, as are NaN, infinity and a number in quotes."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def _one_of(kind: str, known: dict[str, Any]) -> AfterValidator:
    def check(name: str) -> str:
        if name not in known:
            raise ValueError(unknown(kind, name, list(known)))
        return name

    return AfterValidator(check)


def _named(value: Any) -> Any:
    """A bare name stands for an estimator with its manifest's parameters."""
    return {"name": value} if isinstance(value, str) else value


# Names become folders, and a case's name joins several with a hyphen.
NAME = matching(r"[a-z0-9][a-z0-9_.]*", "lower-case letters, digits, _ and ., a letter or digit first")
Name = Annotated[str, NAME]
Point = tuple[float, float]
Positive = Annotated[float, Field(gt=0)]


class LampOverride(Strict):
    """A lamp as a lighting sets it."""

    power_lm: Annotated[float, Field(ge=0)]


class RigSpec(Strict):
    """A stereo pair on the robot."""

    lens: Annotated[str, _one_of("lens", LENSES)] = "paper_blender"
    pitch_deg: Annotated[float, Field(ge=-90, le=90)]
    baseline_m: Positive = 0.12
    forward_m: float = 0.25
    height_m: Positive = 0.4


class TrajectorySpec(Strict):
    """Waypoints that the paper's controller steers the Pioneer through."""

    targets_m: Annotated[tuple[Point, ...], Field(min_length=1)]
    start_m: Point = (0.0, 0.0)
    start_heading_deg: float = 0.0
    robot: Annotated[str, _one_of("robot parameter set", THETAS)] = "pioneer_3dx"
    controller: Annotated[str, _one_of("controller", CONTROLLERS)] = "smooth"
    slip: Annotated[str, _one_of("slip", SLIPS)] = "nominal"
    encoders: Annotated[str, _one_of("encoder error set", ENCODERS)] = "nominal"
    rate_hz: Annotated[float, Field(gt=0, le=1000)] = 30.0
    tolerance_m: Positive = 0.01
    max_time_s: Annotated[float, Field(gt=0, le=3600)] = 60.0


class CameraSpec(Strict):
    """The chip behind the lenses and how it is exposed."""

    sensor: Annotated[str, _one_of("camera sensor", CAMERAS)] = "clean"
    exposure_gain: Positive = 1.0


class EstimatorSpec(Strict):
    """An estimator with parameters other than its manifest's."""

    name: str
    label: Name | None = None
    params: dict[str, Any] = {}


class Suite(Strict):
    """The cases are every combination of scene, lighting, rig, trajectory and camera.

    Each axis names its variants; change one axis to change one factor.
    """

    name: Name
    summary: str = ""
    seed: Annotated[int, Field(ge=0)] = 0
    repeats: Annotated[int, Field(ge=1, le=100)] = 1
    scenes: Annotated[tuple[str, ...], Field(min_length=1)]
    lightings: Annotated[dict[Name, dict[str, LampOverride]], Field(min_length=1)] = {"as_built": {}}
    rigs: Annotated[dict[Name, RigSpec], Field(min_length=1)]
    trajectories: Annotated[dict[Name, TrajectorySpec], Field(min_length=1)]
    cameras: Annotated[dict[Name, CameraSpec], Field(min_length=1)] = {"clean": CameraSpec()}
    estimators: Annotated[tuple[Annotated[EstimatorSpec, BeforeValidator(_named)], ...], Field(min_length=1)]
