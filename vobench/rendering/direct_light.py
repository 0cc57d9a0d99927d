"""Direct light at texels: stratified shadow rays, and lamps that flat mirrors show."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.emitter import Aim, Between, Emitter, emitters
from vobench.rendering.geometry import RAY_OFFSET_M, BoundingSphere, PlanarPatch, RayCaster, bounding_sphere
from vobench.rendering.texel import Texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.thread_pool import chunked
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Light, Sky


@dataclass(frozen=True, slots=True)
class _MirrorImage:
    """An emitter in a mirror: rays go straight to where its image is, through the mirror's faces."""

    emitter: Emitter
    mirror: PlanarPatch
    tint: float
    caster: RayCaster

    def width_rad(self, points_m: Floats) -> Floats:
        return self.emitter.width_rad(self.behind(points_m))

    def towards(self, texels: Texels) -> Aim:
        return self._mirrored(texels, self.emitter.towards)

    def evenly(self, texels: Texels) -> Aim:
        return self._mirrored(texels, self.emitter.evenly or self.emitter.towards)

    def _mirrored(self, texels: Texels, towards: Callable[[Texels], Aim]) -> Aim:
        turned = {name: self._turned(getattr(texels, name)) for name in ("normals", "planes")}
        aim_from_behind = towards(replace(texels, points_m=self.behind(texels.points_m), **turned))

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            way, strength = aim_from_behind(a, b)
            return self._turned(way), np.float32(self.tint) * strength

        return aim

    def passing(self, between: Between, origins_m: Floats, way: Floats) -> Floats:
        share = np.zeros(len(origins_m), np.float32)
        some = self._meeting(origins_m, way)
        reach = self._reach(origins_m[some], way[some])[:, None]
        share[some] = between.passing(origins_m[some], reach * way[some])
        met = origins_m[some] + reach * way[some] + (RAY_OFFSET_M * self.mirror.normal).astype(np.float32)
        share[some] *= self.emitter.passing(between, met, self._turned((1 - reach) * way[some]))
        return share

    def behind(self, points_m: Floats) -> Floats:
        return (points_m - 2 * self.mirror.height_m(points_m)[:, None] * self.mirror.normal).astype(points_m.dtype)

    def _reach(self, points_m: Floats, way: Floats) -> Floats:
        """The share (P,) of each way at which it meets the mirror's plane."""
        with np.errstate(divide="ignore", invalid="ignore"):
            reach: Floats = -self.mirror.height_m(points_m) / (way @ self.mirror.normal)
        return reach.astype(np.float32)

    def _meeting(self, points_m: Floats, way: Floats) -> Rows:
        """Which ways (P, 3) from points pass the mirror's faces from their front."""
        reach = self._reach(points_m, way)
        some = np.flatnonzero((way @ self.mirror.normal < 0) & (reach > 0) & (reach < 1))
        return some[self.caster.stops(points_m[some], way[some])]

    def _turned(self, vectors: Floats) -> Floats:
        normal = self.mirror.normal
        return (vectors - 2 * (vectors @ normal)[:, None] * normal).astype(vectors.dtype)


def mirror_images(light: Light, visibility: Visibility, *, t_ns: float) -> list[Emitter]:
    """A lamp or the sun in every smooth mirror; the sky's come with the rays that gather indirect light."""
    if isinstance(light, Sky):
        return []
    own = emitters(light, visibility, t_ns=t_ns)
    found = []
    for image in [_MirrorImage(emitter, *mirror) for mirror in visibility.mirrors for emitter in own]:
        around = BoundingSphere(image.behind(image.emitter.ball.centre_m[None])[0], image.emitter.ball.radius_m)
        found.append(Emitter(
            around, image.towards, image.width_rad, image.passing, may_light=partial(_shown, image, around),
            evenly=image.evenly, spots=image.emitter.spots,
        ))  # fmt: skip
    return found


