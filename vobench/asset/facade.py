"""Houses on the lots of a street: fronts of some styles with doors, windows and shops.

A house is built in the frame of its lot: its front is on x = 0 and faces x; it stands on the pavement.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.asset import picture
from vobench.asset.front_style import FrontStyle, front_style
from vobench.asset.furniture import BLACK, DARK, SIDES, Part, coated, matt, put, stood, wood
from vobench.asset.house_body import house_body
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays
from vobench.asset.shop_front import FASCIAS, ShopFront, shop_front
from vobench.asset.street_plan import KERB_M, Lot
from vobench.asset.wall import Hole, pierced, reveal
from vobench.asset.window_picture import PICTURES, window_picture
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

SHOP_STOREY_M = 3.7
GROUND_STOREY_M = 3.3  # of a house without a shop
HOME_STOREY_M = 3.0
ABOVE_STOREYS_M = 0.5  # of the walls
REVEAL_M = 0.17
PANE_X_M = 0.03  # before the back of the reveal
FRAME_X_M = 0.055
DOOR_M = 1.0
DOOR_HEAD_M = 2.25
DOOR_TO_END_M = 0.55  # from a door to the end of the front
DOOR_X_M = -0.27
PLINTH_M = 0.34
SHOP_SILL_M = 0.42
SHOP_HEAD_M = 2.85
SILL_ABOVE_FLOOR_M = 0.75  # of upper storeys
GROUND_SILL_M = 0.85


@dataclass(frozen=True, slots=True)
class House:
    """The parts of a house, and the places of its lights, all in the frame of its lot.

    `shop_parts` are those of a shop behind its window.
    `shop_lamps` are faces that shine on the goods.
    `windows` are faces of which some shine at night.
    """

    parts: list[Part]
    shop_parts: list[Part]
    shop_lamps: list[MeshArrays]
    windows: list[MeshArrays]


@dataclass(frozen=True, slots=True)
class _Storeys:
    """The heights of a house: `count` storeys above a ground floor, whose ceiling is at `ground_m`."""

    count: int
    ground_m: float

    @property
    def high_m(self) -> float:
        """The height of the walls."""
        return self.ground_m + self.count * HOME_STOREY_M + ABOVE_STOREYS_M


@dataclass(frozen=True, slots=True)
class _Wall:
    """A wall with its windows, and the panes of the windows."""

    parts: list[Part]
    windows: list[MeshArrays]


def house(rng: Rng, lot: Lot, *, has_shop: bool, number: int) -> House:
    """The house on a lot."""
    style = front_style(rng)
    most_storeys = 4 if lot.is_far else 3
    count = int(rng.integers(1, most_storeys + 1))
    storeys = _Storeys(count, SHOP_STOREY_M if has_shop else GROUND_STOREY_M)
    front = _front(rng, lot, style, storeys, has_shop=has_shop, number=number)
    parts = list(front.parts)
    windows = list(front.windows)
    for is_open, side in zip(lot.is_open, SIDES, strict=True):
        if is_open:
            flank = _flank(rng, lot, style, storeys, side=side)
            parts += flank.parts
            windows += flank.windows
    parts += house_body(rng, lot, style, storeys.high_m)

    T_street_pavement = at(z_m=KERB_M)
    return House(
        parts=[part.moved(T_street_pavement) for part in parts],
        shop_parts=[part.moved(T_street_pavement) for part in front.shop_parts],
        shop_lamps=[lamp.moved(T_street_pavement) for lamp in front.shop_lamps],
        windows=[window.moved(T_street_pavement) for window in windows],
    )


# --- Fronts ---


def _front(rng: Rng, lot: Lot, style: FrontStyle, storeys: _Storeys, *, has_shop: bool, number: int) -> House:
    """The front with its door, its windows, and a shop or a ground floor of a home."""
    width_m = lot.width_m
    high_m = storeys.high_m
    windows = _upper_windows(style, width_m, storeys)
    is_door_left = bool(rng.random() < 0.5)
    door = _door_hole(width_m, is_left=is_door_left)
    shop_window: Hole | None = None
    if has_shop:
        first_m, last_m = _beside_door(door, width_m, is_door_left=is_door_left, away_m=0.5)
        shop_window = (first_m, last_m, SHOP_SILL_M, SHOP_HEAD_M)
        openings = [*windows, door, shop_window]
    else:
        span_m = _beside_door(door, width_m, is_door_left=is_door_left, away_m=0.3)
        windows += _row(style, span_m, GROUND_SILL_M)
        openings = [*windows, door]

    wall = _wall(rng, style, width_m=width_m, high_m=high_m, openings=openings, windows=windows, is_far=lot.is_far)
    parts = list(wall.parts)
    parts += _door(rng, style, door, width_m=width_m, high_m=high_m, number=number)
    parts += _plinth(style, door, width_m)
    shop = shop_front(rng, lot, shop_window, high_m) if shop_window else ShopFront([], [], [])
    parts += shop.parts

    band_m = (0.14, width_m, 0.16)  # above the ground floor
    parts.append(stood(band_m, style.trim, 0.04, z=storeys.ground_m - 0.2, bevel=0))
    if style.has_balconies and not lot.is_far:
        parts += _balconies(style, windows, width_m)
    downpipe = block_arrays((0.09, 0.09, high_m - 0.3), bevel_m=0)
    parts.append(put(downpipe, DARK, 0.05, width_m / 2 - 0.14, high_m / 2 - 0.15))
    return House(parts, shop.room_parts, shop.lamps, wall.windows)


def _door_hole(width_m: float, *, is_left: bool) -> Hole:
    """The hole for the door at one end of a front. Places along a front are measured from its right end."""
    first_m = width_m - DOOR_TO_END_M - DOOR_M if is_left else DOOR_TO_END_M
    return (first_m, first_m + DOOR_M, 0.0, DOOR_HEAD_M)


def _beside_door(door: Hole, width_m: float, *, is_door_left: bool, away_m: float) -> tuple[float, float]:
    """The part of a front beside its door, some distance away from the door and from the end."""
    door_first_m = door[0]
    if is_door_left:
        return away_m, door_first_m - away_m
    return door_first_m + (DOOR_M + away_m), width_m - away_m


def _door(
    rng: Rng,
    style: FrontStyle,
    door: Hole,
    *,
    width_m: float,
    high_m: float,
    number: int,
) -> list[Part]:
    """A door in its reveal, with a pane, a handle, the number of the house and a step."""
    y_m = (door[0] + door[1]) / 2 - width_m / 2
    corner_m = np.array([0.0, -width_m / 2, 0.0])
    door_reveal = reveal(corner_m, (0, width_m, 0), (0, 0, high_m), door, 0.3)

    is_wooden = rng.random() < 0.4
    leaf = wood(one_of(rng, "oak", "walnut")) if is_wooden else coated(one_of(rng, *FASCIAS), roughness=0.25)
    pane = coated("#12161a", roughness=0.08)
    handle = block_arrays((0.05, 0.03, 0.3), bevel_m=0.008)
    sign = card_arrays((0.24, 0.12))
    number_plate = matt(texture=picture.sign(str(number)))
    step_m = (0.28, DOOR_M + 0.2, 0.05)
    return [
        Part(door_reveal, style.trim),
        stood((0.06, DOOR_M, DOOR_HEAD_M), leaf, DOOR_X_M, y_m, bevel=0.004),
        stood((0.04, 0.5, 0.7), pane, -0.25, y_m, 1.25, bevel=0.003),
        put(handle, BLACK, -0.22, y_m + 0.38, 1.05),
        put(sign, number_plate, 0.006, y_m + 0.78, 1.9),
        stood(step_m, style.trim, 0.13, y_m, bevel=0.01),
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


def _upper_windows(style: FrontStyle, width_m: float, storeys: _Storeys) -> list[Hole]:
    """The windows of the upper storeys."""
    windows = []
    for storey in range(storeys.count):
        floor_m = storeys.ground_m + storey * HOME_STOREY_M
        windows += _row(style, (0.25, width_m - 0.25), floor_m + SILL_ABOVE_FLOOR_M)
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


def _flank(rng: Rng, lot: Lot, style: FrontStyle, storeys: _Storeys, *, side: int) -> _Wall:
    """The wall of a side that is seen from a street, with windows in its upper storeys."""
    every = 2 if rng.random() < 0.5 else 1  # second window, or each
    windows = _upper_windows(style, lot.depth_m, storeys)[::every]
    wall = _wall(
        rng,
        style,
        width_m=lot.depth_m,
        high_m=storeys.high_m,
        openings=windows,
        windows=windows,
        is_far=lot.is_far,
    )
    plinth = stood((0.05, lot.depth_m, PLINTH_M), style.trim, 0.02, bevel=0)
    T_house_flank = at(-lot.depth_m / 2, side * lot.width_m / 2, 0, yaw=90 * side)
    return _Wall(
        parts=[part.moved(T_house_flank) for part in (*wall.parts, plinth)],
        windows=[window.moved(T_house_flank) for window in wall.windows],
    )


def _wall(
    rng: Rng,
    style: FrontStyle,
    *,
    width_m: float,
    high_m: float,
    openings: Sequence[Hole],
    windows: Sequence[Hole],
    is_far: bool,
) -> _Wall:
    """A wall on x = 0, centred along y, with openings, and what is in its windows."""
    corner_m = np.array([0.0, -width_m / 2, 0.0])
    along_m = (0.0, width_m, 0.0)
    up_m = (0.0, 0.0, high_m)
    parts = [Part(pierced(corner_m, along_m, up_m, openings), style.wall)]
    if not windows:
        return _Wall(parts, [])
    reveals = [as_arrays(reveal(corner_m, along_m, up_m, hole, REVEAL_M)) for hole in windows]
    parts.append(Part(joined_arrays(reveals), style.frame if style.is_modern else style.trim))

    luminous: list[MeshArrays] = []
    panes_by_picture: dict[int, list[MeshArrays]] = {}
    bars: list[MeshArrays] = []
    sills: list[MeshArrays] = []
    for u0, u1, v0, v1 in windows:
        y_m = (u0 + u1) / 2 + corner_m[1]
        z_m = (v0 + v1) / 2
        window_m = (u1 - u0, v1 - v0)
        pane = card_arrays(window_m).moved(at(-REVEAL_M + PANE_X_M, y_m, z_m))
        picture_number = int(rng.integers(PICTURES))
        panes_by_picture.setdefault(picture_number, []).append(pane)
        luminous.append(pane.moved(at(0.003)))
        bars += _bars(window_m, y_m, z_m, is_modern=style.is_modern, is_far=is_far)
        sill = block_arrays((0.2, u1 - u0 + 0.16, 0.07), bevel_m=0)
        sills.append(sill.moved(at(0.0, y_m, v0 - 0.035)))
    for number, panes in panes_by_picture.items():
        glass = coated("#ffffff", window_picture(number), roughness=0.06)
        parts.append(Part(joined_arrays(panes), glass))
    parts.append(Part(joined_arrays(bars), style.frame))
    parts.append(Part(joined_arrays(sills), style.trim))
    return _Wall(parts, luminous)


def _bars(
    window_m: tuple[float, float],
    y_m: float,
    z_m: float,
    *,
    is_modern: bool,
    is_far: bool,
) -> list[MeshArrays]:
    """The frame of a window, with bars in the middle of those that are seen from near."""
    width_m, height_m = window_m
    x_m = -REVEAL_M + FRAME_X_M
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


def _balconies(style: FrontStyle, windows: Sequence[Hole], width_m: float) -> list[Part]:
    """Balconies of a slab and rails before every other window of the upper storeys."""
    parts = []
    rails: list[MeshArrays] = []
    for u0, u1, sill_m, _ in windows[::2]:
        is_on_ground_floor = sill_m < 2.5
        if is_on_ground_floor:
            continue
        y_m = (u0 + u1) / 2 - width_m / 2
        balcony_m = u1 - u0 + 0.5
        parts.append(stood((0.95, balcony_m, 0.14), style.trim, 0.475, y_m, sill_m - 0.2, bevel=0))
        handrail = block_arrays((0.04, balcony_m, 0.04), bevel_m=0)
        rails.append(handrail.moved(at(0.92, y_m, sill_m + 0.85)))
        bar = block_arrays((0.016, 0.016, 0.9), bevel_m=0).moved(at(0.92, y_m, sill_m + 0.4))
        bars_y_m = np.arange(-balcony_m / 2 + 0.04, balcony_m / 2, 0.16).tolist()
        rails += [bar.moved(at(0, offset_m)) for offset_m in bars_y_m]
    if rails:
        parts.append(Part(joined_arrays(rails), DARK))
    return parts
