"""The settings in the YAML file of a scene."""

from dataclasses import field, replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt, MinLen
from numpy.typing import ArrayLike, NDArray

from vobench.asset import FURNITURE, PANORAMAS, ROLES
from vobench.asset.texture import Procedural
from vobench.errors import SettingError
from vobench.geometry.se3 import Array
from vobench.scene.fog import Fog
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
from vobench.scene.material import LUMINANCE, WHITE, Material, Rgb
from vobench.scene.paint import Paint
from vobench.scene.rain import Rain
from vobench.scene.scene import ceiling_light
from vobench.scene.wind import Wind
from vobench.setting import ByKind, Name, NonNegative, OneOf, Positive, Share, Triple, ValueCheck, settings


@settings()
class LevelSpec:
    """The brightness of a light over time, relative to its nominal brightness. Exactly one field is set."""

    steady: NonNegative | None = None
    flicker: Flicker | None = None
    dimmer: Annotated[tuple[tuple[float, NonNegative], ...], MinLen(2)] | None = None
    switched: Switched | None = None

    def __post_init__(self) -> None:
        alternatives = (self.steady, self.flicker, self.dimmer, self.switched)
        given_count = sum(alternative is not None for alternative in alternatives)
        if given_count != 1:
            raise SettingError("should have exactly one of steady, flicker, dimmer, switched")
        require_increasing([t_s for t_s, _ in self.dimmer or ()])

    def build(self) -> Level:
        """The level as a function of time."""
        if self.dimmer:
            times_s = tuple(t_s for t_s, _ in self.dimmer)
            levels = tuple(level for _, level in self.dimmer)
            return Dimmer(times_s, levels)
        return self.flicker or self.switched or Steady(self.steady or 0.0)


STEADY = LevelSpec(steady=1.0)


@settings()
class LightOverride:
    """The changes of a light: another power (lamps), illuminance (sun and sky), or level over time."""

    power_lm: NonNegative | None = None
    illuminance_lx: NonNegative | None = None
    level: LevelSpec | None = None


Colour = tuple[Share, Share, Share]  # linear red, green and blue


def unit_luminance_colour(colour: Colour) -> Rgb:
    """The colour scaled to luminance 1. Raises SettingError for black."""
    luminance = float(np.array(colour) @ np.array(LUMINANCE))
    if not luminance:
        raise SettingError("light should not be black (got [0, 0, 0])")
    red, green, blue = (channel / luminance for channel in colour)
    return red, green, blue


Hue = Annotated[Colour, ValueCheck(unit_luminance_colour)]  # the colour of a light, which does not change its power


# The light map of a larger scene would not fit into memory.
Side = Annotated[float, Gt(0), Le(300)]
Size = tuple[Side, Side, Side]
Elevation = Annotated[float, Gt(0), Le(90)]


@settings()
class LuminousSpec:
    """A light-emitting material. Its front emits diffusely, in the hue of the linear RGB `colour`."""

    kind: Literal["luminous"] = "luminous"
    luminance_cd_m2: Positive
    colour: Hue = WHITE

    def build(self) -> Material:
        """The material."""
        red, green, blue = (self.luminance_cd_m2 * channel for channel in unit_luminance_colour(self.colour))
        return Material(emission_cd_m2=(red, green, blue))


Eta = Annotated[float, Ge(1), Le(4)]  # refractive index; 1 means no pane, or no coat
Roughness = Annotated[float, Ge(0), Le(0.5)]


@settings(kw_only=False)
class DiffuseSpec(Procedural):
    """A diffuse (Lambertian) material. Its reflectance is that of its texture times the linear RGB `colour`."""

    colour: Colour = WHITE
    kind: Literal["matt"] = "matt"

    def build(self) -> Material:
        """The material."""
        return Material(colour=self.colour, texture=self)


