"""How densely a scene is sampled, and which of its points light is computed at."""

from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.rectangles import box, rectangle, room
from vobench.geometry.triangle import areas_m2
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.rendering.static_scene import (
    MOVER_COARSER,
    SAMPLES,
    SUNLIT_FINER,
    bodies,
    sampled_faces,
    spacings_m,
    static_points,
    static_scene,
)
from vobench.rendering.unwrap import unwrap
from vobench.scene.light import Sun
from vobench.scene.material import Material
from vobench.scene.mesh import quad
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light, triangles
from vobench.scene.triangles import Thing

MATERIALS = {"grey": Material(colour=(0.5, 0.5, 0.5)), "mirror": Material("mirror"), "glass": Material("pane")}
X, Y, Z = np.eye(3)
STILL = WaypointMotion(np.array([0.0]), np.zeros((1, 3)), np.zeros(1))
CART = Mover("cart", tuple(box(0.5 * Z, (0.4, 0.2, 0.6), yaw_deg=0, material="grey")), STILL)
COARSE = BakeSettings(spacing_m=0.2, light_rays=1, indirect_spacing_m=0.5, indirect_rays=4, bounces=0)


def test_samples_are_further_apart_in_a_large_place_where_nothing_is_requested() -> None:
    sides = {"small": 20.0, "asks": 20.0, "large": 200.0}
    things = [Thing(name, quad((0.0, 0, 0), (a, 0, 0), (0, a, 0)), "grey") for name, a in sides.items()]
    things[1] = replace(things[1], spacing_m=0.5)
    place = Scene("place", tuple(things), {"grey": Material()}, ())
    faces = triangles(place)
    no_edge = np.zeros(len(faces), bool)
    spacing_m = spacings_m(place, faces, BakeSettings(), no_edge)
    samples = (areas_m2(faces.corners_m) / spacing_m**2)[faces.thing != 1].sum()
    assert samples == pytest.approx(SAMPLES)
    assert np.unique(spacing_m[faces.thing == 1]) == [0.5]
    alone = replace(place, things=place.things[:2])
    spacing_m = spacings_m(alone, triangles(alone), BakeSettings(), no_edge[:4])
    assert np.unique(spacing_m[:2]) == [BakeSettings().spacing_m]


def test_only_bodies_show_light() -> None:
    things = [rectangle(3 * n * X, X, Y, name, name) for n, name in enumerate(MATERIALS)]
    place = Scene("place", tuple(things), MATERIALS, ())
    assert bodies(place, triangles(place)).tolist() == [True, True, False, False, False, False]


def test_samples_are_denser_on_fine_faces_and_sparser_on_movers() -> None:
    floor = rectangle(0 * Z, X, Y, "grey", "floor")
    place = Scene("place", (floor,), MATERIALS, (), (CART,))
    faces = triangles(place)
    is_fine = np.array([True, False, *[False] * (len(faces) - 2)])
    spacing_m = spacings_m(place, faces, BakeSettings(spacing_m=0.06), is_fine)
    np.testing.assert_allclose(spacing_m[:2], [0.06 / SUNLIT_FINER, 0.06])
    np.testing.assert_allclose(spacing_m[faces.mover == 0], 0.06 * MOVER_COARSER)


def test_faces_are_divided_only_under_a_sun_and_the_parts_have_the_same_area() -> None:
    floor = rectangle(0 * Z, 40 * X, 40 * Y, "grey", "floor")
    post = box(Z, (0.3, 0.3, 2.0), yaw_deg=0, material="grey", name="post")
    dark = Scene("place", (floor, *post), MATERIALS, ())
    sunny = replace(dark, lights=(Sun("sun", 1e4, (0.0,), (30.0,), (45.0,)),))
    whole, faces, _ = sampled_faces(dark, COARSE)
    parts, parted, spacing_m = sampled_faces(sunny, COARSE)
    assert len(whole.parent) == len(faces)
    assert len(parts.parent) > len(faces)
    assert areas_m2(parted.corners_m).sum() == pytest.approx(areas_m2(faces.corners_m).sum())
    assert spacing_m.min() < COARSE.spacing_m


def test_the_points_of_a_scene_stand_for_the_area_of_its_stationary_bodies() -> None:
    sides = room((3, 3, 2.5), floor="grey", wall="grey", ceiling="mirror")
    place = Scene("place", tuple(sides), MATERIALS, (), (CART,))
    faces = triangles(place)
    atlas = unwrap(faces, np.full(len(faces), 0.1), bodies(place, faces))
    _, points, _, area_m2 = static_points(place, faces, atlas, seed=0)
    is_lit = bodies(place, faces) & (faces.mover < 0)
    assert is_lit[points.face].all()
    assert area_m2.sum() == pytest.approx(areas_m2(faces.corners_m[is_lit]).sum(), rel=1e-4)


def test_the_stationary_scene_of_a_bake_has_the_points_of_its_map() -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 2.4]), (0.4, 0.4), power_lm=1000)
    baked = bake(
        Scene("room", tuple(room((3, 3, 2.5), floor="grey", wall="grey", ceiling="grey")), MATERIALS, (lamp,)), COARSE
    )
    static = static_scene(baked)
    assert (static.cells >= 0).all()
    np.testing.assert_array_equal(baked.patches.surfel_of[static.points.index], static.cells)
    assert static.open_sky.all()
