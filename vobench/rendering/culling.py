"""Culling: which clusters of triangles can touch a part of a picture."""

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

RECENT = 32  # views whose clusters are known: what the light is computed for is drawn next
MARGIN_PX = 1  # samples lie up to half a pixel from the middle


@dataclass(frozen=True, slots=True)
class Clusters:
    """Faces that lie together and are culled together, batch by batch: boxes low_m, high_m (C, 3) in a mover's frame.

    first, count (C,): their part of the list of indices; batch, mover (C,); axis (C, 3), sine (C,): the mean direction
    that they face and how far from it they turn, 1 where they may be seen from anywhere.
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
    """All clusters of a scene."""

    def __init__(self, clusters: Clusters) -> None:
        self._clusters = clusters
        self._centre_m = (clusters.low_m + clusters.high_m) / 2
        size_m = clusters.high_m - clusters.low_m
        self._radius_m = np.linalg.norm(size_m, axis=1) / 2
        movers = np.unique(clusters.mover).tolist()
        self._of_movers = {mover: np.flatnonzero(clusters.mover == mover) for mover in movers}
        self._recent: OrderedDict[Hashable, TriangleRuns] = OrderedDict()

    def visible(self, view: PinholeView, box: Box) -> TriangleRuns:
        """By batch the runs (first, count) of indices that can touch a box of a picture; no others can."""
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
        clusters = self._clusters
        is_visible = np.zeros(len(clusters.batch), bool)
        world_planes = bounds(view, box)
        for mover, members in self._of_movers.items():
            T_world_mover = view.pose(mover)
            planes = world_planes @ T_world_mover
            normals = planes[:, :3]
            # The corner of each box that lies farthest along a plane's normal.
            upper = np.maximum(normals, 0) @ clusters.high_m[members].T
            lower = np.minimum(normals, 0) @ clusters.low_m[members].T
            reach = upper + lower
            eye_m = se3.apply(se3.inverse(T_world_mover), view.eye_m[None])[0]
            is_visible[members] = (reach + planes[:, 3:] > 0).all(0)
            is_visible[members] &= self._face_eye(eye_m, members)
        return self._runs(np.flatnonzero(is_visible))

    def _face_eye(self, eye_m: Array, members: Indices) -> Mask:
        """Which clusters (K,) have a face that may be seen from an eye (3,) in their frame."""
        from_eye_m = self._centre_m[members] - eye_m
        distance_m = np.linalg.norm(from_eye_m, axis=1)
        along_axis_m = np.einsum("ij,ij->i", from_eye_m, self._clusters.axis[members])
        nearest_m = along_axis_m - self._radius_m[members]
        limit_m = self._clusters.sine[members] * distance_m
        return np.asarray(nearest_m < limit_m + WELD_M)

    def _runs(self, members: Indices) -> TriangleRuns:
        """The indices of clusters (K,), those of neighbours joined."""
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
    """Planes (P, 4) of the world around all that a box shows, positive inside: four sides, near, and the mirror."""
    u0, u1, v0, v1 = box
    camera = view.camera
    left = 2 * (u0 - MARGIN_PX) / camera.width_px - 1
    right = 2 * (u1 + MARGIN_PX) / camera.width_px - 1
    top = 1 - 2 * (v0 - MARGIN_PX) / camera.height_px
    bottom = 1 - 2 * (v1 + MARGIN_PX) / camera.height_px
    x, y, nearness, w = view.view_projection
    sides = [x - left * w, right * w - x, y - bottom * w, top * w - y]
    planes = [*sides, w - nearness]
    if view.mirror is not None:
        planes.append(view.mirror.coefficients)
    return np.array(planes)
