"""Planar mirrors: faces that mirror sharply in one plane, which are drawn by a view from behind it."""

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

SMOOTH = 0.03  # GGX alpha up to which a plane mirrors as if it were perfectly smooth
COMPARED_COSINE = 0.5  # of the angle of incidence at which mirrors are compared

# Faces belong to one plane up to this angle and this distance.
PLANE_TILT = np.deg2rad(0.1)
PLANE_OFF_M = 1e-3
CELLS_PER_UNIT = 500  # cells of a grid over the coefficients of planes, in which faces of one plane are looked for
# Of two opposite normals, the one with a positive product with this vector represents the plane of a pane: the upper
# one, or for vertical panes that towards y, or that towards x if both are level in y, too.
PREFERRED_SIDE = np.array([1e-4, 1e-2, 1.0])

MOST_MIRRORS = 64
MOST_CANDIDATES = 4 * MOST_MIRRORS
LEAST_M2 = 0.05  # area of a mirror
LEAST_FILL = 0.02  # share of the rectangle around a mirror that its faces fill: a rim is no mirror


@dataclass(frozen=True, slots=True, eq=False)
class PlanarMirror:
    """Faces that mirror sharply in one plane, in the frame of their mover.

    `mover` is the index of the mover, -1 for stationary faces.
    `outline_m` (4, 3) are the corners of a rectangle around the faces.
    `strength` is the share of light that the faces mirror, the largest one among them, as in `sharpness`.
    """

    index: int
    mover: int
    plane: Plane
    outline_m: Array
    is_pane: bool
    strength: float


@dataclass(frozen=True, slots=True)
class MirrorFaces:
    """Faces of a scene that may belong to planar mirrors.

    `corners_m` (F, 3, 3) and `normals` (F, 3) are in the frame of the mover.
    `area_m2` (F,) are the areas of the faces.
    `mover` (F,) are the indices of their movers, -1 for stationary faces.
    `strength` (F,) is the share of light that each face mirrors sharply; 0 for faces that mirror none.
    `is_pane` (F,) marks faces of glass, which mirror on both sides.
    """

    corners_m: Array
    normals: Array
    area_m2: Array
    mover: NDArray[Any]
    strength: Array
    is_pane: Mask


def sharpness(material: Material) -> float:
    """The share of light that a material mirrors sharply, at an angle of incidence of 60°; 0 for none."""
    if material.kind != "pane" and material.roughness > SMOOTH:
        return 0.0
    if material.kind == "mirror":
        return 1.0
    share = float(fresnel(np.array(COMPARED_COSINE), material.eta))
    return max(share, material.metal)


def planar_mirrors(faces: MirrorFaces) -> tuple[Indices, list[PlanarMirror]]:
    """Which mirror each face belongs to (F,), -1 for none, and the mirrors, the largest first."""
    normals = _normals(faces)
    offsets_m = -np.einsum("ij,ij->i", normals, faces.corners_m[:, 0])
    is_free = (faces.strength > 0) & normals.any(1)  # (F,), belongs to no mirror yet; faces without area have no normal
    cells = _cells(faces, normals, offsets_m)

    index = np.full(len(faces.area_m2), -1)
    mirrors = list[PlanarMirror]()
    for cell in _largest_cells(cells, faces.area_m2 * is_free):
        members = np.flatnonzero(is_free & (cells == cell))
        if len(members) == 0:
            continue
        if len(mirrors) == MOST_MIRRORS:
            break
        largest = int(members[np.argmax(faces.area_m2[members])])
        plane = Plane(normals[largest], float(offsets_m[largest]))
        # The plane also has faces in neighbouring cells of the grid, so all free faces are compared with it.
        in_plane = _is_coplanar(faces, normals, is_free & _is_alike(faces, largest), plane)

        outline_m = _outline(faces.corners_m[in_plane].reshape(-1, 3), plane)
        if not _is_large_enough(float(faces.area_m2[in_plane].sum()), outline_m):
            continue
        index[in_plane] = len(mirrors)
        is_free = is_free & ~in_plane
        mirror = PlanarMirror(
            index=len(mirrors),
            mover=int(faces.mover[largest]),
            plane=plane,
            outline_m=outline_m,
            is_pane=bool(faces.is_pane[largest]),
            strength=float(faces.strength[in_plane].max()),
        )
        mirrors.append(mirror)
    return index, mirrors


