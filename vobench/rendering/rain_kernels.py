"""Compiled kernel of rain: the share of each pixel that moving discs cover."""

import math

from vobench.rendering.array_types import Floats
from vobench.rendering.compiled import compiled

STEP_PX = 0.5  # the largest distance between two places at which a small disc is drawn
STEP_DIAMETERS = 0.25  # and that for a large one
MOST_STEPS = 4096
WIDEST_PX = 400.0  # wider discs are drawn as wide as this: they are nearer than any lens


@compiled
def draw_disc(cover: Floats, u: float, v: float, diameter_px: float, area_px2: float) -> None:
    """Add a disc of an area to the cover (H, W) of pixels, spread over a diameter around a place."""
    height, width = cover.shape
    reach_px = max(diameter_px / 2 + 0.5, 1.0)  # a small disc covers four pixels, so its middle is where it should be
    first_row = math.ceil(v - reach_px)
    last_row = math.floor(v + reach_px)
    first_column = math.ceil(u - reach_px)
    last_column = math.floor(u + reach_px)
    if last_row < 0 or last_column < 0 or first_row >= height or first_column >= width:
        return

    total = 0.0
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            total += _weight(column - u, row - v, reach_px)
    if total <= 0.0:
        return
    scale = area_px2 / total
    for row in range(max(first_row, 0), min(last_row + 1, height)):
        for column in range(max(first_column, 0), min(last_column + 1, width)):
            cover[row, column] += scale * _weight(column - u, row - v, reach_px)


@compiled
def _weight(right_px: float, down_px: float, reach_px: float) -> float:
    """The share of a pixel at a distance from the middle of a disc, whose rim is a pixel wide."""
    if reach_px <= 1.0:
        return max(1.0 - abs(right_px), 0.0) * max(1.0 - abs(down_px), 0.0)
    inside_px = reach_px - math.sqrt(right_px * right_px + down_px * down_px)
    return min(max(inside_px, 0.0), 1.0)


@compiled
def draw_streaks(
    cover: Floats,
    starts_px: Floats,
    ends_px: Floats,
    diameters_px: Floats,
    areas_px2: Floats,
) -> None:
    """Add discs that move evenly from starts to ends (N, 2) to the cover (H, W), each with its area (N,) in all."""
    for drop in range(len(starts_px)):
        diameter_px = min(diameters_px[drop], WIDEST_PX)
        along_u = ends_px[drop, 0] - starts_px[drop, 0]
        along_v = ends_px[drop, 1] - starts_px[drop, 1]
        length_px = math.sqrt(along_u * along_u + along_v * along_v)
        step_px = max(STEP_PX, STEP_DIAMETERS * diameter_px)
        steps = int(min(math.ceil(length_px / step_px) + 1.0, MOST_STEPS))
        area_px2 = areas_px2[drop] / steps
        for step in range(steps):
            share = (step + 0.5) / steps
            u = starts_px[drop, 0] + share * along_u
            v = starts_px[drop, 1] + share * along_v
            draw_disc(cover, u, v, diameter_px, area_px2)
