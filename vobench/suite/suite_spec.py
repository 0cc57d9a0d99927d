"""The settings in the YAML file of a suite."""

from collections.abc import Collection
from dataclasses import field, fields
from typing import Annotated, Any, Literal, get_args

from annotated_types import Ge, Le, MinLen

from vobench.errors import SettingError
from vobench.estimator.manifest import Limits
from vobench.geometry.rig import Level
from vobench.sensor.image_sensor import CameraSettings
from vobench.sensor.pixel_truth import CHANNELS
from vobench.setting import Name, OneOf, ShortForm, hints, settings
from vobench.suite.axis import Camera, RigSettings
from vobench.suite.scenario import MOST_SEVERE, SEVERITY_COUNT
from vobench.suite.scene_entry import NamedScene
from vobench.suite.scene_lighting import Lighting
from vobench.suite.source import SOURCES, Source
from vobench.suite.spread import Spread
from vobench.suite.trajectory import TrajectorySpec

ENGINES = ("raster", "path", "pyrender")
MOST_SAMPLES = 65536
RASTER_SAMPLES = (4, 16)
LARGEST_BASE_SEED = 2_000_000_000

KEYS_INSTEAD_OF_SCENES = {"scenarios", "source"}  # a suite with one of these keys can omit `scenes`
KEYS_THAT_NEED_SCENES = {"rigs", "trajectories"}


@settings()
class Rendering:
    """The engine that renders the images.

    `raster` rasterises with precomputed light, and `samples` of each pixel, 4 or 16; None selects 4. `path` traces
    `samples` light paths through each pixel; None selects the default of the path tracer. `pyrender` is the unchanged
    renderer of that library.
    """

    engine: Annotated[str, OneOf("engine", ENGINES)] = "raster"
    samples: Annotated[int, Ge(1), Le(MOST_SAMPLES)] | None = None

    def __post_init__(self) -> None:
        if self.samples is None:
            return
        if self.engine == "pyrender":
            raise SettingError("samples requires engine raster or path, but the engine is pyrender; remove samples")
        if self.engine == "raster" and self.samples not in RASTER_SAMPLES:
            raise SettingError(f"the engine raster takes 4 or 16 samples, got {self.samples}", "samples")

    @property
    def needs_bake(self) -> bool:
        """Whether the engine needs the precomputed light of the scene."""
        return self.engine == "raster"


@settings()
class TruthNoise:
    """Noise that is added to the scored ground truth, like that of the reference system of a real recording.

    The fields are standard deviations: of the position along each axis, and of the rotation about each axis.
    """

    position_m: Annotated[float, Ge(0), Le(1)] = 0.0
    rotation_deg: Annotated[float, Ge(0), Le(10)] = 0.0


EXACT = TruthNoise()


@settings()
class EstimatorSettings:
    """An estimator, with the parameters and limits that differ from those of its manifest."""

    name: str
    label: Name | None = None
    params: dict[str, Any] = field(default_factory=dict)
    limits: dict[Annotated[str, OneOf("limit", hints(Limits))], float] = field(default_factory=dict)


def _as_tuple(value: Any) -> Any:
    """A single severity as a tuple."""
    return (value,) if isinstance(value, int) else value


Severity = Annotated[int, Ge(0), Le(MOST_SEVERE)]
Severities = Annotated[tuple[Severity, ...], MinLen(1), ShortForm(_as_tuple, {"type": "integer"})]


def _at_all_severities(value: Any) -> Any:
    """A list of calibration levels as a mapping from each level to all severities."""
    if not isinstance(value, (list, tuple)):
        return value
    if not all(isinstance(level, str) for level in value):
        return value
    severities = range(SEVERITY_COUNT)
    return {level: list(severities) for level in value}


Calibrations = Annotated[
    dict[Level, Severities],
    MinLen(1),
    ShortForm(_at_all_severities, {"type": "array", "items": {"enum": get_args(Level)}, "minItems": 1}),
]


def _as_named(value: Any) -> Any:
    """The name of an estimator as settings that have only this name."""
    return {"name": value} if isinstance(value, str) else value


