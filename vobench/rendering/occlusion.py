"""Rays against faces: what a camera sees of bodies that move, and what is between two points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.embree import new_scene, with_portable_places
from vobench.scene.material import Material
from vobench.scene.mesh import Triangles, unit
from vobench.scene.scene import Scene, triangles

Floats = NDArray[np.float32]
Indices = NDArray[np.int32]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.intp]

RAY_OFFSET_M = 1e-4  # rays start this far off a face
REACH_M = 1e8  # beyond every scene
MOST_PASSED = 64  # backs and holes that a ray passes before it counts as lost between faces that touch
GRAZING = 1e-3  # the least cosine by which a ray is taken to leave a face's plane
# Embree works in float32, which resolves a place to this share of the scene's largest coordinate.
RESOLUTION = 1e-6
WATERTIGHT = 1e-3 * RESOLUTION  # a ray that passes a face's edge this close has met it


@dataclass(frozen=True, slots=True)
class Hits:
    """Where rays end: face (R,) by its place in the table, -1 for none; distance_m (R,), as Embree says or exact.

    u, v (R,) are the weights of the face's second and third corner.
    """

    face: Indices
    u: Floats
    v: Floats
    distance_m: NDArray[Any]


class FaceCaster:
    """Embree over some faces (K,) of a table of corners (F, 3, 3); hits name faces by their place in the table."""

    def __init__(self, corners_m: Array, among: Pixels) -> None:
        from embreex import mesh_construction

        self._among = np.append(among, -1).astype(np.int32)
        # A scene without triangles would make Embree fail; one beyond everything is never hit.
        own = corners_m[among] if len(among) else np.full((1, 3, 3), 10 * REACH_M)
        self._triangles = np.ascontiguousarray(own, np.float32)
        self._scene = new_scene()
        self._mesh = mesh_construction.TriangleMesh(self._scene, self._triangles)

    def first(self, origins_m: Array | Floats, way: Array | Floats, reach: float = REACH_M) -> Hits:
        """The first face along rays (R, 3); reach and distances are in lengths of `way`."""
        rays = _rays(origins_m, way, np.full(len(way), reach))
        found = self._scene.run(*rays, query="INTERSECT", output=1)
        hit = with_portable_places(found, self._triangles, rays[0], rays[1])
        return Hits(self._among[hit["primID"]], hit["u"], hit["v"], hit["tfar"])

    def stops(self, origins_m: Array | Floats, way: Array | Floats, reach: Array | Floats) -> Mask:
        """Whether a face is between origins and origins + reach * way (R, 3); none where reach (R,) is negative."""
        rays = _rays(origins_m, way, reach)
        return np.asarray((self._scene.run(*rays, query="OCCLUDED") >= 0) & (rays[2] > 0))


def _rays(*parts: Array | Floats) -> list[Floats]:
    return [np.ascontiguousarray(part, np.float32) for part in parts]


class CutOuts:
    """Faces whose texture leaves holes, by the opacity of their materials."""

    def __init__(self, faces: Triangles, materials: dict[str, Material]) -> None:
        self._holed = {name: m for name, m in materials.items() if m.cutout is not None and m.texture}
        place = {name: nth for nth, name in enumerate(self._holed)}
        own = np.array([place.get(thing.material, -1) for thing in faces.things], np.int32)
        # (F + 1,), -1 for none
        self.map = np.append(own[faces.thing], -1)
        self._uv = faces.uv

    def holes(self, hits: Hits) -> Mask:
        """Which of the places (R,) are holes."""
        found = np.zeros(len(hits.face), bool)
        which = self.map[hits.face] if self._holed else np.zeros(0)
        for nth, material in enumerate(self._holed.values()):
            at = np.flatnonzero(which == nth)
            u = hits.u[at, None]
            v = hits.v[at, None]
            (a, b, c) = np.moveaxis(self._uv[hits.face[at]], 1, 0)
            found[at] = ~opaque(material, ((1 - u - v) * a + u * b + v * c) / material.tile_m)
        return found


def opaque(material: Material, places: Array) -> Mask:
    """Whether a material is solid at places (R, 2), in tiles: where its opacity is no less than its cut-out."""
    opacity = _opacity(material)
    return np.asarray(_sampled(opacity, places) >= (material.cutout or 0.0))


@lru_cache(maxsize=64)
def _opacity(material: Material) -> Floats:
    pixels = material.texture.pixels() if material.texture else np.ones((1, 1))
    has_opacity = pixels.ndim == 3 and pixels.shape[-1] == 4
    return np.asarray(pixels[..., 3] / 255 if has_opacity else np.ones((1, 1)), np.float32)


def _sampled(tile: Floats, places: Array) -> Array:
    """A repeating picture (H, W) at places (R, 2), linear between the middles of its pixels."""
    height, width = tile.shape
    x = places[:, 0] * width - 0.5
    y = places[:, 1] * height - 0.5
    x0 = np.floor(x).astype(np.int64)
    y0 = np.floor(y).astype(np.int64)
    fx = x - x0
    fy = y - y0
    left = x0 % width
    right = (x0 + 1) % width
    top = y0 % height
    bottom = (y0 + 1) % height
    upper, lower = (tile[row, left] * (1 - fx) + tile[row, right] * fx for row in (top, bottom))
    return np.asarray(upper * (1 - fy) + lower * fy)


@dataclass(frozen=True, slots=True)
class Body:
    """A body's faces: all that can be seen, those that stop light, those with holes, panes; and a sphere around."""

    seen: FaceCaster
    opaque: FaceCaster
    holed: FaceCaster | None
    panes: FaceCaster | None
    center_m: Array
    radius_m: float

    def near(self, origins_m: Array, directions: Array, reach_m: Array | float = np.inf) -> Mask:
        """Which rays (R, 3) of unit length pass the sphere within `reach_m` of their origins (R, 3)."""
        away = self.center_m - origins_m
        beside = dot(away, directions)
        along = np.clip(beside, 0, reach_m)
        return np.asarray(dot(away, away) - along * (2 * beside - along) <= self.radius_m**2)


