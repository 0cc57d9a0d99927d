"""Scenarios: simulated cases in which one difficulty for odometry increases from severity 0 to severity 5."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from annotated_types import MaxLen, MinLen

from vobench.errors import Mistake, SuiteError
from vobench.motion.free_start import Startable
from vobench.scene.fog import Fog
from vobench.scene.paint import Paint
from vobench.scene.rain import Rain
from vobench.scene.wind import Wind
from vobench.sensor.image_sensor import CameraSettings
from vobench.setting import Name, merged_over, settings
from vobench.suite import yaml_file
from vobench.suite.axis import AXES, Camera, RigSettings
from vobench.suite.props import Props
from vobench.suite.scene_lighting import LAMPS, Lighting
from vobench.suite.scene_spec import MaterialSpec
from vobench.suite.trajectory import TrajectorySpec

MOST_SEVERE = 5
SEVERITY_COUNT = MOST_SEVERE + 1  # with severity 0, the base
PLACE_KEYS = ("scene", "scene_changes", "lighting", "trajectory")  # the keys of a setup that describe place and drive
DEFAULT_CAMERA = CameraSettings()


@settings()
class Setup:
    """The setup of a simulated case: one variant of each axis.

    `scene_changes` maps keys of the scene file to new values. The keys of nested values are joined by dots.
    """

    scene: str
    scene_changes: dict[str, Any] = field(default_factory=dict)
    lighting: Lighting = field(default_factory=dict)
    rig: RigSettings
    trajectory: TrajectorySpec
    camera: Camera = DEFAULT_CAMERA


@settings()
class CommonChanges:
    """Changes of a scene that are possible in every place: of its weather, and of its surfaces."""

    fog: Fog | None = None
    rain: Rain | None = None
    wind: Wind | None = None
    floor: MaterialSpec | None = None
    paint: Paint | None = None

    @property
    def by_key(self) -> dict[str, Any]:
        """The changes that there are, by their key in a scene."""
        changes = {key: getattr(self, key) for key in COMMON_KEYS}
        return {key: change for key, change in changes.items() if change is not None}


COMMON_KEYS = tuple(each.name for each in fields(CommonChanges))
PROP_KEYS = tuple(each.name for each in fields(Props))


@settings()
class ScenarioFile:
    """The content of a scenario file.

    `base` is the setup without any changes.
    `severity` lists, for each severity from 0 to 5, the keys of the setup that differ from `base`.
    `include` names a file from which omitted keys are taken: another scenario, or a file with only a `base`.
    """

    include: str | None = None
    name: Name
    summary: str = ""
    base: Setup
    severity: Annotated[tuple[dict[str, Any], ...], MinLen(SEVERITY_COUNT), MaxLen(SEVERITY_COUNT)]


@dataclass(frozen=True, slots=True)
class Scenario:
    """A scenario: its name, its file, and the setup of each severity from 0.

    `common_changes`, `props` and `other_changes` are the three parts of what each severity changes of the scene.
    """

    name: str
    path: Path
    setups: tuple[Setup, ...]
    common_changes: tuple[CommonChanges, ...]
    props: tuple[Props, ...]
    other_changes: tuple[dict[str, Any], ...]

    @property
    def suits_any_place(self) -> bool:
        """Whether it needs only a rig and a camera, so that it can be combined with any scene and trajectory.

        Then no severity changes the place or the drive, and the base has no lighting of its own.
        """
        return not self._changed_place_keys and not self.setups[0].lighting

    @property
    def suits_named_places(self) -> bool:
        """Whether it can be combined with scenes and trajectories that somebody chose for it.

        Of place, light and drive, its severities then change only what all have: the weather, the surfaces, the level
        of all lamps, and the rate of the images.
        """
        return all(self._changes_what_places_have(key) for key in self._changed_place_keys)

    def _changes_what_places_have(self, key: str, *, keeps_props: bool = False) -> bool:
        """Whether severities change a key of place and drive only in what all places and drives have.

        With `keeps_props`, all places have the props of the scenario.
        """
        has_other_changes = any(changes != self.other_changes[0] for changes in self.other_changes)
        has_other_props = any(props != self.props[0] for props in self.props)
        is_common = {
            "scene": False,
            "scene_changes": not has_other_changes and (keeps_props or not has_other_props),
            "lighting": self._changes_only_lamps,
            "trajectory": self._changes_only_rate,
        }
        return is_common[key]

    @property
    def _changes_only_lamps(self) -> bool:
        """Whether the lightings of all severities differ only in what they say of all lamps."""
        base_without_lamps = _without_lamps(self.setups[0].lighting)
        return all(_without_lamps(setup.lighting) == base_without_lamps for setup in self.setups)

    @property
    def _changes_only_rate(self) -> bool:
        """Whether the trajectories of all severities differ only in the rate of the images."""
        base = self.setups[0].trajectory
        return all(replace(setup.trajectory, rate_hz=base.rate_hz) == base for setup in self.setups)

    def suits_places_with_its_drive(self, *, keeps_props: bool) -> bool:
        """Whether it can be driven on its own trajectory in other places, with its props if it `keeps_props`.

        The trajectory is then one of given shape, whose start is drawn, and of place and light its severities
        change only what all places have.
        """
        is_startable = all(isinstance(setup.trajectory, Startable) for setup in self.setups)
        other_keys = [key for key in self._changed_place_keys if key != "trajectory"]
        return is_startable and all(self._changes_what_places_have(key, keeps_props=keeps_props) for key in other_keys)

    def lamps(self, severity: int) -> Lighting:
        """What the lighting of a severity says of all lamps."""
        lighting = self.setups[severity].lighting
        return {LAMPS: lighting[LAMPS]} if LAMPS in lighting else {}

    def in_drive(self, severity: int, name: str, trajectory: TrajectorySpec) -> tuple[str, TrajectorySpec]:
        """A trajectory under a name with the rate of a severity, which has the same ratio to severity 0 as its own.

        If the rate differs, the name has the form of `variant_names`, as in tour.frame_rate.3.
        """
        suffix = self._severity_suffix(severity, key="trajectory")
        if not suffix:
            return name, trajectory
        ratio = self.setups[severity].trajectory.rate_hz / self.setups[0].trajectory.rate_hz
        return f"{name}.{self.name}{suffix}", replace(trajectory, rate_hz=ratio * trajectory.rate_hz)

    @property
    def _changed_place_keys(self) -> list[str]:
        """The keys of place and drive that differ between severities."""
        return [key for key in PLACE_KEYS if self._is_changed_by_any_severity(key)]

    @property
    def varied_rig_keys(self) -> set[str]:
        """The keys of the rig that differ between severities."""
        base_rig = self.setups[0].rig
        varied_keys = set()
        for rig_field in fields(RigSettings):
            key = rig_field.name
            base_value = getattr(base_rig, key)
            if any(getattr(setup.rig, key) != base_value for setup in self.setups):
                varied_keys.add(key)
        return varied_keys

    def _is_changed_by_any_severity(self, key: str) -> bool:
        """Whether a key of the setup differs from that of severity 0 at another severity."""
        base_value = getattr(self.setups[0], key)
        return any(getattr(setup, key) != base_value for setup in self.setups)

    def variant_names(self, severity: int, scene: str) -> dict[str, str]:
        """The name of the variant on each axis, as in `Case.variant`; `scene` is the name of the scene.

        At severity 3 of a scenario `dim` in the scene `office`, the names are:

        | axis         | if severity 3 changes it | otherwise |
        |--------------|--------------------------|-----------|
        | scene        | office.dim.3             | office    |
        | lighting ... | dim.3                    | dim       |

        The second row is that of all axes except for the scene. A scene that all severities change in the same way has
        the name office.dim, since it differs from the scene office, but not between severities.
        """
        names = {}
        for axis in AXES:
            if axis == "scene":
                names[axis] = self._scene_name(severity, scene)
            else:
                names[axis] = self.name + self._severity_suffix(severity, key=axis)
        return names

    def _scene_name(self, severity: int, scene: str) -> str:
        """The name of the scene; with changes, it is followed by the name of the scenario, as in office.dim.3."""
        if not self.setups[severity].scene_changes:
            return scene
        return f"{scene}.{self.name}" + self._severity_suffix(severity, key="scene_changes")

    def _severity_suffix(self, severity: int, *, key: str) -> str:
        """The end of a name: the severity, as in ".3", if it changes this key of the setup; otherwise empty."""
        is_changed = getattr(self.setups[severity], key) != getattr(self.setups[0], key)
        return f".{severity}" if is_changed else ""


def _without_lamps(lighting: Lighting) -> Lighting:
    """What a lighting says of single lights."""
    return {name: override for name, override in lighting.items() if name != LAMPS}


def read_scenario(path: Path, replaced: Mapping[str, Any] = MappingProxyType({})) -> Scenario:
    """The scenario in a file. Raises SuiteError with all mistakes in it.

    `replaced` are plain YAML values that replace those of its base.
    """
    reading = yaml_file.read_all(path, ScenarioFile, kind="scenario")
    if reading.mistakes:
        raise SuiteError(*reading.mistakes)
    source = reading.source
    scenario_file = reading.model

    # The changes are applied to the base as written, so that they can change single keys of its sections.
    written_base = {**source.plain["base"], **replaced}
    setups: list[Setup] = []
    common_changes: list[CommonChanges] = []
    props: list[Props] = []
    other_changes: list[dict[str, Any]] = []
    mistakes: list[Mistake] = []
    for severity, changes in enumerate(scenario_file.severity):
        place = source.place(("severity", severity))
        merged = merged_over(written_base, changes)
        try:
            setup = yaml_file.checked_section(Setup, merged, place)
            changes_of_scene = setup.scene_changes
            common = {key: value for key, value in changes_of_scene.items() if key in COMMON_KEYS}
            around_path = {key: value for key, value in changes_of_scene.items() if key in PROP_KEYS}
            common_changes.append(yaml_file.checked_section(CommonChanges, common, place))
            props.append(yaml_file.checked_section(Props, around_path, place))
        except SuiteError as error:
            mistakes += error.mistakes
        else:
            setups.append(setup)
            known_keys = common.keys() | around_path.keys()
            other_changes.append({key: value for key, value in changes_of_scene.items() if key not in known_keys})
    if mistakes:
        raise SuiteError(*mistakes)
    return Scenario(
        scenario_file.name,
        path,
        tuple(setups),
        tuple(common_changes),
        tuple(props),
        tuple(other_changes),
    )
