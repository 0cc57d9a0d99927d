"""Direct light at texels: stratified shadow rays, and lamps that flat mirrors show."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.emitter import Aim, Emitter, Occluder, emitters
from vobench.rendering.geometry import RAY_OFFSET_M, BoundingSphere, PlanarPatch, RayCaster, bounding_sphere
from vobench.rendering.level_kernels import UNKNOWN
from vobench.rendering.shadow_kernels import (
    add_arrived,
    ahead_of,
    entering_light,
    lit_rays,
    places_in_cell,
    spread_over_texels,
)
from vobench.rendering.texel import Texels
from vobench.rendering.texel_field import TexelField
from vobench.rendering.texel_layout import STRIDES, TexelLayout
from vobench.rendering.thread_pool import chunked
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Light, Sky


@dataclass(frozen=True, slots=True, eq=False)
class MirrorImage(Emitter):
    """An emitter in a mirror: rays go straight to where its image is, through the mirror's faces."""

    emitter: Emitter
    mirror: PlanarPatch
    tint: float
    caster: RayCaster
    ball: BoundingSphere

    @property
    def open_side(self) -> int:
        """As many as of the emitter itself."""
        return self.emitter.open_side

    @property
    def is_hard(self) -> bool:
        """As hard as the emitter itself."""
        return self.emitter.is_hard

    def width_rad(self, points_m: Floats) -> Floats:
        """As wide as the image is seen."""
        return self.emitter.width_rad(self.behind_m(points_m))

    def towards(self, texels: Texels) -> Aim:
        """Places on the image."""
        aim_from_behind = self.emitter.towards(self._behind(texels))

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m, strength = aim_from_behind(a, b)
            return self._reflected(vectors_m), np.float32(self.tint) * strength

        return aim

    def open_light(self, texels: Texels) -> Floats:
        """The light of the whole image, as if the mirror had no end."""
        return np.float32(self.tint) * self.emitter.open_light(self._behind(texels))

    def may_light(self, points_m: Floats) -> Mask:
        """Points (P, 3) before the mirror from which the image's sphere lies within the mirror's outline, about."""
        outline = bounding_sphere(self.mirror.corners_m)
        vectors_m = self.ball.centre_m - points_m.astype(float)
        height_m = self.mirror.height_m(points_m)
        depth_m = -(vectors_m @ self.mirror.normal)
        share = np.clip(height_m / np.maximum(depth_m, 1e-9), 0, 1)
        crossing_m = points_m + share[:, None] * vectors_m
        aside_m = np.linalg.norm(crossing_m - outline.centre_m, axis=1)
        reach_m = outline.radius_m + share * self.ball.radius_m
        return np.asarray((height_m > 0) & (aside_m <= reach_m))

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

    def _behind(self, texels: Texels) -> Texels:
        """The images of texels behind the mirror."""
        return replace(
            texels,
            points_m=self.behind_m(texels.points_m),
            normals=self._reflected(texels.normals),
            planes=self._reflected(texels.planes),
        )

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
    images = list[Emitter]()
    for mirror, tint, caster in visibility.mirrors:
        for emitter in light_emitters:
            centre_m = emitter.ball.centre_m
            image_m = centre_m - 2 * mirror.height_m(centre_m) * mirror.normal
            around = BoundingSphere(image_m, emitter.ball.radius_m)
            images.append(MirrorImage(emitter, mirror, tint, caster, around))
    return images


