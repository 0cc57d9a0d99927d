"""Ambient light for pyrender, which has no bounces: what surfaces get on average of all that it does not draw."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.rendering.geometry import RayCaster
from vobench.scene.light import AreaLight, Light, Sky, Sun
from vobench.scene.material import Material, reflectance
from vobench.scene.mesh import areas_m2, corners, unit
from vobench.scene.scene import Scene, triangles

POINTS = 1024
SKY_RAYS = 16  # from each point
OFF_M = 1e-3  # off a surface, so that a ray does not meet it
FAR_M = 1e4
MOST_REFLECTED = 0.9  # of the light that surfaces share out between them


@dataclass(frozen=True, slots=True)
class MeanLight:
    """The mean illuminance (L, 3) in lux of each light at level 1 that counts as ambient, by colour."""

    illuminance_lx: Array

    def radiance(self, levels: Sequence[float]) -> Array:
        """What a white surface shows (3,) in cd/m² by ambient light alone, at levels (L,)."""
        return np.asarray(np.asarray(levels) @ self.illuminance_lx / np.pi)


@dataclass(frozen=True, slots=True)
class SurfacePoints:
    """Points (N, 3) spread evenly over the surfaces of a scene at time 0, and their unit normals (N, 3)."""

    points_m: Array
    normals: Array
    mean_reflectance: float
    caster: RayCaster

    def reached(self, way: Array) -> NDArray[np.bool_]:
        """Whether nothing lies between each point and the point plus its vector (N, 3)."""
        return ~self.caster.stops(self.points_m + OFF_M * self.normals, way)


def mean_light(scene: Scene, *, drawn: Collection[int]) -> MeanLight:
    """The mean over all surfaces of the light that bounces, of the sky, and of lights that are not `drawn`.

    Bounces are those of an integrating sphere with the scene's mean reflectance and as open as the scene is:
    E rho c / (1 - rho c), where c is the share of directions in which surfaces see one another.
    """
    surfaces = _surfaces(scene)
    if surfaces is None:
        return MeanLight(np.zeros((len(scene.lights), 3)))
    directions = _hemispheres(surfaces.normals)
    escaped = [surfaces.reached(FAR_M * direction) for direction in directions]
    closed = 1 - float(np.mean(escaped))
    returned = min(surfaces.mean_reflectance * closed, MOST_REFLECTED)
    bounced = returned / (1 - returned)

    rows = []
    for index, light in enumerate(scene.lights):
        if isinstance(light, Sky):
            seen = [
                np.where(free, light.luminance_cd_m2(way), 0) for free, way in zip(escaped, directions, strict=True)
            ]
            direct_lx = np.pi * float(np.mean(seen))
        else:
            direct_lx = _mean_direct_lx(light, surfaces)
        share = bounced if index in drawn else 1 + bounced
        rows.append(share * direct_lx * np.array(light.colour, float))
    return MeanLight(np.array(rows).reshape(-1, 3))


def _surfaces(scene: Scene) -> SurfacePoints | None:
    """Points on all that is opaque and no lamp; None where a scene has no such face."""
    faces = triangles(scene, t_ns=0)
    materials = [scene.materials.get(thing.material) for thing in faces.things]
    is_solid = np.array([material is not None and material.kind != "pane" for material in materials], bool)
    solid = np.flatnonzero(is_solid[faces.thing] & (faces.lamp < 0))
    areas = areas_m2(faces.corners_m[solid])
    if not areas.sum() > 0:
        return None
    rng = np.random.default_rng(0)
    picked = solid[rng.choice(len(solid), POINTS, p=areas / areas.sum())]
    weights = rng.dirichlet(np.ones(3), POINTS)
    points_m = np.einsum("nc,ncd->nd", weights, faces.corners_m[picked])
    reflected = np.array([_mean_reflectance(material) for material in materials])
    caster = RayCaster(faces, solid)
    return SurfacePoints(points_m, faces.plane[picked], float(reflected[faces.thing[picked]].mean()), caster)


def _mean_reflectance(material: Material | None) -> float:
    """Luminous reflectance of a body or mirror; 0 of what is neither."""
    if material is None or material.kind == "pane":
        return 0.0
    return material.tint if material.kind == "mirror" else float(reflectance(material).mean())


def _hemispheres(normals: Array) -> list[Array]:
    """SKY_RAYS directions (N, 3) each around normals (N, 3), as dense as their cosine (Malley's method)."""
    rng = np.random.default_rng(1)
    return [unit(normals + unit(rng.standard_normal(normals.shape))) for _ in range(SKY_RAYS)]


def _mean_direct_lx(light: Light, surfaces: SurfacePoints) -> float:
    """Mean illuminance by a sun, or by a lamp as if all of it shone from its middle."""
    if isinstance(light, Sun):
        towards = np.broadcast_to(light.direction(0), surfaces.normals.shape)
        arriving = light.illuminance_lx * np.maximum(np.einsum("nd,nd->n", surfaces.normals, towards), 0)
        return float(np.mean(arriving * surfaces.reached(FAR_M * towards)))
    if isinstance(light, Sky):
        raise ValueError("the sky is around, it has no middle")
    if isinstance(light, AreaLight):
        corners_m = corners(light.mesh)
        areas = areas_m2(corners_m)
        middle_m = areas @ corners_m.mean(1) / areas.sum()
        nearest_m = float(np.sqrt(areas.sum()))
    else:
        middle_m = light.position_m
        nearest_m = 0.1
    way = middle_m - surfaces.points_m
    distance_m = np.linalg.norm(way, axis=1)
    towards = unit(way)
    cosine = np.maximum(np.einsum("nd,nd->n", surfaces.normals, towards), 0)
    intensity_cd = _intensity_cd(light, -towards)
    arriving = intensity_cd * cosine / np.maximum(distance_m, nearest_m) ** 2
    return float(np.mean(arriving * surfaces.reached(way)))


def _intensity_cd(light: Light, directions: Array) -> Array:
    """Luminous intensity (N,) of a lamp towards unit directions (N, 3)."""
    if isinstance(light, AreaLight):
        corners_m = corners(light.mesh)
        edges = corners_m[:, 1:] - corners_m[:, :1]
        facing_m2 = np.cross(edges[:, 0], edges[:, 1]) / 2  # (F, 3): normals as long as faces are large
        return np.asarray(light.luminance_cd_m2 * np.maximum(directions @ facing_m2.T, 0).sum(1))
    if isinstance(light, Sun | Sky):
        raise ValueError("sun and sky have no intensity")
    return light.intensity_cd(directions)
