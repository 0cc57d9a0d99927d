"""What a suite's YAML may say, and the plan that follows: cases, entrants, trials."""

import fnmatch
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, get_args

import numpy as np
from annotated_types import Ge, Le, MinLen

from vobench.errors import SettingError, SuiteError, UnknownNameError, unknown
from vobench.estimator.manifest import USUAL, Limits, Manifest
from vobench.geometry.rig import Level, Rig, drawn, true_rig
from vobench.motion.replay import Replay
from vobench.motion.wheeled import Wheeled
from vobench.scene.light import Light
from vobench.scene.scene import Scene
from vobench.sensor.image_sensor import CameraSettings
from vobench.sensor.pixel_truth import CHANNELS
from vobench.setting import Name, OneOf, Short, hints, nearest_whole, settings
from vobench.suite import catalog, scene_file, yaml_file
from vobench.suite.axis import Camera, RigSettings
from vobench.suite.catalog import Entry
from vobench.suite.file_kind import Kind
from vobench.suite.manifest import read_manifest
from vobench.suite.scenario import MOST_SEVERE, Scenario, read_scenario
from vobench.suite.scene_file import Lighting
from vobench.suite.scene_spec import SceneFile
from vobench.suite.source import SOURCES, RecordedCase, Source, recorded_cases
from vobench.suite.trajectory import TrajectorySpec, read_replayed, read_times
from vobench.suite.yaml_file import Mistakes, YamlFile

USUAL_RIG = "ahead"  # where a suite has none
ALONE = {"scenarios", "source"}
ENGINES = ("raster", "path", "pyrender")
MOST_SAMPLES = 65536
CALIBRATION_STREAM = 7_301  # sets what is drawn of a calibration apart from other streams of a seed


@settings()
class Rendering:
    """The engine that draws pictures.

    `raster` draws with light computed once, `path` traces `samples` light paths through each pixel (None: as many as
    the path tracer takes by itself), `pyrender` is the stock renderer of that name.
    """

    engine: Annotated[str, OneOf("engine", ENGINES)] = "raster"
    samples: Annotated[int, Ge(1), Le(MOST_SAMPLES)] | None = None

    def __post_init__(self) -> None:
        if self.engine != "path" and self.samples is not None:
            raise SettingError(f"samples belongs to engine path, but the engine is {self.engine}; leave samples out")

    @property
    def needs_bake(self) -> bool:
        """Whether the engine draws with the light of the scene, computed before."""
        return self.engine == "raster"


@settings()
class TruthNoise:
    """How far each pose of the truth that is scored is off, as a reference of a real recording is.

    Standard deviations of its place along each axis, and of its turn about each.
    """

    position_m: Annotated[float, Ge(0), Le(1)] = 0.0
    rotation_deg: Annotated[float, Ge(0), Le(10)] = 0.0


EXACT = TruthNoise()


@settings()
class EstimatorSettings:
    """An estimator with parameters and limits other than its manifest's."""

    name: str
    label: Name | None = None
    params: dict[str, Any] = field(default_factory=dict)
    limits: dict[Annotated[str, OneOf("limit", hints(Limits))], float] = field(default_factory=dict)


def _listed(value: Any) -> Any:
    return (value,) if isinstance(value, int) else value


Severity = Annotated[int, Ge(0), Le(MOST_SEVERE)]
Severities = Annotated[tuple[Severity, ...], MinLen(1), Short(_listed, {"type": "integer"})]


def _at_all(value: Any) -> Any:
    is_list = isinstance(value, (list, tuple)) and all(isinstance(level, str) for level in value)
    return {level: list(range(MOST_SEVERE + 1)) for level in value} if is_list else value


Calibrations = Annotated[
    dict[Level, Severities],
    MinLen(1),
    Short(_at_all, {"type": "array", "items": {"enum": get_args(Level)}, "minItems": 1}),
]


def _named(value: Any) -> Any:
    return {"name": value} if isinstance(value, str) else value


