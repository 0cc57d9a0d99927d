"""Exact ground truth of a picture by rays through its pixels' centres."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.camera import Camera, pixel_grid
from vobench.geometry.se3 import Array
from vobench.rendering.occlusion import (
    RAY_OFFSET_M,
    Bodies,
    Floats,
    Indices,
    Mask,
    Pixels,
    Shot,
    ShotTransforms,
    at_rows,
    dot,
    into,
    moved,
    of,
    shot_transforms,
    turn,
)
from vobench.scene.light import AreaLight, PointLight, Sky, SpotLight, Sun
from vobench.scene.mesh import unit
from vobench.scene.scene import Scene
from vobench.sensor.pixel_truth import CHANNELS, TruthFrame, TruthNames, check_channels

SUN_WAY_M = 1e4  # beyond every scene


@dataclass(frozen=True, slots=True)
class Lamp:
    """A light that is on, seen from its middle: what it reaches and does not.

    center_m (3,), None for the sun; axis (3,): along which it shines, or to the sun; beyond cosine `least` of the
    angle to the axis it does not shine. own_m: as near to the middle its own faces are not in the light's way.
    """

    center_m: Array | None
    axis: Array
    least: float = -2.0
    own_m: float = 0.0

    def way(self, starts_m: Floats) -> Floats:
        """From points (R, 3) to the middle, or as far as matters towards the sun."""
        if self.center_m is None:
            return np.broadcast_to((SUN_WAY_M * self.axis).astype(np.float32), starts_m.shape)
        way = self.center_m.astype(np.float32) - starts_m
        return way if self.own_m == 0 else way * np.maximum(1 - self.own_m / np.linalg.norm(way, axis=1), 0)[:, None]

    def faced(self, normals: Array, away_m: Array) -> Mask:
        """Which planes (F, 3), away_m (F,) from the origin, have it before them."""
        if self.center_m is None:
            return normals @ self.axis > 0
        return normals @ self.center_m > away_m + RAY_OFFSET_M

    def shines(self, way: Floats) -> Mask | bool:
        """Whether it shines to where ways (R, 3) lead to its middle."""
        if self.least < -1:
            return True
        return _along(way, -self.axis) > (self.least * np.sqrt(dot(way, way)) if self.least else 0)


def _along(vectors: Floats, axis: Array) -> Floats:
    return np.asarray(np.einsum("ri,i->r", vectors, axis.astype(np.float32)))


def lamps(scene: Scene, bodies: Bodies, t_ns: int) -> Iterator[tuple[Lamp, Mask]]:
    """The lights that are on at an instant, but for the sky, which has no middle; and the faces turned to each."""
    for index, light in enumerate(scene.lights):
        if not isinstance(light, Sky) and light.level.mean(t_ns, t_ns) > 0:
            lamp = _lamp(light, bodies.faces.corners_m[bodies.faces.lamp == index], t_ns)
            yield lamp, lamp.faced(bodies.normals, bodies.offsets_m)


def _lamp(light: AreaLight | PointLight | SpotLight | Sun, corners_m: Array, t_ns: int) -> Lamp:
    match light:
        case Sun():
            return Lamp(None, light.direction(t_ns))
        case PointLight():
            return Lamp(light.position_m, np.zeros(3))
        case SpotLight():
            return Lamp(light.position_m, light.direction, float(np.cos(np.deg2rad(light.outer_deg))))
        case AreaLight():
            return lamp_of(corners_m)


def lamp_of(corners_m: Array) -> Lamp:
    """The lamp whose faces (F, 3, 3) shine; where they are flat, only before them."""
    doubled = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
    area = np.linalg.norm(doubled, axis=1)
    center_m = np.average(corners_m.mean(1), axis=0, weights=area)
    axis = unit(doubled.sum(0))
    way_m = corners_m.reshape(-1, 3) - center_m
    if np.abs(way_m @ axis).max() < RAY_OFFSET_M:
        return Lamp(center_m, axis, 0.0)
    return Lamp(center_m, axis, own_m=float(np.linalg.norm(way_m, axis=1).max()))


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture to tell the truth of, the next one, and its lamps, each with the faces (F + 1,) turned to it."""

    bodies: Bodies
    camera: Camera
    here: ShotTransforms
    there: ShotTransforms | None
    lamps: tuple[tuple[Lamp, Mask], ...]


