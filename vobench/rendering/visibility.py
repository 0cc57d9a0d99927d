"""The transmittance between two points of a scene: opaque faces block light, and panes attenuate it."""

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

MOST_PANES = 16  # the largest number of panes whose transmittance is evaluated along a ray
WIDE_M2 = 0.05  # the smallest area of a mirror that shows lamps, and of a pane that shows the sky
BOX_MARGIN_M = 0.01  # the margin by which the boxes around panes are enlarged
MOST_BOXES = 48  # if there are more boxes around panes, one box around all of them is used instead
SKY_PROBES = 512  # the number of rays to each side of a pane that test whether the sky is visible through it


class Visibility:
    """Queries of visibility along rays, for the static faces at the rows `among` (K,) of a table of triangles.

    Opaque faces block light, and panes attenuate it. Faces with cut-outs are treated as if they had none.

    `faces` is the table of triangles (F,).
    `normals` (F + 1, 3) are the unit normals of the faces. The last row is zero, and stands for no face.
    `opaque` casts rays at the opaque faces among the rows.
    `is_pane` (F,) is whether a face is a pane among the rows.
    `is_static` (F,) is whether a face is among the rows.
    `mirrors` are the smooth, flat mirrors. Each has its tint, and a ray caster for its faces.
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
        no_normal = np.zeros((1, 3))
        self.normals = np.append(faces.plane, no_normal, axis=0).astype(np.float32)
        self._eta = _by_face(faces, materials_of, lambda material: material.eta, 1.0)
        self._tint = tint.astype(np.float32)
        self.opaque = RayCaster(faces, rows[~is_pane])
        self._panes = RayCaster(faces, rows[is_pane])
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
        """The mirrors that show sharp images of lamps, each with its tint and a ray caster for its faces.

        Coats are omitted, because they reflect little light.
        """
        mirrors = []
        for patch in planar_patches(self.faces, rows, at_least_m2=WIDE_M2):
            tint = float(self._tint[patch.faces[0]])
            caster = RayCaster(self.faces, patch.faces)
            mirrors.append((patch, tint, caster))
        return mirrors

    def _panes_before_sky(self, rows: Indices) -> list[PlanarPatch]:
        """The panes through which the sky is visible, one side of each. These panes are treated as lamps."""
        panes = list[PlanarPatch]()
        for pane in planar_patches(self.faces, rows, at_least_m2=WIDE_M2):
            is_other_side = any(pane.coincides(other) for other in panes)
            if not is_other_side and any(self.sky_sides(pane)):
                panes.append(pane)
        return panes

    def transmittance(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """The transmittance (R,) between origins (R, 3) and the points at origins + segments (R, 3).

        It is 0 where an opaque face is in between, and otherwise the product of the transmittances of all panes.
        """
        transmittance = self.is_unoccluded(origins_m, segments_m).astype(np.float32)
        if self._has_panes:
            near_panes = self._near_panes(origins_m, segments_m)
            rays = near_panes[transmittance[near_panes] > 0]
            transmittance[rays] = self.transmittance_of_panes(origins_m[rays], segments_m[rays])
        return transmittance

    def _near_panes(self, origins_m: Floats, segments_m: Floats) -> Rows:
        """The indices of the rays from origins (R, 3) along segments (R, 3) that meet the box around a pane.

        All other rays cross no pane.
        """
        is_near = np.empty(len(origins_m), bool)
        origins = np.ascontiguousarray(origins_m, np.float32)
        segments = np.ascontiguousarray(segments_m, np.float32)
        meet_boxes(origins, segments, self._around_panes, self._pane_boxes, is_near)
        return np.flatnonzero(is_near)

    def is_unoccluded(self, origins_m: Floats, segments_m: Floats) -> Mask:
        """Whether no opaque face (R,) is between origins (R, 3) and origins + segments (R, 3)."""
        return ~self.opaque.stops(origins_m, segments_m)

    def pane_transmittance(self, pane: PlanarPatch, directions: Floats) -> Floats:
        """The transmittance (R,) of a pane for light along unit directions (R, 3)."""
        face = pane.faces[0]
        cosine = directions @ pane.normal
        reflectance = pane_reflectance(cosine, float(self._eta[face]))
        return np.asarray(self._tint[face] * (1 - reflectance))

    def crosses_sky_pane(self, origins_m: Floats, segments_m: Floats) -> Mask:
        """Whether a pane that shows the sky (R,) is between origins (R, 3) and origins + segments (R, 3)."""
        if not self.sky_panes:
            return np.zeros(len(origins_m), bool)
        return self._sky_panes.stops(origins_m, segments_m)

    def first_panes(self, origins_m: Floats, directions: Floats, reach_m: Floats) -> tuple[Rows, Hits]:
        """The rays that cross a pane within their reach, and where they meet the first one.

        `origins_m` (R, 3) and `directions` (R, 3) are the origins and the directions of the rays.
        `reach_m` (R,) is the length of each ray, in lengths of its direction.

        Returns the indices (K,) of the rays that cross a pane, and their hits (K,). The distances of the hits are in
        lengths of the directions, too.
        """
        if not self._has_panes:
            no_rays = np.zeros(0, np.int64)
            no_faces = np.zeros(0, np.int32)
            no_values = np.zeros(0, np.float32)
            return no_rays, Hits(no_faces, no_values, no_values, no_values)
        near = self._near_panes(origins_m, directions * reach_m[:, None])
        hits = self._panes.one_sided_hits(origins_m[near], directions[near], SHORT_OF_END * reach_m[near])
        crossing = np.flatnonzero(hits.face >= 0)
        rays = near[crossing]
        first_hits = self._panes.facing(hits.take(crossing), directions[rays])
        return rays, first_hits

    def pane_reflectance(self, panes: Indices, cosine: Floats) -> Floats:
        """The reflectance (R,) of panes at cosines of incidence (R,), given a face (R,) of each pane."""
        return pane_reflectance(cosine, self._eta[panes]).astype(np.float32)

    def transmittance_of_panes(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """The transmittance (R,) of all panes between origins (R, 3) and origins + segments (R, 3).

        Opaque faces are ignored.
        """
        transmittance = np.ones(len(origins_m), np.float32)
        if not self._has_panes:
            return transmittance
        near = self._near_panes(origins_m, segments_m)
        rays = near[self._panes.stops(origins_m[near], segments_m[near])]
        first_hits = self._panes.hits(origins_m[rays], segments_m[rays])
        transmittance[rays] = self.transmittance_of_crossed_panes(origins_m[rays], segments_m[rays], first_hits)
        return transmittance

    def transmittance_of_crossed_panes(self, origins_m: Floats, segments_m: Floats, first_hits: Hits) -> Floats:
        """As `transmittance_of_panes`, for rays whose hits of the first panes (R,) are known.

        The distances of `first_hits` are in lengths of the segments.
        """
        transmittance = np.ones(len(origins_m), np.float32)
        hits = first_hits
        rays = np.arange(len(origins_m))
        rest_m = segments_m
        travelled = np.zeros(len(rays), np.float32)  # the fraction of its segment that each ray has travelled
        for _ in range(MOST_PANES):
            # A ray that meets no further pane is complete.
            meets_pane = (hits.face >= 0) & (hits.distance < 1)
            crossing = np.flatnonzero(meets_pane)
            rays = rays[crossing]
            pane = hits.face[crossing]
            rest_m = rest_m[crossing]
            travelled = travelled[crossing]

            length_m = lengths(rest_m)
            along_normal_m = np.einsum("ij,ij->i", rest_m, self.normals[pane])
            cosine = along_normal_m / length_m
            reflectance = pane_reflectance(cosine, self._eta[pane])
            transmittance[rays] *= self._tint[pane] * (1 - reflectance).astype(np.float32)

            # The ray continues slightly behind the pane.
            step = hits.distance[crossing] + RAY_OFFSET_M / length_m
            travelled = (travelled + (1 - travelled) * step).astype(np.float32)
            if not len(rays):
                break
            rest_m = segments_m[rays] * (1 - travelled)[:, None]
            start_m = origins_m[rays] + segments_m[rays] * travelled[:, None]
            hits = self._panes.hits(start_m, rest_m)
        return transmittance

    def sky_sides(self, pane: PlanarPatch) -> tuple[bool, bool]:
        """Whether the sky is visible from a pane, first on the side of its normal, then on the other side.

        SKY_PROBES cosine-weighted rays start at random points on each side. It is enough that one of them leaves the
        scene without meeting an opaque face or a pane.
        """
        a, b, squared_radius, turns = np.random.default_rng(0).random((4, SKY_PROBES))
        u_axis = unit(pane.corners_m[0, 1] - pane.corners_m[0, 0])
        v_axis = np.cross(pane.normal, u_axis)
        radius = np.sqrt(squared_radius)[:, None]
        angle_rad = 2 * np.pi * turns[:, None]
        in_plane = radius * (np.cos(angle_rad) * u_axis + np.sin(angle_rad) * v_axis)
        along_normal = np.sqrt(1 - radius**2) * pane.normal
        directions = np.concatenate([in_plane + along_normal, in_plane - along_normal])

        points_m = np.tile(sample_points(pane.corners_m, a, b), (2, 1))
        origins_m = points_m + RAY_OFFSET_M * directions
        segments_m = FAR_M * directions
        meets_opaque = self.opaque.stops(origins_m, segments_m)
        meets_pane = self._panes.stops(origins_m, segments_m)
        is_clear = ~(meets_opaque | meets_pane)
        return bool(is_clear[:SKY_PROBES].any()), bool(is_clear[SKY_PROBES:].any())


def _boxes(faces: Triangles, rows: Indices) -> Floats:
    """Slightly enlarged boxes (K, 2, 3) float32 around the panes at `rows`, each as its lowest and its highest corner.

    There is one box for each plane of each thing. If there are too many, there is a single box around all of them.
    """
    lowest_and_highest_m = []
    for patch in planar_patches(faces, rows):
        lowest_m = patch.corners_m.min((0, 1))
        highest_m = patch.corners_m.max((0, 1))
        lowest_and_highest_m.append([lowest_m, highest_m])
    boxes_m = np.array(lowest_and_highest_m).reshape(-1, 2, 3)
    boxes_m[:, 0] -= BOX_MARGIN_M
    boxes_m[:, 1] += BOX_MARGIN_M
    rounded_m = np.round(boxes_m, 3).reshape(-1, 6)
    boxes_m = np.unique(rounded_m, axis=0).reshape(-1, 2, 3)
    if len(boxes_m) > MOST_BOXES:
        boxes_m = _around(boxes_m)[None]
    return boxes_m.astype(np.float32)


def _around(boxes_m: Floats) -> Floats:
    """The box (2, 3) around boxes (K, 2, 3). If there are no boxes, it is a point that no segment meets."""
    if not len(boxes_m):
        return np.full((2, 3), FAR_M, np.float32)
    lowest_m = boxes_m[:, 0].min(0)
    highest_m = boxes_m[:, 1].max(0)
    return np.stack([lowest_m, highest_m])


def _by_face(
    faces: Triangles,
    materials_of: Sequence[Material | None],
    read: Callable[[Material], Any],
    default: Any,
) -> NDArray[Any]:
    """A property (F,) of the material of each face.

    `materials_of` are the materials of the things, None for a thing without a material.
    `read` returns the property of a material.
    `default` is the value for faces without a material.
    """
    value_of_thing = [read(material) if material else default for material in materials_of]
    return np.array(value_of_thing)[faces.thing]