ChannelName = Annotated[str, OneOf("ground-truth channel", CHANNELS)]
NamedEstimator = Annotated[EstimatorSettings, Short(_named, {"type": "string"})]
Window = tuple[Annotated[int, Ge(0)], Annotated[int, Ge(2)]]
Mode = Literal["step", "real_time"]


@settings()
class Suite:
    """The cases are every combination of scene, lighting, rig, trajectory and camera, and every recording of `source`.

    Each axis names its variants; change one axis to change one factor. Without rigs a pair looks ahead; without
    trajectories the body goes round where each scene is free. A suite of recordings alone has no axes, nor has one of
    `scenarios`, each at some severities and with the rig's calibration off by each of `calibrations`, or by those that
    have its severity. With `frames`
    only the pictures from one number to before another are taken of every way. What it does not say itself is as the
    suite has it that it includes.
    """

    include: str | None = None
    name: Name
    summary: str = ""
    seed: Annotated[int, Ge(0)] = 0
    repeats: Annotated[int, Ge(1), Le(100)] = 1
    source: Annotated[tuple[Source, ...], SOURCES] = ()
    scenarios: Annotated[dict[str, Severities], MinLen(1)] | None = None
    calibrations: Calibrations | None = None
    scenes: Annotated[tuple[str, ...], MinLen(1)] | None = None
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
        if missing := missing_axis({each.name for each in fields(self) if getattr(self, each.name)}):
            raise SettingError(missing)
        if self.calibrations and not self.scenarios:
            raise SettingError(
                "belongs to scenarios, and there are none; give a rig its calibration_error", "calibrations"
            )


def missing_axis(given: Collection[str]) -> str | None:
    """What a suite with these keys lacks: scenes, scenarios or a source; rigs and trajectories need scenes."""
    if "scenes" in given or (ALONE & set(given) and not {"rigs", "trajectories"} & set(given)):
        return None
    return "scenes: this key is missing; a suite has scenes, or scenarios or a source alone"


AXES = ("scene", "lighting", "rig", "trajectory", "camera")
Axes = tuple[dict[str, Any], ...]  # the variants of each, by name


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One sequence to be made: everything it depends on, resolved.

    `variant` names the case's place on each of AXES; `name` keeps those that differ within the suite,
    and so is unique there and fit for a folder. `seed` is the suite's; `replayed` is what the trajectory's
    file holds, as TUM text, where it has one. A case of a scenario says of which, and how severe it is.
    """

    name: str
    variant: dict[str, str]
    scene: SceneFile
    lighting: Lighting
    rig: RigSettings
    trajectory: TrajectorySpec
    replayed: str | None = None
    camera: CameraSettings
    rendering: Rendering
    truth: tuple[str, ...]
    truth_noise: TruthNoise = EXACT
    frames: Window | None = None
    seed: int
    scenario: str | None = None
    severity: int | None = None

    def build_scene(self) -> Scene:
        """The scene under this case's lighting."""
        from vobench.suite.scene_build import build

        return build(self.scene, self.lighting)

    def build_rig(self) -> Rig:
        """The sensors on the body as their calibration has them: what estimators are told."""
        spec = self.trajectory
        return replace(self.rig.build(), wheels=spec.wheels if isinstance(spec, Wheeled) else None)

    def build_true_rig(self) -> Rig:
        """The stereo pair as it is: what pictures are made with. Raises VobenchError, as `true_rig` does."""
        rig = self.build_rig()
        rng = np.random.default_rng([self.seed, CALIBRATION_STREAM])
        return true_rig(rig, drawn(self.rig.calibration_error, rig, rng))


