"""Exact ground truth of a picture by rays through its pixels' centres."""

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.camera import Camera, pixel_grid
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Indices, Mask, Pixels, Rows
from vobench.rendering.dot_product import dot
from vobench.rendering.lamp import Lamp, LampGroup, lamp_groups, lamps_on
from vobench.rendering.occlusion import Bodies
from vobench.rendering.receiver_plane import large_planes
from vobench.rendering.shadow_cells import KnownShadows
from vobench.rendering.shot import (
    CameraShot,
    RowTransforms,
    ShotTransforms,
    at_rows,
    moved,
    of_rays,
    rays_in,
    shot_transforms,
    turn,
)
from vobench.scene.material import Material
from vobench.scene.scene import Scene
from vobench.sensor.pixel_truth import CHANNELS, TruthFrame, TruthNames, check_channels

__all__ = ["CameraShot", "TruthCaster"]

# With a rolling shutter the row that sees a point next is found by iteration, to this or in so many rounds.
CONVERGED_PX = 1e-5
MOST_ROUNDS = 20
# A point is seen where the ray ends no more than this share of its length before it.
DEPTH_TOLERANCE = 1e-4
LAMP_TOLERANCE = 1e-3  # share of the distance to a lamp's middle in which nothing hides it
NO_RAY = np.float32(-1)  # reach of a ray that is not traced


@dataclass(frozen=True, slots=True)
class FaceIds:
    """Of each face, the last one none (F + 1,): ids, whether it mirrors, whether it scatters the light of lamps."""

    instance: NDArray[np.uint16]
    material: NDArray[np.uint16]
    mirrors: Mask
    diffuse: Mask


@dataclass(frozen=True, slots=True)
class LitLamps:
    """A group of lamps, and the shadows that are known before any ray is cast."""

    group: LampGroup
    known: KnownShadows


@dataclass(frozen=True, slots=True)
class TruthPicture:
    """A picture to find the ground truth of: its scene, its camera now and for the next picture, if there is one."""

    bodies: Bodies
    ids: FaceIds
    camera: Camera
    here: ShotTransforms
    there: ShotTransforms | None
    lamps: tuple[LitLamps, ...]

    def lit(self, transforms: Sequence[Array]) -> list[Array]:
        """The transforms between bodies and the world with which light is computed: leaves are lit as without wind."""
        leaves = len(self.bodies.movers) - self.bodies.rigid_count
        return [*transforms[: len(transforms) - leaves], *[np.eye(4)] * leaves]


@lru_cache(maxsize=4)
def pixel_rays(camera: Camera) -> tuple[Array, Array]:
    """A camera's pixels (H, W, 2) and their unit rays (H, W, 3); cached, as cameras are few and pictures many."""
    uv_px = pixel_grid(camera)
    return uv_px, camera.rays(uv_px)


Values = NDArray[np.generic]


