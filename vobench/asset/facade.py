"""Houses on the lots of a street: fronts of some styles with windows, roofs, and shops with depth behind their panes.

A house is built in the frame of its lot: its front is on x = 0 and faces x; it stands on the pavement.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture, shop
from vobench.asset.fitting import PANE
from vobench.asset.furniture import BLACK, DARK, Part, coated, matt, put, stood, wood
from vobench.asset.picture import BRICK, INK, NAVY, PAPER, PLUM, TEAL, Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays
from vobench.asset.street_plan import KERB_M, Lot
from vobench.asset.wall import Hole, pierced, reveal
from vobench.geometry.se3 import Array
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

STYLES = ("brick", "brick", "render", "render", "stone", "panel")
BRICK_TINTS = ("#ffffff", "#d8c0a8", "#b98d7c", "#e6d6b4", "#9c8f8a", "#d2a68c")
RENDER_TINTS = ("#d9c39a", "#a9bac4", "#c8a392", "#dcd8cc", "#9fb09a", "#e6e0d2", "#c2b8a6", "#b98f76", "#8f9aa0")
STONE_TINTS = ("#e2d6bf", "#cfc6b4", "#d8d4cb")
PANEL_TINTS = ("#c9cbca", "#70767a", "#e0dfda", "#4a4f52", "#a59a8c")
TRIMS = ("#d9d5ca", "#b9b3a6", "#e8e5dd", "#9a948a")
FRAMES = ("#e4e2dc", "#e4e2dc", "#2d3234", "#6b4a2c", "#4f5f5a")
FASCIAS = (NAVY, TEAL, BRICK, PLUM, INK, "#2f4a36", "#e6e3da", "#8a2f2a", "#3b3f42")
SHOP_STOREY_M = 3.7
HOME_STOREY_M = 3.0
REVEAL_M = 0.17
FOUNDATION_M = KERB_M + 0.02  # of a house below the pavement
PICTURES = 8  # of what is behind windows
FASCIA_PX = 96  # height of the picture of a shop's name
FASCIA_LENGTH_PX = 1024
DOOR_M = 1.0
DOOR_HEAD_M = 2.25
DOOR_TO_END_M = 0.55  # from a door to the end of the front
PLINTH_M = 0.34
FOLDS = 9  # of a curtain


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


@dataclass(slots=True)
class House:
    """The parts of a house while it is built, and the places of its lights, all in the lot's frame.

    shop_lamps are faces that shine on the goods; windows are faces of which some shine at night.
    """

    parts: list[Part] = field(default_factory=list)
    shop_parts: list[Part] = field(default_factory=list)
    shop_lamps: list[MeshArrays] = field(default_factory=list)
    windows: list[MeshArrays] = field(default_factory=list)


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


def house(rng: Rng, lot: Lot, *, has_shop: bool, number: int) -> House:
    """The house on a lot."""
    style = front_style(rng)
    storeys = int(rng.integers(1, 5) if lot.is_far else rng.integers(1, 4))
    ground_m = SHOP_STOREY_M if has_shop else HOME_STOREY_M + 0.3
    high_m = ground_m + storeys * HOME_STOREY_M + 0.5
    building = House()
    _front(
        rng, building, lot, style, storeys=storeys, ground_m=ground_m, high_m=high_m, has_shop=has_shop, number=number
    )
    for is_open, side in zip(lot.is_open, (-1, 1), strict=True):
        if is_open:
            _flank(rng, building, lot, style, side=side, storeys=storeys, ground_m=ground_m, high_m=high_m)
    _body(rng, building, lot, style, high_m)
    return _raised(building, KERB_M)


def _raised(building: House, z_m: float) -> House:
    """The house on the pavement."""
    T = at(z_m=z_m)
    return House(
        [part.moved(T) for part in building.parts],
        [part.moved(T) for part in building.shop_parts],
        [lamp.moved(T) for lamp in building.shop_lamps],
        [window.moved(T) for window in building.windows],
    )


# --- Fronts ---


def _front(
    rng: Rng,
    building: House,
    lot: Lot,
    style: FrontStyle,
    *,
    storeys: int,
    ground_m: float,
    high_m: float,
    has_shop: bool,
    number: int,
) -> None:
    """The front with its door, its windows, and a shop or a ground floor of a home."""
    width_m = lot.width_m
    windows = _upper_windows(style, width_m, storeys, ground_m)

    # Along the front, from the right end: the door is at one end, the shop window or windows take the rest.
    is_door_left = bool(rng.random() < 0.5)
    door_u_m = width_m - DOOR_TO_END_M - DOOR_M if is_door_left else DOOR_TO_END_M
    door: Hole = (door_u_m, door_u_m + DOOR_M, 0.0, DOOR_HEAD_M)
    shop_window: Hole | None = None
    if has_shop:
        first_m = 0.5 if is_door_left else door_u_m + 1.5
        last_m = door_u_m - 0.5 if is_door_left else width_m - 0.5
        shop_window = (first_m, last_m, 0.42, 2.85)
    else:
        first_m = 0.3 if is_door_left else door_u_m + 1.3
        last_m = door_u_m - 0.3 if is_door_left else width_m - 0.3
        windows += _row(style, (first_m, last_m), 0.85)
    openings = [*windows, door]
    if shop_window:
        openings.append(shop_window)
    _wall(
        rng,
        building,
        style,
        width_m=width_m,
        high_m=high_m,
        openings=openings,
        windows=windows,
        is_far=lot.is_far,
    )
    _door(rng, building, style, door, width_m=width_m, high_m=high_m, number=number)
    building.parts += _plinth(style, door, width_m)
    if shop_window:
        _shop(rng, building, lot, shop_window, high_m)

    band_m = (0.14, width_m, 0.16)  # above the ground floor
    building.parts.append(stood(band_m, style.trim, 0.04, 0, ground_m - 0.2, bevel=0))
    if style.has_balconies and not lot.is_far:
        _balconies(building, style, windows, width_m)
    downpipe = block_arrays((0.09, 0.09, high_m - 0.3), bevel_m=0)
    building.parts.append(put(downpipe, DARK, 0.05, width_m / 2 - 0.14, high_m / 2 - 0.15))


def _door(
    rng: Rng, building: House, style: FrontStyle, door: Hole, *, width_m: float, high_m: float, number: int
) -> None:
    """A door in its reveal, with a pane, a handle, the number of the house and a step."""
    y_m = (door[0] + door[1]) / 2 - width_m / 2
    corner_m = np.array([0.0, -width_m / 2, 0.0])
    building.parts.append(Part(reveal(corner_m, (0, width_m, 0), (0, 0, high_m), door, 0.3), style.trim))

    is_wooden = rng.random() < 0.4
    leaf = wood(one_of(rng, "oak", "walnut")) if is_wooden else coated(one_of(rng, *FASCIAS), roughness=0.25)
    pane = coated("#12161a", roughness=0.08)
    handle = block_arrays((0.05, 0.03, 0.3), bevel_m=0.008)
    sign = card_arrays((0.24, 0.12))
    building.parts += [
        stood((0.06, DOOR_M, DOOR_HEAD_M), leaf, -0.27, y_m, 0, bevel=0.004),
        stood((0.04, 0.5, 0.7), pane, -0.25, y_m, 1.25, bevel=0.003),
        put(handle, BLACK, -0.22, y_m + 0.38, 1.05),
        put(sign, matt(texture=picture.sign(str(number))), 0.006, y_m + 0.78, 1.9),
        stood((0.28, DOOR_M + 0.2, 0.05), style.trim, 0.13, y_m, 0, bevel=0.01),
    ]


def _plinth(style: FrontStyle, door: Hole, width_m: float) -> list[Part]:
    """The plinth of a front, on both sides of its door."""
    parts = []
    for first_m, last_m in _gaps(width_m, [door]):
        y_m = (first_m + last_m) / 2 - width_m / 2
        parts.append(stood((0.05, last_m - first_m, PLINTH_M), style.trim, 0.02, y_m, 0, bevel=0))
    return parts


def _gaps(width_m: float, holes: Sequence[Hole]) -> list[tuple[float, float]]:
    """The stretches of a front between its doors."""
    ends = [0.0]
    for u0, u1, _, _ in sorted(holes):
        ends += [u0, u1]
    ends.append(width_m)
    return [(first, last) for first, last in zip(ends[::2], ends[1::2], strict=True) if last - first > 0.05]


def _upper_windows(style: FrontStyle, width_m: float, storeys: int, ground_m: float) -> list[Hole]:
    """The windows of the upper storeys."""
    windows = []
    for storey in range(storeys):
        floor_m = ground_m + storey * HOME_STOREY_M
        windows += _row(style, (0.25, width_m - 0.25), floor_m + 0.75)
    return windows


def _row(style: FrontStyle, span: tuple[float, float], sill_m: float) -> list[Hole]:
    """Windows side by side between two places along a front."""
    width_m, height_m = style.window_m
    first_m, last_m = span
    length_m = last_m - first_m
    count = int(length_m / style.module_m)
    if count == 0 and length_m > width_m + 0.3:
        count = 1
    middles_m = first_m + (np.arange(count) + 0.5) * length_m / max(count, 1)
    return [(u_m - width_m / 2, u_m + width_m / 2, sill_m, sill_m + height_m) for u_m in middles_m.tolist()]


def _flank(
    rng: Rng, building: House, lot: Lot, style: FrontStyle, *, side: int, storeys: int, ground_m: float, high_m: float
) -> None:
    """The wall of a side that is seen from a street, with windows in its upper storeys."""
    flank = House()
    every = 2 if rng.random() < 0.5 else 1  # second window, or each
    windows = _upper_windows(style, lot.depth_m, storeys, ground_m)[::every]
    _wall(
        rng,
        flank,
        style,
        width_m=lot.depth_m,
        high_m=high_m,
        openings=windows,
        windows=windows,
        is_far=lot.is_far,
    )
    flank.parts.append(stood((0.05, lot.depth_m, PLINTH_M), style.trim, 0.02, 0, 0, bevel=0))
    T = at(-lot.depth_m / 2, side * lot.width_m / 2, 0, yaw=90 * side)
    building.parts += [part.moved(T) for part in flank.parts]
    building.windows += [window.moved(T) for window in flank.windows]


def _wall(
    rng: Rng,
    building: House,
    style: FrontStyle,
    *,
    width_m: float,
    high_m: float,
    openings: Sequence[Hole],
    windows: Sequence[Hole],
    is_far: bool,
) -> None:
    """A wall on x = 0, centred along y, with openings, and what is in its windows."""
    corner_m = np.array([0.0, -width_m / 2, 0.0])
    along_m = (0.0, width_m, 0.0)
    up_m = (0.0, 0.0, high_m)
    building.parts.append(Part(pierced(corner_m, along_m, up_m, openings), style.wall))
    if windows:
        reveals = [as_arrays(reveal(corner_m, along_m, up_m, hole, REVEAL_M)) for hole in windows]
        building.parts.append(Part(joined_arrays(reveals), style.frame if style.is_modern else style.trim))

    panes_by_picture: dict[int, list[MeshArrays]] = {}
    bars = []
    sills = []
    for u0, u1, v0, v1 in windows:
        y_m = (u0 + u1) / 2 + corner_m[1]
        z_m = (v0 + v1) / 2
        window_m = (u1 - u0, v1 - v0)
        pane = card_arrays(window_m).moved(at(-REVEAL_M + 0.03, y_m, z_m))
        panes_by_picture.setdefault(int(rng.integers(PICTURES)), []).append(pane)
        building.windows.append(pane.moved(at(0.003)))
        bars += _bars(*window_m, y_m, z_m, is_modern=style.is_modern, is_far=is_far)
        sill = block_arrays((0.2, u1 - u0 + 0.16, 0.07), bevel_m=0)
        sills.append(sill.moved(at(0.0, y_m, v0 - 0.035)))
    for number, panes in panes_by_picture.items():
        glass = coated("#ffffff", window_picture(number), roughness=0.06)
        building.parts.append(Part(joined_arrays(panes), glass))
    if bars:
        building.parts += [Part(joined_arrays(bars), style.frame), Part(joined_arrays(sills), style.trim)]


def _bars(
    width_m: float, height_m: float, y_m: float, z_m: float, *, is_modern: bool, is_far: bool
) -> list[MeshArrays]:
    """The frame of a window, with bars in the middle of those that are seen from near."""
    x_m = -REVEAL_M + 0.055
    upright = block_arrays((0.05, 0.06, height_m), bevel_m=0)
    level = block_arrays((0.05, width_m, 0.06), bevel_m=0)
    upright_y_m = [-width_m / 2 + 0.03, width_m / 2 - 0.03]
    level_z_m = [-height_m / 2 + 0.03, height_m / 2 - 0.03]
    if not is_far:
        upright_y_m.append(0.0)
    if not is_far and not is_modern:
        level_z_m.append(0.16 * height_m)
    uprights = [upright.moved(at(x_m, y_m + offset_m, z_m)) for offset_m in upright_y_m]
    levels = [level.moved(at(x_m, y_m, z_m + offset_m)) for offset_m in level_z_m]
    return uprights + levels


def _balconies(building: House, style: FrontStyle, windows: Sequence[Hole], width_m: float) -> None:
    """Balconies of a slab and rails before every other window."""
    rails = []
    for u0, u1, sill_m, _ in windows[::2]:
        is_on_ground_floor = sill_m < 2.5
        if is_on_ground_floor:
            continue
        y_m = (u0 + u1) / 2 - width_m / 2
        balcony_m = u1 - u0 + 0.5
        building.parts.append(stood((0.95, balcony_m, 0.14), style.trim, 0.475, y_m, sill_m - 0.2, bevel=0))
        handrail = block_arrays((0.04, balcony_m, 0.04), bevel_m=0)
        rails.append(handrail.moved(at(0.92, y_m, sill_m + 0.85)))
        bar = block_arrays((0.016, 0.016, 0.9), bevel_m=0).moved(at(0.92, y_m, sill_m + 0.4))
        bar_y_m = np.arange(-balcony_m / 2 + 0.04, balcony_m / 2, 0.16)
        rails += [bar.moved(at(0, offset_m)) for offset_m in bar_y_m.tolist()]
    if rails:
        building.parts.append(Part(joined_arrays(rails), DARK))


# --- The ground floor of a shop ---


def _shop(rng: Rng, building: House, lot: Lot, window: Hole, high_m: float) -> None:
    """A shop window with a room behind its pane, a fascia with the name above it, and perhaps an awning."""
    first_m, last_m, sill_m, head_m = window
    middle_y_m = (first_m + last_m) / 2 - lot.width_m / 2
    width_m = last_m - first_m
    ink = one_of(rng, *FASCIAS)
    paint = coated(ink, roughness=0.3)
    building.parts += _shop_frame(lot, window, high_m, paint)
    pane = quad_arrays((-0.12, middle_y_m - width_m / 2, sill_m), (0, width_m, 0), (0, 0, head_m - sill_m))
    building.shop_parts.append(Part(pane, PANE))

    kind = shop.drawn_kind(rng)
    inside = shop.interior(rng, kind, width_m=width_m, sill_m=sill_m, depth_m=lot.depth_m * 0.4)
    T_house_shop = at(-0.22, middle_y_m, 0)
    building.shop_parts += [part.moved(T_house_shop) for part in inside.parts]
    building.shop_lamps += [lamp.moved(T_house_shop) for lamp in inside.lamps]

    name = one_of(rng, *shop.NAMES[kind])
    board_m = (0.12, width_m + 0.3, 0.62)
    building.parts.append(stood(board_m, paint, 0.06, middle_y_m, head_m + 0.06, bevel=0.01))
    length_m = min(width_m, 5.0)
    letters = card_arrays((length_m, length_m * FASCIA_PX / FASCIA_LENGTH_PX))
    building.parts.append(put(letters, matt(texture=fascia(name, ink)), 0.125, middle_y_m, head_m + 0.37))

    choice = rng.random()
    if lot.is_far:
        return
    if choice < 0.3:
        _awning(building, ink, middle_y_m, width_m, head_m)
    elif choice < 0.6:
        _hanging_sign(rng, building, name, ink, middle_y_m + width_m / 2 - 0.2)


def _shop_frame(lot: Lot, window: Hole, high_m: float, paint: Material) -> list[Part]:
    """The reveal of a shop window, and the posts that divide it into bays."""
    first_m, last_m, sill_m, head_m = window
    middle_y_m = (first_m + last_m) / 2 - lot.width_m / 2
    width_m = last_m - first_m
    corner_m = np.array([0.0, -lot.width_m / 2, 0.0])
    parts = [Part(reveal(corner_m, (0, lot.width_m, 0), (0, 0, high_m), window, 0.22), paint)]
    bays = max(1, round(width_m / 2.2))
    post = block_arrays((0.07, 0.06, head_m - sill_m), bevel_m=0)
    for number in range(bays + 1):
        y_m = middle_y_m - width_m / 2 + number * width_m / bays
        parts.append(put(post, paint, -0.12, y_m, (sill_m + head_m) / 2))
    return parts


def _awning(building: House, ink: str, middle_y_m: float, width_m: float, head_m: float) -> None:
    """Cloth over a shop window, in stripes of two colours."""
    count = max(4, round(width_m / 0.45))
    stripe_m = width_m / count
    stripes: tuple[list[MeshArrays], list[MeshArrays]] = ([], [])  # of the first and of the second colour
    for number in range(count):
        y_m = middle_y_m + (number - (count - 1) / 2) * stripe_m
        cloth = block_arrays((1.15, stripe_m, 0.015), bevel_m=0).moved(at(0.66, y_m, head_m - 0.1, pitch=15))
        hem = block_arrays((0.012, stripe_m, 0.18), bevel_m=0).moved(at(1.22, y_m, head_m - 0.33))
        stripes[number % 2].extend([cloth, hem])
    first, second = stripes
    building.parts += [Part(joined_arrays(first), matt(ink)), Part(joined_arrays(second), matt("#e4ded0"))]


def _hanging_sign(rng: Rng, building: House, name: str, ink: str, y_m: float) -> None:
    """A sign that hangs out over the pavement."""
    word = name.partition(" ")[0][:7]
    lettering = matt(texture=picture.sign(word, ink))
    z_m = float(rng.uniform(2.95, 3.2))
    plate = block_arrays((0.7, 0.04, 0.37), bevel_m=0.004)
    arm = block_arrays((0.8, 0.03, 0.03), bevel_m=0)
    building.parts.append(put(plate, DARK, 0.55, y_m, z_m))
    for side in (-1, 1):
        face = card_arrays((0.68, 0.34))
        building.parts.append(put(face, lettering, 0.55, y_m + side * 0.022, z_m, yaw=side * 90))
    building.parts.append(put(arm, DARK, 0.4, y_m, z_m + 0.22))


@picture.painted
def fascia(name: str, ink: str) -> Picture:
    """The name of a shop on its board."""
    image = Image.new("RGB", (FASCIA_LENGTH_PX, FASCIA_PX), ink)
    draw = ImageDraw.Draw(image)
    is_bright = sum(picture.rgb(ink)) > 450
    middle_px = (FASCIA_LENGTH_PX // 2, FASCIA_PX // 2)
    draw.text(middle_px, name, font=picture._font(64), fill=INK if is_bright else PAPER, anchor="mm")
    return Picture(np.asarray(image))


@picture.painted
def window_picture(number: int) -> Picture:
    """What is behind a window by day: a dim room with curtains, a blind, a plant or a lamp."""
    rng = np.random.default_rng([number, 77])
    width_px = 128
    height_px = 192
    grey = 26 + 10 * rng.random()  # of the room
    image = Image.new("RGB", (width_px, height_px), (int(grey), int(grey * 1.02), int(grey * 1.05)))
    draw = ImageDraw.Draw(image)
    back = int(grey * 1.5)
    back_wall = [0.25 * width_px, 0.1 * height_px, 0.8 * width_px, 0.62 * height_px]
    draw.rectangle(back_wall, fill=(back, back - 2, back - 6))
    floor = [0, 0.9 * height_px, width_px, height_px]
    draw.rectangle(floor, fill=(int(grey * 1.8), int(grey * 1.6), int(grey * 1.3)))

    cloth = picture.rgb(one_of(rng, "#8f887a", "#a49c8c", "#77807f", "#9a8878", "#b5b0a4"))
    match number % 4:
        case 0:
            _curtains(draw, rng, cloth, width_px, height_px, share=0.24)
        case 1:
            _blind(draw, rng, cloth, width_px, height_px)
        case 2:
            _curtains(draw, rng, cloth, width_px, height_px, share=0.12)
            _plant(draw, rng, width_px, height_px)
        case _:
            _curtains(draw, rng, cloth, width_px, height_px, share=0.5)
    return Picture(np.asarray(image))


def _blind(draw: ImageDraw.ImageDraw, rng: Rng, cloth: tuple[int, int, int], width_px: int, height_px: int) -> None:
    """A blind of slats that is let down in part."""
    share = rng.uniform(0.3, 0.75)
    for y_px in np.arange(0, share * height_px, 5).tolist():
        draw.rectangle([0, y_px, width_px, y_px + 3], fill=cloth)


def _plant(draw: ImageDraw.ImageDraw, rng: Rng, width_px: int, height_px: int) -> None:
    """The leaves of a plant on the window sill."""
    for _ in range(26):
        x_px = rng.normal(0.6 * width_px, 0.09 * width_px)
        y_px = rng.normal(0.78 * height_px, 0.07 * height_px)
        green = 62 + int(rng.integers(30))
        draw.ellipse([x_px - 6, y_px - 3, x_px + 6, y_px + 3], fill=(42, green, 34))


def _curtains(
    draw: ImageDraw.ImageDraw, rng: Rng, cloth: Sequence[int], width_px: int, height_px: int, *, share: float
) -> None:
    """Curtains in folds that cover a share of a window from either side."""
    fold_px = share * width_px / FOLDS
    for side in (0, 1):
        for fold in range(FOLDS):
            x_px = fold * share * width_px / FOLDS
            tone = 0.72 + 0.28 * np.sin(1.9 * fold + rng.uniform(0, 0.6))
            fill = tuple(int(channel * tone) for channel in cloth)
            left_px = x_px if side == 0 else width_px - x_px - fold_px
            draw.rectangle([left_px, 0, left_px + fold_px + 1, height_px], fill=fill)


# --- The rest of a house ---


def _body(rng: Rng, building: House, lot: Lot, style: FrontStyle, high_m: float) -> None:
    """The sides that nobody sees well, the back, and the roof."""
    corners = lot.local_corners_m
    right, left, back_left, back_right = (np.array([x, y, 0.0]) for x, y in corners.tolist())
    up = np.array([0.0, 0.0, high_m])
    walls = [quad_arrays(back_left, back_right - back_left, up)]
    if not lot.is_open[1]:
        walls.append(quad_arrays(left, back_left - left, up))
    if not lot.is_open[0]:
        walls.append(quad_arrays(back_right, right - back_right, up))
    building.parts.append(Part(joined_arrays(walls), style.wall))
    building.parts.append(Part(_foundation(right, left, back_left, back_right), style.trim))
    top = _polygon([right + up, left + up, back_left + up, back_right + up])
    building.parts.append(Part(top, DARK))
    if style.roof == "flat":
        parapet_m = (0.3, lot.width_m, 0.3)
        building.parts.append(stood(parapet_m, style.trim, -0.06, 0, high_m - 0.06, bevel=0))
        return
    eaves_m = (0.5, lot.width_m, 0.14)
    building.parts.append(stood(eaves_m, style.trim, 0.1, 0, high_m - 0.16, bevel=0))
    _pitched_roof(rng, building, lot, style, high_m)


def _foundation(right: Array, left: Array, back_left: Array, back_right: Array) -> MeshArrays:
    """The front and the sides down to the road, for houses at the end of a road, where there is no pavement."""
    up = np.array([0.0, 0.0, FOUNDATION_M])
    down = -up
    sides = [
        quad_arrays(right + down, left - right, up),
        quad_arrays(left + down, back_left - left, up),
        quad_arrays(back_right + down, right - back_right, up),
    ]
    return joined_arrays(sides)


def _polygon(corners_m: Sequence[Array]) -> MeshArrays:
    """A flat quadrilateral."""
    vertices_m = np.array(corners_m)
    a, b, c = vertices_m[:3]
    normal = np.cross(b - a, c - a)
    normals = np.tile(normal / np.linalg.norm(normal), (4, 1))
    return MeshArrays(vertices_m, np.array([[0, 1, 2], [0, 2, 3]]), vertices_m[:, :2].copy(), normals)


def _pitched_roof(rng: Rng, building: House, lot: Lot, style: FrontStyle, high_m: float) -> None:
    """Two slopes with a ridge along the street, gables, and a chimney."""
    right, left, back_left, back_right = lot.local_corners_m
    ridge_m = high_m + float(rng.uniform(2.2, 3.4))
    ridge_right = np.array([*((right + back_right) / 2), ridge_m])
    ridge_left = np.array([*((left + back_left) / 2), ridge_m])
    eaves_x = np.array([0.25, 0.0])
    eave_right = np.array([*(right + eaves_x), high_m - 0.02])
    eave_left = np.array([*(left + eaves_x), high_m - 0.02])
    back_eave_right = np.array([*back_right, high_m - 0.02])
    back_eave_left = np.array([*back_left, high_m - 0.02])
    tint = one_of(rng, "#b98d7c", "#8a8f94", "#6f7276", "#a86a52", "#5d5f62")
    tiles = matt(tint, picture.masonry("tile", 1, 512, 2.0, rows=12, columns=8))
    slopes = [
        _slope(eave_right, eave_left, ridge_left, ridge_right),
        _slope(back_eave_left, back_eave_right, ridge_right, ridge_left),
    ]
    building.parts.append(Part(joined_arrays(slopes), tiles))
    gables = [
        _triangle(np.array([*left, high_m]), np.array([*back_left, high_m]), ridge_left),
        _triangle(np.array([*back_right, high_m]), np.array([*right, high_m]), ridge_right),
    ]
    building.parts.append(Part(joined_arrays(gables), style.wall))
    if rng.random() < 0.7:
        chimney_m = (0.5, 0.9, 1.5)
        middle_m = (ridge_left + ridge_right) / 2
        x_m = float(middle_m[0])
        y_m = float(middle_m[1] + rng.uniform(-0.3, 0.3) * lot.width_m)
        bricks = matt("#b98d7c", picture.masonry("brick", 1))
        building.parts.append(stood(chimney_m, bricks, x_m, y_m, ridge_m - 0.6, bevel=0))


def _slope(a: Array, b: Array, c: Array, d: Array) -> MeshArrays:
    """A quadrilateral with texture coordinates along its first side and up the slope."""
    mesh = _polygon([a, b, c, d])
    along = (b - a) / np.linalg.norm(b - a)
    normal = mesh.normals[0]
    upwards = np.cross(normal, along)
    uv = np.column_stack([(mesh.vertices_m - a) @ along, -((mesh.vertices_m - a) @ upwards)])
    return replace(mesh, uv=uv)


def _triangle(a: Array, b: Array, c: Array) -> MeshArrays:
    """A triangle, which is visible from the side from which its corners are counter-clockwise."""
    normal = np.cross(b - a, c - a)
    normals = np.tile(normal / np.linalg.norm(normal), (3, 1))
    vertices_m = np.array([a, b, c])
    along = (b - a) / np.linalg.norm(b - a)
    uv = np.column_stack([(vertices_m - a) @ along, -vertices_m[:, 2]])
    return MeshArrays(vertices_m, np.array([[0, 1, 2]]), uv, normals)
