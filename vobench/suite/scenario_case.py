"""The cases of a suite's scenarios: each scenario at each severity, with each calibration."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from vobench.errors import SuiteError
from vobench.geometry.rig import Level
from vobench.motion.replay import Replay
from vobench.suite import scene_file, scene_lighting
from vobench.suite.case import Case
from vobench.suite.lookup import Lookup
from vobench.suite.scenario import Scenario, Setup, read_scenario
from vobench.suite.scene_entry import described_scene
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite_case import check_buildable, scene_lights, shared_settings
from vobench.suite.suite_spec import Suite
from vobench.suite.trajectory import read_replayed, read_times
from vobench.suite.yaml_source import Mistakes


@dataclass(frozen=True, slots=True)
class ScenarioCases:
    """Reads the cases of the scenarios of a suite, and collects mistakes.

    `scenes` caches the scenes with a scenario's changes, because scenarios can share them.
    """

    suite: Suite
    mistakes: Mistakes
    lookup: Lookup
    scenes: dict[str, SceneFile] = field(default_factory=dict)

    def all(self) -> list[Case]:
        """All cases, in the order of the suite."""
        cases = list[Case]()
        for name, severities in (self.suite.scenarios or {}).items():
            with self.mistakes.at("scenarios", name):
                scenario = read_scenario(self.lookup.find("scenario", name).path)
                if scenario.name in (self.suite.trajectories or {}):
                    raise SuiteError("a trajectory of the suite has this name, too; rename it")
                for severity in dict.fromkeys(severities):
                    cases += self._at_severity(scenario, severity)
        return cases

    def _at_severity(self, scenario: Scenario, severity: int) -> Iterator[Case]:
        """One case for each calibration level. Raises VobenchError."""
        levels = self._calibration_levels(severity)
        setup = scenario.setup(severity)
        rig = setup.rig.read(scenario.path.parent)

        scene_entry = self.lookup.find_for(scenario.path, setup.scene)
        scene = self._read_scene(scene_entry.path, setup.scene_changes)
        if setup.lighting:
            scene_lighting.with_lighting(scene_lights(scene, setup.lighting), setup.lighting)

        replayed = _replayed_poses(setup, scenario.path.parent)
        variant = scenario.variant(severity, scene_entry.name)
        has_several_levels = len(self.suite.calibrations or ()) > 1
        for level in levels:
            suffix = f"-{level}" if has_several_levels else ""
            error = rig.calibration_error
            level_rig = replace(rig, calibration_error=replace(error, level=level)) if level else rig
            yield Case(
                name=f"{scenario.name}-{severity}{suffix}",
                variant={**variant, "rig": f"{variant['rig']}{suffix}"},
                scene=scene,
                lighting=setup.lighting,
                rig=check_buildable(level_rig),
                trajectory=setup.trajectory,
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


def _replayed_poses(setup: Setup, folder: Path) -> str | None:
    """The poses that the trajectory replays, as TUM text; None if it replays none. Raises InputError."""
    if not isinstance(setup.trajectory, Replay):
        return None
    times = read_times(setup.trajectory, folder)
    return read_replayed(setup.trajectory, folder, times)
