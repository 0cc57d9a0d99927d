"""What a suite's YAML may say, and the plan that follows: cases, entrants, trials."""

from collections.abc import Collection, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from vobench.errors import SuiteError, unknown
from vobench.geometry.rig import PRESETS, CalibrationError, Rig, mounted, true_rig
from vobench.scene.scene import Scene
from vobench.suite import catalog, scene_file, yaml_file
from vobench.suite.camera import CameraSpec, ChannelName, ImuSpec, RenderingSpec
from vobench.suite.camera import named as named_imu
from vobench.suite.catalog import Entry, Kind
from vobench.suite.manifest import Manifest, read_manifest
from vobench.suite.scene_spec import LightOverride, SceneFile
from vobench.suite.source import RecordedCase, SourceSpec, as_sources, recorded_cases
from vobench.suite.trajectory import ReplaySpec, TrajectorySpec, read_replayed, read_times, wheels_of
from vobench.suite.yaml_file import Mistakes, Name, Point, Positive, Strict, YamlFile, one_of


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


AXES = ("scene", "lighting", "rig", "trajectory", "camera")


class Case(Strict):
    """One sequence to be made: everything it depends on, resolved.

    `variant` names the case's place on each of AXES; `name` keeps those that differ within the suite,
    and so is unique there and fit for a folder. `seed` is the suite's; `replayed` is what the trajectory's
    file holds, as TUM text, where it has one.
    """

    name: str
    variant: dict[str, str]
    scene: SceneFile
    lighting: dict[str, LightOverride]
    rig: RigSpec
    trajectory: TrajectorySpec
    replayed: str | None = None
    camera: CameraSpec
    rendering: RenderingSpec
    truth: tuple[ChannelName, ...]
    seed: int

    def build_scene(self) -> Scene:
        """The scene under this case's lighting."""
        return scene_file.build(self.scene, self.lighting)

    def build_rig(self) -> Rig:
        """The sensors on the body as their calibration has them: what estimators are told."""
        return replace(self.rig.build(), wheels=wheels_of(self.trajectory))

    def build_true_rig(self) -> Rig:
        """The stereo pair as it is: what pictures are made with. Raises VobenchError, as `true_rig` does."""
        return self.rig.made_true(self.build_rig())


@dataclass(frozen=True, slots=True)
class Entrant:
    """An estimator as it takes part in a suite: its folder, its manifest and its parameters."""

    label: str
    folder: Path
    manifest: Manifest
    params: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Trial:
    """One entrant on one case, for the `repeat`-th time."""

    case: Case | RecordedCase
    entrant: Entrant
    repeat: int

    @property
    def name(self) -> str:
        """What progress calls it."""
        return f"{self.entrant.label} on {self.case.name}"


@dataclass(frozen=True, slots=True)
class Plan:
    """What a suite comes to: cases × entrants × repeats.

    `found` are the scenes and estimators that its names were taken for; `source` is the suite's file.
    """

    suite: Suite
    simulated: tuple[Case, ...]
    recorded: tuple[RecordedCase, ...]
    entrants: tuple[Entrant, ...]
    found: tuple[Entry, ...] = ()
    source: YamlFile | None = None

    @property
    def cases(self) -> tuple[Case | RecordedCase, ...]:
        """All cases."""
        return *self.simulated, *self.recorded

    def trials(self, case: Case | RecordedCase) -> list[Trial]:
        """Every trial on one case."""
        return [Trial(case, entrant, n) for entrant in self.entrants for n in range(self.suite.repeats)]

    def at(self, *keys: int | str) -> AbstractContextManager[None]:
        """Errors of the block name this place in the suite's file."""
        return self.source.at(*keys) if self.source else nullcontext()

    def mistakes(self) -> Mistakes:
        """To gather what is wrong with the suite."""
        return Mistakes(self.source)


