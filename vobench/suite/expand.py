"""From a suite to its plan: every case, and every run of an estimator on it."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from vobench.catalog import catalog, yaml_file
from vobench.catalog.manifest import Manifest, read_manifest
from vobench.errors import SuiteError
from vobench.geometry.rig import LENSES, Rig, stereo_rig
from vobench.scene.scene import Scene
from vobench.suite import scene_file
from vobench.suite.model import CameraSpec, EstimatorSpec, LampOverride, RigSpec, Strict, Suite, TrajectorySpec
from vobench.suite.scene_file import SceneFile

AXES = ("scene", "lighting", "rig", "trajectory", "camera")


class Case(Strict):
    """One sequence to be made: everything it depends on, resolved.

    `variant` names the case's place on each of AXES; `name` keeps those that differ within the suite,
    and so is unique there and fit for a folder. `seed` is the suite's.
    """

    name: str
    variant: dict[str, str]
    scene: SceneFile
    lighting: dict[str, LampOverride]
    rig: RigSpec
    trajectory: TrajectorySpec
    camera: CameraSpec
    seed: int

    def build_scene(self) -> Scene:
        """The scene under this case's lighting."""
        return scene_file.build(self.scene, self.lighting)

    def build_rig(self) -> Rig:
        """The stereo pair on the robot."""
        r = self.rig
        return stereo_rig(
            LENSES[r.lens],
            pitch_deg=r.pitch_deg,
            baseline_m=r.baseline_m,
            forward_m=r.forward_m,
            height_m=r.height_m,
        )


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

    case: Case
    entrant: Entrant
    repeat: int

    @property
    def name(self) -> str:
        """For people who wait."""
        return f"{self.entrant.label} on {self.case.name}"


@dataclass(frozen=True, slots=True)
class Plan:
    """What a suite comes to: cases × entrants × repeats."""

    suite: Suite
    cases: tuple[Case, ...]
    entrants: tuple[Entrant, ...]

    def runs(self, case: Case) -> list[Run]:
        """Every run on one case."""
        return [Run(case, entrant, n) for entrant in self.entrants for n in range(self.suite.repeats)]


def read_suite(name: str) -> Suite:
    """The suite of that name, or in that file. Raises SuiteError or UnknownNameError."""
    return yaml_file.read(catalog.find("suite", name).path, Suite)


def plan(suite: Suite, *, only_estimators: tuple[str, ...] = ()) -> Plan:
    """Resolve all names in a suite; nothing is simulated and no estimator's code is imported."""
    specs = [EstimatorSpec(name=e) if isinstance(e, str) else e for e in suite.estimators]
    if only_estimators:
        specs = [_asked_for(name, specs) for name in only_estimators]
    entrants = tuple(_entrant(spec) for spec in specs)
    labels = [entrant.label for entrant in entrants]
    for label in labels:
        if labels.count(label) > 1:
            raise SuiteError(f"suite '{suite.name}' has two estimators called '{label}'; give one a label of its own")
    return Plan(suite, tuple(_cases(suite)), entrants)


def _asked_for(name: str, specs: list[EstimatorSpec]) -> EstimatorSpec:
    """The suite's own entry of that label, else the estimator of that name with its defaults."""
    return next((spec for spec in specs if name == (spec.label or spec.name)), EstimatorSpec(name=name))


def _entrant(spec: EstimatorSpec) -> Entrant:
    folder = catalog.find("estimator", spec.name).path
    manifest = read_manifest(folder)
    for key in spec.params:
        if key not in manifest.params:
            known = list(manifest.params)
            raise SuiteError(f"estimator '{spec.name}': {catalog.unknown('parameter', key, known)}")
    return Entrant(spec.label or manifest.name, folder, manifest, {**manifest.params, **spec.params})


def _cases(suite: Suite) -> Iterator[Case]:
    entries = [catalog.find("scene", name) for name in suite.scenes]
    scenes = {entry.name: yaml_file.read(entry.path, SceneFile) for entry in entries}
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
            camera=suite.cameras[camera],
            seed=suite.seed,
        )
        case.build_scene()  # a lighting that names no lamp is an error now, not after an hour
        yield case