@dataclass(frozen=True, slots=True)
class FaceIds:
    """Of each face, the last one none (F + 1,): ids, whether it mirrors, whether it shows what light falls on it."""

    instance: NDArray[np.uint16]
    material: NDArray[np.uint16]
    mirrors: Mask
    matt: Mask


@lru_cache(maxsize=4)
def pixel_rays(camera: Camera) -> tuple[Array, Array]:
    """A camera's pixels (H, W, 2) and their unit rays (H, W, 3); kept, as cameras are few and pictures many."""
    uv_px = pixel_grid(camera)
    return uv_px, camera.rays(uv_px)


Values = dict[str, NDArray[np.generic]]

# With a rolling shutter the row that sees a point next is found by iteration, to this or in so many rounds.
CONVERGED_PX = 1e-5
MOST_ROUNDS = 20
# A point is seen where the ray ends no more than this share of the way before it.
DEPTH_TOLERANCE = 1e-4
LAMP_TOLERANCE = 1e-3  # as near to a lamp's middle nothing is in its way


class Band:
    """Rows of a picture: R pixels."""

    def __init__(self, picture: Picture, ids: FaceIds, rows: slice) -> None:
        self._picture = picture
        self._bodies = picture.bodies
        self._ids_of = ids
        self._uv_px, rays = (part[rows].reshape(-1, part.shape[2]) for part in pixel_rays(picture.camera))
        self._rays = rays
        self._T_bodies_camera = at_rows(picture.here.T_bodies_camera, self._uv_px[:, 1])
        seen = self._bodies.visible(rays, self._T_bodies_camera)
        self._face = seen.face
        self._distance_m = seen.distance_m
        self._points_m = self._distance_m[:, None] * rays
        self._world_m = moved(self._T_bodies_camera[0], self._points_m)
        self._movers = self._seen_movers(self._face)

    def values(self, names: Sequence[str]) -> Values:
        """The channels asked for, (R,) or (R, n)."""
        found: Values = {}
        if "flow" in names or "occlusion" in names:
            found["flow"], found["occlusion"] = self._flow(hides="occlusion" in names)
        here = self._picture.here
        rows = self._uv_px[:, 1]
        makers: dict[str, Callable[[], NDArray[np.generic]]] = {
            "depth": lambda: self._points_m[:, 2] if self._picture.camera.depth_along == "axis" else self._distance_m,
            "normals": lambda: self._normals(at_rows(here.T_camera_bodies, rows)),
            "instance": lambda: self._ids_of.instance[self._face],
            "material": lambda: self._ids_of.material[self._face],
            "mirror": self._mirror,
            "shadow": self._shadow,
            "moving": lambda: self._bodies.body[self._face] > 0,
        }
        return {name: found[name] if name in found else makers[name]() for name in names}

    def _seen_movers(self, face: Indices) -> list[tuple[int, Pixels]]:
        """The movers among faces (P,), and which of these are of each."""
        if len(self._T_bodies_camera) == 1:
            return []
        body = self._bodies.body[face]
        return [(int(b), np.flatnonzero(body == b)) for b in np.unique(body) if b]

    def _normals(self, T_frame_bodies: Sequence[Array]) -> Array:
        """Normals (R, 3) in a frame that the transforms, (4, 4) or (R, 4, 4) each, lead to."""
        normals = self._bodies.normals[self._face]
        turned = turn(T_frame_bodies[0], normals)
        for body, these in self._movers:
            turned[these] = turn(of(T_frame_bodies[body], these), normals[these])
        return turned

    def _mirror(self) -> Mask:
        return self._ids_of.mirrors[self._face] | self._bodies.behind_panes(
            self._rays, self._T_bodies_camera, self._distance_m
        )

    def _shadow(self) -> NDArray[np.uint16]:
        count = np.zeros(len(self._face), np.uint16)
        here = self._picture.here
        rows = self._uv_px[:, 1]
        matt = self._ids_of.matt[self._face]
        T_bodies_world = at_rows(here.T_bodies_world, rows)
        normals = self._normals(at_rows(here.T_world_bodies, rows))
        starts_m = (self._world_m + self._bodies.ray_offset_m * normals).astype(np.float32)
        away_m = dot(self._world_m, normals) if self._movers else np.empty(0)
        for lamp, faces in self._picture.lamps:
            faced = faces[self._face]
            way = lamp.way(starts_m)
            for _, these in self._movers:
                faced[these] = lamp.faced(normals[these], away_m[these])
            lit = matt & faced & lamp.shines(way)
            reach = np.where(lit, np.float32(1 - LAMP_TOLERANCE), np.float32(-1))
            count += self._bodies.blocked(starts_m, way, T_bodies_world, reach)
        return count

    def _flow(self, *, hides: bool) -> tuple[Array, Mask]:
        """Pixels (R, 2) to the place in the next picture, and whether the point is hidden or outside there (R,)."""
        there = self._picture.there
        seen = self._face >= 0
        if there is None:
            return np.full((len(self._rays), 2), np.nan), seen
        rows = self._uv_px[:, 1]
        own_m = self._own_m()
        for _ in range(MOST_ROUNDS):
            next_m = self._carried(own_m, there, rows)
            uv_px = self._picture.camera.project(next_m)
            change_px = np.nanmax(np.abs(uv_px[:, 1] - rows), initial=0.0) if there.by_row else 0.0
            if change_px < CONVERGED_PX:
                break
            rows = uv_px[:, 1]
        return uv_px - self._uv_px, seen & self._gone(there, next_m, uv_px) if hides else seen

    def _own_m(self) -> Array:
        """The seen points (R, 3), each in the frame of the body that it is on."""
        own_m = self._world_m.copy() if self._movers else self._world_m
        for body, these in self._movers:
            own_m[these] = moved(of(self._T_bodies_camera[body], these), self._points_m[these])
        return own_m

    def _carried(self, own_m: Array, there: ShotTransforms, rows: Array) -> Array:
        """The points (R, 3) in the next camera's frame, where it is on the rows (R,) that see them."""
        carried = moved(at_rows(there.T_camera_bodies[:1], rows)[0], own_m)
        for body, these in self._movers:
            (T_there_body,) = at_rows(there.T_camera_bodies[body : body + 1], rows[these])
            carried[these] = moved(T_there_body, own_m[these])
        return carried

    def _gone(self, there: ShotTransforms, next_m: Array, uv_px: Array) -> Mask:
        """Whether points (R, 3) in the next camera's frame are outside its picture (R, 2), or hidden from it."""
        camera = self._picture.camera
        (u, v) = uv_px.T
        gone: Mask = ~((u >= -0.5) & (u < camera.width_px - 0.5) & (v >= -0.5) & (v < camera.height_px - 0.5))
        inside = np.flatnonzero(~gone)
        gone[inside] = self._hidden(there, inside, next_m[inside], v[inside])
        return gone

    def _hidden(self, there: ShotTransforms, pixels: Pixels, next_m: Array, rows: Array) -> Mask:
        """Whether the next camera, with the points (P, 3) of pixels before it, sees backs or something nearer."""
        T_bodies_there = at_rows(there.T_bodies_camera, rows)
        face = self._face[pixels]
        origins, way = into(T_bodies_there[0], next_m)
        eye_m = origins.copy()
        for body, these in self._seen_movers(face):
            eye_m[these] = of(T_bodies_there[body], these)[..., :3, 3]
        hidden: Mask = dot(self._bodies.normals[face], eye_m) <= self._bodies.offsets_m[face]
        T_bodies_world = at_rows(there.T_bodies_world, rows)
        reach = np.where(hidden, np.float32(-1), np.float32(1 - DEPTH_TOLERANCE))
        met = self._bodies.blocked(origins.astype(np.float32), way.astype(np.float32), T_bodies_world, reach)
        doubtful = np.flatnonzero(met)  # backs and places within float32's reach are no hindrance
        reach_m = np.linalg.norm(next_m[doubtful], axis=1)
        seen = self._bodies.visible(next_m[doubtful] / reach_m[:, None], [of(T, doubtful) for T in T_bodies_there])
        hidden[doubtful] = seen.distance_m < reach_m * (1 - DEPTH_TOLERANCE)
        return hidden


