"""Palettes by seed: the woods, paints, floors, tiles and cloths of a home or an office, which go together."""

from collections.abc import Sequence
from dataclasses import dataclass

from vobench.asset import picture
from vobench.asset.furniture import coated, matt, wood
from vobench.asset.kitchen import KitchenStyle
from vobench.asset.picture import Rng, one_of
from vobench.scene.material import Material

WHITES = ("#f0ece3", "#efe9dc", "#e9e6df", "#f2efe9", "#e6e2d6")
PAINTS = ("#b9c4bb", "#a9b5a6", "#b3c0c8", "#c9b29c", "#d6c4a2", "#c8b8b4", "#9fb0b4", "#d8cbb4", "#b7a9a0", "#8fa39a")
DEEP_PAINTS = ("#5f7468", "#4f6472", "#8a5f4c", "#6d6472", "#7a7350")
CLOTHS = ("#8f8a80", "#6f7d86", "#8a9a7b", "#b08d64", "#5c6b78", "#a9796a", "#9c9488", "#4f5f5a", "#c2ab8c", "#7b6a78")
ACCENT_CLOTHS = ("#d39a3c", "#b4533a", "#27445c", "#f1ece0", "#6b4353", "#3d7a7c", "#d8c3a0", "#5f7468")
CURTAINS = ("#c9b99a", "#b7c0b4", "#d9d2c4", "#a7b3bc", "#c7a890", "#8f9a96", "#e4dfd4")
LINENS = ("#e6e1d6", "#d9dde0", "#e9e4dc", "#d8cfc4")
COVERS = ("#8a9a7b", "#6f8597", "#b8a48c", "#c9c2b6", "#a3705c", "#5f6f86", "#d2b58a", "#a5a9a2")
FRONTS = ("#7f9182", "#e6e3da", "#46586a", "#c9c4b8", "#5b6b5d", "#b9ad9a", "#8d9aa3", "#dedcd6", "#a5694f")
TILE_COLOURS = ("#eef0ec", "#e0d8c8", "#c9cdcb", "#9fb3b5", "#b8c4b0", "#d9c9b8")
FLOOR_TILE_COLOURS = ("#e8e2d6", "#c2bdb4", "#8f8d89", "#b08a70", "#d9d4ca", "#6f706f")
PRINTS = 24  # pictures of each style from which those on walls are drawn


def plaster(colour: str, seed: int = 0) -> Material:
    """Painted plaster."""
    return matt(colour, picture.ground("plaster", seed % 3, 1280, 1.6))


def plank_floor(rng: Rng, tones: Sequence[str] = ("oak", "walnut", "beech")) -> Material:
    """A floor of planks, narrow or wide, of one of some woods."""
    kind = one_of(rng, *tones)
    rows = int(rng.choice([10, 14, 18]))
    tint = one_of(rng, "#ffffff", "#ece6dc", "#e2d8ca", "#d6cdc4")
    boards = picture.boards(kind, int(rng.integers(1, 3)), 2048, 2.0, rows=rows, joint_m=0.002)
    return matt(tint, boards)


def tile_floor(rng: Rng, colours: Sequence[str] = FLOOR_TILE_COLOURS) -> Material:
    """A floor of glazed tiles."""
    side = int(rng.choice([3, 4, 6]))
    tiles = picture.masonry("tile", int(rng.integers(3)), 1024, 1.2, rows=side, columns=side, bond=0.0)
    return coated(one_of(rng, *colours), tiles, roughness=float(rng.choice([0.12, 0.2, 0.3])))


def wall_tiles(rng: Rng, colours: Sequence[str] = TILE_COLOURS) -> Material:
    """Glazed tiles on a wall, square or long."""
    colour = one_of(rng, *colours)
    rows, columns, bond = ((10, 5, 0.5), (8, 4, 0.0), (6, 6, 0.0))[int(rng.integers(3))]
    tiles = picture.masonry(
        "tile", int(rng.integers(3)), 1024, 0.8 if rows > 6 else 1.2, rows=rows, columns=columns, bond=bond
    )
    return coated(colour, tiles, roughness=0.12)


def worktop(rng: Rng) -> Material:
    """A worktop of wood or of stone."""
    kind = one_of(rng, "beech", "oak", "walnut", "stone", "stone")
    if kind != "stone":
        return wood(kind)
    return coated(
        one_of(rng, "#d9d6cf", "#8d8c89", "#55565a"), picture.ground("concrete", 0, 1024, 2.0), roughness=0.15
    )


@dataclass(frozen=True, slots=True)
class Style:
    """The surfaces of a flat or an office. Colours are #rrggbb; `tones` and `second_tones` are woods of furniture."""

    tones: str
    second_tones: str
    doors: Material
    plain: Material
    accents: tuple[Material, ...]
    ceiling: Material
    planks: Material
    floor_tiles: Material
    bath_tiles: Material
    kitchen: KitchenStyle
    cloths: tuple[str, ...]
    accent_cloths: tuple[str, ...]
    has_slat_chairs: bool
    has_pads: bool
    curtain: str
    linen: str
    cover: str
    frame: str
    window_dressing: str
    prints: tuple[int, ...]  # seeds of pictures on walls
    rugs: tuple[int, ...]
    lamp_k: float
    is_painted: bool  # wardrobes and chests are painted, not of wood


