"""Light on movers, and what they keep from the rest."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.render.bake import BakedScene, StaticScene, bodies
from vobench.render.direct_light import Rays, arriving, cell_spot, footprint, in_front, mirror_images
from vobench.render.emitter import Emitter, emitters
from vobench.render.geometry import Ball, Floats, Mask, RayCaster, Visibility, face_materials
from vobench.render.indirect_light import FinalGather, Gatherer, blend, response, surfels
from vobench.render.lightmap import Places, Texels, in_chunks, owners, texels
from vobench.scene.light import AreaLight, Light, Sky, Sun
from vobench.scene.mesh import Triangles

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

SIDE, SKY_SIDE = 3, 5  # rays along a side from points on movers, to an emitter and to the sky
SHADE_SIDE, SKY_SHADE_SIDE = 2, 3  # the same from points in their shade
SKY_REACH = 10  # radii beyond which a mover hides less than a hundredth of an open sky
GATHER_RAYS = 64
GATHER_M = 0.2  # between places that gather indirect light
UNNOTICED = 1 / 300  # share of a place's light, less than a step of 8 bits
STEEPEST = 0.999  # sine of the angle of a frustum that is as good as open to all sides
SMOOTHINGS = 2  # of the sky's shade
UNSURE = 0.2  # spread of what the points around keep from each other, as a share: there a point asks for itself


def may_shade(mover: Ball, emitter: Ball, points: Ball) -> Mask:
    """Whether a way from within each of `points` (N,) to within the emitter's ball can pass the mover's.

    All ways lie in a cone frustum about the line between the two balls, here one a little wider.
    """
    to_mover = mover.centre_m - points.centre_m
    far2, near = np.einsum("ij,ij->i", to_mover, to_mover), mover.radius_m + points.radius_m
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


class MovingCaster:
    """Rays against bodies where they are: each caster is in its body's frame, and T_body_world (4, 4) leads there."""

    def __init__(self, bodies: Sequence[tuple[RayCaster, Array]], still: RayCaster | None = None) -> None:
        self._bodies, self._still = bodies, still

    def stops(self, origins_m: Floats, way: Floats) -> Mask:
        """Whether anything is between origins and origins + way (R, 3)."""
        hidden = self._still.stops(origins_m, way) if self._still else np.zeros(len(origins_m), bool)
        for caster, T in self._bodies:
            some = np.flatnonzero(~hidden)
            hidden[some] = caster.stops(se3.apply(T, origins_m[some]), way[some] @ T[:3, :3].T)
        return hidden


@dataclass(frozen=True, slots=True)
class MoverLightAt:
    """Movers at one instant: each light's direct light (L, M) on their points.

    lost: of each light the points (N,) from which they keep some of it, and how much (N,). gathered: what reaches
    their groups of points from the surfels and lamps of what stands still.
    """

    direct: Floats
    lost: list[tuple[Places, Floats]]
    gathered: FinalGather


@dataclass(frozen=True, slots=True)
class _Lit:
    """Points (N,) that stand still and have an emitter's light, surfel by surfel.

    cells: balls (C,) around those of each surfel, whose points begin at starts (C + 1,).
    """

    emitter: Emitter
    is_soft: bool
    points: Places
    cells: Ball
    starts: NDArray[np.int64]

    def near(self, movers: Sequence[Ball]) -> Places:
        """Those that may lose some of their light to one of the movers, each of them given as balls."""
        near = np.zeros(len(self.cells.radius_m), bool)
        for parts_at in movers:
            whole = _around(parts_at)
            some = np.flatnonzero(~near & may_shade(whole, self.emitter.ball, self.cells))
            cells = self.cells.take(some)
            for part in range(len(parts_at.radius_m)):
                near[some] |= may_shade(parts_at.take(slice(part, part + 1)), self.emitter.ball, cells)
        return np.asarray(self.points[np.repeat(near, np.diff(self.starts))])