def _shown(image: _MirrorImage, what: BoundingSphere, points_m: Floats) -> Mask:
    """Points (P, 3) before the mirror from which a ball behind it lies beyond its outline."""
    frame = bounding_sphere(image.mirror.corners_m)
    way = what.centre_m - points_m.astype(float)
    height = image.mirror.height_m(points_m)
    far = way @ image.mirror.normal
    share = np.clip(height / np.maximum(-far, 1e-9), 0, 1)
    apart = np.linalg.norm(points_m + share[:, None] * way - frame.centre_m, axis=1)
    return np.asarray((height > 0) & (apart <= frame.radius_m + share * what.radius_m))


# Steps of additive recurrences that fill the unit interval evenly: Roberts (2018), R2 and the golden ratio.
JITTER = np.array([0.7548776662, 0.5698402910], np.float32)
FOOTPRINT = np.array([0.6180339887, 0.3247179572], np.float32)
# emitters that are seen narrower or wider need fewer or more rays
NARROW_RAD = 0.15
WIDE_RAD = 0.6
MOST = 0.7
RIM = 2  # texels around a place of half shadow


@dataclass(frozen=True, slots=True)
class Rays:
    """side x side rays to an emitter; where `spread`, they start all over a texel's area instead of its middle."""

    side: int
    spread: bool = False


