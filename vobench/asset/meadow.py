"""Textures and plants of the ground of parks: lawn, gravel, tufts of grass and flowers."""

from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture
from vobench.asset.furniture import Part, matt
from vobench.asset.picture import Draw, Rng
from vobench.asset.shape import at, cards_arrays
from vobench.geometry.se3 import Array
from vobench.scene.material import Material, Picture, Texture

Ink = tuple[int, int, int]  # red, green and blue

# The second number of the seed of each texture, so that textures with the same seed have independent random numbers.
LAWN_STREAM = 71
GRAVEL_STREAM = 72
TUFT_STREAM = 73
FLOWER_STREAM = 74

# Mown grass
LAWN_BLADES = 30_000  # the number of blades in a tile
LAWN_SOIL = (44, 56, 27)
GREEN_BLADE = (106, 126, 56)
DRY_BLADE = (150, 142, 86)
DRY_SHARES = (0.05, 0.16, 0.3)  # the share of dry blades in each variant
CLOVERS = 160  # the number of clovers
CLOVER = (66, 104, 44)
CLOVER_LEAF_PX = 7  # the radius of a leaf
CLOVER_RADIUS_PX = 8  # the distance of the centres of the leaves from the centre of the clover

# Gravel
PEBBLE_COUNTS = (14_000, 9_000, 20_000)  # the number of pebbles in each variant
MIN_PEBBLE_RADIUS_PX = (1.3, 1.8, 1.0)  # the radius of the smallest pebbles in each variant
SAND = (1.0, 0.93, 0.8)  # red, green and blue relative to the tone
PEBBLE = (158, 148, 132)
FALLEN_LEAVES = 90  # the number of fallen leaves
HALF_LEAF_PX = 13.0  # half the length of a leaf

# Tufts of long grass
TUFT_BLADES = 64  # the number of blades in a tuft
TUFT_BLADE = (122, 138, 62)
TUFT_BACKGROUND = (100, 118, 56, 0)  # transparent

# Flowers
FLOWER_INKS = ((206, 62, 54), (226, 178, 48), (150, 84, 164), (232, 226, 214), (214, 116, 150))
FLOWERS = 26  # the number of flowers in a picture
PETALS = 5  # the number of petals of a flower
FLOWER_STALK = (74, 102, 44, 255)
FLOWER_MIDDLE = (196, 158, 46, 255)
FLOWER_BACKGROUND = (80, 104, 48, 0)  # transparent


@picture.painted
def lawn(seed: int = 0, px: int = 2048, tile_m: float = 3.0) -> Picture:
    """Mown grass: overlapping green and dry blades with clovers, in lighter and darker patches."""
    rng = np.random.default_rng([seed, LAWN_STREAM])
    image = Image.new("RGB", (px, px), LAWN_SOIL)
    draw = ImageDraw.Draw(image)
    _draw_blades(draw, rng, px, dry_share=DRY_SHARES[seed % len(DRY_SHARES)])
    for x, y in rng.uniform(0, px, (CLOVERS, 2)).tolist():
        _draw_clover(draw, x, y, turn_deg=float(rng.uniform(0, 90)))
    patches = 1 + 0.13 * picture.noise(rng, px, 1, 10)
    shaded = np.asarray(image) * patches[..., None]
    pixels = np.clip(shaded, 0, 255).astype(np.uint8)
    return Picture(pixels, tile_m)


def _draw_blades(draw: Draw, rng: Rng, px: int, *, dry_share: float) -> None:
    """Draw blades of mown grass as short lines in all directions. The blades on top are brighter."""
    count = LAWN_BLADES
    starts_px = rng.uniform(0, px, (count, 2))
    angles_rad = rng.uniform(0, 2 * np.pi, count)
    lengths_px = px * rng.uniform(0.006, 0.022, count)
    directions = np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=1)
    ends_px = starts_px + lengths_px[:, None] * directions
    is_dry = rng.random(count) < dry_share
    tone_by_height = 0.55 + 0.5 * np.arange(count) / count  # blades are drawn from the bottom to the top
    tones = tone_by_height * rng.normal(1, 0.12, count)
    for start_px, end_px, dry, tone in zip(starts_px.tolist(), ends_px.tolist(), is_dry, tones, strict=True):
        ink = _toned(DRY_BLADE if dry else GREEN_BLADE, tone, 0, 255)
        draw.line([*start_px, *end_px], fill=ink, width=int(rng.integers(2, 6)))


