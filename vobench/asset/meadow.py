"""What grows and lies on the ground of parks: grass, gravel, tufts, flowers, and conifers with their needles."""

from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture
from vobench.asset.furniture import Part, matt, put
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, cards_arrays, lathe
from vobench.scene.material import Material, Picture, Texture

NEEDLE_TINTS = ("#f4fff0", "#ffffe8", "#e6f8f4")
WHORL_M = 0.34  # between the whorls of a conifer
FLOWER_INKS = ((206, 62, 54), (226, 178, 48), (150, 84, 164), (232, 226, 214), (214, 116, 150))


@picture.painted
def lawn(seed: int = 0, px: int = 2048, tile_m: float = 3.0) -> Picture:
    """Mown grass: blades over one another, in patches of a lighter and a darker green, with clover and dry spots."""
    rng = np.random.default_rng([seed, 71])
    count = 30000
    image = Image.new("RGB", (px, px), (44, 56, 27))
    draw = ImageDraw.Draw(image)
    starts_px = rng.uniform(0, px, (count, 2))
    turns_rad = rng.uniform(0, 2 * np.pi, count)
    lengths_px = px * rng.uniform(0.006, 0.022, count)
    ends_px = starts_px + lengths_px[:, None] * np.stack([np.cos(turns_rad), np.sin(turns_rad)], axis=1)
    is_dry = rng.random(count) < (0.05, 0.16, 0.3)[seed % 3]
    tones = (0.55 + 0.5 * np.arange(count) / count) * rng.normal(1, 0.12, count)
    for index in range(count):
        base = (150, 142, 86) if is_dry[index] else (106, 126, 56)
        ink = tuple(int(np.clip(channel * tones[index], 0, 255)) for channel in base)
        draw.line([*starts_px[index].tolist(), *ends_px[index].tolist()], fill=ink, width=int(rng.integers(2, 6)))
    for x, y in rng.uniform(0, px, (160, 2)).tolist():
        _clover(draw, x, y, float(rng.uniform(0, 90)))
    patches = 1 + 0.13 * picture.noise(rng, px, 1, 10)[..., None]
    return Picture(np.clip(np.asarray(image) * patches, 0, 255).astype(np.uint8), tile_m)


def _clover(draw: ImageDraw.ImageDraw, x: float, y: float, turn_deg: float) -> None:
    """Three round leaves."""
    for angle_rad in np.deg2rad(120 * np.arange(3) + turn_deg):
        cx = x + 8 * float(np.cos(angle_rad))
        cy = y + 8 * float(np.sin(angle_rad))
        draw.ellipse([cx - 7, cy - 7, cx + 7, cy + 7], fill=(66, 104, 44))


@picture.painted
def gravel(seed: int = 0, px: int = 2048, tile_m: float = 2.6) -> Picture:
    """Pebbles of several tones in sand, with fallen leaves."""
    rng = np.random.default_rng([seed, 72])
    tone = 150 + 5 * picture.noise(rng, px, 2, 16) + 20 * picture.noise(rng, px, 90, 900, slope=0.1)
    sand = np.clip(tone[..., None] * np.array([1.0, 0.93, 0.8]), 20, 235).astype(np.uint8)
    image = Image.fromarray(sand)
    draw = ImageDraw.Draw(image)
    count = (14000, 9000, 20000)[seed % 3]
    radii_px = (1.3, 1.8, 1.0)[seed % 3] + rng.exponential(1.6, count)
    tones = rng.normal(0.95, 0.3, count)
    for (x, y), radius, factor in zip(rng.uniform(0, px, (count, 2)).tolist(), radii_px, tones, strict=True):
        ink = tuple(int(np.clip(channel * factor, 30, 230)) for channel in (158, 148, 132))
        draw.ellipse([x - radius, y - 0.8 * radius, x + radius, y + 0.8 * radius], fill=ink)
    for x, y in rng.uniform(0, px, (90, 2)).tolist():
        turn_rad = rng.uniform(0, np.pi)
        ahead = 13 * np.array([np.cos(turn_rad), np.sin(turn_rad)])
        side = 0.45 * np.array([-ahead[1], ahead[0]])
        outline = np.array([x, y]) + np.stack([ahead, side, -ahead, -side])
        ink = (int(rng.uniform(90, 150)), int(rng.uniform(66, 110)), int(rng.uniform(30, 60)))
        draw.polygon([tuple(point) for point in outline.tolist()], fill=ink)
    return Picture(np.asarray(image), tile_m)


@picture.painted
def blades(seed: int = 0, px: int = 256) -> Picture:
    """A tuft of long grass before nothing."""
    rng = np.random.default_rng([seed, 73])
    image = Image.new("RGBA", (px, px), (100, 118, 56, 0))
    draw = ImageDraw.Draw(image)
    count = 64
    for index in range(count):
        foot_px = px / 2 + float(rng.normal(0, 0.16 * px))
        lean_px = float(rng.normal(0, 0.22 * px))
        high_px = px * float(rng.uniform(0.45, 0.97))
        tone = 0.55 + 0.5 * index / count
        bend = [(foot_px + lean_px * share**2, px - high_px * share) for share in np.linspace(0, 1, 7).tolist()]
        draw.line(bend, fill=(int(122 * tone), int(138 * tone), int(62 * tone), 255), width=int(rng.integers(3, 7)))
    return Picture(np.asarray(image))


