"""Light computed once: illuminance of every surface, soft shadows and bounces included.

Direct light is sampled on the lamps' area; indirect light is gathered by cosine-weighted rays on
a coarser grid and iterated over bounces (radiosity with Monte Carlo form factors: Cohen and
Wallace, Radiosity and Realistic Image Synthesis, 1993). All surfaces reflect diffusely.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vobench.geometry.se3 import Array
from vobench.render.geometry import RAY_OFFSET_M, RayCaster, all_surfaces
from vobench.render.lightmap import Layout, layout
from vobench.scene.scene import AreaLight, Scene, Surface
from vobench.scene.texture import Map, reflectance


@dataclass(frozen=True, slots=True)
class BakeSettings:
    """How finely light is sampled; rays per sample are squares so that they can be stratified."""

    spacing_m: float = 0.025
    light_rays: int = 16
    indirect_spacing_m: float = 0.1
    indirect_rays: int = 256
    bounces: int = 3
    seed: int = 0


@dataclass(frozen=True, slots=True)
class BakedScene:
    """A scene with its light: all that drawing a picture needs.

    `illuminance` (H, W) in lux is laid out by `layout` over `all_surfaces(scene)`;
    `albedo` holds each material's tile of reflectance.
    """

    scene: Scene
    layout: Layout
    illuminance: NDArray[np.float32]
    albedo: dict[str, Map]


def bake(scene: Scene, settings: BakeSettings) -> BakedScene:
    """Make the textures and compute the light of a scene; the same bytes for the same arguments."""
    albedo = {name: reflectance(texture) for name, texture in sorted(scene.textures.items())}
    caster, surfaces = RayCaster(scene), all_surfaces(scene)
    fine = layout(surfaces, spacing_m=settings.spacing_m)
    coarse = layout(surfaces, spacing_m=settings.indirect_spacing_m)
    light = _direct(scene, caster, fine, settings)
    first = _direct(scene, caster, coarse, settings)
    bounced = _indirect(scene, caster, coarse, first, {k: float(a.mean()) for k, a in albedo.items()}, settings)
    for index in range(len(surfaces)):
        light[fine.patches[index].window] += _resampled(bounced, coarse, fine, index)
    for lamp, patch in zip(scene.lights, fine.patches[len(scene.surfaces) :], strict=True):
        # A lamp's panel has albedo 1, so that this illuminance shows as its luminance.
        light[patch.window] = np.pi * lamp.luminance_cd_m2
    return BakedScene(scene, fine, light.astype(np.float32), albedo)


def _points(surfaces: list[Surface], where: Layout) -> tuple[Array, Array, NDArray[np.int64]]:
    """Sample points (P, 3), normals (P, 3) and their flat index (P,) in the map, surface by surface."""
    points, normals, indices = [], [], []
    for surface, patch in zip(surfaces, where.patches, strict=True):
        u, v = patch.fractions()
        # Samples on an edge touch the neighbour; a hair inwards they see past it.
        hair = 1e-3
        points.append(surface.at(*(np.clip(f, hair, 1 - hair) for f in (u, v))).reshape(-1, 3))
        normals.append(np.broadcast_to(surface.normal, points[-1].shape))
        indices.append(np.arange(where.height * where.width).reshape(where.height, -1)[patch.window].ravel())
    return np.concatenate(points), np.concatenate(normals), np.concatenate(indices)


def _direct(scene: Scene, caster: RayCaster, where: Layout, settings: BakeSettings) -> Array:
    """Illuminance (H, W) in lux straight from the lamps."""
    points, normals, indices = _points(all_surfaces(scene), where)
    rng = np.random.default_rng([settings.seed, 1])
    total = np.zeros(len(points))
    for lamp in scene.lights:
        total += _from_lamp(lamp, caster, points + RAY_OFFSET_M * normals, normals, settings.light_rays, rng)
    light = np.zeros(where.height * where.width)
    light[indices] = total
    return light.reshape(where.height, where.width)


def _from_lamp(
    lamp: AreaLight, caster: RayCaster, points: Array, normals: Array, rays: int, rng: np.random.Generator
) -> Array:
    """Illuminance (P,) by stratified samples of the lamp's area, jittered for every point."""
    side = round(np.sqrt(rays))
    area = float(np.prod(lamp.surface.size_m))
    total = np.zeros(len(points))
    for cell in range(side * side):
        jitter = rng.random((2, len(points)))
        target = lamp.surface.at((cell % side + jitter[0]) / side, (cell // side + jitter[1]) / side)
        way = target - points
        squared = np.einsum("ij,ij->i", way, way)
        cosines = np.einsum("ij,ij->i", way, normals) * -(way @ lamp.surface.normal) / squared
        seen = np.flatnonzero((cosines > 0) & (way @ lamp.surface.normal < 0))
        lit = seen[~caster.occluded(points[seen], target[seen] + RAY_OFFSET_M * lamp.surface.normal)]
        total[lit] += cosines[lit] / squared[lit]
    illuminance: Array = total * lamp.luminance_cd_m2 * area / (side * side)
    return illuminance


def _indirect(
    scene: Scene, caster: RayCaster, where: Layout, direct: Array, albedo: dict[str, float], settings: BakeSettings
) -> Array:
    """Illuminance (H, W) in lux that arrives after one bounce or more."""
    points, normals, indices = _points(all_surfaces(scene), where)
    points = points + RAY_OFFSET_M * normals
    # Lamps' panels reflect nothing: they are last in the list and have no albedo.
    reflect = np.array([albedo[s.material] for s in scene.surfaces] + [0.0] * len(scene.lights) + [0.0])
    rng = np.random.default_rng([settings.seed, 2])
    seen, factor = _gather_table(caster, where, points, normals, reflect, settings.indirect_rays, rng)
    gathered = np.zeros(direct.size)
    for _ in range(settings.bounces):
        # Cosine-weighted rays: illuminance is the mean of albedo × illuminance where they end.
        gathered[indices] = ((direct.ravel() + gathered)[seen] * factor).mean(0)
    return gathered.reshape(direct.shape)


def _gather_table(
    caster: RayCaster,
    where: Layout,
    points: Array,
    normals: Array,
    reflect: Array,
    rays: int,
    rng: np.random.Generator,
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """For every ray and point (rays, P): the map sample it ends on, and that surface's albedo."""
    side = round(np.sqrt(rays))
    rotation = rng.random((2, len(points)))
    u_axis, v_axis = _tangents(normals)
    seen = np.zeros((side * side, len(points)), np.int32)
    factor = np.zeros((side * side, len(points)), np.float32)
    for cell in range(side * side):
        a, b = (cell % side + rotation[0]) / side, (cell // side + rotation[1]) / side
        radius, angle = np.sqrt(a), 2 * np.pi * b
        disc = (radius * np.cos(angle))[:, None] * u_axis + (radius * np.sin(angle))[:, None] * v_axis
        hits = caster.hits(points, disc + np.sqrt(1 - a)[:, None] * normals)
        seen[cell] = _sample_at(where, hits.surface, hits.u, hits.v)
        factor[cell] = reflect[hits.surface]
    return seen, factor


def _sample_at(where: Layout, surface: NDArray[np.int32], u: Array, v: Array) -> NDArray[np.int32]:
    """Flat index in the map of the sample nearest to (u, v) on a surface; surface -1 gives 0."""
    row, column, rows, columns = np.array([(p.row, p.column, p.rows, p.columns) for p in where.patches]).T
    r = row[surface] + np.rint(v * (rows[surface] - 1)).astype(np.int32)
    c = column[surface] + np.rint(u * (columns[surface] - 1)).astype(np.int32)
    return np.where(surface < 0, 0, r * where.width + c).astype(np.int32)


def _tangents(normals: Array) -> tuple[Array, Array]:
    """Two unit vectors (P, 3) each, square to the normals and to each other."""
    helper = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    u = np.cross(helper, normals)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(normals, u)


def _resampled(light: Array, coarse: Layout, fine: Layout, index: int) -> Array:
    """One surface's part of a coarse map, smoothed against ray noise, at the fine map's samples."""
    source = ndimage.gaussian_filter(light[coarse.patches[index].window], 0.7, mode="nearest")
    patch = fine.patches[index]
    v = np.linspace(0, source.shape[0] - 1, patch.rows)
    u = np.linspace(0, source.shape[1] - 1, patch.columns)
    resampled: Array = ndimage.map_coordinates(source, np.meshgrid(v, u, indexing="ij"), order=1)
    return resampled