def home_style(rng: Rng) -> Style:
    """The style of a flat."""
    tones = one_of(rng, "oak", "oak", "walnut", "beech")
    second_tones = tones if rng.random() < 0.6 else one_of(rng, "oak", "walnut", "beech")
    white_doors = rng.random() < 0.65
    fronts = one_of(rng, *FRONTS)
    two_colours = rng.random() < 0.5
    plaster_seed = int(rng.integers(3))
    paints = rng.permutation([*PAINTS, *DEEP_PAINTS[: int(rng.integers(6))]]).tolist()
    cloths = rng.permutation(CLOTHS).tolist()
    return Style(
        tones=tones,
        second_tones=second_tones,
        doors=coated("#e4e2dc", roughness=0.3) if white_doors else wood(one_of(rng, "oak", "beech", "walnut")),
        plain=plaster(one_of(rng, *WHITES), plaster_seed),
        accents=tuple(plaster(colour, plaster_seed) for colour in paints[:3]),
        ceiling=plaster("#f4f1ea", plaster_seed),
        planks=plank_floor(rng),
        floor_tiles=tile_floor(rng),
        bath_tiles=wall_tiles(rng),
        kitchen=KitchenStyle(
            fronts,
            one_of(rng, "#e4e0d6", "#dedcd6") if two_colours else fronts,
            worktop(rng),
            wall_tiles(rng),
        ),
        cloths=tuple(cloths[:4]),
        accent_cloths=tuple(rng.permutation(ACCENT_CLOTHS).tolist()[:2]),
        has_slat_chairs=bool(rng.random() < 0.88),
        has_pads=bool(rng.random() < 0.5),
        curtain=one_of(rng, *CURTAINS),
        linen=one_of(rng, *LINENS),
        cover=one_of(rng, *COVERS),
        frame=one_of(rng, picture.INK, "#c9a271", "#e6e2d8", "#6b4a2c"),
        window_dressing=one_of(rng, "curtains", "curtains", "blinds", "bare"),
        prints=tuple(rng.permutation(PRINTS).tolist()[:4]),
        rugs=tuple(rng.permutation(8).tolist()[:2]),
        lamp_k=float(rng.uniform(2700, 3600)),
        is_painted=bool(rng.random() < 0.5),
    )


OFFICE_FRONTS = ("#e6e3da", "#46586a", "#c9c4b8", "#8d9aa3", "#5b6b5d")
CHAIRS = ("#27445c", "#3a3c3e", "#3d7a7c", "#6b4353", "#8f8a80", "#7a3a2c", "#5f7468")


def office_style(rng: Rng) -> Style:
    """The style of an office: hard floors or carpet, white or muted walls, light desks."""
    tones = one_of(rng, "oak", "beech", "beech", "walnut")
    fronts = one_of(rng, *OFFICE_FRONTS)
    plaster_seed = int(rng.integers(3))
    paints = rng.permutation([*PAINTS, *DEEP_PAINTS]).tolist()
    cloths = rng.permutation(CHAIRS).tolist()
    kind = one_of(rng, "carpet", "carpet", "carpet", "planks", "terrazzo", "concrete")
    if kind == "carpet":
        tint = one_of(rng, "#ffffff", "#f0d8c4", "#d8e8d8", "#e8dce8", "#fff0d8")
        floor = matt(tint, picture.ground("carpet", int(rng.integers(2))))
    elif kind == "terrazzo":
        floor = Material(texture=picture.terrazzo(), eta=1.5)
    elif kind == "concrete":
        floor = coated("#e6e4e0", picture.ground("concrete"), roughness=0.3)
    else:
        floor = plank_floor(rng, ("oak", "beech"))
    has_tiled_ceiling = rng.random() < 0.6
    tiled = matt(texture=picture.masonry("tile", tile_m=1.2, rows=2, columns=2, bond=0.0))
    return Style(
        tones=tones,
        second_tones=one_of(rng, "oak", "beech", "walnut"),
        doors=wood(one_of(rng, "beech", "oak", "walnut")) if rng.random() < 0.6 else coated("#dcdbd6"),
        plain=plaster(one_of(rng, *WHITES), plaster_seed),
        accents=tuple(plaster(colour, plaster_seed) for colour in paints[:3]),
        ceiling=tiled if has_tiled_ceiling else plaster("#f4f1ea", plaster_seed),
        planks=floor,
        floor_tiles=tile_floor(rng),
        bath_tiles=wall_tiles(rng),
        kitchen=KitchenStyle(fronts, fronts, worktop(rng), wall_tiles(rng)),
        cloths=tuple(cloths[:4]),
        accent_cloths=tuple(rng.permutation(ACCENT_CLOTHS).tolist()[:2]),
        has_slat_chairs=True,
        has_pads=False,
        curtain=one_of(rng, *CURTAINS),
        linen=one_of(rng, *LINENS),
        cover=one_of(rng, *CLOTHS),
        frame=one_of(rng, picture.INK, "#c9a271", "#a4a7a6"),
        window_dressing=one_of(rng, "blinds", "blinds", "bare"),
        prints=tuple(rng.permutation(PRINTS).tolist()[:4]),
        rugs=tuple(rng.permutation(8).tolist()[:2]),
        lamp_k=float(rng.uniform(3800, 5200)),
        is_painted=bool(rng.random() < 0.5),
    )
