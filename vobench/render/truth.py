"""Exact ground truth of a picture by rays through its pixels' centres."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.render.emitter import FARTHEST_M
from vobench.render.geometry import RAY_OFFSET_M, Indices, Mask
from vobench.render.occlusion import (
    TILE_PX,
    Bodies,
    PointView,
    Scalar,
    Shot,
    ShotSurfaces,
    ShotTransforms,
    Tiles,
    at_rows,
    balls,
    moved,
    of,
    shot_transforms,
    spread,
    tiles,
    turn,
)
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import Matt, Mirror, Polished
from vobench.scene.scene import Scene
from vobench.scene.surface import Surface
from vobench.sensor.pixel_truth import CHANNELS, TruthFrame, TruthNames, check_channels

# From there the sun's rays would fall this far beside where they do, within 30 m around the origin.
NEAR_POINT_M, NEAR_POINT_SLACK_M = 3e4, 0.03


@dataclass(frozen=True, slots=True)
class Lamp:
    """A light that is on, and its middle (3,)."""

    light: Light
    center_m: Array

    @property
    def near_point(self) -> tuple[Array, float]:
        """A point (3,) not too far for float32, and how much farther than from it light may strike, in metres."""
        if isinstance(self.light, Sun):
            return self.center_m * (NEAR_POINT_M / FARTHEST_M), NEAR_POINT_SLACK_M
        return self.center_m, 0.0

    @property
    def panel(self) -> Surface | None:
        """The rectangle that shines, which does not shade itself."""
        return self.light.surface if isinstance(self.light, AreaLight) else None

    def reaches(self, centers_m: Array, radii_m: Array, normals: Array) -> tuple[Mask, Mask]:
        """Flat things in balls (R, 3), (R,) that it surely does not shine on, and that it surely shines on all of."""
        way = centers_m - self.center_m
        facing = np.asarray(np.einsum("ri,ri->r", way, normals) < 0)
        if isinstance(self.light, AreaLight):
            before_m = way @ self.light.surface.normal
            return ~facing | (before_m <= -radii_m), facing & (before_m > radii_m)
        if isinstance(self.light, SpotLight):
            reach_m = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
            aside_rad = np.arccos(np.clip(way @ self.light.direction / reach_m, -1, 1))
            half_rad = np.arcsin(np.clip(radii_m / reach_m, 0, 1))
            outer_rad = np.deg2rad(self.light.outer_deg)
            return ~facing | (aside_rad - half_rad >= outer_rad), facing & (aside_rad + half_rad < outer_rad)
        return ~facing, facing

    def hidden(self, bodies: Bodies, points_m: Array, normals: Array, T_bodies_world: Sequence[Array]) -> Mask:
        """Whether something is between the light and places (R, 3) that it would shine on."""
        _, hidden = self.reaches(points_m, np.zeros(len(points_m)), normals)
        lit = np.flatnonzero(hidden)
        starts = points_m[lit] + RAY_OFFSET_M * normals[lit]
        to_bodies = [T if T.ndim == 2 else T[lit] for T in T_bodies_world]
        hidden[lit] = bodies.blocked(starts, np.broadcast_to(self.center_m, starts.shape), to_bodies)
        return hidden


def lamps(scene: Scene, t_ns: int) -> Iterator[Lamp]:
    """The lights that are on at an instant, but for the sky, which has no middle."""
    for light in scene.lights:
        if not isinstance(light, Sky) and light.level.mean(t_ns, t_ns) > 0:
            yield Lamp(light, _center(light, t_ns))


def _center(light: AreaLight | PointLight | SpotLight | Sun, t_ns: int) -> Array:
    if isinstance(light, Sun):
        return FARTHEST_M * light.direction(t_ns)
    if isinstance(light, AreaLight):
        return light.surface.at(np.array(0.5), np.array(0.5))
    return light.position_m


@dataclass(frozen=True, slots=True)
class TilePlan:
    """A picture to tell the truth of, and what is known of its tiles (V, U) beforehand.

    sure: the one surface of a tile, -1 where rays must tell; glazed: panes may be before it; visible: the next
    camera surely sees all of it, as far as its picture reaches; hidden: how many lights surely are from all of it;
    each lamp has the tiles where it is in doubt. All are while camera or movers move.
    """

    bodies: Bodies
    camera: Camera
    tiles: Tiles
    here: ShotTransforms
    there: ShotTransforms | None
    sure: Indices
    glazed: Mask
    visible: Mask
    hidden: NDArray[np.uint16]
    lamps: tuple[tuple[Lamp, Mask], ...]


def tile_plan(
    bodies: Bodies, camera: Camera, here: ShotTransforms, there: ShotTransforms | None, lamps: Iterable[Lamp]
) -> TilePlan:
    """What whole tiles show."""
    cones, snapshot = tiles(camera), here.snapshot
    parts, shape = (bodies, camera, cones, here, there), cones.sine.shape
    if snapshot is None:
        none, nothing, glass = np.full(shape, -1, np.int32), np.zeros(shape, bool), not bodies.opaque.all()
        doubts = tuple((lamp, ~nothing) for lamp in lamps)
        return TilePlan(*parts, none, np.full(shape, glass), nothing, np.zeros(shape, np.uint16), doubts)
    axis, sine = cones.axis.reshape(-1, 3), cones.sine.ravel()
    sure = PointView(snapshot.corners_m, snapshot.facing & bodies.opaque).fills(axis, sine)
    glazed = PointView(snapshot.corners_m, ~bodies.opaque).touches(axis, sine)
    patches = _Patches(sure, *balls(snapshot.planes[sure], axis, sine))
    visible = _visible(bodies, here, there, patches)
    hidden, doubted = np.zeros(len(sure), np.uint16), []
    for lamp in lamps:
        dark, doubt = _cast(bodies, here, snapshot, lamp, patches)
        hidden += dark
        doubted.append((lamp, doubt.reshape(shape)))
    known = sure.reshape(shape), glazed.reshape(shape), visible.reshape(shape), hidden.reshape(shape)
    return TilePlan(*parts, *known, tuple(doubted))


@dataclass(frozen=True, slots=True)
class _Patches:
    """What tiles show of their sure surfaces (T,), within balls: centres (T, 3) in the camera's frame, radii (T,)."""

    sure: Indices
    centers_m: Array
    radii_m: Array


