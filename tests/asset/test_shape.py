"""Shapes: what Gauss, Pythagoras and the formulas of solids say about their meshes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from trimesh import Trimesh

from vobench.asset import shape
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import face_normals
from vobench.scene.mesh import joined, moved, two_sided

SQUARE = np.array([[0, 0], [4, 0], [4, 4], [0, 4]], float)
HOLES = [SQUARE / 4 + 0.5, SQUARE / 4 + 2.5, SQUARE / 8 + [3, 1]]
ANGLE = np.linspace(0, 2 * np.pi, 40, endpoint=False)
STAR = np.stack([np.cos(ANGLE), np.sin(ANGLE)], 1) * np.where(np.arange(40) % 2, 1, 0.5)[:, None]
BENT = shape.spline([[0, 0, 0], [0, 0, 1], [0, 1, 2], [1, 1, 1]], 30)

SOLIDS: dict[str, Trimesh] = {
    "block": shape.block((0.5, 1.2, 0.03)),
    "sharp block": shape.block((1, 2, 3), bevel_m=0),
    "lathe": shape.lathe([[0, 0], [0.1, 0], [0.2, 0.4], [0.05, 0.5], [0, 0.45]]),
    "tube": shape.tube(BENT, 0.05),
    "cushion": shape.cushion((0.5, 0.4, 0.1)),
    "extrusion": shape.extrusion(SQUARE, 0.5, holes_m=HOLES),
    "star": shape.extrusion(STAR[::-1], 0.2),
}
sides = st.floats(0.02, 3.0)


def areas(mesh: Trimesh) -> Array:
    """Area vectors (F, 3)."""
    c = mesh.triangles
    return np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) / 2


def volume(mesh: Trimesh) -> float:
    return float(np.einsum("fk,fk->", areas(mesh), mesh.triangles.mean(axis=1)) / 3)


def stretches(mesh: Trimesh) -> Array:
    """Metres of texture per metre (F, 2), the most and the least, of each face."""
    c, uv = mesh.triangles, mesh.visual.uv[mesh.faces]
    edges, places = c[:, 1:] - c[:, :1], uv[:, 1:] - uv[:, :1]
    along = np.linalg.norm(edges[:, 0], axis=1)
    x = edges[:, 0] / along[:, None]
    y = np.cross(face_normals(c), x)
    flat = np.stack([np.einsum("fek,fk->fe", edges, axis) for axis in (x, y)], axis=-1)
    return np.linalg.svd(np.linalg.solve(flat, places), compute_uv=False)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_is_closed_and_encloses_a_volume(name: str) -> None:
    mesh = SOLIDS[name]
    np.testing.assert_allclose(areas(mesh).sum(axis=0), 0, atol=1e-12)
    assert volume(mesh) > 0


@pytest.mark.parametrize("name", SOLIDS)
def test_every_edge_of_a_solid_is_passed_once_in_each_direction(name: str) -> None:
    mesh = SOLIDS[name]
    _, corner = np.unique(mesh.vertices.round(9), axis=0, return_inverse=True)
    faces = corner[mesh.faces]
    ways = [tuple(edge) for k in range(3) for edge in faces[:, [k, (k + 1) % 3]].tolist()]
    assert len(set(ways)) == len(ways)
    assert {(b, a) for a, b in ways} == set(ways)


@pytest.mark.parametrize("name", SOLIDS)
def test_normals_are_unit_and_point_out_of_their_faces(name: str) -> None:
    mesh = SOLIDS[name]
    np.testing.assert_allclose(np.linalg.norm(mesh.vertex_normals, axis=1), 1, atol=1e-9)
    assert (np.einsum("fck,fk->fc", mesh.vertex_normals[mesh.faces], face_normals(mesh.triangles)) > 0.5).all()


@pytest.mark.parametrize("name", SOLIDS)
def test_no_face_is_degenerate(name: str) -> None:
    assert np.linalg.norm(areas(SOLIDS[name]), axis=1).min() > 1e-9


@given(sides, sides, sides, st.floats(0.0, 0.05))
@settings(max_examples=30, deadline=None)
def test_bevels_stay_inside_their_block_and_take_no_more_than_twelve_edges(
    a: float, b: float, c: float, bevel: float
) -> None:
    mesh = shape.block((a, b, c), bevel_m=bevel)
    assert (np.abs(mesh.vertices) <= np.array([a, b, c]) / 2 + 1e-12).all()
    assert a * b * c - 2 * bevel**2 * (a + b + c) - 1e-12 <= volume(mesh) <= a * b * c + 1e-12


def test_volumes_are_those_of_the_formulas() -> None:
    assert volume(shape.block((1, 2, 3), bevel_m=0)) == pytest.approx(6)
    n = 96
    prism = n / 2 * np.sin(2 * np.pi / n)
    assert volume(shape.lathe([[0, 0], [0.3, 0], [0.3, 2], [0, 2]], sections=n)) == pytest.approx(prism * 0.09 * 2)
    assert volume(shape.tube([[0, 0, 0], [1, 2, 2]], 0.1, sections=n)) == pytest.approx(prism * 0.01 * 3)
    assert volume(shape.extrusion(SQUARE, 0.5, holes_m=HOLES)) == pytest.approx(0.5 * (16 - 1 - 1 - 0.25))
    assert volume(shape.cushion((2, 4, 6), power=2, cells=40)) == pytest.approx(4 / 3 * np.pi * 6, rel=2e-3)


@pytest.mark.parametrize("name", ["block", "sharp block", "extrusion", "star"])
def test_textures_of_flat_faces_are_in_metres(name: str) -> None:
    mesh = SOLIDS[name]
    is_axial = (np.abs(face_normals(mesh.triangles)).max(axis=1) > 0.999) | (name == "star")
    np.testing.assert_allclose(stretches(mesh)[is_axial], 1, atol=1e-9)


def test_textures_of_round_shapes_are_in_metres_around_and_along() -> None:
    u, v = np.meshgrid(np.linspace(0, 2, 5), np.linspace(0, 1, 4))
    sheet = shape.sheet(np.stack([u, v, 0 * u], axis=-1))
    rod = shape.tube([[0, 0, 0], [0, 0, 1]], 0.1, sections=64)
    for mesh in (sheet, rod):
        np.testing.assert_allclose(stretches(mesh), 1, rtol=0.06)
    np.testing.assert_allclose(face_normals(sheet.triangles), np.tile([0, 0, 1], (len(sheet.faces), 1)), atol=1e-12)


def test_the_texture_of_a_block_runs_along_the_longer_side() -> None:
    board = shape.block((0.3, 0.02, 2.0), bevel_m=0)
    front = board.faces[face_normals(board.triangles)[:, 1] > 0.5]
    spread = np.ptp(board.visual.uv[front].reshape(-1, 2), axis=0)
    np.testing.assert_allclose(spread, [2.0, 0.3])


def test_a_lathe_is_smooth_around_and_sharp_at_its_rim() -> None:
    normals = shape.lathe([[0, 0], [0.3, 0], [0.3, 2], [0, 2]], sections=8).vertex_normals
    assert len(np.unique(normals.round(9), axis=0)) == 8 + 2


def test_a_card_shows_the_top_of_its_picture_at_its_top_and_reads_from_left_to_right() -> None:
    mesh = shape.card((2.0, 1.0), cell=(0.25, 0.5, 0.0, 0.5))
    assert face_normals(mesh.triangles) @ [1, 0, 0] == pytest.approx(1)
    np.testing.assert_allclose(mesh.visual.uv[:, 1], 0.25 - mesh.vertices[:, 2] * 0.5)
    # Who looks against x has y on the right.
    np.testing.assert_allclose(mesh.visual.uv[:, 0], 0.375 + mesh.vertices[:, 1] * 0.125)


def test_cards_are_cards_at_their_poses_seen_from_both_sides() -> None:
    sizes = [(1.0, 2.0), (0.3, 0.7)]
    poses = [shape.at(1, 2, 3, yaw=20, pitch=30, roll=40), shape.at(z_m=-1, roll=200)]
    expected = [two_sided(moved(shape.card(size), pose)) for size, pose in zip(sizes, poses, strict=True)]
    cards = shape.cards(sizes, poses)
    np.testing.assert_array_equal(cards.triangles, joined(expected).triangles)
    np.testing.assert_array_equal(cards.vertex_normals, joined(expected).vertex_normals)
    np.testing.assert_array_equal(cards.visual.uv, joined(expected).visual.uv)


def test_a_block_with_a_transform_is_the_block_moved() -> None:
    T = shape.at(1, 2, 3, yaw=20, pitch=30, roll=40)
    there = shape.block((1, 2, 3), transform=T)
    np.testing.assert_array_equal(there.triangles, moved(shape.block((1, 2, 3)), T).triangles)


def test_a_plate_without_thickness_has_no_normals_on_its_rim() -> None:
    plate = shape.block((1, 2, 0))
    is_rim = np.abs(plate.triangles[:, :, 2]).max(axis=1) == 0
    assert is_rim.all()
    lengths = np.linalg.norm(plate.vertex_normals, axis=1)
    assert sorted(set(lengths.round(9))) == [0, 1]
    assert (lengths > 0.5).sum() == 12


def test_an_upright_block_shows_a_picture_upright_on_all_sides() -> None:
    """Seen from outside, u grows to the right and v downwards."""
    box = shape.block((0.4, 0.3, 0.5), bevel_m=0, uv_m=(0.5, 0.5), upright=True)
    for face, normal in zip(box.faces, box.face_normals, strict=True):
        up = np.array([0.0, 1.0, 0.0]) if abs(normal[2]) > 0.5 else np.array([0.0, 0.0, 1.0])
        right = np.cross(up, normal)
        corners = box.vertices[face]
        expected = np.stack([corners @ right, -corners @ up], -1) + 0.5
        np.testing.assert_allclose(box.visual.uv[face], expected, atol=1e-12)
