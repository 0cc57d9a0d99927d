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
from vobench.render.geometry import RAY_OFFSET_M, Hits, RayCaster, all_surfaces
from vobench.render.lightmap import Layout, layout
from vobench.scene.scene import AreaLight, Scene, Surface
from vobench.scene.texture import Map, reflectance


@dataclass(frozen=True, slots=True)
class BakeSettings:
    """How finely light is sampled; rays per sample are squares so that they can be stratified."""

    spacing_m: float = 0.03
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


@dataclass(frozen=True, slots=True)
class Samples:
    """Where light is computed: points and normals (P, 3), and their flat indices (P,) in the map."""

    points_m: Array
    normals: Array
    indices: NDArray[np.int64]

    def on_map(self, values: Array, where: Layout) -> Array:
        """Values (P,) laid out as the map (H, W); 0 where no surface is."""
        flat = np.zeros(where.height * where.width)
        flat[self.indices] = values
        return flat.reshape(where.height, where.width)


def bake(scene: Scene, settings: BakeSettings) -> BakedScene:
    """Make the textures and compute the light of a scene; the same bytes for the same arguments."""
    albedo = {name: reflectance(texture) for name, texture in sorted(scene.textures.items())}
    caster, surfaces = RayCaster(scene), all_surfaces(scene)
    fine = layout(surfaces, spacing_m=settings.spacing_m)
    coarse = layout(surfaces, spacing_m=settings.indirect_spacing_m)
    light = _direct(scene, caster, fine, settings)
    # Lamps' panels come last in the list of surfaces, and reflect nothing.
    reflect = np.array([albedo[s.material].mean() for s in scene.surfaces] + [0.0] * len(scene.lights))
    bounced = _indirect(scene, caster, coarse, reflect, settings)
    for index in range(len(surfaces)):
        light[fine.patches[index].window] += _resampled(bounced, coarse, fine, index)
    for lamp, patch in zip(scene.lights, fine.patches[len(scene.surfaces) :], strict=True):
        # A lamp's panel is drawn with albedo 1, so that this illuminance shows as its luminance.
        light[patch.window] = np.pi * lamp.luminance_cd_m2
    return BakedScene(scene, fine, light.astype(np.float32), albedo)


def _samples(surfaces: list[Surface], where: Layout) -> Samples:
    points, normals, indices = [], [], []
    for surface, patch in zip(surfaces, where.patches, strict=True):
        # Samples on an edge touch the neighbour; a hair inwards they see past it.
        u, v = (np.clip(fraction, 1e-3, 1 - 1e-3) for fraction in patch.fractions())
        points.append((surface.at(u, v) + RAY_OFFSET_M * surface.normal).reshape(-1, 3))
        normals.append(np.broadcast_to(surface.normal, points[-1].shape))
        indices.append(np.arange(where.height * where.width).reshape(where.height, -1)[patch.window].ravel())
    return Samples(np.concatenate(points), np.concatenate(normals), np.concatenate(indices))


def _direct(scene: Scene, caster: RayCaster, where: Layout, settings: BakeSettings) -> Array:
    """Illuminance (H, W) in lux straight from the lamps."""
    samples = _samples(all_surfaces(scene), where)
    rng = np.random.default_rng([settings.seed, 1])
    lamps = (_from_lamp(lamp, caster, samples, where, rays=settings.light_rays, rng=rng) for lamp in scene.lights)
    return samples.on_map(sum(lamps, start=np.zeros(len(samples.points_m))), where)


def _from_lamp(
    lamp: AreaLight, caster: RayCaster, samples: Samples, where: Layout, *, rays: int, rng: np.random.Generator
) -> Array:
    """Illuminance (P,) of points, with four times the rays in and around the lamp's half shadows."""
    points, normals, side = samples.points_m, samples.normals, round(np.sqrt(rays))
    light, blocked = _panel_light(lamp.surface, caster, points, normals, side=side, rng=rng)
    half_shadow = samples.on_map(((light > 0) & blocked).astype(float), where) > 0
    # Few rays can miss the rim of a lamp, so points beside a half shadow may lie in it too.
    grainy = np.flatnonzero(ndimage.binary_dilation(half_shadow, iterations=3).ravel()[samples.indices] & blocked)
    light[grainy] = _panel_light(lamp.surface, caster, points[grainy], normals[grainy], side=2 * side, rng=rng)[0]
    return light * lamp.luminance_cd_m2


