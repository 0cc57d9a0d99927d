"""Meshes keep their shape and winding as they are moved, mirrored and joined; a scene's table has every face once."""

import numpy as np
import pytest
import trimesh
from trimesh import Trimesh

from vobench.asset.shape import block
from vobench.geometry import se3
from vobench.geometry.triangle import face_normals
from vobench.geometry.vector import unit
from vobench.scene.mesh import (
    as_arrays,
    copies,
    flat_shaded,
    flipped,
    has_texture_coordinates,
    joined,
    make_mesh,
    moved,
    quad,
    textured,
    two_sided,
)

CORNER_M, U_M, V_M = np.array([1.0, 2.0, 0.5]), np.array([2.0, 0, 0]), np.array([0, 0, 3.0])
T = se3.transform(se3.rotation_z(0.4), [0.3, -2.0, 1.0])


def tetrahedron() -> Trimesh:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    return flat_shaded(vertices, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], vertices[:, :2])


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


def test_a_mesh_of_trimesh_has_its_own_normals_and_no_texture_coordinates() -> None:
    box = trimesh.creation.box((1, 1, 1))
    assert not has_texture_coordinates(box)
    np.testing.assert_array_equal(as_arrays(box).uv, np.zeros((8, 2)))
    np.testing.assert_array_equal(as_arrays(box).normals, box.vertex_normals)
    assert has_texture_coordinates(textured(box, np.zeros((8, 2))))
