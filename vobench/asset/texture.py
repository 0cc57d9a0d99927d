"""Procedural textures: square tiles that repeat without a seam."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
import scipy
from annotated_types import Ge, Gt, Le, Lt

from vobench.scene.material import Map
from vobench.setting import OneOf, Positive, Share, settings


def _noise(
    texture: "Procedural",
    rng: np.random.Generator,
    *,
    coarse_m: float,
    fine_m: float,
    slope: float,
) -> Map:
    """Periodic noise of unit variance with features that are `fine_m` to `coarse_m` wide; 0 if none fits.

    White noise is multiplied by f^-slope in the frequency domain, so the result is isotropic and has no seams.
    """
    n = texture.resolution_px
    px_per_m = n / texture.tile_m
    lowest = 0.5 / coarse_m  # cycles per metre
    highest = 0.5 / fine_m
    f_u = scipy.fft.rfftfreq(n) * px_per_m
    f_v = scipy.fft.fftfreq(n)[:, None] * px_per_m
    f_u = f_u[f_u < highest]  # the inverse transform pads the spectrum with zeros
    f = np.hypot(f_v, f_u).astype(np.float32)
    is_in_band = (f > lowest) & (f < highest)
    gain = np.maximum(f, 1e-6) ** -slope
    shape = np.where(is_in_band, gain, 0).astype(np.float32)

    white = rng.standard_normal((n, n), dtype=np.float32)
    spectrum = scipy.fft.rfft2(white, workers=-1)[:, : len(f_u)]
    noise = scipy.fft.irfft2(spectrum * shape, s=(n, n), workers=-1)
    deviation = noise.std() or 1
    return np.asarray(noise / deviation)


def plain(texture: "Procedural", rng: np.random.Generator) -> Map:
    """One tone, without any detail."""
    del rng
    return np.zeros((texture.resolution_px, texture.resolution_px), np.float32)


def terrazzo(texture: "Procedural", rng: np.random.Generator) -> Map:
    """Bright and dark chips with sharp edges, in a ground with fine grain."""
    chips = _noise(texture, rng, coarse_m=0.06, fine_m=0.012, slope=0.5)
    small = _noise(texture, rng, coarse_m=0.015, fine_m=0.004, slope=0.5)
    grain = _noise(texture, rng, coarse_m=0.5, fine_m=0.002, slope=1.2)
    step = 0.08
    bright_chips = 0.9 * np.tanh((chips - 0.6) / step)
    dark_chips = 0.6 * np.tanh((small - 0.8) / step)
    return np.asarray(bright_chips - dark_chips + 0.5 * grain)


def plaster(texture: "Procedural", rng: np.random.Generator) -> Map:
    """Plaster: soft patches with pits."""
    patches = _noise(texture, rng, coarse_m=0.8, fine_m=0.006, slope=1.1)
    pits = _noise(texture, rng, coarse_m=0.04, fine_m=0.008, slope=0.3)
    step = 0.1
    depth = np.tanh((pits - 1.4) / step)
    return np.asarray(patches - 0.8 * depth)


def wood(texture: "Procedural", rng: np.random.Generator) -> Map:
    """Wood grain along u, with bent growth rings."""
    bend = _noise(texture, rng, coarse_m=0.6, fine_m=0.08, slope=1.5)
    fibre = _noise(texture, rng, coarse_m=0.05, fine_m=0.004, slope=0.6)
    n = texture.resolution_px
    ring_m = 0.05
    count = round(texture.tile_m / ring_m)
    share = np.arange(n, dtype=np.float32)[:, None] / n
    phase = share * 2 * np.pi * count
    rings = np.sin(phase + 2.5 * bend)
    return np.asarray(rings + 0.7 * fibre)


def poster(texture: "Procedural", rng: np.random.Generator) -> Map:
    """Large flat patches with sharp borders, as on printed boards and book spines."""
    n = texture.resolution_px
    pattern = np.zeros((n, n), np.float32)
    patches = 160
    for _ in range(patches):
        row, column = rng.integers(0, n, 2)
        height, width = (rng.uniform(0.02, 0.22, 2) * n).astype(int)
        rows = np.arange(row, row + height) % n
        columns = np.arange(column, column + width) % n
        pattern[np.ix_(rows, columns)] = rng.uniform(-1, 1)
    grain = _noise(texture, rng, coarse_m=0.1, fine_m=0.004, slope=0.5)
    return pattern + 0.15 * grain


def checker(texture: "Procedural", rng: np.random.Generator) -> Map:
    """Eight by eight squares, whose corners are at known positions."""
    del rng
    n = texture.resolution_px
    square = np.arange(n) * 8 // n
    is_bright = (square[:, None] + square[None, :]) % 2
    return np.where(is_bright, 1.0, -1.0).astype(np.float32)


PATTERNS: dict[str, Callable[["Procedural", np.random.Generator], Map]] = {
    "plain": plain,
    "terrazzo": terrazzo,
    "plaster": plaster,
    "wood": wood,
    "poster": poster,
    "checker": checker,
}


Pattern = Annotated[str, OneOf("pattern", PATTERNS)]
Albedo = Annotated[float, Gt(0), Lt(1)]
Resolution = Annotated[int, Ge(8), Le(8192)]
Seed = Annotated[int, Ge(0)]
MOST_SAMPLED_PX = 64  # the percentiles of larger tiles are computed from every fourth row and column


@settings(kw_only=False)
class Procedural:
    """A square tile that repeats every `tile_m`.

    `albedo` is its mean reflectance. `contrast` is half the difference between its 99th and 1st percentile, relative to
    the mean.
    """

    pattern: Pattern
    albedo: Albedo
    contrast: Share = 0.0
    tile_m: Positive = 1.0
    resolution_px: Resolution = 1024
    seed: Seed = 0

    def pixels(self) -> Map:
        """Reflectance (resolution_px, resolution_px) float32 in [0.02, 0.98], row 0 at v = 0."""
        rng = np.random.default_rng([self.seed, self.resolution_px])
        pattern = PATTERNS[self.pattern](self, rng)

        sample = pattern
        if len(pattern) > MOST_SAMPLED_PX:
            sample = pattern[::4, ::4]
        darkest, brightest = np.percentile(sample, [1, 99])
        is_plain = brightest <= darkest
        spread = 1.0 if is_plain else (brightest - darkest) / 2
        deviation = (pattern - pattern.mean()) / spread
        reflectance = self.albedo * (1 + self.contrast * deviation)
        return np.asarray(np.clip(reflectance, 0.02, 0.98).astype(np.float32))
