"""The cases of a suite's axes: every combination of scene, lighting, rig, trajectory and camera."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

from vobench.errors import SuiteError
from vobench.geometry.rig import true_rig
from vobench.motion.replay import Replay
from vobench.motion.wander import Wander
from vobench.scene.light import Light
from vobench.suite import scene_file, scene_lighting
from vobench.suite.axis import AXES, RigSettings
from vobench.suite.case import Case
from vobench.suite.lookup import Lookup
from vobench.suite.scene_entry import places
from vobench.suite.scene_spec import SceneFile
from vobench.suite.spread import Dealer, Spread, units
from vobench.suite.suite_spec import Suite
from vobench.suite.trajectory import TrajectorySpec, read_replayed, read_times
from vobench.suite.yaml_source import Mistakes

USUAL_RIG = "ahead"  # the name of the default rig
USUAL_PITCH_DEG = 10
USUAL_DRIVE = Wander(length_m=8.0, rate_hz=10.0)
SHARED_SETTINGS = ("rendering", "truth", "truth_noise", "frames", "seed")  # the same for all cases of a suite

Axes = dict[str, Mapping[str, Any]]  # the variants of each axis by name, in the order of AXES


@dataclass(frozen=True, slots=True)
class Variant:
    """One combination of the axes: the name of the case, and the name of the variant on each axis."""

    name: str
    by_axis: dict[str, str]


@dataclass(frozen=True, slots=True)
class AxisReader:
    """Reads the variants of a suite's axes, which may be incomplete, and collects mistakes.

    `entry_of` maps the name of each scene to the number of its entry in the suite.
    """

    suite: Suite
    mistakes: Mistakes
    lookup: Lookup
    entry_of: dict[str, int] = field(default_factory=dict)

    def _folder(self) -> Path:
        """The folder of the suite, at which its relative paths start."""
        return self.mistakes.source.path.parent

    def scenes(self) -> dict[str, SceneFile]:
        """The scenes by name. The lightings of the suite are checked against each scene that its file describes.

        No generator is run.
        """
        files = dict[Path, tuple[SceneFile, Mistakes]]()
        scenes = dict[str, SceneFile]()
        for index, entry in enumerate(self.suite.scenes or ()):
            with self.mistakes.at("scenes", index):
                found = self.lookup.find("scene", entry.name)
                if found.path not in files:
                    files[found.path] = scene_file.read_scene_with_mistakes(found.path)
                scene, scene_mistakes = files[found.path]
                if scene.is_described and not entry.has_seeds:
                    self._check_lightings(scene, scene_mistakes)
                scene_mistakes.require_none()
                for place in places(entry, found.name, scene, base_seed=self.suite.base_seed):
                    _require_new(place.name, scenes)
                    scenes[place.name] = place.scene
                    self.entry_of[place.name] = index
        return scenes

    def _check_lightings(self, scene: SceneFile, scene_mistakes: Mistakes) -> None:
        """Find lightings that name a light which the scene does not have, before anything is simulated."""
        lightings = self.suite.lightings
        is_scene_complete = not scene_mistakes.recorded
        lights: tuple[Light, ...] = ()
        if is_scene_complete:
            names = {name for overrides in lightings.values() for name in overrides}
            lights = scene_lights(scene, names)

        for lighting, overrides in lightings.items():
            for name, override in overrides.items():
                with self.mistakes.at("lightings", lighting, name):
                    if is_scene_complete:
                        scene_lighting.with_lighting(lights, {name: override})
                    else:
                        scene_lighting.require_possible(name, scene_mistakes.source)

    def replayed_poses(self) -> dict[str, str]:
        """The poses of each replayed trajectory as TUM text, by the name of the trajectory."""
        texts = dict[str, str]()
        for name, spec in (self.suite.trajectories or {}).items():
            if not isinstance(spec, Replay):
                continue
            with self.mistakes.at("trajectories", name, "times"):
                times = read_times(spec, self._folder())
                with self.mistakes.at("trajectories", name, "file"):
                    texts[name] = read_replayed(spec, self._folder(), times)
        return texts

    def rigs(self) -> dict[str, RigSettings]:
        """The rigs with the lenses from their files. A rig that cannot be built is a mistake."""
        rigs = dict(self.suite.rigs or {})
        for name, rig in rigs.items():
            with self.mistakes.at("rigs", name):
                rigs[name] = check_buildable(rig.read(self._folder()))
        return rigs

    def axes(self, scenes: dict[str, SceneFile], rigs: dict[str, RigSettings]) -> Axes:
        """The variants of each axis. If there are scenes, missing rigs and trajectories are replaced by defaults."""
        trajectories: Mapping[str, Any] = self._drives()
        if scenes and not rigs:
            rigs = {USUAL_RIG: RigSettings(pitch_deg=USUAL_PITCH_DEG)}
        if scenes and not trajectories:
            trajectories = self._default_trajectories(scenes)
        return {
            "scene": scenes,
            "lighting": self.suite.lightings,
            "rig": rigs,
            "trajectory": trajectories,
            "camera": self.suite.cameras,
        }

    def _drives(self) -> dict[str, TrajectorySpec]:
        """The trajectories of the suite, one for each seed of those that wander."""
        drives = dict[str, TrajectorySpec]()
        for name, spec in (self.suite.trajectories or {}).items():
            if not isinstance(spec, Wander) or spec.seeds is None:
                drives[name] = spec
                continue
            for number in range(spec.seeds):
                seed = self.suite.base_seed + spec.seed + number
                drives[f"{name}.{seed}"] = replace(spec, seed=seed, seeds=None)
        return drives

    def _default_trajectories(self, scenes: dict[str, SceneFile]) -> dict[str, Any]:
        """A circular path in the free space of each scene. In a generated place, which is not built, a body wanders."""
        from vobench.suite.free_space import circular_path
        from vobench.suite.scene_build import build

        trajectories = dict[str, Any]()
        for name, scene in scenes.items():
            own_name = _default_trajectory_name(name, scenes)
            if scene.generated:
                trajectories[own_name] = USUAL_DRIVE
                continue
            with self.mistakes.at("scenes", self.entry_of[name]):
                if not self.mistakes.recorded:
                    trajectories[own_name] = circular_path(build(scene, {}))
        return trajectories

    def variants(self, axes: Axes) -> list[Variant]:
        """Every combination of the axes. A default trajectory is combined only with its scene."""
        variants = _combinations(axes)
        if self.suite.trajectories:
            return variants
        scenes = axes["scene"]
        own_variants = list[Variant]()
        for variant in variants:
            own_trajectory = _default_trajectory_name(variant.by_axis["scene"], scenes)
            if variant.by_axis["trajectory"] == own_trajectory:
                own_variants.append(variant)
        return own_variants

    def spread_variants(self, axes: Axes, spread: Spread) -> list[Variant]:
        """The combinations of a design: each combination of the other axes in some of the units.

        Raises SuiteError if there are fewer units than the design asks for.
        """
        dealer = Dealer(units(spread, axes), spread.each, self.suite.seed)
        others = {axis: names for axis, names in axes.items() if axis not in spread.over}
        variants = list[Variant]()
        for names in product(*others.values()):
            treatment = dict(zip(others, names, strict=True))
            differing = [name for axis, name in treatment.items() if len(axes[axis]) > 1]
            for unit in dealer.deal():
                chosen = {**treatment, **unit.by_axis}
                by_axis = {axis: chosen[axis] for axis in AXES}
                variants.append(Variant("-".join([*differing, unit.name]), by_axis))
        return variants

    def case(self, variant: Variant, axes: Axes, replayed: Mapping[str, str]) -> Case:
        """The case of one combination."""
        chosen = {axis: axes[axis][name] for axis, name in variant.by_axis.items()}
        chosen["rig"] = chosen["rig"].mounted_on(chosen["trajectory"])
        return Case(
            name=variant.name,
            variant=variant.by_axis,
            **chosen,
            replayed=replayed.get(variant.by_axis["trajectory"]),
            **shared_settings(self.suite),
        )


def _require_new(name: str, scenes: Collection[str]) -> None:
    """Raise SuiteError if another scene has this name."""
    if name in scenes:
        raise SuiteError(f"two scenes are called '{name}'; list each once, from files with different names")


def _default_trajectory_name(scene: str, scenes: Collection[str]) -> str:
    return "found" if len(scenes) == 1 else f"found_{scene}"


def _combinations(axes: Axes) -> list[Variant]:
    """Every combination of the axes. Its name consists of the variants on axes that have several variants."""
    variants = list[Variant]()
    for names in product(*axes.values()):
        by_axis = dict(zip(AXES, names, strict=True))
        differing = [name for axis, name in by_axis.items() if len(axes[axis]) > 1]
        variants.append(Variant("-".join(differing) or by_axis["trajectory"], by_axis))
    return variants


def shared_settings(suite: Suite) -> dict[str, Any]:
    """The settings that all cases of a suite share."""
    return {key: getattr(suite, key) for key in SHARED_SETTINGS}


def check_buildable(rig: RigSettings) -> RigSettings:
    """Return the rig if it can be built with its calibration error. Raises VobenchError otherwise."""
    true_rig(rig.build(), rig.calibration_error)
    return rig


def scene_lights(scene: SceneFile, names: Collection[str]) -> tuple[Light, ...]:
    """The lights of a scene, including those in `names`.

    If the file of the scene lists all of `names`, only the listed lights are returned, and no geometry is built.
    """
    from vobench.suite.scene_build import build, listed_lights

    listed = tuple(listed_lights(scene))
    listed_names = {light.name for light in listed}
    return listed if listed_names.issuperset(names) else build(scene, {}).lights
