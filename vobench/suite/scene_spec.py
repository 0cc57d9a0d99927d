"""What a scene's YAML may say."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from vobench.scene.light import SKIES, Dimmer, Flicker, Level, Steady, Switched
from vobench.scene.material import PATTERNS
from vobench.setting import Name, NonNegative, Positive, Share, Triple
from vobench.suite.yaml_file import Strict, one_of


class FlickerSpec(Strict):
    """A lamp on alternating current: 1 + depth cos(2π 2 mains_hz t + phase)."""

    mains_hz: Positive = 50.0
    depth: Share
    phase_deg: float = 0.0


class SwitchedSpec(Strict):
    """On or off at first, and the other way round at each time."""

    times_s: Annotated[tuple[float, ...], Field(min_length=1)]
    on_first: bool = True


class LevelSpec(Strict):
    """A light's brightness over time, relative to its nominal one: exactly one of these."""

    steady: NonNegative | None = None
    flicker: FlickerSpec | None = None
    dimmer: Annotated[tuple[tuple[float, NonNegative], ...], Field(min_length=2)] | None = None
    switched: SwitchedSpec | None = None

    @model_validator(mode="after")
    def _exactly_one(self) -> "LevelSpec":
        if len(self.model_dump(exclude_none=True)) != 1:
            raise ValueError("should have exactly one of steady, flicker, dimmer, switched")
        require_increasing([t for t, _ in self.dimmer or ()])
        require_increasing(list(self.switched.times_s) if self.switched else [])
        return self

    def build(self) -> Level:
        """The function of time."""
        if self.flicker:
            return Flicker(self.flicker.mains_hz, self.flicker.depth, float(np.deg2rad(self.flicker.phase_deg)))
        if self.dimmer:
            return Dimmer(tuple(t for t, _ in self.dimmer), tuple(level for _, level in self.dimmer))
        if self.switched:
            return Switched(self.switched.times_s, self.switched.on_first)
        assert self.steady is not None  # one of them is there
        return Steady(self.steady)


class LightOverride(Strict):
    """A light as a lighting sets it: another power (lamps) or illuminance (sun and sky), or a level over time."""

    power_lm: NonNegative | None = None
    illuminance_lx: NonNegative | None = None
    level: LevelSpec | None = None


def require_increasing(times_s: list[float]) -> None:
    """Raise ValueError where a time is not later than the one before it."""
    for earlier, later in pairwise(times_s):
        if later <= earlier:
            raise ValueError(f"times should increase, but {later:g} follows {earlier:g}")


# The light of anything larger would take more memory than machines have, and the renderer sees 60 m far.
Side = Annotated[float, Field(gt=0, le=30)]
Size = tuple[Side, Side, Side]
Elevation = Annotated[float, Field(gt=0, le=90)]
MaterialKind = Literal["matt", "polished", "mirror", "glass", "luminous"]
LampKind = Literal["panel", "point", "spot"]
Wall = Literal["north", "east", "south", "west"]

TEXTURE_KEYS = ("pattern", "albedo", "contrast", "tile_m", "resolution_px", "seed")
# Which keys belong to which kind of material or lamp.
MATERIAL_KEYS: dict[MaterialKind, tuple[str, ...]] = {
    "matt": TEXTURE_KEYS,
    "polished": (*TEXTURE_KEYS, "eta", "tint", "roughness"),
    "mirror": ("tint", "roughness"),
    "glass": ("eta", "tint"),
    "luminous": ("luminance_cd_m2",),
}
LAMP_KEYS: dict[LampKind, tuple[str, ...]] = {
    "panel": ("center_m", "size_m"),
    "point": ("center_m",),
    "spot": ("center_m", "target_m", "inner_deg", "outer_deg"),
}


class MaterialSpec(Strict):
    """What a surface is made of; `kind` says which of the other keys belong here."""

    kind: MaterialKind = "matt"
    pattern: Annotated[str, one_of("pattern", PATTERNS)] | None = None
    albedo: Annotated[float, Field(gt=0, lt=1)] | None = None
    contrast: Share = 0.0
    tile_m: Positive = 1.0
    resolution_px: Annotated[int, Field(ge=8, le=8192)] = 1024
    seed: Annotated[int, Field(ge=0)] = 0
    eta: Annotated[float, Field(gt=1, le=4)] = 1.5
    tint: Share | None = None
    roughness: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    luminance_cd_m2: Positive | None = None

    @model_validator(mode="after")
    def _fits_kind(self) -> "MaterialSpec":
        needed = {"matt": ("pattern", "albedo"), "polished": ("pattern", "albedo"), "luminous": ("luminance_cd_m2",)}
        _require_fitting(self, MATERIAL_KEYS, needed.get(self.kind, ()))
        return self


