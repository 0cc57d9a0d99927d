"""Planar mirrors: faces in one plane that reflect sharply. Their reflections are drawn from behind the plane."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Mask
from vobench.rendering.view import Plane
from vobench.scene.material import Material, fresnel
from vobench.scene.weld import distinct_rows

Indices = NDArray[np.int64]

SMOOTH = 0.03  # the largest GGX alpha of a surface that is drawn as a perfectly smooth mirror
STEEP_COSINE = 0.5  # the cosine of incidence at which the reflectances of mirrors are compared

# The largest angle and the largest distance between the faces of one mirror.
PLANE_TILT = np.deg2rad(0.1)
PLANE_OFF_M = 1e-3

CELLS = (
    500  # the number of grid cells per unit of the coefficients of a plane, in which faces of one plane are searched
)
MOST_MIRRORS = 64
LEAST_M2 = 0.05  # the smallest area of a mirror
LEAST_FILL = 0.02  # the smallest share of its bounding rectangle that a mirror fills, so that rims are no mirrors


@dataclass(frozen=True, slots=True, eq=False)
class PlanarMirror:
    """Faces that reflect sharply in one plane, in the frame of their mover.

    `outline_m` (4, 3) are the corners of a rectangle around them.
    `strength` is their approximate reflectance, at a steep angle.
    """

    index: int
    mover: int
    plane: Plane
    outline_m: Array
    is_pane: bool
    strength: float


@dataclass(frozen=True, slots=True)
class MirrorFaces:
    """F faces that can be parts of planar mirrors.

    `corners_m` (F, 3, 3), `normals` (F, 3), `area_m2` (F,) and `mover` (F,) are their properties.
    `strength` (F,) is their reflectance, 0 for faces that do not reflect sharply.
    `is_pane` (F,) is whether they are of glass, which reflects on both sides.
    """

    corners_m: Array
    normals: Array
    area_m2: Array
    mover: NDArray[Any]
    strength: Array
    is_pane: Mask


def sharpness(material: Material) -> float:
    """The reflectance of a material for sharp reflections at a steep angle, 0 if it has none."""
    if material.kind != "pane" and material.roughness > SMOOTH:
        return 0.0
    if material.kind == "mirror":
        return 1.0
    share = float(fresnel(np.array(STEEP_COSINE), material.eta))
    return max(share, material.metal)


def planar_mirrors(faces: MirrorFaces) -> tuple[Indices, list[PlanarMirror]]:
    """The mirror (F,) of each face, -1 for none, and the mirrors, the largest first."""
    # Panes reflect on both sides, so opposite normals mean the same plane. The sign of their normals is made unique.
    faces_away = faces.is_pane & (faces.normals @ [1e-4, 1e-2, 1.0] < 0)
    sign = np.where(faces_away, -1.0, 1.0)
    normal = faces.normals * sign[:, None]
    offset_m = -np.einsum("ij,ij->i", normal, faces.corners_m[:, 0])

    # Faces of one plane have similar coefficients of their planes, so most of them are in one cell of a grid.
    is_free = (faces.strength > 0) & normal.any(1)
    keys = np.column_stack([CELLS * normal, CELLS * offset_m, faces.mover, faces.is_pane])
    cell = distinct_rows(np.round(keys)).inverse
    cell_areas_m2 = np.bincount(cell, faces.area_m2 * is_free)
    largest_first = np.argsort(-cell_areas_m2, kind="stable")

    index = np.full(len(faces.area_m2), -1)
    mirrors = list[PlanarMirror]()
    for candidate in largest_first[: 4 * MOST_MIRRORS].tolist():
        members = np.flatnonzero(is_free & (cell == candidate))
        if len(members) == 0 or len(mirrors) == MOST_MIRRORS:
            continue
        seed = int(members[np.argmax(faces.area_m2[members])])
        plane = Plane(normal[seed], float(offset_m[seed]))
        in_plane = is_free & _are_in_plane(faces, normal, seed, plane)

        outline_m = _outline(faces.corners_m[in_plane].reshape(-1, 3), plane)
        sides_m = np.linalg.norm(np.diff(outline_m[:3], axis=0), axis=1)
        least_m2 = max(LEAST_M2, LEAST_FILL * float(np.prod(sides_m)))
        if faces.area_m2[in_plane].sum() < least_m2:
            continue
        index[in_plane] = len(mirrors)
        is_free = is_free & ~in_plane
        mirrors.append(
            PlanarMirror(
                index=len(mirrors),
                mover=int(faces.mover[seed]),
                plane=plane,
                outline_m=outline_m,
                is_pane=bool(faces.is_pane[seed]),
                strength=float(faces.strength[in_plane].max()),
            )
        )
    return index, mirrors


def _are_in_plane(faces: MirrorFaces, normal: Array, seed: int, plane: Plane) -> Mask:
    """Whether faces (F,) with normals (F, 3) are in the plane of one of them, the seed, and can be in one mirror."""
    has_same_mover = faces.mover == faces.mover[seed]
    is_same_kind = faces.is_pane == faces.is_pane[seed]
    is_parallel = normal @ plane.normal > np.cos(PLANE_TILT)
    in_plane = np.asarray(has_same_mover & is_same_kind & is_parallel)
    heights_m = np.abs(faces.corners_m[in_plane] @ plane.normal + plane.offset_m)
    in_plane[in_plane] = heights_m.max(1) < PLANE_OFF_M
    return in_plane


def _outline(points_m: Array, plane: Plane) -> Array:
    """The corners (4, 3) of the smallest rectangle around points (N, 3) in a plane. One side is on their hull."""
    plane_axes = np.linalg.svd(plane.normal[None])[2][1:]
    hull_m = points_m[ConvexHull(points_m @ plane_axes.T).vertices]
    along = unit(np.roll(hull_m, -1, axis=0) - hull_m)
    across = np.cross(plane.normal, along)
    u = hull_m @ along.T  # (points, sides): the coordinate of each point along each side
    v = hull_m @ across.T
    areas_m2 = np.ptp(u, axis=0) * np.ptp(v, axis=0)
    best = int(np.argmin(areas_m2))
    u_low = u[:, best].min()
    u_high = u[:, best].max()
    v_low = v[:, best].min()
    v_high = v[:, best].max()
    corners = np.array([[u_low, v_low], [u_high, v_low], [u_high, v_high], [u_low, v_high]])
    in_plane_m = corners @ np.stack([along[best], across[best]])
    return np.asarray(in_plane_m - plane.offset_m * plane.normal)
