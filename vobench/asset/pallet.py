"""Pallets with loads: cartons, wrapped goods, drums, sacks, plastic crates and wooden crates. They stand on z = 0."""

from collections.abc import Callable
from itertools import product

import numpy as np

from vobench.asset import furniture, picture
from vobench.asset.furniture import SIDES, Part, coated, matt, put
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays, cushion, lathe
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import joined_arrays

PALLET_M = (1.2, 0.8, 0.144)  # the EUR pallet: UIC 435-2
FOOT_M = (1.2, 0.1, 0.1)
CROSSPIECE_M = (0.14, 0.8, 0.022)
DECK_BOARD_M = (1.2, 0.12, 0.022)
FEET_Y_M = (-0.35, 0.0, 0.35)
CROSSPIECES_X_M = (-0.53, 0.0, 0.53)
DECK_BOARDS_Y_M = (-0.33, -0.165, 0.0, 0.165, 0.33)

CARTONS = 5  # pictures of cartons
CARTON_GRIDS = ((3, 2), (2, 2), (4, 2), (2, 1))  # columns and rows on a pallet
CARTONS_X_M = 1.18  # extent of a layer of cartons
CARTONS_Y_M = 0.78
MOST_LAYERS = 5  # of cartons or sacks
CARTON_TINTS = ("#ffffff", "#f3ead9", "#e5e9ea", "#fff3dc", "#e9d8c2")
FILM_TINTS = ("#c9cdd0", "#dcdcd6", "#3b3f42", "#b7b09e")
DRUM_M = 0.86  # height
# Radius in metres and share of the height, with two rolling hoops
DRUM_PROFILE = np.array(
    [[0, 0], [0.28, 0], [0.29, 0.02], [0.28, 0.33], [0.29, 0.35], [0.28, 0.66], [0.29, 1.0], [0, 1.0]]
)
DRUM_PAINTS = ("#27445c", "#b4533a", "#3d7a7c", "#2f4a36", "#5d6468")
SACK_M = 0.15  # height of a layer of sacks
SACK_WIDTH_M = 0.39
SACK_TINTS = ("#d9d4c8", "#c9b79a", "#e6e3da")
CRATE_M = 0.26  # height
CRATE_COLOURS = ("#27445c", "#8d1f1c", "#3d7a7c", "#5d6468", "#c8a23a", "#2f4a36")


def pallet() -> list[Part]:
    """A pallet of planks: feet along x, crosspieces on them, and deck boards along x."""
    pallet_height_m = PALLET_M[2]
    boards = []
    for y_m in FEET_Y_M:
        foot = block_arrays(FOOT_M, bevel_m=0, uv_m=(y_m, y_m))
        boards.append(foot.moved(at(0, y_m, FOOT_M[2] / 2)))
    for x_m in CROSSPIECES_X_M:
        crosspiece = block_arrays(CROSSPIECE_M, bevel_m=0, uv_m=(x_m, x_m))
        boards.append(crosspiece.moved(at(x_m, 0, 0.111)))
    for y_m in DECK_BOARDS_Y_M:
        deck_board = block_arrays(DECK_BOARD_M, bevel_m=0, uv_m=(3 * y_m, y_m))
        boards.append(deck_board.moved(at(0, y_m, pallet_height_m - DECK_BOARD_M[2] / 2)))
    planks = matt(texture=picture.boards("beech", 9, rows=6))
    return [Part(joined_arrays(boards), planks)]


def load(rng: Rng, high_m: float) -> list[Part]:
    """A pallet with goods, no higher than `high_m` with the pallet."""
    pallet_height_m = PALLET_M[2]
    often_cartons = ("cartons",) * 5
    kind = one_of(rng, *often_cartons, "wrapped", "wrapped", "drums", "sacks", "crates", "wood")
    goods = LOADS[kind](rng, high_m - pallet_height_m)
    T_ground_deck = at(z_m=pallet_height_m)
    return [*pallet(), *(part.moved(T_ground_deck) for part in goods)]


