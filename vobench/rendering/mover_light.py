"""Light on movers, and what they keep from the rest."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import doubled_areas_px2
from vobench.rendering.bake import BakedScene, StaticScene, bodies
from vobench.rendering.culling import bounds
from vobench.rendering.direct_light import Rays, arriving, footprint_m, mirror_images, place_in_cell, reached
from vobench.rendering.emitter import Emitter, emitters
from vobench.rendering.geometry import BoundingSphere, RayCaster, face_materials
from vobench.rendering.indirect_light import FinalGather, Gatherer, blend, response, surfels
from vobench.rendering.texel import Texels, texels
from vobench.rendering.texel_owner import owners
from vobench.rendering.thread_pool import chunked
from vobench.rendering.view import Box, PinholeView
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, Light, Sky, Sun
from vobench.scene.mesh import Triangles, areas_m2

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

Views = Sequence[tuple[PinholeView, Box]]
# rays along a side from points on movers, to an emitter and to the sky
SIDE = 3
SKY_SIDE = 5
# the same from points in their shade
SHADE_SIDE = 2
SKY_SHADE_SIDE = 3
SKY_REACH = 10  # radii beyond which a mover hides less than a hundredth of an open sky
GATHER_RAYS = 64
GATHER_M = 0.2  # between places that gather indirect light
UNNOTICED = 1 / 300  # share of a place's light, less than a step of 8 bits
STEEPEST = 0.999  # sine of the angle of a frustum that is as good as open to all sides
SMOOTHINGS = 2  # of the sky's shade
READ_TEXELS = 2  # from what is seen, as far as pictures read light
AHEAD_M = 0.3  # beyond what a view needs: the other eye is about there
UNSURE = 0.2  # spread of what the points around keep from each other, as a share: there a point asks for itself


def may_shade(mover: BoundingSphere, emitter: BoundingSphere, points: BoundingSphere) -> Mask:
    """Whether a way from within each of `points` (N,) to within the emitter's ball can pass the mover's.

    All ways lie in a cone frustum about the line between the two balls, here one a little wider.
    """
    to_mover = mover.centre_m - points.centre_m
    far2 = np.einsum("ij,ij->i", to_mover, to_mover)
    near = mover.radius_m + points.radius_m
    if np.isinf(emitter.radius_m):
        return np.asarray(far2 <= (SKY_REACH * mover.radius_m + points.radius_m) ** 2)
    to_emitter = emitter.centre_m - points.centre_m
    far_emitter = np.maximum(np.sqrt(np.einsum("ij,ij->i", to_emitter, to_emitter)), 1e-9)
    along = np.einsum("ij,ij->i", to_mover, to_emitter) / far_emitter
    slope = np.minimum((emitter.radius_m + points.radius_m) / far_emitter, STEEPEST)
    aside = np.sqrt(np.maximum(far2 - along**2, 0))
    within = aside * np.sqrt(1 - slope**2) <= near + slope * np.maximum(along, 0)
    ahead = along <= far_emitter + emitter.radius_m + near
    return np.asarray((far2 <= near**2) | (within & ahead & (along >= -near)))


class Casters:
    """Several ray casters as one."""

    def __init__(self, *casters: RayCaster) -> None:
        self._casters = casters

    def stops(self, origins_m: Floats, way: Floats) -> Mask:
        """Whether anything is between origins and origins + way (R, 3)."""
        hidden = np.zeros(len(origins_m), bool)
        for caster in self._casters:
            some = np.flatnonzero(~hidden)
            hidden[some] = caster.stops(origins_m[some], way[some])
        return hidden


@dataclass(slots=True)
class MoverLightAt:
    """Movers at one instant: each light's direct light (L, M) on their points.

    gathered: what reaches their groups of points from the surfels and lamps of what stands still. movers, balls: they
    as faces that rays meet, and around their parts. known (C,): the cells whose shade has been looked for; lost: of a
    light the points (N,) there from which they keep some of it, and how much (N,).
    """

    direct: Floats
    gathered: FinalGather
    movers: RayCaster
    balls: list[BoundingSphere]
    shining: "list[list[_Lit]]"
    known: Mask
    lost: list[tuple[int, Rows, Floats]]


@dataclass(frozen=True, slots=True)
class _Lit:
    """Points that stand still and have an emitter's light, surfel by surfel: has (P,) says which.

    points (N,): in the order of their cells (C,), cell by cell from starts (C + 1,) on; balls around each of these.
    """

    emitter: Emitter
    is_soft: bool
    has: Mask
    points: Rows
    cells: Indices
    balls: BoundingSphere
    starts: Rows

    def near(self, movers: Sequence[BoundingSphere], among: Mask) -> Mask:
        """Of which of the cells among all (A,) some point may lose light to one of the movers, given as balls."""
        asked = np.flatnonzero(among[self.cells])
        balls = self.balls.take(asked)
        near = np.zeros(len(asked), bool)
        for parts_at in movers:
            some = np.flatnonzero(~near & may_shade(_around(parts_at), self.emitter.ball, balls))
            cells = balls.take(some)
            for part in range(len(parts_at.radius_m)):
                near[some] |= may_shade(parts_at.take(slice(part, part + 1)), self.emitter.ball, cells)
        found = np.zeros(len(among), bool)
        found[self.cells[asked[near]]] = True
        return found

    def within(self, among: Mask) -> Rows:
        """Its points in the cells among all (A,)."""
        return self.points[spans(self.starts, np.flatnonzero(among[self.cells]))]


class MoverLight:
    """The light of a baked scene's movers."""

    def __init__(self, baked: BakedScene, still: StaticScene) -> None:
        self._baked = baked
        self._still = still
        self._lights = baked.scene.lights
        faces = baked.faces
        materials = baked.scene.materials
        looks = [m is not None and m.kind == "pane" for m in face_materials(faces, materials)]
        solid = ~np.array(looks, bool)[faces.thing]
        own = [np.flatnonzero((faces.mover == nth) & solid) for nth in range(len(baked.scene.movers))]
        self._solid = [nth for nth, some in enumerate(own) if len(some)]
        self._bodies = faces.some(np.concatenate([NONE, *own]))
        self._parts = [parts(faces.corners_m[own[nth]]) for nth in self._solid]
        moves = (faces.mover >= 0) & bodies(baked.scene, faces)
        self._points, self._layout = texels(
            faces, materials, baked.atlas, owners(baked.atlas), among=moves, seed=baked.settings.seed
        )
        self._mover = faces.mover[self._points.face]
        self._by_cell = np.argsort(still.cells, kind="stable")
        self._cells = _cells(baked, still, self._by_cell)
        self._texels = np.argsort(still.layout.source, kind="stable").astype(np.int32)
        self._begins = np.searchsorted(still.layout.source[self._texels], np.arange(len(still.points) + 1))
        self._lit: dict[tuple[int, float], list[_Lit]] = {}
        self._groups, self._blend = self._grouped(faces)
        self._own = np.flatnonzero(self._layout.source < len(self._points))
        self._blend = self._blend[self._own]
        self._gatherer = Gatherer(
            baked.atlas,
            still.visibility,
            response(faces, materials, still.visibility),
            [light for light in self._lights if isinstance(light, Sky)],
            baked.patches.surfel_of,
            len(baked.patches.area_m2),
            len(self._lights),
        )
        self._straight = [layer.ravel()[still.points.index] for layer in baked.direct]

    def _grouped(self, faces: Triangles) -> "tuple[Rows, csr_matrix]":
        """The points that gather light for their neighbours, and how these take it (H·W, S)."""
        points = self._points
        moving = np.flatnonzero(faces.mover >= 0)
        alone = Visibility(faces, self._baked.scene.materials, moving)
        steps = np.full(len(points), GATHER_M, np.float32)
        groups = surfels(points, faces.thing[points.face], steps, alone)
        return groups.middle, blend(points, groups, self._layout, alone, np.ones(len(groups), bool))

    def at(self, t_ns: float, suns_ns: Sequence[float], is_on: Sequence[bool]) -> MoverLightAt:
        """What the movers' places decide, but for their shade.

        suns_ns (L,): the instant of each sun that moves; is_on (L,): which lights are on at all.
        """
        poses = [mover.path.pose(t_ns) for mover in self._baked.scene.movers]
        movers = RayCaster(self._bodies.moved(poses))
        balls = [_moved_ball(own, poses[n]) for own, n in zip(self._parts, self._solid, strict=True)]
        points = self._placed(poses)
        together = copy(self._still.visibility)
        together.opaque = Casters(together.opaque, movers)  # type: ignore[assignment]
        direct = np.zeros((len(self._lights), len(points)), np.float32)
        shining = [self._lit_by(i, suns_ns[i]) if is_on[i] else [] for i in range(len(self._lights))]
        for index, lit in enumerate(shining):
            for emitter in [one.emitter for one in lit]:
                some = reached(emitter, points, np.arange(len(points)))
                side = SKY_SIDE if emitter.sky else SIDE
                direct[index, some] += arriving(emitter, points, some, together, Rays(side))[0]
        count = GATHER_RAYS if self._baked.settings.bounces else 0
        gathered = self._gatherer.gather(points.take(self._groups), rays=count)
        known = np.zeros(int(self._still.cells.max(initial=-1)) + 1, bool)
        return MoverLightAt(direct, gathered, movers, balls, shining, known, [])

    def shade(self, moment: MoverLightAt, views: Views | None) -> None:
        """Find what the movers keep from all that views show, or from everything."""
        inside_m = np.full(len(moment.known), np.inf) if views is None else _inside_m(self._cells, views)
        if not ((inside_m > 0) & ~moment.known).any():
            return
        new = (inside_m > -AHEAD_M) & ~moment.known
        moment.known = moment.known | new
        for index, shining in enumerate(moment.shining):
            taken = np.zeros(len(self._still.points), np.float32)
            found = [self._lost(lit, index, moment, new) for lit in shining]
            for some, lost in found:
                taken[some] += lost
            some = _distinct(np.concatenate([NONE, *(points[lost > 0] for points, lost in found)]))
            # Rounding apart, nothing is taken that had not come.
            moment.lost.append((index, some, np.minimum(taken[some], self._straight[index][some])))

    def add(self, moment: MoverLightAt, still: Floats, levels: Sequence[float]) -> Floats:
        """The map (H, W, 3) of all that stands still with the movers' light and shade."""
        total = still.copy()
        strength = np.asarray(levels, np.float32)
        colours = strength[:, None] * np.array([light.colour for light in self._lights], np.float32)
        flat = total.reshape(-1, 3)
        row = np.zeros(len(self._still.points), np.int32)
        points = _distinct(np.concatenate([NONE, *(some for _, some, _ in moment.lost)]))
        row[points] = np.arange(len(points))
        shade = np.zeros((len(points), 3), np.float32)
        for index, some, taken in moment.lost:
            shade[row[some]] += taken[:, None] * colours[index]
        shaded = self._texels[spans(self._begins, points)]
        flat[shaded] = np.maximum(flat[shaded] - np.repeat(shade, np.diff(self._begins)[points], axis=0), 0)
        lit = (moment.direct.T @ colours)[self._layout.source[self._own]]
        flat[self._own] = lit + self._blend @ self._around(moment.gathered, colours)
        return total

    def _around(self, gathered: FinalGather, colours: Floats) -> Floats:
        """Illuminance (S, 3) of the movers' groups by bounces, lamps in mirrors included."""
        radiosity = np.einsum("lsc,lc->sc", self._baked.patches.radiosity, colours)
        glow = [np.pi * x.luminance_cd_m2 if isinstance(x, AreaLight) else 0 for x in self._lights]
        sent = np.concatenate([radiosity, np.array(glow, np.float32)[:, None] * colours])
        skies = [colour for colour, x in zip(colours, self._lights, strict=True) if isinstance(x, Sky)]
        by_mirrors = gathered.sky.T @ np.array(skies, np.float32).reshape(-1, 3)
        return np.asarray(gathered.table @ sent + by_mirrors, np.float32)

    def _placed(self, poses: Sequence[Array]) -> Texels:
        """The movers' points where they are."""
        p = self._points
        T = np.array(poses)[self._mover]

        def turned(vectors: Floats) -> Floats:
            return np.asarray(np.einsum("nij,nj->ni", T[:, :3, :3], vectors), np.float32)

        names = ("normals", "planes", "step_u_m", "step_v_m")
        vectors: dict[str, Any] = {name: turned(getattr(p, name)) for name in names}
        return replace(p, points_m=(turned(p.points_m) + T[:, :3, 3]).astype(np.float32), **vectors)

    def _shining(self, light: Light, sun_ns: float) -> list[Emitter]:
        """What a light shines from, its images in mirrors included."""
        t_ns = sun_ns if isinstance(light, Sun) and light.moves else 0.0
        own = emitters(light, self._still.visibility, t_ns=t_ns)
        return [*own, *mirror_images(light, self._still.visibility, t_ns=t_ns)]

    def _lit_by(self, index: int, sun_ns: float) -> list[_Lit]:
        """All that a light shines from, each with the points that it may light, a moving sun at an instant of its."""
        key = index, sun_ns
        if key not in self._lit:
            self._lit = {other: lit for other, lit in self._lit.items() if other[0] != index}
            self._lit[key] = [self._lit_from(x, index) for x in self._shining(self._lights[index], sun_ns)]
        return self._lit[key]

    def _lit_from(self, emitter: Emitter, index: int) -> _Lit:
        points = self._still.points
        straight = self._straight[index]
        some = reached(emitter, points, self._by_cell[straight[self._by_cell] > UNNOTICED * straight.max(initial=0)])
        has = np.zeros(len(points), bool)
        cells = self._still.cells[some]
        has[some] = True
        starts = np.flatnonzero(np.diff(cells, prepend=-1, append=-1))
        is_soft = bool((emitter.width_rad(points.points_m[some]) > 0).any())
        return _Lit(emitter, is_soft, has, some, cells[starts[:-1]], _balls(points.points_m[some], starts), starts)

    def _lost(self, lit: _Lit, index: int, moment: MoverLightAt, new: Mask) -> tuple[Rows, Floats]:
        """Points (N,) in new cells and the illuminance (N,) that movers take from them.

        Soft shadows are asked at few points, and at others where those around differ, as light is. What is found at
        a point does not hang on which others are asked for.
        """
        straight = self._straight[index]
        layout = self._still.layout
        near = lit.near(moment.balls, new)
        wanted = some = lit.within(near)
        if not lit.is_soft:
            return some, self._traced(lit.emitter, some, moment.movers, SHADE_SIDE)
        is_pane = lit.emitter.sky == "pane"
        for _ in range(SMOOTHINGS if is_pane else 0):
            some = self._may_lose(lit, moment, near, np.append(some, layout.neighbours[:, some]))
        is_few = layout.is_sparse[some]
        rest = some[~is_few]
        weights = layout.weights[rest]
        few = self._may_lose(lit, moment, near, np.append(some[is_few], weights.indices))
        side = SKY_SHADE_SIDE if is_pane else SHADE_SIDE
        share = np.zeros(len(straight), np.float32)
        share[few] = self._traced(lit.emitter, few, moment.movers, side) / straight[few]
        each = share[weights.indices]
        known = weights.data * lit.has[weights.indices]
        with np.errstate(invalid="ignore", divide="ignore"):
            count = np.add.reduceat(known, weights.indptr[:-1])
            mean, square = (np.add.reduceat(known * each**power, weights.indptr[:-1]) / count for power in (1, 2))
            unsure = ~(np.sqrt(np.maximum(square - mean**2, 0)) <= UNSURE)
        share[rest] = np.where(unsure, 0, mean)
        asked = rest[unsure]
        share[asked] = self._traced(lit.emitter, asked, moment.movers, side) / straight[asked]
        for _ in range(SMOOTHINGS if is_pane else 0):
            share[some] = (4 * share[some] + share[layout.neighbours[:, some]].sum(0)) / 8
        return wanted, share[wanted] * straight[wanted]

    def _may_lose(self, lit: _Lit, moment: MoverLightAt, near: Mask, points: Rows) -> Rows:
        """Those of some points, each once, that have an emitter's light and may lose some of it.

        near (C,): the cells of which that is known; it is asked for others.
        """
        points = _distinct(points[lit.has[points]])
        cells = self._still.cells[points]
        others = np.zeros(len(near), bool)
        others[cells[~near[cells]]] = True
        return points[(near | lit.near(moment.balls, others))[cells]]

    def _traced(self, emitter: Emitter, some: Rows, movers: RayCaster, side: int) -> Floats:
        return chunked(lambda part: self._lost_at(emitter, some[part], movers, side), len(some))

    def _lost_at(self, emitter: Emitter, some: Rows, movers: RayCaster, side: int) -> Floats:
        own = self._still.points.take(some)
        towards = emitter.towards(own)
        lost = np.zeros(len(own), np.float32)
        for cell in range(side**2):
            way, strength = towards(*place_in_cell(own, cell, side))
            cosine = own.cosine(way)
            light = strength * np.maximum(cosine, 0) * own.entering(cosine)
            aside = footprint_m(own, slice(None), cell)
            start = own.points_m + aside
            ahead = way - aside
            hit = np.flatnonzero(movers.stops(start, ahead) & (light > 0))
            lost[hit] += light[hit] * emitter.passing(self._still.visibility, start[hit], ahead[hit])
        return lost / np.float32(side**2)


