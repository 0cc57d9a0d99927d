"""Some rows of a picture and what is true of their pixels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.render.beams import TILE_PX, Scalar, spread
from vobench.render.bodies import moved, turn
from vobench.render.geometry import Indices, Mask
from vobench.render.stand import Stand, at_rows, of
from vobench.render.truth_plan import Plan

Values = dict[str, NDArray[np.generic]]
Pixels = NDArray[np.intp]

# With a rolling shutter the row that sees a point next is looked for until it settles to this, or so many times.
SETTLED_PX, MOST_ROUNDS = 1e-5, 20
# A point is seen where sight ends no more than this share of the way before it.
SIGHT_TOLERANCE = 1e-4


@dataclass(frozen=True, slots=True)
class Looks:
    """Of each surface, the last one none (S + 1,): ids, whether it mirrors, whether it shows what light falls on it."""

    instance: NDArray[np.uint16]
    material: NDArray[np.uint16]
    mirrors: Mask
    matt: Mask


class Band:
    """Rows of a picture that begin with a tile's first: R pixels in T tiles."""

    def __init__(self, plan: Plan, looks: Looks, rows: slice) -> None:
        self._plan, self._bodies, self._looks = plan, plan.bodies, looks
        self._shape = (rows.stop - rows.start, plan.camera.width_px)
        self._rays = plan.tiles.rays[rows].reshape(-1, 3)
        self._uv_px = plan.tiles.uv_px[rows].reshape(-1, 2)
        self._tiles = slice(rows.start // TILE_PX, -(-rows.stop // TILE_PX))
        self._T_bodies_camera = at_rows(plan.here.T_bodies_camera, self._uv_px[:, 1])
        self._surface, self._distance_m = self._look()
        self._points_m = self._distance_m[:, None] * self._rays
        movers = np.append(self._bodies.of_surface, 0)[self._surface] if len(self._T_bodies_camera) > 1 else None
        self._body = movers if movers is not None and movers.any() else None

    def values(self, names: Sequence[str]) -> Values:
        """The channels asked for, (R,) or (R, n)."""
        found: Values = {}
        if "flow" in names or "occlusion" in names:
            found["flow"], found["occlusion"] = self._flow()
        makers: dict[str, Callable[[], NDArray[np.generic]]] = {
            "depth": self._depth,
            "normals": self._normals,
            "instance": lambda: self._looks.instance[self._surface],
            "material": lambda: self._looks.material[self._surface],
            "mirror": self._mirror,
            "shadow": self._shadow,
            "moving": lambda: np.zeros(len(self._rays), bool) if self._body is None else self._body > 0,
        }
        return {name: found[name] if name in found else makers[name]() for name in names}

    def _look(self) -> tuple[Indices, Array]:
        """Surfaces and distances (R,): by planes where tiles are sure, by rays elsewhere."""
        surface, snapshot = spread(self._plan.sure[self._tiles], self._shape).ravel(), self._plan.here.snapshot
        distance_m = np.full(len(surface), np.nan)
        if snapshot is not None:
            distance_m = 1 / np.einsum("ri,ri->r", snapshot.planes[surface], self._rays)
        unsure = np.flatnonzero(surface < 0)
        seen = self._bodies.look(self._rays[unsure], [of(T, unsure) for T in self._T_bodies_camera])
        surface[unsure], distance_m[unsure] = seen.surface, seen.distance_m
        return surface, distance_m

    def _depth(self) -> Array:
        return self._points_m[:, 2] if self._plan.camera.depth_along == "axis" else self._distance_m

    def _normals(self) -> Array:
        T_camera_bodies = at_rows(self._plan.here.T_camera_bodies, self._uv_px[:, 1])
        return self._turned_normals(T_camera_bodies, np.arange(len(self._rays)))

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
        mirror = self._looks.mirrors[self._surface]
        pixels = np.flatnonzero(self._spread(self._plan.glazed) & ~mirror)
        T_bodies_camera = [of(T, pixels) for T in self._T_bodies_camera]
        mirror[pixels] = self._bodies.behind_panes(self._rays[pixels], T_bodies_camera, self._distance_m[pixels])
        return mirror

    def _shadow(self) -> NDArray[np.uint16]:
        lamps, matt = self._plan.lamps, self._looks.matt[self._surface]
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
        """A picture's tiles (V, U) as this band's pixels (R,)."""
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
            if change_px < SETTLED_PX:
                break
            rows = uv_px[:, 1]
        return uv_px - self._uv_px, seen & self._gone(there, next_m, uv_px)

    def _own_points_m(self) -> Array:
        """The seen points (R, 3), each in the frame of the body that it is on."""
        points_m = moved(self._T_bodies_camera[0], self._points_m)
        for body, these in self._movers():
            points_m[these] = moved(of(self._T_bodies_camera[body], these), self._points_m[these])
        return points_m

    def _carried(self, own_points_m: Array, there: Stand, rows: Array) -> Array:
        """The points (R, 3) in the next camera's frame, where it stands on the rows (R,) that see them."""
        carried = moved(at_rows(there.T_camera_bodies[:1], rows)[0], own_points_m)
        for body, these in self._movers():
            (T_there_body,) = at_rows(there.T_camera_bodies[body : body + 1], rows[these])
            carried[these] = moved(T_there_body, own_points_m[these])
        return carried

    def _gone(self, there: Stand, points_m: Array, uv_px: Array) -> Mask:
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
        met = self._bodies.look(rays, T_bodies_camera)
        hidden: Mask = (met.surface != surface) & (met.distance_m < reach_m * (1 - SIGHT_TOLERANCE))
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
