"""Rugs: woven, striped, with a border, or plain."""

import numpy as np

from vobench.asset import household
from vobench.asset.furniture import Part, cloth, stood
from vobench.asset.picture import Rng

COLOURS = ("#8f8a80", "#b9a88a", "#5c6b78", "#7a5a4c", "#6f7d6a", "#c2b8a4", "#3f4a55", "#9a6a5a")
THICKNESS_M = 0.008
STRIPE_M = 0.22  # width of a stripe, about
STRIPE_RISE_M = 0.0006  # of a pattern above the rug below it, so that their surfaces are apart
BORDER_RISE_M = 0.0003
BORDER_OFFSET_M = 0.06  # from the edge of the rug to its border
BORDER_M = 0.06  # width of the border


def rug(rng: Rng, width_m: float, depth_m: float, seed: int) -> list[Part]:
    """A rug on the floor with its width along y; its seed selects kind and colours."""
    kind = ("woven", "striped", "bordered", "plain")[seed % 4]
    if kind == "woven":
        return household.rug(rng, width_m=width_m, depth_m=depth_m, seed=seed)
    colours = np.random.default_rng(seed).permutation(COLOURS).tolist()
    parts = [stood((depth_m, width_m, THICKNESS_M), cloth(colours[0]), bevel=0.003)]
    if kind == "striped":
        parts += _stripes(width_m, depth_m, (colours[1], colours[2]))
    elif kind == "bordered":
        parts += _border(width_m, depth_m, colours[1], colours[2])
    return parts


def _stripes(width_m: float, depth_m: float, colours: tuple[str, str]) -> list[Part]:
    """Stripes across the rug, of two colours by turns, with stripes of the rug's own colour between them."""
    count = 2 * int(width_m / STRIPE_M) + 1
    stripe_m = width_m / count
    size_m = (depth_m - 0.01, stripe_m, STRIPE_RISE_M)
    stripes = []
    for index in range(1, count, 2):
        y_m = (index + 0.5) * stripe_m - width_m / 2
        colour = colours[index // 2 % 2]
        stripes.append(stood(size_m, cloth(colour), 0, y_m, THICKNESS_M, bevel=0))
    return stripes


def _border(width_m: float, depth_m: float, border_colour: str, inner_colour: str) -> list[Part]:
    """A border along the edges of the rug, and the field within it."""
    outer_margin_m = 2 * BORDER_OFFSET_M
    inner_margin_m = 2 * (BORDER_OFFSET_M + BORDER_M)
    outer_m = (depth_m - outer_margin_m, width_m - outer_margin_m, BORDER_RISE_M)
    inner_m = (depth_m - inner_margin_m, width_m - inner_margin_m, STRIPE_RISE_M)
    return [
        stood(outer_m, cloth(border_colour), 0, 0, THICKNESS_M, bevel=0),
        stood(inner_m, cloth(inner_colour), 0, 0, THICKNESS_M, bevel=0),
    ]