NONE = np.zeros(0, np.int64)


def _distinct(points: Rows) -> Rows:
    """Each of some points (N,) once, in order."""
    points = np.sort(points)
    return np.asarray(points[np.diff(points, prepend=-1) > 0])


def spans(begins: Rows, some: Rows) -> Rows:
    """All numbers from begins[i] to begins[i + 1] for some i (N,), one after the other."""
    count = begins[some + 1] - begins[some]
    ends = np.cumsum(count)
    return np.asarray(np.arange(ends[-1] if len(ends) else 0) + np.repeat(begins[some] - ends + count, count))


def _cells(baked: BakedScene, still: StaticScene, by_cell: Rows) -> BoundingSphere:
    """Balls (C,) around all places that read light of the cells of what stands still."""
    faces = still.faces
    some = still.points.face[by_cell]
    with np.errstate(divide="ignore", invalid="ignore"):
        texel_m = np.sqrt(2 * areas_m2(faces.corners_m) / np.abs(doubled_areas_px2(baked.atlas.light_px)))
    starts = np.flatnonzero(np.diff(still.cells[by_cell], prepend=-1, append=-1))
    around = _balls(still.points.points_m[by_cell], starts)
    farthest = np.maximum.reduceat(np.where(np.isfinite(texel_m), texel_m, 0)[some], starts[:-1])
    return BoundingSphere(around.centre_m, around.radius_m + READ_TEXELS * farthest)