def read_plan(name: str, *, only_estimators: tuple[str, ...] = ()) -> Plan:
    """The plan of the suite of that name, or in that file. Raises SuiteError or UnknownNameError."""
    reading = yaml_file.read_all(catalog.find("suite", name).path, Suite)
    wrong = Mistakes(reading.source, list(reading.mistakes))
    meant = {key for said in reading.source.marked for key in get_close_matches(str(said), Suite.model_fields, n=1)}
    with wrong.at():
        if wrong.found and (missing := missing_axis(meant)):
            raise SuiteError(missing)
    return _Planner(reading.model, wrong).plan(only_estimators)


def plan(suite: Suite) -> Plan:
    """Resolve all names in a suite; nothing is simulated and no estimator's code is imported."""
    return _Planner(suite, Mistakes(None)).plan()


@dataclass(frozen=True, slots=True)
class _Planner:
    """Resolves the names in a suite, of which entries or sections may be missing, and gathers what is wrong."""

    suite: Suite
    wrong: Mistakes
    found: list[Entry] = field(default_factory=list)

    def plan(self, only_estimators: tuple[str, ...] = ()) -> Plan:
        """The plan. Raises SuiteError with all that is wrong."""
        entrants = self._entrants(only_estimators)
        scenes, replayed = self._scenes(), self._replayed()
        self._check_rigs()
        axes = self._axes(scenes)
        recorded = self._recorded({name for name, _ in _combinations(axes)})
        self.wrong.require_none()
        simulated = tuple(self._case(name, variant, scenes, replayed) for name, variant in _combinations(axes))
        return Plan(self.suite, simulated, recorded, entrants, tuple(self.found), self.wrong.source)

    def _file(self) -> Path | None:
        return self.wrong.source.path.resolve() if self.wrong.source else None

    def _folder(self) -> Path:
        """Where relative paths in a suite start: at its file."""
        return self.wrong.source.path.parent if self.wrong.source else Path.cwd()

    def _find(self, kind: Kind, name: str) -> Entry:
        entry = catalog.find(kind, name, suite=self._file())
        self.found.append(entry)
        return entry

    def _entrants(self, only: tuple[str, ...]) -> tuple[Entrant, ...]:
        listed = dict(enumerate(getattr(self.suite, "estimators", ())))
        if only:
            return self._asked_for(only, listed)
        entrants = list[Entrant]()
        for index, spec in listed.items():
            with self.wrong.at("estimators", index):
                entrant = self._entrant(spec, index)
                _require_new_label(entrant, entrants)
                entrants.append(entrant)
        return tuple(entrants)

    def _asked_for(self, only: tuple[str, ...], listed: dict[int, EstimatorSpec]) -> tuple[Entrant, ...]:
        """The suite's own entries of these labels, else estimators of these names with their defaults.

        Raises UnknownNameError and SuiteError, for it is not the suite that is wrong.
        """
        entrants = list[Entrant]()
        for name in only:
            indexes = [index for index, spec in listed.items() if name == (spec.label or spec.name)]
            entrant = (
                self._entrant(listed[indexes[0]], indexes[0]) if indexes else self._entrant(EstimatorSpec(name=name))
            )
            _require_new_label(entrant, entrants)
            entrants.append(entrant)
        return tuple(entrants)

    def _entrant(self, spec: EstimatorSpec, index: int | None = None) -> Entrant:
        folder = self._find("estimator", spec.name).path
        manifest = read_manifest(folder)
        for key, value in spec.params.items():
            with self.wrong.at("estimators", index or 0, "params", key):
                _check_param(key, value, manifest.params)
        return Entrant(spec.label or manifest.name, folder, manifest, {**manifest.params, **spec.params})

    def _scenes(self) -> dict[str, SceneFile]:
        """The scenes by their files' names, which name a case's place on this axis; lightings are checked on each."""
        scenes: dict[str, SceneFile] = {}
        for index, name in enumerate(self.suite.scenes):
            with self.wrong.at("scenes", index):
                entry = self._find("scene", name)
                if entry.name in scenes:
                    raise SuiteError(
                        f"two scenes are called '{entry.name}'; give each once, from files of different names"
                    )
                scenes[entry.name], wrong = scene_file.survey(entry.path)
                self._check_lightings(scenes[entry.name], wrong)
                wrong.require_none()
                scene_file.build(scenes[entry.name], {})
        return scenes

    def _check_lightings(self, scene: SceneFile, wrong: Mistakes) -> None:
        """A lighting that names no lamp is an error now, not after an hour."""
        lights = () if wrong.found else scene_file.lights(scene)
        for lighting, overrides in self.suite.lightings.items():
            for name, override in overrides.items():
                with self.wrong.at("lightings", lighting, name):
                    if wrong.found and wrong.source:
                        scene_file.require_possible(name, wrong.source)
                    else:
                        scene_file.lit(lights, {name: override})

    def _check_rigs(self) -> None:
        """So is a rig whose distortion is off, on a lens without any."""
        for name, rig in self.suite.rigs.items():
            with self.wrong.at("rigs", name):
                rig.made_true(rig.build())

    def _replayed(self) -> dict[str, str]:
        """What the files of replayed trajectories hold, by the trajectories' names."""
        texts = dict[str, str]()
        for name, spec in self.suite.trajectories.items():
            if isinstance(spec, ReplaySpec):
                with self.wrong.at("trajectories", name, "times"):
                    times = read_times(spec, self._folder())
                    with self.wrong.at("trajectories", name, "file"):
                        texts[name] = read_replayed(spec, self._folder(), times)
        return texts

    def _axes(self, scenes: dict[str, SceneFile]) -> tuple[dict[str, Any], ...]:
        suite = self.suite
        return scenes, suite.lightings, suite.rigs, suite.trajectories, suite.cameras

    def _case(self, name: str, variant: dict[str, str], scenes: dict[str, SceneFile], replayed: dict[str, str]) -> Case:
        suite = self.suite
        return Case(
            name=name,
            variant=variant,
            scene=scenes[variant["scene"]],
            lighting=suite.lightings[variant["lighting"]],
            rig=suite.rigs[variant["rig"]],
            trajectory=suite.trajectories[variant["trajectory"]],
            replayed=replayed.get(variant["trajectory"]),
            camera=suite.cameras[variant["camera"]],
            rendering=suite.rendering,
            truth=suite.truth,
            seed=suite.seed,
        )

    def _recorded(self, taken: set[str]) -> tuple[RecordedCase, ...]:
        """The recordings, none of them called as another case is."""
        recorded = list[RecordedCase]()
        for index, spec in enumerate(self.suite.source):
            with self.wrong.at("source", index):
                cases = list(recorded_cases(spec, self._folder(), entry=index))
                recorded += cases
                _require_new(cases, taken)
            taken = taken | {case.name for case in recorded}
        return tuple(recorded)