__all__ = ["Shot", "TruthCaster"]

BAND_ROWS = 60  # worked on at a time: their arrays stay in the processor's cache
THREADS = max(1, min(2, os.cpu_count() or 1))


class TruthCaster:
    """Ground truth of one scene; `names` says what its ids mean."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._bodies = Bodies(scene)
        faces = self._bodies.faces
        movers = dict(zip(faces.thing.tolist(), faces.mover.tolist(), strict=True))
        instances = [
            thing.name if movers.get(nth, -1) < 0 else scene.movers[movers[nth]].name
            for nth, thing in enumerate(faces.things)
        ]
        materials = [thing.material for thing in faces.things]
        self.names = TruthNames(_table(instances), _table(materials))
        kinds = [scene.materials.get(name) for name in materials]
        mirrors = [m is not None and (m.kind == "mirror" or m.is_coated or m.metal > 0) for m in kinds]
        matt = [m is not None and m.kind == "body" and m.metal < 1 for m in kinds]
        thing = np.append(faces.thing, len(faces.things))  # the last one is nothing, for the face -1
        self._ids_of = FaceIds(
            _ids(instances, self.names.instance)[thing],
            _ids(materials, self.names.material)[thing],
            np.array([*mirrors, False])[thing],
            np.array([*matt, False])[thing] & (np.append(faces.lamp, -1) < 0),
        )
        self._pool = ThreadPoolExecutor(THREADS)

    def frame(
        self, camera: Camera, now: Shot, channels: Iterable[str] = tuple(CHANNELS), *, later: Shot | None = None
    ) -> TruthFrame:
        """The channels asked for; `later` is the next picture, without which flow is NaN and all is occluded.

        Raises UnknownNameError for a channel that does not exist.
        """
        height = camera.height_px
        width = camera.width_px
        wanted = {name: CHANNELS[name] for name in check_channels(channels)}
        values: dict[str, Any] = {name: np.empty(c.shape(height, width), c.dtype) for name, c in wanted.items()}
        lit = lamps(self._scene, self._bodies, int(np.mean(now.t_ns))) if "shadow" in wanted else ()
        there = shot_transforms(self._bodies, later) if later else None
        whole = Picture(self._bodies, camera, shot_transforms(self._bodies, now), there, tuple(lit))

        def fill(rows: slice) -> None:
            for name, found in Band(whole, self._ids_of, rows).values(tuple(wanted)).items():
                values[name][rows] = found.reshape(values[name][rows].shape)

        starts = range(0, height, BAND_ROWS)
        list(self._pool.map(fill, [slice(row, min(row + BAND_ROWS, height)) for row in starts]))
        return TruthFrame(**values)


def _table(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(["", *names]))


def _ids(names: Sequence[str], table: Sequence[str]) -> NDArray[np.uint16]:
    """The names' places in a table (S + 1,); the last one is nothing."""
    place = {name: nth for nth, name in enumerate(table)}
    return np.array([*(place[name] for name in names), 0], np.uint16)
