"""Light on movers, and what they keep from the rest."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vobench.render.bake import BakedScene, StaticScene, reached
from vobench.render.direct_light import Rays, arriving, cell_spot, first_rays, footprint, in_front, mirror_images
from vobench.render.emitter import Emitter, emitters
from vobench.render.geometry import (
    Ball,
    Floats,
    Mask,
    RayCaster,
    SurfaceList,
    Visibility,
    ball,
    corners,
    inventory,
    take,
)
from vobench.render.indirect_light import FinalGather, final_gather, surface_responses
from vobench.render.lightmap import Atlas, Chart, Scales, Texels, in_chunks, pack_atlas, texels
from vobench.scene.light import Sky, Sun
from vobench.scene.material import Map
from vobench.scene.surface import Surface

BLOCK = 4  # samples along a side
PROBES, RAYS = Rays(2), Rays(3, spread=True)  # per point, emitter and picture
SKY_REACH = 10  # radii beyond which a mover hides less than a hundredth of an open sky
CHUNK = 1 << 12
MOST_SLICES = 8  # of a mover
SPREAD = 1.5  # samples, from every other one
MARGIN = 6  # samples around a shadow that its smoothing reaches


def blocks(points: Texels, atlas: Atlas) -> tuple[NDArray[np.int64], Ball]:
    """Which square (P,) of BLOCK x BLOCK samples of one surface each point is in, and balls (B,) around these."""
    row, column = points.index // atlas.width // BLOCK, points.index % atlas.width // BLOCK
    key = (points.surface.astype(np.int64) * (atlas.height // BLOCK + 1) + row) * (atlas.width // BLOCK + 1) + column
    _, of, count = np.unique(key, return_inverse=True, return_counts=True)
    centre = np.stack([np.bincount(of, axis) for axis in points.points_m.T], -1) / count[:, None]
    radius = np.zeros(len(count))
    np.maximum.at(radius, of, np.linalg.norm(points.points_m - centre[of], axis=1))
    return of, Ball(centre, radius)


def may_shade(mover: Ball, emitter: Ball, points: Ball) -> Mask:
    """Whether a way from within each of `points` (N,) to within the emitter's ball can pass the mover's."""
    if np.isinf(emitter.radius_m):
        distance = np.linalg.norm(mover.centre_m - points.centre_m, axis=-1)
        return np.asarray(distance <= SKY_REACH * mover.radius_m + points.radius_m)
    to_mover, to_source = mover.centre_m - points.centre_m, emitter.centre_m - points.centre_m
    far_mover, far_source = (np.linalg.norm(way, axis=-1) for way in (to_mover, to_source))
    cosine = np.einsum("ij,ij->i", to_mover, to_source) / np.maximum(far_mover * far_source, 1e-9)
    angles = (
        np.arcsin(np.clip((one.radius_m + points.radius_m) / np.maximum(far, 1e-9), 0, 1))
        for one, far in ((mover, far_mover), (emitter, far_source))
    )
    reach = far_source + emitter.radius_m + mover.radius_m + points.radius_m
    inside = far_mover <= mover.radius_m + points.radius_m
    return np.asarray(inside | ((np.arccos(np.clip(cosine, -1, 1)) <= sum(angles)) & (far_mover <= reach)))


Shaded = tuple[NDArray[np.int64], Floats]  # some points (N,), and the illuminance (N,) that movers take from them


@dataclass(frozen=True, slots=True)
class StaticShading:
    """What does not move, ready to be shaded; block_of and balls are its `blocks`."""

    points: Texels
    atlas: Atlas
    block_of: NDArray[np.int64]
    balls: Ball
    visibility: Visibility

    def by(self, movers: Sequence[Sequence[Surface]], target: "Target", least_lx: Floats) -> Shaded:
        """Light of an emitter that movers, each a list of surfaces, keep from the points.

        least_lx (P,): blocks of points that lose less than this are left alone.
        """
        emitter = target.emitter
        some = np.flatnonzero(self._near(movers, emitter.ball)[self.block_of])
        some = some[in_front(emitter.ball, self.points.points_m[some], self.points.normals[some])]
        surfaces = [surface for mover in movers for surface in mover]
        caster = RayCaster(surfaces, range(len(surfaces)))
        probes = some[self._every_other(some)] if emitter.sky == "pane" else some
        sent = target.sent(self.points, probes, PROBES)
        bright = np.flatnonzero(sent.light.mean(1) > least_lx[probes])
        found = probes[bright][self._lost(sent.take(bright), target, caster) > least_lx[probes[bright]]]
        # Probes miss the rims of half shadows, but not whole blocks.
        shaded = np.zeros(len(self.balls.radius_m), bool)
        shaded[self.block_of[found]] = True
        return self._shaded(some[shaded[self.block_of[some]]], target, caster)

    def _near(self, movers: Sequence[Sequence[Surface]], emitter: Ball) -> Mask:
        """Blocks (B,) that movers may shade: by a ball around each, and of those by smaller ones that fit better."""
        near = np.zeros(len(self.balls.radius_m), bool)
        for mover in movers:
            some = np.flatnonzero(~near)
            for enclosing in ([ball(mover)], slices(mover)):
                few = self.balls.take(some)
                some = some[np.logical_or.reduce([may_shade(one, emitter, few) for one in enclosing])]
            near[some] = True
        return near

    def _shaded(self, some: NDArray[np.int64], target: "Target", caster: RayCaster) -> Shaded:
        if target.emitter.sky != "pane":
            return some, self._lost(target.sent(self.points, some, RAYS), target, caster)
        few = some[self._every_other(some)]
        return some, self._filled(some, few, self._lost(target.sent(self.points, few, RAYS), target, caster))

    def _every_other(self, some: NDArray[np.int64]) -> Mask:
        row, column = np.divmod(self.points.index[some], self.atlas.width)
        return np.asarray((row % 2 == 0) & (column % 2 == 0))

    def _filled(self, some: NDArray[np.int64], few: NDArray[np.int64], lost: Floats) -> Floats:
        """The loss of few points, smoothed as the sky's own light is, at all of some."""
        weighted = np.zeros((2, self.atlas.height, self.atlas.width), np.float32)
        weighted.reshape(2, -1)[:, self.points.index[few]] = lost, np.ones_like(lost)
        place, surface = self.points.index[some], self.points.surface[some]
        for index in np.unique(surface):
            window = _around(place[surface == index], self.atlas, self.atlas.charts[index])
            for layer in weighted:
                layer[window] = ndimage.gaussian_filter(layer[window], SPREAD, mode="nearest")
        light, weight = weighted.reshape(2, -1)[:, place]
        return np.asarray(light / np.maximum(weight, 1e-6))

    def _lost(self, sent: "ShadowRays", target: "Target", caster: RayCaster) -> Floats:
        """Illuminance (N,) that what a caster holds takes from the points of some rays."""
        count = len(sent.some)
        parts = in_chunks(lambda part: self._lost_of(sent.take(part), target.emitter, caster), count, chunk=CHUNK)
        return np.concatenate([*parts, np.zeros(0, np.float32)])

    def _lost_of(self, sent: "ShadowRays", emitter: Emitter, caster: RayCaster) -> Floats:
        start = np.broadcast_to(sent.start_m, sent.ahead_m.shape).reshape(-1, 3)
        light, ahead = sent.light.ravel(), sent.ahead_m.reshape(-1, 3)
        hidden = np.flatnonzero(caster.stops(start, ahead) & (light > 0))
        lost = np.zeros(len(light), np.float32)
        lost[hidden] = light[hidden] * emitter.passing(self.visibility, start[hidden], ahead[hidden])
        return np.asarray(lost.reshape(sent.light.shape).mean(1))


