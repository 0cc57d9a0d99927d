"""Meshes keep their shape and winding as they are moved, mirrored and joined; a scene's table has every face once."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from trimesh import Trimesh

from vobench.asset.shape import block
from vobench.geometry import se3
from vobench.geometry.vector import unit
from vobench.scene.light import PointLight
from vobench.scene.mesh import (
    WELD_M,
    Thing,
    arrays,
    copies,
    face_normals,
    flat,
    flipped,
    has_texture_coordinates,
    is_closed_body,
    joined,
    make_mesh,
    moved,
    open_edges,
    quad,
    table,
    textured,
    two_sided,
    welded,
)
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light, triangles

CORNER_M, U_M, V_M = np.array([1.0, 2.0, 0.5]), np.array([2.0, 0, 0]), np.array([0, 0, 3.0])
T = se3.transform(se3.rotation_z(0.4), [0.3, -2.0, 1.0])


def tetrahedron() -> Trimesh:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    return flat(vertices, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], vertices[:, :2])


def volume(mesh: Trimesh) -> float:
    """What a mesh encloses, positive where its faces look outwards (Gauss's theorem)."""
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def test_a_quad_faces_where_its_edges_turn_and_its_texture_lies_on_it_in_metres() -> None:
    mesh = quad(CORNER_M, U_M, V_M, uv_m=(0.25, 0.5))
    np.testing.assert_allclose(face_normals(mesh.triangles), [unit(np.cross(U_M, V_M))] * 2)
    np.testing.assert_allclose(mesh.vertex_normals, [unit(np.cross(U_M, V_M))] * 4)
    along, up = (mesh.vertices - CORNER_M) @ unit(U_M), (mesh.vertices - CORNER_M) @ unit(V_M)
    np.testing.assert_allclose(mesh.visual.uv, np.stack([along + 0.25, up + 0.5], -1))
    assert {tuple(p) for p in mesh.vertices[mesh.faces].reshape(-1, 3)} == {tuple(p) for p in mesh.vertices}


def test_a_flat_mesh_has_the_normals_of_its_faces_and_encloses_what_it_should() -> None:
    mesh = tetrahedron()
    assert volume(mesh) == pytest.approx(1 / 6)
    np.testing.assert_allclose(mesh.vertex_normals[mesh.faces], face_normals(mesh.triangles)[:, None].repeat(3, 1))


def test_a_moved_mesh_is_its_points_moved() -> None:
    mesh = tetrahedron()
    displaced = moved(mesh, T)
    np.testing.assert_allclose(displaced.vertices, se3.apply(T, mesh.vertices))
    np.testing.assert_allclose(displaced.vertex_normals, mesh.vertex_normals @ T[:3, :3].T, atol=1e-12)


@pytest.mark.parametrize("scale", [(2.0, 1.0, 0.5), (-1.0, 1.0, 1.0), (-1.0, -2.0, -3.0)])
def test_what_is_scaled_or_mirrored_still_looks_outwards(scale: tuple[float, float, float]) -> None:
    scaled = moved(tetrahedron(), T @ np.diag([*scale, 1.0]))
    assert volume(scaled) == pytest.approx(abs(np.prod(scale)) / 6)
    np.testing.assert_allclose(
        scaled.vertex_normals[scaled.faces], face_normals(scaled.triangles)[:, None].repeat(3, 1)
    )


def test_a_flipped_mesh_looks_inwards_and_two_sides_enclose_nothing() -> None:
    assert volume(flipped(tetrahedron())) == pytest.approx(-1 / 6)
    assert volume(two_sided(tetrahedron())) == pytest.approx(0)
    assert len(two_sided(tetrahedron()).faces) == 8


def test_joined_meshes_have_all_faces_of_all_and_nothing_else() -> None:
    parts = [tetrahedron(), quad(CORNER_M, U_M, V_M), moved(tetrahedron(), T)]
    np.testing.assert_array_equal(joined(parts).triangles, np.concatenate([part.triangles for part in parts]))
    assert len(joined([]).faces) == 0


def hall() -> Scene:
    crate = Thing("crate", block((1, 1, 1), bevel_m=0), "wood")
    lid = Thing("lid", quad([0, 0, 0.6], [1, 0, 0], [0, 1, 0]), "wood")
    path = WaypointMotion(np.array([0.0, 1.0]), np.array([[0.0, 0, 0.5], [1.0, 0, 0.5]]), np.array([0.0, 90.0]))
    floor = Thing("floor", quad([-2, -3, 0], [4, 0, 0], [0, 6, 0]), "f")
    bulb = PointLight("bulb", np.zeros(3), 1.0)
    lamp = ceiling_light("lamp", np.array([0.0, 0.0, 2.9]), (0.5, 0.5), power_lm=1.0)
    mover = Mover("crate", (crate, lid), path)
    return Scene("hall", (floor, Thing("pyramid", tetrahedron(), "stone")), {}, (bulb, lamp), (mover,))


def test_a_scenes_table_has_what_stands_then_lamps_then_movers() -> None:
    faces = triangles(hall())
    assert [thing.name for thing in faces.things] == ["floor", "pyramid", "lamp", "crate", "lid"]
    assert np.bincount(faces.thing).tolist() == [2, 4, 2, 12, 2]
    assert (np.diff(faces.thing) >= 0).all()
    assert np.unique(faces.lamp[faces.thing == 2]).tolist() == [1]  # the second of its lights
    assert (faces.lamp[faces.thing != 2] == -1).all()
    assert (faces.mover[-14:] == 0).all()
    assert (faces.mover[:-14] == -1).all()


def test_what_a_face_has_is_that_of_its_things_mesh() -> None:
    faces = triangles(hall())
    for nth, thing in enumerate(faces.things):
        own, mesh = faces.thing == nth, thing.mesh
        np.testing.assert_array_equal(faces.corners_m[own], mesh.triangles)
        np.testing.assert_array_equal(faces.normals[own], mesh.vertex_normals[mesh.faces])
        np.testing.assert_array_equal(faces.uv[own], mesh.visual.uv[mesh.faces])
        np.testing.assert_allclose(faces.plane[own], face_normals(mesh.triangles), atol=1e-12)


def test_movers_faces_are_where_their_path_says_and_others_stay() -> None:
    still, later = triangles(hall()), triangles(hall(), t_ns=1_000_000_000)
    own = still.mover == 0
    pose = hall().movers[0].path.pose(1_000_000_000)
    np.testing.assert_allclose(later.corners_m[own], se3.apply(pose, still.corners_m[own]))
    np.testing.assert_allclose(later.plane[own], face_normals(later.corners_m[own]), atol=1e-12)
    np.testing.assert_array_equal(later.corners_m[~own], still.corners_m[~own])


def test_a_table_of_nothing_is_empty() -> None:
    assert len(table((), (), ())) == 0


def test_a_made_mesh_keeps_its_vertices_in_order_and_all_that_it_was_given() -> None:
    vertices = np.array([[0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [1, 0, 0], [0, 1, 0]])
    uv = np.arange(8.0).reshape(4, 2)
    normals = unit(np.arange(12.0).reshape(4, 3) + 1)
    mesh = make_mesh(vertices, [[0, 2, 3], [1, 3, 2]], uv, normals)
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, [[0, 2, 3], [1, 3, 2]])
    np.testing.assert_array_equal(mesh.visual.uv, uv)
    np.testing.assert_array_equal(mesh.vertex_normals, normals)


def test_nothing_changes_the_mesh_that_it_is_given() -> None:
    mesh = block((1.0, 2.0, 3.0))
    before = [array.copy() for array in (mesh.vertices, mesh.faces, mesh.visual.uv, mesh.vertex_normals)]
    for change in (flipped, two_sided, lambda m: moved(m, T), lambda m: textured(m, m.visual.uv + 1)):
        other = change(mesh)
        other.apply_translation([1, 2, 3])
        other.vertices += 1
        other.visual.uv[:] = 5
        other.faces[:] = 0
    after = (mesh.vertices, mesh.faces, mesh.visual.uv, mesh.vertex_normals)
    for array, original in zip(after, before, strict=True):
        np.testing.assert_array_equal(array, original)


def test_copies_are_the_mesh_at_each_pose() -> None:
    poses = [T, np.eye(4), T @ T]
    expected = joined([moved(tetrahedron(), pose) for pose in poses])
    np.testing.assert_array_equal(copies(tetrahedron(), poses).triangles, expected.triangles)


def test_points_within_the_weld_tolerance_are_one_and_others_are_not() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [WELD_M / 10, 0, 0], [1 + 3 * WELD_M, 0, 0]])
    first, index = welded(points)
    assert len(first) == 3
    assert index[0] == index[2]
    assert index[1] != index[3]
    np.testing.assert_allclose(points[first][index], points, atol=WELD_M)


