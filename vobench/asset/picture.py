"""Pictures in colour: woods, stones, cloths and printed matter, from palettes, with detail down to a millimetre."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, wraps
from inspect import signature
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFilter, ImageFont

from vobench.asset.wall import Hole
from vobench.geometry.se3 import Array
from vobench.scene.material import Map, Picture, Texture

Rng = np.random.Generator
Bytes = NDArray[np.uint8]
Draw = ImageDraw.ImageDraw
Box = tuple[float, float, float, float]

# From dark to light.
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
# Noise from octaves (lowest and highest frequency per tile, slope, amount); pits (frequencies, threshold, depth).
GROUNDS: dict[str, tuple[tuple[Box, ...], Box]] = {
    "plaster": (((1, 8, 1.0, 0.07), (8, 80, 0.7, 0.06), (80, 480, 0.1, 0.11)), (20, 90, 3.1, -0.25)),
    "concrete": (((1, 10, 1.1, 0.17), (10, 90, 0.8, 0.1), (90, 500, 0.2, 0.09)), (30, 160, 2.5, -0.5)),
    "carpet": (((1, 6, 1.0, 0.04), (100, 500, 0.0, 0.22)), (60, 300, 2.2, 0.45)),
    "kraft": (((1, 20, 1.0, 0.06), (60, 500, 0.2, 0.06)), (80, 300, 2.8, -0.25)),
    "cork": (((2, 30, 0.6, 0.07), (30, 200, 0.1, 0.2)), (20, 90, 1.8, -0.3)),
    "leaf": (((1, 20, 1.0, 0.08), (20, 120, 0.4, 0.05)), (30, 90, 2.6, 0.2)),
    "clay": (((1, 20, 1.0, 0.15), (20, 250, 0.4, 0.08)), (20, 90, 2.4, 0.2)),
}
STONES = ("#d9d3c7", "#b9b1a4", "#6e6a66", "#45474a", "#9a7a62", "#7d8a84")
CEMENT = "#aaa49a"
MORTAR = "#b9b2a6"
BRASS = (122, 104, 70)
SPINE_PX_PER_M = 1300.0
# What things are printed, woven and painted in.
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
class Unpainted:
    """A texture whose pixels are painted where they are first asked for."""

    pixels: Callable[[], NDArray[Any]]
    tile_m: float


def painted(paint: Callable[..., Picture]) -> Callable[..., Texture]:
    """What paints pictures that cover `tile_m`, 1 without, made one for each of its arguments, and late.

    Most that a scene is built for, such as ways through it, looks at none.
    """
    form = signature(paint)

    @cache
    def texture(*args: Any, **kwargs: Any) -> Texture:
        (said := form.bind(*args, **kwargs)).apply_defaults()
        return Unpainted(cache(lambda: paint(*args, **kwargs).values), said.arguments.get("tile_m", 1.0))

    return wraps(paint)(texture)


def rgb(colour: str) -> tuple[int, int, int]:
    """The three bytes of #rrggbb."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def _ramp(values: ArrayLike, tones: str) -> Bytes:
    """Colours (..., 3) of values from 0, the first tone, to 1, the last."""
    stops = np.array([rgb(tone) for tone in TONES[tones]])
    at = np.linspace(0, 1, 256)
    table = np.stack([np.interp(at, np.linspace(0, 1, len(stops)), stops[:, k]) for k in range(3)], axis=-1)
    return np.asarray((table + 0.5).astype(np.uint8)[(np.clip(values, 0, 1) * 255).astype(np.uint8)])


def _scaled(picture: ArrayLike | Image.Image, factor: ArrayLike) -> Bytes:
    return np.asarray(np.clip(np.asarray(picture) * np.asarray(factor, np.float32), 0, 255).astype(np.uint8))


