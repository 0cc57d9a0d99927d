"""Meshes of files are repaired: no face without area, backs where they can be seen."""

from typing import Any

import numpy as np
import pytest

from tests.asset.glb import CORNERS, Glb, Reader, only, triangle
from vobench.geometry.triangle import face_normals


def test_faces_without_area_are_dropped_and_counted(read: Reader) -> None:
    glb = Glb(nodes=[{"mesh": 0}])
    points = [*CORNERS, [2, 0, 0], [0.5, 0, 0]]
    glb.tree["meshes"] = [{"primitives": [glb.primitive(points, [[0, 1, 2], [0, 0, 1], [0, 1, 3], [4, 1, 2]])]}]
    model = read(glb)
    assert (len(only(model).faces), model.dropped_faces) == (2, 2)


def cube(size: float) -> tuple[Any, Any]:
    """Corners and outward faces."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * size
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return corners, [face for a, b, c, d in sides for face in ([a, b, c], [a, c, d])]


@pytest.mark.parametrize(("size", "inward", "faces"), [(0.5, False, 12), (2.0, False, 24), (0.5, True, 24)])
def test_two_sided_faces_have_backs_but_for_small_closed_bodies(
    read: Reader, size: float, inward: bool, faces: int
) -> None:
    corners, sides = cube(size)
    glb = Glb(nodes=[{"mesh": 0}], materials=[{"doubleSided": True}])
    order = np.array(sides)[:, ::-1] if inward else sides
    glb.tree["meshes"] = [{"primitives": [glb.primitive(corners, order, material=0)]}]
    assert len(only(read(glb)).faces) == faces


def test_a_two_sided_sheet_shows_the_same_picture_from_behind(read: Reader) -> None:
    mesh = only(read(triangle(material={"doubleSided": True})))
    np.testing.assert_array_equal(face_normals(mesh.triangles), [[0, -1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(mesh.triangles[1], mesh.triangles[0][::-1])
