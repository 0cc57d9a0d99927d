"""Procedural colour textures: wood, stone, cloth and printed matter, with detail down to a millimetre.

A tile is the part of a plane that a texture covers before it repeats. Frequencies are in cycles per tile.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache, wraps
from inspect import signature
from itertools import product
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFilter, ImageFont

from vobench.asset.kept_pixels import KEPT
from vobench.asset.wall import Hole
from vobench.geometry.se3 import Array
from vobench.scene.material import Map, Picture, Texture

Rng = np.random.Generator
Bytes = NDArray[np.uint8]
Draw = ImageDraw.ImageDraw
Box = tuple[float, float, float, float]  # left, top, right and bottom in pixels

# The colours of each palette, from dark to light.
TONES = {
    "oak": ("#6b4a2c", "#a87d50", "#c9a271", "#dcbd8f"),
    "walnut": ("#33231a", "#573c29", "#77543a", "#8f6b4d"),
    "beech": ("#9b7449", "#c39a69", "#d9b585", "#e6cba2"),
    "plaster": ("#b4aea3", "#d3cec4", "#e2ded6", "#efece6"),
    "concrete": ("#6f6d69", "#8e8b86", "#a19e98", "#b7b4ad"),
    "brick": ("#5b3226", "#8a4b38", "#a35d45", "#b9795c"),
    "paving": ("#6c6a66", "#8b8780", "#a09b91", "#b5aea2"),
    "tile": ("#b9b7b1", "#d6d5d0", "#e2e1dd", "#ecebe8"),
    "cloth": ("#8f8f8f", "#b8b8b8", "#d2d2d2", "#ebebeb"),
    "carpet": ("#2f3a42", "#44525b", "#5b6a72", "#7d898d"),
    "kraft": ("#7c5a38", "#a67d52", "#b98f62", "#c9a376"),
    "cork": ("#5f4226", "#9a7145", "#b58a5a", "#cba777"),
    "leaf": ("#1d3018", "#33522a", "#4b7038", "#7a9a58"),
    "clay": ("#6d3d2a", "#99593f", "#b06c4f", "#c58a6b"),
}


@dataclass(frozen=True, slots=True)
class Octave:
    """A band of noise.

    `low` is the lowest frequency in cycles per tile.
    `high` is the highest frequency in cycles per tile.
    `slope` is the exponent of the spectrum, which is f^-slope.
    `amount` is the standard deviation of the tone, for which 1 is the whole palette.
    """

    low: float
    high: float
    slope: float
    amount: float


@dataclass(frozen=True, slots=True)
class Pits:
    """Spots where a band of noise exceeds a threshold.

    `low` is the lowest frequency of the noise in cycles per tile.
    `high` is the highest frequency of the noise in cycles per tile.
    `threshold` is the threshold, in standard deviations of the noise.
    `depth` is the change of the tone in a spot. It is negative if spots are darker.
    """

    low: float
    high: float
    threshold: float
    depth: float


@dataclass(frozen=True, slots=True)
class Ground:
    """A uniform surface.

    `octaves` are bands of noise, which are added.
    `pits` are spots of another tone.
    """

    octaves: tuple[Octave, ...]
    pits: Pits


GROUNDS: dict[str, Ground] = {
    "plaster": Ground(
        (Octave(1, 8, 1.0, 0.07), Octave(8, 80, 0.7, 0.06), Octave(80, 480, 0.1, 0.11)),
        Pits(20, 90, 3.1, -0.25),
    ),
    "concrete": Ground(
        (Octave(1, 10, 1.1, 0.17), Octave(10, 90, 0.8, 0.1), Octave(90, 500, 0.2, 0.09)),
        Pits(30, 160, 2.5, -0.5),
    ),
    "carpet": Ground(
        (Octave(1, 6, 1.0, 0.04), Octave(100, 500, 0.0, 0.22)),
        Pits(60, 300, 2.2, 0.45),
    ),
    "kraft": Ground(
        (Octave(1, 20, 1.0, 0.06), Octave(60, 500, 0.2, 0.06)),
        Pits(80, 300, 2.8, -0.25),
    ),
    "cork": Ground(
        (Octave(2, 30, 0.6, 0.07), Octave(30, 200, 0.1, 0.2)),
        Pits(20, 90, 1.8, -0.3),
    ),
    "leaf": Ground(
        (Octave(1, 20, 1.0, 0.08), Octave(20, 120, 0.4, 0.05)),
        Pits(30, 90, 2.6, 0.2),
    ),
    "clay": Ground(
        (Octave(1, 20, 1.0, 0.15), Octave(20, 250, 0.4, 0.08)),
        Pits(20, 90, 2.4, 0.2),
    ),
}
STONES = ("#d9d3c7", "#b9b1a4", "#6e6a66", "#45474a", "#9a7a62", "#7d8a84")
CEMENT = "#aaa49a"
MORTAR = "#b9b2a6"
BRASS = (122, 104, 70)
# Noise is repeated within a tile only if each period has at least this size, and this many cycles of its lowest
# frequency, so that the repetition is not visible.
MIN_PERIOD_PX = 1024
MIN_PERIOD_CYCLES = 16
SPINE_PX_PER_M = 1300.0  # the resolution of the spines of books
# The colours of prints, cloths and paints.
NAVY = "#27445c"
TEAL = "#3d7a7c"
SKY = "#8fb3c7"
SAGE = "#8a9a7b"
OCHRE = "#d39a3c"
BRICK = "#b4533a"
PLUM = "#6b4353"
SAND = "#d8c3a0"
PAPER = "#f1ece0"
INK = "#262b30"
INKS = (NAVY, TEAL, SKY, SAGE, OCHRE, BRICK, PLUM, SAND)
WORDS = (
    "survey motion atlas light harbour field notes stereo theory index garden vector northern history lens river model "
    "signal practice annual report drive state method urban design order error studies depth volume energy craft map "
    "modern filter winter letters pixel control introduction systems guide image data the of and for"
)


@dataclass(frozen=True, slots=True, eq=False)
class LazyTexture:
    """A texture whose pixels are computed when they are needed.

    `pixels` computes the pixels.
    `tile_m` is the side of the tile.
    `planks` is for floors with planks along u, and empty otherwise: for each row of planks, the positions along u
    where the row is cut, as shares of the tile. They make it possible to lay the planks in another order.
    """

    pixels: Callable[[], NDArray[Any]]
    tile_m: float
    planks: tuple[tuple[float, ...], ...] = ()


def painted(paint: Callable[..., Picture]) -> Callable[..., Texture]:
    """Decorate a function that paints a picture, so that it returns a lazy texture instead.

    The picture is painted when its pixels are first needed. Many uses of a scene, such as planning a path, need none.
    Calls with equal arguments return the same texture. If the function has a parameter `tile_m`, the texture gets it.
    """
    parameters = signature(paint)

    @cache
    def texture(*args: Any, **kwargs: Any) -> Texture:
        call = parameters.bind(*args, **kwargs)
        call.apply_defaults()
        tile_m = call.arguments.get("tile_m", 1.0)
        pixels = KEPT.lazy(lambda: paint(*args, **kwargs).values)
        return LazyTexture(pixels, tile_m)

    return wraps(paint)(texture)


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, from 0 to 255, of a colour #rrggbb."""
    red = int(colour[1:3], 16)
    green = int(colour[3:5], 16)
    blue = int(colour[5:7], 16)
    return red, green, blue