def _combinations(axes: tuple[dict[str, Any], ...]) -> Iterator[tuple[str, dict[str, str]]]:
    """The name of each case, of those variants that there is a choice of, and its place on each axis."""
    for names in product(*axes):
        differing = [name for name, axis in zip(names, axes, strict=True) if len(axis) > 1]
        variant = dict(zip(AXES, names, strict=True))
        yield "-".join(differing) or variant["trajectory"], variant


def _require_new_label(entrant: Entrant, earlier: list[Entrant]) -> None:
    if entrant.label in [other.label for other in earlier]:
        raise SuiteError(f"two estimators are called '{entrant.label}'; give one a label of its own")


def _check_param(key: str, value: Any, defaults: dict[str, Any]) -> None:
    """A parameter of the manifest's, and of the kind of its value there; whole numbers may become fractions."""
    if key not in defaults:
        raise SuiteError(unknown("parameter", key, list(defaults)))
    kinds = [int if isinstance(v, float) else type(v) for v in (defaults[key], value)]
    if defaults[key] is not None and kinds[0] is not kinds[1]:
        raise SuiteError(f"parameter '{key}' should be of the kind of its default {defaults[key]!r}, got {value!r}")


def _require_new(cases: list[RecordedCase], taken: set[str]) -> None:
    """Raise SuiteError with all that are called as another case is."""
    wrong = list[str]()
    for case in cases:
        if case.name in taken:
            wrong.append(f"two cases are called '{case.name}'; name one another: {case.source.path}")
        taken = taken | {case.name}
    if wrong:
        raise SuiteError(*wrong)