def noise(rng: Rng, px: int, low: float, high: float, *, slope: float = 1.0, stretch: float = 1.0) -> Map:
    """Periodic noise (px, px) of unit variance between two frequencies per tile, `stretch` times as long along u.

    Above 1024 pixels it repeats within the tile where its lowest frequency allows that.
    """
    repeats = max(1, min(px // 1024, int(low) // 16))
    n = px // repeats
    low = low / repeats
    high = high / repeats
    f = np.hypot(scipy.fft.rfftfreq(n) * n * stretch, scipy.fft.fftfreq(n)[:, None] * n).astype(np.float32)
    shape = np.where((f >= low) & (f <= high), np.maximum(f, 1) ** -slope, 0).astype(np.float32)
    values = scipy.fft.irfft2(scipy.fft.rfft2(rng.standard_normal((n, n), dtype=np.float32)) * shape, s=(n, n))
    return np.tile(values / (values.std() or 1), (repeats, repeats)).astype(np.float32)


def _polygons(image: Image.Image, shapes: Array, tones: NDArray[np.int64], *, is_open: bool = False) -> Map:
    """The image with polygons (N, K, 2) in pixels that run on across its borders, drawn in order, as an array."""
    draw = ImageDraw.Draw(image)
    px = image.width
    low = shapes.min(axis=1)
    high = shapes.max(axis=1)
    for corners, near, far, tone in zip(shapes, low, high, tones.tolist(), strict=True):
        for dx in (0, *([px] if near[0] < 0 else []), *([-px] if far[0] > px else [])):
            for dy in (0, *([px] if near[1] < 0 else []), *([-px] if far[1] > px else [])):
                place = (corners + np.array([dx, dy])).ravel().tolist()
                (draw.line if is_open else draw.polygon)(place, fill=tone)
    return np.asarray(image, np.float32)


def _scratches(rng: Rng, px: int, count: int) -> Map:
    """Thin bent lines (px, px) in [0, 1]."""
    start = rng.uniform(0, px, (count, 1, 2))
    way = rng.normal(0, 0.03 * px, (count, 1, 2))
    bend = rng.normal(0, 0.004 * px, (count, 1, 2))
    lines = np.concatenate([start, start + way / 2 + bend, start + way], axis=1)
    return _polygons(Image.new("L", (px, px)), lines, rng.integers(30, 255, count), is_open=True) / np.float32(255)


def _cells(px: int, cuts: Array) -> tuple[NDArray[np.int64], Map]:
    """The cell (px, px) and its distance in pixels to the next joint, in rows cut at `cuts` (rows, K) of a row."""
    rows, count = cuts.shape
    x = np.arange(px)
    row = x * rows // px
    high = px / rows
    place = np.stack([np.searchsorted(np.sort(c * px), x) % count for c in cuts]) + np.arange(rows)[:, None] * count
    apart = np.abs((x - cuts[..., None] * px + px / 2) % px - px / 2).min(axis=1)
    return place[row], np.minimum(apart[row], np.minimum(x % high, high - x % high)[:, None]).astype(np.float32)


@painted
def boards(
    tones: str, seed: int = 0, px: int = 1024, tile_m: float = 1.2, *, rows: int = 8, joint_m: float = 0
) -> Picture:
    """Planks along u: rings cut lengthwise, pores, fibres, each plank in a tone of its own, and scratches."""
    rng = np.random.default_rng(seed)
    cuts = 2 if joint_m else 1
    variety = 0.08 if joint_m else 0.05
    cell, apart = _cells(px, rng.uniform(0, 1, (rows, cuts)))
    planks = rows * cuts
    v = ((np.arange(px) / px * rows) % 1)[:, None] * tile_m / rows
    heart = rng.uniform(-0.05, 0.15, planks)
    depth = rng.uniform(0.01, 0.07, planks)
    phase = rng.uniform(0, 7, planks)
    wave = np.sin(2 * np.pi * np.arange(px) / px + phase[cell]) * 0.02
    bend = noise(rng, px, 1, 12, slope=1.6, stretch=3) * 0.004
    radius = np.hypot(v - heart[cell] + bend, depth[cell] + wave)
    late = ((radius / rng.uniform(0.005, 0.009, planks)[cell] % 1) ** 3).astype(np.float32)
    fibre = noise(rng, px, 30, 500, slope=0.4, stretch=30)
    pores = noise(rng, px, 60, 500, slope=0.0, stretch=12) > 1.9
    tone = 0.62 - 0.3 * late + 0.09 * fibre - 0.22 * pores + rng.normal(0, variety, planks)[cell]
    wear = 1 + 0.03 * noise(rng, px, 1, 20) + 0.12 * _scratches(rng, px, px // 4)
    hue = 1 + rng.normal(0, 0.15 * variety, (planks, 3)).astype(np.float32)
    joint = np.minimum(0.3 + 0.7 * apart / (joint_m / tile_m * px), 1) if joint_m else np.float32(1)
    return Picture(_scaled(_ramp(tone, tones), hue[cell] * (wear * joint)[..., None]), tile_m)


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
    """Bricks, slabs or tiles in courses, each shifted by `bond` of a length against the one before."""
    rng = np.random.default_rng(seed)
    variety = 0.14 if columns > 3 else 0.05
    cell, apart = _cells(px, (np.arange(columns) + bond * (np.arange(rows) % 2)[:, None] + 1e-3) / columns)
    rough = noise(rng, px, 4, 60, slope=0.6) * 0.6 + noise(rng, px, 60, 400, slope=0.2)
    pits = noise(rng, px, 40, 200, slope=0.2) > 2.3
    tone = 0.5 + rng.normal(0, variety, rows * columns)[cell] + variety * 0.5 * rough - 0.2 * pits
    is_joint = (apart + 0.6 * rough < 0.006 / tile_m * px)[..., None]
    light = 1 + 0.3 * variety * noise(rng, px, 1, 8) - 0.1 * np.exp(-apart / 3) + 0.04 * rough
    return Picture(_scaled(np.where(is_joint, rgb(MORTAR), _ramp(tone, tones)), light[..., None]), tile_m)


@painted
def ground(kind: str, seed: int = 0, px: int = 1024, tile_m: float = 2.0) -> Picture:
    """An even surface of GROUNDS: blotches, grain, pits and scratches."""
    rng = np.random.default_rng(seed)
    octaves, (low, high, threshold, depth) = GROUNDS[kind]
    tone = 0.6 + sum(amount * noise(rng, px, a, b, slope=slope) for a, b, slope, amount in octaves)
    tone = tone + depth * np.clip((noise(rng, px, low, high, slope=0.3) - threshold) / 0.3, 0, 1)
    return Picture(_ramp(tone - 0.2 * _scratches(rng, px, px // 20), kind), tile_m)


@painted
def fabric(seed: int = 0, px: int = 512, tile_m: float = 0.4) -> Picture:
    """A plain weave of threads in slightly different greys, to be coloured by its material."""
    rng = np.random.default_rng(seed)
    thread = np.arange(px) // 4
    bulge = np.abs(np.sin(np.arange(px) * np.pi / 4 + 0.4))
    warp, weft = (0.5 + 0.14 * rng.standard_normal(px // 4)[thread] + 0.3 * bulge for _ in range(2))
    is_over = (thread[:, None] + thread) % 2 == 0
    tone = np.where(is_over, warp * (0.7 + 0.3 * bulge[:, None]), weft[:, None] * (0.7 + 0.3 * bulge))
    tone = tone + 0.06 * noise(rng, px, 1, 12) + 0.1 * noise(rng, px, 40, 250, slope=0.0)
    return Picture(_ramp(tone, "cloth"), tile_m)


@painted
def terrazzo(seed: int = 0, px: int = 2048, tile_m: float = 1.6) -> Picture:
    """Broken stones of all sizes ground flush with their cement, between strips of brass, with stains and scratches."""
    rng = np.random.default_rng(seed)
    count = round(11700 * tile_m**2)
    radius = np.sort(0.0016 * rng.uniform(0, 1, count) ** -0.55)[::-1].clip(max=0.014) / tile_m * px
    angle = np.sort(rng.uniform(0, 2 * np.pi, (count, 6)), axis=1)
    shapes = np.stack([np.cos(angle), np.sin(angle)], -1) * radius[:, None, None] + rng.uniform(0, px, (count, 1, 2))
    chips = _polygons(Image.new("L", (px, px)), shapes, rng.integers(1, 6 * len(STONES) + 1, count)).astype(np.uint8)
    tones = np.array([rgb(CEMENT), *(rgb(stone) for stone in STONES for _ in range(6))])
    table = (tones * rng.uniform(0.86, 1.12, (len(tones), 1))).clip(0, 255).astype(np.uint8)
    grain = 0.045 * noise(rng, px, 20, 1500, slope=0.6) + 0.02 * noise(rng, px, 3, 12)
    grain -= 0.1 * _scratches(rng, px, px // 6)
    picture = _scaled(table[chips], (1 + grain)[..., None])
    strip = slice(round(0.004 / tile_m * px))
    picture[strip] = BRASS
    picture[:, strip] = BRASS
    return Picture(picture, tile_m)


# Printed matter: a picture fills [0, 1]², to be cut into cells.
def _canvas(width: int, height: int, colour: str) -> tuple[Image.Image, Draw]:
    image = Image.new("RGB", (width, height), colour)
    return image, ImageDraw.Draw(image)


@cache
def _font(size: int) -> Any:
    return ImageFont.load_default(size)


def _text(draw: Draw, place: tuple[float, float], text: str, size: float, colour: str, *, anchor: str = "lt") -> None:
    draw.text(place, text, font=_font(max(6, round(size))), fill=colour, anchor=anchor)


def _words(rng: Rng, count: int) -> str:
    return " ".join(rng.choice(WORDS.split(), count))


def _on(colour: str) -> str:
    """The ink that can be read on a colour."""
    return PAPER if sum(rgb(colour)) < 380 else INK


def some(rng: Rng, *colours: str) -> str:
    """One of some colours."""
    return str(rng.choice(colours))


def _chart(draw: Draw, rng: Rng, box: Box) -> None:
    """Axes with bars or curves."""
    x0, y0, x1, y1 = box
    draw.line([x0, y0, x0, y1, x1, y1], fill="#777777")
    xs = np.linspace(x0, x1, int(rng.integers(8, 16)))[1:-1]
    half = 0.3 * (xs[1] - xs[0])
    has_bars = rng.random() < 0.4
    for _ in range(1 if has_bars else 3):
        ys = y1 - (y1 - y0) * np.clip(0.5 + np.cumsum(rng.normal(0, 0.16, len(xs))), 0.06, 0.96)
        ink = some(rng, *INKS)
        for x, y in zip(xs, ys, strict=True):
            draw.rectangle([x - half, y, x + half, y1] if has_bars else [x - 2, y - 2, x + 2, y + 2], fill=ink)
        if not has_bars:
            draw.line(np.stack([xs, ys], axis=1).ravel().tolist(), fill=ink, width=2)


def _column(draw: Draw, rng: Rng, box: Box, size: float) -> None:
    """Paragraphs of text, with a chart now and then, that fill a box."""
    x0, y, x1, y1 = box
    while y < y1 - size:
        if rng.random() < 0.07 and y1 - y > 12 * size:
            _chart(draw, rng, (x0 + size, y + size, x1, y + 9 * size))
            y += 10.5 * size
        is_last = rng.random() < 0.14
        length = (x1 - x0) / (0.52 * size) * (rng.uniform(0.2, 0.8) if is_last else 1)
        _text(draw, (x0, y), _words(rng, 16)[: int(length)], size, "#3a3d42")
        y += (2.4 if is_last else 1.35) * size


@painted
def pages(seed: int = 0) -> Picture:
    """Six sheets of A4 (480 × 680 px each), in three columns and two rows, with titles, text and charts."""
    rng = np.random.default_rng(seed)
    image, draw = _canvas(1440, 1360, PAPER)
    for x, y in ((x, y) for y in (0, 680) for x in (0, 480, 960)):
        band = some(rng, PAPER, PAPER, *INKS)
        split = rng.choice([220, 440])
        draw.rectangle([x, y, x + 479, y + 679], fill=some(rng, "#f4f2ec", PAPER, "#ebe8df"))
        draw.rectangle([x, y, x + 479, y + 90], fill=band)
        _text(draw, (x + 24, y + 36), _words(rng, 3).title(), 29, _on(band))
        for x0 in range(24, 456, split):
            _column(draw, rng, (x + x0, y + 112, x + x0 + split - 20, y + 650), 10)
    return Picture(np.asarray(image))


@dataclass(frozen=True, slots=True, eq=False)
class Spines:
    """A picture of books' spines, each with its cell, thickness and height in metres; the lowest row is paper."""

    picture: Picture
    cells: tuple[Hole, ...]
    sizes_m: tuple[tuple[float, float], ...]


@cache
def spines(seed: int = 0, count: int = 52) -> Spines:
    """Books of several publishers, volumes of series among them, and ring binders."""
    rng = np.random.default_rng(seed)
    high = round(0.325 * SPINE_PX_PER_M)
    drawn: list[Image.Image] = []
    while len(drawn) < count:
        drawn += _binders(rng) if rng.random() < 0.14 else _series(rng)
    ends = np.cumsum([0, *(spine.height for spine in drawn)])
    image = Image.new("RGB", (int(ends[-1]), high), PAPER)
    for x, spine in zip(ends.tolist(), drawn, strict=False):
        image.paste(spine.transpose(Image.Transpose.ROTATE_270), (x, 0))
    worn = 1 + 0.05 * noise(rng, 1024, 20, 500, slope=0.5)
    pixels = _scaled(image, np.tile(worn, (1, image.width // 1024 + 1))[:high, : image.width, None])
    u = (ends / image.width).tolist()
    cells = tuple((u[k], u[k + 1], 0.0, spine.width / high) for k, spine in enumerate(drawn))
    return Spines(Picture(pixels), cells, tuple((s.height / SPINE_PX_PER_M, s.width / SPINE_PX_PER_M) for s in drawn))


def _binders(rng: Rng) -> list[Image.Image]:
    """Ring binders of one owner, lying on their side as books are."""
    colour = some(rng, NAVY, INK, BRICK, "#8a8d8f")
    owner = _words(rng, 1).upper()
    result = []
    w = round(0.07 * SPINE_PX_PER_M)
    h = round(0.318 * SPINE_PX_PER_M)
    for volume in range(int(rng.integers(2, 5))):
        image, draw = _canvas(h, w, colour)
        draw.rectangle([0.12 * h, 0.14 * w, 0.55 * h, 0.86 * w], fill=PAPER)
        _text(draw, (0.15 * h, 0.5 * w), f"{owner} {2019 + volume}", 0.34 * w, INK, anchor="lm")
        draw.ellipse([0.79 * h, 0.28 * w, 0.79 * h + 0.44 * w, 0.72 * w], fill="#0c0d0e", outline="#b9bcbe", width=5)
        result.append(image)
    return result


def _series(rng: Rng) -> list[Image.Image]:
    """A book, or the volumes of one, each lying on its side: as wide as the book is high."""
    volumes = int(rng.choice([1, 1, 1, 1, 2, 5]))
    w = round(rng.uniform(0.012, 0.042) * SPINE_PX_PER_M)
    h = round(float(rng.choice([0.178, 0.2, 0.216, 0.235, 0.24, 0.28])) * SPINE_PX_PER_M)
    colour = some(rng, *INKS, INK, PAPER, "#e2d9c6", "#4a5a4d")
    accent = some(rng, *INKS, PAPER)
    title = _words(rng, int(rng.integers(2, 5))).title()
    author = _words(rng, 1).upper()
    block = rng.uniform(-0.6, 0.6)
    image, draw = _canvas(h, w, colour)
    for start, length in ((0.13, max(block, 0)), *((band, 0.012) for band in rng.choice([0.05, 0.09, 0.84], 2))):
        draw.rectangle([start * h, 0, (start + length) * h, w], fill=accent)
    on_title = _on(accent if block > 0 else colour)
    _text(draw, (0.15 * h, 0.5 * w), title, min(0.6 * w, 0.075 * h, 1.25 * h / len(title)), on_title, anchor="lm")
    result = [image.copy() for _ in range(volumes)]
    for k, spine in enumerate(result):
        last = author if volumes == 1 else str(k + 1)
        size = min(0.45 * w, 0.06 * h)
        _text(ImageDraw.Draw(spine), (0.97 * h, 0.5 * w), last, size, _on(colour), anchor="rm")
    return result


@painted
def screen(seed: int = 0) -> Picture:
    """A display (1280 × 720) with files, an editor, a chart, a log and a bar of icons."""
    rng = np.random.default_rng(seed)
    back, bar = ("#1f252b", "#12161a") if rng.random() < 0.7 else ("#f2f1ec", "#d9dcdc")
    ink = _on(back)
    (image, draw) = _canvas(1280, 720, back)
    for box, fill in (((0, 0, 1280, 26), bar), ((0, 26, 190, 690), bar), ((0, 690, 1280, 720), "#34556b")):
        draw.rectangle(box, fill=fill)
    for y0, y1 in ((60, 360), (380, 670)):
        draw.rectangle([800, y0, 1250, y1], fill=bar, outline="#59636a")
    for k in range(38):
        _text(draw, (14 + 14 * (k % 3), 40 + 17 * k), _words(rng, 2)[:18], 13, "#8d979d")
        x = 240.0 + 26 * abs((3 * k) % 8 - 4) * (k % 5 > 0)
        for word in _words(rng, int(rng.integers(1, 7))).split():
            _text(draw, (x, 36 + 17 * k), word, 13, some(rng, ink, ink, TEAL, OCHRE, SKY, SAGE))
            x += 8.5 * len(word)
    for k in range(16):
        _text(draw, (812, 392 + 17 * k), _words(rng, 6)[:50], 12, "#8fae92")
        draw.rectangle([20 + 40 * k, 696, 42 + 40 * k, 714], fill=INKS[k % 8])
    _chart(draw, rng, (830, 90, 1230, 330))
    return Picture(np.asarray(image))


@painted
def poster(style: str, seed: int = 0, width: int = 700, height: int = 1000) -> Picture:
    """A print in one of POSTERS' styles."""
    rng = np.random.default_rng(seed)
    image, draw = _canvas(width, height, PAPER)
    POSTERS[style](draw, rng, width, height)
    paint = 1 + 0.03 * noise(rng, 1024, 10, 500, slope=0.5, stretch=2)[:height, :width]
    return Picture(_scaled(image, paint[..., None]))


def _hills(draw: Draw, rng: Rng, w: int, h: int) -> None:
    """Ridges in the haze below a sun."""
    for k, tone in enumerate(np.linspace(rgb(SKY), rgb(PAPER), 40).astype(int).tolist()):
        draw.rectangle([0, k * h / 40, w, h], fill=tuple(tone))
    draw.ellipse([0.62 * w, 0.12 * h, 0.62 * w + 0.16 * h, 0.28 * h], fill=OCHRE)
    x = np.linspace(0, w, 160)
    for k, tone in enumerate(np.linspace(rgb(SAND), rgb(NAVY), 8).astype(int).tolist()):
        walk = np.cumsum(rng.normal(0, 1, 160)) - np.linspace(0, 1, 160) * rng.normal(0, 6)
        ridge = h * (0.3 + 0.08 * k + 0.012 * walk + 0.0009 * k * rng.normal(0, 1, 160))
        draw.polygon([(0, h), *zip(x, ridge, strict=True), (w, h)], fill=tuple(tone))


def _circles(draw: Draw, rng: Rng, w: int, h: int) -> None:
    """Quarters and halves of circles in squares."""
    side = w // 5
    for x, y in ((x, y) for y in range(0, h, side) for x in range(0, w, side)):
        back, front, dot = (some(rng, *INKS[:6], PAPER) for _ in range(3))
        quarter = int(rng.integers(4))
        half = rng.random() < 0.4
        draw.rectangle([x, y, x + side, y + side], fill=back)
        left, up = (x, y) if half else (x - side * (quarter in (0, 3)), y - side * (quarter in (0, 1)))
        across = side if half else 2 * side
        draw.pieslice([left, up, left + across, up + across], 90 * quarter, 90 * quarter + 90 + 90 * half, fill=front)
        draw.ellipse([x + 0.38 * side, y + 0.38 * side, x + 0.62 * side, y + 0.62 * side], fill=dot)


def _talk(draw: Draw, rng: Rng, w: int, h: int) -> None:
    """A title over three columns of text and charts."""
    draw.rectangle([0, 0, w, 0.12 * h], fill=some(rng, NAVY, TEAL, PLUM))
    _text(draw, (0.04 * w, 0.03 * h), _words(rng, 4).title(), 0.04 * h, PAPER)
    _text(draw, (0.04 * w, 0.08 * h), _words(rng, 6).title(), 0.02 * h, SAND)
    for k in range(3):
        x0 = w * (0.04 + 0.32 * k)
        x1 = w * (0.32 + 0.32 * k)
        y = h * (0.2 + 0.3 * (k % 2))
        draw.rectangle([x0, 0.15 * h, x1, 0.18 * h], fill=some(rng, *INKS))
        _column(draw, rng, (x0, 0.2 * h, x1, 0.96 * h), 0.011 * h)
        draw.rectangle([x0, y, x1, y + 0.2 * h], fill=PAPER)
        _chart(draw, rng, (x0, y, x1, y + 0.18 * h))


POSTERS: dict[str, Callable[[Draw, Rng, int, int], None]] = {"hills": _hills, "circles": _circles, "talk": _talk}


@painted
def whiteboard(seed: int = 0) -> Picture:
    """A board (1440 × 900) with diagrams in four inks, and what is left of wiped ones."""
    rng = np.random.default_rng(seed)
    image, draw = _canvas(1440, 900, "#e9e9e5")
    for k in range(24):
        x, y = rng.uniform(40, [1100, 760])
        ink = some(rng, NAVY, BRICK, "#2f6b4a", INK) if k >= 8 else "#dcdcda"
        draw.rounded_rectangle([x, y, x + 200, y + 74], 12, outline=ink, width=4)
        draw.line([x + 200, y + 37, x + 290, y + rng.uniform(-40, 120)], fill=ink, width=4)
        _text(draw, (x + 14, y + 20), _words(rng, int(rng.integers(1, 3))), rng.uniform(24, 36), ink)
        if k % 6 == 5:
            _chart(draw, rng, (x, y + 90, x + 240, y + 220))
    wiped = 1 - 0.015 * noise(rng, 1440, 2, 60, stretch=2)[:900]
    return Picture(_scaled(image.filter(ImageFilter.GaussianBlur(0.8)), wiped[..., None]))


@painted
def carton(seed: int = 0, tile_m: float = 0.5) -> Picture:
    """Brown board (768 × 768 px) with tape, a label with bars and text, and printed marks."""
    rng = np.random.default_rng(seed)
    image = Image.fromarray(ground("kraft", 0, 768).pixels())
    draw = ImageDraw.Draw(image)
    x = rng.uniform(300, 480)
    y = rng.choice([150, 440])
    for box, fill in (
        ((0, 352, 768, 416), "#c4a882"),
        ((0, 383, 768, 385), "#7d5d3c"),
        ((x, y, x + 230, y + 150), PAPER),
    ):
        draw.rectangle(box, fill=fill)
    for bar in np.cumsum(rng.integers(3, 8, 34)):
        draw.rectangle([x + 12 + bar, y + 84, x + 12 + bar + rng.integers(1, 4), y + 136], fill=INK)
    for k in range(3):
        _text(draw, (x + 12, y + 10 + 22 * k), _words(rng, 3).title(), 19 - 2 * k, INK)
        up = 110 + 60 * k
        draw.line([up, 640, up, 580, up - 16, 600, up, 580, up + 16, 600], fill="#5b3f26", width=5)
    _text(draw, (90, 480), _words(rng, 1).upper(), 54, "#5b3f26")
    return Picture(np.asarray(image), tile_m)


@painted
def sign(text: str, colour: str = PAPER) -> Picture:
    """A plate (480 × 240) with a word in a border."""
    image, draw = _canvas(480, 240, colour)
    draw.rectangle([8, 8, 471, 231], outline=_on(colour), width=5)
    _text(draw, (240, 120), text, 90, _on(colour), anchor="mm")
    return Picture(np.asarray(image))
