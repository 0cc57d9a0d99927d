"""Shadow rays from texels to places on one emitter, and the light that arrives along them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Mask, Rows
from vobench.rendering.emitter import Aim, Emitter, Occluder
from vobench.rendering.shadow_kernels import (
    add_arrived,
    ahead_of,
    entering_light,
    lit_rays,
    places_in_cell,
    spread_over_texels,
)
from vobench.rendering.sobol_pattern import SobolPattern
from vobench.rendering.texel import Texels
from vobench.rendering.thread_pool import chunked

# The angular widths of an emitter up to which fewer rays are needed.
NARROW_RAD = 0.15
WIDE_RAD = 0.6
WIDER_RAD = 1.5


@dataclass(frozen=True, slots=True)
class RayGrid:
    """The shadow rays of a texel: one to each cell of an emitter that is divided into side x side cells.

    `is_spread` is whether the rays start at points in the area of the texel, instead of its centre.
    """

    side: int
    is_spread: bool = False


@dataclass(frozen=True, slots=True)
class ArrivedLight:
    """The light that arrives at N points along shadow rays.

    `light` (N,) is the illuminance in lx, under a coat only the light that enters it.
    `clear_share` (N,) is the share of rays that hit nothing opaque, NaN without rays.
    `unshadowed` (N,) is the illuminance without any obstacle.
    """

    light: Floats
    clear_share: Floats
    unshadowed: Floats


def reachable(emitter: Emitter, points: Texels, rows: Rows) -> Rows:
    """The points among the rows (N,) that the light of an emitter can reach, as far as this is known without rays."""

    def reachable_part(part: slice) -> Rows:
        part_rows = rows[part]
        is_ahead = np.empty(len(part_rows), bool)
        ball = emitter.ball
        ahead_of(points.points_m, points.normals, part_rows, ball.centre_m, ball.radius_m, is_ahead)
        part_rows = part_rows[is_ahead]
        return np.asarray(part_rows[emitter.may_reach(points.points_m[part_rows])])

    return chunked(reachable_part, len(rows))


def first_sides(
    emitter: Emitter,
    points_m: Floats,
    side: int,
) -> NDArray[np.int64]:
    """The side (P,) of the first grid of rays from points (P, 3) to an emitter; 1 if its shadows are hard.

    It depends on the angular width of the emitter. `side` is the one for a medium width.
    """
    width_rad = chunked(lambda part: emitter.width_rad(points_m[part]), len(points_m))
    half = max(side // 2, 1)
    three_quarters = max(3 * side // 4, 1)
    # An open sky needs many rays, because few of them pass through a small opening. A pane needs many rays because its
    # frame reflects much of its light into the room.
    one_and_a_half = 3 * side // 2
    if emitter.sky == "pane":
        conditions = [width_rad < NARROW_RAD, width_rad < WIDE_RAD, width_rad < WIDER_RAD]
        return np.select(conditions, [half, three_quarters, side], one_and_a_half)
    conditions = [width_rad == 0, width_rad < WIDE_RAD, width_rad < WIDER_RAD]
    return np.select(conditions, [1, half, three_quarters], one_and_a_half)


def cast_shadow_rays(  # noqa: PLR0917
    emitter: Emitter,
    points: Texels,
    rows: Rows,
    occluder: Occluder,
    grid: RayGrid,
    pattern: SobolPattern | None = None,
) -> ArrivedLight:
    """Cast a grid of shadow rays from each of the points at rows (N,) to an emitter.

    With a pattern, the rays of neighbouring texels are stratified together.
    """

    def cast(part: slice) -> Floats:
        texels = points.take(rows[part])
        if pattern:
            texels = replace(texels, dither=pattern.offsets(texels.index, texels.dither))
        return _cast(emitter, texels, occluder, grid)

    return ArrivedLight(*chunked(cast, len(rows)).T)


def _cast(
    emitter: Emitter,
    texels: Texels,
    occluder: Occluder,
    grid: RayGrid,
) -> Floats:
    """The columns (P, 3) of `ArrivedLight` at texels."""
    count = len(texels)
    total, unshadowed, passed_count, ray_count = np.zeros((4, count), np.float32)
    rows = np.empty(count, np.int32)
    origins_m = np.empty((count, 3), np.float32)
    segments_m = np.empty((count, 3), np.float32)
    aim = emitter.towards(texels)
    for cell in range(grid.side**2):
        vectors_m, light = _light_of_cell(aim, texels, cell, grid.side)
        lit_count = lit_rays(texels.points_m, vectors_m, light, rows, origins_m, segments_m)
        lit = slice(lit_count)
        if grid.is_spread:
            steps_m = (texels.step_u_m, texels.step_v_m)
            spread_over_texels(texels.dither, *steps_m, cell, rows[lit], origins_m[lit], segments_m[lit])
        share = emitter.passing(occluder, origins_m[lit], segments_m[lit])
        add_arrived(rows[lit], share.astype(np.float32), light, total, unshadowed, passed_count, ray_count)
    with np.errstate(invalid="ignore"):
        clear_share = passed_count / ray_count
    return np.stack([total / grid.side**2, clear_share, unshadowed / grid.side**2], -1)


def unshadowed_light(
    emitter: Emitter,
    points: Texels,
    rows: Rows,
    side: int,
) -> tuple[Floats, Mask]:
    """The unshadowed illuminance (N,) of the points at rows, and whether each value is sampled (N,).

    It is computed with a formula if there is one, otherwise it is sampled at side x side places of the emitter or more.
    """
    light = chunked(lambda part: emitter.unshadowed_light(points.take(rows[part])), len(rows))
    is_sampled = np.isnan(light)
    sampled_rows = rows[is_sampled]
    sampled_side = max(side, emitter.least_side)

    def sample(part: slice) -> Floats:
        return _mean_light(emitter, points.take(sampled_rows[part]), sampled_side)

    light[is_sampled] = chunked(sample, len(sampled_rows))
    return light, is_sampled


def _mean_light(emitter: Emitter, texels: Texels, side: int) -> Floats:
    """The mean illuminance (P,) of side x side places on an emitter."""
    aim = emitter.towards(texels)
    total = np.zeros(len(texels), np.float32)
    for cell in range(side**2):
        _, light = _light_of_cell(aim, texels, cell, side)
        total += light
    return total / np.float32(side**2)


def _light_of_cell(
    aim: Aim,
    texels: Texels,
    cell: int,
    side: int,
) -> tuple[Floats, Floats]:
    """The vectors (P, 3) to places in one of side x side cells of an emitter, and the unshadowed illuminance (P,)."""
    a, b, light = np.empty((3, len(texels)), np.float32)
    places_in_cell(texels.dither, cell, side, a, b)
    vectors_m, strength = aim(a, b)
    vectors_m = np.ascontiguousarray(vectors_m, np.float32)
    strength = np.ascontiguousarray(strength, np.float32)
    entering_light(vectors_m, strength, texels.normals, texels.planes, texels.eta, light)
    return vectors_m, light