class Bodies:
    """The faces of a scene, each in its body's frame, and rays against them; body 0 is all that stands.

    normals (F + 1, 3) and offsets_m (F + 1,) are the planes of faces, body (F + 1,) whose they are; the last entry,
    that of the face -1, is nothing.
    """

    def __init__(self, scene: Scene) -> None:
        self.faces = triangles(scene)
        corners = self.faces.corners_m
        self.normals = np.append(self.faces.plane, np.full((1, 3), np.nan), axis=0)
        self.offsets_m = np.append(dot(self.faces.plane, corners.mean(1)), np.nan)
        self.body = np.append(self.faces.mover + 1, 0)
        self._height_m = np.append(_least_height_m(corners), np.nan).astype(np.float32)
        self._edge_m = RESOLUTION * max(1.0, float(np.abs(corners).max(initial=0.0)))
        self.ray_offset_m = max(RAY_OFFSET_M, self._edge_m)
        self._twin = twins(self.faces)
        self._cut = CutOuts(self.faces, scene.materials)
        glass = [(m := scene.materials.get(t.material)) is not None and m.kind == "pane" for t in self.faces.things]
        pane = np.array(glass, bool)[self.faces.thing]
        self._bodies = [self._body(index, pane) for index in range(len(scene.movers) + 1)]
        self._paths = [mover.path for mover in scene.movers]

    def T_world_bodies(self, t_ns: NDArray[np.int64]) -> list[Array]:
        """Where the bodies are at an instant () or at some (H,): (4, 4) each, or (H, 4, 4) for what moves."""
        poses = [np.array([path.pose(t) for t in np.ravel(t_ns).tolist()]) for path in self._paths]
        return [np.eye(4), *(T if np.ndim(t_ns) else T[0] for T in poses)]

    def visible(self, directions: Array, T_bodies_camera: Sequence[Array]) -> Hits:
        """What a camera sees along unit directions (R, 3) in its own frame, NaN m away where that is nothing."""
        world, *movers = self._bodies
        origins, turned = into(T_bodies_camera[0], directions)
        seen = self._meet(world, origins, turned)
        self._seal(world, origins, turned, seen)
        for body, T_body_camera in zip(movers, T_bodies_camera[1:], strict=True):
            origins, turned = into(T_body_camera, directions)
            near = np.flatnonzero(body.near(origins, turned))
            met = self._meet(body, origins[near], turned[near])
            nearer = met.distance_m < np.nan_to_num(seen.distance_m[near], nan=np.inf)
            seen.face[near[nearer]] = met.face[nearer]
            seen.distance_m[near[nearer]] = met.distance_m[nearer]
        return seen

    def behind_panes(self, directions: Array, T_bodies_camera: Sequence[Array], distance_m: Array) -> Mask:
        """Whether glass is before what is seen at some distance (R,), or before nothing where that is NaN."""
        behind = np.zeros(len(directions), bool)
        limit_m = np.nan_to_num(distance_m, nan=REACH_M)
        for body, T_body_camera in zip(self._bodies, T_bodies_camera, strict=True):
            if body.panes is not None:
                origins, turned = into(T_body_camera, directions)
                behind |= body.panes.stops(origins, turned, limit_m)
        return behind

    def blocked(self, starts_m: Floats, way: Floats, T_bodies_world: Sequence[Array], reach: Floats) -> Mask:
        """Whether anything but glass is between starts and starts + reach * way (R, 3), both in the world."""
        world, *movers = self._bodies
        hidden = self._stopped(world, starts_m, way, reach)
        for body, T_body_world in zip(movers, T_bodies_world[1:], strict=True):
            start = moved(T_body_world, starts_m.astype(float))
            turned = turn(T_body_world, way.astype(float))
            length_m = np.linalg.norm(turned, axis=1)
            near = np.flatnonzero(body.near(start, turned / length_m[:, None], length_m) & ~hidden & (reach > 0))
            hidden[near] = self._stopped(body, start[near], turned[near], reach[near])
        return hidden

    def _body(self, index: int, pane: Mask) -> Body:
        member = (self.body[:-1] == index) & (self._height_m[:-1] > 0)
        points = self.faces.corners_m[member].reshape(-1, 3)
        center_m = (points.min(0) + points.max(0)) / 2 if len(points) else np.zeros(3)
        radius_m = float(np.linalg.norm(points - center_m, axis=1).max(initial=0.0)) + RAY_OFFSET_M

        def caster(which: Mask) -> FaceCaster:
            return FaceCaster(self.faces.corners_m, np.flatnonzero(member & which))

        # Of two faces back to back only one is there for rays: they could meet either.
        one = (self._twin[:-1] < 0) | (self._twin[:-1] > np.arange(len(pane)))
        seen = caster(one & ~pane)
        holed = member & one & ~pane & (self._cut.map[:-1] >= 0)
        glass = member & pane
        opaque = caster(one & ~pane & ~holed) if holed.any() else seen
        holed_caster, glass_caster = (caster(part) if part.any() else None for part in (holed, glass))
        return Body(seen, opaque, holed_caster, glass_caster, center_m, radius_m)

    def _stopped(self, body: Body, starts_m: Array | Floats, way: Array | Floats, reach: Floats) -> Mask:
        """Whether a body stops light on its way, from either side of its faces but not through their holes."""
        stopped = body.opaque.stops(starts_m, way, reach)
        rays = np.flatnonzero(~stopped & (reach > 0)) if body.holed else np.zeros(0, np.intp)
        start = starts_m[rays]
        ahead = way[rays] * reach[rays, None]
        for _ in range(MOST_PASSED):
            if not len(rays) or not body.holed:
                break
            hits = body.holed.first(start, ahead, 1.0)
            hole = self._cut.holes(hits)
            stopped[rays[(hits.face >= 0) & ~hole]] = True
            on = (hits.distance_m + RAY_OFFSET_M / np.linalg.norm(ahead, axis=1))[:, None]
            further = hole & (on[:, 0] < 1)
            rays = rays[further]
            start = (start + on * ahead)[further]
            ahead = (ahead * (1 - on))[further]
        return stopped

    def _meet(self, body: Body, origins_m: Array, directions: Array) -> Hits:
        """The first face of a body that rays (R, 3) in its frame meet from its front.

        Embree, in float32, says which; where, the plane's equation does. Where a ray passes so close to an edge that
        float32 may take the wrong face, float64 decides.
        """
        hits, cosine = self._first_front(body, origins_m, directions)
        distance_m = (self.offsets_m[hits.face] - dot(self.normals[hits.face], origins_m)) / cosine
        within = np.minimum(np.minimum(hits.u, hits.v), 1 - hits.u - hits.v) * self._height_m[hits.face]
        doubtful = np.flatnonzero(-cosine * within < self._edge_m)
        distance_m[doubtful] = hits.distance_m[doubtful]
        seen = replace(hits, distance_m=distance_m)
        self._settle(body, origins_m, directions, seen, doubtful)
        return seen

    def _first_front(
        self, body: Body, origins_m: Array, directions: Array, most: int = MOST_PASSED
    ) -> tuple[Hits, Array]:
        """What rays meet as Embree says, backs and holes passed, and the cosines (R,) to the faces' normals."""
        hits = body.seen.first(origins_m, directions)
        holes = self._cut.holes(hits)
        cosine = self._fronts(hits.face, directions)
        passed = np.flatnonzero((cosine >= 0) | holes)
        if len(passed) and most:
            aside = np.maximum(np.abs(cosine[passed]), GRAZING)
            on_m = hits.distance_m[passed] + 3 * self._edge_m / aside
            start = origins_m[passed] + on_m[:, None] * directions[passed]
            onward, cosine[passed] = self._first_front(body, start, directions[passed], most - 1)
            hits.face[passed] = onward.face
            hits.u[passed] = onward.u
            hits.v[passed] = onward.v
            hits.distance_m[passed] = on_m + onward.distance_m
        return hits, cosine

    def _fronts(self, face: Indices, directions: Array) -> Array:
        """Cosines (R,) to the normals of faces; where one's back is met and it has a twin, it becomes that."""
        cosine = dot(self.normals[face], directions)
        backs = np.flatnonzero(cosine >= 0)
        backs = backs[self._twin[face[backs]] >= 0]
        face[backs] = self._twin[face[backs]]
        cosine[backs] = -cosine[backs]
        return cosine

    def _seal(self, body: Body, origins_m: Array, directions: Array, seen: Hits) -> None:
        """Close the gaps that float32 leaves between faces: what meets nothing is asked again a hair aside."""
        missed = np.flatnonzero(seen.face < 0)
        aside = directions[missed] + (self._edge_m * AXES.sum(0))
        gaps = missed[body.seen.first(origins_m[missed], aside).face >= 0]
        self._settle(body, origins_m, directions, seen, gaps)

    def _settle(self, body: Body, origins_m: Array, directions: Array, seen: Hits, doubtful: Pixels) -> None:
        """The faces that rays meet in float64, among those that Embree finds there and a little to four sides."""
        if not len(doubtful):
            return
        origins = origins_m[doubtful]
        ahead = directions[doubtful]
        reach_m = seen.distance_m[doubtful]
        right = unit(np.cross(ahead, AXES[np.argmin(np.abs(ahead), axis=1)]))
        down = np.cross(ahead, right)
        step_m = 3 * self._edge_m / np.where(reach_m > 0, reach_m, 1)[:, None]
        origins = np.concatenate([origins] * 5)
        aside = np.concatenate([ahead + step_m * way for way in (0 * right, right, down, -right, -down)])
        face = self._first_front(body, origins, aside)[0].face.reshape(5, -1)
        face[0] = seen.face[doubtful]
        distance_m = self._exact_m(face.ravel(), origins, np.concatenate([ahead] * 5)).reshape(5, -1)
        best = distance_m.argmin(0), np.arange(len(doubtful))
        met = np.isfinite(distance_m[best])
        seen.face[doubtful[met]] = face[best][met]
        seen.distance_m[doubtful[met]] = distance_m[best][met]
        # Past an outline; where all are faces, the ray is in a joint between them, and Embree's word stands.
        past = doubtful[~met & (face < 0).any(0)]
        seen.face[past] = -1
        seen.distance_m[past] = np.nan

    def _exact_m(self, face: Indices, origins_m: Array, directions: Array) -> Array:
        """How far along rays (R, 3) their faces' fronts are, infinite where they pass them by."""
        normals = self.normals[face]
        corners = self.faces.corners_m[face]
        cosine = dot(normals, directions)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance_m = (self.offsets_m[face] - dot(normals, origins_m)) / cosine
            points = origins_m + distance_m[:, None] * directions
            edges = np.roll(corners, -1, axis=1) - corners
            inward = np.cross(normals[:, None], unit(edges))
            inside_m = np.einsum("rei,rei->re", inward, points[:, None] - corners).min(1)
            met = (cosine < 0) & (distance_m > 0) & (inside_m >= -WATERTIGHT / RESOLUTION * self._edge_m)
        return np.where(met, distance_m, np.inf)