def _cartons(rng: Rng, high_m: float) -> list[Part]:
    """Cartons of one size in layers, of which some of the uppermost are gone."""
    columns, rows = CARTON_GRIDS[int(rng.integers(len(CARTON_GRIDS)))]
    length_m = CARTONS_X_M / columns
    width_m = CARTONS_Y_M / rows
    layer_m = float(rng.uniform(0.22, 0.46))
    most_layers = max(1, min(int(high_m / layer_m), MOST_LAYERS))
    layers = int(rng.integers(max(1, most_layers - 1), most_layers + 1))
    is_opened = rng.random() < 0.5

    middle_of_picture_m = max(length_m, width_m, layer_m) / 2
    carton_m = (length_m - 0.012, width_m - 0.012, layer_m - 0.002)
    carton = block_arrays(carton_m, bevel_m=0, uv_m=(middle_of_picture_m, middle_of_picture_m), upright=True)
    boxes = []
    for layer, column, row in np.ndindex(layers, columns, rows):
        is_uppermost = layers > 1 and layer == layers - 1
        may_be_gone = is_opened and is_uppermost
        if may_be_gone and rng.random() < 0.4:
            continue
        x_m = (column - (columns - 1) / 2) * length_m
        y_m = (row - (rows - 1) / 2) * width_m
        z_m = (layer + 0.5) * layer_m - 0.001 * (layer == 0)  # the lowest layer touches the pallet
        half_turn_deg = 180.0 * int(rng.integers(2))
        skew_deg = float(np.clip(rng.normal(0, 0.4), -0.8, 0.8))
        boxes.append(carton.moved(at(x_m, y_m, z_m, yaw=half_turn_deg + skew_deg)))
    texture = picture.carton(int(rng.integers(CARTONS)), 0.5)
    tint = one_of(rng, *CARTON_TINTS)
    return [Part(joined_arrays(boxes), matt(tint, texture))]


def _wrapped(rng: Rng, high_m: float) -> list[Part]:
    """A block wrapped in film, with a label on two sides."""
    height_m = float(rng.uniform(0.6, 1.0)) * high_m
    film = coated(one_of(rng, *FILM_TINTS), picture.fabric(1), roughness=0.16)
    body = block_arrays((1.14, 0.76, height_m), bevel_m=0.04)
    label = matt(texture=picture.sign(f"{rng.integers(1000, 9999)}"))
    card = card_arrays((0.3, 0.15))
    labels = [put(card, label, 0, side * 0.386, 0.6 * height_m, yaw=90.0 * side) for side in SIDES]
    return [put(body, film, z=height_m / 2), *labels]


def _drums(rng: Rng, high_m: float) -> list[Part]:
    """Two steel drums."""
    height_m = min(DRUM_M, high_m)
    drum = lathe(DRUM_PROFILE * [1, height_m], sections=16)
    paint = coated(one_of(rng, *DRUM_PAINTS), roughness=0.25)
    return [put(drum, paint, x, yaw=float(rng.uniform(0, 90))) for x in (-0.3, 0.3)]


def _sacks(rng: Rng, high_m: float) -> list[Part]:
    """Sacks in layers that lie crosswise."""
    layers = max(1, min(int(high_m / SACK_M) - 1, MOST_LAYERS))
    sack = as_arrays(cushion((SACK_WIDTH_M, 0.76, SACK_M + 0.03), power=4, cells=4))
    sacks = []
    for layer in range(layers):
        middle_z_m = (layer + 0.5) * SACK_M + 0.015
        for column in (-1, 0, 1):
            yaw_deg = float(rng.normal(0, 1))
            sacks.append(sack.moved(at(SACK_WIDTH_M * column, 0, middle_z_m, yaw=yaw_deg)))
    fabric = matt(one_of(rng, *SACK_TINTS), picture.fabric(2))
    return [Part(joined_arrays(sacks), fabric)]


def _crates(rng: Rng, high_m: float) -> list[Part]:
    """Plastic crates in four stacks of different heights."""
    colour = one_of(rng, *CRATE_COLOURS)
    body = block_arrays((0.57, 0.37, 0.22), bevel_m=0)
    rim = block_arrays((0.595, 0.395, 0.04), bevel_m=0)
    most_levels = max(2, int(high_m / CRATE_M))
    crates = []
    for x_m, y_m in product((-0.3, 0.3), (-0.2, 0.2)):
        for level in range(int(rng.integers(1, most_levels + 1))):
            if (level + 1) * CRATE_M > high_m:
                break
            bottom_m = level * CRATE_M
            crates.append(body.moved(at(x_m, y_m, bottom_m + 0.11)))
            crates.append(rim.moved(at(x_m, y_m, bottom_m + 0.24)))
    return [Part(joined_arrays(crates), coated(colour, roughness=0.3))]


def _wooden_crate(rng: Rng, high_m: float) -> list[Part]:
    """A wooden crate."""
    return furniture.crate(rng, (1.1, 0.75, min(0.9, high_m)))


# What is on a pallet: each function returns goods on z = 0, no higher than a height in metres.
LOADS: dict[str, Callable[[Rng, float], list[Part]]] = {
    "cartons": _cartons,
    "wrapped": _wrapped,
    "drums": _drums,
    "sacks": _sacks,
    "crates": _crates,
    "wood": _wooden_crate,
}