@picture.painted
def flowers(seed: int = 0, px: int = 256) -> Picture:
    """Flowers of one colour on their stalks before nothing."""
    rng = np.random.default_rng([seed, 74])
    image = Image.new("RGBA", (px, px), (80, 104, 48, 0))
    draw = ImageDraw.Draw(image)
    petals = FLOWER_INKS[seed % len(FLOWER_INKS)]
    for _ in range(26):
        foot_px = px / 2 + float(rng.normal(0, 0.2 * px))
        x = foot_px + float(rng.normal(0, 0.1 * px))
        y = px * float(rng.uniform(0.06, 0.6))
        draw.line([(foot_px, px), (x, y)], fill=(74, 102, 44, 255), width=5)
        radius_px = px * float(rng.uniform(0.035, 0.06))
        tone = float(rng.uniform(0.75, 1.1))
        ink = tuple(min(255, int(channel * tone)) for channel in petals)
        for angle_rad in np.deg2rad(72 * np.arange(5) + float(rng.uniform(0, 72))):
            cx = x + radius_px * float(np.cos(angle_rad))
            cy = y + radius_px * float(np.sin(angle_rad))
            draw.ellipse([cx - radius_px, cy - radius_px, cx + radius_px, cy + radius_px], fill=(*ink, 255))
        draw.ellipse([x - 5, y - 5, x + 5, y + 5], fill=(196, 158, 46, 255))
    return Picture(np.asarray(image))


@picture.painted
def needles(seed: int = 0, px: int = 512) -> Picture:
    """A bough of a conifer before nothing: twigs on both sides of a stem, with needles."""
    rng = np.random.default_rng([seed, 75])
    image = Image.new("RGBA", (px, px), (44, 66, 40, 0))
    draw = ImageDraw.Draw(image)
    stem = [(px / 2, px), (px / 2, 0.02 * px)]
    draw.line(stem, fill=(74, 58, 42, 255), width=7)
    for share in np.linspace(0.04, 0.97, 34).tolist():
        foot = np.array([px / 2, px * (1 - share)])
        reach_px = px * 0.47 * (1 - share) ** 0.7 * float(rng.uniform(0.8, 1.0)) + 0.02 * px
        for side in (-1, 1):
            tip = foot + reach_px * np.array([side * 0.88, -0.48])
            draw.line([tuple(foot.tolist()), tuple(tip.tolist())], fill=(66, 60, 40, 255), width=3)
            _needles(draw, rng, foot, tip, px)
    return Picture(np.asarray(image))


def _needles(draw: ImageDraw.ImageDraw, rng: Rng, foot: np.ndarray, tip: np.ndarray, px: int) -> None:
    """Needles on both sides of a twig."""
    count = max(4, int(np.linalg.norm(tip - foot) / px * 130))
    for share in np.linspace(0, 1, count):
        middle = foot + share * (tip - foot)
        for turn in (-1, 1):
            lean = np.array([turn * float(rng.uniform(0.2, 1.0)), -float(rng.uniform(0.3, 1.0))])
            end = middle + px * 0.03 * lean / np.linalg.norm(lean)
            tone = float(rng.uniform(0.6, 1.15))
            ink = (int(88 * tone), int(124 * tone), int(76 * tone), 255)
            draw.line([tuple(middle.tolist()), tuple(end.tolist())], fill=ink, width=3)


def cut_out(tint: str, texture: Texture) -> Material:
    """A material whose transparent parts are holes."""
    return replace(matt(tint, texture), cutout=0.5)


def conifer(rng: Rng, height_m: float = 8.0, spread: float = 0.24) -> list[Part]:
    """A conifer with whorls of drooping boughs; `spread` is the radius of the lowest ones relative to the height."""
    bark = matt(one_of(rng, "#8d8378", "#9a8a7a", "#7d7264"), picture.boards("walnut", 3, 512, 0.8))
    trunk = lathe(np.array([[0, -0.02], [0.014, -0.02], [0.01, 0.4], [0.004, 0.95], [0, 0.97]]) * height_m, sections=9)
    clear_m = max(2.4, 0.2 * height_m)
    sizes_m = []
    poses = []
    levels_m = np.arange(clear_m, height_m - 0.1, WHORL_M)
    for index, level_m in enumerate(levels_m.tolist()):
        share = (height_m - level_m) / (height_m - clear_m)
        length_m = spread * height_m * (0.12 + 0.88 * share) * float(rng.uniform(0.85, 1.1))
        # The boughs of a whorl rise near the top and droop below.
        pitch_deg = -12 + 34 * share
        count = 7 if share > 0.3 else 5
        first_deg = float(rng.uniform(0, 360)) + 30 * (index % 2)
        droop_m = 0.5 * length_m * float(np.sin(np.deg2rad(pitch_deg)))
        low_m = max(level_m, 2.35 + 2 * droop_m)
        for number in range(count):
            yaw_deg = first_deg + 360 * number / count + float(rng.normal(0, 8))
            tilt_deg = pitch_deg + float(rng.normal(0, 5))
            sizes_m.append((0.8 * length_m, length_m))
            # The card's height, its z, lies along the bough.
            T = at(0, 0, low_m, yaw=yaw_deg) @ at(pitch=90 + tilt_deg) @ at(0, 0, length_m / 2)
            poses.append(T)
    boughs = cards_arrays(sizes_m, poses)
    return [put(trunk, bark), Part(boughs, cut_out(one_of(rng, *NEEDLE_TINTS), needles(int(rng.integers(2)))))]


def tufts(rng: Rng, feet_m: np.ndarray, high_m: tuple[float, float], material: Material) -> Part:
    """Crossed cards with a picture of grass or flowers at feet (N, 3)."""
    sizes_m = []
    poses = []
    for x, y, z in feet_m.tolist():
        height_m = float(rng.uniform(*high_m))
        turn_deg = float(rng.uniform(0, 90))
        for yaw_deg in (turn_deg, turn_deg + 90):
            sizes_m.append((1.5 * height_m, height_m))
            poses.append(at(x, y, z + 0.42 * height_m, yaw=yaw_deg))
    return Part(cards_arrays(sizes_m, poses), material)