@dataclass(frozen=True, slots=True)
class Entrant:
    """An estimator as it takes part in a suite: its folder, its manifest, its parameters and limits.

    In mode `step` it gets the next frame when it is through with the last, in `real_time` when the camera has it.
    """

    label: str
    folder: Path
    manifest: Manifest
    params: dict[str, Any]
    limits: Limits = USUAL
    mode: Mode = "step"

    @property
    def claims(self) -> tuple[str, ...]:
        """What a board says beside the label."""
        return (*self.manifest.claims, *(["real time"] if self.mode == "real_time" else []))


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
    found: tuple[Entry, ...]
    source: YamlFile

    @property
    def cases(self) -> tuple[Case | RecordedCase, ...]:
        """All cases."""
        return *self.simulated, *self.recorded

    def trials(self, case: Case | RecordedCase) -> list[Trial]:
        """Every trial on one case."""
        return [Trial(case, entrant, n) for entrant in self.entrants for n in range(self.suite.repeats)]

    def only(self, cases: Collection[str], scenes: Collection[str]) -> "Plan":
        """The plan of those cases and scenes alone whose names match; none given means all.

        Raises UnknownNameError for what matches none.
        """
        names = [case.name for case in self.cases]
        places = [case.variant.get("scene", "") for case in self.cases]
        for kind, patterns, known in (("case", cases, names), ("scene", scenes, places)):
            for pattern in patterns:
                if not fnmatch.filter(known, pattern):
                    raise UnknownNameError(unknown(kind, pattern, sorted(set(known))))

        def kept(case: Case | RecordedCase) -> bool:
            pairs = ((case.name, cases), (case.variant.get("scene", ""), scenes))
            return all(not some or any(fnmatch.fnmatch(name, pattern) for pattern in some) for name, some in pairs)

        return replace(self, simulated=tuple(filter(kept, self.simulated)), recorded=tuple(filter(kept, self.recorded)))

    def limited(self, **limits: Any) -> "Plan":
        """The plan with these of Limits in place of every entrant's."""
        entrants = (replace(each, limits=replace(each.limits, **limits)) for each in self.entrants)
        return replace(self, entrants=tuple(entrants))

    def mistakes(self) -> Mistakes:
        """To gather what is wrong with the suite."""
        return Mistakes(self.source)


def read_plan(
    name: str, *, only_estimators: tuple[str, ...] = (), changes: Mapping[str, str] = MappingProxyType({})
) -> Plan:
    """The plan of the suite of that name, or in that file; nothing is simulated, no estimator's code is imported.

    `only_estimators` are labels, globs of labels, or names of others; `changes` those of `yaml_file.read_all`.

    Raises SuiteError or UnknownNameError.
    """
    reading = yaml_file.read_all(catalog.find("suite", name).path, Suite, changes, kind="suite")
    wrong = Mistakes(reading.source, list(reading.mistakes))
    meant = {key for said in reading.source.plain for key in get_close_matches(str(said), hints(Suite), n=1)}
    with wrong.at():
        if wrong.found and (missing := missing_axis(meant)):
            raise SuiteError(missing)
    return _Planner(reading.model, wrong).plan(only_estimators)


