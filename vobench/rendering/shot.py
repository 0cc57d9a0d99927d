"""The poses of the camera and of movers while a picture is taken, also row by row for a rolling shutter."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Pixels
from vobench.rendering.compiled import compiled
from vobench.scene.scene import Mover


@dataclass(frozen=True, slots=True)
class CameraShot:
    """The pose (4, 4) and the instant of a camera's picture, or the poses (H, 4, 4) and instants (H,) of its rows."""

    T_world_camera: Array
    t_ns: NDArray[np.int64] | int


@dataclass(frozen=True, slots=True)
class ShotTransforms:
    """A shot as transforms, there and back: each body's (4, 4), or (H, 4, 4) by row; body 0 is all that stands."""

    T_world_bodies: list[Array]
    T_bodies_world: list[Array]
    T_bodies_camera: list[Array]
    T_camera_bodies: list[Array]

    @property
    def by_row(self) -> bool:
        """Whether the camera or a body moves while the rows are exposed."""
        return any(T.ndim == 3 for T in self.T_bodies_camera)


def shot_transforms(movers: Sequence[Mover], shot: CameraShot) -> ShotTransforms:
    """The transforms of a shot of a scene with these movers."""
    T_world_bodies = _poses(movers, np.asarray(shot.t_ns, np.int64))
    T_bodies_world = [se3.inverse(T) for T in T_world_bodies]
    T_bodies_camera = [T @ shot.T_world_camera for T in T_bodies_world]
    T_camera_bodies = [se3.inverse(T) for T in T_bodies_camera]
    return ShotTransforms(T_world_bodies, T_bodies_world, T_bodies_camera, T_camera_bodies)


def _poses(
    movers: Sequence[Mover],
    t_ns: NDArray[np.int64],
) -> list[Array]:
    """The poses of the bodies at an instant () or at several (H,): (4, 4) each, or (H, 4, 4) for a body that moves."""
    T_world_bodies: list[Array] = [np.eye(4)]
    for mover in movers:
        T_world_body = np.array([mover.path.pose(t) for t in np.ravel(t_ns).tolist()])
        T_world_bodies.append(T_world_body if np.ndim(t_ns) else T_world_body[0])
    return T_world_bodies


class RowTransforms(Sequence[Array]):
    """The transforms of each table for rays on rows (R,): (4, 4) as it is, (H, 4, 4) as (R, 4, 4).

    They are computed when they are asked for: with hundreds of moving leaves they would not fit into memory.
    """

    def __init__(self, tables: Sequence[Array], rows: Array) -> None:
        self._tables = tables
        self._rows = rows
        self._first: Array | None = None  # that of body 0, which is asked for most often

    def __len__(self) -> int:
        return len(self._tables)

    @overload
    def __getitem__(self, index: int) -> Array: ...
    @overload
    def __getitem__(self, index: slice) -> "RowTransforms": ...
    def __getitem__(self, index: int | slice) -> "Array | RowTransforms":
        if isinstance(index, slice):
            return RowTransforms(self._tables[index], self._rows)
        table = self._tables[index]
        if table.ndim == 2:
            return table
        if index != 0:
            return _between(table, self._rows)
        if self._first is None:
            self._first = _between(table, self._rows)
        return self._first

    def of_rays(self, rays: Pixels) -> "RowTransforms":
        """The transforms for some of the rays."""
        return RowTransforms(self._tables, self._rows[rays])

    def spanned(self, index: int) -> Array:
        """The transforms (K, 4, 4) of a table at all of its rows on or between which rays are; one for (4, 4)."""
        table = self._tables[index]
        if table.ndim == 2:
            return table[None]
        place = np.clip(np.nan_to_num(self._rows), 0, len(table) - 1)
        first = math.floor(place.min(initial=len(table) - 1))
        last = math.ceil(place.max(initial=0))
        return table[first : last + 1]


def spanned(transforms: Sequence[Array], index: int) -> Array:
    """Transforms (K, 4, 4) of a body between which those of all rays are, without one for each ray where possible."""
    if isinstance(transforms, RowTransforms):
        return transforms.spanned(index)
    return transforms[index].reshape(-1, 4, 4)


def at_rows(tables: Sequence[Array], rows: Array) -> RowTransforms:
    """The transforms of each table for rays on rows (R,)."""
    return RowTransforms(tables, rows)


def _between(table: Array, rows: Array) -> Array:
    """Transforms (R, 4, 4) at rows between those of a table (H, 4, 4); beyond its ends the last ones.

    Two rows differ by so little that a straight line between matrices is a rotation to the last bits.
    """
    place = np.clip(np.nan_to_num(rows), 0, len(table) - 1)
    first = np.minimum(place.astype(np.int64), max(len(table) - 2, 0))
    share = (place - first)[:, None, None]
    if not share.any():
        return table[first]
    second = np.minimum(first + 1, len(table) - 1)
    return np.asarray((1 - share) * table[first] + share * table[second])


def of_rays(T: Array, rays: Pixels) -> Array:
    """The transforms of some rays: the only one (4, 4), or those rows of (R, 4, 4)."""
    return T if T.ndim == 2 else T[rays]


def rays_in(T_body_camera: Array, directions: Array) -> tuple[Array, Array]:
    """Rays from a camera's centre along unit directions (R, 3): origins (R, 3) and directions in a body's frame."""
    turned = turn(T_body_camera, directions)
    return np.broadcast_to(T_body_camera[..., :3, 3], turned.shape), turned


def turn(T_a_b: Array, vectors: Array) -> Array:
    """Directions (R, 3) in b as directions in a."""
    rotations = T_a_b[..., :3, :3].reshape(-1, 3, 3)
    turned = np.empty((len(vectors), 3))
    _turn_rows(rotations, vectors, turned)
    return turned


@compiled
def _turn_rows(rotations: Array, vectors: Array, turned: Array) -> None:
    """Turn vectors (R, 3) by rotations (R, 3, 3), or all by one (1, 3, 3)."""
    for row in range(len(vectors)):
        rotation = rotations[0] if len(rotations) == 1 else rotations[row]
        x = vectors[row, 0]
        y = vectors[row, 1]
        z = vectors[row, 2]
        for axis in range(3):
            turned[row, axis] = rotation[axis, 0] * x + rotation[axis, 1] * y + rotation[axis, 2] * z


def moved(T_a_b: Array, points: Array) -> Array:
    """Points (R, 3) in b as points in a."""
    return turn(T_a_b, points) + T_a_b[..., :3, 3]