class Band:
    """Rows of a picture: R pixels."""

    def __init__(self, picture: TruthPicture, rows: slice) -> None:
        self._picture = picture
        self._bodies = picture.bodies
        uv_px, rays = pixel_rays(picture.camera)
        self._uv_px = uv_px[rows].reshape(-1, 2)
        self._rays = rays[rows].reshape(-1, 3)
        self._T_bodies_camera = at_rows(picture.here.T_bodies_camera, self._uv_px[:, 1])
        hits = self._bodies.visible(self._rays, self._T_bodies_camera)
        self._face = hits.face
        self._distance_m = hits.distance
        self._points_m = self._distance_m[:, None] * self._rays  # (R, 3), camera
        self._world_m = moved(self._T_bodies_camera[0], self._points_m)  # (R, 3), world
        self._movers = self._seen_movers(self._face)

    def values(self, names: Sequence[str]) -> dict[str, Values]:
        """The channels of these names, (R,) or (R, n)."""
        flow: dict[str, Values] = {}
        if "flow" in names or "occlusion" in names:
            flow["flow"], flow["occlusion"] = self._flow(hides="occlusion" in names)
        channels: dict[str, Callable[[], Values]] = {
            "depth": self._depth_m,
            "normals": self._camera_normals,
            "instance": lambda: self._picture.ids.instance[self._face],
            "material": lambda: self._picture.ids.material[self._face],
            "mirror": self._mirror,
            "shadow": self._shadow,
            "moving": lambda: self._bodies.body[self._face] > 0,
        }
        return {name: flow[name] if name in flow else channels[name]() for name in names}

    def _depth_m(self) -> Array:
        along_axis = self._picture.camera.depth_along == "axis"
        return self._points_m[:, 2] if along_axis else self._distance_m

    def _camera_normals(self) -> Array:
        T_camera_bodies = at_rows(self._picture.here.T_camera_bodies, self._uv_px[:, 1])
        return self._normals(T_camera_bodies)

    def _mirror(self) -> Mask:
        """Which pixels (R,) show a mirror, or something through glass."""
        mirrors = self._picture.ids.mirrors[self._face]
        behind_panes = self._bodies.behind_panes(self._rays, self._T_bodies_camera, self._distance_m)
        return np.asarray(mirrors | behind_panes)

    def _seen_movers(self, face: Indices) -> list[tuple[int, Pixels]]:
        """The movers among faces (P,), and which of these are of each."""
        if len(self._T_bodies_camera) == 1:
            return []
        body = self._bodies.body[face]
        movers = [int(index) for index in np.unique(body) if index]
        return [(mover, np.flatnonzero(body == mover)) for mover in movers]

    def _normals(self, T_frame_bodies: Sequence[Array]) -> Array:
        """Normals (R, 3) in a frame that the transforms, (4, 4) or (R, 4, 4) each, lead to."""
        normals = self._bodies.normals[self._face]
        turned = turn(T_frame_bodies[0], normals)
        for mover, pixels in self._movers:
            turned[pixels] = turn(of_rays(T_frame_bodies[mover], pixels), normals[pixels])
        return turned

    def _shadow(self) -> NDArray[np.uint16]:
        """The number of lamps (R,) in front of the visible face that are hidden from it.

        Leaves in wind are lit, and cast shadows, as if there were no wind.
        """
        picture = self._picture
        here = picture.here
        rows = self._uv_px[:, 1]
        T_bodies_world = at_rows(picture.lit(here.T_bodies_world), rows)
        normals = self._normals(at_rows(picture.lit(here.T_world_bodies), rows))
        world_m = self._lit_m()
        lift_m = self._bodies.ray_offset_m * normals
        starts_m = (world_m + lift_m).astype(np.float32)
        offsets_m = dot(world_m, normals) if self._movers else np.empty(0)
        count = np.zeros(len(self._face), np.uint16)
        for lamps in picture.lamps:
            group = lamps.group
            facing = group.facing[self._face]
            for _, pixels in self._movers:
                is_diffuse = picture.ids.diffuse[self._face[pixels]]
                facing[pixels] = np.where(is_diffuse, group.bits_before(normals[pixels], offsets_m[pixels]), 0)
            decided, hidden = lamps.known.bits(self._face, starts_m)
            hidden &= facing
            count += np.bitwise_count(hidden)
            for lamp, pixels in group.pixels_facing(facing & ~decided):
                count[pixels] += self._is_hidden(lamp, starts_m, T_bodies_world, pixels, by_movers=False)
            if self._bodies.movers:
                for lamp, pixels in group.pixels_facing(facing & decided & ~hidden):
                    count[pixels] += self._is_hidden(lamp, starts_m, T_bodies_world, pixels, by_movers=True)
        return count

    def _lit_m(self) -> Array:
        """The seen points (R, 3) in the world, where they are lit: those on leaves as without wind."""
        world_m = self._world_m.copy()
        for mover, pixels in self._movers:
            if mover > self._bodies.rigid_count:
                T_leaves_camera = of_rays(self._T_bodies_camera[mover], pixels)
                world_m[pixels] = moved(T_leaves_camera, self._points_m[pixels])
        return world_m

    def shown(self) -> list[Rows]:
        """How many pixels show each of the planes (P,) whose shadows may be known, for each group of lamps."""
        return [lamps.known.shown(self._face) for lamps in self._picture.lamps]

    def _is_hidden(
        self,
        lamp: Lamp,
        starts_m: Floats,
        T_bodies_world: RowTransforms,
        pixels: Pixels,
        *,
        by_movers: bool,
    ) -> Mask:
        """Whether something is between a lamp that shines towards pixels (P,) and what they show at starts_m (R, 3).

        With `by_movers`, only movers count.
        """
        pixel_starts_m = starts_m[pixels]
        vectors_m = lamp.vectors_m(pixel_starts_m)
        is_lit = np.broadcast_to(lamp.shines(vectors_m), len(pixels))
        reach = np.where(is_lit, np.float32(1 - LAMP_TOLERANCE), NO_RAY)
        T_bodies_pixels = T_bodies_world.of_rays(pixels)
        if by_movers:
            return self._bodies.blocked_by_movers(pixel_starts_m, vectors_m, T_bodies_pixels, reach, where=is_lit)
        return self._bodies.blocked(pixel_starts_m, vectors_m, T_bodies_pixels, reach)

    def _flow(self, *, hides: bool) -> tuple[Array, Mask]:
        """Pixels (R, 2) to the place in the next picture, and whether the point is hidden or outside there (R,)."""
        there = self._picture.there
        is_seen = self._face >= 0
        if there is None:
            return np.full((len(self._rays), 2), np.nan), is_seen
        camera = self._picture.camera
        rows = self._uv_px[:, 1]
        body_m = self._in_bodies_m()
        for _ in range(MOST_ROUNDS):
            next_m = self._in_next_camera_m(body_m, there, rows)
            uv_px = camera.project(next_m)
            changes_px = np.abs(uv_px[:, 1] - rows)
            change_px = np.nanmax(changes_px, initial=0.0) if there.by_row else 0.0
            if change_px < CONVERGED_PX:
                break
            rows = uv_px[:, 1]
        flow_px = uv_px - self._uv_px
        if not hides:
            return flow_px, is_seen
        return flow_px, is_seen & self._gone(there, next_m, uv_px)

    def _in_bodies_m(self) -> Array:
        """The seen points (R, 3), each in the frame of the body that it is on."""
        if not self._movers:
            return self._world_m
        body_m = self._world_m.copy()
        for mover, pixels in self._movers:
            body_m[pixels] = moved(of_rays(self._T_bodies_camera[mover], pixels), self._points_m[pixels])
        return body_m

    def _in_next_camera_m(self, body_m: Array, there: ShotTransforms, rows: Array) -> Array:
        """The points (R, 3) in the next camera's frame, where it is on the rows (R,) that see them."""
        (T_there_world,) = at_rows(there.T_camera_bodies[:1], rows)
        next_m = moved(T_there_world, body_m)
        for mover, pixels in self._movers:
            (T_there_body,) = at_rows(there.T_camera_bodies[mover : mover + 1], rows[pixels])
            next_m[pixels] = moved(T_there_body, body_m[pixels])
        return next_m

    def _gone(self, there: ShotTransforms, next_m: Array, uv_px: Array) -> Mask:
        """Whether points (R, 3) in the next camera's frame are outside its picture (R, 2), or hidden from it."""
        camera = self._picture.camera
        u, v = uv_px.T
        in_columns = (u >= -0.5) & (u < camera.width_px - 0.5)
        in_rows = (v >= -0.5) & (v < camera.height_px - 0.5)
        is_gone: Mask = ~(in_columns & in_rows)
        inside = np.flatnonzero(~is_gone)
        is_gone[inside] = self._hidden(there, inside, next_m[inside], v[inside])
        return is_gone

    def _hidden(
        self,
        there: ShotTransforms,
        pixels: Pixels,
        next_m: Array,
        rows: Array,
    ) -> Mask:
        """Whether the next camera, with the points (P, 3) of pixels before it, sees backs or something nearer."""
        T_bodies_there = at_rows(there.T_bodies_camera, rows)
        face = self._face[pixels]
        origins_m, vectors_m = rays_in(T_bodies_there[0], next_m)
        eye_m = origins_m.copy()  # (P, 3), each in the frame of the body that is seen
        for mover, of_mover in self._seen_movers(face):
            eye_m[of_mover] = of_rays(T_bodies_there[mover], of_mover)[..., :3, 3]
        eye_offset_m = dot(self._bodies.normals[face], eye_m)
        is_hidden: Mask = eye_offset_m <= self._bodies.offsets_m[face]

        T_bodies_world = at_rows(there.T_bodies_world, rows)
        reach = np.where(is_hidden, NO_RAY, np.float32(1 - DEPTH_TOLERANCE))
        is_blocked = self._bodies.blocked(
            origins_m.astype(np.float32), vectors_m.astype(np.float32), T_bodies_world, reach
        )
        doubtful = np.flatnonzero(is_blocked)  # backs and places within float32's reach hide nothing
        distance_m = np.linalg.norm(next_m[doubtful], axis=1)
        T_bodies_doubtful = T_bodies_there.of_rays(doubtful)
        seen = self._bodies.visible(next_m[doubtful] / distance_m[:, None], T_bodies_doubtful)
        is_hidden[doubtful] = seen.distance < distance_m * (1 - DEPTH_TOLERANCE)
        return is_hidden