@settings(kw_only=False)
class PolishedSpec(Procedural):
    """A diffuse material under a clear coat, such as waxed stone, which reflects more at grazing angles.

    `tint` scales the reflection of the coat. `roughness` is the RMS slope of its facets (GGX alpha); it is 0 for a
    smooth coat.
    """

    eta: Eta = 1.5
    tint: Share = 1.0
    roughness: Roughness = 0.0
    colour: Colour = WHITE
    kind: Literal["polished"] = "polished"

    def build(self) -> Material:
        """The material."""
        return Material(colour=self.colour, texture=self, eta=self.eta, tint=self.tint, roughness=self.roughness)


@settings(kw_only=False)
class MirrorSpec:
    """A metal that reflects the share `tint` of the light at every angle. `roughness` is that of PolishedSpec."""

    tint: Share = 0.9
    roughness: Roughness = 0.0
    kind: Literal["mirror"] = "mirror"

    def build(self) -> Material:
        """The material."""
        return Material("mirror", tint=self.tint, roughness=self.roughness)


@settings(kw_only=False)
class GlassSpec:
    """A thin pane that reflects a small part of the light, and transmits the rest without refraction.

    `tint` scales the transmission.
    """

    eta: Eta = 1.5
    tint: Share = 1.0
    kind: Literal["glass"] = "glass"

    def build(self) -> Material:
        """The material."""
        return Material("pane", eta=self.eta, tint=self.tint)


Wall = Literal["north", "east", "south", "west"]
MaterialSpec = Annotated[
    DiffuseSpec | PolishedSpec | MirrorSpec | GlassSpec | LuminousSpec, ByKind("material", default="matt")
]


@settings()
class WindowSpec:
    """An opening in a wall, with a pane at the distance `depth_m` behind it.

    `center_m` is the position along the wall (x or y) and the height (z).
    """

    wall: Wall
    center_m: tuple[float, float]
    size_m: tuple[Side, Side]
    depth_m: Annotated[float, Gt(0), Le(2)] = 0.15
    pane: str
    reveal: str


@settings()
class RoomSpec:
    """Four walls around the origin, a floor at z = 0, and a ceiling. `walls` maps single walls to materials."""

    size_m: Size
    floor: str
    wall: str
    ceiling: str
    walls: dict[Wall, str] = field(default_factory=dict)
    windows: tuple[WindowSpec, ...] = ()

    @property
    def extent(self) -> str:
        """The size of the room as text."""
        return f"{' × '.join(f'{side:g}' for side in self.size_m)} m around the origin"

    def holds(self, points_m: ArrayLike) -> NDArray[np.bool_]:
        """Whether each point (..., 3) is inside of the room."""
        half_size_m = np.array(self.size_m) / 2
        center_m = [0, 0, half_size_m[2]]
        offset_m = np.abs(np.asarray(points_m) - center_m)
        is_inside: NDArray[np.bool_] = np.all(offset_m < half_size_m, axis=-1)
        return is_inside


@settings()
class BoxSpec:
    """A box, such as a simple piece of furniture."""

    name: Name | None = None
    center_m: Triple
    size_m: Size
    yaw_deg: float = 0.0
    material: str


@settings()
class BoardSpec:
    """An upright rectangle, such as a picture, screen, mirror or pane.

    Its visible side faces the direction `yaw_deg`; 0 is along x.
    """

    name: Name | None = None
    center_m: Triple
    size_m: tuple[Side, Side]
    yaw_deg: float = 0.0
    material: str


@settings()
class FurnitureSpec:
    """A piece of furniture at `at_m` whose front faces `yaw_deg`.

    Its random details depend on its name and the seed.
    """

    kind: Annotated[str, OneOf("piece of furniture", FURNITURE)]
    name: Name
    at_m: Triple
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    size: dict[str, Any] = field(default_factory=dict)


@settings()
class ModelSpec:
    """A model from a glTF, OBJ, STL or PLY file, with its origin at `at_m`.

    `roles` maps globs of node names to roles.
    `scale` is the length of the file's unit in metres.
    `up` is the axis that points up, if it differs from that of the format.
    """

    file: Annotated[str, MinLen(1)]
    name: Name | None = None
    at_m: Triple = (0.0, 0.0, 0.0)
    yaw_deg: float = 0.0
    scale: Positive = 1.0
    up: Literal["y", "z"] | None = None
    roles: dict[str, Annotated[str, OneOf("role", ROLES)]] = field(default_factory=dict)


