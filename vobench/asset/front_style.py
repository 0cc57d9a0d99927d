"""The style of a house: the materials of its front, the size of its windows, its roof and its balconies."""

from dataclasses import dataclass
from typing import Literal

from vobench.asset import picture
from vobench.asset.furniture import coated, matt
from vobench.asset.picture import Rng, one_of
from vobench.scene.material import Material

STYLES = ("brick", "brick", "render", "render", "stone", "panel")
BRICK_TINTS = ("#ffffff", "#d8c0a8", "#b98d7c", "#e6d6b4", "#9c8f8a", "#d2a68c")
RENDER_TINTS = ("#d9c39a", "#a9bac4", "#c8a392", "#dcd8cc", "#9fb09a", "#e6e0d2", "#c2b8a6", "#b98f76", "#8f9aa0")
STONE_TINTS = ("#e2d6bf", "#cfc6b4", "#d8d4cb")
PANEL_TINTS = ("#c9cbca", "#70767a", "#e0dfda", "#4a4f52", "#a59a8c")
TRIMS = ("#d9d5ca", "#b9b3a6", "#e8e5dd", "#9a948a")
FRAMES = ("#e4e2dc", "#e4e2dc", "#2d3234", "#6b4a2c", "#4f5f5a")


@dataclass(frozen=True, slots=True)
class FrontStyle:
    """How a house looks.

    `window_m` is the width and the height of windows, and `module_m` the distance between their middles.
    """

    wall: Material
    trim: Material
    frame: Material
    window_m: tuple[float, float]
    module_m: float
    is_modern: bool
    roof: Literal["flat", "pitched"]
    has_balconies: bool


def front_style(rng: Rng) -> FrontStyle:
    """The style of a house."""
    kind = one_of(rng, *STYLES)
    wall = _wall_material(rng, kind)
    is_modern = kind == "panel" or rng.random() < 0.15
    width_range_m = (1.5, 2.1) if is_modern else (0.9, 1.25)
    height_range_m = (1.4, 1.8) if is_modern else (1.45, 1.9)
    width_m = float(rng.uniform(*width_range_m))
    height_m = float(rng.uniform(*height_range_m))
    return FrontStyle(
        wall=wall,
        trim=matt(one_of(rng, *TRIMS), picture.ground("concrete", 4)),
        frame=coated(one_of(rng, *FRAMES), roughness=0.35),
        window_m=(width_m, height_m),
        module_m=width_m + float(rng.uniform(0.9, 1.5)),
        is_modern=is_modern,
        roof="flat" if is_modern or rng.random() < 0.45 else "pitched",
        has_balconies=is_modern and bool(rng.random() < 0.6),
    )


def _wall_material(rng: Rng, kind: str) -> Material:
    """The material of walls. There are few textures, in many tints: painting one takes up to half a second."""
    seed = int(rng.integers(2))
    match kind:
        case "brick":
            return matt(one_of(rng, *BRICK_TINTS), picture.masonry("brick", seed))
        case "render":
            return matt(one_of(rng, *RENDER_TINTS), picture.ground("plaster", seed, 1024, 3.2))
        case "stone":
            blocks = picture.masonry("paving", 0, 512, 2.4, rows=8, columns=3)
            return matt(one_of(rng, *STONE_TINTS), blocks)
        case _:
            panels = picture.masonry("tile", 0, 512, 3.6, rows=3, columns=2, bond=0.0)
            return coated(one_of(rng, *PANEL_TINTS), panels, 0.35)
