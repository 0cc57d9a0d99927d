"""The equipment of warehouses: forklifts, pallet trucks and roller doors. They stand on z = 0."""

from vobench.asset import picture
from vobench.asset.furniture import BLACK, DARK, SIDES, STEEL, Part, coated, matt, mm, put, stood
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays, lathe, tube
from vobench.scene.mesh_arrays import joined_arrays

YELLOW = coated("#d8a614", roughness=0.4)
FORKLIFT_PAINTS = ("#d8a614", "#c9652a", "#8d1f1c", "#3f6c87")
FORKLIFT_WHEEL_M = 0.25  # radius
TRUCK_ROLL_M = 0.04  # radius of the rolls of a pallet truck
DOOR_SLATS = 32  # of a roller door
DOOR_SLAT_M = 0.12  # height


def forklift(rng: Rng) -> list[Part]:
    """A forklift that faces x, with its forks on the ground."""
    paint = coated(one_of(rng, *FORKLIFT_PAINTS), roughness=0.25)
    body = stood((1.5, 1.0, 0.55), paint, -0.35, z=0.2, bevel=0.06)
    counterweight = stood((0.55, 1.0, 0.45), paint, -0.85, z=0.7, bevel=0.08)
    seat = stood((0.5, 0.55, 0.12), BLACK, -0.3, z=0.75, bevel=0.03)
    backrest = stood((0.1, 0.5, 0.5), BLACK, -0.54, z=0.85, bevel=0.03)
    roof = stood((1.25, 1.0, 0.06), DARK, -0.35, z=2.05, bevel=0.01)
    parts = [body, counterweight, seat, backrest, roof]

    post_m = (0.06, 0.06, 1.3)  # of the roof
    for x in (-0.9, 0.2):
        for side in SIDES:
            y = side * 0.45
            parts.append(stood(post_m, DARK, x, y, 0.75))
    mast_m = (0.1, 0.08, 2.1)
    fork_m = (1.1, 0.12, 0.04)
    carriage = stood((0.05, 0.9, 0.45), DARK, 0.58, z=0.12)
    parts += [stood(mast_m, DARK, 0.5, side * 0.3, 0.05) for side in SIDES]
    parts.append(carriage)
    parts += [stood(fork_m, STEEL, 1.12, side * 0.22, bevel=0.01) for side in SIDES]

    tyre = lathe(mm("0 -90, 230 -90, 250 -70, 250 70, 230 90, 0 90"), sections=16)
    hub = lathe(mm("0 -96, 120 -96, 120 96, 0 96"), sections=12)
    for x in (-0.85, 0.2):
        for side in SIDES:
            y = side * 0.46
            parts.append(put(tyre, BLACK, x, y, FORKLIFT_WHEEL_M, roll=90))
            parts.append(put(hub, STEEL, x, y, FORKLIFT_WHEEL_M, roll=90))
    steering_wheel = lathe(mm("0 0, 180 0, 190 10, 180 20, 0 20"), sections=16)
    parts.append(put(steering_wheel, BLACK, 0.15, z=1.15, pitch=-60))
    return parts


def pallet_truck(_: Rng) -> list[Part]:
    """A hand truck: two forks on rolls, a pump and a tiller."""
    fork_m = (1.15, 0.16, 0.05)
    parts = [stood(fork_m, YELLOW, 0.1, side * 0.19, 0.07, bevel=0.012) for side in SIDES]
    roll = lathe(mm("0 -35, 38 -35, 40 -30, 40 30, 38 35, 0 35"), sections=12)
    for x in (0.55, -0.5):
        for side in SIDES:
            y = side * 0.19
            parts.append(put(roll, BLACK, x, y, TRUCK_ROLL_M, roll=90))

    body = stood((0.2, 0.54, 0.34), YELLOW, -0.52, z=0.1, bevel=0.02)
    pump = lathe(mm("0 0, 60 0, 60 340, 40 360, 0 360"), sections=12)
    tiller = tube([[-0.6, 0, 0.6], [-0.42, 0, 1.18]], 0.018)
    handle = tube([[-0.42, -0.12, 1.18], [-0.42, 0.12, 1.18]], 0.015)
    return [
        *parts,
        body,
        put(pump, DARK, -0.6, z=0.3),
        put(tiller, DARK),
        put(handle, BLACK),
    ]


def roller_door(_: Rng, number: int, width_m: float = 3.6) -> list[Part]:
    """A closed roller door with guides on a wall at x = 0 that faces x, and a plate with its number over it."""
    slat = block_arrays((0.04, width_m, DOOR_SLAT_M - 0.002), bevel_m=0.01)
    slats = [slat.moved(at(0.02, 0, 0.06 + DOOR_SLAT_M * index)) for index in range(DOOR_SLATS)]
    parts = [Part(joined_arrays(slats), coated("#b9bfc2", roughness=0.35))]

    half_m = width_m / 2
    guide_m = (0.16, 0.14, 4.0)
    bumper_m = (0.03, 0.12, 1.1)
    housing_m = (0.42, width_m + 0.5, 0.42)
    parts += [stood(guide_m, DARK, 0.08, side * (half_m + 0.08)) for side in SIDES]
    parts += [stood(bumper_m, YELLOW, 0.02, side * (half_m + 0.24)) for side in SIDES]
    parts.append(stood(housing_m, DARK, 0.21, z=3.85))
    plate = matt(texture=picture.sign(f"DOCK {number}"))
    parts.append(put(card_arrays((1.0, 0.5)), plate, 0.43, z=4.06))
    return parts
