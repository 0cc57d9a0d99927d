"""What a scene's YAML may say, beside the materials and levels of the room `scene`."""

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt, MinLen
from numpy.typing import ArrayLike, NDArray

from vobench.errors import SettingError
from vobench.geometry.se3 import Array
from vobench.scene.light import (
    SKIES,
    AreaLight,
    Dimmer,
    Flicker,
    Level,
    PointLight,
    SpotLight,
    Steady,
    Switched,
    require_increasing,
)
from vobench.scene.material import Glass, Matt, Mirror, Polished
from vobench.scene.scene import ceiling_light
from vobench.setting import ByKind, Name, NonNegative, OneOf, Positive, Triple, settings


@settings()
class LevelSpec:
    """A light's brightness over time, relative to its nominal one: exactly one of these."""

    steady: NonNegative | None = None
    flicker: Flicker | None = None
    dimmer: Annotated[tuple[tuple[float, NonNegative], ...], MinLen(2)] | None = None
    switched: Switched | None = None

    def __post_init__(self) -> None:
        if sum(way is not None for way in (self.steady, self.flicker, self.dimmer, self.switched)) != 1:
            raise SettingError("should have exactly one of steady, flicker, dimmer, switched")
        require_increasing([t for t, _ in self.dimmer or ()])

    def build(self) -> Level:
        """The function of time."""
        if self.dimmer:
            return Dimmer(tuple(t for t, _ in self.dimmer), tuple(level for _, level in self.dimmer))
        return self.flicker or self.switched or Steady(self.steady or 0.0)


STEADY = LevelSpec(steady=1.0)


@settings()
class LightOverride:
    """A light as a lighting sets it: another power (lamps) or illuminance (sun and sky), or a level over time."""

    power_lm: NonNegative | None = None
    illuminance_lx: NonNegative | None = None
    level: LevelSpec | None = None


# The light of anything larger would take more memory than machines have, and the renderer sees 60 m far.
Side = Annotated[float, Gt(0), Le(30)]
Size = tuple[Side, Side, Side]
Elevation = Annotated[float, Gt(0), Le(90)]


@settings()
class Luminous:
    """A material of lamps: what has it shines evenly to all sides of its front."""

    kind: Literal["luminous"] = "luminous"
    luminance_cd_m2: Positive


MaterialSpec = Annotated[Matt | Polished | Mirror | Glass | Luminous, ByKind("material", default="matt")]


@settings()
class WindowSpec:
    """A hole in a wall with a pane depth_m behind it; center_m is the place along the wall (world x or y) and z."""

    wall: Literal["north", "east", "south", "west"]
    center_m: tuple[float, float]
    size_m: tuple[Side, Side]
    depth_m: Annotated[float, Gt(0), Le(2)] = 0.15
    pane: str
    reveal: str


@settings()
class RoomSpec:
    """Four walls, a floor at z = 0 and a ceiling, around the origin."""

    size_m: Size
    floor: str
    wall: str
    ceiling: str
    windows: tuple[WindowSpec, ...] = ()

    @property
    def extent(self) -> str:
        """Its size in words."""
        return f"{' × '.join(f'{side:g}' for side in self.size_m)} m around the origin"

    def holds(self, points_m: ArrayLike) -> NDArray[np.bool_]:
        """Which points (..., 3) are within the walls, above the floor and below the ceiling."""
        half = np.array(self.size_m) / 2
        within: NDArray[np.bool_] = np.all(np.abs(np.asarray(points_m) - [0, 0, half[2]]) < half, axis=-1)
        return within


@settings()
class BoxSpec:
    """A piece of furniture."""

    name: Name | None = None
    center_m: Triple
    size_m: Size
    yaw_deg: float = 0.0
    material: str


@settings()
class BoardSpec:
    """An upright rectangle seen from the side that faces yaw_deg (0 along x): a picture, a screen, a mirror, a pane."""

    name: Name | None = None
    center_m: Triple
    size_m: tuple[Side, Side]
    yaw_deg: float = 0.0
    material: str


