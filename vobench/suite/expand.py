"""From a suite to its plan: every case, and every run of an estimator on it."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

from vobench.catalog import catalog, yaml_file
from vobench.catalog.manifest import Manifest, read_manifest
from vobench.catalog.yaml_file import Source
from vobench.errors import SuiteError
from vobench.geometry.calibration import CalibrationError, true_rig
from vobench.geometry.preset import PRESETS
from vobench.geometry.rig import Rig, mounted
from vobench.scene.scene import Scene
from vobench.suite import scene_file
from vobench.suite.camera_spec import CameraSpec
from vobench.suite.light_spec import LightOverride
from vobench.suite.model import EstimatorSpec, RigSpec, Suite
from vobench.suite.rendering_spec import ChannelName, RenderingSpec
from vobench.suite.replay_spec import ReplaySpec, read_replayed, read_times
from vobench.suite.scene_spec import SceneFile
from vobench.suite.source_spec import RecordedCase, recorded_cases
from vobench.suite.strict import Strict
from vobench.suite.trajectory_spec import TrajectorySpec, wheels_of

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
        r, preset = self.rig, PRESETS[self.rig.lens]
        cameras = mounted(
            preset.left,
            preset.right,
            preset.T_left_right if r.baseline_m is None else preset.at_baseline(r.baseline_m),
            pitch_deg=r.pitch_deg,
            forward_m=r.forward_m,
            height_m=r.height_m,
        )
        imu = r.imu.build().calibration if r.imu else None
        return replace(cameras, wheels=wheels_of(self.trajectory), imu=imu)

    def build_true_rig(self) -> Rig:
        """The stereo pair as it is: what pictures are made with. Raises VobenchError, as `true_rig` does."""
        return true_rig(self.build_rig(), CalibrationError(**self.rig.calibration_error.model_dump()))


@dataclass(frozen=True, slots=True)
class Entrant:
    """An estimator as it takes part in a suite: its folder, its manifest and its parameters."""

    label: str
    folder: Path
    manifest: Manifest
    params: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Run:
    """One entrant on one case, for the `repeat`-th time."""

    case: Case | RecordedCase
    entrant: Entrant
    repeat: int

    @property
    def name(self) -> str:
        """For people who wait."""
        return f"{self.entrant.label} on {self.case.name}"


@dataclass(frozen=True, slots=True)
class Plan:
    """What a suite comes to: cases × entrants × repeats; `source` is the suite's file."""

    suite: Suite
    simulated: tuple[Case, ...]
    recorded: tuple[RecordedCase, ...]
    entrants: tuple[Entrant, ...]
    source: Source | None = None

    @property
    def cases(self) -> tuple[Case | RecordedCase, ...]:
        """All cases."""
        return *self.simulated, *self.recorded

    def runs(self, case: Case | RecordedCase) -> list[Run]:
        """Every run on one case."""
        return [Run(case, entrant, n) for entrant in self.entrants for n in range(self.suite.repeats)]

    def at(self, *keys: int | str) -> AbstractContextManager[None]:
        """Errors of the block name this place in the suite's file."""
        return _at(self.source, *keys)


def read_plan(name: str, *, only_estimators: tuple[str, ...] = ()) -> Plan:
    """The plan of the suite of that name, or in that file. Raises SuiteError or UnknownNameError."""
    suite, source = yaml_file.read_marked(catalog.find("suite", name).path, Suite)
    return plan(suite, source=source, only_estimators=only_estimators)


def plan(suite: Suite, *, source: Source | None = None, only_estimators: tuple[str, ...] = ()) -> Plan:
    """Resolve all names in a suite; nothing is simulated and no estimator's code is imported."""
    if only_estimators:
        entrants = [_entrant(_asked_for(name, suite.estimators)) for name in only_estimators]
    else:
        entrants = [_listed(spec, index, source) for index, spec in enumerate(suite.estimators)]
    for index, entrant in enumerate(entrants):
        if entrant.label in [earlier.label for earlier in entrants[:index]]:
            with nullcontext() if only_estimators else _at(source, "estimators", index):
                raise SuiteError(f"two estimators are called '{entrant.label}'; give one a label of its own")
    simulated = tuple(_cases(suite, source))
    recorded = tuple(_recorded(suite, source, taken={case.name for case in simulated}))
    return Plan(suite, simulated, recorded, tuple(entrants), source)


def _at(source: Source | None, *keys: int | str) -> AbstractContextManager[None]:
    return source.at(*keys) if source else nullcontext()


