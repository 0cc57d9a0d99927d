"""What a scene holds, and where a body can drive in it."""

import numpy as np
import pytest

from vobench.analysis.scene_survey import scene_survey
from vobench.asset.shape import at, block
from vobench.scene.light import PointLight
from vobench.scene.material import Material
from vobench.scene.mesh import flipped, joined, make_mesh, moved, quad
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing

GREY = {"grey": Material(colour=(0.5, 0.5, 0.5))}
FLOOR = Thing("floor", quad((-4, -3, 0), (8, 0, 0), (0, 6, 0)), "grey")
LIGHT = PointLight("bulb", np.array([0.0, 0.0, 2.5]), 500.0)


def scene(*things: Thing) -> Scene:
    return Scene("s", things, GREY, (LIGHT,))


def crate(x_m: float, y_m: float, *, size_m: float = 1.0) -> Thing:
    mesh = moved(block((size_m, size_m, size_m), bevel_m=0), at(x_m, y_m, size_m / 2))
    return Thing(f"crate_{x_m:g}", mesh, "grey")


def test_the_largest_free_circle_touches_the_floors_edge_or_a_thing() -> None:
    free = scene_survey(scene(FLOOR)).free_circle
    assert free is not None
    assert (free.floor_m, free.radius_m) == (0, pytest.approx(3.0, abs=0.1))
    beside = scene_survey(scene(FLOOR, crate(1.0, 0.0))).free_circle
    assert beside is not None
    # Between the left edge and the crate's side, and away from its corners.
    assert np.hypot(beside.x_m - 0.5, beside.y_m) >= beside.radius_m - 0.1
    assert beside.x_m - beside.radius_m >= -4.1
    assert beside.radius_m < free.radius_m


def test_what_hangs_higher_than_a_body_leaves_the_floor_free() -> None:
    shelf = Thing("shelf", moved(block((8, 6, 0.05), bevel_m=0), at(z_m=1.2)), "grey")
    free = scene_survey(scene(FLOOR, shelf)).free_circle
    assert free is not None
    assert (free.floor_m, free.radius_m) == (0, pytest.approx(3.0, abs=0.1))


def test_a_wall_that_stands_on_the_floor_and_ends_at_the_ceiling_is_no_way() -> None:
    ceiling = Thing("ceiling", quad((-4, 3, 2.5), (8, 0, 0), (0, -6, 0)), "grey")
    for wall in (
        moved(block((0.14, 6, 2.5), bevel_m=0), at(0.04, 0, 1.25)),  # its ends lie in floor and ceiling
        quad((0.04, -3, 0), (0, 6, 0), (0, 0, 2.5)),  # a sheet, between two looks down
    ):
        free = scene_survey(scene(FLOOR, ceiling, Thing("wall", wall, "grey"))).free_circle
        assert free is not None
        assert abs(free.x_m - 0.04) > free.radius_m - 0.05


def test_the_floor_is_below_a_roof_that_is_larger() -> None:
    roof = Thing("roof", quad((-6, -4, 3), (12, 0, 0), (0, 8, 0)), "grey")
    free = scene_survey(scene(FLOOR, roof)).free_circle
    assert free is not None
    assert free.floor_m == 0


def test_faces_sizes_and_lights_are_counted() -> None:
    found = scene_survey(scene(FLOOR, crate(1.0, 0.0)))
    assert (found.thing_count, found.face_count, found.material_count, found.light_names) == (2, 14, 1, ("bulb",))
    assert (found.low_m, found.high_m) == ((-4, -3, 0), (4, 3, 1))


def test_open_edges_and_faces_on_a_face_are_found() -> None:
    solid = crate(1.0, 0.0)
    assert scene_survey(scene(FLOOR, solid)).open_edge_count == 0
    faces = solid.mesh.faces
    torn = Thing(
        "torn",
        make_mesh(solid.mesh.vertices, faces[1:], solid.mesh.visual.uv, solid.mesh.vertex_normals),
        "grey",
    )
    assert scene_survey(scene(FLOOR, torn)).open_edge_count == 3
    assert (
        scene_survey(scene(FLOOR, Thing("twice", joined([solid.mesh, solid.mesh]), "grey"))).duplicate_face_count == 12
    )


def test_backs_are_seen_from_inside_a_thing_that_looks_outwards() -> None:
    hall = moved(block((7.9, 5.9, 3), bevel_m=0), at(z_m=1.4))
    inwards = scene_survey(scene(FLOOR, Thing("hall", flipped(hall), "grey")))
    outwards = scene_survey(scene(FLOOR, Thing("hall", hall, "grey")))
    assert inwards.back_facing_share == 0
    assert outwards.back_facing_share > 0.5


def test_a_scene_without_a_floor_has_no_free_circle() -> None:
    wall = Thing("wall", quad((0, 0, 0), (1, 0, 0), (0, 0, 1)), "grey")
    assert scene_survey(scene(wall)).free_circle is None


def test_textures_are_counted_once_each_in_megabytes() -> None:
    from vobench.suite.scene_spec import DiffuseSpec

    texture = DiffuseSpec("terrazzo", 0.4, contrast=0.5, resolution_px=64)
    materials = {
        "grey": Material(colour=(0.5, 0.5, 0.5), texture=texture),
        "again": Material(colour=(0.2, 0.5, 0.5), texture=texture),
    }
    found = scene_survey(Scene("s", (FLOOR,), materials, (LIGHT,)))
    assert found.textures_mb == pytest.approx(texture.pixels().nbytes / 1e6)
    assert found.material_count == 2
    assert scene_survey(scene(FLOOR)).textures_mb == 0


def test_corners_nearer_than_a_hundredth_of_a_millimetre_are_one_point() -> None:
    solid = crate(1.0, 0.0)
    for gap_m, open_edges in ((1e-7, 0), (1e-3, 3)):
        vertices = solid.mesh.vertices[solid.mesh.faces].reshape(-1, 3).copy()  # each face has corners of its own
        vertices[:3] += gap_m
        faces = np.arange(len(vertices)).reshape(-1, 3)
        uv = np.zeros((len(vertices), 2))
        normals = np.repeat(np.array([[0.0, 0.0, 1.0]]), len(vertices), axis=0)
        apart = Thing("apart", make_mesh(vertices, faces, uv, normals), "grey")
        found = scene_survey(scene(FLOOR, apart)).open_edge_count
        assert found == 0 if open_edges == 0 else found >= open_edges


def test_a_face_that_stands_twice_in_another_order_of_corners_is_a_twin() -> None:
    solid = crate(1.0, 0.0)
    turned = make_mesh(
        solid.mesh.vertices,
        np.vstack([solid.mesh.faces, np.roll(solid.mesh.faces[:2], 1, axis=1)]),
        np.zeros((len(solid.mesh.vertices), 2)),
        solid.mesh.vertex_normals,
    )
    assert scene_survey(scene(FLOOR, solid)).duplicate_face_count == 0
    assert scene_survey(scene(FLOOR, Thing("turned", turned, "grey"))).duplicate_face_count == 2


def test_backs_are_looked_for_from_the_middle_where_there_is_no_floor() -> None:
    roof = Thing("roof", quad((-4, 3, 2), (8, 0, 0), (0, -6, 0)), "grey")  # faces down
    lower = Thing("lower", quad((-4, -3, 0), (0, 6, 0), (8, 0, 0)), "grey")  # faces down, too: no floor
    found = scene_survey(scene(roof, lower))
    assert found.free_circle is None
    # From 1 m above it the back of the lower one is all that is below, but for what passes beside it.
    assert 0.3 < found.back_facing_share < 0.5
