"""Direct light at texels: stratified shadow rays, and lamps that flat mirrors show."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.emitter import Aim, Emitter, Occluder, emitters
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
        return self.emitter.width_rad(self.behind_m(points_m))

    def towards(self, texels: Texels) -> Aim:
        return self._mirrored(texels, self.emitter.towards)

    def evenly(self, texels: Texels) -> Aim:
        return self._mirrored(texels, self.emitter.evenly or self.emitter.towards)

    def _mirrored(self, texels: Texels, towards: Callable[[Texels], Aim]) -> Aim:
        behind = replace(
            texels,
            points_m=self.behind_m(texels.points_m),
            normals=self._reflected(texels.normals),
            planes=self._reflected(texels.planes),
        )
        aim_from_behind = towards(behind)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m, strength = aim_from_behind(a, b)
            return self._reflected(vectors_m), np.float32(self.tint) * strength

        return aim

    def passing(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """Share (R,) of light that passes what is before the mirror and, reflected, what is before the emitter."""
        share = np.zeros(len(origins_m), np.float32)
        rays = self._meeting(origins_m, segments_m)
        origins_m = origins_m[rays]
        segments_m = segments_m[rays]
        reach = self._reach(origins_m, segments_m)[:, None]
        to_mirror_m = reach * segments_m
        share[rays] = occluder.passing(origins_m, to_mirror_m)
        lift_m = (RAY_OFFSET_M * self.mirror.normal).astype(np.float32)
        met_m = origins_m + to_mirror_m + lift_m
        onwards_m = self._reflected((1 - reach) * segments_m)
        share[rays] *= self.emitter.passing(occluder, met_m, onwards_m)
        return share

    def behind_m(self, points_m: Floats) -> Floats:
        """The images of points (P, 3) behind the mirror."""
        height_m = self.mirror.height_m(points_m)
        images_m = points_m - 2 * height_m[:, None] * self.mirror.normal
        return images_m.astype(points_m.dtype)

    def _reach(self, points_m: Floats, segments_m: Floats) -> Floats:
        """The share (P,) of each segment at which it meets the mirror's plane."""
        with np.errstate(divide="ignore", invalid="ignore"):
            reach: Floats = -self.mirror.height_m(points_m) / (segments_m @ self.mirror.normal)
        return reach.astype(np.float32)

    def _meeting(self, points_m: Floats, segments_m: Floats) -> Rows:
        """Which segments (P, 3) from points pass the mirror's faces from their front."""
        reach = self._reach(points_m, segments_m)
        leads_down = segments_m @ self.mirror.normal < 0
        rays = np.flatnonzero(leads_down & (reach > 0) & (reach < 1))
        return rays[self.caster.stops(points_m[rays], segments_m[rays])]

    def _reflected(self, vectors: Floats) -> Floats:
        normal = self.mirror.normal
        return (vectors - 2 * (vectors @ normal)[:, None] * normal).astype(vectors.dtype)


def mirror_images(
    light: Light,
    visibility: Visibility,
    *,
    t_ns: float,
) -> list[Emitter]:
    """A lamp or the sun in every smooth mirror; the sky's come with the rays that gather indirect light."""
    if isinstance(light, Sky):
        return []
    light_emitters = emitters(light, visibility, t_ns=t_ns)
    images = []
    for mirror, tint, caster in visibility.mirrors:
        for emitter in light_emitters:
            image = _MirrorImage(emitter, mirror, tint, caster)
            centre_m = image.behind_m(emitter.ball.centre_m[None])[0]
            around = BoundingSphere(centre_m, emitter.ball.radius_m)
            images.append(
                Emitter(
                    around,
                    image.towards,
                    image.width_rad,
                    image.passing,
                    may_light=partial(_sees_image, image, around),
                    evenly=image.evenly,
                    side_samples=emitter.side_samples,
                )
            )
    return images


def _sees_image(image: _MirrorImage, around: BoundingSphere, points_m: Floats) -> Mask:
    """Points (P, 3) before the mirror from which a sphere behind it lies within the mirror's outline, about."""
    outline = bounding_sphere(image.mirror.corners_m)
    vectors_m = around.centre_m - points_m.astype(float)
    height_m = image.mirror.height_m(points_m)
    depth_m = -(vectors_m @ image.mirror.normal)
    share = np.clip(height_m / np.maximum(depth_m, 1e-9), 0, 1)
    crossing_m = points_m + share[:, None] * vectors_m
    aside_m = np.linalg.norm(crossing_m - outline.centre_m, axis=1)
    reach_m = outline.radius_m + share * around.radius_m
    return np.asarray((height_m > 0) & (aside_m <= reach_m))


