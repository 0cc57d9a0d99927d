"""Light by way of coats and mirrors: photons bring what Fresnel's law and the geometry say."""

import numpy as np
import pytest

from tests.rendering.rectangles import rectangle, sheet
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.face_response import response
from vobench.rendering.indirect_light import Gatherer
from vobench.rendering.photons import ALL_PHOTONS_SHARE, LEAST_EFFORT, TYPICAL_COSINE, Reflectors
from vobench.rendering.static_scene import bodies, static_points
from vobench.rendering.unwrap import unwrap
from vobench.scene.light import PointLight, Sun
from vobench.scene.material import Material, fresnel
from vobench.scene.scene import Scene, triangles

ETA = 1.5
MATERIALS = {
    "coated": Material(colour=(0.0, 0.0, 0.0), eta=ETA),
    "grey": Material(colour=(0.5, 0.5, 0.5)),
}
SETTINGS = BakeSettings(spacing_m=0.05, light_rays=4, indirect_spacing_m=0.1, indirect_rays=72, bounces=1)
X, Y, Z = np.eye(3)


def ceiling_flux_lm(baked: BakedScene) -> float:
    """The light that bounces bring to the ceiling, the last thing."""
    texel = np.flatnonzero(baked.patches.surfel_of >= 0)
    surfel_count = len(baked.patches.area_m2)
    is_ceiling = np.zeros(surfel_count, bool)
    thing = np.array([baked.faces.things[nth].name == "ceiling" for nth in baked.faces.thing])
    corners_px = baked.atlas.light_px[thing].reshape(-1, 2)
    low_px = corners_px.min(0) - 0.75  # texels at a rim reach beyond it
    high_px = corners_px.max(0) + 0.75
    column = texel % baked.atlas.width + 0.5
    row = texel // baked.atlas.width + 0.5
    is_inside = (column > low_px[0]) & (column < high_px[0]) & (row > low_px[1]) & (row < high_px[1])
    is_ceiling[baked.patches.surfel_of[texel[is_inside]]] = True
    return float((baked.bounced[0, is_ceiling, 1] * baked.patches.area_m2[is_ceiling]).sum())


def test_a_black_coated_floor_mirrors_the_sun_to_the_ceiling_by_fresnels_law() -> None:
    # The sun comes in below the ceiling from the side, and all that the floor mirrors meets the ceiling.
    elevation_deg = 40.0
    floor = rectangle(0 * Z, X, Y, "coated", "floor")
    ceiling = rectangle(0.6 * Z + 1.1 * X, 2.5 * Y, 1.9 * X, "grey", "ceiling")
    sun = Sun("sun", 1e4, (0.0,), (180.0,), (elevation_deg,))
    direction = sun.direction(0)
    assert direction[0] < 0
    baked = bake(Scene("coat", (floor, ceiling), MATERIALS, (sun,)), SETTINGS)
    cosine = np.sin(np.deg2rad(elevation_deg))
    expected_lm = 1e4 * cosine * float(fresnel(np.array(cosine), ETA))
    assert ceiling_flux_lm(baked) == pytest.approx(expected_lm, rel=0.03)


def test_a_coat_shows_a_bulb_as_an_image_of_fresnels_share() -> None:
    floor = sheet(np.array([-3.0, -3.0, 0.0]), 6 * X, 6 * Y, "coated", "floor")
    ceiling = rectangle(1.5 * Z, 0.6 * Y, 0.6 * X, "grey", "ceiling")
    bulb = PointLight("bulb", 0.5 * Z, 1000.0)
    baked = bake(Scene("coat", (floor, ceiling), MATERIALS, (bulb,)), SETTINGS)
    # The image is 2 m below the ceiling, near to right above it.
    expected_lm = 1000 / (4 * np.pi) / 2.0**2 * float(fresnel(np.array(1.0), ETA)) * 0.36
    assert ceiling_flux_lm(baked) == pytest.approx(expected_lm, rel=0.06)


def test_photons_are_fewer_where_they_carry_little_of_the_light() -> None:
    """A bulb over a coated floor: its effort grows with the square of the share that the coat mirrors."""
    floor = sheet(np.array([-1.0, -1.0, 0.0]), 2 * X, 2 * Y, "coated", "floor")
    scene = Scene("coat", (floor,), MATERIALS, (PointLight("bulb", Z, 1000.0),))
    faces = triangles(scene)
    atlas = unwrap(faces, np.full(len(faces), 0.1), bodies(scene, faces))
    visibility, points, _, area_m2 = static_points(scene, faces, atlas, seed=0)
    surfel_of = np.full(atlas.height * atlas.width, -1, np.int32)
    gatherer = Gatherer(
        atlas, visibility, response(faces, MATERIALS, visibility), [], surfel_of=surfel_of, surfels=1, lamps=0
    )
    reflectors = Reflectors(gatherer, points, area_m2, seed=0)
    light_lx = np.full(len(points), 100.0, np.float32)
    arriving_lm = 100.0 * area_m2.sum()
    mirrored = float(fresnel(np.array(float(TYPICAL_COSINE)), ETA))
    assert reflectors.effort(light_lx, 0.0) == 1
    assert reflectors.effort(light_lx, 1e3 * arriving_lm) == LEAST_EFFORT
    scattered_lm = 2 * mirrored * arriving_lm / ALL_PHOTONS_SHARE
    assert reflectors.effort(light_lx, scattered_lm) == pytest.approx(1 / 4, rel=1e-3)
    assert reflectors.effort(np.zeros_like(light_lx), scattered_lm) == 1
