"""Drops of water on the glass before a lens: each bends light like a small lens that is far out of focus. Pure.

The glass is parallel to the image plane, GLASS_M before the aperture. A pixel collects light through a disc of glass
that is as large as the aperture, because the lens is focused on infinity. Where the disc overlaps a drop, that part of
the light comes from where the drop bends the ray to.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.geometry.camera import Camera, pixel_grid
from vobench.geometry.se3 import Array

# Assumptions: a lens of 3 mm focal length at f/2, behind a window as that of a housing or a car.
APERTURE_M = 1.5e-3
GLASS_M = 50e-3
# The logarithm of the radius is evenly distributed. Larger drops run down the glass. Both are assumptions.
LEAST_RADIUS_M = 0.3e-3
LARGEST_RADIUS_M = 2e-3
CONTACT_RAD = np.deg2rad(40)  # of water on glass that is not quite clean; clean glass has less, a coated one more
WATER_ETA = 1.333
APERTURE_POINTS = 96
BLOCK_SHARE = 1 / 40  # the side of the blocks that drops show, in widths of the picture
TINY_M = 1e-12
STEEPEST = 3.0  # the tangent of the angle to the optical axis up to which the glass has drops


Pixels = NDArray[np.int64]  # indices of pixels, in reading order


@dataclass(frozen=True, slots=True)
class GlassDrops:
    """Drops on the glass: their middles (N, 2) in metres to the right and down of the optical axis, and radii (N,)."""

    middles_m: Array
    radii_m: Array


@dataclass(frozen=True, slots=True)
class LensDrops:
    """Where the light of P pixels comes from behind drops.

    `direct` (P,) is the share of each pixel's own light. `bent` (P, B) are the shares of the means of B square blocks
    of the picture, whose side is `block_px`. All shares of a pixel add up to 1.
    """

    direct: NDArray[np.float32]
    bent: "scipy.sparse.csr_array"
    block_px: int

    def apply(self, light: NDArray[np.float32]) -> NDArray[np.float32]:
        """The light (H, W) behind the drops, of light (H, W) without them."""
        rows = np.arange(0, light.shape[0], self.block_px)
        columns = np.arange(0, light.shape[1], self.block_px)
        block_sums = np.add.reduceat(np.add.reduceat(light, rows, axis=0, dtype=np.float64), columns, axis=1)
        heights_px = np.diff([*rows, light.shape[0]])
        widths_px = np.diff([*columns, light.shape[1]])
        means = (block_sums / np.outer(heights_px, widths_px)).astype(np.float32)
        behind = self.direct * light.ravel() + self.bent @ means.ravel()
        return np.asarray(behind.reshape(light.shape), np.float32)


def lens_drops(
    camera: Camera,
    share: float,
    rng: np.random.Generator,
) -> LensDrops:
    """Random drops that cover a share of the glass.

    Light from beyond the border of the picture is taken from the border. What the surfaces of drops reflect is
    neglected. The first drops of a larger share are those of a smaller one.
    """
    rays = camera.rays(pixel_grid(camera)).reshape(-1, 3)
    tangents = _tangents(rays)
    drops = drops_on_glass(tangents, share, rng)

    block_px = max(1, round(BLOCK_SHARE * camera.width_px))
    rows = [np.zeros(0, np.int64)]
    blocks = [np.zeros(0, np.int64)]
    for pixels, deflections in deflected(tangents, drops):
        bent = np.column_stack([tangents[pixels] + deflections, np.ones(len(pixels))])
        rows.append(pixels)
        blocks.append(_blocks(camera, _nearest_pixels(camera, bent, pixels), block_px))

    through_drops = np.concatenate(rows)
    sources = np.concatenate(blocks)
    weight = 1 / APERTURE_POINTS
    shape = (len(rays), _block_count(camera.height_px, block_px) * _block_count(camera.width_px, block_px))
    weights = np.full(len(through_drops), weight)
    entries = scipy.sparse.coo_array((weights, (through_drops, sources)), shape)
    bent_shares = scipy.sparse.csr_array(entries, dtype=np.float32)
    covered = np.bincount(through_drops, minlength=len(rays)) * weight
    return LensDrops((1 - covered).astype(np.float32), bent_shares, block_px)


def _block_count(size_px: int, block_px: int) -> int:
    """The number of blocks along a side of a picture. The last one may be smaller."""
    return -(-size_px // block_px)


def _blocks(camera: Camera, pixels: Pixels, block_px: int) -> Pixels:
    """The blocks (K,) that pixels (K,) are in."""
    rows, columns = np.divmod(pixels, camera.width_px)
    return np.asarray(rows // block_px * _block_count(camera.width_px, block_px) + columns // block_px)


def aperture_points() -> Array:
    """Points (APERTURE_POINTS, 2) that are spread evenly over the aperture, in metres; Vogel's spiral (1979)."""
    index = np.arange(APERTURE_POINTS) + 0.5
    radius_m = APERTURE_M / 2 * np.sqrt(index / APERTURE_POINTS)
    angle_rad = np.pi * (3 - np.sqrt(5)) * index
    return np.stack([radius_m * np.cos(angle_rad), radius_m * np.sin(angle_rad)], -1)