@dataclass(frozen=True, slots=True)
class ShadowRays:
    """R rays from each of some points (N,), increasing, to an emitter: where from, (N, R, 3) or (N, 1, 3), and whereto.

    light (N, R): the illuminance that each of the rays would bring if nothing stood in its way.
    """

    some: NDArray[np.int64]
    start_m: Floats
    ahead_m: Floats
    light: Floats

    take = take

    def merged(self, other: "ShadowRays", own: Mask) -> "ShadowRays":
        """Those of both, one after another; `own` (N,) says whose turn it is."""
        merged = []
        for mine, others in ((getattr(self, f.name), getattr(other, f.name)) for f in fields(self)):
            both = np.empty((len(own), *mine.shape[1:]), mine.dtype)
            both[own], both[~own] = mine, others
            merged.append(both)
        return ShadowRays(*merged)


def _nobody(rays: Rays) -> ShadowRays:
    vectors = np.zeros((0, rays.side**2, 3), np.float32)
    return ShadowRays(np.zeros(0, np.int64), vectors if rays.spread else vectors[:, :1], vectors, vectors[..., 0])


class Target:
    """An emitter, and the rays that points sent to it for the last picture: movers go slowly, so most serve again."""

    def __init__(self, emitter: Emitter) -> None:
        self.emitter = emitter
        self._kept: dict[Rays, ShadowRays] = {}

    def sent(self, points: Texels, some: NDArray[np.int64], rays: Rays) -> ShadowRays:
        """Rays from some points (N,), increasing."""
        kept = self._kept.get(rays, _nobody(rays))
        place = np.searchsorted(kept.some, some)
        known = np.append(kept.some, -1)[place] == some
        new = some[~known]
        parts = in_chunks(lambda part: self._send(points, new[part], rays), len(new), chunk=CHUNK)
        fresh = ShadowRays(
            *(np.concatenate([getattr(p, f.name) for p in [_nobody(rays), *parts]]) for f in fields(ShadowRays))
        )
        self._kept[rays] = kept.take(place[known]).merged(fresh, known)
        return self._kept[rays]

    def _send(self, points: Texels, some: NDArray[np.int64], rays: Rays) -> ShadowRays:
        part, shape = points.take(some), (len(some), rays.side**2)
        towards, every = self.emitter.towards(part), np.arange(len(some))
        light, ahead_m = np.empty(shape, np.float32), np.empty((*shape, 3), np.float32)
        start_m = part.points_m[:, None].repeat(shape[1] if rays.spread else 1, axis=1)
        for cell in range(rays.side**2):
            way, strength = towards(*cell_spot(part, cell, rays.side))
            cosine = part.cosine(way)
            light[:, cell] = strength * np.maximum(cosine, 0) * part.entering(cosine)
            ahead_m[:, cell] = way
            if rays.spread:
                aside_m = footprint(part, every, cell)
                start_m[:, cell] += aside_m
                ahead_m[:, cell] -= aside_m
        return ShadowRays(some, start_m, ahead_m, light)


