"""Materials: matt, polished, mirror, glass; and their procedural textures."""

from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
import scipy
from annotated_types import Ge, Gt, Le, Lt
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.setting import OneOf, Positive, Share, settings

Map = NDArray[np.float32]


def reflectance(texture: "Textured") -> Map:
    """The tile as (resolution_px, resolution_px) float32 in [0.02, 0.98], row 0 at v = 0."""
    rng = np.random.default_rng([texture.seed, texture.resolution_px])
    pattern = PATTERNS[texture.pattern](texture, rng)
    low, high = np.percentile(pattern[::4, ::4] if len(pattern) > 64 else pattern, [1, 99])
    unit = (pattern - pattern.mean()) / ((high - low) / 2 if high > low else 1.0)
    return np.asarray(np.clip(texture.albedo * (1 + texture.contrast * unit), 0.02, 0.98).astype(np.float32))


def _noise(texture: "Textured", rng: np.random.Generator, *, coarse_m: float, fine_m: float, slope: float) -> Map:
    """Periodic noise of unit variance whose features are between `fine_m` and `coarse_m` wide; 0 where none fits.

    White noise shaped in the frequency domain by f^-slope: isotropic, and a tile without seams.
    """
    n = texture.resolution_px
    per_m = n / texture.tile_m
    f_u = scipy.fft.rfftfreq(n) * per_m
    # Columns above the band are zero, and the inverse transform adds them back as such.
    f_u = f_u[f_u < 0.5 / fine_m]
    spectrum = scipy.fft.rfft2(rng.standard_normal((n, n), dtype=np.float32), workers=-1)[:, : len(f_u)]
    f = np.hypot(scipy.fft.fftfreq(n)[:, None] * per_m, f_u).astype(np.float32)
    band = (f > 0.5 / coarse_m) & (f < 0.5 / fine_m)
    spectrum = spectrum * np.where(band, np.maximum(f, 1e-6) ** -slope, 0).astype(np.float32)
    noise = scipy.fft.irfft2(spectrum, s=(n, n), workers=-1)
    return np.asarray(noise / (noise.std() or 1))


def plain(texture: "Textured", rng: np.random.Generator) -> Map:
    """One tone, without any detail."""
    del rng
    return np.zeros((texture.resolution_px, texture.resolution_px), np.float32)


def terrazzo(texture: "Textured", rng: np.random.Generator) -> Map:
    """Chips of several tones and sizes with sharp edges in a ground with fine grain."""
    chips = _noise(texture, rng, coarse_m=0.06, fine_m=0.012, slope=0.5)
    small = _noise(texture, rng, coarse_m=0.015, fine_m=0.004, slope=0.5)
    grain = _noise(texture, rng, coarse_m=0.5, fine_m=0.002, slope=1.2)
    step = 0.08
    return np.asarray(0.9 * np.tanh((chips - 0.6) / step) - 0.6 * np.tanh((small - 0.8) / step) + 0.5 * grain)


def plaster(texture: "Textured", rng: np.random.Generator) -> Map:
    """A trowelled wall: soft patches with pits."""
    patches = _noise(texture, rng, coarse_m=0.8, fine_m=0.006, slope=1.1)
    pits = _noise(texture, rng, coarse_m=0.04, fine_m=0.008, slope=0.3)
    return np.asarray(patches - 0.8 * np.tanh((pits - 1.4) / 0.1))


def wood(texture: "Textured", rng: np.random.Generator) -> Map:
    """Grain that runs along u, in bent rings."""
    bend = _noise(texture, rng, coarse_m=0.6, fine_m=0.08, slope=1.5)
    fibre = _noise(texture, rng, coarse_m=0.05, fine_m=0.004, slope=0.6)
    n = texture.resolution_px
    rings = np.arange(n, dtype=np.float32)[:, None] / n * 2 * np.pi * round(texture.tile_m / 0.05)
    return np.asarray(np.sin(rings + 2.5 * bend) + 0.7 * fibre)


def poster(texture: "Textured", rng: np.random.Generator) -> Map:
    """Large flat patches with sharp borders, as on printed boards and book spines."""
    n = texture.resolution_px
    pattern = np.zeros((n, n), np.float32)
    for _ in range(160):
        row, column = rng.integers(0, n, 2)
        height, width = (rng.uniform(0.02, 0.22, 2) * n).astype(int)
        rows, columns = np.arange(row, row + height) % n, np.arange(column, column + width) % n
        pattern[np.ix_(rows, columns)] = rng.uniform(-1, 1)
    return pattern + 0.15 * _noise(texture, rng, coarse_m=0.1, fine_m=0.004, slope=0.5)