AXES = np.eye(3)


def _least_height_m(corners_m: Array) -> Array:
    """The least of the three heights (F,) of triangles (F, 3, 3)."""
    edges = corners_m - np.roll(corners_m, 1, axis=1)
    longest = np.maximum(np.linalg.norm(edges, axis=2).max(1), 1e-30)
    return np.asarray(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / longest)


def twins(faces: Triangles) -> Indices:
    """The face (F + 1,) of the same thing with the same corners that looks the other way, -1 for none."""
    corners = _numbered(faces.corners_m.reshape(-1, 3)).reshape(-1, 3)
    key = _numbered(np.column_stack([np.sort(corners, axis=1), faces.thing]))
    order = np.argsort(key, kind="stable")
    first = order[:-1]
    second = order[1:]
    pair = (key[first] == key[second]) & (dot(faces.plane[first], faces.plane[second]) < 0)
    pair[1:] &= ~pair[:-1]
    twin = np.full(len(faces) + 1, -1, np.int32)
    twin[first[pair]] = second[pair]
    twin[second[pair]] = first[pair]
    return twin


def _numbered(rows: NDArray[Any]) -> NDArray[np.int64]:
    """Numbers (N,) that are equal where rows (N, K) are."""
    order = np.lexsort(rows.T)
    numbers = np.zeros(len(rows), np.int64)
    numbers[order[1:]] = np.cumsum((np.diff(rows[order], axis=0) != 0).any(1))
    return numbers


