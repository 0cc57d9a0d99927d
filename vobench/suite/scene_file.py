"""What a scene's YAML may say, and the scene it describes."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from vobench.catalog import yaml_file
from vobench.catalog.catalog import unknown
from vobench.catalog.yaml_file import Keys
from vobench.errors import SuiteError
from vobench.scene.scene import AreaLight, Scene, box, ceiling_light, room
from vobench.scene.texture import Texture
from vobench.suite.model import LampOverride, Name, Positive, Strict

Triple = tuple[float, float, float]
Size = tuple[Positive, Positive, Positive]
# The light of a larger room would take more memory than machines have, and the renderer sees 60 m far.
RoomSide = Annotated[float, Field(gt=0, le=30)]


class MaterialSpec(Strict):
    """A diffuse material with a procedural texture."""

    pattern: Literal["plain", "terrazzo", "plaster", "wood", "poster", "checker"]
    albedo: Annotated[float, Field(gt=0, lt=1)]
    contrast: Annotated[float, Field(ge=0, le=1)] = 0.0
    tile_m: Positive = 1.0
    resolution_px: Annotated[int, Field(ge=8, le=8192)] = 1024
    seed: Annotated[int, Field(ge=0)] = 0


class RoomSpec(Strict):
    """Four walls, a floor at z = 0 and a ceiling, around the origin."""

    size_m: tuple[RoomSide, RoomSide, RoomSide]
    floor: str
    wall: str
    ceiling: str


class BoxSpec(Strict):
    """A piece of furniture."""

    center_m: Triple
    size_m: Size
    yaw_deg: float = 0.0
    material: str


class LampSpec(Strict):
    """A level panel that shines down from a rectangle of size_m."""

    name: Name
    center_m: Triple
    size_m: tuple[Positive, Positive]
    power_lm: Annotated[float, Field(ge=0)]


class SceneFile(Strict):
    """A scene: a room, boxes in it, lamps, and the luminance of matt white that cameras are exposed for."""

    name: Name
    summary: str = ""
    white_cd_m2: Positive
    materials: dict[Name, MaterialSpec]
    room: RoomSpec
    boxes: tuple[BoxSpec, ...] = ()
    lamps: Annotated[tuple[LampSpec, ...], Field(min_length=1)]


def read_scene(path: Path) -> SceneFile:
    """The scene in a file. Raises SuiteError, one line with its place, where it is wrong or names no material."""
    spec, source = yaml_file.read_marked(path, SceneFile)
    used: list[tuple[Keys, str]] = [(("room", part), getattr(spec.room, part)) for part in ("floor", "wall", "ceiling")]
    used += [(("boxes", index, "material"), b.material) for index, b in enumerate(spec.boxes)]
    for keys, name in used:
        with source.at(*keys):
            if name not in spec.materials:
                raise SuiteError(unknown("material", name, list(spec.materials)))
    return spec


def build(spec: SceneFile, lighting: dict[str, LampOverride]) -> Scene:
    """The scene under a lighting. Raises SuiteError where the lighting names a lamp that is not there."""
    lamps = [lamp.name for lamp in spec.lamps]
    for name in lighting:
        if name not in lamps:
            raise SuiteError(f"lighting: {unknown('lamp', name, lamps)}")
    surfaces = room(spec.room.size_m, floor=spec.room.floor, wall=spec.room.wall, ceiling=spec.room.ceiling)
    for b in spec.boxes:
        surfaces += box(np.asarray(b.center_m), b.size_m, yaw_deg=b.yaw_deg, material=b.material)
    textures = {name: _texture(material) for name, material in spec.materials.items()}
    return Scene(spec.name, tuple(surfaces), textures, tuple(_lamp(lamp, lighting) for lamp in spec.lamps))


def _texture(m: MaterialSpec) -> Texture:
    return Texture(m.pattern, m.albedo, m.contrast, m.tile_m, m.resolution_px, m.seed)


def _lamp(lamp: LampSpec, lighting: dict[str, LampOverride]) -> AreaLight:
    power_lm = lighting[lamp.name].power_lm if lamp.name in lighting else lamp.power_lm
    return ceiling_light(lamp.name, np.asarray(lamp.center_m), lamp.size_m, power_lm=power_lm)
