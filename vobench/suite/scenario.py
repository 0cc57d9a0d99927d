"""A scenario: one thing that makes odometry hard, at severities from 0 to 5, all else the same."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from annotated_types import MaxLen, MinLen

from vobench.errors import Mistake, SuiteError
from vobench.sensor.image_sensor import CameraSettings
from vobench.setting import Name, over, settings
from vobench.suite import yaml_file
from vobench.suite.axis import Camera, RigSettings
from vobench.suite.scene_file import Lighting
from vobench.suite.trajectory import TrajectorySpec

MOST_SEVERE = 5
AXES = ("lighting", "rig", "trajectory", "camera")
NO_CAMERA = CameraSettings()


@settings()
class Setup:
    """What a case is simulated with: one variant of each axis.

    `scene_changes` are values in place of those of the scene's file, by keys with dots between.
    """

    scene: str
    scene_changes: dict[str, Any] = field(default_factory=dict)
    lighting: Lighting = field(default_factory=dict)
    rig: RigSettings
    trajectory: TrajectorySpec
    camera: Camera = NO_CAMERA


@settings()
class ScenarioFile:
    """A scenario's YAML: a setup, and for each severity what is changed in it, key by key.

    What it does not say itself is as the file has it that it includes: another scenario, or one with a `base` alone.
    """

    include: str | None = None
    name: Name
    summary: str = ""
    base: Setup
    severity: Annotated[tuple[dict[str, Any], ...], MinLen(MOST_SEVERE + 1), MaxLen(MOST_SEVERE + 1)]


@dataclass(frozen=True, slots=True)
class Scenario:
    """A scenario as its file has it: the name, and the setup of each severity."""

    name: str
    path: Path
    setups: tuple[Setup, ...]

    def setup(self, severity: int) -> Setup:
        """What a case of this severity is simulated with."""
        return self.setups[severity]

    def variant(self, severity: int, scene: str) -> dict[str, str]:
        """The name on each axis: the scenario's, with the severity where that changes something."""
        setup = self.setups[severity]
        first = self.setups[0]

        def name(axis: str, whole: str) -> str:
            is_same = getattr(setup, axis) == getattr(first, axis)
            return whole if is_same else f"{whole}.{severity}"

        placed = name("scene_changes", f"{scene}.{self.name}") if setup.scene_changes else scene
        return {"scene": placed, **{axis: name(axis, self.name) for axis in AXES}}


def read_scenario(path: Path) -> Scenario:
    """The scenario in a file. Raises SuiteError with all that is wrong with it."""
    read = yaml_file.read_all(path, ScenarioFile, kind="scenario")
    if read.mistakes:
        raise SuiteError(*read.mistakes)
    base = read.source.plain["base"]
    wrong = list[Mistake]()
    setups = list[Setup]()
    for severity, changes in enumerate(read.model.severity):
        try:
            place = read.source.place(("severity", severity))
            setups.append(yaml_file.checked_section(Setup, over(base, changes), place))
        except SuiteError as error:
            wrong += error.mistakes
    if wrong:
        raise SuiteError(*wrong)
    return Scenario(read.model.name, path, tuple(setups))