def _ramp(values: ArrayLike, tones: str) -> Bytes:
    """The colours (..., 3) of values (...) in a palette: 0 is the darkest tone, and 1 is the lightest."""
    # The colours between those of the palette are interpolated in a table of 256 levels.
    colours = np.array([rgb(tone) for tone in TONES[tones]])
    stops = np.linspace(0, 1, len(colours))
    levels = np.linspace(0, 1, 256)
    channels = [np.interp(levels, stops, colours[:, channel]) for channel in range(3)]
    table = (np.stack(channels, axis=-1) + 0.5).astype(np.uint8)

    level = (np.clip(values, 0, 1) * 255).astype(np.uint8)
    return np.asarray(table[level])


def _scaled(picture: ArrayLike | Image.Image, factor: ArrayLike) -> Bytes:
    """A picture multiplied by a factor, which can be an array, as bytes."""
    scaled = np.asarray(picture) * np.asarray(factor, np.float32)
    return np.asarray(np.clip(scaled, 0, 255).astype(np.uint8))


def noise(
    rng: Rng,
    px: int,
    low: float,
    high: float,
    *,
    slope: float = 1.0,
    stretch: float = 1.0,
) -> Map:
    """Periodic noise (px, px) with unit variance in a band of frequencies.

    `low` and `high` are the lowest and the highest frequency in cycles per tile.
    `slope` is the exponent of the spectrum, which is f^-slope.
    `stretch` is the length of features along u relative to their length along v.

    Large tiles of high frequencies contain several periods of the noise, which takes less time to compute. A period has
    at least MIN_PERIOD_PX pixels and MIN_PERIOD_CYCLES cycles.
    """
    repeats_by_size = px // MIN_PERIOD_PX
    repeats_by_band = int(low) // MIN_PERIOD_CYCLES
    repeats = max(1, min(repeats_by_size, repeats_by_band))
    n = px // repeats
    low = low / repeats
    high = high / repeats

    white = rng.standard_normal((n, n), dtype=np.float32)
    spectrum = scipy.fft.rfft2(white)
    spectrum *= _band(n, low, high, slope, stretch)
    values = scipy.fft.irfft2(spectrum, s=(n, n), overwrite_x=True)
    values /= values.std() or 1
    return np.tile(values, (repeats, repeats)) if repeats > 1 else np.asarray(values)


