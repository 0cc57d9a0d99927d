"""A baked scene as what OpenGL draws: rectangles in batches, one for each material, mover and mirroring plane."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyrender

from vobench.geometry.se3 import Array
from vobench.render.bake import BakedScene
from vobench.render.geometry import corners, inventory
from vobench.render.mirror import Plane
from vobench.render.texture import FloatTexture, ReflectanceTexture
from vobench.scene.material import Glass, Material, Mirror, Polished, texture_of
from vobench.scene.surface import Surface


@dataclass(frozen=True, slots=True)
class Batch:
    """Rectangles drawn in one call: all of one material and mover (-1 for none), in the mover's frame.

    Those that mirror lie in one plane; panels have no material. quads_m (K, 4, 3) are the corners.
    """

    index: int
    primitive: Any
    material: Material | None
    mover: int
    plane: Plane | None
    quads_m: Array
    body_scale: float


@dataclass(frozen=True, slots=True)
class Stock:
    """What batches are made from: the baked scene, its textures on the graphics side, and how often each is drawn."""

    baked: BakedScene
    light: FloatTexture
    tiles: dict[str, ReflectanceTexture]
    blank: ReflectanceTexture
    copies: int


@dataclass(frozen=True, slots=True)
class Part:
    """One rectangle on its way into a batch: its place in the inventory, in its mover's frame."""

    index: int
    surface: Surface
    mover: int
    material: Material | None

    @property
    def plane(self) -> Plane | None:
        """The plane it mirrors at, None where it does not."""
        if not isinstance(self.material, Polished | Mirror | Glass):
            return None
        normal = self.surface.normal
        return Plane(normal, -float(normal @ self.surface.corner_m))

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for parts of one batch."""
        name = None if self.material is None else self.surface.material
        return self.mover, name, self.plane.key if self.plane else None


def batches(baked: BakedScene, light: FloatTexture, *, copies: int) -> list[Batch]:
    """All rectangles of a scene, each drawn `copies` times (once a sample), in an order that never changes."""
    groups: dict[tuple[object, ...], list[Part]] = {}
    for part in _parts(baked):
        groups.setdefault(part.key, []).append(part)
    tiles = {name: ReflectanceTexture(tile) for name, tile in baked.albedo.items()}
    stock = Stock(baked, light, tiles, ReflectanceTexture(np.ones((2, 2), np.float32)), copies)
    return [_batch(stock, index, parts) for index, parts in enumerate(groups.values())]


def _parts(baked: BakedScene) -> Iterator[Part]:
    scene = baked.scene
    own = [surface for mover in scene.movers for surface in mover.surfaces]
    things = inventory(scene)
    first = len(things.surfaces) - len(own)  # movers come last in the inventory
    for index, there in enumerate(things.surfaces):
        surface = there if index < first else own[index - first]
        material = None if things.panel[index] >= 0 else scene.materials[surface.material]
        yield Part(index, surface, int(things.mover[index]), material)


def _batch(stock: Stock, index: int, parts: list[Part]) -> Batch:
    material, layout = parts[0].material, stock.baked.layout
    texture = texture_of(material) if material is not None else None
    tile = stock.blank if texture is None else stock.tiles[parts[0].surface.material]
    quads = np.stack([corners(part.surface) for part in parts])
    primitive = pyrender.Primitive(
        positions=quads.reshape(-1, 3),
        texcoord_0=np.concatenate([_on_texture(part.surface) for part in parts]) / (texture.tile_m if texture else 1),
        texcoord_1=np.concatenate([layout.texture_coordinates(part.index) for part in parts]),
        indices=(np.arange(len(parts))[:, None] * 4 + [0, 1, 2, 0, 2, 3]).reshape(-1, 3),
        material=pyrender.MetallicRoughnessMaterial(baseColorTexture=tile, emissiveTexture=stock.light),
        mode=4,
        poses=np.tile(np.eye(4), (stock.copies, 1, 1)),
    )
    return Batch(index, primitive, material, parts[0].mover, parts[0].plane, quads, tile.scale / np.pi)


def _on_texture(surface: Surface) -> Array:
    """Places (4, 2) in metres on the texture of the corners."""
    return surface.on_texture_m(np.array([0.0, 1, 1, 0]), np.array([0.0, 0, 1, 1]))