def test_a_closed_body_has_no_open_edges_and_one_that_lacks_a_face_has_three() -> None:
    mesh = block((1.0, 2.0, 3.0))
    point = welded(arrays(mesh).vertices_m)[1]
    faces = point[mesh.faces]
    assert len(open_edges(faces)) == 0
    assert len(open_edges(faces[1:])) == 3
    assert set(open_edges(faces[1:]).ravel()) == set(faces[0])


@pytest.mark.parametrize(("change", "is_closed"), [(lambda m: m, True), (flipped, False), (two_sided, False)])
def test_a_body_is_closed_where_it_is_seen_from_outside(change: Callable[[Trimesh], Trimesh], is_closed: bool) -> None:
    assert is_closed_body(arrays(change(block((1.0, 2.0, 3.0))))) is is_closed


def test_a_body_that_lacks_a_face_is_open() -> None:
    whole = arrays(block((1.0, 2.0, 3.0)))
    assert not is_closed_body(replace(whole, faces=whole.faces[1:]))


def test_a_mesh_of_trimesh_has_its_own_normals_and_no_texture_coordinates() -> None:
    box = trimesh.creation.box((1, 1, 1))
    assert not has_texture_coordinates(box)
    np.testing.assert_array_equal(arrays(box).uv, np.zeros((8, 2)))
    np.testing.assert_array_equal(arrays(box).normals, box.vertex_normals)
    assert has_texture_coordinates(textured(box, np.zeros((8, 2))))
