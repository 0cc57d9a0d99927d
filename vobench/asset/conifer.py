"""Conifers: a trunk with whorls of boughs, which are cards with a picture of twigs and needles."""

from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture
from vobench.asset.furniture import SIDES, Part, matt, put
from vobench.asset.meadow import cut_out
from vobench.asset.picture import Draw, Rng, one_of
from vobench.asset.shape import at, cards_arrays, lathe
from vobench.geometry.se3 import Array
from vobench.scene.material import Picture

BARK_TINTS = ("#8d8378", "#9a8a7a", "#7d7264")
NEEDLE_TINTS = ("#f4fff0", "#ffffe8", "#e6f8f4")
# The profile of a trunk (N, 2), radius and height, for a height of 1.
TRUNK_PROFILE = np.array([[0, -0.02], [0.014, -0.02], [0.01, 0.4], [0.004, 0.95], [0, 0.97]])
WHORL_M = 0.34  # between the whorls
LEAST_CLEAR_M = 2.4  # below the lowest whorl, so that a body passes
LOWEST_TIP_M = 2.35  # height of the tips of boughs that droop
TOP_PITCH_DEG = -12.0  # of the boughs at the top, which rise; downwards is positive
DROOP_DEG = 34.0  # by which the lowest boughs droop more than those at the top

# The picture of a bough
STEM_COLOUR = (74, 58, 42, 255)
TWIG_COLOUR = (66, 60, 40, 255)
NEEDLE_COLOUR = (88, 124, 76)
TRANSPARENT = (44, 66, 40, 0)
TWIGS = 34  # on each side of the stem
TWIG_RIGHT = 0.88  # direction of the twigs on the right in the picture, a unit vector about
TWIG_UP = 0.48
NEEDLES_PER_SIDE = 130  # of a picture, along a twig
NEEDLE_LENGTH = 0.03  # relative to the side of the picture


@picture.painted
def needles(seed: int = 0, px: int = 512) -> Picture:
    """A bough of a conifer on a transparent background: twigs on both sides of a stem, with needles."""
    rng = np.random.default_rng([seed, 75])
    image = Image.new("RGBA", (px, px), TRANSPARENT)
    draw = ImageDraw.Draw(image)
    draw.line([(px / 2, px), (px / 2, 0.02 * px)], fill=STEM_COLOUR, width=7)
    for share in np.linspace(0.04, 0.97, TWIGS).tolist():  # from the foot of the stem to its tip
        foot_px = np.array([px / 2, px * (1 - share)])
        longest_px = px * 0.47 * (1 - share) ** 0.7
        length_px = longest_px * float(rng.uniform(0.8, 1.0)) + 0.02 * px
        for side in SIDES:
            tip_px = foot_px + length_px * np.array([side * TWIG_RIGHT, -TWIG_UP])
            draw.line([tuple(foot_px.tolist()), tuple(tip_px.tolist())], fill=TWIG_COLOUR, width=3)
            _draw_needles(draw, rng, foot_px, tip_px, px)
    return Picture(np.asarray(image))


def _draw_needles(draw: Draw, rng: Rng, foot_px: Array, tip_px: Array, px: int) -> None:
    """Draw needles on both sides of a twig."""
    length_px = np.linalg.norm(tip_px - foot_px)
    count = max(4, int(length_px / px * NEEDLES_PER_SIDE))
    for share in np.linspace(0, 1, count):
        start_px = foot_px + share * (tip_px - foot_px)
        for side in SIDES:
            right = side * float(rng.uniform(0.2, 1.0))
            up = float(rng.uniform(0.3, 1.0))
            direction = np.array([right, -up])
            end_px = start_px + px * NEEDLE_LENGTH * direction / np.linalg.norm(direction)
            tone = float(rng.uniform(0.6, 1.15))
            red, green, blue = (int(channel * tone) for channel in NEEDLE_COLOUR)
            draw.line([tuple(start_px.tolist()), tuple(end_px.tolist())], fill=(red, green, blue, 255), width=3)


def conifer(rng: Rng, height_m: float = 8.0, spread: float = 0.24) -> list[Part]:
    """A conifer with whorls of boughs; `spread` is the radius of the lowest ones relative to the height."""
    bark = matt(one_of(rng, *BARK_TINTS), picture.boards("walnut", 3, 512, 0.8))
    trunk = lathe(TRUNK_PROFILE * height_m, sections=9)
    clear_m = max(LEAST_CLEAR_M, 0.2 * height_m)
    sizes_m = []
    poses = []
    levels_m = np.arange(clear_m, height_m - 0.1, WHORL_M)
    for index, level_m in enumerate(levels_m.tolist()):
        depth = (height_m - level_m) / (height_m - clear_m)  # 0 at the top and 1 at the lowest whorl
        length_m = spread * height_m * (0.12 + 0.88 * depth) * float(rng.uniform(0.85, 1.1))
        pitch_deg = TOP_PITCH_DEG + DROOP_DEG * depth
        count = 7 if depth > 0.3 else 5
        first_deg = float(rng.uniform(0, 360)) + 30 * (index % 2)
        # Boughs that droop begin higher, so that their tips are above a body.
        droop_m = 0.5 * length_m * float(np.sin(np.deg2rad(pitch_deg)))
        foot_m = max(level_m, LOWEST_TIP_M + 2 * droop_m)
        for number in range(count):
            yaw_deg = first_deg + 360 * number / count + float(rng.normal(0, 8))
            bough_pitch_deg = pitch_deg + float(rng.normal(0, 5))
            # The card's height, its z, lies along the bough.
            T_tree_foot = at(0, 0, foot_m, yaw=yaw_deg)
            T_foot_bough = at(pitch=90 + bough_pitch_deg)
            T_bough_card = at(0, 0, length_m / 2)
            sizes_m.append((0.8 * length_m, length_m))
            poses.append(T_tree_foot @ T_foot_bough @ T_bough_card)
    boughs = cards_arrays(sizes_m, poses)
    needle_tint = one_of(rng, *NEEDLE_TINTS)
    needle_seed = int(rng.integers(2))
    foliage = replace(cut_out(needle_tint, needles(needle_seed)), is_foliage=True)
    return [put(trunk, bark), Part(boughs, foliage)]