def _inside_m(cells: BoundingSphere, views: Views) -> Floats:
    """How far cells (C,) reach into what one of the views shows, at least; negative for how far they are from all."""
    farthest = np.full(len(cells.radius_m), -np.inf)
    for view, box in views:
        planes = bounds(view, box)
        planes /= np.linalg.norm(planes[:, :3], axis=1)[:, None]
        middle_m = np.einsum("ij,kj->ik", planes[:, :3], cells.centre_m) + planes[:, 3:]
        farthest = np.maximum(farthest, middle_m.min(0) + cells.radius_m)
    return farthest


def _balls(points_m: Floats, starts: NDArray[np.int64]) -> BoundingSphere:
    """Balls (C,) around points (N, 3) from each start (C + 1,) to the next."""
    if not len(points_m):
        return BoundingSphere(np.zeros((0, 3)), np.zeros(0))
    count = np.diff(starts)
    centre = np.add.reduceat(points_m.astype(float), starts[:-1]) / count[:, None]
    apart = np.linalg.norm(points_m - np.repeat(centre, count, axis=0), axis=1)
    return BoundingSphere(centre, np.maximum.reduceat(apart, starts[:-1]))


def _around(balls: BoundingSphere) -> BoundingSphere:
    """One ball (1,) around several."""
    centre = balls.centre_m.mean(0)
    reach = np.linalg.norm(balls.centre_m - centre, axis=1) + balls.radius_m
    return BoundingSphere(centre[None], reach.max(keepdims=True))


MOST_PARTS = 8


def parts(corners_m: Array) -> BoundingSphere:
    """Balls (K,) that enclose faces (F, 3, 3) together: of those in slices across the longest side of their box."""
    points = corners_m.reshape(-1, 3)
    low = points.min(0)
    size = np.ptp(points, axis=0)
    longest = int(size.argmax())
    count = int(np.clip(np.ceil(size[longest] / max(np.sort(size)[1], 1e-3)), 1, MOST_PARTS))
    part = np.where(np.arange(3) == longest, size / count, size)
    centres = low + part / 2 + np.arange(count)[:, None] * np.eye(3)[longest] * part
    return BoundingSphere(centres, np.full(count, float(np.linalg.norm(part) / 2)))


def _moved_ball(own: BoundingSphere, T_world_body: NDArray[np.float64]) -> BoundingSphere:
    return BoundingSphere(se3.apply(T_world_body, own.centre_m), own.radius_m)