def _normals(faces: MirrorFaces) -> Array:
    """The normals (F, 3) of the planes of faces. Panes mirror on both sides, so opposite ones have the same normal."""
    is_on_other_side = faces.normals @ PREFERRED_SIDE < 0
    is_reversed = faces.is_pane & is_on_other_side
    sign = np.where(is_reversed, -1.0, 1.0)
    return np.asarray(faces.normals * sign[:, None])


def _cells(faces: MirrorFaces, normals: Array, offsets_m: Array) -> Indices:
    """The cell (F,) of each face in a grid over the coefficients of planes, by mover, for panes and for mirrors."""
    coordinates = np.column_stack(
        [CELLS_PER_UNIT * normals, CELLS_PER_UNIT * offsets_m, faces.mover, faces.is_pane],
    )
    return distinct_rows(np.round(coordinates)).inverse


def _largest_cells(cells: Indices, area_m2: Array) -> list[int]:
    """The cells with the largest area (F,) of faces, the largest first."""
    cell_areas_m2 = np.bincount(cells, area_m2)
    largest_first = np.argsort(-cell_areas_m2, kind="stable")
    return [int(cell) for cell in largest_first[:MOST_CANDIDATES]]


def _is_alike(faces: MirrorFaces, face: int) -> Mask:
    """Whether each face (F,) moves with a given one, and is of glass if that one is."""
    has_same_mover = faces.mover == faces.mover[face]
    has_same_kind = faces.is_pane == faces.is_pane[face]
    return np.asarray(has_same_mover & has_same_kind)


def _is_coplanar(faces: MirrorFaces, normals: Array, is_candidate: Mask, plane: Plane) -> Mask:
    """Which of the candidates (F,) are in a plane."""
    is_parallel = normals @ plane.normal > np.cos(PLANE_TILT)
    in_plane: Mask = is_candidate & is_parallel
    # Distances are computed last, as few faces are parallel.
    distances_m = np.abs(faces.corners_m[in_plane] @ plane.normal + plane.offset_m)  # (faces, 3 corners)
    in_plane[in_plane] = distances_m.max(1) < PLANE_OFF_M
    return in_plane


def _is_large_enough(area_m2: float, outline_m: Array) -> bool:
    """Whether faces of this total area make a mirror: not too small, nor too small a share of the rectangle (4, 3)."""
    sides_m = np.linalg.norm(np.diff(outline_m[:3], axis=0), axis=1)
    rectangle_m2 = float(np.prod(sides_m))
    return area_m2 >= max(LEAST_M2, LEAST_FILL * rectangle_m2)


def _outline(points_m: Array, plane: Plane) -> Array:
    """The corners (4, 3) of the smallest rectangle around points (N, 3) in a plane.

    One side of the smallest rectangle lies on a side of the convex hull, so only these directions are tried.
    """
    plane_axes = np.linalg.svd(plane.normal[None])[2][1:]
    hull_m = points_m[ConvexHull(points_m @ plane_axes.T).vertices]
    along = unit(np.roll(hull_m, -1, axis=0) - hull_m)
    across = np.cross(plane.normal, along)
    u_m = hull_m @ along.T  # (points, sides): each point along each side
    v_m = hull_m @ across.T
    areas_m2 = np.ptp(u_m, axis=0) * np.ptp(v_m, axis=0)
    best = int(np.argmin(areas_m2))

    u_low = u_m[:, best].min()
    u_high = u_m[:, best].max()
    v_low = v_m[:, best].min()
    v_high = v_m[:, best].max()
    corners_m = np.array([[u_low, v_low], [u_high, v_low], [u_high, v_high], [u_low, v_high]])
    from_foot_m = corners_m @ np.stack([along[best], across[best]])  # from the plane's point nearest to the origin
    return np.asarray(from_foot_m - plane.offset_m * plane.normal)