class WindowSpec(Strict):
    """A hole in a wall with a pane depth_m behind it; center_m is the place along the wall (world x or y) and z."""

    wall: Wall
    center_m: tuple[float, float]
    size_m: tuple[Side, Side]
    depth_m: Annotated[float, Field(gt=0, le=2)] = 0.15
    pane: str
    reveal: str


class RoomSpec(Strict):
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


class BoxSpec(Strict):
    """A piece of furniture."""

    name: Name | None = None
    center_m: Triple
    size_m: Size
    yaw_deg: float = 0.0
    material: str


class BoardSpec(Strict):
    """An upright rectangle seen from the side that faces yaw_deg (0 along x): a picture, a screen, a mirror, a pane."""

    name: Name | None = None
    center_m: Triple
    size_m: tuple[Side, Side]
    yaw_deg: float = 0.0
    material: str


class LampSpec(Strict):
    """A level panel that shines down from a rectangle of size_m, or a bulb with or without a reflector."""

    name: Name
    kind: LampKind = "panel"
    center_m: Triple
    size_m: tuple[Side, Side] | None = None
    target_m: Triple | None = None
    inner_deg: Annotated[float, Field(ge=0, lt=90)] = 20.0
    outer_deg: Annotated[float, Field(gt=0, lt=90)] = 30.0
    power_lm: NonNegative
    level: LevelSpec = LevelSpec(steady=1.0)

    @model_validator(mode="after")
    def _fits_kind(self) -> "LampSpec":
        needed = {"panel": ("size_m",), "spot": ("target_m",)}
        _require_fitting(self, LAMP_KEYS, needed.get(self.kind, ()))
        if self.inner_deg > self.outer_deg:
            raise ValueError(f"inner_deg should be at most outer_deg (got {self.inner_deg:g} and {self.outer_deg:g})")
        if self.target_m == self.center_m:
            raise ValueError(f"target_m should differ from center_m (got {list(self.center_m)} for both)")
        return self


class SunKey(Strict):
    """Where the sun stands at a time."""

    t_s: float
    azimuth_deg: float
    elevation_deg: Elevation


class SunSpec(Strict):
    """Direct sunlight on a surface that faces it; one place, or several in order of time."""

    illuminance_lx: NonNegative
    azimuth_deg: float | None = None
    elevation_deg: Elevation | None = None
    path: tuple[SunKey, ...] = ()
    level: LevelSpec = LevelSpec(steady=1.0)

    @model_validator(mode="after")
    def _one_place_or_path(self) -> "SunSpec":
        angles = [angle for angle in (self.azimuth_deg, self.elevation_deg) if angle is not None]
        if len(angles) != (0 if self.path else 2):
            raise ValueError("should have either azimuth_deg and elevation_deg, or a path")
        require_increasing([key.t_s for key in self.path])
        return self


class SkySpec(Strict):
    """A sky that gives illuminance_lx on open level ground."""

    illuminance_lx: NonNegative
    kind: Annotated[str, one_of("sky", SKIES)] = "overcast"
    level: LevelSpec = LevelSpec(steady=1.0)


class PathKey(Strict):
    """Where a mover is at a time."""

    t_s: float
    position_m: Triple
    yaw_deg: float = 0.0


class MoverSpec(Strict):
    """A box that goes straight from key to key, its middle at position_m; again and again where it repeats."""

    name: Name
    size_m: Size
    material: str
    path: Annotated[tuple[PathKey, ...], Field(min_length=2)]
    repeats: bool = False

    @model_validator(mode="after")
    def _in_order(self) -> "MoverSpec":
        require_increasing([key.t_s for key in self.path])
        return self


class SceneFile(Strict):
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


def _require_fitting(
    spec: MaterialSpec | LampSpec, keys_of: Mapping[Any, tuple[str, ...]], needed: tuple[str, ...]
) -> None:
    known = keys_of[spec.kind]
    for key in needed:
        if getattr(spec, key) is None:
            raise ValueError(f"{key} is missing for kind '{spec.kind}'")
    for key in sorted({key for keys in keys_of.values() for key in keys}.difference(known)):
        if key in spec.model_fields_set:
            raise ValueError(f"{key} does not belong to kind '{spec.kind}', which has {', '.join(known)}")
