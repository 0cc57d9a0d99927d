"""How much light passes between two points of a scene: opaque faces block it, and panes reduce it."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.embree import Hits
from vobench.rendering.geometry import (
    FAR_M,
    RAY_OFFSET_M,
    SHORT_OF_END,
    RayCaster,
    face_materials,
    lengths,
    sample_points,
)
from vobench.rendering.planar_patch import PlanarPatch, planar_patches
from vobench.rendering.shadow_kernels import meet_boxes
from vobench.scene.material import Material, pane_reflectance
from vobench.scene.triangles import Triangles

MOST_PANES = 16  # the largest number of panes that a ray crosses
WIDE_M2 = 0.05  # the smallest area of mirrors that show lamps, and of panes that show the sky
BOX_MARGIN_M = 0.01  # the margin of the boxes around panes
MOST_BOXES = 48  # if there are more boxes around panes, one box around all of them is used instead
SKY_PROBES = 512  # the number of rays to each side of a pane that test whether the sky is visible through it


class Visibility:
    """The opaque faces and the panes among the given rows (K,) of a table. Cut-outs count as solid.

    `faces` is the table. `normals` (F + 1, 3) are those of its faces, the last entry for no face.
    `opaque` casts rays at the opaque faces.
    `is_pane` (F,) and `is_static` (F,) are whether a face is a pane, and whether it is among the rows.
    `mirrors` are the smooth, flat mirrors, each with its tint and a caster of rays at it.
    `sky_panes` are the panes through which the sky is visible.
    """

    def __init__(
        self,
        faces: Triangles,
        materials: Mapping[str, Material],
        among: ArrayLike,
    ) -> None:
        rows = np.asarray(among, np.int32)
        materials_of = face_materials(faces, materials)
        kind = _by_face(faces, materials_of, lambda material: material.kind, "")[rows]
        roughness = _by_face(faces, materials_of, lambda material: material.roughness, np.nan)[rows]
        tint = _by_face(faces, materials_of, lambda material: material.tint, 1.0)
        is_pane = kind == "pane"
        is_smooth_mirror = (kind == "mirror") & (roughness == 0)

        self.faces = faces
        normals = np.append(faces.plane, np.zeros((1, 3)), 0)
        self.normals = normals.astype(np.float32)
        self._eta = _by_face(faces, materials_of, lambda material: material.eta, 1.0)
        self._tint = tint.astype(np.float32)
        self.opaque = RayCaster(faces, rows[~is_pane])
        self._glass = RayCaster(faces, rows[is_pane])
        self._has_panes = bool(is_pane.any())
        self._pane_boxes = _boxes(faces, rows[is_pane])
        self._around_panes = _around(self._pane_boxes)
        self.is_pane = np.zeros(len(faces), bool)
        self.is_pane[rows[is_pane]] = True
        self.is_static = np.zeros(len(faces), bool)
        self.is_static[rows] = True
        self.mirrors = self._mirrors(rows[is_smooth_mirror])
        self.sky_panes = self._panes_before_sky(rows[is_pane])
        sky_pane_faces = [face for pane in self.sky_panes for face in pane.faces]
        self._sky_panes = RayCaster(faces, sky_pane_faces)

    def _mirrors(self, rows: Indices) -> list[tuple[PlanarPatch, float, RayCaster]]:
        """The mirrors that show sharp images of lamps, with their tints. Coats, which reflect little, are omitted."""
        mirrors = []
        for patch in planar_patches(self.faces, rows, at_least_m2=WIDE_M2):
            tint = float(self._tint[patch.faces[0]])
            mirrors.append((patch, tint, RayCaster(self.faces, patch.faces)))
        return mirrors

    def _panes_before_sky(self, rows: Indices) -> list[PlanarPatch]:
        """One side of each pane through which the sky is visible. These panes are treated as lamps."""
        panes = list[PlanarPatch]()
        for pane in planar_patches(self.faces, rows, at_least_m2=WIDE_M2):
            is_back = any(pane.coincides(other) for other in panes)
            if not is_back and self._sees_sky(pane):
                panes.append(pane)
        return panes

    def passing(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """The share (R,) of light that reaches origins (R, 3) from origins + segments (R, 3)."""
        share = (~self.opaque.stops(origins_m, segments_m)).astype(np.float32)
        if self._has_panes:
            rays = self._near_panes(origins_m, segments_m)
            rays = rays[share[rays] > 0]
            share[rays] = self.through_panes(origins_m[rays], segments_m[rays])
        return share

    def _near_panes(self, origins_m: Floats, segments_m: Floats) -> Rows:
        """The rays from origins along segments (R, 3) that meet the box of a pane. Other rays cross no pane."""
        is_near = np.empty(len(origins_m), bool)
        origins = np.ascontiguousarray(origins_m, np.float32)
        segments = np.ascontiguousarray(segments_m, np.float32)
        meet_boxes(origins, segments, self._around_panes, self._pane_boxes, is_near)
        return np.flatnonzero(is_near)

    def clear(self, origins_m: Floats, segments_m: Floats) -> Mask:
        """Whether nothing opaque is between origins and origins + segments (R, 3)."""
        return ~self.opaque.stops(origins_m, segments_m)

    def pane_passes(self, pane: PlanarPatch, directions: Floats) -> Floats:
        """The share (R,) of light that a pane transmits along unit directions (R, 3)."""
        face = pane.faces[0]
        reflected = pane_reflectance(directions @ pane.normal, float(self._eta[face]))
        return np.asarray(self._tint[face] * (1 - reflected))

    def crosses_sky_pane(self, origins_m: Floats, segments_m: Floats) -> Mask:
        """Whether one of the panes that show the sky is between origins and origins + segments (R, 3)."""
        if not self.sky_panes:
            return np.zeros(len(origins_m), bool)
        return self._sky_panes.stops(origins_m, segments_m)

    def first_panes(self, origins_m: Floats, directions: Floats, reach_m: Floats) -> tuple[Rows, Hits]:
        """The rays (K,) that cross a pane within their reach (R,), and their hits with the first one.

        Reach and distances of hits are in lengths of the directions (R, 3).
        """
        if not self._has_panes:
            none = np.zeros(0, np.int64)
            no_values = np.zeros(0, np.float32)
            return none, Hits(none.astype(np.int32), no_values, no_values, no_values)
        near = self._near_panes(origins_m, directions * reach_m[:, None])
        hits = self._glass.one_sided_hits(origins_m[near], directions[near], SHORT_OF_END * reach_m[near])
        met = np.flatnonzero(hits.face >= 0)
        rays = near[met]
        return rays, self._glass.facing(hits.take(met), directions[rays])

    def pane_mirrors(self, panes: Indices, cosine: Floats) -> Floats:
        """The reflectance (R,) of the panes with faces (R,) at cosines of incidence (R,)."""
        return pane_reflectance(cosine, self._eta[panes]).astype(np.float32)

    def through_panes(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """The share (R,) of light that all panes between origins and origins + segments (R, 3) transmit."""
        share = np.ones(len(origins_m), np.float32)
        if not self._has_panes:
            return share
        rays = self._near_panes(origins_m, segments_m)
        rays = rays[self._glass.stops(origins_m[rays], segments_m[rays])]
        travelled = np.zeros(len(rays), np.float32)  # the share of the segment behind each ray
        for _ in range(MOST_PANES):
            if not len(rays):
                break
            # The next pane of each ray. Rays without one are complete.
            rest_m = segments_m[rays] * (1 - travelled)[:, None]
            start_m = origins_m[rays] + segments_m[rays] * travelled[:, None]
            hits = self._glass.hits(start_m, rest_m)
            crossing = np.flatnonzero((hits.face >= 0) & (hits.distance < 1))
            rays = rays[crossing]
            pane = hits.face[crossing]
            rest_m = rest_m[crossing]
            travelled = travelled[crossing]

            length_m = lengths(rest_m)
            cosine = np.einsum("ij,ij->i", rest_m, self.normals[pane]) / length_m
            reflected = pane_reflectance(cosine, self._eta[pane])
            share[rays] *= self._tint[pane] * (1 - reflected).astype(np.float32)

            # The ray continues slightly behind the pane.
            step = hits.distance[crossing] + RAY_OFFSET_M / length_m
            travelled = (travelled + (1 - travelled) * step).astype(np.float32)
        return share

    def _sees_sky(self, pane: PlanarPatch) -> bool:
        """Whether any of SKY_PROBES rays to each side of a pane leaves the scene without meeting another pane."""
        a, b, tilt, turn = np.random.default_rng(0).random((4, SKY_PROBES))
        u_axis = unit(pane.corners_m[0, 1] - pane.corners_m[0, 0])
        v_axis = np.cross(pane.normal, u_axis)
        radius = np.sqrt(tilt)[:, None]
        angle = 2 * np.pi * turn[:, None]
        in_plane = radius * (np.cos(angle) * u_axis + np.sin(angle) * v_axis)
        upwards = np.sqrt(1 - radius**2) * pane.normal
        directions = np.concatenate([in_plane + upwards, in_plane - upwards])
        points_m = np.tile(sample_points(pane.corners_m, a, b), (2, 1))
        origins_m = points_m + RAY_OFFSET_M * directions
        segments_m = FAR_M * directions
        meets_opaque = self.opaque.stops(origins_m, segments_m)
        meets_pane = self._glass.stops(origins_m, segments_m)
        is_blocked = meets_opaque | meets_pane
        return not is_blocked.all()


def _boxes(faces: Triangles, rows: Indices) -> Floats:
    """Slightly enlarged boxes (K, 2, 3) float32 around the faces at rows, one for each plane of each thing."""
    patches = planar_patches(faces, rows)
    corners_m = [[patch.corners_m.min((0, 1)), patch.corners_m.max((0, 1))] for patch in patches]
    boxes_m = np.array(corners_m).reshape(-1, 2, 3)
    boxes_m[:, 0] -= BOX_MARGIN_M
    boxes_m[:, 1] += BOX_MARGIN_M
    rounded_m = np.round(boxes_m, 3).reshape(-1, 6)
    boxes_m = np.unique(rounded_m, axis=0).reshape(-1, 2, 3)
    if len(boxes_m) > MOST_BOXES:
        boxes_m = _around(boxes_m)[None]
    return boxes_m.astype(np.float32)


def _around(boxes_m: Floats) -> Floats:
    """The box (2, 3) around boxes (K, 2, 3). Without boxes it is a point that no segment meets."""
    if not len(boxes_m):
        return np.full((2, 3), FAR_M, np.float32)
    return np.stack([boxes_m[:, 0].min(0), boxes_m[:, 1].max(0)])


def _by_face(
    faces: Triangles,
    materials_of: Sequence[Material | None],
    read: Callable[[Material], Any],
    default: Any,
) -> NDArray[Any]:
    """A property (F,) of the material of each face, given the materials of things; the default if there is none."""
    values = [read(material) if material else default for material in materials_of]
    return np.array(values)[faces.thing]