@settings()
class PanelLamp:
    """A horizontal panel of size_m that emits light downwards."""

    name: Name
    kind: Literal["panel"] = "panel"
    center_m: Triple
    size_m: tuple[Side, Side]
    power_lm: NonNegative
    colour: Hue = WHITE
    level: LevelSpec = STEADY

    def build(self) -> AreaLight:
        """The light."""
        panel = ceiling_light(self.name, np.asarray(self.center_m), self.size_m, power_lm=self.power_lm)
        return replace(panel, level=self.level.build(), colour=unit_luminance_colour(self.colour))


@settings()
class PointLamp:
    """A lamp that emits light equally in all directions."""

    name: Name
    kind: Literal["point"] = "point"
    center_m: Triple
    power_lm: NonNegative
    colour: Hue = WHITE
    level: LevelSpec = STEADY

    def build(self) -> PointLight:
        """The light."""
        return PointLight(
            self.name, np.asarray(self.center_m), self.power_lm, self.level.build(), unit_luminance_colour(self.colour)
        )


@settings()
class SpotLamp:
    """A lamp in a reflector that points at target_m."""

    name: Name
    kind: Literal["spot"] = "spot"
    center_m: Triple
    target_m: Triple
    inner_deg: Annotated[float, Ge(0), Lt(90)] = 20.0
    outer_deg: Annotated[float, Gt(0), Lt(90)] = 30.0
    power_lm: NonNegative
    colour: Hue = WHITE
    level: LevelSpec = STEADY

    def __post_init__(self) -> None:
        if self.inner_deg > self.outer_deg:
            raise SettingError(f"should be at most outer_deg, {self.outer_deg:g} (got {self.inner_deg:g})", "inner_deg")
        if self.target_m == self.center_m:
            raise SettingError(f"should differ from center_m (got {list(self.center_m)} for both)", "target_m")

    def build(self) -> SpotLight:
        """The light."""
        center = np.asarray(self.center_m)
        level = self.level.build()
        towards_target = np.asarray(self.target_m) - center
        direction: Array = towards_target / np.linalg.norm(towards_target)
        return SpotLight(
            self.name,
            center,
            direction,
            self.power_lm,
            self.inner_deg,
            self.outer_deg,
            level,
            unit_luminance_colour(self.colour),
        )


LampSpec = Annotated[PanelLamp | PointLamp | SpotLamp, ByKind("lamp", default="panel")]


@settings()
class SunKey:
    """The position of the sun at a time."""

    t_s: float
    azimuth_deg: float
    elevation_deg: Elevation


@settings()
class SunSpec:
    """Direct sunlight, as the illuminance of a surface that faces it, from one position or along a path."""

    illuminance_lx: NonNegative
    azimuth_deg: float | None = None
    elevation_deg: Elevation | None = None
    path: tuple[SunKey, ...] = ()
    colour: Hue = WHITE
    level: LevelSpec = STEADY

    def __post_init__(self) -> None:
        angles_deg = [angle for angle in (self.azimuth_deg, self.elevation_deg) if angle is not None]
        needed_count = 0 if self.path else 2
        if len(angles_deg) != needed_count:
            raise SettingError("should have either azimuth_deg and elevation_deg, or a path")
        require_increasing([key.t_s for key in self.path])


@settings()
class PanoramaSpec:
    """What surrounds a scene, too far away for parallax; another seed has other buildings, trees and clouds.

    `height_m` is how high the scene's z = 0 is above the ground around. `distance_m` is how near the first things are.
    """

    kind: Annotated[str, OneOf("panorama", PANORAMAS)]
    seed: Annotated[int, Ge(0)] = 0
    height_m: Annotated[float, Ge(0), Le(300)] = 0.0
    distance_m: Annotated[float, Ge(15), Le(500)] = 30.0


@settings()
class SkySpec:
    """A sky, as the illuminance of open horizontal ground."""

    illuminance_lx: NonNegative
    kind: Annotated[str, OneOf("sky", SKIES)] = "overcast"
    colour: Hue = WHITE
    level: LevelSpec = STEADY
    panorama: PanoramaSpec | None = None