def _visible(bodies: Bodies, here: ShotTransforms, there: ShotTransforms | None, patches: _Patches) -> Mask:
    if there is None or there.snapshot is None:
        return np.zeros(len(patches.sure), bool)
    T_there_here = np.stack(there.T_camera_bodies) @ np.stack(here.T_bodies_camera)
    body = np.append(bodies.of_surface, 0)[patches.sure]
    centers_m = moved(T_there_here[body], patches.centers_m)
    point_view = PointView(there.snapshot.corners_m, there.snapshot.facing & bodies.opaque)
    facing = np.append(there.snapshot.facing, False)[patches.sure]
    return np.asarray(facing & point_view.shading(centers_m, patches.radii_m, patches.sure)[0])


def _cast(
    bodies: Bodies, here: ShotTransforms, snapshot: ShotSurfaces, lamp: Lamp, patches: _Patches
) -> tuple[Mask, Mask]:
    """Tiles (T,) that a lamp would light but for what is before them, and those where that is not sure.

    Glass does not count, and a panel does not shade itself.
    """
    T_world_camera = here.T_bodies_camera[0]
    near_point_m, slack_m = lamp.near_point
    T_lamp_camera = se3.transform(np.eye(3), -near_point_m) @ T_world_camera
    others = np.array([surface is not lamp.panel for surface in bodies.surfaces])
    point_view = PointView(se3.apply(T_lamp_camera, snapshot.corners_m), others & bodies.opaque)
    radii_m = patches.radii_m + slack_m
    clear, dark = point_view.shading(moved(T_lamp_camera, patches.centers_m), radii_m, patches.sure)
    normals = turn(T_world_camera, snapshot.planes)[patches.sure]  # longer than 1, which matters to no sign
    unlit, lit = lamp.reaches(moved(T_world_camera, patches.centers_m), radii_m, -normals)
    return dark & lit, (patches.sure < 0) | ~(clear | unlit | (dark & lit))