def _folder(source: Source | None) -> Path:
    """Where relative paths in a suite start: at its file."""
    return source.path.parent if source else Path.cwd()


def _asked_for(name: str, specs: tuple[EstimatorSpec, ...]) -> EstimatorSpec:
    """The suite's own entry of that label, else the estimator of that name with its defaults."""
    return next((spec for spec in specs if name == (spec.label or spec.name)), EstimatorSpec(name=name))


def _listed(spec: EstimatorSpec, index: int, source: Source | None) -> Entrant:
    with _at(source, "estimators", index):
        return _entrant(spec)


def _entrant(spec: EstimatorSpec) -> Entrant:
    folder = catalog.find("estimator", spec.name).path
    manifest = read_manifest(folder)
    for key, value in spec.params.items():
        _check_param(key, value, manifest.params)
    return Entrant(spec.label or manifest.name, folder, manifest, {**manifest.params, **spec.params})


def _check_param(key: str, value: Any, defaults: dict[str, Any]) -> None:
    """A parameter of the manifest's, and of the kind of its value there; whole numbers may become fractions."""
    if key not in defaults:
        raise SuiteError(catalog.unknown("parameter", key, list(defaults)))
    kinds = [int if isinstance(v, float) else type(v) for v in (defaults[key], value)]
    if defaults[key] is not None and kinds[0] is not kinds[1]:
        raise SuiteError(f"parameter '{key}' should be of the kind of its default {defaults[key]!r}, got {value!r}")


def _cases(suite: Suite, source: Source | None) -> Iterator[Case]:
    scenes, replayed = _scenes(suite, source), _replayed(suite, source)
    axes: list[dict[str, Any]] = [scenes, suite.lightings, suite.rigs, suite.trajectories, suite.cameras]
    for names in product(*axes):
        scene, lighting, rig, trajectory, camera = names
        differing = [name for name, axis in zip(names, axes, strict=True) if len(axis) > 1]
        case = Case(
            name="-".join(differing) or trajectory,
            variant=dict(zip(AXES, names, strict=True)),
            scene=scenes[scene],
            lighting=suite.lightings[lighting],
            rig=suite.rigs[rig],
            trajectory=suite.trajectories[trajectory],
            replayed=replayed.get(trajectory),
            camera=suite.cameras[camera],
            rendering=suite.rendering,
            truth=suite.truth,
            seed=suite.seed,
        )
        with _at(source, "lightings", lighting):
            case.build_scene()  # a lighting that names no lamp is an error now, not after an hour
        with _at(source, "rigs", rig):
            case.build_true_rig()  # nor one whose distortion is off, on a lens without any
        yield case


def _recorded(suite: Suite, source: Source | None, *, taken: set[str]) -> Iterator[RecordedCase]:
    """The recordings of a suite; a relative path starts at the suite's file."""
    folder = _folder(source)
    for index, spec in enumerate(suite.source):
        with _at(source, "source", index):
            cases = list(recorded_cases(spec, folder, entry=index))
            _require_new(cases, taken)
        taken = taken | {case.name for case in cases}
        yield from cases


def _require_new(cases: list[RecordedCase], taken: set[str]) -> None:
    """Raise SuiteError for the first that is called as another case is."""
    for case in cases:
        if case.name in taken:
            raise SuiteError(f"two cases are called '{case.name}'; name one another: {case.source.path}")
        taken = taken | {case.name}


def _replayed(suite: Suite, source: Source | None) -> dict[str, str]:
    """What the files of replayed trajectories hold, by the trajectories' names; a relative path as for recordings."""
    texts, folder = dict[str, str](), _folder(source)
    for name, spec in suite.trajectories.items():
        if isinstance(spec, ReplaySpec):
            with _at(source, "trajectories", name, "times"):
                times = read_times(spec, folder)
            with _at(source, "trajectories", name, "file"):
                texts[name] = read_replayed(spec, folder, times)
    return texts


def _scenes(suite: Suite, source: Source | None) -> dict[str, SceneFile]:
    """The scenes by their files' names, which name a case's place on this axis."""
    scenes: dict[str, SceneFile] = {}
    for index, name in enumerate(suite.scenes):
        with _at(source, "scenes", index):
            entry = catalog.find("scene", name)
            if entry.name in scenes:
                raise SuiteError(f"two scenes are called '{entry.name}'; give each once, from files of different names")
            scenes[entry.name] = scene_file.read_scene(entry.path)
    return scenes