@settings()
class PathKey:
    """The pose of a mover at a time."""

    t_s: float
    position_m: Triple
    yaw_deg: float = 0.0


@settings()
class MoverSpec:
    """A thing that moves in straight lines from key to key. With `repeats`, it starts again at the end.

    It is a box with `size_m` and `material` whose centre is at `position_m`, or furniture or a model with its origin
    there.
    """

    name: Name
    size_m: Size | None = None
    material: str | None = None
    kind: Annotated[str, OneOf("piece of furniture", FURNITURE)] | None = None
    file: str | None = None
    path: Annotated[tuple[PathKey, ...], MinLen(2)]
    repeats: bool = False

    def __post_init__(self) -> None:
        require_increasing([key.t_s for key in self.path])
        if (self.size_m is None) != (self.material is None):
            raise SettingError("a box that moves should have both size_m and material")
        shape_count = sum(shape is not None for shape in (self.size_m, self.kind, self.file))
        if shape_count != 1:
            raise SettingError(
                "should be a box with size_m and material, or a kind of furniture, or the file of a model"
            )


LIGHTINGS = ("day", "evening", "night", "overcast")
MOST_SEED = 2**31 - 1
Seed = Annotated[int, Ge(0), Le(MOST_SEED)]


@settings()
class GeneratedSpec:
    """Which place a generator creates: its seed, and the lighting, one of LIGHTINGS."""

    seed: Seed
    lighting: Annotated[str, OneOf("lighting", LIGHTINGS)]


@settings()
class SceneFile:
    """A scene, and the luminance of diffuse white for which cameras are exposed.

    Without `white_cd_m2`, white follows from the light that cameras on the free path see.

    It contains a room, boxes, boards, furniture, models, and what the Python file `maker` creates. Paths are relative
    to the scene's file. `seed` determines the random details of furniture and makers. `scale` multiplies all lengths.

    `floor` replaces the material of the level floor, and `paint` covers all bodies.

    The Python file `generator` creates places for suites that name this scene with a seed. `generated` is such a place;
    it contains nothing else that the file describes.
    """

    name: Name
    summary: str = ""
    white_cd_m2: Positive | None = None
    materials: dict[Name, MaterialSpec] = field(default_factory=dict)
    room: RoomSpec | None = None
    boxes: tuple[BoxSpec, ...] = ()
    boards: tuple[BoardSpec, ...] = ()
    furniture: tuple[FurnitureSpec, ...] = ()
    meshes: tuple[ModelSpec, ...] = ()
    maker: str | None = None
    generator: str | None = None
    generated: GeneratedSpec | None = None
    seed: Annotated[int, Ge(0)] = 0
    scale: Annotated[float, Ge(0.05), Le(20)] = 1.0
    lamps: tuple[LampSpec, ...] = ()
    sun: SunSpec | None = None
    sky: SkySpec | None = None
    fog: Fog | None = None
    rain: Rain | None = None
    wind: Wind | None = None
    floor: MaterialSpec | None = None
    paint: Paint | None = None
    movers: tuple[MoverSpec, ...] = ()

    def __post_init__(self) -> None:
        has_objects = any((self.boxes, self.boards, self.furniture, self.meshes))
        if self.generated and not self.generator:
            raise SettingError("requires a generator, and the scene has none", "generated")
        if not (self.room or self.maker or self.generator or has_objects):
            raise SettingError(
                "a scene needs something visible: room, boxes, boards, furniture, meshes, a maker or a generator"
            )

    @property
    def place_name(self) -> str:
        """The name of the scene, with the seed and the lighting of a place of its generator."""
        if self.generated is None:
            return self.name
        return f"{self.name}.{self.generated.seed}.{self.generated.lighting}"

    @property
    def is_described(self) -> bool:
        """Whether the file describes a place without a seed, rather than only where its generator is."""
        has_objects = any((self.boxes, self.boards, self.furniture, self.meshes))
        return bool(self.room or self.maker or has_objects)
