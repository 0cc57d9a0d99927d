"""Moving bodies: the triangles that cast their shadows, and the light probes along them."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
import scipy

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Mask, Rows
from vobench.rendering.geometry import sphere_directions
from vobench.scene.scene import Mover
from vobench.scene.triangles import Triangles
from vobench.scene.weld import distinct_rows

HULL_DIRECTIONS = 20  # the number of directions in which the outermost vertex of a shape is found
HULL_FILLED = 1.4  # the ratio of the volumes of hull and shape above which the hull does not represent the shape
CELL = 1 / 24  # the size of a grid cell, relative to that of the shape, in which vertices are merged
SMALL = 1 / 32  # a thing casts no shadow if its size relative to that of the body is smaller
PROBES_M = 0.5  # the distance between the probes of a body
MOST_PROBES = 6  # the largest number of probes of a body


@dataclass(frozen=True, slots=True)
class MovingBody:
    """Movers with the same name: a single thing, or all limbs of a person.

    `movers` are the indices of the movers in the scene.
    `corners_m` (K, 3, 3) are the triangles that cast the body's shadow, each in the frame of its mover.
    `mover` (K,) is the index of each triangle's mover.
    `probes_m` (N, 3) are the positions of the light probes along the body, in the frame of its first mover.
    `part` (K,) is the index of the probe that is nearest to each triangle at the start.
    """

    movers: tuple[int, ...]
    corners_m: Array
    mover: Rows
    probes_m: Array
    part: Rows

    def placed(self, T_world_movers: Array) -> Array:
        """The triangles (K, 3, 3) in the world frame, given the poses (M, 4, 4) of all movers."""
        return _placed(self.corners_m, self.mover, T_world_movers)

    def probe_place(self, points_m: Array) -> Array:
        """The coordinate (P,) of points (P, 3) along the row of probes: 0 at the first probe, 1 at the second one.

        The points are given in the frame of the first mover.
        """
        return _place_among(self.probes_m, points_m)


def moving_bodies(scene_movers: Sequence[Mover], faces: Triangles, is_solid: Mask) -> list[MovingBody]:
    """The bodies that the movers of a scene form; consecutive movers with the same name are one body.

    `is_solid` (F,) selects the faces that can cast shadows. Movers without such faces form no body.
    """
    T_world_movers = np.array([mover.path.pose(0) for mover in scene_movers])
    result = []
    for _, members in groupby(range(len(scene_movers)), key=lambda index: scene_movers[index].name):
        movers = tuple(members)
        occluders_m = _occluders(movers, faces, is_solid)
        if occluders_m:
            result.append(_moving_body(movers, occluders_m, T_world_movers))
    return result


def _occluders(movers: Sequence[int], faces: Triangles, is_solid: Mask) -> list[tuple[int, Array]]:
    """The movers of a body, each with the `occluder` of one of its things. Small things are omitted."""
    body_rows = np.flatnonzero(is_solid & np.isin(faces.mover, movers))
    smallest_m = SMALL * _size_m(faces.corners_m[body_rows])
    result = []
    for mover in movers:
        rows = np.flatnonzero(is_solid & (faces.mover == mover))
        for thing in np.unique(faces.thing[rows]):
            thing_rows = rows[faces.thing[rows] == thing]
            corners_m = faces.corners_m[thing_rows]
            if _size_m(corners_m) >= smallest_m:
                result.append((mover, occluder(corners_m)))
    return result


def _moving_body(
    movers: tuple[int, ...], occluders_m: Sequence[tuple[int, Array]], T_world_movers: Array
) -> MovingBody:
    """The body of some movers, given their occluders, and the poses (M, 4, 4) of all movers at the start."""
    corners_m = np.concatenate([triangles_m for _, triangles_m in occluders_m])
    mover = np.concatenate([np.full(len(triangles_m), mover) for mover, triangles_m in occluders_m])

    T_first_world = se3.inverse(T_world_movers[movers[0]])
    world_m = _placed(corners_m, mover, T_world_movers)
    points_m = se3.apply(T_first_world, world_m.reshape(-1, 3))
    probes_m = _probes_m(points_m)
    middles_m = points_m.reshape(-1, 3, 3).mean(1)
    part = np.rint(_place_among(probes_m, middles_m)).astype(np.int64)
    return MovingBody(movers, corners_m, mover, probes_m, part)


def _placed(corners_m: Array, mover: Rows, T_world_movers: Array) -> Array:
    """Triangles (K, 3, 3) in the world frame, each given in the frame of its mover (K,)."""
    T_world_mover = T_world_movers[mover]
    rotated_m = np.einsum("kij,kcj->kci", T_world_mover[:, :3, :3], corners_m)
    return np.asarray(rotated_m + T_world_mover[:, None, :3, 3])


def _place_among(probes_m: Array, points_m: Array) -> Array:
    """The coordinate (P,) of points (P, 3) along a row of probes (N, 3), as in `MovingBody.probe_place`."""
    last = len(probes_m) - 1
    if last == 0:
        return np.zeros(len(points_m))
    axis_m = probes_m[-1] - probes_m[0]
    fraction = (points_m - probes_m[0]) @ axis_m / (axis_m @ axis_m)
    return np.asarray(last * np.clip(fraction, 0, 1))


def _size_m(corners_m: Array) -> float:
    """The longest side of the bounding box of faces (K, 3, 3); 0 without faces."""
    if not len(corners_m):
        return 0.0
    return float(np.ptp(corners_m.reshape(-1, 3), axis=0).max())


def _probes_m(points_m: Array) -> Array:
    """The positions (N, 3) of probes along the longest axis of the bounding box of points (P, 3)."""
    low_m = points_m.min(0)
    size_m = np.ptp(points_m, axis=0)
    longest = int(size_m.argmax())
    count = int(np.clip(np.ceil(size_m[longest] / PROBES_M), 1, MOST_PROBES))
    shares = np.full((count, 3), 0.5)
    shares[:, longest] = (np.arange(count) + 0.5) / count
    return np.asarray(low_m + shares * size_m)


def occluder(corners_m: Array) -> Array:
    """A few triangles (K, 3, 3) with nearly the same silhouettes as the faces (F, 3, 3) of a thing.

    They are the convex hull of the outermost vertices. If the hull is much larger than the shape, vertices that are
    close together are merged instead.
    """
    points_m = np.unique(corners_m.reshape(-1, 3), axis=0)
    along_directions_m = sphere_directions(HULL_DIRECTIONS) @ points_m.T
    outermost_m = points_m[np.unique(along_directions_m.argmax(1))]
    try:
        hull = scipy.spatial.ConvexHull(outermost_m)
    except (scipy.spatial.QhullError, ValueError):  # flat, or fewer than four points
        return _merged(corners_m)
    if hull.volume > HULL_FILLED * _volume_m3(corners_m):
        return _merged(corners_m)
    return np.asarray(outermost_m[hull.simplices])


def _volume_m3(corners_m: Array) -> float:
    """The volume within closed faces (F, 3, 3): the sum of the signed tetrahedra between the faces and the origin."""
    a, b, c = np.moveaxis(corners_m, 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def _merged(corners_m: Array) -> Array:
    """Triangles (K, 3, 3) with all vertices in a grid cell merged at their mean, without those that have no area."""
    points_m = corners_m.reshape(-1, 3)
    cell_m = max(float(np.ptp(points_m, axis=0).max()) * CELL, 1e-6)
    cell = distinct_rows(np.rint(points_m / cell_m).astype(np.int64)).inverse  # (3 F,)
    count = np.bincount(cell)
    sums_m = np.stack([np.bincount(cell, column) for column in points_m.T], -1)
    means_m = sums_m / count[:, None]
    merged_m = means_m[cell].reshape(-1, 3, 3)
    return np.asarray(merged_m[areas_m2(merged_m) > 0])
