"""Rays meet the fronts of faces, at distances that are exact to float64."""

from typing import Any

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.cutout import CutOuts
from vobench.rendering.embree import TriangleCaster
from vobench.rendering.front_hit import FacePlanes, FrontCaster, face_planes, least_height_m
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import flipped, moved, quad, two_sided
from vobench.scene.triangles import Thing, triangle_table

DOWN = np.array([0.0, 0, -1])
LEFT_HALF_OPAQUE = np.zeros((64, 64, 4), np.uint8)
LEFT_HALF_OPAQUE[:, :32, 3] = 255
MATERIALS = {"a": Material(), "holes": Material(texture=Picture(LEFT_HALF_OPAQUE, 1.0), cutout=0.5)}


def square(z_m: float, *, material: str = "a", mesh_of: Any = lambda mesh: mesh, shift_m: Any = (0, 0, 0)) -> Thing:
    """A square of 1 x 1 m around the z axis that faces upwards."""
    mesh = moved(quad([-0.5, -0.5, z_m], [1, 0, 0], [0, 1, 0]), se3.transform(np.eye(3), shift_m))
    return Thing("square", mesh_of(mesh), material)


def caster(*things: Thing) -> tuple[FrontCaster, FacePlanes]:
    faces = triangle_table(list(things), [-1] * len(things), [-1] * len(things))
    planes = face_planes(faces)
    is_first = (planes.back[:-1] < 0) | (planes.back[:-1] > np.arange(len(faces)))
    triangles = TriangleCaster(faces.corners_m, np.flatnonzero(is_first), robust=False)
    return FrontCaster(triangles, planes, CutOuts(faces, MATERIALS)), planes


def from_above(x_m: Array, y_m: Array | float, z_m: float = 3.0) -> tuple[Array, Array]:
    x_m, y_m = np.broadcast_arrays(x_m, y_m)
    return np.stack([x_m, y_m, np.full(x_m.shape, z_m)], -1), np.broadcast_to(DOWN, (len(x_m), 3))


def test_backs_are_passed_and_fronts_behind_them_are_met() -> None:
    rays, planes = caster(square(2.0, mesh_of=flipped), square(1.0), square(0.0))
    hits = rays.hits(*from_above(np.array([0.1, 0.3]), 0.2))
    np.testing.assert_allclose(hits.distance, 2.0, rtol=1e-12)
    assert (planes.offsets_m[hits.face] == 1.0).all()


def test_the_two_sides_of_a_sheet_are_met_from_either_side() -> None:
    rays, planes = caster(square(1.0, mesh_of=two_sided))
    origins_m, directions = from_above(np.array([0.1, 0.3]), 0.2)
    from_top = rays.hits(origins_m, directions)
    from_bottom = rays.hits(-origins_m, -directions)
    assert (planes.normals[from_top.face] @ DOWN == -1).all()
    assert (planes.normals[from_bottom.face] @ DOWN == 1).all()
    np.testing.assert_allclose(from_top.distance, 2.0)
    np.testing.assert_allclose(from_bottom.distance, 4.0)


def test_holes_are_passed() -> None:
    rays, _ = caster(square(1.0, material="holes"), square(0.0))
    hits = rays.hits(*from_above(np.array([-0.3, 0.3]), 0.1))
    np.testing.assert_allclose(hits.distance, [2.0, 3.0])


def test_rays_within_a_micrometre_of_an_outline_meet_the_face_if_and_only_if_they_are_inside() -> None:
    for shift_m in ((0.0, 0, 0), (700.0, -300.0, 0)):
        rays, planes = caster(square(0.0, shift_m=shift_m))
        beyond_m = np.array([-1e-6, -1e-7, 1e-7, 1e-6]) * max(1.0, planes.resolution_m / 1e-6)
        origins_m, directions = from_above(shift_m[0] + 0.5 + beyond_m, shift_m[1] + 0.123)
        hits = rays.hits(origins_m, directions)
        np.testing.assert_array_equal(hits.face >= 0, beyond_m < 0)


def test_a_gap_is_closed_where_there_are_faces_around_and_nowhere_else() -> None:
    rays, _ = caster(square(0.0))
    origins_m, directions = from_above(np.array([0.1, 0.6]), 0.2)
    hits = rays.hits(origins_m, directions)
    hits.face[0] = -1
    hits.distance[0] = np.nan
    rays.close_gaps(origins_m, directions, hits)
    assert hits.face[0] >= 0
    assert hits.distance[0] == pytest.approx(3.0)
    assert hits.face[1] == -1


def test_the_least_height_is_that_on_the_longest_edge() -> None:
    right_angled = np.array([[[0.0, 0, 0], [4, 0, 0], [0, 3, 0]], [[0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    np.testing.assert_allclose(least_height_m(right_angled), [4 * 3 / 5, 0])
