"""Pictures of what is behind the windows of houses by day: dim rooms with curtains, blinds and plants."""

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture
from vobench.asset.picture import Draw, Rng, one_of
from vobench.scene.material import Picture

PICTURES = 8  # that differ
WIDTH_PX = 128
HEIGHT_PX = 192
CLOTHS = ("#8f887a", "#a49c8c", "#77807f", "#9a8878", "#b5b0a4")
FOLDS = 9  # of a curtain
SLAT_PX = 5  # of a blind, with the gap below it
LEAVES = 26  # of a plant


@picture.painted
def window_picture(number: int) -> Picture:
    """What is behind a window by day: a dim room with curtains, a blind or a plant."""
    rng = np.random.default_rng([number, 77])
    image = _room(grey=26 + 10 * rng.random())
    draw = ImageDraw.Draw(image)
    cloth = picture.rgb(one_of(rng, *CLOTHS))
    match number % 4:
        case 0:
            _draw_curtains(draw, rng, cloth, share=0.24)
        case 1:
            _draw_blind(draw, rng, cloth)
        case 2:
            _draw_curtains(draw, rng, cloth, share=0.12)
            _draw_plant(draw, rng)
        case _:
            _draw_curtains(draw, rng, cloth, share=0.5)
    return Picture(np.asarray(image))


def _room(grey: float) -> Image.Image:
    """A dim room with a lighter back wall and floor."""
    image = Image.new("RGB", (WIDTH_PX, HEIGHT_PX), (int(grey), int(grey * 1.02), int(grey * 1.05)))
    draw = ImageDraw.Draw(image)
    back = int(grey * 1.5)
    back_wall = [0.25 * WIDTH_PX, 0.1 * HEIGHT_PX, 0.8 * WIDTH_PX, 0.62 * HEIGHT_PX]
    draw.rectangle(back_wall, fill=(back, back - 2, back - 6))
    floor = [0, 0.9 * HEIGHT_PX, WIDTH_PX, HEIGHT_PX]
    draw.rectangle(floor, fill=(int(grey * 1.8), int(grey * 1.6), int(grey * 1.3)))
    return image


def _draw_blind(draw: Draw, rng: Rng, cloth: tuple[int, int, int]) -> None:
    """Draw a blind of slats that is let down in part."""
    share = rng.uniform(0.3, 0.75)
    for y_px in np.arange(0, share * HEIGHT_PX, SLAT_PX).tolist():
        draw.rectangle([0, y_px, WIDTH_PX, y_px + 3], fill=cloth)


def _draw_plant(draw: Draw, rng: Rng) -> None:
    """Draw the leaves of a plant on the window sill."""
    for _ in range(LEAVES):
        x_px = rng.normal(0.6 * WIDTH_PX, 0.09 * WIDTH_PX)
        y_px = rng.normal(0.78 * HEIGHT_PX, 0.07 * HEIGHT_PX)
        green = 62 + int(rng.integers(30))
        draw.ellipse([x_px - 6, y_px - 3, x_px + 6, y_px + 3], fill=(42, green, 34))


def _draw_curtains(draw: Draw, rng: Rng, cloth: Sequence[int], *, share: float) -> None:
    """Draw curtains in folds that cover a share of the window from either side."""
    fold_px = share * WIDTH_PX / FOLDS
    for side in (0, 1):
        for fold in range(FOLDS):
            from_side_px = fold * share * WIDTH_PX / FOLDS
            left_px = from_side_px if side == 0 else WIDTH_PX - from_side_px - fold_px
            tone = 0.72 + 0.28 * np.sin(1.9 * fold + rng.uniform(0, 0.6))
            fill = tuple(int(channel * tone) for channel in cloth)
            draw.rectangle([left_px, 0, left_px + fold_px + 1, HEIGHT_PX], fill=fill)
