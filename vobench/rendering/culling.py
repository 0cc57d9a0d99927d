"""Culling: which clusters of triangles may be visible in a box of a picture, by frusta and by normal cones."""

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Mask
from vobench.rendering.view import Box, PinholeView
from vobench.scene.weld import WELD_M

Indices = NDArray[np.int64]
TriangleRuns = dict[int, list[tuple[int, int]]]  # for each batch, runs (first, count) of its indices

RECENT = 32  # views whose result is cached, because the light is first computed for the views that are then drawn
MARGIN_PX = 1  # around a box; samples are up to half a pixel from the centre of their pixel


@dataclass(frozen=True, slots=True)
class Clusters:
    """Groups of neighbouring faces of one batch that are culled together, in the order of batches.

    low_m, high_m (C, 3): the bounding box in the frame of the mover. first, count (C,): the range of indices of its
    triangles. batch, mover (C,): the indices of these, -1 for no mover. axis (C, 3), sine (C,): the normal cone, as its
    axis and the sine of its half-angle; 1 where a cluster may be seen from all sides.
    """

    low_m: Array
    high_m: Array
    first: Indices
    count: Indices
    batch: Indices
    mover: Indices
    axis: Array
    sine: Array


class CullingSet:
    """All clusters of a scene, in whose frames views are tested. Recent results are cached."""

    def __init__(self, clusters: Clusters) -> None:
        self._clusters = clusters
        self._centre_m = (clusters.low_m + clusters.high_m) / 2
        size_m = clusters.high_m - clusters.low_m
        self._radius_m = np.linalg.norm(size_m, axis=1) / 2
        movers = np.unique(clusters.mover).tolist()
        self._of_movers = {mover: np.flatnonzero(clusters.mover == mover) for mover in movers}
        self._recent: OrderedDict[Hashable, TriangleRuns] = OrderedDict()

    def visible(self, view: PinholeView, box: Box) -> TriangleRuns:
        """The triangles that may be visible in a box of a picture, as runs (first, count) of indices for each batch."""
        poses = np.array(view.T_world_movers).tobytes()
        mirror = view.mirror.key if view.mirror else ()
        key = (view.view_projection.tobytes(), view.eye_m.tobytes(), poses, mirror, view.camera, box)
        if key not in self._recent:
            self._recent[key] = self._visible(view, box)
        self._recent.move_to_end(key)
        if len(self._recent) > RECENT:
            self._recent.popitem(last=False)
        return self._recent[key]

    def _visible(self, view: PinholeView, box: Box) -> TriangleRuns:
        """As `visible`, without the cache."""
        clusters = self._clusters
        is_visible = np.zeros(len(clusters.batch), bool)
        world_planes = bounds(view, box)
        for mover, members in self._of_movers.items():
            T_world_mover = view.pose(mover)
            planes = world_planes @ T_world_mover
            normals = planes[:, :3]
            # A box is inside a plane if its corner that is farthest along the normal is.
            by_upper_corner = np.maximum(normals, 0) @ clusters.high_m[members].T
            by_lower_corner = np.minimum(normals, 0) @ clusters.low_m[members].T
            farthest = by_upper_corner + by_lower_corner + planes[:, 3:]  # (P, K)
            is_inside = (farthest > 0).all(0)
            eye_m = se3.apply(se3.inverse(T_world_mover), view.eye_m[None])[0]
            is_visible[members] = is_inside & self._may_face_eye(eye_m, members)
        return self._runs(np.flatnonzero(is_visible))

    def _may_face_eye(self, eye_m: Array, members: Indices) -> Mask:
        """Which clusters (K,) may have a face whose front is seen from an eye (3,) in their frame, by normal cones."""
        from_eye_m = self._centre_m[members] - eye_m
        distance_m = np.linalg.norm(from_eye_m, axis=1)
        along_axis_m = np.einsum("ij,ij->i", from_eye_m, self._clusters.axis[members])
        least_along_m = along_axis_m - self._radius_m[members]
        limit_m = self._clusters.sine[members] * distance_m
        return np.asarray(least_along_m < limit_m + WELD_M)

    def _runs(self, members: Indices) -> TriangleRuns:
        """The index runs of clusters (K,), with adjacent ones of a batch joined."""
        clusters = self._clusters
        batch = clusters.batch[members]
        is_apart = np.diff(members, prepend=-2) != 1
        is_other_batch = np.diff(batch, prepend=-1) != 0
        begins = np.flatnonzero(is_apart | is_other_batch)
        if not len(begins):
            return {}
        first = clusters.first[members[begins]]
        count = np.add.reduceat(clusters.count[members], begins)
        runs: TriangleRuns = {}
        batches = batch[begins].tolist()
        for index, *run in zip(batches, first.tolist(), count.tolist(), strict=True):
            runs.setdefault(index, []).append((run[0], run[1]))
        return runs


def bounds(view: PinholeView, box: Box) -> Array:
    """The planes (P, 4) in the world that bound what a box shows, positive inside: four sides, near, and the mirror."""
    u0, u1, v0, v1 = box
    camera = view.camera
    left = 2 * (u0 - MARGIN_PX) / camera.width_px - 1
    right = 2 * (u1 + MARGIN_PX) / camera.width_px - 1
    top = 1 - 2 * (v0 - MARGIN_PX) / camera.height_px
    bottom = 1 - 2 * (v1 + MARGIN_PX) / camera.height_px
    # Rows of the projection matrix (Gribb and Hartmann, 2001).
    x, y, depth, w = view.view_projection
    sides = [x - left * w, right * w - x, y - bottom * w, top * w - y]
    planes = [*sides, w - depth]
    if view.mirror is not None:
        planes.append(view.mirror.coefficients)
    return np.array(planes)
