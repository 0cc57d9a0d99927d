"""Direct light at texels: stratified shadow rays, and lamps that flat mirrors show."""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.render.emitter import Aim, Emitter, emitters
from vobench.render.geometry import RAY_OFFSET_M, Ball, Floats, Visibility
from vobench.render.lightmap import Atlas, Texels, in_chunks
from vobench.scene.light import Light, Sky
from vobench.scene.surface import Surface


@dataclass(frozen=True, slots=True)
class _MirrorImage:
    """An emitter in a mirror: rays go straight to where its image is, through the mirror's rectangle."""

    emitter: Emitter
    mirror: Surface
    tint: float

    def width_rad(self, points_m: Floats) -> Floats:
        return self.emitter.width_rad(self.behind(points_m))

    def towards(self, texels: Texels) -> Aim:
        images = replace(texels, points_m=self.behind(texels.points_m), normals=self._turned(texels.normals))
        aim_from_behind = self.emitter.towards(images)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            way, strength = aim_from_behind(a, b)
            way = self._turned(way)
            return way, np.where(self._meets(texels.points_m, way), self.tint * strength, 0)

        return aim

    def passing(self, visibility: Visibility, origins_m: Floats, way: Floats) -> Floats:
        reach = self._reach(origins_m, way)[:, None]
        share = visibility.passing(origins_m, reach * way)
        some = np.flatnonzero(share)
        met = origins_m[some] + reach[some] * way[some] + (RAY_OFFSET_M * self.mirror.normal).astype(np.float32)
        share[some] *= self.emitter.passing(visibility, met, self._turned((1 - reach[some]) * way[some]))
        return share

    def behind(self, points_m: Floats) -> Floats:
        normal = self.mirror.normal
        height = (points_m - self.mirror.corner_m) @ normal
        return (points_m - 2 * height[:, None] * normal).astype(points_m.dtype)

    def _reach(self, points_m: Floats, way: Floats) -> Floats:
        """The share (P,) of each way at which it meets the mirror's plane."""
        normal = self.mirror.normal
        with np.errstate(divide="ignore", invalid="ignore"):
            reach: Floats = ((self.mirror.corner_m - points_m) @ normal) / (way @ normal)
        return reach.astype(np.float32)

    def _meets(self, points_m: Floats, way: Floats) -> Floats:
        """Whether ways (P, 3) from points pass the mirror's rectangle from its front."""
        reach = self._reach(points_m, way)
        ahead = (way @ self.mirror.normal < 0) & (reach > 0) & (reach < 1)
        place = points_m + np.where(ahead, reach, 0)[:, None] * way - self.mirror.corner_m
        u, v = (place @ edge / (edge @ edge) for edge in (self.mirror.edge_u_m, self.mirror.edge_v_m))
        return np.asarray(ahead & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1))

    def _turned(self, vectors: Floats) -> Floats:
        normal = self.mirror.normal
        return (vectors - 2 * (vectors @ normal)[:, None] * normal).astype(vectors.dtype)


def mirror_images(light: Light, visibility: Visibility, *, t_ns: float) -> list[Emitter]:
    """A lamp or the sun in every smooth mirror; the sky's come with the rays that gather indirect light."""
    if isinstance(light, Sky):
        return []
    own = emitters(light, visibility, t_ns=t_ns)
    found = []
    for image in [_MirrorImage(emitter, mirror, tint) for mirror, tint in visibility.mirrors for emitter in own]:
        ball = Ball(image.behind(image.emitter.ball.centre_m[None])[0], image.emitter.ball.radius_m)
        found.append(Emitter(ball, image.towards, image.width_rad, image.passing))
    return found


# Steps of additive recurrences that fill the unit interval evenly: Roberts (2018), R2 and the golden ratio.
JITTER = np.array([0.7548776662, 0.5698402910], np.float32)
FOOTPRINT = np.array([0.6180339887, 0.3247179572], np.float32)
NARROW_RAD, WIDE_RAD = 0.15, 0.6  # emitters that are seen narrower or wider get a quarter or four times the rays
SKY_SMOOTHING = 1.0  # samples; its shadows are so soft that averaging neighbours takes noise away, and nothing else
PROBE_STEP, PROBE_SIDE, OPEN_SHARE = 7, 4, 1e-3


@dataclass(frozen=True, slots=True)
class Rays:
    """side x side rays to an emitter; where `spread`, they start all over a texel's area instead of its middle."""

    side: int
    spread: bool = False


def direct_light(emitter: Emitter, texels: Texels, atlas: Atlas, visibility: Visibility, *, side: int) -> Floats:
    """Illuminance (P,) in lux that one emitter gives at level 1; under a coat the part that enters."""
    light, clear = np.zeros(len(texels), np.float32), np.full(len(texels), np.nan, np.float32)
    coarse = np.zeros(len(texels), bool)
    for rays, some in first_rays(emitter, texels, side):
        light[some], clear[some] = arriving(emitter, texels.take(some), visibility, rays)
        coarse[some] = rays.side < 2 * side
    if emitter.sky == "pane":
        return light  # so soft that the map is smoothed instead
    grainy = np.flatnonzero(_half_shadow(clear, texels, atlas) & coarse)
    light[grainy], _ = arriving(emitter, texels.take(grainy), visibility, Rays(2 * side, spread=True))
    return light