# emitters that are seen narrower or wider need fewer or more rays
NARROW_RAD = 0.15
WIDE_RAD = 0.6
BESIDE_RAD = 1.5
RIM = 2  # texels around a place of half shadow
LEAST_LX = 1e-30  # by which nothing is divided that is darker
# Differences of the visible share between neighbours from which it is computed at every second and at every texel. What
# is interpolated beside the rim of a half shadow errs by less than half of them.
STEEP = (0.08, 0.15)
GENTLE = 0.2  # difference of the visible share between neighbours on a coarse grid up to which it is smoothed
UNEVEN = 0.1  # relative difference of unshaded light between neighbours from which it is computed on a finer grid
BEND = 0.004  # the same of the mean of its neighbours, four times the error of what is interpolated
FINER_STRIDES = (*STRIDES[1:], 1)
BENT = 1e-4  # difference of a normal from that of its flat face from which light is computed at each texel


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

    The visible share of an emitter with soft shadows is computed at every fourth point along rows and columns, and at
    every second and at every point only where it differs between neighbours; so is the light that would arrive if
    nothing were in the way. The sky in a pane is sampled at every other point and smoothed. Of hard shadows one ray at
    each point tells the outlines, within RIM texels of which, or in the same of the cells (P,), rays from all over
    each texel follow.
    """
    lit = reached(emitter, points, np.flatnonzero(among))
    if not len(lit):
        return np.zeros(len(points), np.float32)
    receivers = Receivers(points, layout, cells, visibility, lit)
    if emitter.sky == "pane":
        return receivers.pane_light(emitter, side)
    if emitter.is_hard:
        return receivers.hard_light(emitter, side)
    return receivers.soft_light(emitter, side)


@dataclass(frozen=True, slots=True)
class Receivers:
    """Points that an emitter may light, at rows `lit` (N,) among all (P,), and what may hide it from them."""

    points: Texels
    layout: TexelLayout
    cells: Indices
    visibility: Visibility
    lit: Rows

    def pane_light(self, emitter: Emitter, side: int) -> Floats:
        """The sky's light (P,) in a pane, sampled at every other point along rows and columns."""
        light = TexelField.unknown(self.layout, len(self.points))
        rows = self.layout.on_grid(self.lit, STRIDES[-1])
        light.set(rows, self._sampled(emitter, rows, side))
        rows = light.refine(self.lit, stride=1, tolerance=np.inf)
        light.set(rows, self._sampled(emitter, rows, side))
        return self.layout.blurred(light.values)

    def hard_light(self, emitter: Emitter, side: int) -> Floats:
        """Light (P,) of an emitter that is so narrow that one ray tells, but for the edges of shadows."""
        points = self.points
        light = np.zeros(len(points), np.float32)
        clear = np.full(len(points), np.nan, np.float32)
        light[self.lit], clear[self.lit], _ = arriving(emitter, points, self.lit, self.visibility, Rays(1))
        near_edge = self._half_shadow(clear, self.cells, self.lit, rim=RIM)

        pattern = self._pattern(stride=1)
        few = Rays(max(side // 2, 1), spread=True)
        arrived = arriving(emitter, points, near_edge, self.visibility, few, pattern)
        light[near_edge], clear[near_edge], _ = arrived
        each_alone = np.arange(len(points), dtype=np.int32)
        at_edge = self._half_shadow(clear, each_alone, near_edge, rim=1)
        many = Rays(3 * side // 2, spread=True)
        light[at_edge] = arriving(emitter, points, at_edge, self.visibility, many, pattern)[0]
        return light

    def soft_light(self, emitter: Emitter, side: int) -> Floats:
        """Light (P,) of a wide emitter: what would arrive with nothing in the way, times the share that rays find."""
        share = self._visible_share(emitter, side)
        shone = self.lit[share[self.lit] > 0]
        open_lx, is_grainy = self._open_light(emitter, shone, side)
        light = np.zeros(len(self.points), np.float32)
        light[shone] = share[shone] * open_lx
        grainy = shone[is_grainy]
        if emitter.open_side > 1 and len(grainy):
            light[grainy] = self.layout.blurred(light)[grainy]
        return light

    def _visible_share(self, emitter: Emitter, side: int) -> Floats:
        """The share (P,) of an emitter's light that nothing hides."""
        share = TexelField.unknown(self.layout, len(self.points))
        coarsest = STRIDES[0]
        rows = self.layout.on_grid(self.lit, coarsest)
        first_share, clear = self._shares(
            emitter, rows, first_rays(emitter, self.points.points_m[rows], side), coarsest
        )
        share.set(rows, clear)
        low, high = share.extremes(rows, steps=coarsest)
        share.set(rows, first_share)
        mixed = rows[(low < 1) & (high > 0)]
        self._take_shares(share, emitter, mixed, Rays(side, spread=True), coarsest)

        finer_rays = max(3 * side // 4, 1)
        for stride, tolerance in zip(FINER_STRIDES, STEEP, strict=True):
            rows = self.layout.on_grid(self.lit, stride)
            steep = share.refine(rows, stride=stride, tolerance=tolerance)
            self._take_shares(share, emitter, steep, Rays(finer_rays, spread=True), stride)
        return share.values

    def _take_shares(self, share: TexelField, emitter: Emitter, rows: Rows, rays: Rays, stride: int) -> None:
        """Set the visible share of an emitter's light at the rows (N,), smoothed where it is in part hidden.

        On the coarse grids it is smoothed only where it changes slowly.
        """
        values, clear = self._shares(emitter, rows, rays, stride)
        share.set(rows, values)
        low, high = share.extremes(rows, steps=stride)
        is_partial = (clear > 0) & (clear < 1)
        is_gentle = (high - low < GENTLE) | (stride == 1)
        share.smooth(rows[is_partial & is_gentle], steps=stride)

    def _shares(
        self,
        emitter: Emitter,
        rows: Rows,
        rays: "Rays | NDArray[np.int64]",
        stride: int,
    ) -> tuple[Floats, Floats]:
        """The visible share (N,) of an emitter's light at points, and the share of the rays that met nothing opaque.

        `rays` are the same for all, or rays from the middle of each point by their number along a side (N,).
        """
        pattern = self._pattern(stride=stride)
        share = np.zeros(len(rows), np.float32)
        clear = np.zeros(len(rows), np.float32)
        parts = [(rays, np.arange(len(rows)))] if isinstance(rays, Rays) else []
        if not isinstance(rays, Rays):
            parts = [(Rays(int(ray_side)), np.flatnonzero(rays == ray_side)) for ray_side in np.unique(rays)]
        for part_rays, part in parts:
            total, part_clear, unshaded = arriving(
                emitter, self.points, rows[part], self.visibility, part_rays, pattern
            )
            share[part] = total / np.maximum(unshaded, LEAST_LX)
            clear[part] = np.nan_to_num(part_clear)
        return share, clear

    def _sampled(self, emitter: Emitter, rows: Rows, side: int) -> Floats:
        """The light (N,) that rays to an emitter bring to points."""
        sides = first_rays(emitter, self.points.points_m[rows], side)
        light = np.zeros(len(rows), np.float32)
        for ray_side in np.unique(sides):
            part = np.flatnonzero(sides == ray_side)
            light[part] = arriving(emitter, self.points, rows[part], self.visibility, Rays(int(ray_side)))[0]
        return light

    def _open_light(self, emitter: Emitter, rows: Rows, side: int) -> tuple[Floats, Mask]:
        """The illuminance (N,) at points if nothing hid the emitter; and where it is sampled, hence grainy (N,)."""
        points = self.points
        light = TexelField.unknown(self.layout, len(points))
        is_grainy = np.zeros(len(points), bool)
        is_bent = np.zeros(len(points), bool)
        is_bent[rows] = chunked(lambda part: _are_bent(points, rows[part]), len(rows))
        grid = self.layout.on_grid(rows, STRIDES[0])
        exact_lx, is_grainy[grid] = open_light(emitter, points, grid, side)
        light.set(grid, exact_lx)
        for stride in FINER_STRIDES:
            exact = grid[~is_grainy[grid]]
            is_bend = light.bends(exact, steps=2 * stride, tolerance=BEND)
            grid = self.layout.on_grid(rows, stride)
            light.state[grid[is_bent[grid]]] = UNKNOWN
            asked = light.refine(grid, stride=stride, tolerance=UNEVEN, is_relative=True, marked=is_bend)
            exact_lx, is_grainy[asked] = open_light(emitter, points, asked, side)
            light.set(asked, exact_lx)
        return light.values[rows], is_grainy[rows]

    def _pattern(self, *, stride: int, turn: float = 0) -> "EvenPattern":
        return EvenPattern(self.layout.width, stride, self.points.dither[:1] + np.float32(turn))

    def _half_shadow(self, clear: Floats, cells: Indices, among: Rows, *, rim: int) -> Rows:
        """Those among the points (N,) beside which an emitter is both seen and hidden, or in their cell (P,).

        clear (P,): the share of rays that met nothing, NaN where none was sent.
        """
        is_seen = clear > 0
        is_hidden = clear < 1
        seen_in_cell = np.zeros(int(cells.max(initial=0)) + 1, bool)
        hidden_in_cell = np.zeros_like(seen_in_cell)
        seen_in_cell[cells[is_seen]] = True
        hidden_in_cell[cells[is_hidden]] = True
        is_mixed = seen_in_cell & hidden_in_cell
        is_near = self.layout.dilated(is_seen, steps=rim) & self.layout.dilated(is_hidden, steps=rim)
        return among[(is_near | is_mixed[cells])[among]]


def _are_bent(points: Texels, rows: Rows) -> Mask:
    """Which of the points at rows (N,) have a normal that is not that of their flat face."""
    return np.asarray(np.abs(points.normals[rows] - points.planes[rows]).max(1) > BENT)


@dataclass(frozen=True, slots=True)
class EvenPattern:
    """Numbers by which the rays of texels beside one another fit together, as if they were those of one larger texel.

    The texels of each square of 2^n x 2^n are a (0, 2n, 2)-net of Sobol's sequence, along a Z-shaped curve. Every
    stride-th texel along rows and columns counts; the shift (1, 2) is added to all.
    Source: Ahmed and Wonka, Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error, 2020.
    """

    width: int
    stride: int
    shift: Floats

    def dither(self, index: Rows, others: Floats) -> Floats:
        """Two numbers in [0, 1) for each texel at a flat index (P, 2), the `others` (P, 2) for those between."""
        row, column = np.divmod(index, self.width)
        is_between = (row % self.stride != 0) | (column % self.stride != 0)
        along_curve = _spread_bits(column // self.stride) | _spread_bits(row // self.stride) << np.uint32(1)
        first = np.zeros(len(index), np.uint32)
        second = np.zeros(len(index), np.uint32)
        first_direction = 1 << PATTERN_BITS - 1
        second_direction = 1 << PATTERN_BITS - 1
        for bit in range(PATTERN_BITS):
            is_set = (along_curve >> np.uint32(bit)) & np.uint32(1)
            first ^= is_set * np.uint32(first_direction)
            second ^= is_set * np.uint32(second_direction)
            first_direction >>= 1
            second_direction ^= second_direction >> 1
        numbers = np.stack([first, second], -1).astype(np.float32)
        shifted = numbers / np.float32(1 << PATTERN_BITS) + self.shift
        return np.where(is_between[:, None], others, shifted - np.floor(shifted))


PATTERN_BITS = 12  # of a place along the curve: texels 64 apart have the same numbers


def _spread_bits(numbers: Rows) -> NDArray[np.uint32]:
    """Numbers (N,) whose bits are the lowest six of each, with a zero between."""
    bits = (numbers & 0x3F).astype(np.uint32)
    bits = (bits | bits << np.uint32(4)) & np.uint32(0x30F)
    bits = (bits | bits << np.uint32(2)) & np.uint32(0x333)
    return (bits | bits << np.uint32(1)) & np.uint32(0x555)


def reached(emitter: Emitter, points: Texels, rows: Rows) -> Rows:
    """Those of the points at rows (N,) that any light of an emitter can reach, as far as that is known without rays."""

    def reached_part(part: slice) -> Rows:
        part_rows = rows[part]
        is_ahead = np.empty(len(part_rows), bool)
        ball = emitter.ball
        ahead_of(points.points_m, points.normals, part_rows, ball.centre_m, ball.radius_m, is_ahead)
        part_rows = part_rows[is_ahead]
        return np.asarray(part_rows[emitter.may_light(points.points_m[part_rows])])

    return chunked(reached_part, len(rows))


def first_rays(
    emitter: Emitter,
    points_m: Floats,
    side: int,
) -> NDArray[np.int64]:
    """How many rays along a side points (P, 3) need to tell whether they see an emitter: one where shadows are hard."""
    width_rad = chunked(lambda part: emitter.width_rad(points_m[part]), len(points_m))
    half = max(side // 2, 1)
    most = max(3 * side // 4, 1)
    # Few of the rays to an open sky find a small opening. Frames beside a pane send much of its light on into a room.
    widest = 3 * side // 2
    if emitter.sky != "pane":
        conditions = [width_rad == 0, width_rad < WIDE_RAD, width_rad < BESIDE_RAD]
        return np.select(conditions, [1, half, most], widest)
    conditions = [width_rad < NARROW_RAD, width_rad < WIDE_RAD, width_rad < BESIDE_RAD]
    return np.select(conditions, [half, most, side], widest)


def arriving(  # noqa: PLR0917
    emitter: Emitter,
    points: Texels,
    rows: Rows,
    occluder: Occluder,
    rays: Rays,
    pattern: EvenPattern | None = None,
) -> Floats:
    """(3, N) of points at rows: illuminance, share of rays that met nothing opaque (NaN: none sent), light unshaded.

    With a pattern the rays of points beside one another fit together.
    """

    def arriving_part(part: slice) -> Floats:
        texels = points.take(rows[part])
        if pattern:
            texels = replace(texels, dither=pattern.dither(texels.index, texels.dither))
        return _arriving(emitter, texels, occluder, rays)

    return chunked(arriving_part, len(rows)).T


def _arriving(
    emitter: Emitter,
    texels: Texels,
    occluder: Occluder,
    rays: Rays,
) -> Floats:
    count = len(texels)
    total, unshaded, passed_count, ray_count = np.zeros((4, count), np.float32)
    rows = np.empty(count, np.int32)
    origins_m = np.empty((count, 3), np.float32)
    segments_m = np.empty((count, 3), np.float32)
    towards = emitter.towards(texels)
    for cell in range(rays.side**2):
        vectors_m, light = _sent(towards, texels, cell, rays.side)
        lit_count = lit_rays(texels.points_m, vectors_m, light, rows, origins_m, segments_m)
        lit = slice(lit_count)
        if rays.spread:
            steps_m = (texels.step_u_m, texels.step_v_m)
            spread_over_texels(texels.dither, *steps_m, cell, rows[lit], origins_m[lit], segments_m[lit])
        share = emitter.passing(occluder, origins_m[lit], segments_m[lit])
        add_arrived(rows[lit], share.astype(np.float32), light, total, unshaded, passed_count, ray_count)
    with np.errstate(invalid="ignore"):
        clear_share = passed_count / ray_count
    return np.stack([total / rays.side**2, clear_share, unshaded / rays.side**2], -1)


def open_light(
    emitter: Emitter,
    points: Texels,
    rows: Rows,
    side: int,
) -> tuple[Floats, Mask]:
    """Illuminance (N,) of the points at rows if nothing hid the emitter; and where it is sampled, hence grainy (N,)."""
    light = chunked(lambda part: emitter.open_light(points.take(rows[part])), len(rows))
    is_sampled = np.isnan(light)
    unknown = rows[is_sampled]
    places_side = max(side, emitter.open_side)
    light[is_sampled] = chunked(
        lambda part: _sampled_light(emitter, points.take(unknown[part]), places_side), len(unknown)
    )
    return light, is_sampled


def _sampled_light(emitter: Emitter, texels: Texels, side: int) -> Floats:
    """The mean illuminance (P,) of side x side places on an emitter."""
    towards = emitter.towards(texels)
    total = np.zeros(len(texels), np.float32)
    for cell in range(side**2):
        total += _sent(towards, texels, cell, side)[1]
    return total / np.float32(side**2)


def _sent(
    towards: Aim,
    texels: Texels,
    cell: int,
    side: int,
) -> tuple[Floats, Floats]:
    """Vectors (P, 3) to an emitter, and the illuminance (P,) that enters from there if nothing hides it."""
    a, b, light = np.empty((3, len(texels)), np.float32)
    places_in_cell(texels.dither, cell, side, a, b)
    vectors_m, strength = towards(a, b)
    vectors_m = np.ascontiguousarray(vectors_m, np.float32)
    strength = np.ascontiguousarray(strength, np.float32)
    entering_light(vectors_m, strength, texels.normals, texels.planes, texels.eta, light)
    return vectors_m, light
