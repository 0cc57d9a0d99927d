"""Surveys a scene: its contents, the defects of its meshes, and the free area for a robot."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.geometry import RayCaster
from vobench.scene.material import Texture
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles
from vobench.scene.weld import distinct_rows, open_edges, welded
from vobench.suite.free_space import FreeCircle, largest_free_circle
from vobench.suite.viewpoint import is_place

EYE_HEIGHT_M = 1.2  # the height of the viewer above the floor, about that of a robot's mast
DIRECTIONS = 4096  # the number of random directions in which a survey looks for the backs of faces
DIRECTION_SEED = 0  # the seed of the random directions, fixed so that a survey is repeatable
# An object with at most this many faces counts as a rectangle, which has open edges. Others should be closed surfaces.
MAX_FACES_OF_RECTANGLE = 2


@dataclass(frozen=True, slots=True)
class SceneSurvey:
    """The contents of a scene at its start, and the defects of its meshes.

    `thing_count` is the number of things.
    `face_count` is the number of triangles.
    `material_count` is the number of materials.
    `textures_mb` is the size of all textures in memory, in megabytes.
    `low_m` is the corner of the bounding box with the smallest coordinates.
    `high_m` is the corner of the bounding box with the largest coordinates.
    `light_names` are the names of all lights.
    `open_edge_count` is the number of edges that belong to only one face; those of rectangles are not counted.
    `duplicate_face_count` is the number of faces with the same corners as an earlier face.
    `back_facing_share` is the share of view directions in which the nearest face shows its back, which is not drawn.
    The viewer is in the free circle; without one, it is in the centre of the scene.
    `free_circle` is the largest circle of free floor, None if there is no floor.
    `is_place` is whether a robot can drive in the scene; otherwise the scene is an object.
    """

    thing_count: int
    face_count: int
    material_count: int
    textures_mb: float
    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]
    light_names: tuple[str, ...]
    open_edge_count: int
    duplicate_face_count: int
    back_facing_share: float
    free_circle: FreeCircle | None
    is_place: bool


def scene_survey(scene: Scene) -> SceneSurvey:
    """The survey of a scene at its start. Its lighting is not computed."""
    faces = triangles(scene, t_ns=0)
    caster = RayCaster(faces)
    corners_m = faces.corners_m.reshape(-1, 3)
    low_m = corners_m.min(0)
    high_m = corners_m.max(0)

    free_circle = largest_free_circle(faces, caster)
    eye_m = (low_m + high_m) / 2 if free_circle is None else _above_floor_m(free_circle)
    point_ids = _point_ids(faces)
    texture_bytes = sum(texture.pixels().nbytes for texture in _textures(scene))
    return SceneSurvey(
        thing_count=len({thing.name for thing in faces.things}),
        face_count=len(faces),
        material_count=len(scene.materials),
        textures_mb=texture_bytes / 1e6,
        low_m=_rounded(low_m),
        high_m=_rounded(high_m),
        light_names=tuple(light.name for light in scene.lights),
        open_edge_count=_open_edge_count(faces, point_ids),
        duplicate_face_count=_duplicate_face_count(point_ids),
        back_facing_share=_back_facing_share(faces, caster, eye_m),
        free_circle=free_circle,
        is_place=is_place(faces, caster, free_circle),
    )


def _above_floor_m(circle: FreeCircle) -> Array:
    """The position (3,) of a viewer at the centre of a free circle."""
    return np.array([circle.x_m, circle.y_m, circle.floor_m + EYE_HEIGHT_M])


def _textures(scene: Scene) -> set[Texture]:
    """The distinct textures of all materials."""
    textures = set()
    for material in scene.materials.values():
        for texture in (material.texture, material.emission_texture):
            if texture is not None:
                textures.add(texture)
    return textures


def _rounded(point_m: ArrayLike) -> tuple[float, float, float]:
    """A point (3,), rounded to millimetres."""
    x_m, y_m, z_m = (round(float(coordinate), 3) for coordinate in np.asarray(point_m))
    return (x_m, y_m, z_m)


def _point_ids(faces: Triangles) -> NDArray[np.intp]:
    """The index (F, 3) of the point at each corner; corners at the same position have the same index."""
    point_ids = welded(faces.corners_m.reshape(-1, 3)).inverse
    return point_ids.reshape(-1, 3)


def _open_edge_count(faces: Triangles, point_ids: NDArray[np.intp]) -> int:
    """The number of edges that belong to a single face, without those of rectangles."""
    face_counts = np.bincount(faces.thing, minlength=len(faces.things))
    solid_things = np.flatnonzero(face_counts > MAX_FACES_OF_RECTANGLE)
    is_solid = np.isin(faces.thing, solid_things)
    # Each object gets a separate range of point ids, so that two objects never share an edge.
    point_count = point_ids.max(initial=0) + 1
    id_offset = faces.thing[is_solid, None] * point_count
    return len(open_edges(point_ids[is_solid] + id_offset))


def _duplicate_face_count(point_ids: NDArray[np.intp]) -> int:
    """The number of faces whose three points are those of an earlier face, in any order."""
    sorted_corners = np.sort(point_ids, axis=1)
    first_faces = distinct_rows(sorted_corners).first_index
    return len(point_ids) - len(first_faces)


def _back_facing_share(faces: Triangles, caster: RayCaster, eye_m: ArrayLike) -> float:
    """The share of directions from a viewpoint (3,) in which the nearest face shows its back."""
    rng = np.random.default_rng(DIRECTION_SEED)
    directions = unit(rng.standard_normal((DIRECTIONS, 3)))
    origins_m = np.tile(eye_m, (DIRECTIONS, 1))
    hits = caster.hits(origins_m, directions)
    is_hit = hits.face >= 0
    normals = faces.plane[hits.face[is_hit]]  # (K, 3), of the hit faces
    cosines = np.einsum("ij,ij->i", normals, directions[is_hit])
    is_back = cosines > 0
    return float(np.count_nonzero(is_back) / DIRECTIONS)
