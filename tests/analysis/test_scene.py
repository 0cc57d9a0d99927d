"""What a scene holds, and where a body can drive in it."""

import numpy as np
import pytest

from vobench.analysis.scene import survey
from vobench.asset.shape import at, block
from vobench.scene.light import PointLight
from vobench.scene.material import Material
from vobench.scene.mesh import Thing, flipped, joined, make_mesh, moved, quad
from vobench.scene.scene import Scene

GREY = {"grey": Material(colour=(0.5, 0.5, 0.5))}
FLOOR = Thing("floor", quad((-4, -3, 0), (8, 0, 0), (0, 6, 0)), "grey")
LIGHT = PointLight("bulb", np.array([0.0, 0.0, 2.5]), 500.0)


def scene(*things: Thing) -> Scene:
    return Scene("s", things, GREY, (LIGHT,))


def crate(x_m: float, y_m: float, *, size_m: float = 1.0) -> Thing:
    mesh = moved(block((size_m, size_m, size_m), bevel_m=0), at(x_m, y_m, size_m / 2))
    return Thing(f"crate_{x_m:g}", mesh, "grey")


def test_the_largest_free_circle_touches_the_floors_edge_or_a_thing() -> None:
    free = survey(scene(FLOOR)).free
    assert free is not None
    assert (free.floor_m, free.radius_m) == (0, pytest.approx(3.0, abs=0.1))
    beside = survey(scene(FLOOR, crate(1.0, 0.0))).free
    assert beside is not None
    # Between the left edge and the crate's side, and away from its corners.
    assert np.hypot(beside.x_m - 0.5, beside.y_m) >= beside.radius_m - 0.1
    assert beside.x_m - beside.radius_m >= -4.1
    assert beside.radius_m < free.radius_m


def test_what_hangs_higher_than_a_body_leaves_the_floor_free() -> None:
    shelf = Thing("shelf", moved(block((8, 6, 0.05), bevel_m=0), at(z_m=1.2)), "grey")
    free = survey(scene(FLOOR, shelf)).free
    assert free is not None
    assert (free.floor_m, free.radius_m) == (0, pytest.approx(3.0, abs=0.1))


def test_a_wall_that_stands_on_the_floor_and_ends_at_the_ceiling_is_no_way() -> None:
    ceiling = Thing("ceiling", quad((-4, 3, 2.5), (8, 0, 0), (0, -6, 0)), "grey")
    for wall in (
        moved(block((0.14, 6, 2.5), bevel_m=0), at(0.04, 0, 1.25)),  # its ends lie in floor and ceiling
        quad((0.04, -3, 0), (0, 6, 0), (0, 0, 2.5)),  # a sheet, between two looks down
    ):
        free = survey(scene(FLOOR, ceiling, Thing("wall", wall, "grey"))).free
        assert free is not None
        assert abs(free.x_m - 0.04) > free.radius_m - 0.05


def test_the_floor_is_below_a_roof_that_is_larger() -> None:
    roof = Thing("roof", quad((-6, -4, 3), (12, 0, 0), (0, 8, 0)), "grey")
    free = survey(scene(FLOOR, roof)).free
    assert free is not None
    assert free.floor_m == 0


def test_faces_sizes_and_lights_are_counted() -> None:
    found = survey(scene(FLOOR, crate(1.0, 0.0)))
    assert (found.things, found.faces, found.materials, found.lights) == (2, 14, 1, ("bulb",))
    assert (found.low_m, found.high_m) == ((-4, -3, 0), (4, 3, 1))


def test_open_edges_and_faces_on_a_face_are_found() -> None:
    solid = crate(1.0, 0.0)
    assert survey(scene(FLOOR, solid)).open_edges == 0
    faces = solid.mesh.faces
    torn = Thing(
        "torn",
        make_mesh(solid.mesh.vertices, faces[1:], solid.mesh.visual.uv, solid.mesh.vertex_normals),
        "grey",
    )
    assert survey(scene(FLOOR, torn)).open_edges == 3
    assert survey(scene(FLOOR, Thing("twice", joined([solid.mesh, solid.mesh]), "grey"))).twins == 12


def test_backs_are_seen_from_inside_a_thing_that_looks_outwards() -> None:
    hall = moved(block((7.9, 5.9, 3), bevel_m=0), at(z_m=1.4))
    inwards = survey(scene(FLOOR, Thing("hall", flipped(hall), "grey")))
    outwards = survey(scene(FLOOR, Thing("hall", hall, "grey")))
    assert inwards.backs == 0
    assert outwards.backs > 0.5


def test_a_scene_without_a_floor_has_no_free_circle() -> None:
    wall = Thing("wall", quad((0, 0, 0), (1, 0, 0), (0, 0, 1)), "grey")
    assert survey(scene(wall)).free is None