@dataclass(frozen=True, slots=True)
class _Planner:
    """Resolves the names in a suite, of which entries or sections may be missing, and gathers what is wrong."""

    suite: Suite
    wrong: Mistakes
    found: list[Entry] = field(default_factory=list)
    changed: dict[str, SceneFile] = field(default_factory=dict)

    def plan(self, only_estimators: tuple[str, ...] = ()) -> Plan:
        """The plan. Raises SuiteError with all that is wrong."""
        entrants = self._entrants(only_estimators)
        scenes = self._scenes()
        replayed = self._replayed()
        axes = self._axes(scenes, self._rigs())
        variants = [*_combinations(axes)]
        if not self.suite.trajectories:
            variants = [(name, v) for name, v in variants if v["trajectory"] == _found_name(v["scene"], scenes)]
        of_scenarios = self._of_scenarios()
        taken = [name for name, _ in variants] + [case.name for case in of_scenarios]
        with self.wrong.at("scenarios"):
            if twice := [name for name in taken if taken.count(name) > 1]:
                raise SuiteError(f"two cases are called '{twice[0]}'; name a variant of an axis otherwise")
        recorded = self._recorded(set(taken))
        self.wrong.require_none()
        simulated = tuple(self._case(name, variant, axes, replayed) for name, variant in variants)
        return Plan(self.suite, (*simulated, *of_scenarios), recorded, entrants, tuple(self.found), self.wrong.source)

    def _folder(self) -> Path:
        """Where relative paths in a suite start: at its file."""
        return self.wrong.source.path.parent

    def _find(self, kind: Kind, name: str) -> Entry:
        entry = catalog.find(kind, name, suite=self.wrong.source.path.resolve())
        self.found.append(entry)
        return entry

    def _entrants(self, only: tuple[str, ...]) -> tuple[Entrant, ...]:
        listed = dict(enumerate(getattr(self.suite, "estimators", ())))
        if only:
            return self._asked_for(only, listed)
        entrants = list[Entrant]()
        for index, spec in listed.items():
            with self.wrong.at("estimators", index):
                entrants += self._of_modes(self._entrant(spec, index), entrants)
        return tuple(entrants)

    def _of_modes(self, entrant: Entrant, earlier: list[Entrant]) -> list[Entrant]:
        """The entrant in each mode of the suite; where there are two, real time has a label of its own."""
        modes = tuple(dict.fromkeys(getattr(self.suite, "modes", ("step",))))
        labels = {mode: f"{entrant.label}.{mode}" if mode != modes[0] else entrant.label for mode in modes}
        for label in labels.values():
            if label in [other.label for other in earlier]:
                raise SuiteError(f"two estimators are called '{label}'; give one a label of its own")
        return [replace(entrant, label=label, mode=mode) for mode, label in labels.items()]

    def _asked_for(self, only: tuple[str, ...], listed: dict[int, EstimatorSettings]) -> tuple[Entrant, ...]:
        """The suite's own entries of these labels, else estimators of these names with their defaults.

        Raises UnknownNameError and SuiteError, for it is not the suite that is wrong.
        """
        entrants = list[Entrant]()
        labels = {index: spec.label or spec.name for index, spec in listed.items()}
        named = [label for name in only for label in (fnmatch.filter(labels.values(), name) or [name])]
        for name in named:
            index = next((index for index, spec in listed.items() if name == (spec.label or spec.name)), None)
            spec = EstimatorSettings(name=name) if index is None else listed[index]
            entrants += self._of_modes(self._entrant(spec, index), entrants)
        return tuple(entrants)

    def _entrant(self, spec: EstimatorSettings, index: int | None) -> Entrant:
        folder = self._find("estimator", spec.name).path
        manifest = read_manifest(folder)
        for key, value in spec.params.items():
            with self.wrong.at("estimators", index or 0, "params", key):
                _check_param(key, value, manifest.params)
        limits = manifest.limits
        for key, value in spec.limits.items():
            with self.wrong.at("estimators", index or 0, "limits"):
                changed: Any = _whole(value) if isinstance(getattr(limits, key), int) else value
                limits = replace(limits, **{key: changed})
        return Entrant(spec.label or manifest.name, folder, manifest, {**manifest.params, **spec.params}, limits)

    def _scenes(self) -> dict[str, SceneFile]:
        """The scenes by their files' names, which name a case's place on this axis; lightings are checked on each."""
        scenes: dict[str, SceneFile] = {}
        for index, name in enumerate(self.suite.scenes or ()):
            with self.wrong.at("scenes", index):
                entry = self._find("scene", name)
                if entry.name in scenes:
                    raise SuiteError(
                        f"two scenes are called '{entry.name}'; give each once, from files of different names"
                    )
                scenes[entry.name], wrong = scene_file.survey(entry.path)
                self._check_lightings(scenes[entry.name], wrong)
                wrong.require_none()
        return scenes

    def _of_scenarios(self) -> list[Case]:
        """The cases of the scenarios: each at each severity, by each calibration."""
        cases = list[Case]()
        for name, severities in (self.suite.scenarios or {}).items():
            with self.wrong.at("scenarios", name):
                scenario = read_scenario(self._find("scenario", name).path)
                if scenario.name in (self.suite.trajectories or {}):
                    raise SuiteError("a trajectory of the suite is called so, too; give it another name")
                for severity in dict.fromkeys(severities):
                    cases += self._of_scenario(scenario, severity)
        return cases

    def _of_scenario(self, scenario: Scenario, severity: int) -> Iterator[Case]:
        setup = scenario.setup(severity)
        asked = self.suite.calibrations or {}
        levels = [level for level in asked if severity in asked[level]] if asked else [None]
        if not levels:
            raise SuiteError(f"none of the calibrations is run at severity {severity}")
        own = setup.rig.read(scenario.path.parent)
        entry = catalog.find("scene", setup.scene, suite=scenario.path)
        if entry not in self.found:
            self.found.append(entry)
        scene = self._changed(entry.path, setup.scene_changes)
        if setup.lighting:
            scene_file.lit(_lights(scene, setup.lighting), setup.lighting)
        text = None
        if isinstance(setup.trajectory, Replay):
            folder = scenario.path.parent
            text = read_replayed(setup.trajectory, folder, read_times(setup.trajectory, folder))
        variant = scenario.variant(severity, entry.name)
        for level in levels:
            rig = own
            end = f"-{level}" if len(asked) > 1 else ""
            if level:
                rig = replace(rig, calibration_error=replace(rig.calibration_error, level=level))
            yield Case(
                name=f"{scenario.name}-{severity}{end}",
                variant={**variant, "rig": f"{variant['rig']}{end}"},
                scene=scene,
                lighting=setup.lighting,
                rig=_possible(rig),
                trajectory=setup.trajectory,
                replayed=text,
                camera=setup.camera,
                **self._of_all(),
                scenario=scenario.name,
                severity=severity,
            )

    def _changed(self, path: Path, changes: dict[str, Any]) -> SceneFile:
        """A scene with these changes, read once for all scenarios that share it."""
        key = f"{path} {changes}"
        if key not in self.changed:
            self.changed[key], wrong = scene_file.survey(path, changes)
            wrong.require_none()
        return self.changed[key]

    def _check_lightings(self, scene: SceneFile, wrong: Mistakes) -> None:
        """A lighting that names no lamp is an error now, not after an hour."""
        named = {name for overrides in self.suite.lightings.values() for name in overrides}
        lights = () if wrong.found else _lights(scene, named)
        for lighting, overrides in self.suite.lightings.items():
            for name, override in overrides.items():
                with self.wrong.at("lightings", lighting, name):
                    if wrong.found:
                        scene_file.require_possible(name, wrong.source)
                    else:
                        scene_file.lit(lights, {name: override})

    def _rigs(self) -> dict[str, RigSettings]:
        """The rigs, their files read; one whose distortion is off, on a lens without any, is an error now."""
        rigs = dict(self.suite.rigs or {})
        for name, rig in rigs.items():
            with self.wrong.at("rigs", name):
                rigs[name] = _possible(rig.read(self._folder()))
        return rigs

    def _replayed(self) -> dict[str, str]:
        """What the files of replayed trajectories hold, by the trajectories' names."""
        texts = dict[str, str]()
        for name, spec in (self.suite.trajectories or {}).items():
            if isinstance(spec, Replay):
                with self.wrong.at("trajectories", name, "times"):
                    times = read_times(spec, self._folder())
                    with self.wrong.at("trajectories", name, "file"):
                        texts[name] = read_replayed(spec, self._folder(), times)
        return texts

    def _axes(self, scenes: dict[str, SceneFile], rigs: dict[str, RigSettings]) -> Axes:
        suite = self.suite
        if not scenes:
            return scenes, suite.lightings, rigs, suite.trajectories or {}, suite.cameras
        rigs = rigs or {USUAL_RIG: RigSettings(pitch_deg=10)}
        return scenes, suite.lightings, rigs, suite.trajectories or self._found_ways(scenes), suite.cameras

    def _found_ways(self, scenes: dict[str, SceneFile]) -> dict[str, Any]:
        """A way round in each scene, where the suite says none."""
        from vobench.suite.free_way import free_way
        from vobench.suite.scene_build import build

        ways = dict[str, Any]()
        for index, (name, scene) in enumerate(scenes.items()):
            with self.wrong.at("scenes", index):
                if not self.wrong.found:
                    ways[_found_name(name, scenes)] = free_way(build(scene, {}))
        return ways

    def _case(self, name: str, variant: dict[str, str], axes: Axes, replayed: dict[str, str]) -> Case:
        chosen = [axis[variant[kind]] for kind, axis in zip(AXES, axes, strict=True)]
        return Case(
            name=name,
            variant=variant,
            **dict(zip(AXES, chosen, strict=True)),
            replayed=replayed.get(variant["trajectory"]),
            **self._of_all(),
        )

    def _of_all(self) -> dict[str, Any]:
        """What all cases of the suite have alike."""
        return {key: getattr(self.suite, key) for key in ("rendering", "truth", "truth_noise", "frames", "seed")}

    def _recorded(self, taken: set[str]) -> tuple[RecordedCase, ...]:
        """The recordings, none of them called as another case is."""
        recorded = list[RecordedCase]()
        for index, spec in enumerate(self.suite.source):
            with self.wrong.at("source", index):
                recorded += recorded_cases(spec, self._folder(), entry=index)
        for case in recorded:
            with self.wrong.at("source", case.entry):
                if case.name in taken:
                    raise SuiteError(f"two cases are called '{case.name}'; name one another: {case.source.path}")
            taken = taken | {case.name}
        return tuple(recorded)