def in_front(what: Ball, points_m: Floats, normals: Floats) -> NDArray[np.bool_]:
    """Points (P, 3) with normals (P, 3) before which some of a ball lies."""
    ahead = np.einsum("ij,ij->i", what.centre_m - points_m, normals)
    return np.asarray(ahead > -what.radius_m)


def first_rays(emitter: Emitter, texels: Texels, side: int) -> list[tuple[Rays, NDArray[np.int64]]]:
    """How many rays which points need where nothing is in the way: more for what is seen wider."""
    points = texels.points_m
    width = np.concatenate(in_chunks(lambda part: emitter.width_rad(points[part]), len(points)) or [np.zeros(0)])
    kinds = np.select([width == 0, width < NARROW_RAD, width < WIDE_RAD], [1, max(1, side // 2), side], 2 * side)
    return [(Rays(int(kind)), np.flatnonzero(kinds == kind)) for kind in np.unique(kinds)]


def arriving(emitter: Emitter, texels: Texels, visibility: Visibility, rays: Rays) -> tuple[Floats, Floats]:
    """Illuminance (P,), and the share of rays that met nothing opaque (P,), NaN where the emitter lies behind."""
    parts = in_chunks(lambda part: _arriving(emitter, texels.take(part), visibility, rays), len(texels))
    light, clear = zip(*parts, strict=True) if parts else ([np.zeros(0, np.float32)], [np.zeros(0, np.float32)])
    return np.concatenate(light), np.concatenate(clear)


def _arriving(emitter: Emitter, texels: Texels, visibility: Visibility, rays: Rays) -> tuple[Floats, Floats]:
    total, open_light, passed, cast = (np.zeros(len(texels), np.float32) for _ in range(4))
    towards = emitter.towards(texels)
    for cell in range(rays.side**2):
        way, strength = towards(*cell_spot(texels, cell, rays.side))
        cosine = texels.cosine(way)
        light = strength * np.maximum(cosine, 0)
        open_light += light
        faced = np.flatnonzero(light > 0)
        light *= texels.entering(cosine)
        start = texels.points_m[faced] + (footprint(texels, faced, cell) if rays.spread else 0)
        ahead = texels.points_m[faced] + way[faced] - start
        share = emitter.passing(visibility, start, ahead)
        total[faced] += light[faced] * share
        passed[faced] += share > 0
        cast[faced] += 1
    exact = emitter.unshadowed(texels) if emitter.unshadowed else None
    known = np.zeros(0, np.int64) if exact is None else np.flatnonzero((open_light > 0) & ~np.isnan(exact))
    total /= rays.side**2
    if exact is not None:
        total[known] *= exact[known] / open_light[known] * rays.side**2
    with np.errstate(invalid="ignore"):
        return total, passed / cast


def cell_spot(texels: Texels, cell: int, side: int) -> tuple[Floats, Floats]:
    """Where in one of side x side cells of the unit square each point aims (P,): turned by its own dither."""
    jitter = (texels.dither + cell * JITTER) % 1
    return (cell % side + jitter[:, 0]) / side, (cell // side + jitter[:, 1]) / side


def footprint(texels: Texels, some: NDArray[np.int64], cell: int) -> Floats:
    """Steps (N, 3) from the middle of texels to somewhere on their area."""
    a, b = ((texels.dither[some, ::-1] + cell * FOOTPRINT) % 1 - np.float32(0.5)).T
    return np.asarray(a[:, None] * texels.step_u_m[some] + b[:, None] * texels.step_v_m[some])


def _half_shadow(clear: Floats, texels: Texels, atlas: Atlas) -> NDArray[np.bool_]:
    """Points (P,) beside which, within three texels, the emitter is both seen and hidden.

    Few rays can miss the rim of a lamp, hence the three.
    """
    near = [
        scipy.ndimage.binary_dilation(texels.on_map(part.astype(np.float32), atlas) > 0, iterations=3).ravel()[
            texels.index
        ]
        for part in (clear > 0, clear < 1)
    ]
    return np.asarray(near[0] & near[1] & ~np.isnan(clear))


def sees_open_sky(emitter: Emitter, texels: Texels, visibility: Visibility) -> NDArray[np.bool_]:
    """Points (P,) on surfaces of which one probe in a thousand or more leaves the scene without meeting a pane."""
    probe = texels.take(slice(None, None, PROBE_STEP))
    lit, _ = arriving(emitter, probe, visibility, Rays(PROBE_SIDE))
    count = np.bincount(probe.surface, lit > 0, minlength=len(visibility.surfaces))
    total = np.bincount(probe.surface, minlength=len(visibility.surfaces))
    return (count > OPEN_SHARE * total)[texels.surface]