def slices(surfaces: Sequence[Surface]) -> list[Ball]:
    """Balls that enclose surfaces together: slices of their upright box across its longest side."""
    points = np.concatenate([corners(s) for s in surfaces])
    low, size = points.min(0), np.ptp(points, axis=0)
    longest = int(size.argmax())
    count = int(np.clip(np.ceil(size[longest] / max(np.sort(size)[1], 1e-3)), 1, MOST_SLICES))
    part = np.where(np.arange(3) == longest, size / count, size)
    step = np.eye(3)[longest] * part
    return [Ball(low + part / 2 + i * step, float(np.linalg.norm(part) / 2)) for i in range(count)]


def _around(place: NDArray[np.int64], atlas: Atlas, chart: Chart) -> tuple[slice, slice]:
    """The part of a chart, with a margin, that flat places lie in."""
    row, column = np.divmod(place, atlas.width)
    return (
        slice(max(int(row.min()) - MARGIN, chart.row), min(int(row.max()) + MARGIN, chart.row + chart.rows)),
        slice(
            max(int(column.min()) - MARGIN, chart.column), min(int(column.max()) + MARGIN, chart.column + chart.columns)
        ),
    )


GATHER_RAYS = 64
GATHER_SPACING_M = 0.2
SKY_SHARE = 0.05  # of all points
UNNOTICED = 1 / 300  # share of a place's light, less than a step of 8 bits


@dataclass(frozen=True, slots=True)
class MoverLightAt:
    """Movers at one instant: each light's direct light (L, P) on their points, and what they shade of it.

    gathered: what reaches their coarse points, at `coarse` (C,) in the coarse map.
    """

    index: NDArray[np.int64]
    direct: Floats
    shaded: tuple[tuple[Shaded, ...], ...]
    gathered: FinalGather
    coarse: NDArray[np.int64]


