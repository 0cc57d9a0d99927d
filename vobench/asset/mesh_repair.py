"""Repairs the mesh of a glTF primitive: faces without area, missing normals, NaN, faces whose backs are visible."""

from dataclasses import replace

import numpy as np

from vobench.asset.gltf import Primitive
from vobench.asset.vertex_colour import painted
from vobench.errors import ModelError
from vobench.geometry.triangle import areas_m2, face_normals
from vobench.scene.mesh_arrays import Faces, MeshArrays
from vobench.scene.weld import is_closed_body

LEAST_M2 = 1e-12  # the smallest area of a face; smaller faces are removed
LARGEST_CLOSED_M = 1.0  # a closed body of at most this extent contains no camera, so its back faces are never visible
FARTHEST_M = 1e7  # a model with vertices farther from the origin is probably damaged


def repaired(primitive: Primitive) -> Primitive:
    """The primitive with its mesh repaired and in the frame of the model, and its vertex colours in its look.

    Faces without area are removed, and missing normals are computed. Faces whose backs are visible are doubled.
    Raises ModelError for vertices that are not finite, or too far from the origin.
    """
    if not np.isfinite(primitive.mesh.vertices_m).all():
        raise ModelError("has vertices at NaN or infinity; repair it where it was made")
    is_singular = not np.linalg.det(primitive.T_model_mesh[:3, :3])
    if is_singular:  # no face has an area
        return _without_faces(primitive)

    finite = _with_finite_uv(primitive)
    in_model = _in_model_frame(finite)
    separate = _with_separate_faces(in_model)
    coloured = _with_vertex_colours_in_look(separate)
    return _with_visible_backs(coloured)


def _without_faces(primitive: Primitive) -> Primitive:
    mesh = primitive.mesh
    return replace(primitive, mesh=replace(mesh, faces=mesh.faces[:0]), dropped=len(mesh.faces))


def _with_finite_uv(primitive: Primitive) -> Primitive:
    """The primitive with 0 for texture coordinates that are not finite, and a note if there are any."""
    uv = primitive.mesh.uv
    if np.isfinite(uv).all():
        return primitive
    finite_uv = np.nan_to_num(uv, posinf=0, neginf=0)
    note = f"{primitive.node}: NaN in its texture coordinates read as 0"
    return replace(primitive, mesh=replace(primitive.mesh, uv=finite_uv), notes=(*primitive.notes, note))


def _in_model_frame(primitive: Primitive) -> Primitive:
    """The primitive with its vertices in the frame of the model. Raises ModelError if one is too far away."""
    mesh = primitive.mesh.moved(primitive.T_model_mesh)
    farthest_m = np.abs(mesh.vertices_m).max(initial=0)
    if farthest_m > FARTHEST_M:
        raise ModelError(f"reaches {farthest_m:.3g} m; is it damaged, or of another unit?")
    return replace(primitive, mesh=mesh, T_model_mesh=np.eye(4))


def _with_separate_faces(primitive: Primitive) -> Primitive:
    """The primitive with the faces that have an area, each with three vertices of its own."""
    has_area = areas_m2(primitive.mesh.corners_m) > LEAST_M2
    faces = primitive.mesh.faces[has_area]
    colours = primitive.colours
    if colours is not None:
        colours = colours[faces].reshape(-1, 3)  # (3 F, 3)
    dropped = int(np.count_nonzero(~has_area))
    return replace(primitive, mesh=_separate_faces(primitive.mesh, faces), colours=colours, dropped=dropped)


def _separate_faces(mesh: MeshArrays, faces: Faces) -> MeshArrays:
    """The given faces (F, 3) of a mesh, each with three vertices of its own.

    A vertex without a normal gets the normal of its face.
    """
    normals = np.nan_to_num(mesh.normals)[faces]
    flat_normals = face_normals(mesh.vertices_m[faces])[:, None]
    has_normal = np.linalg.norm(normals, axis=2, keepdims=True) > 0.5
    complete = np.where(has_normal, normals, flat_normals)
    separate = np.arange(faces.size).reshape(-1, 3)
    return MeshArrays(
        mesh.vertices_m[faces].reshape(-1, 3),
        separate,
        mesh.uv[faces].reshape(-1, 2),
        complete.reshape(-1, 3),
    )


def _with_vertex_colours_in_look(primitive: Primitive) -> Primitive:
    """The primitive with the colours of its separate faces in its look instead of at its vertices."""
    has_faces = len(primitive.mesh.faces) > 0
    if primitive.colours is None or not has_faces:
        return replace(primitive, colours=None)
    corner_colours = primitive.colours.reshape(-1, 3, 3)
    mesh, look = painted(primitive.mesh, corner_colours, primitive.look)
    return replace(primitive, mesh=mesh, look=look, colours=None)


def _with_visible_backs(primitive: Primitive) -> Primitive:
    """The primitive with faces on both sides if its look is two-sided and a camera can see the backs."""
    look = primitive.look
    mesh = primitive.mesh
    shows_backs = look.two_sided and look.material.kind == "body"
    if not shows_backs or _is_small_and_closed(mesh):
        return primitive
    return replace(primitive, mesh=mesh.two_sided())


def _is_small_and_closed(mesh: MeshArrays) -> bool:
    """Whether a mesh is a closed body that is too small for a camera to be inside."""
    extent_m = np.ptp(mesh.vertices_m, axis=0).max(initial=0)
    return bool(extent_m <= LARGEST_CLOSED_M) and is_closed_body(mesh)
