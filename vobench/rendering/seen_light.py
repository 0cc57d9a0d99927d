"""The luminance along rays in a baked scene, for each light separately, without rendering a picture."""

import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vobench.errors import RenderError
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Mask, Rows
from vobench.rendering.baked_scene import BakedScene
from vobench.rendering.cutout import CutOuts
from vobench.rendering.embree import Hits
from vobench.rendering.face_response import metal_reflectance
from vobench.rendering.geometry import RayCaster, face_materials, take
from vobench.scene.light import AreaLight, Light, Sky
from vobench.scene.material import LUMINANCE, Material, fresnel, linear, pane_reflectance, under_coat
from vobench.trajectory.nanoseconds import NS_PER_S

MOST_SURFACES = 12  # the largest number of surfaces along a ray, including holes and backs of faces
FAINTEST = 1e-3  # the share of a pixel below which a ray ends
STEP_M = 1e-4  # the distance from a surface at which a ray continues
LEVELS_NS = NS_PER_S  # the level of a light is its mean over the first second
FILE = "seen_light.npz"


@dataclass(frozen=True, slots=True)
class SeenLight:
    """The luminance along N rays.

    `luminance_cd_m2` (L, N) is the luminance due to each light alone, at level 1.
    `is_source` (N,) is whether a ray ends at a lamp or in the sky.
    `names` and `levels` (L,) are the names of the lights and their mean levels.
    """

    luminance_cd_m2: Floats
    is_source: Mask
    names: tuple[str, ...]
    levels: tuple[float, ...]

    def luminance(self, lights: Iterable[Light] = ()) -> Array:
        """The luminance (N,) in cd/m² due to all lights. Lights that are not given have their stored levels."""
        level_by_name = {light.name: light.level.mean(0, LEVELS_NS) for light in lights}
        total = np.zeros(self.luminance_cd_m2.shape[1])
        for name, level, by_light in zip(self.names, self.levels, self.luminance_cd_m2, strict=True):
            total += level_by_name.get(name, level) * by_light
        return total

    def save(self, folder: Path) -> None:
        """Write the luminance to the folder of the scene's baked light."""
        np.savez(
            folder / FILE,
            luminance_cd_m2=self.luminance_cd_m2,
            is_source=self.is_source,
            names=np.array(self.names, str),
            levels=np.array(self.levels, float),
        )


def read_seen_light(folder: Path) -> SeenLight:
    """Read the file that `SeenLight.save` wrote. Raises RenderError if it cannot be read."""
    try:
        with (folder / FILE).open("rb") as file, np.load(file) as stored:
            names = tuple(stored["names"].tolist())
            levels = tuple(stored["levels"].tolist())
            return SeenLight(stored["luminance_cd_m2"], stored["is_source"], names, levels)
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise RenderError(f"the scene's light cannot be read ({error}); delete this folder: {folder}") from error


def seen_light(baked: BakedScene, origins_m: Array, directions: Array) -> SeenLight:
    """The luminance along rays (N, 3) with unit directions, without movers and without the glints of small lamps.

    A coat or a metal adds the light that its body scatters, and reflects the ray like a smooth mirror. As in pictures,
    the backs of faces are invisible.
    """
    surfaces = _Surfaces(baked)
    count = len(origins_m)
    luminance = np.zeros((len(baked.scene.lights), count))
    is_source = np.zeros(count, bool)
    rays = _Rays(np.arange(count), origins_m, directions, np.ones(count))
    for _ in range(MOST_SURFACES):
        hits = surfaces.hits(rays)
        for index, light in enumerate(baked.scene.lights):
            luminance[index, rays.pixel] += rays.share * surfaces.emitted_cd_m2(index, light, rays, hits)
        scattered = surfaces.scattered(rays, hits)
        bodies = np.flatnonzero(scattered)
        illuminance_lx = surfaces.illuminance_lx(hits.take(bodies))
        body_share = rays.share[bodies] * scattered[bodies]
        luminance[:, rays.pixel[bodies]] += body_share * illuminance_lx / np.pi
        has_full_share = rays.share > 1 / 2
        is_source[rays.pixel[surfaces.are_sources(hits) & has_full_share]] = True
        rays = surfaces.followed(rays, hits)
        if not len(rays.pixel):
            break
    names = tuple(light.name for light in baked.scene.lights)
    levels = tuple(light.level.mean(0, LEVELS_NS) for light in baked.scene.lights)
    return SeenLight(luminance.astype(np.float32), is_source, names, levels)


@dataclass(frozen=True, slots=True)
class _Rays:
    """Rays (R, 3) with unit directions. `share` (R,) is the contribution of each ray to its `pixel` (R,)."""

    pixel: Rows
    origins_m: Array
    directions: Array
    share: Array

    take = take


