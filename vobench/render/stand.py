"""Where a camera stands among a scene's bodies while it takes a picture, row by row where its shutter rolls."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.render.bodies import Bodies
from vobench.render.geometry import Mask


@dataclass(frozen=True, slots=True)
class Shot:
    """Where a camera stands and when it takes a picture: a pose (4, 4) and an instant, or (H, 4, 4) and (H,) by row."""

    T_world_camera: Array
    t_ns: NDArray[np.int64] | int


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All surfaces from a camera at one instant: corners (S, 4, 3) in its frame, planes (S + 1, 3), what it faces (S,).

    A plane's product with a unit ray is one over the distance along that ray.
    """

    corners_m: Array
    planes: Array
    facing: Mask


@dataclass(frozen=True, slots=True)
class Stand:
    """A shot as transforms, there and back: each body's (4, 4), or (H, 4, 4) by row.

    `snapshot` is None where the camera or a body moves meanwhile.
    """

    T_world_bodies: list[Array]
    T_bodies_world: list[Array]
    T_bodies_camera: list[Array]
    T_camera_bodies: list[Array]
    snapshot: Snapshot | None


def stand(bodies: Bodies, shot: Shot) -> Stand:
    """The transforms of a shot."""
    T_world_bodies = bodies.T_world_bodies(np.asarray(shot.t_ns, np.int64))
    T_bodies_world = [se3.inverse(T) for T in T_world_bodies]
    T_bodies_camera = [T @ shot.T_world_camera for T in T_bodies_world]
    T_camera_bodies = [se3.inverse(T) for T in T_bodies_camera]
    rolling = any(T.ndim == 3 for T in T_bodies_camera)
    snapshot = None if rolling else _snapshot(bodies, np.stack(T_camera_bodies))
    return Stand(T_world_bodies, T_bodies_world, T_bodies_camera, T_camera_bodies, snapshot)


def _snapshot(bodies: Bodies, T_camera_bodies: Array) -> Snapshot:
    T_camera_surfaces = T_camera_bodies[bodies.of_surface]
    corners_m = se3.apply(T_camera_surfaces, bodies.corners_m)
    normals = np.einsum("sij,sj->si", T_camera_surfaces[:, :3, :3], bodies.normals[:-1])
    away_m = np.einsum("si,si->s", normals, corners_m[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):  # a plane through the camera is seen edge-on: never
        planes = normals / away_m[:, None]
    return Snapshot(corners_m, np.append(planes, np.full((1, 3), np.nan), axis=0), away_m < 0)


def at_rows(tables: Sequence[Array], rows: Array) -> list[Array]:
    """The transforms of each table for rays on rows (R,): (4, 4) as it is, (H, 4, 4) as (R, 4, 4)."""
    return [_between(T, rows) if T.ndim == 3 else T for T in tables]


def _between(table: Array, rows: Array) -> Array:
    """Transforms (R, 4, 4) at rows between those of a table (H, 4, 4); beyond its ends the last ones.

    Two rows differ by so little that a straight line between matrices is a rotation to the last bits.
    """
    place = np.clip(np.nan_to_num(rows), 0, len(table) - 1)
    first = np.minimum(place.astype(np.int64), max(len(table) - 2, 0))
    share = (place - first)[:, None, None]
    if not share.any():
        return table[first]
    blend: Array = (1 - share) * table[first] + share * table[np.minimum(first + 1, len(table) - 1)]
    return blend


def of(T: Array, rays: NDArray[np.intp]) -> Array:
    """Some rays' transforms: the only one, or their own of (R, 4, 4)."""
    return T if T.ndim == 2 else T[rays]