class MoverLight:
    """The light of a baked scene's movers."""

    def __init__(self, baked: BakedScene, still: StaticScene) -> None:
        self._baked, self._still, self._lights = baked, still, baked.scene.lights
        faces, materials = baked.faces, baked.scene.materials
        looks = [m is not None and m.kind == "pane" for m in face_materials(faces, materials)]
        solid = ~np.array(looks, bool)[faces.thing]
        own = [np.flatnonzero((faces.mover == nth) & solid) for nth in range(len(baked.scene.movers))]
        self._solid = [nth for nth, some in enumerate(own) if len(some)]
        self._casters = [RayCaster(faces, own[nth]) for nth in self._solid]
        self._parts = [parts(faces.corners_m[own[nth]]) for nth in self._solid]
        moves = (faces.mover >= 0) & bodies(baked.scene, faces)
        self._points, self._layout = texels(
            faces, materials, baked.atlas, owners(baked.atlas), among=moves, seed=baked.settings.seed
        )
        self._mover = faces.mover[self._points.face]
        self._by_cell = np.argsort(still.cells, kind="stable")
        self._lit: dict[tuple[int, float], list[_Lit]] = {}
        self._groups, self._blend = self._grouped(faces)
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

    def _grouped(self, faces: Triangles) -> "tuple[Places, csr_matrix]":
        """The points that gather light for their neighbours, and how these take it (H·W, S)."""
        points, moving = self._points, np.flatnonzero(faces.mover >= 0)
        alone = Visibility(faces, self._baked.scene.materials, moving)
        steps = np.full(len(points), GATHER_M, np.float32)
        groups = surfels(points, faces.thing[points.face], steps, alone)
        return groups.middle, blend(points, groups, self._layout, alone, np.ones(len(groups), bool))

    def at(self, t_ns: float, suns_ns: Sequence[float], is_on: Sequence[bool]) -> MoverLightAt:
        """All that the movers' places decide.

        suns_ns (L,): the instant of each sun that moves; is_on (L,): which lights are on at all.
        """
        poses = [mover.path.pose(t_ns) for mover in self._baked.scene.movers]
        solid = [(caster, se3.inverse(poses[n])) for caster, n in zip(self._casters, self._solid, strict=True)]
        parts_at = [_moved_ball(own, poses[n]) for own, n in zip(self._parts, self._solid, strict=True)]
        points, together = self._placed(poses), copy(self._still.visibility)
        together.opaque = MovingCaster(solid, together.opaque)  # type: ignore[assignment]
        direct = np.zeros((len(self._lights), len(points)), np.float32)
        lost = []
        for index in range(len(self._lights)):
            taken = np.zeros(len(self._still.points), np.float32)
            for lit in self._lit_by(index, suns_ns[index]) if is_on[index] else ():
                emitter = lit.emitter
                some = np.flatnonzero(in_front(emitter.ball, points.points_m, points.normals))
                rays = Rays(SKY_SIDE if emitter.sky else SIDE)
                direct[index, some] += arriving(emitter, points.take(some), together, rays)[0]
                near = lit.near(parts_at)
                taken[near] += self._lost(lit, near, index, MovingCaster(solid))
            some = np.flatnonzero(taken)
            # Rounding apart, nothing is taken that had not come.
            lost.append((some, np.minimum(taken[some], self._straight[index][some])))
        count = GATHER_RAYS if self._baked.settings.bounces else 0
        return MoverLightAt(direct, lost, self._gatherer.gather(points.take(self._groups), rays=count))

    def add(self, moment: MoverLightAt, total: Floats, levels: Sequence[float]) -> None:
        """Put the movers' light and shade into the sum (H, W, 3) of all that stands still."""
        flat, strength = total.reshape(-1, 3), np.asarray(levels, np.float32)
        colours = strength[:, None] * np.array([light.colour for light in self._lights], np.float32)
        row = np.zeros(len(self._still.points) + 1, np.int32)
        for some, _ in moment.lost:
            row[some] = 1
        points = np.flatnonzero(row)
        row[points] = np.arange(1, len(points) + 1)
        shade = np.zeros((len(points) + 1, 3), np.float32)
        for (some, taken), colour in zip(moment.lost, colours, strict=True):
            shade[row[some]] += taken[:, None] * colour
        rows = row[self._still.layout.source]
        shaded = np.flatnonzero(rows)
        flat[shaded] = np.maximum(flat[shaded] - shade[rows[shaded]], 0)
        own = np.flatnonzero(self._layout.source < len(self._points))
        lit = (moment.direct.T @ colours)[self._layout.source[own]]
        flat[own] = lit + (self._blend @ self._around(moment.gathered, colours))[own]

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
        p, T = self._points, np.array(poses)[self._mover]

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
        points, straight = self._still.points, self._straight[index]
        some = self._by_cell[straight[self._by_cell] > UNNOTICED * straight.max(initial=0)]
        some = some[in_front(emitter.ball, points.points_m[some], points.normals[some])]
        some = some[emitter.may_light(points.points_m[some])]
        cells = self._still.cells[some]
        starts = np.flatnonzero(np.diff(cells, prepend=-1, append=-1) if len(cells) else np.zeros(1, bool))
        is_soft = bool((emitter.width_rad(points.points_m[some]) > 0).any())
        return _Lit(emitter, is_soft, some, _balls(points.points_m[some], starts), starts)

    def _lost(self, lit: _Lit, some: Places, index: int, movers: MovingCaster) -> Floats:
        """Illuminance (N,) that movers take from some points; soft shadows between points that ask, as light does."""
        if not lit.is_soft:
            return self._traced(lit.emitter, some, movers, SHADE_SIDE)
        side = SKY_SHADE_SIDE if lit.emitter.sky == "pane" else SHADE_SIDE
        straight, is_few = self._straight[index], self._still.layout.few[some]
        few, rest = some[is_few], some[~is_few]
        share, known = np.zeros(len(straight), np.float32), np.zeros(len(straight), bool)
        known[lit.points] = True
        share[few] = self._traced(lit.emitter, few, movers, side) / straight[few]
        mean, spread = self._still.layout.around(rest, share, known)
        unsure = ~(spread <= UNSURE)
        share[rest] = np.where(unsure, 0, mean)
        asked = rest[unsure]
        share[asked] = self._traced(lit.emitter, asked, movers, side) / straight[asked]
        if lit.emitter.sky == "pane":
            for _ in range(SMOOTHINGS):
                share[some] = (4 * share[some] + share[self._still.layout.beside[:, some]].sum(0)) / 8
        return np.asarray(share[some] * straight[some])

    def _traced(self, emitter: Emitter, some: Places, movers: MovingCaster, side: int) -> Floats:
        found = in_chunks(lambda part: self._lost_at(emitter, some[part], movers, side), len(some))
        return np.concatenate([*found, np.zeros(0, np.float32)])

    def _lost_at(self, emitter: Emitter, some: Places, movers: MovingCaster, side: int) -> Floats:
        own = self._still.points.take(some)
        towards, lost = emitter.towards(own), np.zeros(len(own), np.float32)
        for cell in range(side**2):
            way, strength = towards(*cell_spot(own, cell, side))
            cosine = own.cosine(way)
            light = strength * np.maximum(cosine, 0) * own.entering(cosine)
            aside = footprint(own, slice(None), cell)
            start, ahead = own.points_m + aside, way - aside
            hit = np.flatnonzero(movers.stops(start, ahead) & (light > 0))
            lost[hit] += light[hit] * emitter.passing(self._still.visibility, start[hit], ahead[hit])
        return lost / np.float32(side**2)