BAND_ROWS = 60  # worked on at a time: their arrays stay in the processor's cache
THREADS = max(1, min(2, os.cpu_count() or 1))


class TruthCaster:
    """Ground truth of one scene; `names` lists what its ids mean."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._bodies = Bodies(scene)
        faces = self._bodies.faces
        mover_of = dict(zip(faces.thing.tolist(), faces.mover.tolist(), strict=True))
        instances = []
        for index, thing in enumerate(faces.things):
            mover = mover_of.get(index, -1)
            instances.append(thing.name if mover < 0 else self._bodies.movers[mover].name)
        material_names = [thing.material for thing in faces.things]
        self.names = TruthNames(_table(instances), _table(material_names))

        materials = [scene.materials.get(name) for name in material_names]
        mirrors = [material is not None and _mirrors(material) for material in materials]
        diffuse = [material is not None and _is_diffuse(material) for material in materials]
        thing_of = np.append(faces.thing, len(faces.things))  # the last one is nothing, for the face -1
        is_no_lamp = np.append(faces.lamp, -1) < 0
        self._ids = FaceIds(
            instance=_ids(instances, self.names.instance)[thing_of],
            material=_ids(material_names, self.names.material)[thing_of],
            mirrors=np.array([*mirrors, False])[thing_of],
            diffuse=np.array([*diffuse, False])[thing_of] & is_no_lamp,
        )
        self._pool = ThreadPoolExecutor(THREADS)
        self._lit_lamps = lru_cache(maxsize=2)(self._lit_lamps_of)
        is_surface = self._ids.diffuse[:-1] & (self._bodies.body[:-1] == 0)
        planes, self._face_plane = large_planes(faces.corners_m, faces.plane, is_surface, self._bodies.ray_offset_m)
        self._planes = planes
        self._occluders = self._bodies.stationary_occluders()

    def _lit_lamps_of(self, lights: tuple[int, ...], t_ns: int, is_moving: bool) -> tuple[LitLamps, ...]:
        """The lamps among lights, by their indices, as they are at an instant."""
        result = []
        for group in lamp_groups(self._scene, self._bodies, self._ids.diffuse, lights, t_ns):
            stationary = () if is_moving else group.lamps
            known = KnownShadows(self._planes, self._face_plane, stationary, self._occluders)
            result.append(LitLamps(group, known))
        return tuple(result)

    def _lamps_at(self, t_ns: int) -> tuple[LitLamps, ...]:
        """The lamps that are on at an instant; computed again if others are on or the sun has moved."""
        lights = lamps_on(self._scene, t_ns)
        is_moving = any(self._scene.lights[index].moves for index in lights)
        return self._lit_lamps(lights, t_ns if is_moving else 0, is_moving)

    def frame(
        self,
        camera: Camera,
        now: CameraShot,
        channels: Iterable[str] = tuple(CHANNELS),
        *,
        later: CameraShot | None = None,
    ) -> TruthFrame:
        """The channels of these names; `later` is the next picture, without which flow is NaN and all is occluded.

        Raises UnknownNameError for a channel that does not exist.
        """
        height = camera.height_px
        wanted = {name: CHANNELS[name] for name in check_channels(channels)}
        values: dict[str, Any] = {}
        for name, channel in wanted.items():
            values[name] = np.empty(channel.shape(height, camera.width_px), channel.dtype)
        movers = self._bodies.movers
        middle_ns = int(np.mean(now.t_ns))
        picture = TruthPicture(
            bodies=self._bodies,
            ids=self._ids,
            camera=camera,
            here=shot_transforms(movers, now),
            there=shot_transforms(movers, later) if later else None,
            lamps=self._lamps_at(middle_ns) if "shadow" in wanted else (),
        )

        def fill(rows: slice) -> list[Rows]:
            band = Band(picture, rows)
            for name, channel in band.values(tuple(wanted)).items():
                values[name][rows] = channel.reshape(values[name][rows].shape)
            return band.shown()

        bands = [slice(row, min(row + BAND_ROWS, height)) for row in range(0, height, BAND_ROWS)]
        for shown_by_group in list(self._pool.map(fill, bands)):
            for lamps, shown in zip(picture.lamps, shown_by_group, strict=True):
                lamps.known.learn(shown)
        return TruthFrame(**values)


def _mirrors(material: Material) -> bool:
    return material.kind == "mirror" or material.is_coated or material.metal > 0


def _is_diffuse(material: Material) -> bool:
    return material.kind == "body" and material.metal < 1


def _table(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(["", *names]))


def _ids(
    names: Sequence[str],
    table: Sequence[str],
) -> NDArray[np.uint16]:
    """The names' places in a table (S + 1,); the last one is nothing."""
    place = {name: nth for nth, name in enumerate(table)}
    return np.array([*(place[name] for name in names), 0], np.uint16)