def direct_light(
    emitter: Emitter,
    points: Texels,
    layout: TexelLayout,
    cells: Indices,
    visibility: Visibility,
    *,
    side: int,
    among: Mask,
) -> Floats:
    """Illuminance (P,) in lux that one emitter gives at level 1 to those among the points; of coats what enters.

    Few rays tell whether the emitter is seen, of soft shadows at every other point along rows and columns. Where it
    is neither seen nor hidden all around, within RIM texels or in the same of the cells (P,), many rays follow.
    Elsewhere many spots on it are added up without rays, and the sky in a pane is smoothed instead.
    """
    light, share = np.zeros((2, len(points)), np.float32)
    clear = np.full(len(points), np.nan, np.float32)
    some = reached(emitter, points, np.flatnonzero(among))
    kinds = first_rays(emitter, points.points_m[some], side)
    is_soft = bool((kinds > 1).any())
    for kind in np.unique(kinds):
        own = some[(kinds == kind) & (layout.is_sparse[some] if is_soft else True)]
        light[own], clear[own], unshaded = arriving(emitter, points, own, visibility, Rays(int(kind)))
        share[own] = light[own] / np.maximum(unshaded, 1e-30)
    if emitter.sky == "pane":
        return layout.blurred(layout.interpolated(light))
    half = _half_shadow(clear, layout, cells, some)
    if not is_soft:
        light[half] = arriving(emitter, points, half, visibility, Rays(3 * side // 2, spread=True))[0]
        return light
    share = layout.interpolated(share)
    is_half = np.zeros(len(points), bool)
    is_half[half] = True
    for kind in np.unique(kinds):
        own = some[(kinds == kind) & ~is_half[some] & (share[some] > 0)]
        light[own] = share[own] * open_light(emitter, points, own, max(2 * int(kind) - 1, emitter.spots))
    light[half], clear[half], _ = arriving(emitter, points, half, visibility, Rays(side, spread=True))
    is_half[half] = (clear[half] > 0) & (clear[half] < 1)
    return np.where(is_half | bool(emitter.sky or emitter.spots), layout.blurred(light), light)


def reached(emitter: Emitter, points: Texels, some: Rows) -> Rows:
    """Those of some points (N,) that any light of an emitter can reach, as far as that is known without rays."""

    def of(part: slice) -> Rows:
        own = some[part]
        ahead = np.einsum("ij,ij->i", emitter.ball.centre_m - points.points_m[own], points.normals[own])
        own = own[ahead > -emitter.ball.radius_m]
        return np.asarray(own[emitter.may_light(points.points_m[own])])

    return chunked(of, len(some))


def first_rays(emitter: Emitter, points_m: Floats, side: int) -> NDArray[np.int64]:
    """How many rays along a side points (P, 3) need to tell whether they see an emitter: one where shadows are hard."""
    width = chunked(lambda part: emitter.width_rad(points_m[part]), len(points_m))
    middle = 3 * side // 4 if emitter.sky == "pane" else side // 2
    return np.select([width == 0, width < NARROW_RAD, width < WIDE_RAD], [1, max(side // 2, 1), max(middle, 1)], side)


def arriving(emitter: Emitter, points: Texels, some: Rows, between: Between, rays: Rays) -> Floats:
    """(3, N) of some points: illuminance, share of rays that met nothing opaque (NaN: none sent), light unshaded."""
    return chunked(lambda part: _arriving(emitter, points.take(some[part]), between, rays), len(some)).T


def _arriving(emitter: Emitter, texels: Texels, between: Between, rays: Rays) -> Floats:
    total, unshaded, passed, cast = (np.zeros(len(texels), np.float32) for _ in range(4))
    towards = emitter.towards(texels)
    for cell in range(rays.side**2):
        way, light = _sent(towards, texels, cell, rays.side)
        unshaded += light
        is_lit = light > 0
        # All at once where most are: picking rows costs as much as rays.
        faced = np.flatnonzero(is_lit) if np.count_nonzero(is_lit) < MOST * len(light) else slice(None)
        start = texels.points_m[faced]
        ahead = way[faced]
        if rays.spread:
            aside = footprint(texels, faced, cell)
            start = start + aside
            ahead = ahead - aside
        share = emitter.passing(between, start, ahead)
        total[faced] += light[faced] * share
        passed[faced] += (share > 0) & is_lit[faced]
        cast += is_lit
    with np.errstate(invalid="ignore"):
        return np.stack([total / rays.side**2, passed / cast, unshaded / rays.side**2], -1)


def open_light(emitter: Emitter, points: Texels, some: Rows, side: int) -> Floats:
    """Illuminance (N,) of some points if nothing were in the way."""

    def of(part: slice) -> Floats:
        own = points.take(some[part])
        towards = (emitter.evenly or emitter.towards)(own)
        light = np.sum([_sent(towards, own, cell, side)[1] for cell in range(side**2)], axis=0)
        return np.asarray(light / np.float32(side**2), np.float32)

    return chunked(of, len(some))


def _sent(towards: Aim, texels: Texels, cell: int, side: int) -> tuple[Floats, Floats]:
    """Ways (P, 3) to an emitter, and the illuminance (P,) that enters from there if nothing is in the way."""
    way, strength = towards(*cell_spot(texels, cell, side))
    cosine = texels.cosine(way)
    return way, strength * np.maximum(cosine, 0) * texels.entering(cosine)


def cell_spot(texels: Texels, cell: ArrayLike, side: int) -> tuple[Floats, Floats]:
    """Where in a cell of side x side of the unit square each point aims (P,), of cells (K, 1) (K, P): by its dither."""
    cells = np.asarray(cell, np.float32)
    jitter = texels.dither + cells[..., None] * JITTER
    jitter -= np.floor(jitter)
    return (cells % side + jitter[..., 0]) / np.float32(side), (cells // side + jitter[..., 1]) / np.float32(side)


def footprint(texels: Texels, some: Rows | slice, cell: int) -> Floats:
    """Steps (N, 3) from the middle of texels to somewhere on their area."""
    spot = texels.dither[some] + cell * FOOTPRINT
    spot -= np.floor(spot) + np.float32(0.5)
    return np.asarray(spot[:, 1:] * texels.step_u_m[some] + spot[:, :1] * texels.step_v_m[some])


def _half_shadow(clear: Floats, layout: TexelLayout, cells: Indices, some: Rows) -> Rows:
    """Those of some points (N,) beside which an emitter is both seen and hidden."""
    seen = clear > 0
    hidden = clear < 1
    mixed = np.logical_and(*(np.bincount(cells, part, minlength=1) > 0 for part in (seen, hidden)))
    near = layout.dilated(seen, steps=RIM) & layout.dilated(hidden, steps=RIM)
    return some[(near | mixed[cells])[some]]
