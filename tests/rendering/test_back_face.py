"""Faces back to back are found in pairs."""

from dataclasses import replace

import numpy as np

from vobench.rendering.back_face import back_faces
from vobench.rendering.dot_product import dot
from vobench.scene.mesh import flipped, make_mesh, quad, texture_coordinates, two_sided
from vobench.scene.triangles import Thing, triangle_table


def test_the_back_of_a_face_has_its_corners_in_any_order_and_belongs_to_the_same_thing() -> None:
    front = quad([0, 0, 0], [1, 0, 0], [0, 1, 0])
    back = flipped(front)
    rolled = make_mesh(back.vertices, np.roll(back.faces, 1, axis=1), texture_coordinates(back), back.vertex_normals)
    sheet = Thing("sheet", front, "a")
    for mesh in (back, rolled):
        both = triangle_table([replace(sheet, mesh=front), replace(sheet, mesh=mesh)], [-1, -1], [-1, -1])
        assert (back_faces(both) == -1).all()
    both_sides = triangle_table([replace(sheet, mesh=two_sided(front))], [-1], [-1])
    back_of = back_faces(both_sides)
    assert back_of[-1] == -1
    np.testing.assert_array_equal(back_of[back_of[:-1]], np.arange(len(both_sides)))
    cosine = dot(both_sides.plane, both_sides.plane[back_of[:-1]])
    np.testing.assert_allclose(cosine, -1)


def test_of_three_coincident_faces_each_is_in_one_pair_at_most() -> None:
    front = quad([0, 0, 0], [1, 0, 0], [0, 1, 0])
    both = two_sided(front)
    faces = np.concatenate([both.faces, both.faces[:2]])
    mesh = make_mesh(both.vertices, faces, texture_coordinates(both), both.vertex_normals)
    back = back_faces(triangle_table([Thing("sheet", mesh, "a")], [-1], [-1]))
    paired = np.flatnonzero(back >= 0)
    assert len(paired) == 4
    np.testing.assert_array_equal(back[back[paired]], paired)
