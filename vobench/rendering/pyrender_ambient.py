"""Ambient light for pyrender, which has no bounces: the mean on all surfaces of the light that it does not draw."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.geometry.vector import unit
from vobench.rendering.geometry import RayCaster
from vobench.scene.light import AreaLight, Light, Sky, Sun
from vobench.scene.material import Material, reflectance
from vobench.scene.mesh import face_corners
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
        """Radiance of a white surface (3,) in cd/m² by ambient light alone, at levels (L,)."""
        total_lx = np.asarray(levels) @ self.illuminance_lx
        return np.asarray(total_lx / np.pi)


@dataclass(frozen=True, slots=True)
class SurfacePoints:
    """Points (N, 3) spread evenly over the surfaces of a scene at time 0, and their unit normals (N, 3)."""

    points_m: Array
    normals: Array
    mean_reflectance: float
    caster: RayCaster

    def reached(self, vectors_m: Array) -> NDArray[np.bool_]:
        """Whether nothing lies between each point and the point plus its vector (N, 3)."""
        origins_m = self.points_m + OFF_M * self.normals
        return ~self.caster.stops(origins_m, vectors_m)


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
            seen_cd_m2 = []
            for is_free, direction in zip(escaped, directions, strict=True):
                seen_cd_m2.append(np.where(is_free, light.luminance_cd_m2(direction), 0))
            direct_lx = np.pi * float(np.mean(seen_cd_m2))
        else:
            direct_lx = _mean_direct_lx(light, surfaces)
        share = bounced if index in drawn else 1 + bounced
        rows.append(share * direct_lx * np.array(light.colour, float))
    return MeanLight(np.array(rows).reshape(-1, 3))


def _surfaces(scene: Scene) -> SurfacePoints | None:
    """Points on all that is opaque and no lamp; None where a scene has no such face."""
    faces = triangles(scene, t_ns=0)
    materials = [scene.materials.get(thing.material) for thing in faces.things]
    of_solid = [material is not None and material.kind != "pane" for material in materials]
    is_solid = np.array(of_solid, bool)[faces.thing]
    solid = np.flatnonzero(is_solid & (faces.lamp < 0))
    area_m2 = areas_m2(faces.corners_m[solid])
    total_m2 = area_m2.sum()
    if not total_m2 > 0:
        return None
    rng = np.random.default_rng(0)
    face = solid[rng.choice(len(solid), POINTS, p=area_m2 / total_m2)]
    corner_weights = rng.dirichlet(np.ones(3), POINTS)
    reflectances = np.array([_mean_reflectance(material) for material in materials])
    return SurfacePoints(
        points_m=np.einsum("nc,ncd->nd", corner_weights, faces.corners_m[face]),
        normals=faces.plane[face],
        mean_reflectance=float(reflectances[faces.thing[face]].mean()),
        caster=RayCaster(faces, solid),
    )


def _mean_reflectance(material: Material | None) -> float:
    """The luminous reflectance of a body or mirror; 0 for other materials."""
    if material is None or material.kind == "pane":
        return 0.0
    if material.kind == "mirror":
        return material.tint
    return float(reflectance(material).mean())


def _hemispheres(normals: Array) -> list[Array]:
    """SKY_RAYS directions (N, 3) each around normals (N, 3), as dense as their cosine (Malley's method)."""
    rng = np.random.default_rng(1)
    directions = []
    for _ in range(SKY_RAYS):
        on_sphere = unit(rng.standard_normal(normals.shape))
        directions.append(unit(normals + on_sphere))
    return directions


def _mean_direct_lx(light: Light, surfaces: SurfacePoints) -> float:
    """Mean illuminance by a sun, or by a lamp as if all of it shone from its middle."""
    if isinstance(light, Sun):
        towards = np.broadcast_to(light.direction(0), surfaces.normals.shape)
        cosine = np.maximum(np.einsum("nd,nd->n", surfaces.normals, towards), 0)
        arriving_lx = light.illuminance_lx * cosine
        return float(np.mean(arriving_lx * surfaces.reached(FAR_M * towards)))
    if isinstance(light, Sky):
        raise ValueError("the sky surrounds the scene and has no middle")
    if isinstance(light, AreaLight):
        corners_m = face_corners(light.mesh)
        areas = areas_m2(corners_m)
        middle_m = areas @ corners_m.mean(1) / areas.sum()
        nearest_m = float(np.sqrt(areas.sum()))
    else:
        middle_m = light.position_m
        nearest_m = 0.1
    vectors_m = middle_m - surfaces.points_m
    distance_m = np.linalg.norm(vectors_m, axis=1)
    towards = unit(vectors_m)
    cosine = np.maximum(np.einsum("nd,nd->n", surfaces.normals, towards), 0)
    intensity_cd = _intensity_cd(light, -towards)
    arriving_lx = intensity_cd * cosine / np.maximum(distance_m, nearest_m) ** 2
    return float(np.mean(arriving_lx * surfaces.reached(vectors_m)))


def _intensity_cd(light: Light, directions: Array) -> Array:
    """Luminous intensity (N,) of a lamp towards unit directions (N, 3)."""
    if isinstance(light, AreaLight):
        corners_m = face_corners(light.mesh)
        edges = corners_m[:, 1:] - corners_m[:, :1]
        facing_m2 = np.cross(edges[:, 0], edges[:, 1]) / 2  # (F, 3): normals as long as faces are large
        seen_m2 = np.maximum(directions @ facing_m2.T, 0).sum(1)
        return np.asarray(light.luminance_cd_m2 * seen_m2)
    if isinstance(light, Sun | Sky):
        raise ValueError("sun and sky have no intensity")
    return light.intensity_cd(directions)
