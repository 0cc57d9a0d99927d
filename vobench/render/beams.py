"""Which surfaces matter where: a picture in tiles, each a narrow cone of rays, and tests that hold for all of one.

Most of a picture shows the inside of some large surface. A test that can only err towards "not sure"
finds those tiles, so that rays are cast where edges are, and only there.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.render.geometry import Floats, Indices, Mask

Scalar = TypeVar("Scalar", bound=np.generic)

TILE_PX = 16
MARGIN = 2e-6  # on sines and cosines, for float32
EDGE_ON_M = 1e-6


@dataclass(frozen=True, slots=True)
class Tiles:
    """A camera's pixels (H, W, 2), their unit rays (H, W, 3), and for each tile the cone around its pixels' rays.

    axis (V, U, 3) unit; sine (V, U) of the angle to the farthest ray, infinite where a pixel has none.
    """

    uv_px: Array
    rays: Array
    axis: Floats
    sine: Floats


@lru_cache(maxsize=4)
def tiles(camera: Camera) -> Tiles:
    """The tiles of a camera; kept, as cameras are few and pictures many."""
    uv_px = camera.pixel_grid()
    rays = camera.rays(uv_px)
    sums = _over_tiles(np.add, rays)
    with np.errstate(invalid="ignore"):
        axis = sums / np.linalg.norm(sums, axis=-1, keepdims=True)
        cosine = _over_tiles(np.minimum, (rays * spread(axis, rays.shape)).sum(-1))
    # Beyond some 60° bounds are of no use; NaN compares false.
    sine = np.where(cosine > 0.5, np.sqrt(np.clip(1 - cosine**2, 0, 1)) + MARGIN, np.inf)
    return Tiles(uv_px, rays, np.nan_to_num(axis).astype(np.float32), sine.astype(np.float32))


def spread(values: NDArray[Scalar], shape: tuple[int, ...]) -> NDArray[Scalar]:
    """Values of tiles (V, U, ...) at each of their pixels, for a picture of some shape (H, W, ...)."""
    return values.repeat(TILE_PX, 0)[: shape[0]].repeat(TILE_PX, 1)[:, : shape[1]]


def balls(planes: Array, axis: Floats, sine: Floats) -> tuple[Array, Array]:
    """Centres (T, 3) and radii (T,) of balls around what cones cut out of planes, as in `stand.Snapshot`.

    NaN or infinite where a cone does not end on its plane.
    """
    half_sine = np.minimum(sine, 1).astype(float)
    half_cosine = np.sqrt(1 - half_sine**2)
    along = np.einsum("tc,tc->t", planes, axis)
    across = np.sqrt(np.maximum((planes**2).sum(1) - along**2, 0)) * half_sine
    with np.errstate(divide="ignore", invalid="ignore"):
        middle_m, nearest_m = 1 / along, 1 / (along * half_cosine + across)
        farthest_m = np.where(along * half_cosine > across, 1 / (along * half_cosine - across), np.inf)
        aside = np.maximum(farthest_m - middle_m, middle_m - nearest_m)
        return axis * middle_m[:, None], (aside + middle_m * np.sqrt(2 - 2 * half_cosine)) * (1 + MARGIN)


def _over_tiles(reduce: np.ufunc, values: Array) -> Array:
    """A reduction over the pixels of each tile: (H, W, ...) to (V, U, ...)."""
    height, width = values.shape[:2]
    by_row = reduce.reduceat(values, np.arange(0, height, TILE_PX), axis=0)
    return np.asarray(reduce.reduceat(by_row, np.arange(0, width, TILE_PX), axis=1))


class Outlook:
    """Rectangles as one point sees them: corners (S, 4, 3) relative to it, `counts` (S,) says which count."""

    def __init__(self, corners_m: Array, counts: Mask) -> None:
        normal = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 3] - corners_m[:, 0])
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        away_m = np.einsum("sc,sc->s", normal, corners_m[:, 0])
        # A rectangle seen edge-on hides nothing.
        self._which = np.flatnonzero(counts & (np.abs(away_m) > EDGE_ON_M))
        corner, normal, away_m = corners_m[self._which], normal[self._which], away_m[self._which]
        edges = np.cross(corner, np.roll(corner, -1, axis=1))
        inward = np.sign(np.einsum("sec,sc->se", edges, corner.mean(1)))[..., None]
        length = np.linalg.norm(edges, axis=-1, keepdims=True)
        # Where the point lies in line with an edge the normal is 0: neither inside nor outside.
        self._edges = (inward * edges / np.where(length > 0, length, 1.0)).astype(np.float32)
        self._normal = (np.where(away_m < 0, -1, 1)[:, None] * normal).astype(np.float32)
        self._away_m = np.abs(away_m).astype(np.float32)

    def fills(self, axis: Floats, sine: Floats) -> Indices:
        """The surface that is all there is to see in cones (T, 3), (T,), -1 where that is not sure."""
        inside = self._inside(axis)
        nearest_m, farthest_m = self._range_m(axis, sine)
        covering = np.where((inside > sine[:, None]), farthest_m, np.inf)
        if not len(self._which):
            return np.full(len(axis), -1, np.int32)
        best = covering.argmin(1)
        limit_m = np.take_along_axis(covering, best[:, None], 1)
        rival = (inside >= -sine[:, None]) & (nearest_m < limit_m)
        np.put_along_axis(rival, best[:, None], values=False, axis=1)
        sure = np.isfinite(limit_m[:, 0]) & ~rival.any(1)
        return np.where(sure, self._which[best], -1).astype(np.int32)

    def shading(self, centers_m: Array, radii_m: Array, own: Indices) -> tuple[Mask, Mask]:
        """Balls (T, 3), (T,) of points of surfaces `own` (T,) that are surely in plain sight, and surely all hidden."""
        reach_m = np.linalg.norm(centers_m, axis=-1)
        outside = reach_m > 2 * radii_m
        reach_m, centers_m = np.where(outside, reach_m, 1), np.where(outside[:, None], centers_m, 1)
        axis = (centers_m / reach_m[:, None]).astype(np.float32)
        sine = (np.where(outside, radii_m / reach_m, 1) + MARGIN).astype(np.float32)
        inside, (nearest_m, farthest_m) = self._inside(axis), self._range_m(axis, sine)
        others = self._which != own[:, None]
        before = others & (inside >= -sine[:, None]) & (nearest_m < (reach_m + radii_m)[:, None])
        across = others & (inside > sine[:, None]) & (farthest_m < (reach_m - radii_m)[:, None])
        return np.asarray(outside & ~before.any(1)), np.asarray(outside & across.any(1))

    def touches(self, axis: Floats, sine: Floats) -> Mask:
        """Whether anything may be in cones (T, 3), (T,)."""
        return np.asarray(~(self._inside(axis) < -sine[:, None]).all(1))

    def _inside(self, axis: Floats) -> Floats:
        """The least sine (T, S) of the angle between axes and the planes through the point and an edge."""
        first, second, third, fourth = (np.einsum("tc,sc->ts", axis, self._edges[:, edge]) for edge in range(4))
        least: Floats = np.minimum(np.minimum(first, second), np.minimum(third, fourth))
        return least

    def _range_m(self, axis: Floats, sine: Floats) -> tuple[Floats, Floats]:
        """How near and how far (T, S) the surfaces' planes may be along rays of cones."""
        half_sine = np.minimum(sine, 1)[:, None]
        half_cosine = np.sqrt(1 - half_sine**2)
        cosine = np.clip(np.einsum("tc,sc->ts", axis, self._normal), -1, 1)
        along, across = cosine * half_cosine, np.sqrt(1 - cosine**2) * half_sine
        # Within the cone's half angle of the normal, the normal itself is among the rays.
        most = np.where(cosine >= half_cosine, 1, along + across) + np.float32(MARGIN)
        least = along - across - np.float32(MARGIN)
        with np.errstate(divide="ignore", invalid="ignore"):
            nearest = np.where(most > 0, self._away_m / most, np.inf)
            farthest = np.where(least > 0, self._away_m / least, np.inf)
        return nearest, farthest
