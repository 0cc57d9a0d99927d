"""Direct light at texels: the light of one emitter, with hard or soft shadows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.emitter import Emitter
from vobench.rendering.level_kernels import UNKNOWN
from vobench.rendering.shadow_ray import RayGrid, cast_shadow_rays, first_sides, reachable, unshadowed_light
from vobench.rendering.sobol_pattern import SobolPattern
from vobench.rendering.texel import Texels
from vobench.rendering.texel_field import TexelField
from vobench.rendering.texel_layout import STRIDES, TexelLayout
from vobench.rendering.thread_pool import chunked
from vobench.rendering.visibility import Visibility

EDGE_STEPS = 2  # the number of texels around the edge of a hard shadow that are supersampled
LEAST_LX = 1e-30  # avoids a division by zero
FINER_STRIDES = (*STRIDES[1:], 1)

# The visible share is interpolated on the grids of FINER_STRIDES if it differs by less than this between neighbours.
# The error of an interpolated value beside the edge of a penumbra is less than half of this.
STEEP = (0.08, 0.15)
GENTLE = 0.2  # the visible share is smoothed if, once smoothed, it differs by less than this between neighbours
STEEP_SIDES = 2  # how many times as many rays along each side of the grid of rays where it differs by more

PANE_BLURS = 4  # how often the light through a pane is blurred, so that the noise of its few rays leaves no stains
# The light through a pane is interpolated on the grids of FINER_STRIDES if its relative difference is at most this.
PANE_UNEVEN = (0.02, 1.0)

# The open sky is so bright that the light of a small share of it is computed with more rays, and smoothed.
FAINT_SHARE = 0.3  # the greatest share for which this is done
DIM_SHARE = 0.1  # the greatest mean share of a place for which this is done; where it is greater, light is bright
FAINT_SIDES = 4  # how many times as many rays along each side of the grid of rays
FAINT_STEPS = 8  # the distance of points that may have missed the sky from one that saw it, in coarsest steps
# The greatest shares, and how many times such shares are smoothed: the smaller a share is, the fewer rays see the sky.
SMOOTHINGS_OF_FAINT = ((FAINT_SHARE, 2), (0.1, 4), (0.02, 16))

# Unshadowed light is interpolated if its relative difference between neighbours is less than UNEVEN, and if it differs
# by less than BEND from the mean of its neighbours, which is four times the error of the interpolation. It is always
# computed where the normal differs by more than BENT from that of the flat face.
UNEVEN = 0.1
BEND = 0.004
BENT = 1e-4


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
    """The illuminance (P,) in lx of points by an emitter at level 1. Under a coat it is the light that enters the coat.

    `cells` (P,) is the surfel of each point.
    `side` determines the number of shadow rays: about side x side where an emitter is partly hidden.
    `among` (P,) selects the points. The others get 0.
    """
    lit = reachable(emitter, points, np.flatnonzero(among))
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
    """Points that receive light.

    `points` (P,) are all points, with their places in the `layout` of texels.
    `cells` (P,) is the surfel of each point.
    `visibility` finds what hides an emitter from a point.
    `lit` (N,) are the rows of the points that the emitter can light.
    """

    points: Texels
    layout: TexelLayout
    cells: Indices
    visibility: Visibility
    lit: Rows

    def pane_light(self, emitter: Emitter, side: int) -> Floats:
        """The light (P,) of the sky through a pane, sampled at every second texel along rows and columns.

        Where it is even, as behind walls, every fourth texel suffices.
        """
        light = TexelField.unknown(self.layout, len(self.points))
        rows = self.layout.on_grid(self.lit, STRIDES[0])
        light.set(rows, self._sampled(emitter, rows, side))
        for stride, tolerance in zip(FINER_STRIDES, PANE_UNEVEN, strict=True):
            rows = self.layout.on_grid(self.lit, stride)
            not_interpolated = light.refine(rows, stride=stride, tolerance=tolerance, is_relative=True)
            light.set(not_interpolated, self._sampled(emitter, not_interpolated, side))
        values = light.values
        for _ in range(PANE_BLURS):
            values = self.layout.blurred(values)
        return values

    def hard_light(self, emitter: Emitter, side: int) -> Floats:
        """The light (P,) of a narrow emitter, for which one shadow ray suffices except near the edges of shadows.

        There, several rays start from the area of each texel: few near an edge, many at the edge itself.
        """
        points = self.points
        light = np.zeros(len(points), np.float32)
        clear_share = np.full(len(points), np.nan, np.float32)
        arrived = cast_shadow_rays(emitter, points, self.lit, self.visibility, RayGrid(1))
        light[self.lit] = arrived.light
        clear_share[self.lit] = arrived.clear_share
        near_edge = self._at_shadow_edge(clear_share, self.cells, self.lit, steps=EDGE_STEPS)

        # Near an edge.
        pattern = self._pattern(stride=1)
        few_rays = RayGrid(max(side // 2, 1), is_spread=True)
        arrived = cast_shadow_rays(emitter, points, near_edge, self.visibility, few_rays, pattern)
        light[near_edge] = arrived.light
        clear_share[near_edge] = arrived.clear_share

        # At the edge itself. Here, every point has a cell of its own, so that only the neighbouring texels count.
        own_cells = np.arange(len(points), dtype=np.int32)
        at_edge = self._at_shadow_edge(clear_share, own_cells, near_edge, steps=1)
        many_rays = RayGrid(3 * side // 2, is_spread=True)
        light[at_edge] = cast_shadow_rays(emitter, points, at_edge, self.visibility, many_rays, pattern).light
        return light

    def soft_light(self, emitter: Emitter, side: int) -> Floats:
        """The light (P,) of a wide emitter: the unshadowed light times the visible share.

        Both are computed at every fourth texel along rows and columns, and on finer grids only where they vary.
        Source: Heitz, Hill and McGuire, Combining Analytic Direct Illumination and Stochastic Shadows, 2018.
        """
        share = self._visible_share(emitter, side)
        visible = self.lit[share[self.lit] > 0]
        unshadowed_lx, is_sampled = self._unshadowed_light(emitter, visible, side)
        light = np.zeros(len(self.points), np.float32)
        light[visible] = share[visible] * unshadowed_lx
        noisy = visible[is_sampled]
        if emitter.least_side > 1 and len(noisy):
            light[noisy] = self.layout.blurred(light)[noisy]
        return light

    def _visible_share(self, emitter: Emitter, side: int) -> Floats:
        """The share (P,) of an emitter's light that reaches each point."""
        share = TexelField.unknown(self.layout, len(self.points))
        coarsest = STRIDES[0]
        rows = self.layout.on_grid(self.lit, coarsest)
        spread_grid = RayGrid(side, is_spread=True)
        if emitter.sky == "open":
            self._set_share_of_sky(share, emitter, rows, spread_grid)
        else:
            first_share, clear_share = self._shares_by_sides(emitter, rows, side, coarsest)
            share.set(rows, clear_share)
            is_partly_hidden = _are_partly_hidden(share, rows)
            share.set(rows, first_share)
            self._compute_share(share, emitter, rows[is_partly_hidden], spread_grid, coarsest)
        if emitter.sky == "open" and share.values[rows].mean() < DIM_SHARE:
            self._compute_faint_share(share, emitter, rows, FAINT_SIDES * side)

        finer_grid = RayGrid(max(3 * side // 4, 1), is_spread=True)
        for stride, tolerance in zip(FINER_STRIDES, STEEP, strict=True):
            rows = self.layout.on_grid(self.lit, stride)
            steep = share.refine(rows, stride=stride, tolerance=tolerance)
            self._compute_share(share, emitter, steep, finer_grid, stride)
        return share.values

    def _set_share_of_sky(self, share: TexelField, emitter: Emitter, rows: Rows, grid: RayGrid) -> None:
        """Set the visible share of the open sky at the rows (N,) of the coarsest grid.

        Outdoors, most points see a part of the sky. Therefore the rays of the grid are cast first, and more rays only
        from the points around which none of these, or all, are blocked.
        """
        coarsest = STRIDES[0]
        first_share, clear_share = self._shares(emitter, rows, grid, coarsest)
        share.set(rows, clear_share)
        even = np.flatnonzero(~_are_partly_hidden(share, rows))
        share_by_more_rays, clear_share = self._shares_by_sides(emitter, rows[even], grid.side, coarsest)
        share.set(rows[even], clear_share)
        is_partly_hidden = _are_partly_hidden(share, rows)

        values = first_share.copy()
        values[even] = share_by_more_rays
        values[is_partly_hidden] = first_share[is_partly_hidden]
        share.set(rows, values)
        self._smooth_share(share, emitter, rows[is_partly_hidden], grid, coarsest)

    def _compute_faint_share(self, share: TexelField, emitter: Emitter, rows: Rows, side: int) -> None:
        """Compute again, with side x side rays, a small share of the sky, as that seen through an opening far away.

        A few rays find such an opening or miss it. The sky is so bright that this would be seen as stains.
        """
        coarsest = STRIDES[0]
        _, high = share.extremes(rows, steps=coarsest)
        saw_sky_nearby = share.copy()
        for _ in range(FAINT_STEPS):
            saw_sky_nearby.smooth(rows, steps=coarsest)
        is_faint = (saw_sky_nearby.values[rows] > 0) & (high < FAINT_SHARE)
        faint = rows[is_faint]
        values, _ = self._shares(emitter, faint, RayGrid(side, is_spread=True), coarsest)
        share.set(faint, values)
        for greatest_share, smoothings in SMOOTHINGS_OF_FAINT:
            fainter = faint[share.values[faint] < greatest_share]
            for _ in range(smoothings):
                share.smooth(fainter, steps=coarsest)

    def _compute_share(self, share: TexelField, emitter: Emitter, rows: Rows, grid: RayGrid, stride: int) -> None:
        """Set the visible share of an emitter's light at the rows (N,), without the noise of its rays."""
        values, _ = self._shares(emitter, rows, grid, stride)
        share.set(rows, values)
        self._smooth_share(share, emitter, rows, grid, stride)

    def _smooth_share(self, share: TexelField, emitter: Emitter, rows: Rows, grid: RayGrid, stride: int) -> None:
        """Remove the noise of rays from the visible share of an emitter's light at the rows (N,).

        In and beside a penumbra it is smoothed where it changes slowly. Where it does not, more rays are cast on the
        finest grid, because smoothing would blur the shadow.
        """
        low, high = share.extremes(rows, steps=stride)
        near_penumbra = rows[(low < 1) & (high > 0)]
        smoothed = share.copy()
        smoothed.smooth(near_penumbra, steps=stride)
        low, high = smoothed.extremes(near_penumbra, steps=stride)
        is_gentle = high - low < GENTLE
        share.smooth(near_penumbra[is_gentle], steps=stride)
        if stride == 1:
            steep = near_penumbra[~is_gentle]
            many_rays = RayGrid(STEEP_SIDES * grid.side, is_spread=True)
            values, _ = self._shares(emitter, steep, many_rays, stride)
            share.set(steep, values)

    def _shares_by_sides(self, emitter: Emitter, rows: Rows, side: int, stride: int) -> tuple[Floats, Floats]:
        """As `_shares`, with a number of rays that depends on the apparent size of the emitter."""
        share = np.zeros(len(rows), np.float32)
        clear_share = np.zeros(len(rows), np.float32)
        for ray_side, part in self._parts_by_side(emitter, rows, side):
            share[part], clear_share[part] = self._shares(emitter, rows[part], RayGrid(ray_side), stride)
        return share, clear_share

    def _shares(self, emitter: Emitter, rows: Rows, grid: RayGrid, stride: int) -> tuple[Floats, Floats]:
        """The visible share (N,) of an emitter's light at points, and the share (N,) of unobstructed rays."""
        arrived = cast_shadow_rays(emitter, self.points, rows, self.visibility, grid, self._pattern(stride=stride))
        share = arrived.light / np.maximum(arrived.unshadowed, LEAST_LX)
        return share, np.nan_to_num(arrived.clear_share)

    def _sampled(self, emitter: Emitter, rows: Rows, side: int) -> Floats:
        """The light (N,) at points, with a number of rays that depends on the apparent size of the emitter."""
        light = np.zeros(len(rows), np.float32)
        for ray_side, part in self._parts_by_side(emitter, rows, side):
            grid = RayGrid(ray_side)
            light[part] = cast_shadow_rays(emitter, self.points, rows[part], self.visibility, grid).light
        return light

    def _parts_by_side(self, emitter: Emitter, rows: Rows, side: int) -> list[tuple[int, NDArray[np.intp]]]:
        """The sides of the grids of rays, each with the indices of the rows for which it is used at first."""
        sides = first_sides(emitter, self.points.points_m[rows], side)
        return [(int(ray_side), np.flatnonzero(sides == ray_side)) for ray_side in np.unique(sides)]

    def _unshadowed_light(self, emitter: Emitter, rows: Rows, side: int) -> tuple[Floats, Mask]:
        """The unshadowed illuminance (N,) at points, and whether each value is sampled and therefore noisy (N,)."""
        points = self.points
        light = TexelField.unknown(self.layout, len(points))
        is_sampled = np.zeros(len(points), bool)
        is_bent = np.zeros(len(points), bool)
        is_bent[rows] = chunked(lambda part: _are_bent(points, rows[part]), len(rows))

        grid = self.layout.on_grid(rows, STRIDES[0])
        unshadowed_lx, is_sampled[grid] = unshadowed_light(emitter, points, grid, side)
        light.set(grid, unshadowed_lx)
        for stride in FINER_STRIDES:
            exact = grid[~is_sampled[grid]]
            is_bend = light.bends(exact, steps=2 * stride, tolerance=BEND)
            grid = self.layout.on_grid(rows, stride)
            light.state[grid[is_bent[grid]]] = UNKNOWN
            not_interpolated = light.refine(grid, stride=stride, tolerance=UNEVEN, is_relative=True, marked=is_bend)
            unshadowed_lx, is_sampled[not_interpolated] = unshadowed_light(emitter, points, not_interpolated, side)
            light.set(not_interpolated, unshadowed_lx)
        return light.values[rows], is_sampled[rows]

    def _pattern(self, *, stride: int) -> SobolPattern:
        """The pattern that stratifies the rays of neighbouring texels together, on a grid of every stride-th texel."""
        return SobolPattern(self.layout.width, stride, self.points.dither[:1])

    def _at_shadow_edge(self, clear_share: Floats, cells: Indices, rows: Rows, *, steps: int) -> Rows:
        """The points among the rows (N,) that are at the edge of a shadow.

        The emitter is visible and hidden within `steps` texels of such a point, or within its cell (P,).
        `clear_share` (P,) is the share of unobstructed rays, NaN for points without rays.
        """
        is_visible = clear_share > 0
        is_hidden = clear_share < 1
        visible_nearby = self.layout.dilated(is_visible, steps=steps)
        hidden_nearby = self.layout.dilated(is_hidden, steps=steps)

        cell_count = int(cells.max(initial=0)) + 1
        visible_in_cell = np.zeros(cell_count, bool)
        hidden_in_cell = np.zeros(cell_count, bool)
        visible_in_cell[cells[is_visible]] = True
        hidden_in_cell[cells[is_hidden]] = True
        is_mixed_cell = visible_in_cell & hidden_in_cell

        is_at_edge = (visible_nearby & hidden_nearby) | is_mixed_cell[cells]
        return rows[is_at_edge[rows]]


def _are_partly_hidden(clear_share: TexelField, rows: Rows) -> Mask:
    """Whether some rays, but not all, are blocked around the points at rows (N,) of the coarsest grid.

    `clear_share` is the share of unobstructed rays of these points.
    """
    low, high = clear_share.extremes(rows, steps=STRIDES[0])
    return np.asarray((low < 1) & (high > 0))


def _are_bent(points: Texels, rows: Rows) -> Mask:
    """Whether the normals of the points at rows (N,) differ from those of their flat faces."""
    difference = np.abs(points.normals[rows] - points.planes[rows])
    return np.asarray(difference.max(1) > BENT)