ChannelName = Annotated[str, OneOf("ground-truth channel", CHANNELS)]
NamedEstimator = Annotated[EstimatorSettings, ShortForm(_as_named, {"type": "string"})]
# The first frame, and the frame after the last one.
Window = tuple[Annotated[int, Ge(0)], Annotated[int, Ge(2)]]
Mode = Literal["step", "real_time"]


@settings()
class Suite:
    """A suite: estimators, and the cases that they run on.

    The cases are every combination of scene, lighting, rig, trajectory and camera, every recording of `source`, and
    each of `scenarios` at the severities it is listed with. Each axis names its variants; change one axis to change
    one factor. Each simulated case is repeated `repeats` times, with new noise and another seed of the estimator each
    time. Without rigs, a stereo pair looks ahead; without trajectories, the body drives a circle in the free space of
    each scene. A suite of recordings or scenarios alone has no axes. Scenarios are repeated for each of `calibrations`
    that lists their severity. With `frames`, only the frames from the first number up to, not including, the second
    are rendered. Keys that the file omits are those of the suite that it includes.
    """

    include: str | None = None
    name: Name
    summary: str = ""
    seed: Annotated[int, Ge(0)] = 0
    base_seed: Annotated[int, Ge(0), Le(LARGEST_BASE_SEED)] = 0
    repeats: Annotated[int, Ge(1), Le(100)] = 1
    source: Annotated[tuple[Source, ...], SOURCES] = ()
    scenarios: Annotated[dict[str, Severities], MinLen(1)] | None = None
    spread: Spread | None = None
    calibrations: Calibrations | None = None
    scenes: Annotated[tuple[NamedScene, ...], MinLen(1)] | None = None
    lightings: Annotated[dict[Name, Lighting], MinLen(1)] = field(default_factory=lambda: {"as_built": {}})
    rigs: Annotated[dict[Name, RigSettings], MinLen(1)] | None = None
    trajectories: Annotated[dict[Name, TrajectorySpec], MinLen(1)] | None = None
    cameras: Annotated[dict[Name, Camera], MinLen(1)] = field(default_factory=lambda: {"clean": CameraSettings()})
    rendering: Rendering = Rendering()
    truth: tuple[ChannelName, ...] = ()
    truth_noise: TruthNoise = EXACT
    frames: Window | None = None
    modes: Annotated[tuple[Mode, ...], MinLen(1)] = ("step",)
    share_time: bool = False
    estimators: Annotated[tuple[NamedEstimator, ...], MinLen(1)]

    def __post_init__(self) -> None:
        # None and empty values count as omitted keys.
        given_keys = {setting.name for setting in fields(self) if getattr(self, setting.name)}
        missing = missing_axis(given_keys)
        if missing:
            raise SettingError(missing)
        if self.calibrations and not self.scenarios:
            raise SettingError(
                "requires scenarios, and the suite has none; use calibration_error of a rig", "calibrations"
            )
        if self.spread:
            self._check_spread(self.spread)

    def _check_spread(self, spread: Spread) -> None:
        """Raise SettingError if an axis of the design has no variants, or an axis of scenarios has several."""
        for axis, key in {"scene": "scenes", "trajectory": "trajectories"}.items():
            is_needed = bool(self.scenarios) or axis in spread.over
            has_variants = bool(getattr(self, key))
            if is_needed and not has_variants:
                raise SettingError(f"requires {key}, and the suite has none", "spread")
        if not self.scenarios:
            return
        for key in ("lightings", "rigs", "cameras"):
            variants = getattr(self, key) or ()
            if len(variants) > 1:
                raise SettingError(f"scenarios are spread with one variant of {key}, but there are several", key)


def missing_axis(given_keys: Collection[str]) -> str | None:
    """A sentence about the axes that a suite with the given keys lacks; None if it lacks none.

    A suite needs scenes, scenarios or a source. Rigs and trajectories need scenes.
    """
    keys = set(given_keys)
    if "scenes" in keys:
        return None
    has_other_cases = not keys.isdisjoint(KEYS_INSTEAD_OF_SCENES)
    needs_scenes = not keys.isdisjoint(KEYS_THAT_NEED_SCENES)
    if has_other_cases and not needs_scenes:
        return None
    return "scenes: this key is missing; a suite needs scenes, or only scenarios or a source"