Values = dict[str, NDArray[np.generic]]
Pixels = NDArray[np.intp]

# With a rolling shutter the row that sees a point next is found by iteration, to this or in so many rounds.
CONVERGED_PX, MOST_ROUNDS = 1e-5, 20
# A point is seen where the ray ends no more than this share of the way before it.
DEPTH_TOLERANCE = 1e-4


@dataclass(frozen=True, slots=True)
class SurfaceIds:
    """Of each surface, the last one none (S + 1,): ids, whether it mirrors, whether it shows what light falls on it."""

    instance: NDArray[np.uint16]
    material: NDArray[np.uint16]
    mirrors: Mask
    matt: Mask


class Band:
    """Rows of a picture that begin with a tile's first: R pixels in T tiles."""

    def __init__(self, plan: TilePlan, ids: SurfaceIds, rows: slice) -> None:
        self._plan, self._bodies, self._ids_of = plan, plan.bodies, ids
        self._shape = (rows.stop - rows.start, plan.camera.width_px)
        self._rays = plan.tiles.rays[rows].reshape(-1, 3)
        self._uv_px = plan.tiles.uv_px[rows].reshape(-1, 2)
        self._tiles = slice(rows.start // TILE_PX, -(-rows.stop // TILE_PX))
        self._T_bodies_camera = at_rows(plan.here.T_bodies_camera, self._uv_px[:, 1])
        self._surface, self._distance_m = self._visible_surfaces()
        self._points_m = self._distance_m[:, None] * self._rays
        movers = np.append(self._bodies.of_surface, 0)[self._surface] if len(self._T_bodies_camera) > 1 else None
        self._body = movers if movers is not None and movers.any() else None

    def values(self, names: Sequence[str]) -> Values:
        """The channels asked for, (R,) or (R, n)."""
        found: Values = {}
        if "flow" in names or "occlusion" in names:
            found["flow"], found["occlusion"] = self._flow()
        along_axis, T_camera_bodies = self._plan.camera.depth_along == "axis", self._plan.here.T_camera_bodies
        rows, pixels = self._uv_px[:, 1], np.arange(len(self._rays))
        makers: dict[str, Callable[[], NDArray[np.generic]]] = {
            "depth": lambda: self._points_m[:, 2] if along_axis else self._distance_m,
            "normals": lambda: self._turned_normals(at_rows(T_camera_bodies, rows), pixels),
            "instance": lambda: self._ids_of.instance[self._surface],
            "material": lambda: self._ids_of.material[self._surface],
            "mirror": self._mirror,
            "shadow": self._shadow,
            "moving": lambda: np.zeros(len(self._rays), bool) if self._body is None else self._body > 0,
        }
        return {name: found[name] if name in found else makers[name]() for name in names}

    def _visible_surfaces(self) -> tuple[Indices, Array]:
        """Surfaces and distances (R,): by planes where tiles are sure, by rays elsewhere."""
        surface, snapshot = spread(self._plan.sure[self._tiles], self._shape).ravel(), self._plan.here.snapshot
        distance_m = np.full(len(surface), np.nan)
        if snapshot is not None:
            distance_m = 1 / np.einsum("ri,ri->r", snapshot.planes[surface], self._rays)
        unsure = np.flatnonzero(surface < 0)
        seen = self._bodies.visible_surfaces(self._rays[unsure], [of(T, unsure) for T in self._T_bodies_camera])
        surface[unsure], distance_m[unsure] = seen.surface, seen.distance_m
        return surface, distance_m

    def _turned_normals(self, T_frame_bodies: Sequence[Array], pixels: Pixels) -> Array:
        """Normals (P, 3) of some pixels in a frame that the transforms, (4, 4) or (P, 4, 4) each, lead to."""
        surface, normals, T_frame_world = self._surface[pixels], self._bodies.normals, T_frame_bodies[0]
        if T_frame_world.ndim == 2:
            turned = turn(T_frame_world, normals)[surface]
        else:
            turned = turn(T_frame_world, normals[surface])
        for body, these in self._movers(pixels):
            turned[these] = turn(of(T_frame_bodies[body], these), normals[surface[these]])
        return turned

    def _mirror(self) -> Mask:
        mirror = self._ids_of.mirrors[self._surface]
        pixels = np.flatnonzero(self._spread(self._plan.glazed) & ~mirror)
        T_bodies_camera = [of(T, pixels) for T in self._T_bodies_camera]
        mirror[pixels] = self._bodies.behind_panes(self._rays[pixels], T_bodies_camera, self._distance_m[pixels])
        return mirror

    def _shadow(self) -> NDArray[np.uint16]:
        lamps, matt = self._plan.lamps, self._ids_of.matt[self._surface]
        count = self._spread(self._plan.hidden) * matt
        doubts = [self._spread(doubt) for _, doubt in lamps]
        pixels = np.flatnonzero(matt & np.logical_or.reduce(doubts, axis=0))
        rows, here = self._uv_px[pixels, 1], self._plan.here
        T_world_bodies, T_bodies_world = at_rows(here.T_world_bodies, rows), at_rows(here.T_bodies_world, rows)
        points_m = moved(of(self._T_bodies_camera[0], pixels), self._points_m[pixels])
        normals = self._turned_normals(T_world_bodies, pixels)
        for (lamp, _), doubt in zip(lamps, doubts, strict=True):
            these = np.flatnonzero(doubt[pixels])
            to_bodies = [of(T, these) for T in T_bodies_world]
            count[pixels[these]] += lamp.hidden(self._bodies, points_m[these], normals[these], to_bodies)
        return count

    def _spread(self, tiles: NDArray[Scalar]) -> NDArray[Scalar]:
        return spread(tiles[self._tiles], self._shape).ravel()

    def _flow(self) -> tuple[Array, Mask]:
        """Pixels (R, 2) to the place in the next picture, and whether the point is hidden or outside there (R,)."""
        there, seen = self._plan.there, self._surface >= 0
        if there is None:
            return np.full((len(self._rays), 2), np.nan), seen
        rows, points_m = self._uv_px[:, 1], self._own_points_m()
        for _ in range(MOST_ROUNDS):
            next_m = self._carried(points_m, there, rows)
            uv_px = self._plan.camera.project(next_m)
            change_px = np.nanmax(np.abs(uv_px[:, 1] - rows), initial=0.0) if there.snapshot is None else 0.0
            if change_px < CONVERGED_PX:
                break
            rows = uv_px[:, 1]
        return uv_px - self._uv_px, seen & self._gone(there, next_m, uv_px)

    def _own_points_m(self) -> Array:
        """The seen points (R, 3), each in the frame of the body that it is on."""
        points_m = moved(self._T_bodies_camera[0], self._points_m)
        for body, these in self._movers():
            points_m[these] = moved(of(self._T_bodies_camera[body], these), self._points_m[these])
        return points_m

    def _carried(self, own_points_m: Array, there: ShotTransforms, rows: Array) -> Array:
        """The points (R, 3) in the next camera's frame, where it is on the rows (R,) that see them."""
        carried = moved(at_rows(there.T_camera_bodies[:1], rows)[0], own_points_m)
        for body, these in self._movers():
            (T_there_body,) = at_rows(there.T_camera_bodies[body : body + 1], rows[these])
            carried[these] = moved(T_there_body, own_points_m[these])
        return carried

    def _gone(self, there: ShotTransforms, points_m: Array, uv_px: Array) -> Mask:
        """Whether points (R, 3) in the next camera's frame are outside its picture (R, 2), or hidden from it."""
        camera = self._plan.camera
        u, v = uv_px[:, 0], uv_px[:, 1]
        gone: Mask = ~((u >= -0.5) & (u < camera.width_px - 0.5) & (v >= -0.5) & (v < camera.height_px - 0.5))
        doubtful = np.flatnonzero(~gone & ~self._spread(self._plan.visible))
        T_bodies_there = at_rows(there.T_bodies_camera, v[doubtful])
        gone[doubtful] = self._hidden(points_m[doubtful], self._surface[doubtful], T_bodies_there)
        return gone

    def _hidden(self, points_m: Array, surface: Indices, T_bodies_camera: Sequence[Array]) -> Mask:
        """Whether a camera that has surfaces' points (P, 3) before it sees something nearer, or the surface's back."""
        reach_m = np.linalg.norm(points_m, axis=1)
        rays = points_m / reach_m[:, None]
        met = self._bodies.visible_surfaces(rays, T_bodies_camera)
        hidden: Mask = (met.surface != surface) & (met.distance_m < reach_m * (1 - DEPTH_TOLERANCE))
        other = np.flatnonzero((met.surface != surface) & ~hidden)
        body = self._bodies.of_surface[surface[other]]
        for index in np.unique(body):
            these = other[body == index]
            turned = turn(of(T_bodies_camera[index], these), rays[these])
            hidden[these] = np.einsum("ri,ri->r", turned, self._bodies.normals[surface[these]]) >= 0
        return hidden

    def _movers(self, pixels: Pixels | None = None) -> list[tuple[int, Pixels]]:
        """The movers that some pixels (None: all) see, and which of these see each."""
        if self._body is None:
            return []
        body = self._body if pixels is None else self._body[pixels]
        return [(int(b), np.flatnonzero(body == b)) for b in np.unique(body) if b]


__all__ = ["Shot", "TruthCaster"]

BAND_ROWS = 3 * TILE_PX  # worked on at a time: their arrays stay in the processor's cache
THREADS = max(1, min(2, os.cpu_count() or 1))


class TruthCaster:
    """Ground truth of one scene; `names` says what its ids mean."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._bodies = scene, Bodies(scene)
        surfaces = self._bodies.surfaces
        things = ["", *(mover.name for mover in scene.movers)]
        instances = [things[b] or s.instance for b, s in zip(self._bodies.of_surface, surfaces, strict=True)]
        materials = [s.material for s in surfaces]
        self.names = TruthNames(_table(instances), _table(materials))
        kinds = [*(scene.materials.get(name) for name in materials), None]
        self._ids_of = SurfaceIds(
            _ids(instances, self.names.instance),
            _ids(materials, self.names.material),
            np.array([isinstance(kind, Mirror | Polished) for kind in kinds]),
            np.array([isinstance(kind, Matt | Polished) for kind in kinds]),
        )
        self._pool = ThreadPoolExecutor(THREADS)

    def frame(
        self, camera: Camera, now: Shot, channels: Iterable[str] = tuple(CHANNELS), *, later: Shot | None = None
    ) -> TruthFrame:
        """The channels asked for; `later` is the next picture, without which flow is NaN and all is occluded.

        Raises UnknownNameError for a channel that does not exist.
        """
        height, width = camera.height_px, camera.width_px
        wanted = {name: CHANNELS[name] for name in check_channels(channels)}
        values: dict[str, Any] = {name: np.empty(c.shape(height, width), c.dtype) for name, c in wanted.items()}
        lit = lamps(self._scene, int(np.mean(now.t_ns))) if "shadow" in wanted else ()
        there = shot_transforms(self._bodies, later) if later else None
        whole = tile_plan(self._bodies, camera, shot_transforms(self._bodies, now), there, lit)

        def fill(rows: slice) -> None:
            for name, found in Band(whole, self._ids_of, rows).values(tuple(wanted)).items():
                values[name][rows] = found.reshape(values[name][rows].shape)

        starts = range(0, height, BAND_ROWS)
        list(self._pool.map(fill, [slice(row, min(row + BAND_ROWS, height)) for row in starts]))
        return TruthFrame(**values)


def _table(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(["", *names]))


def _ids(names: Sequence[str], table: Sequence[str]) -> NDArray[np.uint16]:
    """The names' places in a table (S + 1,); the last one is nothing, for the surface -1."""
    return np.array([*(table.index(name) for name in names), 0], np.uint16)