def _panel_light(
    panel: Surface, caster: RayCaster, points_m: Array, normals: Array, *, side: int, rng: np.random.Generator
) -> tuple[Array, NDArray[np.bool_]]:
    """Illuminance (P,) by a panel of luminance 1, and whether anything is in the way; side² jittered rays a point."""
    total, hidden = np.zeros(len(points_m)), np.zeros(len(points_m), bool)
    for cell in range(side * side):
        jitter = rng.random((2, len(total)))
        target = panel.at((cell % side + jitter[0]) / side, (cell // side + jitter[1]) / side)
        way = target - points_m
        squared = np.einsum("ij,ij->i", way, way)
        arriving, leaving = np.einsum("ij,ij->i", way, normals), -(way @ panel.normal)
        faced = np.flatnonzero((arriving > 0) & (leaving > 0))
        blocked = caster.occluded(points_m[faced], target[faced] + RAY_OFFSET_M * panel.normal)
        lit = faced[~blocked]
        total[lit] += arriving[lit] * leaving[lit] / squared[lit] ** 2
        hidden[faced[blocked]] = True
    return total * np.prod(panel.size_m) / (side * side), hidden


def _indirect(scene: Scene, caster: RayCaster, where: Layout, reflect: Array, settings: BakeSettings) -> Array:
    """Illuminance (H, W) in lux that arrives after one bounce or more."""
    samples = _samples(all_surfaces(scene), where)
    direct = _direct(scene, caster, where, settings)
    seen, factor = _gather_table(caster, samples, where, reflect, settings)
    gathered = np.zeros(direct.shape)
    for _ in range(settings.bounces):
        # Cosine-weighted rays: illuminance is the mean of albedo × illuminance where they end.
        gathered = samples.on_map(((direct + gathered).ravel()[seen] * factor).mean(0), where)
    return gathered


def _gather_table(
    caster: RayCaster, samples: Samples, where: Layout, reflect: Array, settings: BakeSettings
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """For every ray and point (rays, P): the map sample it ends on, and that surface's albedo."""
    side = round(np.sqrt(settings.indirect_rays))
    rotation = np.random.default_rng([settings.seed, 2]).random((2, len(samples.points_m)))
    u_axis, v_axis = _tangents(samples.normals)
    seen = np.zeros((side * side, len(samples.points_m)), np.int32)
    factor = np.zeros(seen.shape, np.float32)
    for cell in range(side * side):
        a, b = (cell % side + rotation[0]) / side, (cell // side + rotation[1]) / side
        radius, angle = np.sqrt(a), 2 * np.pi * b
        disc = (radius * np.cos(angle))[:, None] * u_axis + (radius * np.sin(angle))[:, None] * v_axis
        hits = caster.hits(samples.points_m, disc + np.sqrt(1 - a)[:, None] * samples.normals)
        seen[cell] = _sample_at(where, hits)
        factor[cell] = np.where(hits.surface < 0, 0, reflect[hits.surface])
    return seen, factor


def _sample_at(where: Layout, hits: Hits) -> NDArray[np.int32]:
    """Flat index (R,) in the map of the sample nearest to where each ray ended; 0 where it did not."""
    row, column, rows, columns = np.array([(p.row, p.column, p.rows, p.columns) for p in where.patches]).T
    r = row[hits.surface] + np.rint(hits.v * (rows[hits.surface] - 1)).astype(np.int32)
    c = column[hits.surface] + np.rint(hits.u * (columns[hits.surface] - 1)).astype(np.int32)
    return np.where(hits.surface < 0, 0, r * where.width + c).astype(np.int32)


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
