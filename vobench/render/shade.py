"""Direct light that movers take from what stands still."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vobench.render.direct import Rays, cell_spot, footprint, in_front
from vobench.render.geometry import Ball, Floats, RayCaster, ball
from vobench.render.lightmap import Layout, Patch
from vobench.render.sight import Sight
from vobench.render.source import SkyPane, Source
from vobench.render.texels import Texels, in_chunks
from vobench.scene.surface import Surface

BLOCK = 4  # samples along a side
SCOUTS, RAYS = Rays(2), Rays(3, spread=True)  # per point, source and picture
SKY_REACH = 10  # radii beyond which a mover hides less than a hundredth of an open sky
CHUNK = 1 << 12
SPREAD = 1.5  # samples, from every other one
MARGIN = 6  # samples around a shadow that its smoothing reaches


@dataclass(frozen=True, slots=True)
class Blocks:
    """Points in groups of neighbours: `of` (P,) names each point's group, `balls` (B,) enclose them."""

    of: NDArray[np.int64]
    balls: Ball


def blocks(points: Texels, where: Layout) -> Blocks:
    """Squares of BLOCK x BLOCK samples of one surface."""
    row, column = points.index // where.width // BLOCK, points.index % where.width // BLOCK
    key = (points.surface.astype(np.int64) * (where.height // BLOCK + 1) + row) * (where.width // BLOCK + 1) + column
    _, of, count = np.unique(key, return_inverse=True, return_counts=True)
    centre = np.stack([np.bincount(of, axis) for axis in points.points_m.T], -1) / count[:, None]
    radius = np.zeros(len(count))
    np.maximum.at(radius, of, np.linalg.norm(points.points_m - centre[of], axis=1))
    return Blocks(of, Ball(centre, radius))


def may_shade(mover: Ball, source: Ball, points: Ball) -> NDArray[np.bool_]:
    """Whether a way from within each of `points` (N,) to within the source's ball can pass the mover's."""
    if np.isinf(source.radius_m):
        distance = np.linalg.norm(mover.centre_m - points.centre_m, axis=-1)
        return np.asarray(distance <= SKY_REACH * mover.radius_m + points.radius_m)
    to_mover, to_source = mover.centre_m - points.centre_m, source.centre_m - points.centre_m
    far_mover, far_source = (np.linalg.norm(way, axis=-1) for way in (to_mover, to_source))
    cosine = np.einsum("ij,ij->i", to_mover, to_source) / np.maximum(far_mover * far_source, 1e-9)
    angles = (
        np.arcsin(np.clip((one.radius_m + points.radius_m) / np.maximum(far, 1e-9), 0, 1))
        for one, far in ((mover, far_mover), (source, far_source))
    )
    reach = far_source + source.radius_m + mover.radius_m + points.radius_m
    inside = far_mover <= mover.radius_m + points.radius_m
    passes: NDArray[np.bool_] = inside | ((np.arccos(np.clip(cosine, -1, 1)) <= sum(angles)) & (far_mover <= reach))
    return passes


@dataclass(frozen=True, slots=True)
class Shaded:
    """Points (N,) of a stage and the illuminance (N,) that movers take from them."""

    some: NDArray[np.int64]
    lost: Floats


@dataclass(frozen=True, slots=True)
class Shade:
    """What stands still, ready to be shaded."""

    points: Texels
    where: Layout
    blocks: Blocks
    sight: Sight

    def by(self, movers: Sequence[Sequence[Surface]], source: Source, least_lx: Floats) -> Shaded:
        """Light of a source that movers, each a list of surfaces, keep from the points.

        least_lx (P,): blocks of points that lose less than this are left alone.
        """
        reach = source.ball()
        near = np.zeros(len(self.blocks.balls.radius_m), bool)
        for mover in movers:
            near |= may_shade(ball(mover), reach, self.blocks.balls)
        some = np.flatnonzero(near[self.blocks.of])
        some = some[in_front(reach, self.points.take(some))]
        surfaces = [surface for mover in movers for surface in mover]
        caster = RayCaster(surfaces, range(len(surfaces)))
        scouts = some[self._every_other(some)] if isinstance(source, SkyPane) else some
        found = scouts[self._lost(scouts, source, caster, SCOUTS) > least_lx[scouts]]
        # Scouts miss the rims of half shadows, but not whole blocks.
        near = np.isin(self.blocks.of[some], self.blocks.of[found])
        return self._shaded(some[near], source, caster)

    def _shaded(self, some: NDArray[np.int64], source: Source, caster: RayCaster) -> Shaded:
        if not isinstance(source, SkyPane):
            return Shaded(some, self._lost(some, source, caster, RAYS))
        few = some[self._every_other(some)]
        return Shaded(some, self._filled(some, few, self._lost(few, source, caster, RAYS)))

    def _every_other(self, some: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Every other row and column."""
        row, column = np.divmod(self.points.index[some], self.where.width)
        even: NDArray[np.bool_] = (row % 2 == 0) & (column % 2 == 0)
        return even

    def _filled(self, some: NDArray[np.int64], few: NDArray[np.int64], lost: Floats) -> Floats:
        """The loss of few points, smoothed as the sky's own light is, at all of some."""
        weighted = np.zeros((2, self.where.height, self.where.width), np.float32)
        weighted.reshape(2, -1)[:, self.points.index[few]] = lost, np.ones_like(lost)
        place, surface = self.points.index[some], self.points.surface[some]
        for index in np.unique(surface):
            window = _around(place[surface == index], self.where, self.where.patches[index])
            for layer in weighted:
                layer[window] = ndimage.gaussian_filter(layer[window], SPREAD, mode="nearest")
        light, weight = weighted.reshape(2, -1)[:, place]
        filled: Floats = light / np.maximum(weight, 1e-6)
        return filled

    def _lost(self, some: NDArray[np.int64], source: Source, caster: RayCaster, rays: Rays) -> Floats:
        parts = in_chunks(
            lambda part: self._lost_of(self.points.take(some[part]), source, caster, rays), len(some), chunk=CHUNK
        )
        return np.concatenate([*parts, np.zeros(0, np.float32)])

    def _lost_of(self, points: Texels, source: Source, caster: RayCaster, rays: Rays) -> Floats:
        total, towards = np.zeros(len(points), np.float32), source.towards(points)
        for cell in range(rays.side**2):
            way, strength = towards(*cell_spot(points, cell, rays.side))
            cosine = points.cosine(way)
            light = strength * cosine
            faced = np.flatnonzero(light > 0)
            start = points.points_m[faced] + (footprint(points, faced, cell) if rays.spread else 0)
            end = points.points_m[faced] + way[faced]
            hidden = np.flatnonzero(caster.occluded(start, end))
            faced, start = faced[hidden], start[hidden]
            ahead = end[hidden] - start
            share = source.passing(self.sight, start, ahead)
            total[faced] += light[faced] * share * points.take(faced).entering(cosine[faced])
        return total / rays.side**2


def _around(place: NDArray[np.int64], where: Layout, patch: Patch) -> tuple[slice, slice]:
    """The part of a patch, with a margin, that flat places lie in."""
    row, column = np.divmod(place, where.width)
    return (
        slice(max(int(row.min()) - MARGIN, patch.row), min(int(row.max()) + MARGIN, patch.row + patch.rows)),
        slice(
            max(int(column.min()) - MARGIN, patch.column), min(int(column.max()) + MARGIN, patch.column + patch.columns)
        ),
    )