def _draw_clover(draw: Draw, x: float, y: float, *, turn_deg: float) -> None:
    """Draw a clover with three round leaves around (x, y)."""
    for angle_rad in np.deg2rad(120 * np.arange(3) + turn_deg):
        leaf_x = x + CLOVER_RADIUS_PX * float(np.cos(angle_rad))
        leaf_y = y + CLOVER_RADIUS_PX * float(np.sin(angle_rad))
        _draw_disc(draw, leaf_x, leaf_y, CLOVER_LEAF_PX, CLOVER)


@picture.painted
def gravel(seed: int = 0, px: int = 2048, tile_m: float = 2.6) -> Picture:
    """Gravel: pebbles of several tones in sand, with fallen leaves."""
    rng = np.random.default_rng([seed, GRAVEL_STREAM])
    blotches = 5 * picture.noise(rng, px, 2, 16)
    grains = 20 * picture.noise(rng, px, 90, 900, slope=0.1)
    tone = 150 + blotches + grains
    coloured = tone[..., None] * np.array(SAND)
    sand = np.clip(coloured, 20, 235).astype(np.uint8)
    image = Image.fromarray(sand)
    draw = ImageDraw.Draw(image)

    variant = seed % len(PEBBLE_COUNTS)
    _draw_pebbles(draw, rng, px, count=PEBBLE_COUNTS[variant], min_radius_px=MIN_PEBBLE_RADIUS_PX[variant])
    for x, y in rng.uniform(0, px, (FALLEN_LEAVES, 2)).tolist():
        _draw_fallen_leaf(draw, rng, x, y)
    return Picture(np.asarray(image), tile_m)


def _draw_pebbles(draw: Draw, rng: Rng, px: int, *, count: int, min_radius_px: float) -> None:
    """Draw pebbles as horizontal ellipses. Most of them are slightly larger than the smallest ones."""
    radii_px = min_radius_px + rng.exponential(1.6, count)
    tones = rng.normal(0.95, 0.3, count)
    middles_px = rng.uniform(0, px, (count, 2))
    for (x, y), radius_px, tone in zip(middles_px.tolist(), radii_px, tones, strict=True):
        half_height_px = 0.8 * radius_px
        box_px = [x - radius_px, y - half_height_px, x + radius_px, y + half_height_px]
        draw.ellipse(box_px, fill=_toned(PEBBLE, tone, 30, 230))


def _draw_fallen_leaf(draw: Draw, rng: Rng, x: float, y: float) -> None:
    """Draw a leaf around (x, y) as a rhombus in a random direction."""
    angle_rad = rng.uniform(0, np.pi)
    half_length_px = HALF_LEAF_PX * np.array([np.cos(angle_rad), np.sin(angle_rad)])
    half_width_px = 0.45 * np.array([-half_length_px[1], half_length_px[0]])
    from_center_px = np.stack([half_length_px, half_width_px, -half_length_px, -half_width_px])
    corners_px = np.array([x, y]) + from_center_px
    red = int(rng.uniform(90, 150))
    green = int(rng.uniform(66, 110))
    blue = int(rng.uniform(30, 60))
    draw.polygon([tuple(corner) for corner in corners_px.tolist()], fill=(red, green, blue))