def _balls(points_m: Floats, starts: NDArray[np.int64]) -> Ball:
    """Balls (C,) around points (N, 3) from each start (C + 1,) to the next."""
    if not len(points_m):
        return Ball(np.zeros((0, 3)), np.zeros(0))
    count = np.diff(starts)
    centre = np.add.reduceat(points_m.astype(float), starts[:-1]) / count[:, None]
    apart = np.linalg.norm(points_m - np.repeat(centre, count, axis=0), axis=1)
    return Ball(centre, np.maximum.reduceat(apart, starts[:-1]))


def _around(balls: Ball) -> Ball:
    """One ball (1,) around several."""
    centre = balls.centre_m.mean(0)
    reach = np.linalg.norm(balls.centre_m - centre, axis=1) + balls.radius_m
    return Ball(centre[None], reach.max(keepdims=True))


MOST_PARTS = 8


def parts(corners_m: Array) -> Ball:
    """Balls (K,) that enclose faces (F, 3, 3) together: of those in slices across the longest side of their box."""
    points = corners_m.reshape(-1, 3)
    low, size = points.min(0), np.ptp(points, axis=0)
    longest = int(size.argmax())
    count = int(np.clip(np.ceil(size[longest] / max(np.sort(size)[1], 1e-3)), 1, MOST_PARTS))
    part = np.where(np.arange(3) == longest, size / count, size)
    centres = low + part / 2 + np.arange(count)[:, None] * np.eye(3)[longest] * part
    return Ball(centres, np.full(count, float(np.linalg.norm(part) / 2)))


def _moved_ball(own: Ball, T_world_body: NDArray[np.float64]) -> Ball:
    return Ball(se3.apply(T_world_body, own.centre_m), own.radius_m)