@settings()
class PanelLamp:
    """A level panel that shines down from a rectangle of size_m."""

    name: Name
    kind: Literal["panel"] = "panel"
    center_m: Triple
    size_m: tuple[Side, Side]
    power_lm: NonNegative
    level: LevelSpec = STEADY

    def build(self) -> AreaLight:
        """The light."""
        panel = ceiling_light(self.name, np.asarray(self.center_m), self.size_m, power_lm=self.power_lm)
        return replace(panel, level=self.level.build())


@settings()
class PointLamp:
    """A bulb."""

    name: Name
    kind: Literal["point"] = "point"
    center_m: Triple
    power_lm: NonNegative
    level: LevelSpec = STEADY

    def build(self) -> PointLight:
        """The light."""
        return PointLight(self.name, np.asarray(self.center_m), self.power_lm, self.level.build())


@settings()
class SpotLamp:
    """A bulb in a reflector that points at target_m."""

    name: Name
    kind: Literal["spot"] = "spot"
    center_m: Triple
    target_m: Triple
    inner_deg: Annotated[float, Ge(0), Lt(90)] = 20.0
    outer_deg: Annotated[float, Gt(0), Lt(90)] = 30.0
    power_lm: NonNegative
    level: LevelSpec = STEADY

    def __post_init__(self) -> None:
        if self.inner_deg > self.outer_deg:
            raise SettingError(f"should be at most outer_deg, {self.outer_deg:g} (got {self.inner_deg:g})", "inner_deg")
        if self.target_m == self.center_m:
            raise SettingError(f"should differ from center_m (got {list(self.center_m)} for both)", "target_m")

    def build(self) -> SpotLight:
        """The light."""
        center, level = np.asarray(self.center_m), self.level.build()
        way = np.asarray(self.target_m) - center
        direction: Array = way / np.linalg.norm(way)
        return SpotLight(self.name, center, direction, self.power_lm, self.inner_deg, self.outer_deg, level)


LampSpec = Annotated[PanelLamp | PointLamp | SpotLamp, ByKind("lamp", default="panel")]


@settings()
class SunKey:
    """Where the sun is at a time."""

    t_s: float
    azimuth_deg: float
    elevation_deg: Elevation


@settings()
class SunSpec:
    """Direct sunlight on a surface that faces it; one place, or several in order of time."""

    illuminance_lx: NonNegative
    azimuth_deg: float | None = None
    elevation_deg: Elevation | None = None
    path: tuple[SunKey, ...] = ()
    level: LevelSpec = STEADY

    def __post_init__(self) -> None:
        angles = [angle for angle in (self.azimuth_deg, self.elevation_deg) if angle is not None]
        if len(angles) != (0 if self.path else 2):
            raise SettingError("should have either azimuth_deg and elevation_deg, or a path")
        require_increasing([key.t_s for key in self.path])


@settings()
class SkySpec:
    """A sky that gives illuminance_lx on open level ground."""

    illuminance_lx: NonNegative
    kind: Annotated[str, OneOf("sky", SKIES)] = "overcast"
    level: LevelSpec = STEADY


@settings()
class PathKey:
    """Where a mover is at a time."""

    t_s: float
    position_m: Triple
    yaw_deg: float = 0.0


@settings()
class MoverSpec:
    """A box that goes straight from key to key, its middle at position_m; again and again where it repeats."""

    name: Name
    size_m: Size
    material: str
    path: Annotated[tuple[PathKey, ...], MinLen(2)]
    repeats: bool = False

    def __post_init__(self) -> None:
        require_increasing([key.t_s for key in self.path])


@settings()
class SceneFile:
    """A scene, and the luminance of matt white that cameras are exposed for."""

    name: Name
    summary: str = ""
    white_cd_m2: Positive
    materials: dict[Name, MaterialSpec]
    room: RoomSpec
    boxes: tuple[BoxSpec, ...] = ()
    boards: tuple[BoardSpec, ...] = ()
    lamps: tuple[LampSpec, ...] = ()
    sun: SunSpec | None = None
    sky: SkySpec | None = None
    movers: tuple[MoverSpec, ...] = ()