def into(T_body_camera: Array, directions: Array) -> tuple[Array, Array]:
    """Rays from a camera's centre along unit directions (R, 3): origins (R, 3) and directions in a body's frame."""
    turned = turn(T_body_camera, directions)
    return np.broadcast_to(T_body_camera[..., :3, 3], turned.shape), turned


def turn(T_a_b: Array, vectors: Array) -> Array:
    """Directions (R, 3) in b as directions in a."""
    R = T_a_b[..., :3, :3]
    # Not by BLAS: its threads spin on products as narrow as these.
    return np.asarray(np.einsum("ij,rj->ri" if R.ndim == 2 else "rij,rj->ri", R, vectors))


def moved(T_a_b: Array, points: Array) -> Array:
    """Points (R, 3) in b as points in a."""
    return turn(T_a_b, points) + T_a_b[..., :3, 3]


def dot(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Products (R,) of vectors (R, 3)."""
    return np.asarray(np.einsum("ri,ri->r", a, b))


@dataclass(frozen=True, slots=True)
class Shot:
    """Where a camera is and when it takes a picture: a pose (4, 4) and an instant, or (H, 4, 4) and (H,) by row."""

    T_world_camera: Array
    t_ns: NDArray[np.int64] | int


@dataclass(frozen=True, slots=True)
class ShotTransforms:
    """A shot as transforms, there and back: each body's (4, 4), or (H, 4, 4) by row."""

    T_world_bodies: list[Array]
    T_bodies_world: list[Array]
    T_bodies_camera: list[Array]
    T_camera_bodies: list[Array]

    @property
    def by_row(self) -> bool:
        """Whether the camera or a body moves while the rows are exposed."""
        return any(T.ndim == 3 for T in self.T_bodies_camera)


def shot_transforms(bodies: Bodies, shot: Shot) -> ShotTransforms:
    """The transforms of a shot."""
    T_world_bodies = bodies.T_world_bodies(np.asarray(shot.t_ns, np.int64))
    T_bodies_world = [se3.inverse(T) for T in T_world_bodies]
    T_bodies_camera = [T @ shot.T_world_camera for T in T_bodies_world]
    return ShotTransforms(T_world_bodies, T_bodies_world, T_bodies_camera, [se3.inverse(T) for T in T_bodies_camera])


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
    return np.asarray((1 - share) * table[first] + share * table[np.minimum(first + 1, len(table) - 1)])


def of(T: Array, rays: Pixels) -> Array:
    """Some rays' transforms: the only one, or their own of (R, 4, 4)."""
    return T if T.ndim == 2 else T[rays]
