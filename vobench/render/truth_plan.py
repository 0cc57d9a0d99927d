"""What can be said of whole tiles of a picture, so that rays are kept for those where it cannot."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.render.beams import Outlook, Tiles, balls, tiles
from vobench.render.bodies import Bodies, moved, turn
from vobench.render.geometry import Indices, Mask
from vobench.render.shadow import Lamp
from vobench.render.stand import Snapshot, Stand


@dataclass(frozen=True, slots=True)
class Plan:
    """A picture to tell the truth of, and what is known of its tiles (V, U) beforehand.

    sure: the one surface of a tile, -1 where rays must tell; glazed: panes may stand before it; visible: the next
    camera surely sees all of it, as far as its picture reaches; hidden: how many lights surely are from all of it;
    each lamp has the tiles where it is in doubt. All are while camera or movers move.
    """

    bodies: Bodies
    camera: Camera
    tiles: Tiles
    here: Stand
    there: Stand | None
    sure: Indices
    glazed: Mask
    visible: Mask
    hidden: NDArray[np.uint16]
    lamps: tuple[tuple[Lamp, Mask], ...]


def plan(bodies: Bodies, camera: Camera, here: Stand, there: Stand | None, lamps: Iterable[Lamp]) -> Plan:
    """What whole tiles show."""
    cones, snapshot = tiles(camera), here.snapshot
    parts, shape = (bodies, camera, cones, here, there), cones.sine.shape
    if snapshot is None:
        none, nothing, glass = np.full(shape, -1, np.int32), np.zeros(shape, bool), not bodies.opaque.all()
        doubts = tuple((lamp, ~nothing) for lamp in lamps)
        return Plan(*parts, none, np.full(shape, glass), nothing, np.zeros(shape, np.uint16), doubts)
    axis, sine = cones.axis.reshape(-1, 3), cones.sine.ravel()
    sure = Outlook(snapshot.corners_m, snapshot.facing & bodies.opaque).fills(axis, sine)
    glazed = Outlook(snapshot.corners_m, ~bodies.opaque).touches(axis, sine)
    patches = _Patches(sure, *balls(snapshot.planes[sure], axis, sine))
    visible = _visible(bodies, here, there, patches)
    hidden, doubted = np.zeros(len(sure), np.uint16), []
    for lamp in lamps:
        dark, doubt = _cast(bodies, here, snapshot, lamp, patches)
        hidden += dark
        doubted.append((lamp, doubt.reshape(shape)))
    known = sure.reshape(shape), glazed.reshape(shape), visible.reshape(shape), hidden.reshape(shape)
    return Plan(*parts, *known, tuple(doubted))


@dataclass(frozen=True, slots=True)
class _Patches:
    """What tiles show of their sure surfaces (T,), within balls: centres (T, 3) in the camera's frame, radii (T,)."""

    sure: Indices
    centers_m: Array
    radii_m: Array


def _visible(bodies: Bodies, here: Stand, there: Stand | None, patches: _Patches) -> Mask:
    if there is None or there.snapshot is None:
        return np.zeros(len(patches.sure), bool)
    T_there_here = np.stack(there.T_camera_bodies) @ np.stack(here.T_bodies_camera)
    body = np.append(bodies.of_surface, 0)[patches.sure]
    centers_m = moved(T_there_here[body], patches.centers_m)
    outlook = Outlook(there.snapshot.corners_m, there.snapshot.facing & bodies.opaque)
    facing = np.append(there.snapshot.facing, False)[patches.sure]
    return np.asarray(facing & outlook.shading(centers_m, patches.radii_m, patches.sure)[0])


def _cast(bodies: Bodies, here: Stand, snapshot: Snapshot, lamp: Lamp, patches: _Patches) -> tuple[Mask, Mask]:
    """Tiles (T,) that a lamp would light but for what stands before them, and those where that is not sure.

    Glass does not count, and a panel does not stand in its own light.
    """
    T_world_camera = here.T_bodies_camera[0]
    beacon_m, slack_m = lamp.beacon
    T_lamp_camera = se3.transform(np.eye(3), -beacon_m) @ T_world_camera
    others = np.array([surface is not lamp.panel for surface in bodies.surfaces])
    outlook = Outlook(se3.apply(T_lamp_camera, snapshot.corners_m), others & bodies.opaque)
    radii_m = patches.radii_m + slack_m
    clear, dark = outlook.shading(moved(T_lamp_camera, patches.centers_m), radii_m, patches.sure)
    normals = turn(T_world_camera, snapshot.planes)[patches.sure]  # longer than 1, which matters to no sign
    unlit, lit = lamp.reaches(moved(T_world_camera, patches.centers_m), radii_m, -normals)
    return dark & lit, (patches.sure < 0) | ~(clear | unlit | (dark & lit))