class MoverLight:
    """The light of a baked scene's movers."""

    def __init__(self, baked: BakedScene, still: StaticScene) -> None:
        self._scene, self._settings, self._still = baked.scene, baked.settings, still
        self._shade = StaticShading(still.points, still.atlas, *blocks(still.points, still.atlas), still.visibility)
        self._movers = tuple(np.flatnonzero(still.things.mover >= 0).tolist())
        self._scales = Scales(still.atlas, pack_atlas(still.things.surfaces, spacing_m=GATHER_SPACING_M))
        self._response = surface_responses(
            still.things.surfaces, self._scene.materials, baked.albedo, still.things.panel
        )
        self._skies = [light for light in self._scene.lights if isinstance(light, Sky)]
        self._targets = [self._seen(emitters(light, still.visibility)) for light in self._scene.lights]
        self._layers = baked.light.reshape(len(baked.light), -1)

    def at(self, t_ns: float, suns_ns: Sequence[float], is_on: Sequence[bool]) -> MoverLightAt:
        """All that the movers' places decide.

        suns_ns (L,): the instant of each sun that moves; is_on (L,): which lights are on at all.
        """
        things, side = inventory(self._scene, t_ns=t_ns), round(np.sqrt(self._settings.light_rays))
        lit = self._points(things, self._still.atlas)
        visibility = Visibility(things.surfaces, self._scene.materials, range(len(things.surfaces)))
        shining = [self._shining(index, suns_ns[index]) if on else [] for index, on in enumerate(is_on)]
        opaque = [np.flatnonzero((things.mover == index) & ~things.pane) for index in range(len(self._scene.movers))]
        movers = [[things.surfaces[i] for i in sides] for sides in opaque if len(sides)]
        direct = np.zeros((len(shining), len(lit)), np.float32)
        for row, light, targets, sun_ns in zip(direct, self._scene.lights, shining, suns_ns, strict=True):
            shown = mirror_images(light, visibility, t_ns=sun_ns) if targets else []
            for emitter in [*(target.emitter for target in targets), *shown]:
                for rays, some in first_rays(emitter, lit, side):
                    row[some] += arriving(emitter, lit.take(some), visibility, rays)[0]
        least_lx = (UNNOTICED * np.asarray(is_on, np.float32) @ self._layers)[self._still.points.index]
        shaded = tuple(tuple(self._shade.by(movers, target, least_lx) for target in targets) for targets in shining)
        coarse = self._points(things, self._scales.coarse)
        gather_rays, still = GATHER_RAYS if self._settings.bounces else 0, self._still
        gathered = final_gather(coarse, still.atlas, still.visibility, self._response, self._skies, rays=gather_rays)
        return MoverLightAt(lit.index, direct, shaded, gathered, coarse.index)

    def add(self, moment: MoverLightAt, total: Map, levels: Sequence[float]) -> None:
        """Put the movers' light and shade into the sum of all layers (H, W) of what is static."""
        flat = total.reshape(-1)
        for level, parts in zip(levels, moment.shaded, strict=True):
            for some, lost in parts:
                place = self._still.points.index[some]
                flat[place] = np.maximum(flat[place] - np.float32(level) * lost, 0)
        of_sky = [level for level, light in zip(levels, self._scene.lights, strict=True) if isinstance(light, Sky)]
        around = np.zeros((1, self._scales.coarse.height * self._scales.coarse.width), np.float32)
        around[0, moment.coarse] = moment.gathered.table @ flat + np.asarray(of_sky, np.float32) @ moment.gathered.sky
        on_map = around.reshape(1, self._scales.coarse.height, -1)
        indirect = self._scales.refined(on_map, self._movers).reshape(-1)
        flat[moment.index] = np.asarray(levels, np.float32) @ moment.direct + indirect[moment.index]

    def _points(self, things: SurfaceList, atlas: Atlas) -> Texels:
        materials, seed = self._scene.materials, self._settings.seed
        return texels(things.surfaces, materials, atlas, among=self._movers, seed=seed)

    def _shining(self, index: int, t_ns: float) -> list[Target]:
        light = self._scene.lights[index]
        if isinstance(light, Sun) and light.moves:
            return [Target(emitter) for emitter in emitters(light, self._still.visibility, t_ns=t_ns)]
        return self._targets[index]

    def _seen(self, parts: list[Emitter]) -> list[Target]:
        """All but an open sky that few points see, such as undersides of things on the floor."""
        some = [reached(emitter, self._still).mean() if emitter.sky == "open" else 1 for emitter in parts]
        return [Target(emitter) for emitter, share in zip(parts, some, strict=True) if share > SKY_SHARE]