def checker(texture: "Textured", rng: np.random.Generator) -> Map:
    """Eight by eight squares: the one with corners whose place is known."""
    del rng
    square = np.arange(texture.resolution_px) * 8 // texture.resolution_px
    return np.where((square[:, None] + square[None, :]) % 2, 1.0, -1.0).astype(np.float32)


PATTERNS: dict[str, Callable[["Textured", np.random.Generator], Map]] = {
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
Eta = Annotated[float, Ge(1), Le(4)]  # 1 is an open pane, or no coat
Roughness = Annotated[float, Ge(0), Le(0.5)]


@settings(kw_only=False)
class Matt:
    """Reflects its texture's share of the light alike in all directions (Lambert).

    The texture is a square tile that repeats every `tile_m`. `albedo` is its mean, and `contrast` its spread over
    its mean: half the step from the darkest 1 % to the brightest 1 %.
    """

    pattern: Pattern
    albedo: Albedo
    contrast: Share = 0.0
    tile_m: Positive = 1.0
    resolution_px: Resolution = 1024
    seed: Seed = 0
    kind: Literal["matt"] = "matt"


@settings(kw_only=False)
class Polished:
    """A texture as in Matt under a clear coat, such as waxed stone: matt below, and a mirror that grows to grazing.

    `tint` scales what the coat mirrors; `roughness` is the RMS slope of its facets (GGX alpha), 0 for none.
    """

    pattern: Pattern
    albedo: Albedo
    contrast: Share = 0.0
    tile_m: Positive = 1.0
    resolution_px: Resolution = 1024
    seed: Seed = 0
    eta: Eta = 1.5
    tint: Share = 1.0
    roughness: Roughness = 0.0
    kind: Literal["polished"] = "polished"


@settings(kw_only=False)
class Mirror:
    """A metal that reflects the share `tint` at every angle; `roughness` as in Polished."""

    tint: Share = 0.9
    roughness: Roughness = 0.0
    kind: Literal["mirror"] = "mirror"


@settings(kw_only=False)
class Glass:
    """A thin pane: mirrors a little, lets the rest pass straight; `tint` scales what passes. It dims light, no more."""

    eta: Eta = 1.5
    tint: Share = 1.0
    kind: Literal["glass"] = "glass"


Textured = Matt | Polished
Material = Matt | Polished | Mirror | Glass


def texture_of(material: Material) -> Textured | None:
    """The material where it shows a texture, None for one without a body."""
    return material if isinstance(material, Matt | Polished) else None


def fresnel(cosine: Array, eta: float | Array) -> Array:
    """F (...) at cosines (...) of the angle to the normal, from air onto eta. Source: Born and Wolf, section 1.5."""
    c = np.clip(np.abs(cosine), 0.0, 1.0)
    inside = np.sqrt(1 - (1 - c * c) / eta**2)
    across, along = (c - eta * inside) / (c + eta * inside), (inside - eta * c) / (inside + eta * c)
    return np.asarray(0.5 * (across**2 + along**2))


def pane_reflectance(cosine: Array, eta: float | Array) -> Array:
    """Share (...) that a pane mirrors, all reflections between its two faces added: 2F / (1 + F)."""
    F = fresnel(cosine, eta)
    return 2 * F / (1 + F)


def inner_reflectance(eta: float) -> float:
    """Share of diffuse light under a coat that the coat sends back down.

    By the reciprocity of Fresnel's law: 1 - (1 - F̄) / eta², F̄ the mean of F over diffuse light from outside.
    """
    cosine = np.sqrt((np.arange(4096) + 0.5) / 4096)  # cosines of diffuse light: cos² is evenly spread
    return float(1 - (1 - fresnel(cosine, eta).mean()) / eta**2)


def under_coat(albedo: Array, eta: float) -> Array:
    """What a texture of albedo (...) reflects per light let in and out of its coat, all inner bounces added.

    Outgoing luminance = under_coat · E_in (1 - F(out)) / π, where E_in is the illuminance that enters,
    weighted by 1 - F(in). Source: the plastic of Mitsuba 3 (nonlinear), after Jakob (2010).
    """
    return np.asarray(albedo / (1 - albedo * inner_reflectance(eta)) / eta**2)