class _Surfaces:
    """The stationary faces of a baked scene, and the light that they emit and reflect."""

    def __init__(self, baked: BakedScene) -> None:
        faces = baked.faces
        self._baked = baked
        self._faces = faces
        self._caster = RayCaster(faces, np.flatnonzero(faces.mover < 0))
        self._cutouts = CutOuts(faces, baked.scene.materials)
        materials = [*face_materials(faces, baked.scene.materials), None]  # None is for rays without a hit
        thing = np.append(faces.thing, len(materials) - 1)
        self._materials = materials
        self._thing = thing
        self._lamp = np.append(faces.lamp, -1)
        self._kind = np.array([material.kind if material else "" for material in materials])[thing]
        self._eta = np.array([material.eta if material else 1.0 for material in materials])[thing]
        self._tint = np.array([material.tint if material else 0.0 for material in materials])[thing]
        self._metal = np.array([metal_reflectance(material) for material in materials])[thing]

    def hits(self, rays: _Rays) -> Hits:
        """The nearest face along each ray."""
        return self._caster.hits(rays.origins_m, rays.directions)

    def are_sources(self, hits: Hits) -> Mask:
        """Which hits (R,) are of a lamp or of the sky."""
        return np.asarray((hits.face < 0) | (self._lamp[hits.face] >= 0))

    def emitted_cd_m2(self, index: int, light: Light, rays: _Rays, hits: Hits) -> Array:
        """The luminance (R,) of the lamp or the sky that rays meet, for one light at level 1."""
        result = np.zeros(len(hits.face))
        if isinstance(light, Sky):
            is_miss = hits.face < 0
            result[is_miss] = light.luminance_cd_m2(rays.directions[is_miss])
        if isinstance(light, AreaLight):
            is_this_lamp = self._is_front(rays, hits) & (self._lamp[hits.face] == index)
            result[is_this_lamp] = light.luminance_cd_m2
        return result

    def _is_front(self, rays: _Rays, hits: Hits) -> Mask:
        """Which rays (R,) meet the front of a face."""
        cosine = np.einsum("ij,ij->i", self._faces.plane[hits.face], rays.directions)
        return np.asarray((hits.face >= 0) & (cosine < 0))

    def scattered(self, rays: _Rays, hits: Hits) -> Array:
        """The luminous reflectance (R,) of the body that each ray hits, below its coat; 0 if it hits no body."""
        result = np.zeros(len(hits.face))
        is_body = self._is_front(rays, hits) & (self._kind[hits.face] == "body") & ~self._cutouts.are_in_holes(hits)
        rows = np.flatnonzero(is_body)
        leaving = 1 - self._coat(rays, hits)[rows]
        result[rows] = leaving * self._reflectance(hits.take(rows))
        return result

    def illuminance_lx(self, hits: Hits) -> Array:
        """The illuminance (L, R) of the nearest texel, due to each light alone at level 1."""
        baked = self._baked
        texel = baked.atlas.index(hits.at(baked.atlas.light_px))
        spread = baked.spread[texel]
        by_light = list[Array]()
        for light, direct, bounced in zip(baked.scene.lights, baked.direct, baked.bounced, strict=True):
            bounced_lx = bounced @ (np.array(light.colour) * LUMINANCE)  # (S,)
            by_light.append(direct.reshape(-1)[texel] + spread @ bounced_lx)
        return np.array(by_light).reshape(len(baked.scene.lights), len(texel))

    def _reflectance(self, hits: Hits) -> Array:
        """The luminous reflectance (R,) of bodies for light that has entered through their coats."""
        result = np.zeros(len(hits.face))
        thing = self._thing[hits.face]
        for number in np.unique(thing).tolist():
            material = self._materials[number]
            if material is None:
                continue
            rows = np.flatnonzero(thing == number)
            uv = hits.take(rows).at(self._faces.uv)
            albedo = (1 - material.metal) * _reflectance_at(material, uv / material.tile_m)
            result[rows] = under_coat(albedo, material.eta) if material.is_coated else albedo
        return result

    def _coat(self, rays: _Rays, hits: Hits) -> Array:
        """The specular reflectance (R,) of coats; 0 without a coat."""
        cosine = np.einsum("ij,ij->i", self._faces.plane[hits.face], rays.directions)
        has_coat = (self._kind[hits.face] == "body") & (self._eta[hits.face] > 1)
        return np.where(has_coat, fresnel(cosine, np.maximum(self._eta[hits.face], 1.0)), 0.0)

    def followed(self, rays: _Rays, hits: Hits) -> _Rays:
        """The rays that pass panes, holes and backs of faces, or that mirrors, coats and metals reflect."""
        face = hits.face
        planes = self._faces.plane[face]
        cosine = np.einsum("ij,ij->i", planes, rays.directions)
        is_front = self._is_front(rays, hits)
        is_pane = (self._kind[face] == "pane") & (face >= 0)
        is_absent = (face >= 0) & ~is_pane & (~is_front | self._cutouts.are_in_holes(hits))
        is_mirroring = is_front & ~is_pane & ~is_absent & (self._lamp[face] < 0)

        share = np.zeros(len(face))
        share[is_absent] = 1.0
        passed = self._tint[face] * (1 - pane_reflectance(cosine, np.maximum(self._eta[face], 1.0)))
        share[is_pane] = passed[is_pane]
        coat = self._coat(rays, hits)
        mirrored = self._tint[face] * coat + (1 - coat) * self._metal[face]
        share[is_mirroring] = mirrored[is_mirroring]

        reflected = rays.directions - 2 * cosine[:, None] * planes
        directions = np.where(is_mirroring[:, None], reflected, rays.directions)
        distance_m = np.nan_to_num(hits.distance)[:, None]
        places_m = rays.origins_m + distance_m * rays.directions
        following = _Rays(rays.pixel, places_m + STEP_M * directions, directions, rays.share * share)
        return following.take(np.flatnonzero(following.share > FAINTEST))


def _reflectance_at(material: Material, places: Array) -> Array:
    """The luminous reflectance (R,) of a material at texture coordinates `places` (R, 2), in tiles.

    It is the value of the nearest pixel of the texture times the colour.
    """
    colour = np.array(material.colour) * LUMINANCE
    if material.texture is None:
        return np.full(len(places), colour.sum())
    pixels = material.texture.pixels()
    height, width = pixels.shape[:2]
    column = np.floor(places[:, 0] * width).astype(np.int64) % width
    row = np.floor(places[:, 1] * height).astype(np.int64) % height
    nearest = pixels[row, column]
    if pixels.ndim == 2:
        return np.asarray(nearest * colour.sum(), float)
    return np.asarray(linear(nearest[:, :3]) @ colour, float)