# Steps of additive recurrences that fill the unit interval evenly: Roberts (2018), R2 and the golden ratio.
JITTER = np.array([0.7548776662, 0.5698402910], np.float32)
FOOTPRINT = np.array([0.6180339887, 0.3247179572], np.float32)
# emitters that are seen narrower or wider need fewer or more rays
NARROW_RAD = 0.15
WIDE_RAD = 0.6
MOST = 0.7  # share of rays from which on all are cast at once
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
    Elsewhere the light of many places on it is added up without rays, and the sky in a pane is smoothed instead.
    """
    light = np.zeros(len(points), np.float32)
    share = np.zeros(len(points), np.float32)
    clear = np.full(len(points), np.nan, np.float32)
    lit = reached(emitter, points, np.flatnonzero(among))
    sides = first_rays(emitter, points.points_m[lit], side)
    is_soft = bool((sides > 1).any())
    for first_side in np.unique(sides):
        is_asked = sides == first_side
        if is_soft:
            is_asked = is_asked & layout.is_sparse[lit]
        asked = lit[is_asked]
        light[asked], clear[asked], unshaded = arriving(emitter, points, asked, visibility, Rays(int(first_side)))
        share[asked] = light[asked] / np.maximum(unshaded, 1e-30)
    if emitter.sky == "pane":
        return layout.blurred(layout.interpolated(light))

    half = _half_shadow(clear, layout, cells, lit)
    if not is_soft:
        many = Rays(3 * side // 2, spread=True)
        light[half] = arriving(emitter, points, half, visibility, many)[0]
        return light
    share = layout.interpolated(share)
    is_half = np.zeros(len(points), bool)
    is_half[half] = True
    for first_side in np.unique(sides):
        open_points = lit[(sides == first_side) & ~is_half[lit] & (share[lit] > 0)]
        open_side = max(2 * int(first_side) - 1, emitter.side_samples)
        light[open_points] = share[open_points] * open_light(emitter, points, open_points, open_side)
    light[half], clear[half], _ = arriving(emitter, points, half, visibility, Rays(side, spread=True))
    is_half[half] = (clear[half] > 0) & (clear[half] < 1)
    is_grainy = bool(emitter.sky or emitter.side_samples)
    return np.where(is_half | is_grainy, layout.blurred(light), light)


def reached(emitter: Emitter, points: Texels, rows: Rows) -> Rows:
    """Those of the points at rows (N,) that any light of an emitter can reach, as far as that is known without rays."""

    def reached_part(part: slice) -> Rows:
        part_rows = rows[part]
        to_centre_m = emitter.ball.centre_m - points.points_m[part_rows]
        ahead_m = np.einsum("ij,ij->i", to_centre_m, points.normals[part_rows])
        part_rows = part_rows[ahead_m > -emitter.ball.radius_m]
        return np.asarray(part_rows[emitter.may_light(points.points_m[part_rows])])

    return chunked(reached_part, len(rows))


def first_rays(
    emitter: Emitter,
    points_m: Floats,
    side: int,
) -> NDArray[np.int64]:
    """How many rays along a side points (P, 3) need to tell whether they see an emitter: one where shadows are hard."""
    width_rad = chunked(lambda part: emitter.width_rad(points_m[part]), len(points_m))
    narrow = max(side // 2, 1)
    middle = max(3 * side // 4 if emitter.sky == "pane" else side // 2, 1)
    conditions = [width_rad == 0, width_rad < NARROW_RAD, width_rad < WIDE_RAD]
    return np.select(conditions, [1, narrow, middle], side)


def arriving(
    emitter: Emitter,
    points: Texels,
    rows: Rows,
    occluder: Occluder,
    rays: Rays,
) -> Floats:
    """(3, N) of points at rows: illuminance, share of rays that met nothing opaque (NaN: none sent), light unshaded."""

    def arriving_part(part: slice) -> Floats:
        return _arriving(emitter, points.take(rows[part]), occluder, rays)

    return chunked(arriving_part, len(rows)).T


def _arriving(
    emitter: Emitter,
    texels: Texels,
    occluder: Occluder,
    rays: Rays,
) -> Floats:
    total = np.zeros(len(texels), np.float32)
    unshaded = np.zeros(len(texels), np.float32)
    passed_count = np.zeros(len(texels), np.float32)
    ray_count = np.zeros(len(texels), np.float32)
    towards = emitter.towards(texels)
    for cell in range(rays.side**2):
        vectors_m, light = _sent(towards, texels, cell, rays.side)
        unshaded += light
        is_lit = light > 0
        # All at once where most are: picking rows costs as much as rays.
        are_few = np.count_nonzero(is_lit) < MOST * len(light)
        cast = np.flatnonzero(is_lit) if are_few else slice(None)
        start_m = texels.points_m[cast]
        ahead_m = vectors_m[cast]
        if rays.spread:
            aside_m = footprint_m(texels, cast, cell)
            start_m = start_m + aside_m
            ahead_m = ahead_m - aside_m
        share = emitter.passing(occluder, start_m, ahead_m)
        total[cast] += light[cast] * share
        passed_count[cast] += (share > 0) & is_lit[cast]
        ray_count += is_lit
    with np.errstate(invalid="ignore"):
        clear_share = passed_count / ray_count
    return np.stack([total / rays.side**2, clear_share, unshaded / rays.side**2], -1)


def open_light(
    emitter: Emitter,
    points: Texels,
    rows: Rows,
    side: int,
) -> Floats:
    """Illuminance (N,) of the points at rows if nothing hid the emitter."""

    def open_part(part: slice) -> Floats:
        texels = points.take(rows[part])
        towards = (emitter.evenly or emitter.towards)(texels)
        cell_light = [_sent(towards, texels, cell, side)[1] for cell in range(side**2)]
        light = np.sum(cell_light, axis=0)
        return np.asarray(light / np.float32(side**2), np.float32)

    return chunked(open_part, len(rows))


def _sent(
    towards: Aim,
    texels: Texels,
    cell: int,
    side: int,
) -> tuple[Floats, Floats]:
    """Vectors (P, 3) to an emitter, and the illuminance (P,) that enters from there if nothing hides it."""
    a, b = place_in_cell(texels, cell, side)
    vectors_m, strength = towards(a, b)
    cosine = texels.cosine(vectors_m)
    return vectors_m, strength * np.maximum(cosine, 0) * texels.entering(cosine)


def place_in_cell(
    texels: Texels,
    cell: ArrayLike,
    side: int,
) -> tuple[Floats, Floats]:
    """Where in a cell of side x side of the unit square each point aims (P,), of cells (K, 1) (K, P): by its dither."""
    cells = np.asarray(cell, np.float32)
    jitter = texels.dither + cells[..., None] * JITTER
    jitter -= np.floor(jitter)
    a = (cells % side + jitter[..., 0]) / np.float32(side)
    b = (cells // side + jitter[..., 1]) / np.float32(side)
    return a, b


def footprint_m(
    texels: Texels,
    rows: Rows | slice,
    cell: int,
) -> Floats:
    """Steps (N, 3) from the middle of texels to somewhere on their area."""
    place = texels.dither[rows] + cell * FOOTPRINT
    place -= np.floor(place) + np.float32(0.5)
    along_u_m = place[:, 1:] * texels.step_u_m[rows]
    along_v_m = place[:, :1] * texels.step_v_m[rows]
    return np.asarray(along_u_m + along_v_m)


def _half_shadow(
    clear: Floats,
    layout: TexelLayout,
    cells: Indices,
    lit: Rows,
) -> Rows:
    """Those of the points (N,) beside which an emitter is both seen and hidden."""
    is_seen = clear > 0
    is_hidden = clear < 1
    seen_in_cell = np.bincount(cells, is_seen, minlength=1) > 0
    hidden_in_cell = np.bincount(cells, is_hidden, minlength=1) > 0
    is_mixed = np.logical_and(seen_in_cell, hidden_in_cell)
    is_near_seen = layout.dilated(is_seen, steps=RIM)
    is_near = is_near_seen & layout.dilated(is_hidden, steps=RIM)
    return lit[(is_near | is_mixed[cells])[lit]]
