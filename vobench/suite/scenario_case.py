"""The cases of a suite's scenarios: each scenario at each severity, with each calibration."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any

from vobench.errors import MotionError, SuiteError
from vobench.geometry.rig import Level
from vobench.motion.free_start import Relocation, Startable, habits_of, joined_floor_use, start_of
from vobench.motion.replay import Replay
from vobench.suite import scene_file, scene_lighting
from vobench.suite.axis import RigSettings
from vobench.suite.case import Case
from vobench.suite.lookup import Lookup
from vobench.suite.props import Props
from vobench.suite.scenario import DEFAULT_CAMERA, Scenario, Setup, read_scenario
from vobench.suite.scene_entry import described_scene
from vobench.suite.scene_lighting import Lighting
from vobench.suite.scene_spec import SceneFile
from vobench.suite.spread import UNIT_AXES, Dealer, Spread, Unit, UnitAxis, kind_of, units
from vobench.suite.suite_case import Axes, check_buildable, scene_lights, shared_settings
from vobench.suite.suite_spec import Suite
from vobench.suite.trajectory import TrajectorySpec, read_replayed, read_times
from vobench.suite.yaml_source import Mistakes


@dataclass(frozen=True, slots=True)
class _Drive:
    """A trajectory with its name as a variant, the name of its unit, and the poses that it replays, as TUM text.

    `props` are those of the scenario around it, None if it has none with it.
    """

    name: str
    trajectory: TrajectorySpec
    unit: str
    replayed: str | None = None
    props: Props | None = None


@dataclass(frozen=True, slots=True)
class ScenarioCases:
    """Reads the cases of the scenarios of a suite, and collects mistakes.

    `axes` are those of the suite. Scenarios can be spread over its scenes and trajectories.
    `replayed` are the poses of the trajectories that are replayed, as TUM text by the name of the trajectory.
    `scenes` caches the scenes with a scenario's changes, because scenarios can share them.
    """

    suite: Suite
    mistakes: Mistakes
    lookup: Lookup
    axes: Axes
    replayed: Mapping[str, str]
    scenes: dict[str, SceneFile] = field(default_factory=dict)

    def all(self) -> list[Case]:
        """All cases, in the order of the suite."""
        cases = list[Case]()
        dealer = self._dealer()
        for name, severities in (self.suite.scenarios or {}).items():
            distinct_severities = list(dict.fromkeys(severities))
            with self.mistakes.at("scenarios", name):
                for case in self._of_scenario(name, distinct_severities, dealer):
                    cases.append(case)  # also those before a mistake
        return cases

    def _of_scenario(self, name: str, severities: Sequence[int], dealer: Dealer | None) -> Iterator[Case]:
        """The cases of a scenario: in its units if it is spread, or else in its own place. Raises VobenchError."""
        path = self.lookup.find("scenario", name).path
        scenario = read_scenario(path)
        if scenario.name in (self.suite.trajectories or {}):
            raise SuiteError("a trajectory of the suite has this name, too; rename it")
        if dealer and self._is_spread(name, scenario):
            kept = self._kept_by(name)
            with_base_of_suite = read_scenario(path, self._base(kept))
            if "camera" in kept:
                with_base_of_suite = _exposed_for_any_place(with_base_of_suite)
            yield from self._in_units(with_base_of_suite, severities, dealer, self._kinds_of(name))
            return
        for severity in severities:
            yield from self._at_severity(scenario, severity)

    def _is_spread(self, name: str, scenario: Scenario) -> bool:
        """Whether a scenario of a suite with a design leaves its own place.

        Raises SuiteError if the suite names places for a scenario that cannot leave its own.
        """
        spread = self.suite.spread
        if spread is None or name in spread.own_place:
            return False
        if "trajectory" in self._kept_by(name):
            if not scenario.suits_places_with_its_drive(keeps_props="props" in self._kept_by(name)):
                raise SuiteError(
                    "spread.keep says that it keeps its trajectory, which has no free start, or its severities change "
                    "its own place or single lights"
                )
            return True
        has_places = self._kinds_of(name) is not None
        if has_places and not scenario.suits_named_places:
            raise SuiteError(
                "spread.places names it, but its severities change its own place, single lights or its drive"
            )
        return has_places or scenario.suits_any_place

    def _kinds_of(self, name: str) -> Collection[str] | None:
        """The scenes that the suite spreads a scenario over; None if it does not say so."""
        spread = self.suite.spread
        if spread is None or spread.places is None:
            return None
        return spread.places.get(name)

    def _kept_by(self, name: str) -> Collection[str]:
        """What a scenario keeps of its own where it is spread."""
        spread = self.suite.spread
        if spread is None or spread.keep is None:
            return ()
        return spread.keep.get(name, ())

    def _dealer(self) -> Dealer | None:
        """The dealer that assigns units to scenarios; None if the suite does not spread them, or has mistakes."""
        spread = self.suite.spread
        if spread is None or not self.suite.scenarios or self.mistakes.recorded:
            return None
        with self.mistakes.at("spread"):
            self._require_scenarios("own_place", spread.own_place)
            self._require_scenarios("places", spread.places or ())
            self._require_scenarios("keep", spread.keep or ())
            self._require_scenes(spread)
            for axis in UNIT_AXES:
                if axis not in spread.over and len(self.axes[axis]) > 1:
                    raise SuiteError(f"scenarios are spread over variants of {axis}; add {axis} to over")
            return Dealer(units(spread, self.axes), spread.each, self.suite.seed)
        return None

    def _require_scenarios(self, key: str, names: Collection[str]) -> None:
        """Raise SuiteError if a key of `spread` names scenarios that the suite does not have."""
        unknown = [name for name in names if name not in (self.suite.scenarios or {})]
        if unknown:
            raise SuiteError(f"{key} names scenarios that the suite does not have: {', '.join(unknown)}")

    def _require_scenes(self, spread: Spread) -> None:
        """Raise SuiteError if `spread.places` names scenes that the suite does not have."""
        kinds = {kind_of(scene) for scene in self.axes["scene"]}
        for scenario, scenes in (spread.places or {}).items():
            unknown = [scene for scene in scenes if scene not in kinds]
            if unknown:
                raise SuiteError(f"places.{scenario} names scenes that the suite does not have: {', '.join(unknown)}")

    def _base(self, kept: Collection[str]) -> dict[str, Any]:
        """The rig and the camera in the file of the suite, which replace those of a base except for what is `kept`."""
        content = self.mistakes.source.plain
        base = dict[str, Any]()
        for section, key in (("rigs", "rig"), ("cameras", "camera")):
            for variant in (content.get(section) or {}).values():
                if key not in kept:
                    base[key] = variant
        return base

    def _in_units(
        self,
        scenario: Scenario,
        severities: Sequence[int],
        dealer: Dealer,
        kinds: Collection[str] | None,
    ) -> Iterator[Case]:
        """The cases of a scenario in its units, which are in places of some kinds, or of all.

        All severities have the same units, so that they can be compared.
        """
        runs = sum(len(self._calibration_levels(severity)) for severity in severities)
        drives = dict[tuple[str, int], _Drive]()  # by the name of the unit and the severity
        if "trajectory" in self._kept_by(scenario.name):

            def fits(unit: Unit) -> bool:
                """Whether the scenario can keep its trajectory in a unit; its drives there are added to `drives`."""
                own_drives = self._own_drives(scenario, severities, dealer, unit)
                drives.update({(unit.name, severity): drive for severity, drive in own_drives.items()})
                return bool(own_drives)

            chosen = dealer.deal(runs, kinds, fits)
        else:
            chosen = dealer.deal(runs, kinds)
            self._require_free_mounts(scenario, chosen)
            for unit, severity in product(chosen, severities):
                drives[unit.name, severity] = self._drive_of_suite(scenario, severity, unit)
        for severity, unit in product(severities, chosen):
            rig = scenario.setups[severity].rig.read(self._folder_of_rig(scenario))
            scene_name = self._variant(unit, "scene")
            drive = drives[unit.name, severity]
            variant = scenario.variant_names(severity, scene_name)
            scene = _with_common_changes(self.axes["scene"][scene_name], scenario, severity)
            yield from self._cases(
                scenario,
                severity,
                scene=drive.props.in_scene(scene) if drive.props else scene,
                lighting=scenario.lamps(severity),
                trajectory=drive.trajectory,
                replayed=drive.replayed,
                variant={**variant, "scene": scene_name, "trajectory": drive.name},
                rig=rig.mounted_on(drive.trajectory),
                unit=drive.unit,
            )

    def _drive_of_suite(self, scenario: Scenario, severity: int, unit: Unit) -> _Drive:
        """The trajectory of a unit at the rate of a severity."""
        name = self._variant(unit, "trajectory")
        drive_name, trajectory = scenario.in_drive(severity, name, self.axes["trajectory"][name])
        return _Drive(drive_name, trajectory, unit.name, self.replayed.get(name))

    def _own_drives(
        self, scenario: Scenario, severities: Sequence[int], dealer: Dealer, unit: Unit
    ) -> dict[int, _Drive]:
        """The trajectories of a scenario by severity from a free start in the place of a unit.

        They are empty if there is no such start. It is free for the rigs and the props of all the severities, so that
        it does not depend on the severity.
        """
        from vobench.suite.clearance import at_free_start  # slow to import, and most suites need no free start

        scene_name = self._variant(unit, "scene")
        column_m = max(self._column_m(scenario, severity) for severity in severities)
        all_props = [scenario.props[severity] for severity in severities] if self._keeps_props(scenario) else []
        floor_use = joined_floor_use(props.floor_use for props in all_props)
        start_seed = self.suite.base_seed + 1 + dealer.units.index(unit)
        suffix = f"start.{start_seed}"

        drives = dict[int, _Drive]()
        for severity in severities:
            own = scenario.setups[severity].trajectory
            assert isinstance(own, Startable)
            drawn = replace(own, start_seed=start_seed)
            try:
                trajectory = at_free_start(drawn, self.axes["scene"][scene_name], column_m, floor_use)
            except MotionError:
                return {}
            props = None
            if self._keeps_props(scenario):
                props = scenario.props[severity].relocated(Relocation(start_of(own), start_of(trajectory)))
            name = scenario.variant_names(severity, scene_name)["trajectory"]
            drives[severity] = _Drive(f"{name}.{suffix}", trajectory, f"{scene_name}-{suffix}", props=props)
        return drives

    def _column_m(self, scenario: Scenario, severity: int) -> float:
        """The height above the floor that has to be free for the robot and the rig of a severity."""
        from vobench.suite.clearance import column_on_wheels_m

        trajectory = scenario.setups[severity].trajectory
        assert isinstance(trajectory, Startable)
        rig = scenario.setups[severity].rig.read(self._folder_of_rig(scenario)).mounted_on(trajectory)
        return column_on_wheels_m(rig.build(), habits_of(trajectory))

    def _keeps_props(self, scenario: Scenario) -> bool:
        """Whether a scenario takes its props to other places."""
        return "props" in self._kept_by(scenario.name)

    def _variant(self, unit: Unit, axis: UnitAxis) -> str:
        """The variant of a unit on an axis. An axis over which nothing is spread has only one."""
        return unit.by_axis.get(axis) or next(iter(self.axes[axis]))

    def _require_free_mounts(self, scenario: Scenario, chosen: Sequence[Unit]) -> None:
        """Raise SuiteError if a trajectory mounts the cameras where only the severities of a scenario should."""
        varied = scenario.varied_rig_keys
        for unit in chosen:
            name = self._variant(unit, "trajectory")
            trajectory = self.axes["trajectory"][name]
            mounted_keys = trajectory.mount.replaced if trajectory.mount else {}
            conflicting = varied & set(mounted_keys)
            if conflicting:
                keys = ", ".join(sorted(conflicting))
                raise SuiteError(
                    f"its severities change {keys} of the rig, which the mount of trajectory '{name}' sets"
                )

    def _folder_of_rig(self, scenario: Scenario) -> Path:
        """The folder at which the paths in a rig start: that of the suite if the rig is from there."""
        has_rig_of_suite = self.suite.rigs and "rig" not in self._kept_by(scenario.name)
        return self.mistakes.source.path.parent if has_rig_of_suite else scenario.path.parent

    def _at_severity(self, scenario: Scenario, severity: int) -> Iterator[Case]:
        """The cases of a scenario in its own place, one for each calibration level. Raises VobenchError."""
        setup = scenario.setups[severity]
        scene_entry = self.lookup.find_for(scenario.path, setup.scene)
        scene = self._read_scene(scene_entry.path, setup.scene_changes)
        if setup.lighting:
            scene_lighting.with_lighting(scene_lights(scene, setup.lighting), setup.lighting)
        yield from self._cases(
            scenario,
            severity,
            scene=scene,
            lighting=setup.lighting,
            trajectory=setup.trajectory,
            replayed=_replayed_poses(setup, scenario.path.parent),
            variant=scenario.variant_names(severity, scene_entry.name),
            rig=setup.rig.read(scenario.path.parent),
        )

    def _cases(
        self,
        scenario: Scenario,
        severity: int,
        *,
        scene: SceneFile,
        lighting: Lighting,
        trajectory: TrajectorySpec,
        replayed: str | None,
        variant: dict[str, str],
        rig: RigSettings,
        unit: str = "",
    ) -> Iterator[Case]:
        """One case for each calibration level. Raises VobenchError."""
        setup = scenario.setups[severity]
        levels = self._calibration_levels(severity)
        has_several_levels = len(self.suite.calibrations or ()) > 1
        in_unit = f"-{unit}" if unit else ""
        for level in levels:
            suffix = f"-{level}" if has_several_levels else ""
            error = rig.calibration_error
            level_rig = replace(rig, calibration_error=replace(error, level=level)) if level else rig
            yield Case(
                name=f"{scenario.name}-{severity}{suffix}{in_unit}",
                variant={**variant, "rig": f"{variant['rig']}{suffix}"},
                scene=scene,
                lighting=lighting,
                rig=check_buildable(level_rig),
                trajectory=trajectory,
                replayed=replayed,
                camera=setup.camera,
                **shared_settings(self.suite),
                scenario=scenario.name,
                severity=severity,
            )

    def _calibration_levels(self, severity: int) -> list[Level | None]:
        """The calibration levels for a severity; [None] if the suite has no calibrations."""
        calibrations = self.suite.calibrations
        if not calibrations:
            return [None]
        levels: list[Level | None] = [level for level, severities in calibrations.items() if severity in severities]
        if not levels:
            raise SuiteError(f"no calibration lists severity {severity}")
        return levels

    def _read_scene(self, path: Path, changes: dict[str, Any]) -> SceneFile:
        """The scene in a file with a scenario's changes. Raises SuiteError."""
        key = f"{path} {changes}"
        if key not in self.scenes:
            scene, scene_mistakes = scene_file.read_scene_with_mistakes(path, changes)
            scene_mistakes.require_none()
            self.scenes[key] = described_scene(scene)
        return self.scenes[key]


def _exposed_for_any_place(scenario: Scenario) -> Scenario:
    """A scenario whose camera is exposed by the brightness of the place where it is, and no longer of its own."""
    setups = []
    for setup in scenario.setups:
        camera = replace(setup.camera, exposure_gain=DEFAULT_CAMERA.exposure_gain)
        setups.append(replace(setup, camera=camera))
    return replace(scenario, setups=tuple(setups))


def _with_common_changes(scene: SceneFile, scenario: Scenario, severity: int) -> SceneFile:
    """A scene of the suite with those changes of a severity that are possible in every place."""
    return replace(scene, **scenario.common_changes[severity].by_key)


def _replayed_poses(setup: Setup, folder: Path) -> str | None:
    """The poses that the trajectory replays, as TUM text; None if it replays none. Raises InputError."""
    if not isinstance(setup.trajectory, Replay):
        return None
    times = read_times(setup.trajectory, folder)
    return read_replayed(setup.trajectory, folder, times)
