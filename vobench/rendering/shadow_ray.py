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

# Angular widths of emitters. The wider an emitter is, the more shadow rays are cast at it.
NARROW_RAD = 0.15
WIDE_RAD = 0.6
WIDER_RAD = 1.5


@dataclass(frozen=True, slots=True)
class RayGrid:
    """The shadow rays of a texel: one ray to each of the side x side cells of an emitter.

    `side` is the number of cells along each side of the emitter.
    `is_spread` is whether the rays start at random points on the area of the texel instead of its centre.
    """

    side: int
    is_spread: bool = False


@dataclass(frozen=True, slots=True)
class ArrivedLight:
    """The light that arrives at N points along shadow rays.

    `light` (N,) is the illuminance in lx. At points with a coat, only the light that enters the coat is counted.
    `clear_share` (N,) is the share of the rays that hit no opaque face. It is NaN if no ray was cast.
    `unshadowed` (N,) is the illuminance in lx that there would be without any obstacle.
    """

    light: Floats
    clear_share: Floats
    unshadowed: Floats


def reachable(emitter: Emitter, points: Texels, rows: Rows) -> Rows:
    """The rows of the points, among `rows` (N,), that the light of an emitter may reach.

    Points that face away from the emitter, and those that it cannot reach for another reason, are excluded. No rays are
    cast, so an obstacle may still block the light.
    """

    def reachable_part(part: slice) -> Rows:
        part_rows = rows[part]
        is_ahead = np.empty(len(part_rows), bool)
        ball = emitter.ball
        ahead_of(points.points_m, points.normals, part_rows, ball.centre_m, ball.radius_m, is_ahead)
        rows_ahead = part_rows[is_ahead]
        may_reach = emitter.may_reach(points.points_m[rows_ahead])
        return np.asarray(rows_ahead[may_reach])

    return chunked(reachable_part, len(rows))


def first_sides(
    emitter: Emitter,
    points_m: Floats,
    side: int,
) -> NDArray[np.int64]:
    """The side (P,) of the first grid of rays from each of the points (P, 3) to an emitter.

    The result grows with the angular width of the emitter. It is 1 if the shadows of the emitter are hard.

    `side` is the nominal side. The results are fractions or multiples of it.
    """
    width_rad = chunked(lambda part: emitter.width_rad(points_m[part]), len(points_m))
    half = max(side // 2, 1)
    three_quarters = max(3 * side // 4, 1)
    one_and_a_half = 3 * side // 2
    # A pane needs many rays, because its frame reflects much of its light into the room. An open sky needs many rays,
    # because few of them pass through a small opening.
    if emitter.sky == "pane":
        is_narrower = [width_rad < NARROW_RAD, width_rad < WIDE_RAD, width_rad < WIDER_RAD]
        sides = [half, three_quarters, side]
    else:
        is_narrower = [width_rad == 0, width_rad < WIDE_RAD, width_rad < WIDER_RAD]
        sides = [1, half, three_quarters]
    return np.select(is_narrower, sides, default=one_and_a_half)


def cast_shadow_rays(  # noqa: PLR0917
    emitter: Emitter,
    points: Texels,
    rows: Rows,
    occluder: Occluder,
    grid: RayGrid,
    pattern: SobolPattern | None = None,
) -> ArrivedLight:
    """Cast a grid of shadow rays from each of the points at rows (N,) to an emitter.

    `grid` is the grid of the rays of one point.
    `pattern` stratifies the rays of neighbouring texels together. If it is None, the dither of each texel is used.
    """

    def cast(part: slice) -> Floats:
        texels = points.take(rows[part])
        if pattern:
            offsets = pattern.offsets(texels.index, texels.dither)
            texels = replace(texels, dither=offsets)
        return _cast(emitter, texels, occluder, grid)

    light, clear_share, unshadowed = chunked(cast, len(rows)).T
    return ArrivedLight(light, clear_share, unshadowed)


def _cast(
    emitter: Emitter,
    texels: Texels,
    occluder: Occluder,
    grid: RayGrid,
) -> Floats:
    """The fields of `ArrivedLight` as the columns of an array (P, 3), for texels (P,)."""
    count = len(texels)
    total_lx = np.zeros(count, np.float32)
    total_unshadowed_lx = np.zeros(count, np.float32)
    clear_count = np.zeros(count, np.float32)
    ray_count = np.zeros(count, np.float32)
    # Buffers for the shadow rays of one cell. `lit_rays` writes the rays of the texels that the cell would light.
    row_buffer = np.empty(count, np.int32)
    origin_buffer_m = np.empty((count, 3), np.float32)
    segment_buffer_m = np.empty((count, 3), np.float32)
    aim = emitter.towards(texels)
    for cell in range(grid.side**2):
        vectors_m, light = _light_of_cell(aim, texels, cell, grid.side)
        lit_count = lit_rays(texels.points_m, vectors_m, light, row_buffer, origin_buffer_m, segment_buffer_m)
        rows = row_buffer[:lit_count]
        origins_m = origin_buffer_m[:lit_count]
        segments_m = segment_buffer_m[:lit_count]
        if grid.is_spread:
            spread_over_texels(
                texels.dither,
                texels.step_u_m,
                texels.step_v_m,
                cell,
                rows,
                origins_m,
                segments_m,
            )
        transmittance = emitter.transmittance(occluder, origins_m, segments_m)
        add_arrived(
            rows,
            transmittance.astype(np.float32),
            light,
            total_lx,
            total_unshadowed_lx,
            clear_count,
            ray_count,
        )

    cell_count = grid.side**2
    with np.errstate(invalid="ignore"):  # 0 / 0 is NaN, for texels without rays
        clear_share = clear_count / ray_count
    mean_lx = total_lx / cell_count
    mean_unshadowed_lx = total_unshadowed_lx / cell_count
    return np.stack([mean_lx, clear_share, mean_unshadowed_lx], -1)


def unshadowed_light(
    emitter: Emitter,
    points: Texels,
    rows: Rows,
    side: int,
) -> tuple[Floats, Mask]:
    """The unshadowed illuminance (N,) in lx of the points at `rows`, and whether each value is sampled (N,).

    If the emitter has a formula for the illuminance of a point, the formula is used. Otherwise the illuminance is
    sampled at side x side places of the emitter, or at more if the emitter requires it.
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
    """The illuminance (P,) in lx of texels by an emitter, as the mean over side x side places on it."""
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
    """Random places in one of the side x side cells of an emitter, one for each texel.

    Returns the vectors (P, 3) in m from the texels to the places, and the unshadowed illuminance (P,) in lx.
    """
    count = len(texels)
    a = np.empty(count, np.float32)
    b = np.empty(count, np.float32)
    light = np.empty(count, np.float32)
    places_in_cell(texels.dither, cell, side, a, b)
    vectors_m, strength = aim(a, b)
    vectors_m = np.ascontiguousarray(vectors_m, np.float32)
    strength = np.ascontiguousarray(strength, np.float32)
    entering_light(vectors_m, strength, texels.normals, texels.planes, texels.eta, light)
    return vectors_m, light
