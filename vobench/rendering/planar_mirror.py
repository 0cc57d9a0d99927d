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

SMOOTH = 0.03  # GGX alpha below which a plane mirrors as if it were perfectly smooth
STEEP_COSINE = 0.5  # of the angle of incidence at which mirrors are compared
# between faces that mirror as one plane
PLANE_TILT = np.deg2rad(0.1)
PLANE_OFF_M = 1e-3
CELLS = 500  # a unit of a plane's coefficients, in which faces of one plane are looked for
LEAST_M2 = 0.05
MOST_MIRRORS = 64
LEAST_FILL = 0.02  # of the rectangle around them: a rim is no mirror


@dataclass(frozen=True, slots=True, eq=False)
class PlanarMirror:
    """Faces that mirror sharply in one plane of their mover's frame.

    outline_m (4, 3): corners around them all. strength: the share that they mirror of what comes from ahead, about.
    """

    index: int
    mover: int
    plane: Plane
    outline_m: Array
    is_pane: bool
    strength: float


@dataclass(frozen=True, slots=True)
class MirrorFaces:
    """Faces (F,) of which planar mirrors are made: corners (F, 3, 3), normals (F, 3), areas, movers.

    strength (F,): what they mirror, 0 for faces that do not; is_pane (F,): of glass, which mirrors on both sides.
    """

    corners_m: Array
    normals: Array
    area_m2: Array
    mover: NDArray[Any]
    strength: Array
    is_pane: Mask


def sharpness(material: Material) -> float:
    """The share that a material mirrors as sharply as a perfect mirror, seen from a steep angle, 0 for none."""
    if material.kind != "pane" and material.roughness > SMOOTH:
        return 0.0
    if material.kind == "mirror":
        return 1.0
    share = float(fresnel(np.array(STEEP_COSINE), material.eta))
    return max(share, material.metal)


def planar_mirrors(faces: MirrorFaces) -> tuple[Indices, list[PlanarMirror]]:
    """Which mirror each face belongs to (F,), -1 for none, and the mirrors, the largest first."""
    # Panes mirror on both sides: those that face away are the same plane.
    faces_away = faces.is_pane & (faces.normals @ [1e-4, 1e-2, 1.0] < 0)
    sign = np.where(faces_away, -1.0, 1.0)
    normal = faces.normals * sign[:, None]
    offset_m = -np.einsum("ij,ij->i", normal, faces.corners_m[:, 0])

    is_free = (faces.strength > 0) & normal.any(1)
    index = np.full(len(faces.area_m2), -1)
    mirrors = list[PlanarMirror]()
    keys = np.column_stack([CELLS * normal, CELLS * offset_m, faces.mover, faces.is_pane])
    cell = distinct_rows(np.round(keys)).inverse
    cell_areas_m2 = np.bincount(cell, faces.area_m2 * is_free)
    largest_first = np.argsort(-cell_areas_m2, kind="stable")
    for nth in largest_first[: 4 * MOST_MIRRORS].tolist():
        members = np.flatnonzero(is_free & (cell == nth))
        if len(members) == 0 or len(mirrors) == MOST_MIRRORS:
            continue
        seed = members[np.argmax(faces.area_m2[members])]
        plane = Plane(normal[seed], float(offset_m[seed]))
        moves_along = faces.mover == faces.mover[seed]
        is_alike = moves_along & (faces.is_pane == faces.is_pane[seed])
        is_parallel = normal @ plane.normal > np.cos(PLANE_TILT)
        in_plane = is_free & is_alike & is_parallel
        heights_m = np.abs(faces.corners_m[in_plane] @ plane.normal + plane.offset_m)
        in_plane[in_plane] = heights_m.max(1) < PLANE_OFF_M

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


def _outline(points_m: Array, plane: Plane) -> Array:
    """The corners (4, 3) of the smallest rectangle around points (N, 3) in a plane; one side is the hull's."""
    plane_axes = np.linalg.svd(plane.normal[None])[2][1:]
    hull_m = points_m[ConvexHull(points_m @ plane_axes.T).vertices]
    along = unit(np.roll(hull_m, -1, axis=0) - hull_m)
    across = np.cross(plane.normal, along)
    u = hull_m @ along.T  # (points, sides): each point along each side
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