@lru_cache(maxsize=8)  # textures of one kind have the same bands
def _band(n: int, low: float, high: float, slope: float, stretch: float) -> Map:
    """The gain (n, n // 2 + 1) at each frequency of a spectrum. It is zero outside the band."""
    f_u = (np.arange(n // 2 + 1) * stretch).astype(np.float32)
    f_v = (scipy.fft.fftfreq(n)[:, None] * n).astype(np.float32)
    f = np.hypot(f_u, f_v)
    is_in_band = (f >= low) & (f <= high)
    gain = np.zeros(f.shape, np.float32)
    gain[is_in_band] = np.maximum(f[is_in_band], 1) ** -np.float32(slope)
    return gain


def _polygons(
    image: Image.Image,
    shapes: Array,
    tones: NDArray[np.int64],
    *,
    is_open: bool = False,
) -> Map:
    """Draw polygons on an image, and return it as an array (px, px).

    `shapes` (N, K, 2) are the vertices of the polygons in pixels. Later polygons are drawn over earlier ones. A
    polygon that crosses a border continues at the opposite border.
    `tones` (N,) are the values of their pixels.
    `is_open` draws polylines instead of polygons.
    """
    draw = ImageDraw.Draw(image)
    draw_shape = draw.line if is_open else draw.polygon
    px = image.width
    lowest = shapes.min(axis=1)
    highest = shapes.max(axis=1)
    for corners, low, high, tone in zip(shapes, lowest, highest, tones.tolist(), strict=True):
        for dx in _repeats(low[0], high[0], px):
            for dy in _repeats(low[1], high[1], px):
                shifted = corners + np.array([dx, dy])
                draw_shape(shifted.ravel().tolist(), fill=tone)
    return np.asarray(image, np.float32)


def _repeats(low: float, high: float, px: int) -> list[int]:
    """The shifts by which a shape that extends from `low` to `high` has to be drawn in a periodic tile from 0 to px."""
    shifts = [0]
    if low < 0:
        shifts.append(px)
    if high > px:
        shifts.append(-px)
    return shifts


def _scratches(rng: Rng, px: int, count: int) -> Map:
    """An image (px, px) of thin, slightly bent lines, with values from 0 to 1."""
    start = rng.uniform(0, px, (count, 1, 2))
    step = rng.normal(0, 0.03 * px, (count, 1, 2))
    bend = rng.normal(0, 0.004 * px, (count, 1, 2))
    middle = start + step / 2 + bend
    end = start + step
    lines = np.concatenate([start, middle, end], axis=1)
    tones = rng.integers(30, 255, count)
    blank = Image.new("L", (px, px))
    return _polygons(blank, lines, tones, is_open=True) / np.float32(255)


def _cells(px: int, cuts: Array) -> tuple[NDArray[np.int64], Map]:
    """The cells into which joints divide rows, such as planks or bricks.

    `cuts` (rows, K) are the positions of the joints in each row, as shares of its length.
    Returns the index (px, px) of the cell of each pixel, and the distance (px, px) in pixels to the nearest joint.
    """
    rows, count = cuts.shape
    x = np.arange(px)
    row = x * rows // px
    row_px = px / rows

    columns = [np.searchsorted(np.sort(cut * px), x) % count for cut in cuts]
    cell = np.stack(columns) + np.arange(rows)[:, None] * count

    # Distances along a row are periodic, and are from -px / 2 to px / 2.
    to_cut = (x - cuts[..., None] * px + px / 2) % px - px / 2
    to_nearest_cut = np.abs(to_cut).min(axis=1)
    from_row_start = x % row_px
    to_row_border = np.minimum(from_row_start, row_px - from_row_start)
    to_joint = np.minimum(to_nearest_cut[row], to_row_border[:, None])
    return cell[row], to_joint.astype(np.float32)


@cache
def boards(
    tones: str,
    seed: int = 0,
    px: int = 1024,
    tile_m: float = 1.2,
    *,
    rows: int = 8,
    joint_m: float = 0,
) -> Texture:
    """Planks along u with growth rings, pores, fibres and scratches. Each plank has a different tone.

    `tones` is the name of a palette.
    `rows` is the number of rows of planks in the tile.
    `joint_m` is the width of the joints; with 0, the planks have no visible joints.
    """
    pixels = KEPT.lazy(lambda: _boards(tones, seed, px, tile_m, rows=rows, joint_m=joint_m))
    if not joint_m:
        return LazyTexture(pixels, tile_m)
    cuts = _plank_cuts(np.random.default_rng(seed), rows, joint_m)
    sorted_cuts = np.sort(cuts, axis=1)
    planks = tuple(tuple(row) for row in sorted_cuts.tolist())
    return LazyTexture(pixels, tile_m, planks)


def _plank_cuts(rng: Rng, rows: int, joint_m: float) -> Array:
    """The positions (rows, K) where each row of planks is cut, as shares of its length."""
    cuts_per_row = 2 if joint_m else 1
    return rng.uniform(0, 1, (rows, cuts_per_row))


def _boards(tones: str, seed: int, px: int, tile_m: float, *, rows: int, joint_m: float) -> Bytes:
    """The pixels of `boards`."""
    rng = np.random.default_rng(seed)
    variety = 0.08 if joint_m else 0.05  # the standard deviation of the tones of planks
    cuts = _plank_cuts(rng, rows, joint_m)
    planks = cuts.size
    plank_of_pixel, to_joint_px = _cells(px, cuts)

    late_wood = _late_wood(rng, plank_of_pixel, planks=planks, tile_m=tile_m, rows=rows)
    fibre = noise(rng, px, 30, 500, slope=0.4, stretch=30)
    pores = noise(rng, px, 60, 500, slope=0.0, stretch=12) > 1.9
    plank_tone = rng.normal(0, variety, planks).astype(np.float32)
    tone = 0.62 - 0.3 * late_wood + 0.09 * fibre - np.float32(0.22) * pores + plank_tone[plank_of_pixel]

    wear = _wear(rng, px)
    hue = 1 + rng.normal(0, 0.15 * variety, (planks, 3)).astype(np.float32)
    joint_shade = np.float32(1)
    if joint_m:
        joint_px = joint_m / tile_m * px
        joint_shade = np.minimum(0.3 + 0.7 * to_joint_px / joint_px, 1)
    shade = wear * joint_shade
    light = hue[plank_of_pixel] * shade[..., None]
    return _scaled(_ramp(tone, tones), light)


def _late_wood(
    rng: Rng,
    plank_of_pixel: NDArray[np.int64],
    *,
    planks: int,
    tile_m: float,
    rows: int,
) -> Map:
    """The share (px, px) of late wood, which is the dark part of a growth ring, at each pixel.

    Each plank is a cut through a trunk, at a random distance from the centre of the trunk.
    """
    px = len(plank_of_pixel)
    row_share = (np.arange(px) / px * rows) % 1
    across_plank_m = (row_share[:, None] * tile_m / rows).astype(np.float32)
    center_m = rng.uniform(-0.05, 0.15, planks).astype(np.float32)
    depth_m = rng.uniform(0.01, 0.07, planks)
    phase = rng.uniform(0, 7, planks)
    angle_u = 2 * np.pi * np.arange(px) / px
    wave_m = np.sin(angle_u + phase[:, None]) * 0.02
    depth_along_u_m = (depth_m[:, None] + wave_m).astype(np.float32)  # (planks, px)

    bend = noise(rng, px, 1, 12, slope=1.6, stretch=3)
    from_center_m = across_plank_m - center_m[plank_of_pixel] + np.float32(0.004) * bend
    depth_of_pixel_m = depth_along_u_m[plank_of_pixel, np.arange(px)]
    radius_m = np.sqrt(from_center_m * from_center_m + depth_of_pixel_m * depth_of_pixel_m)

    ring_width_m = rng.uniform(0.005, 0.009, planks)
    rings_per_m = (1 / ring_width_m).astype(np.float32)
    ring = radius_m * rings_per_m[plank_of_pixel]
    place_in_ring = ring - np.floor(ring)
    return np.asarray(place_in_ring * place_in_ring * place_in_ring)


def _wear(rng: Rng, px: int) -> Map:
    """The factor (px, px) by which stains and scratches change the luminance of wood."""
    stains = noise(rng, px, 1, 20)
    scratches = _scratches(rng, px, px // 4)
    return np.asarray(1 + np.float32(0.03) * stains + np.float32(0.12) * scratches)


@painted
def masonry(
    tones: str,
    seed: int = 0,
    px: int = 1024,
    tile_m: float = 1.8,
    *,
    rows: int = 24,
    columns: int = 8,
    bond: float = 0.5,
) -> Picture:
    """Bricks, slabs or tiles in courses.

    `tones` is the name of a palette.
    `rows` and `columns` are the numbers of courses, and of bricks in a course, in the tile.
    `bond` is the shift of every other course, as a share of the length of a brick.
    """
    rng = np.random.default_rng(seed)
    variety = 0.14 if columns > 3 else 0.05  # the standard deviation of the tones; that of large slabs is smaller
    shift = bond * (np.arange(rows) % 2)[:, None]
    offset = 1e-3  # keeps joints off the border of the tile
    cuts = (np.arange(columns) + shift + offset) / columns
    cell, to_joint_px = _cells(px, cuts)

    coarse = noise(rng, px, 4, 60, slope=0.6)
    fine = noise(rng, px, 60, 400, slope=0.2)
    roughness = coarse * 0.6 + fine
    pits = noise(rng, px, 40, 200, slope=0.2) > 2.3
    brick_tone = rng.normal(0, variety, rows * columns)
    tone = 0.5 + brick_tone[cell] + variety * 0.5 * roughness - 0.2 * pits

    joint_px = 0.006 / tile_m * px
    rough_distance_px = to_joint_px + 0.6 * roughness
    is_joint = (rough_distance_px < joint_px)[..., None]
    stains = 0.3 * variety * noise(rng, px, 1, 8)
    edge_shade = 0.1 * np.exp(-to_joint_px / 3)
    light = 1 + stains - edge_shade + 0.04 * roughness
    colours = np.where(is_joint, rgb(MORTAR), _ramp(tone, tones))
    return Picture(_scaled(colours, light[..., None]), tile_m)


@painted
def ground(kind: str, seed: int = 0, px: int = 1024, tile_m: float = 2.0) -> Picture:
    """A uniform surface with blotches, grain, pits and scratches. `kind` is one of GROUNDS."""
    rng = np.random.default_rng(seed)
    surface = GROUNDS[kind]
    bands = []
    for octave in surface.octaves:
        band = noise(rng, px, octave.low, octave.high, slope=octave.slope)
        bands.append(octave.amount * band)
    tone = 0.6 + sum(bands)

    pits = surface.pits
    pit_noise = noise(rng, px, pits.low, pits.high, slope=0.3)
    excess = (pit_noise - pits.threshold) / 0.3
    tone = tone + pits.depth * np.clip(excess, 0, 1)
    scratched = tone - 0.2 * _scratches(rng, px, px // 20)
    return Picture(_ramp(scratched, kind), tile_m)


@painted
def fabric(seed: int = 0, px: int = 512, tile_m: float = 0.4) -> Picture:
    """A plain weave of threads in slightly different greys. A material that uses it gives it a colour."""
    rng = np.random.default_rng(seed)
    thread = np.arange(px) // 4  # the index of the thread at each pixel; threads are 4 pixels wide
    bulge = np.abs(np.sin(np.arange(px) * np.pi / 4 + 0.4))  # threads are brightest near their middle
    warp_greys = 0.14 * rng.standard_normal(px // 4)
    weft_greys = 0.14 * rng.standard_normal(px // 4)
    warp = 0.5 + warp_greys[thread] + 0.3 * bulge
    weft = 0.5 + weft_greys[thread] + 0.3 * bulge

    is_warp_above = (thread[:, None] + thread) % 2 == 0
    shade = 0.7 + 0.3 * bulge
    warp_tone = warp * shade[:, None]
    weft_tone = weft[:, None] * shade
    tone = np.where(is_warp_above, warp_tone, weft_tone)
    tone = tone + 0.06 * noise(rng, px, 1, 12)
    tone = tone + 0.1 * noise(rng, px, 40, 250, slope=0.0)
    return Picture(_ramp(tone, "cloth"), tile_m)


@painted
def terrazzo(seed: int = 0, px: int = 2048, tile_m: float = 1.6) -> Picture:
    """Terrazzo: stone chips of various sizes in cement, with brass strips, stains and scratches."""
    rng = np.random.default_rng(seed)
    chips, stone_colours = _stone_chips(rng, px, tile_m)
    grain = 0.045 * noise(rng, px, 20, 1500, slope=0.6)
    grain = grain + 0.02 * noise(rng, px, 3, 12)
    grain -= 0.1 * _scratches(rng, px, px // 6)
    light = 1 + grain
    pixels = _scaled(stone_colours[chips], light[..., None])

    # The brass strips are along the first row and the first column of the tile.
    strip_px = round(0.004 / tile_m * px)
    pixels[:strip_px] = BRASS
    pixels[:, :strip_px] = BRASS
    return Picture(pixels, tile_m)


def _stone_chips(rng: Rng, px: int, tile_m: float) -> tuple[Bytes, Bytes]:
    """The index (px, px) of the colour at each pixel, where 0 is cement, and the colours (N, 3) by index."""
    count = round(11700 * tile_m**2)
    random_size_m = 0.0016 * rng.uniform(0, 1, count) ** -0.55  # a power law: many small and few large chips
    largest_first_m = np.sort(random_size_m)[::-1]
    size_m = largest_first_m.clip(max=0.014)
    radius_px = size_m / tile_m * px
    angle = np.sort(rng.uniform(0, 2 * np.pi, (count, 6)), axis=1)
    circle = np.stack([np.cos(angle), np.sin(angle)], -1)
    center_px = rng.uniform(0, px, (count, 1, 2))
    shapes = circle * radius_px[:, None, None] + center_px

    shades = 6  # the number of shades of each stone
    stones = rng.integers(1, shades * len(STONES) + 1, count)
    chips = _polygons(Image.new("L", (px, px)), shapes, stones)
    tones = [rgb(stone) for stone in STONES for _ in range(shades)]
    colours = np.array([rgb(CEMENT), *tones])
    shaded = colours * rng.uniform(0.86, 1.12, (len(colours), 1))
    return chips.astype(np.uint8), shaded.clip(0, 255).astype(np.uint8)


# Printed matter: a picture fills the texture coordinates from 0 to 1. A mesh can show a rectangular part of it.
def _canvas(width: int, height: int, colour: str) -> tuple[Image.Image, Draw]:
    """An image that is filled with a colour, and an object that draws on it."""
    image = Image.new("RGB", (width, height), colour)
    return image, ImageDraw.Draw(image)


@cache
def _font(size: int) -> Any:
    """Pillow's built-in font of a size in pixels."""
    return ImageFont.load_default(size)


def _text(
    draw: Draw,
    place: tuple[float, float],
    text: str,
    size: float,
    colour: str,
    *,
    anchor: str = "lt",
) -> None:
    """Draw a line of text with its anchor at a place. It is at least 6 pixels high, so that it is legible."""
    font = _font(max(6, round(size)))
    draw.text(place, text, font=font, fill=colour, anchor=anchor)


def _words(rng: Rng, count: int) -> str:
    """A number of random words."""
    return " ".join(rng.choice(WORDS.split(), count))


def _text_colour_on(colour: str) -> str:
    """The colour of text on a background: light on a dark background, and dark on a light one."""
    is_dark = sum(rgb(colour)) < 380
    return PAPER if is_dark else INK


def one_of(rng: Rng, *colours: str) -> str:
    """A random one of the colours."""
    return str(rng.choice(colours))


def _chart(draw: Draw, rng: Rng, box: Box) -> None:
    """Draw a chart into a box: axes with bars, or with three curves."""
    x0, y0, x1, y1 = box
    draw.line([x0, y0, x0, y1, x1, y1], fill="#777777")
    xs = np.linspace(x0, x1, int(rng.integers(8, 16)))[1:-1]
    has_bars = rng.random() < 0.4
    for _ in range(1 if has_bars else 3):
        walk = np.cumsum(rng.normal(0, 0.16, len(xs)))
        shares = np.clip(0.5 + walk, 0.06, 0.96)
        ys = y1 - (y1 - y0) * shares
        ink = one_of(rng, *INKS)
        if has_bars:
            _bars(draw, xs, ys, y1, ink)
        else:
            _curve(draw, xs, ys, ink)


def _bars(
    draw: Draw,
    xs: Array,
    ys: Array,
    bottom: float,
    ink: str,
) -> None:
    """Draw a bar from the bottom of a chart to each of the points (xs, ys)."""
    half_width = 0.3 * (xs[1] - xs[0])
    for x, y in zip(xs, ys, strict=True):
        draw.rectangle([x - half_width, y, x + half_width, bottom], fill=ink)


def _curve(
    draw: Draw,
    xs: Array,
    ys: Array,
    ink: str,
) -> None:
    """Draw a line through the points (xs, ys), with a square at each point."""
    for x, y in zip(xs, ys, strict=True):
        draw.rectangle([x - 2, y - 2, x + 2, y + 2], fill=ink)
    points = np.stack([xs, ys], axis=1)
    draw.line(points.ravel().tolist(), fill=ink, width=2)


def _column(draw: Draw, rng: Rng, box: Box, size: float) -> None:
    """Fill a box with paragraphs of text and occasional charts. `size` is the size of the font in pixels."""
    x0, y, x1, y1 = box
    character_width = 0.52 * size
    characters = (x1 - x0) / character_width
    while y < y1 - size:
        has_chart = rng.random() < 0.07
        if has_chart and y1 - y > 12 * size:
            _chart(draw, rng, (x0 + size, y + size, x1, y + 9 * size))
            y += 10.5 * size

        ends_paragraph = rng.random() < 0.14
        filled_share = rng.uniform(0.2, 0.8) if ends_paragraph else 1
        length = int(characters * filled_share)
        line = _words(rng, 16)[:length]
        _text(draw, (x0, y), line, size, "#3a3d42")
        line_spacing = 2.4 if ends_paragraph else 1.35
        y += line_spacing * size


@painted
def pages(seed: int = 0) -> Picture:
    """Six A4 pages of 480 × 680 px with titles, text and charts, in three columns and two rows."""
    rng = np.random.default_rng(seed)
    image, draw = _canvas(1440, 1360, PAPER)
    for y, x in product((0, 680), (0, 480, 960)):
        _page(draw, rng, x, y)
    return Picture(np.asarray(image))


def _page(draw: Draw, rng: Rng, x: float, y: float) -> None:
    """Draw a page with its upper left corner at (x, y): a title above one or two columns."""
    band = one_of(rng, PAPER, PAPER, *INKS)  # paper twice: it is more frequent
    column_pitch = rng.choice([220, 440])  # from the left edge of a column to that of the next: two columns or one
    paper = one_of(rng, "#f4f2ec", PAPER, "#ebe8df")
    draw.rectangle([x, y, x + 479, y + 679], fill=paper)
    draw.rectangle([x, y, x + 479, y + 90], fill=band)
    title = _words(rng, 3).title()
    _text(draw, (x + 24, y + 36), title, 29, _text_colour_on(band))
    for left in range(24, 456, column_pitch):
        right = left + column_pitch - 20
        _column(draw, rng, (x + left, y + 112, x + right, y + 650), size=10)


@dataclass(frozen=True, slots=True, eq=False)
class Spines:
    """The spines of books, side by side in one picture.

    `picture` is the picture. Its lowest row has the colour of paper.
    `cells` are the part of the picture of each book: first u, last u, first v and last v, as shares of the picture.
    `sizes_m` are the thickness and the height of each book.
    """

    picture: Picture
    cells: tuple[Hole, ...]
    sizes_m: tuple[tuple[float, float], ...]


@lru_cache(maxsize=32)  # each takes a few MB
def spines(seed: int = 0, count: int = 52) -> Spines:
    """The spines of single books, series of books and ring binders. There are `count` or slightly more of them."""
    rng = np.random.default_rng(seed)
    drawn: list[Image.Image] = []
    while len(drawn) < count:
        has_binders = rng.random() < 0.14
        drawn += _binders(rng) if has_binders else _series(rng)

    # Each spine was drawn horizontally. In the picture, they are upright and side by side.
    ends = np.cumsum([0, *(spine.height for spine in drawn)])
    height = round(0.325 * SPINE_PX_PER_M)
    image = Image.new("RGB", (int(ends[-1]), height), PAPER)
    for x, spine in zip(ends.tolist(), drawn, strict=False):
        image.paste(spine.transpose(Image.Transpose.ROTATE_270), (x, 0))

    wear = 1 + 0.05 * noise(rng, 1024, 20, 500, slope=0.5)
    repeated_wear = np.tile(wear, (1, image.width // 1024 + 1))
    pixels = _scaled(image, repeated_wear[:height, : image.width, None])

    border_u = (ends / image.width).tolist()
    cells = []
    sizes_m = []
    for k, spine in enumerate(drawn):
        last_v = spine.width / height
        cells.append((border_u[k], border_u[k + 1], 0.0, last_v))
        thickness_m = spine.height / SPINE_PX_PER_M
        height_m = spine.width / SPINE_PX_PER_M
        sizes_m.append((thickness_m, height_m))
    return Spines(Picture(pixels), tuple(cells), tuple(sizes_m))


def _binders(rng: Rng) -> list[Image.Image]:
    """The spines of two to four ring binders of one owner, drawn horizontally."""
    colour = one_of(rng, NAVY, INK, BRICK, "#8a8d8f")
    owner = _words(rng, 1).upper()
    width = round(0.07 * SPINE_PX_PER_M)
    height = round(0.318 * SPINE_PX_PER_M)
    binders = []
    for volume in range(int(rng.integers(2, 5))):
        image, draw = _canvas(height, width, colour)
        label = [0.12 * height, 0.14 * width, 0.55 * height, 0.86 * width]
        hole_x = 0.79 * height
        hole = [hole_x, 0.28 * width, hole_x + 0.44 * width, 0.72 * width]
        draw.rectangle(label, fill=PAPER)
        text = f"{owner} {2019 + volume}"
        _text(draw, (0.15 * height, 0.5 * width), text, 0.34 * width, INK, anchor="lm")
        draw.ellipse(hole, fill="#0c0d0e", outline="#b9bcbe", width=5)
        binders.append(image)
    return binders


def _series(rng: Rng) -> list[Image.Image]:
    """The spines of the volumes of a series, or of a single book, drawn horizontally."""
    volumes = int(rng.choice([1, 1, 1, 1, 2, 5]))  # most are single books
    width = round(rng.uniform(0.012, 0.042) * SPINE_PX_PER_M)
    height_m = float(rng.choice([0.178, 0.2, 0.216, 0.235, 0.24, 0.28]))
    height = round(height_m * SPINE_PX_PER_M)
    colour = one_of(rng, *INKS, INK, PAPER, "#e2d9c6", "#4a5a4d")
    accent = one_of(rng, *INKS, PAPER)
    title = _words(rng, int(rng.integers(2, 5))).title()
    author = _words(rng, 1).upper()

    image, draw = _canvas(height, width, colour)
    title_band = rng.uniform(-0.6, 0.6)  # the length of the band behind the title; negative for no band
    thin_bands = [(start, 0.012) for start in rng.choice([0.05, 0.09, 0.84], 2)]
    bands = [(0.13, max(title_band, 0)), *thin_bands]  # start and length, as shares of the height of the book
    for start, length in bands:
        end = start + length
        draw.rectangle([start * height, 0, end * height, width], fill=accent)
    title_ink = _text_colour_on(accent if title_band > 0 else colour)
    title_size = min(0.6 * width, 0.075 * height, 1.25 * height / len(title))
    _text(draw, (0.15 * height, 0.5 * width), title, title_size, title_ink, anchor="lm")

    spines_of_series = []
    size = min(0.45 * width, 0.06 * height)
    for volume in range(1, volumes + 1):
        spine = image.copy()
        foot = author if volumes == 1 else str(volume)
        _text(ImageDraw.Draw(spine), (0.97 * height, 0.5 * width), foot, size, _text_colour_on(colour), anchor="rm")
        spines_of_series.append(spine)
    return spines_of_series


@painted
def screen(seed: int = 0) -> Picture:
    """The picture on a monitor (1280 × 720 px): a list of files, an editor, a chart, a log and a bar of icons."""
    rng = np.random.default_rng(seed)
    is_dark = rng.random() < 0.7
    background = "#1f252b" if is_dark else "#f2f1ec"
    panel = "#12161a" if is_dark else "#d9dcdc"
    ink = _text_colour_on(background)

    image, draw = _canvas(1280, 720, background)
    draw.rectangle([0, 0, 1280, 26], fill=panel)
    draw.rectangle([0, 26, 190, 690], fill=panel)
    draw.rectangle([0, 690, 1280, 720], fill="#34556b")
    draw.rectangle([800, 60, 1250, 360], fill=panel, outline="#59636a")
    draw.rectangle([800, 380, 1250, 670], fill=panel, outline="#59636a")

    for row in range(38):
        file_name = _words(rng, 2)[:18]
        file_x = 14 + 14 * (row % 3)
        _text(draw, (file_x, 40 + 17 * row), file_name, 13, "#8d979d")

        starts_block = row % 5 == 0
        indent = 0 if starts_block else 26 * abs((3 * row) % 8 - 4)
        x = 240.0 + indent
        for word in _words(rng, int(rng.integers(1, 7))).split():
            colour = one_of(rng, ink, ink, TEAL, OCHRE, SKY, SAGE)
            _text(draw, (x, 36 + 17 * row), word, 13, colour)
            x += 8.5 * len(word)

    for row in range(16):
        message = _words(rng, 6)[:50]
        _text(draw, (812, 392 + 17 * row), message, 12, "#8fae92")
        icon_x = 20 + 40 * row
        draw.rectangle([icon_x, 696, icon_x + 22, 714], fill=INKS[row % 8])
    _chart(draw, rng, (830, 90, 1230, 330))
    return Picture(np.asarray(image))


@painted
def poster(style: str, seed: int = 0, width: int = 700, height: int = 1000) -> Picture:
    """A poster. `style` is one of POSTERS, and the size is in pixels."""
    rng = np.random.default_rng(seed)
    image, draw = _canvas(width, height, PAPER)
    POSTERS[style](draw, rng, width, height)
    grain = noise(rng, 1024, 10, 500, slope=0.5, stretch=2)
    light = 1 + 0.03 * grain[:height, :width]
    return Picture(_scaled(image, light[..., None]))


def _hills(draw: Draw, rng: Rng, w: int, h: int) -> None:
    """Draw ridges of hazy hills below a sun."""
    sky_tones = np.linspace(rgb(SKY), rgb(PAPER), 40).astype(int)
    for k, tone in enumerate(sky_tones.tolist()):
        draw.rectangle([0, k * h / 40, w, h], fill=tuple(tone))

    sun_x = 0.62 * w
    sun = [sun_x, 0.12 * h, sun_x + 0.16 * h, 0.28 * h]
    draw.ellipse(sun, fill=OCHRE)

    x = np.linspace(0, w, 160)
    ridge_tones = np.linspace(rgb(SAND), rgb(NAVY), 8).astype(int)
    for k, tone in enumerate(ridge_tones.tolist()):
        steps = rng.normal(0, 1, 160)
        slope = np.linspace(0, 1, 160) * rng.normal(0, 6)
        walk = np.cumsum(steps) - slope
        trees = rng.normal(0, 1, 160)
        share = 0.3 + 0.08 * k + 0.012 * walk + 0.0009 * k * trees
        ridge = zip(x, h * share, strict=True)
        draw.polygon([(0, h), *ridge, (w, h)], fill=tuple(tone))


def _circles(draw: Draw, rng: Rng, w: int, h: int) -> None:
    """Draw a grid of squares, each with a quarter or a half of a circle."""
    side = w // 5
    for y, x in product(range(0, h, side), range(0, w, side)):
        background = one_of(rng, *INKS[:6], PAPER)
        foreground = one_of(rng, *INKS[:6], PAPER)
        dot_colour = one_of(rng, *INKS[:6], PAPER)
        quarter = int(rng.integers(4))
        is_half = rng.random() < 0.4
        draw.rectangle([x, y, x + side, y + side], fill=background)

        if is_half:
            left = x
            top = y
            diameter = side
            sector_deg = 180
        else:
            # The circle is twice as wide as the square, and its centre is at a corner of the square.
            centre_x = x if quarter in (0, 3) else x + side
            centre_y = y if quarter in (0, 1) else y + side
            left = centre_x - side
            top = centre_y - side
            diameter = 2 * side
            sector_deg = 90
        box = [left, top, left + diameter, top + diameter]
        start_deg = 90 * quarter
        draw.pieslice(box, start_deg, start_deg + sector_deg, fill=foreground)

        near = 0.38 * side
        far = 0.62 * side
        draw.ellipse([x + near, y + near, x + far, y + far], fill=dot_colour)


def _talk(draw: Draw, rng: Rng, w: int, h: int) -> None:
    """Draw the poster of a talk: a title above three columns of text and charts."""
    banner = one_of(rng, NAVY, TEAL, PLUM)
    draw.rectangle([0, 0, w, 0.12 * h], fill=banner)
    _text(draw, (0.04 * w, 0.03 * h), _words(rng, 4).title(), 0.04 * h, PAPER)
    _text(draw, (0.04 * w, 0.08 * h), _words(rng, 6).title(), 0.02 * h, SAND)
    for k in range(3):
        x0 = w * (0.04 + 0.32 * k)
        x1 = w * (0.32 + 0.32 * k)
        y = h * (0.2 + 0.3 * (k % 2))
        heading = one_of(rng, *INKS)
        draw.rectangle([x0, 0.15 * h, x1, 0.18 * h], fill=heading)
        _column(draw, rng, (x0, 0.2 * h, x1, 0.96 * h), 0.011 * h)
        draw.rectangle([x0, y, x1, y + 0.2 * h], fill=PAPER)
        _chart(draw, rng, (x0, y, x1, y + 0.18 * h))


POSTERS: dict[str, Callable[[Draw, Rng, int, int], None]] = {
    "hills": _hills,
    "circles": _circles,
    "talk": _talk,
}


@painted
def whiteboard(seed: int = 0) -> Picture:
    """A whiteboard (1440 × 900 px) with diagrams in four colours, and traces of wiped diagrams."""
    rng = np.random.default_rng(seed)
    image, draw = _canvas(1440, 900, "#e9e9e5")
    wiped_diagrams = 8
    for k in range(24):
        x, y = rng.uniform(40, [1100, 760])
        is_wiped = k < wiped_diagrams
        ink = "#dcdcda" if is_wiped else one_of(rng, NAVY, BRICK, "#2f6b4a", INK)
        arrow_end = (x + 290, y + rng.uniform(-40, 120))
        draw.rounded_rectangle([x, y, x + 200, y + 74], 12, outline=ink, width=4)
        draw.line([x + 200, y + 37, *arrow_end], fill=ink, width=4)
        label = _words(rng, int(rng.integers(1, 3)))
        _text(draw, (x + 14, y + 20), label, rng.uniform(24, 36), ink)
        if k % 6 == 5:
            _chart(draw, rng, (x, y + 90, x + 240, y + 220))

    soft = image.filter(ImageFilter.GaussianBlur(0.8))
    smears = noise(rng, 1440, 2, 60, stretch=2)[:900]
    light = 1 - 0.015 * smears
    return Picture(_scaled(soft, light[..., None]))


@painted
def carton(seed: int = 0, tile_m: float = 0.5) -> Picture:
    """Cardboard (768 × 768 px) with tape, a label with a bar code and text, and printed arrows."""
    rng = np.random.default_rng(seed)
    image = Image.fromarray(ground("kraft", 0, 768).pixels())
    draw = ImageDraw.Draw(image)
    x = rng.uniform(300, 480)
    y = rng.choice([150, 440])
    draw.rectangle([0, 352, 768, 416], fill="#c4a882")
    draw.rectangle([0, 383, 768, 385], fill="#7d5d3c")
    draw.rectangle([x, y, x + 230, y + 150], fill=PAPER)

    for bar in np.cumsum(rng.integers(3, 8, 34)):
        left = x + 12 + bar
        right = left + rng.integers(1, 4)
        draw.rectangle([left, y + 84, right, y + 136], fill=INK)
    for k in range(3):
        line = _words(rng, 3).title()
        line_y = y + 10 + 22 * k
        _text(draw, (x + 12, line_y), line, 19 - 2 * k, INK)
        arrow_x = 110 + 60 * k
        shaft = [arrow_x, 640, arrow_x, 580]
        head = [arrow_x - 16, 600, arrow_x, 580, arrow_x + 16, 600]
        draw.line([*shaft, *head], fill="#5b3f26", width=5)
    _text(draw, (90, 480), _words(rng, 1).upper(), 54, "#5b3f26")
    return Picture(np.asarray(image), tile_m)


@painted
def sign(text: str, colour: str = PAPER) -> Picture:
    """A sign (480 × 240 px) with a word inside a border."""
    ink = _text_colour_on(colour)
    image, draw = _canvas(480, 240, colour)
    draw.rectangle([8, 8, 471, 231], outline=ink, width=5)
    _text(draw, (240, 120), text, 90, ink, anchor="mm")
    return Picture(np.asarray(image))


def __getattr__(name: str) -> object:
    """A name that this module had in the previous release."""
    from vobench import retired

    return retired.lookup(__name__, name)