def drops_on_glass(tangents: Array, share: float, rng: np.random.Generator) -> GlassDrops:
    """Random drops on the part of the glass that pixels with directions of tangents (P, 2) look through.

    Drops may overlap. They cover 1 - exp(-n) of the glass if their areas add up to n times its area (the Boolean model,
    Matheron 1975).
    """
    margin_m = LARGEST_RADIUS_M + APERTURE_M / 2
    low_m = GLASS_M * np.nanmin(tangents, axis=0) - margin_m
    high_m = GLASS_M * np.nanmax(tangents, axis=0) + margin_m
    wanted_m2 = -np.log1p(-share) * float(np.prod(high_m - low_m))
    middles_m = []
    radii_m = []
    area_m2 = 0.0
    while area_m2 < wanted_m2:
        middles_m.append(rng.uniform(low_m, high_m))
        radius_m = LEAST_RADIUS_M * (LARGEST_RADIUS_M / LEAST_RADIUS_M) ** rng.uniform()
        radii_m.append(radius_m)
        area_m2 += np.pi * radius_m**2
    return GlassDrops(np.array(middles_m).reshape(-1, 2), np.array(radii_m))


def deflected(tangents: Array, drops: GlassDrops) -> Iterator[tuple[Pixels, Array]]:
    """For each drop, the pixels (K,) of rays that pass it, and the changes (K, 2) of their tangents.

    `tangents` (P, 2) are those of the pixels. A pixel has APERTURE_POINTS rays, so it occurs up to that many times. The
    last drop lies on top of the others.
    """
    offsets_m = aperture_points()
    top = np.full((len(tangents), APERTURE_POINTS), -1, np.int32)  # the drop on top, for each ray
    reached = []
    for index, (middle_m, radius_m) in enumerate(zip(drops.middles_m, drops.radii_m, strict=True)):
        reach_m = radius_m + APERTURE_M / 2
        near = np.flatnonzero((np.abs(GLASS_M * tangents - middle_m) < reach_m).all(1))
        reached.append(near)
        distances_m = np.linalg.norm(_from_middle_m(tangents[near], offsets_m, middle_m), axis=-1)
        top[near] = np.where(distances_m < radius_m, index, top[near])

    for index, near in enumerate(reached):
        nth, point = np.nonzero(top[near] == index)
        pixels = near[nth]
        from_middle_m = GLASS_M * tangents[pixels] + offsets_m[point] - drops.middles_m[index]
        distances_m = np.linalg.norm(from_middle_m, axis=1)
        bend_rad = bending_rad(distances_m / drops.radii_m[index])
        towards_middle = -from_middle_m / np.maximum(distances_m, TINY_M)[:, None]
        yield pixels, np.tan(bend_rad)[:, None] * towards_middle


def _from_middle_m(tangents: Array, offsets_m: Array, middle_m: Array) -> Array:
    """Where rays (K, A, 2) of pixels with tangents (K, 2) pass the glass, from the middle (2,) of a drop."""
    return np.asarray(GLASS_M * tangents[:, None] + offsets_m - middle_m)


def bending_rad(distance: Array) -> Array:
    """The angle (N,) by which a drop bends light towards its middle, at distances (N,) from it in radii of the drop.

    A drop is a spherical cap that meets the glass at the contact angle. By Snell's law, for light along its axis.
    """
    sine = np.sin(CONTACT_RAD) * distance  # of the slope of the surface
    return np.asarray(np.arcsin(WATER_ETA * sine) - np.arcsin(sine))


def _tangents(rays: Array) -> Array:
    """The tangents (P, 2) of the angles of rays (P, 3) to the right and down; NaN for rays that miss the glass."""
    is_forward = rays[:, 2] > 0
    depth = np.where(is_forward, rays[:, 2], np.nan)
    tangents = rays[:, :2] / depth[:, None]
    misses = ~(np.abs(tangents) <= STEEPEST).all(1)
    tangents[misses] = np.nan
    return np.asarray(tangents)


def _nearest_pixels(camera: Camera, directions: Array, instead: Pixels) -> Pixels:
    """The pixels (K,) that directions (K, 3) are nearest to, or those `instead` for directions that no pixel has."""
    size_px = np.array([camera.width_px, camera.height_px])
    uv_px = camera.project(directions)
    is_projected = np.isfinite(uv_px).all(1)
    inside_px = np.clip(np.nan_to_num(uv_px), 0, size_px - 1)
    columns, rows = np.rint(inside_px).astype(np.int64).T
    return np.where(is_projected, rows * camera.width_px + columns, instead)
