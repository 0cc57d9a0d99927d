"""What is in a warehouse: pallets with loads of many kinds, racks, a forklift and a hand truck. They stand on z = 0."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from vobench.asset import furniture, picture
from vobench.asset.furniture import BLACK, DARK, STEEL, Part, coated, matt, mm, put, stood
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays, cushion, lathe, tube
from vobench.scene.material import Material
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

PALLET_M = (1.2, 0.8, 0.144)
CARTONS = 5  # pictures of cartons
CARTON_GRIDS = ((3, 2), (2, 2), (4, 2), (2, 1))  # columns and rows on a pallet
CARTON_TINTS = ("#ffffff", "#f3ead9", "#e5e9ea", "#fff3dc", "#e9d8c2")
CRATE_M = 0.26  # height
CRATE_COLOURS = ("#27445c", "#8d1f1c", "#3d7a7c", "#5d6468", "#c8a23a", "#2f4a36")
YELLOW = coated("#d8a614", roughness=0.4)


def pallet() -> list[Part]:
    """A pallet of planks."""
    plank = matt(texture=picture.boards("beech", 9, rows=6))
    length_m, width_m, high_m = PALLET_M
    boards = []
    for y_m in (-0.35, 0.0, 0.35):
        foot = block_arrays((length_m, 0.1, 0.1), bevel_m=0, uv_m=(y_m, y_m))
        boards.append(foot.moved(at(0, y_m, 0.05)))
    for x_m in (-0.53, 0.0, 0.53):
        crosspiece = block_arrays((0.14, width_m, 0.022), bevel_m=0, uv_m=(x_m, x_m))
        boards.append(crosspiece.moved(at(x_m, 0, 0.111)))
    for y_m in (-0.33, -0.165, 0.0, 0.165, 0.33):
        deck_board = block_arrays((length_m, 0.12, 0.022), bevel_m=0, uv_m=(3 * y_m, y_m))
        boards.append(deck_board.moved(at(0, y_m, high_m - 0.011)))
    return [Part(joined_arrays(boards), plank)]


def load(rng: Rng, high_m: float) -> list[Part]:
    """A pallet with goods, no higher than a height."""
    choice = one_of(rng, *("cartons",) * 5, "wrapped", "wrapped", "drums", "sacks", "crates", "wood")
    goods = LOADS[choice](rng, high_m - PALLET_M[2])
    return [*pallet(), *(part.moved(at(z_m=PALLET_M[2])) for part in goods)]


def _cartons(rng: Rng, high_m: float) -> list[Part]:
    """Cartons of one size in layers, of which some of the uppermost are gone."""
    columns, rows = CARTON_GRIDS[int(rng.integers(len(CARTON_GRIDS)))]
    length_m = 1.18 / columns
    width_m = 0.78 / rows
    layer_m = float(rng.uniform(0.22, 0.46))
    most_layers = max(1, min(int(high_m / layer_m), 5))
    layers = int(rng.integers(max(1, most_layers - 1), most_layers + 1))
    is_open = rng.random() < 0.5
    middle_m = max(length_m, width_m, layer_m) / 2  # of the picture
    size_m = (length_m - 0.012, width_m - 0.012, layer_m - 0.002)
    carton = block_arrays(size_m, bevel_m=0, uv_m=(middle_m, middle_m), upright=True)
    boxes = []
    for layer, column, row in np.ndindex(layers, columns, rows):
        may_be_gone = is_open and layers > 1 and layer == layers - 1
        if may_be_gone and rng.random() < 0.4:
            continue
        x_m = (column - (columns - 1) / 2) * length_m
        y_m = (row - (rows - 1) / 2) * width_m
        z_m = (layer + 0.5) * layer_m - 0.001 * (layer == 0)
        half_turn_deg = 180.0 * int(rng.integers(2))
        skew_deg = float(np.clip(rng.normal(0, 0.4), -0.8, 0.8))
        boxes.append(carton.moved(at(x_m, y_m, z_m, yaw=half_turn_deg + skew_deg)))
    look = picture.carton(int(rng.integers(CARTONS)), 0.5)
    return [Part(joined_arrays(boxes), matt(one_of(rng, *CARTON_TINTS), look))]


def _wrapped(rng: Rng, high_m: float) -> list[Part]:
    """A block wrapped in film, with a label."""
    z_m = float(rng.uniform(0.6, 1.0)) * high_m
    film = coated(one_of(rng, "#c9cdd0", "#dcdcd6", "#3b3f42", "#b7b09e"), picture.fabric(1), roughness=0.16)
    body = block_arrays((1.14, 0.76, z_m), bevel_m=0.04).moved(at(z_m=z_m / 2))
    label = matt(texture=picture.sign(f"{rng.integers(1000, 9999)}"))
    sides = [put(card_arrays((0.3, 0.15)), label, 0, side * 0.386, 0.6 * z_m, yaw=90.0 * side) for side in (-1, 1)]
    return [Part(body, film), *sides]


def _drums(rng: Rng, high_m: float) -> list[Part]:
    """Steel drums."""
    z_m = min(0.86, high_m)
    profile = np.array(
        [[0, 0], [0.28, 0], [0.29, 0.02], [0.28, 0.33], [0.29, 0.35], [0.28, 0.66], [0.29, 1.0], [0, 1.0]]
    )
    drum = lathe(profile * [1, z_m], sections=16)
    paint = coated(one_of(rng, "#27445c", "#b4533a", "#3d7a7c", "#2f4a36", "#5d6468"), roughness=0.25)
    return [put(drum, paint, x, 0, 0, yaw=float(rng.uniform(0, 90))) for x in (-0.3, 0.3)]


def _sacks(rng: Rng, high_m: float) -> list[Part]:
    """Sacks in layers that lie crosswise."""
    z_m = 0.15
    layers = max(1, min(int(high_m / z_m) - 1, 5))
    sack = as_arrays(cushion((0.39, 0.76, z_m + 0.03), power=4, cells=4))
    sacks = []
    for layer in range(layers):
        for column in (-1, 0, 1):
            middle_z_m = (layer + 0.5) * z_m + 0.015
            sacks.append(sack.moved(at(0.39 * column, 0, middle_z_m, yaw=float(rng.normal(0, 1)))))
    fabric = matt(one_of(rng, "#d9d4c8", "#c9b79a", "#e6e3da"), picture.fabric(2))
    return [Part(joined_arrays(sacks), fabric)]


def _crates(rng: Rng, high_m: float) -> list[Part]:
    """Plastic crates in stacks of unlike height."""
    colour = one_of(rng, *CRATE_COLOURS)
    body = block_arrays((0.57, 0.37, 0.22), bevel_m=0)
    rim = block_arrays((0.595, 0.395, 0.04), bevel_m=0)
    most_levels = max(2, int(high_m / CRATE_M))
    crates = []
    for x_m, y_m in product((-0.3, 0.3), (-0.2, 0.2)):
        for level in range(int(rng.integers(1, most_levels + 1))):
            if (level + 1) * CRATE_M > high_m:
                break
            crates.append(body.moved(at(x_m, y_m, level * CRATE_M + 0.11)))
            crates.append(rim.moved(at(x_m, y_m, level * CRATE_M + 0.24)))
    return [Part(joined_arrays(crates), coated(colour, roughness=0.3))]


def _wood(rng: Rng, high_m: float) -> list[Part]:
    """A wooden crate."""
    return furniture.crate(rng, (1.1, 0.75, min(0.9, high_m)))


LOADS: dict[str, Callable[[Rng, float], list[Part]]] = {
    "cartons": _cartons,
    "wrapped": _wrapped,
    "drums": _drums,
    "sacks": _sacks,
    "crates": _crates,
    "wood": _wood,
}


# --- Racks ---


@dataclass(frozen=True, slots=True)
class Rack:
    """A row of pallet racks along x, centred at the origin: number and length of bays, depth, and heights of decks."""

    bays: int
    bay_m: float
    depth_m: float
    levels_m: tuple[float, ...]
    upright: Material
    beam: Material

    @property
    def pitch_m(self) -> float:
        """The distance between uprights."""
        return self.bay_m + 0.1

    @property
    def length_m(self) -> float:
        """The length of the row."""
        return self.bays * self.pitch_m + 0.1

    def bay_x_m(self, bay: int) -> float:
        """The middle of a bay."""
        return (bay - (self.bays - 1) / 2) * self.pitch_m

    def parts(self) -> list[Part]:
        """Uprights with braces, beams and decks."""
        high_m = self.levels_m[-1] + 1.3
        post = block_arrays((0.08, 0.1, high_m), bevel_m=0).moved(at(z_m=high_m / 2))
        uprights: list[MeshArrays] = []
        braces: list[MeshArrays] = []
        beams: list[MeshArrays] = []
        decks: list[MeshArrays] = []
        half_m = self.depth_m / 2
        for k in range(self.bays + 1):
            x = (k - self.bays / 2) * self.pitch_m
            uprights += [post.moved(at(x, side * half_m)) for side in (-1, 1)]
            steps = np.arange(0.3, high_m - 0.9, 0.85).tolist()
            braces += [as_arrays(tube([[x, -half_m, z], [x, half_m, z + 0.85]], 0.016, sections=4)) for z in steps]
        beam = block_arrays((self.bay_m, 0.05, 0.12), bevel_m=0)
        slat = block_arrays((0.1, self.depth_m - 0.06, 0.02), bevel_m=0)
        for bay in range(self.bays):
            for z in self.levels_m:
                x = self.bay_x_m(bay)
                beams += [beam.moved(at(x, side * half_m, z - 0.06)) for side in (-1, 1)]
                slats = np.linspace(-self.bay_m / 2 + 0.1, self.bay_m / 2 - 0.1, 10).tolist()
                decks += [slat.moved(at(x + along, 0, z - 0.011)) for along in slats]
        return [
            Part(joined_arrays([*uprights, *braces]), self.upright),
            Part(joined_arrays(beams), self.beam),
            Part(joined_arrays(decks), STEEL),
        ]


# --- Machines ---


def forklift(rng: Rng) -> list[Part]:
    """A forklift that faces x, with its forks on the ground."""
    paint = coated(one_of(rng, "#d8a614", "#c9652a", "#8d1f1c", "#3f6c87"), roughness=0.25)
    wheel = lathe(mm("0 -90, 230 -90, 250 -70, 250 70, 230 90, 0 90"), sections=16)
    hub = lathe(mm("0 -96, 120 -96, 120 96, 0 96"), sections=12)
    parts = [
        stood((1.5, 1.0, 0.55), paint, -0.35, 0, 0.2, bevel=0.06),
        stood((0.55, 1.0, 0.45), paint, -0.85, 0, 0.7, bevel=0.08),
        stood((0.5, 0.55, 0.12), BLACK, -0.3, 0, 0.75, bevel=0.03),
        stood((0.1, 0.5, 0.5), BLACK, -0.54, 0, 0.85, bevel=0.03),
        stood((1.25, 1.0, 0.06), DARK, -0.35, 0, 2.05, bevel=0.01),
    ]
    parts += [stood((0.06, 0.06, 1.3), DARK, x, side * 0.45, 0.75) for x in (-0.9, 0.2) for side in (-1, 1)]
    parts += [stood((0.1, 0.08, 2.1), DARK, 0.5, side * 0.3, 0.05) for side in (-1, 1)]
    parts += [stood((0.05, 0.9, 0.45), DARK, 0.58, 0, 0.12)]
    parts += [stood((1.1, 0.12, 0.04), STEEL, 1.12, side * 0.22, 0.0, bevel=0.01) for side in (-1, 1)]
    for x in (-0.85, 0.2):
        for side in (-1, 1):
            parts.append(put(wheel, BLACK, x, side * 0.46, 0.25, roll=90))
            parts.append(put(hub, STEEL, x, side * 0.46, 0.25, roll=90))
    parts.append(put(lathe(mm("0 0, 180 0, 190 10, 180 20, 0 20"), sections=16), BLACK, 0.15, 0, 1.15, pitch=-60))
    return parts


def pallet_truck(_: Rng) -> list[Part]:
    """A hand truck: two forks, a pump and a tiller."""
    roll = lathe(mm("0 -35, 38 -35, 40 -30, 40 30, 38 35, 0 35"), sections=12)
    parts = [stood((1.15, 0.16, 0.05), YELLOW, 0.1, side * 0.19, 0.07, bevel=0.012) for side in (-1, 1)]
    parts += [put(roll, BLACK, x, side * 0.19, 0.04, roll=90) for x in (0.55, -0.5) for side in (-1, 1)]
    return [
        *parts,
        stood((0.2, 0.54, 0.34), YELLOW, -0.52, 0, 0.1, bevel=0.02),
        put(lathe(mm("0 0, 60 0, 60 340, 40 360, 0 360"), sections=12), DARK, -0.6, 0, 0.3),
        put(tube([[-0.6, 0, 0.6], [-0.42, 0, 1.18]], 0.018), DARK),
        put(tube([[-0.42, -0.12, 1.18], [-0.42, 0.12, 1.18]], 0.015), BLACK),
    ]


def roller_door(_: Rng, number: int, width_m: float = 3.6) -> list[Part]:
    """A closed roller door with guides on a wall at x = 0 that faces x, and a plate with its number over it."""
    slat = block_arrays((0.04, width_m, 0.118), bevel_m=0.01)
    slats = joined_arrays([slat.moved(at(0.02, 0, 0.06 + 0.12 * k)) for k in range(32)])
    half_m = width_m / 2
    plate = matt(texture=picture.sign(f"DOCK {number}"))
    parts = [Part(slats, coated("#b9bfc2", roughness=0.35))]
    parts += [stood((0.16, 0.14, 4.0), DARK, 0.08, side * (half_m + 0.08)) for side in (-1, 1)]
    parts += [stood((0.03, 0.12, 1.1), YELLOW, 0.02, side * (half_m + 0.24)) for side in (-1, 1)]
    parts += [stood((0.42, width_m + 0.5, 0.42), DARK, 0.21, 0, 3.85)]
    parts.append(put(card_arrays((1.0, 0.5)), plate, 0.43, 0, 4.06))
    return parts
