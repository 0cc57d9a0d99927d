"""Sheets with two sides: rays meet the side that they come from, and both return light."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.asset.shape import at, block
from vobench.asset.texture import Procedural
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.rendering.geometry import RayCaster, reversed_faces
from vobench.rendering.illumination import Illumination
from vobench.scene.light import PointLight
from vobench.scene.material import Material
from vobench.scene.mesh import flipped, joined, moved, quad, two_sided
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Thing, triangle_table

GREY = {"grey": Material(texture=Procedural("plain", 0.5, 0.0, 1.0, 8, 0))}
SETTINGS = BakeSettings(spacing_m=0.1, light_rays=4, indirect_spacing_m=0.2, indirect_rays=144, bounces=12)
ROOM = flipped(block((3.0, 2.6, 2.4), bevel_m=0))
SHEET = quad((0, -0.5, -0.6), (0, 1.0, 0), (0, 0, 1.2))  # seen from +x


@pytest.mark.parametrize("back_first", [False, True])
def test_a_ray_meets_the_side_of_a_sheet_that_it_comes_from(back_first: bool) -> None:
    both = joined([SHEET, flipped(SHEET)][:: -1 if back_first else 1])
    faces = triangle_table([Thing("sheet", both, "grey")], [-1], [-1])
    rng = np.random.default_rng(0)
    ends = np.column_stack([np.zeros(200), rng.uniform(-0.4, 0.4, 200), rng.uniform(-0.5, 0.5, 200)])
    starts = rng.uniform(0.2, 1, (200, 3)) * rng.choice([-1, 1], (200, 1))
    ways = ends - starts
    caster = RayCaster(faces)
    hits = caster.hits(starts, ways)
    assert (np.einsum("ij,ij->i", faces.plane[hits.face], ways) < 0).all()
    np.testing.assert_allclose(hits.at(faces.corners_m), ends, atol=1e-5)
    np.testing.assert_array_equal(caster.nearest(starts, ways), hits.face)


def test_only_faces_with_the_same_corners_in_reverse_are_twins() -> None:
    solid = block((1, 1, 1))
    assert (reversed_faces(solid.triangles) < 0).all()
    doubled = two_sided(solid).triangles
    found, count = reversed_faces(doubled), len(solid.faces)
    np.testing.assert_array_equal(found, np.roll(np.arange(2 * count), count))


def mean_lx(scene: Scene) -> float:
    """Over all of the room's walls, seen from inside, by bounces alone."""
    baked = bake(scene, SETTINGS)
    around = replace(baked, direct=0 * baked.direct)
    light, faces = Illumination(around).at(0, 0)[..., 1], triangles(scene)
    own = (faces.thing == 0) & (np.einsum("ij,ij->i", faces.plane, faces.corners_m.mean(1)) < 0)
    spots = np.random.default_rng(1).dirichlet((1, 1, 1), 300)
    u, v = np.moveaxis(spots @ baked.light_uv[own].astype(float), -1, 0).reshape(2, -1)
    height, width = light.shape
    return float(light[(v * height).astype(int), (u * width).astype(int)].mean())


@pytest.mark.parametrize("back_first", [False, True])
def test_a_room_of_two_sided_walls_is_as_bright_as_one_that_is_seen_from_inside_alone(back_first: bool) -> None:
    lamp = PointLight("bulb", np.array([0.2, 0.1, 0.4]), 1000.0)
    walls = joined([flipped(ROOM), ROOM][:: 1 if back_first else -1])
    alone, doubled = (Scene("s", (Thing("room", mesh, "grey"),), GREY, (lamp,)) for mesh in (ROOM, walls))
    assert mean_lx(doubled) == pytest.approx(mean_lx(alone), rel=0.01)


@pytest.mark.parametrize("back_first", [False, True])
def test_a_two_sided_sheet_returns_light_from_both_sides(back_first: bool) -> None:
    """As two sheets do that look away from each other, a millimetre apart."""
    lamps = tuple(PointLight(f"bulb_{x}", np.array([x, 0.3, 0.4]), 1000.0) for x in (-0.5, 0.5))
    seen = []
    for apart_m in (0.001, 0.0):
        pair = [moved(SHEET, at(apart_m / 2)), moved(flipped(SHEET), at(-apart_m / 2))][:: -1 if back_first else 1]
        things = (Thing("room", ROOM, "grey"), Thing("sheet", joined(pair), "grey"))
        seen.append(mean_lx(Scene("s", things, GREY, lamps)))
    assert seen[1] == pytest.approx(seen[0], rel=0.01)