def _found_name(scene: str, scenes: Collection[str]) -> str:
    return "found" if len(scenes) == 1 else f"found_{scene}"


def _possible(rig: RigSettings) -> RigSettings:
    """A rig that can be built, its calibration's error too. Raises VobenchError."""
    true_rig(rig.build(), rig.calibration_error)
    return rig


def _lights(scene: SceneFile, named: Collection[str]) -> tuple[Light, ...]:
    """The lights of a scene; where its file lists all of those `named`, these alone, for which nothing is built."""
    from vobench.suite.scene_build import build, listed_lights

    listed = tuple(listed_lights(scene))
    return listed if {light.name for light in listed}.issuperset(named) else build(scene, {}).lights


def _combinations(axes: Axes) -> Iterator[tuple[str, dict[str, str]]]:
    """The name of each case, of those variants that there is a choice of, and its place on each axis."""
    for names in product(*axes):
        differing = [name for name, axis in zip(names, axes, strict=True) if len(axis) > 1]
        variant = dict(zip(AXES, names, strict=True))
        yield "-".join(differing) or variant["trajectory"], variant


def _whole(value: float) -> int:
    """A limit that counts something. Raises SuiteError for a fraction."""
    whole = nearest_whole(value)
    if whole is None:
        raise SuiteError(f"should be a whole number (got {value:g})")
    return whole


def _check_param(key: str, value: Any, defaults: dict[str, Any]) -> None:
    """A parameter of the manifest's, and of the kind of its value there; whole numbers may become fractions."""
    if key not in defaults:
        raise SuiteError(unknown("parameter", key, list(defaults)))
    kinds = [int if isinstance(v, float) else type(v) for v in (defaults[key], value)]
    if defaults[key] is not None and kinds[0] is not kinds[1]:
        raise SuiteError(f"parameter '{key}' should be of the kind of its default {defaults[key]!r}, got {value!r}")