@picture.painted
def blades(seed: int = 0, px: int = 256) -> Picture:
    """A tuft of long grass on a transparent background."""
    rng = np.random.default_rng([seed, TUFT_STREAM])
    image = Image.new("RGBA", (px, px), TUFT_BACKGROUND)
    draw = ImageDraw.Draw(image)
    for index in range(TUFT_BLADES):
        foot_px = px / 2 + float(rng.normal(0, 0.16 * px))
        lean_px = float(rng.normal(0, 0.22 * px))
        height_px = px * float(rng.uniform(0.45, 0.97))
        tone = 0.55 + 0.5 * index / TUFT_BLADES  # the blades in front are brighter
        path_px = []
        for height_share in np.linspace(0, 1, 7).tolist():
            x = foot_px + lean_px * height_share**2  # the curvature is that of a parabola
            y = px - height_px * height_share
            path_px.append((x, y))
        red, green, blue = (int(channel * tone) for channel in TUFT_BLADE)
        draw.line(path_px, fill=(red, green, blue, 255), width=int(rng.integers(3, 7)))
    return Picture(np.asarray(image))


@picture.painted
def flowers(seed: int = 0, px: int = 256) -> Picture:
    """Flowers of one colour on their stalks, on a transparent background."""
    rng = np.random.default_rng([seed, FLOWER_STREAM])
    image = Image.new("RGBA", (px, px), FLOWER_BACKGROUND)
    draw = ImageDraw.Draw(image)
    ink = FLOWER_INKS[seed % len(FLOWER_INKS)]
    for _ in range(FLOWERS):
        foot_px = px / 2 + float(rng.normal(0, 0.2 * px))
        x = foot_px + float(rng.normal(0, 0.1 * px))
        y = px * float(rng.uniform(0.06, 0.6))
        draw.line([(foot_px, px), (x, y)], fill=FLOWER_STALK, width=5)
        _draw_blossom(draw, rng, x, y, ink=ink, px=px)
    return Picture(np.asarray(image))


def _draw_blossom(draw: Draw, rng: Rng, x: float, y: float, *, ink: Ink, px: int) -> None:
    """Draw a flower with five round petals and a yellow middle around (x, y)."""
    radius_px = px * float(rng.uniform(0.035, 0.06))
    tone = float(rng.uniform(0.75, 1.1))
    red, green, blue = (min(255, int(channel * tone)) for channel in ink)
    petal_angle_deg = 360 / PETALS
    first_deg = float(rng.uniform(0, petal_angle_deg))
    for angle_rad in np.deg2rad(petal_angle_deg * np.arange(PETALS) + first_deg):
        petal_x = x + radius_px * float(np.cos(angle_rad))
        petal_y = y + radius_px * float(np.sin(angle_rad))
        _draw_disc(draw, petal_x, petal_y, radius_px, (red, green, blue, 255))
    _draw_disc(draw, x, y, 5, FLOWER_MIDDLE)


def _draw_disc(draw: Draw, x: float, y: float, radius_px: float, ink: tuple[int, ...]) -> None:
    """Draw a disc around (x, y)."""
    box_px = [x - radius_px, y - radius_px, x + radius_px, y + radius_px]
    draw.ellipse(box_px, fill=ink)


def _toned(ink: Ink, tone: float, darkest: int, lightest: int) -> tuple[int, ...]:
    """A colour multiplied by a tone. Each channel is limited to the range from `darkest` to `lightest`."""
    return tuple(int(np.clip(channel * tone, darkest, lightest)) for channel in ink)


def cut_out(tint: str, texture: Texture) -> Material:
    """A diffuse material with a texture whose transparent parts are holes."""
    return replace(matt(tint, texture), cutout=0.5)


def tufts(rng: Rng, feet_m: Array, height_range_m: tuple[float, float], material: Material) -> Part:
    """Plants as pairs of crossed cards, which show a picture of grass or flowers.

    `feet_m` (N, 3) are the positions of the plants on the ground.
    `height_range_m` are the smallest and the largest height.
    `material` is the material with the picture; see `cut_out`.
    """
    sizes_m = []
    poses = []
    for x, y, z in feet_m.tolist():
        card_height_m = float(rng.uniform(*height_range_m))
        first_deg = float(rng.uniform(0, 90))
        for yaw_deg in (first_deg, first_deg + 90):
            sizes_m.append((1.5 * card_height_m, card_height_m))
            center_z = z + 0.42 * card_height_m  # slightly below half the height, so that the card touches the ground
            poses.append(at(x, y, center_z, yaw=yaw_deg))
    return Part(cards_arrays(sizes_m, poses), material)
