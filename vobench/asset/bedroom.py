"""Furniture of bedrooms and halls, such as beds and wardrobes.

The back of a piece that stands at a wall is at x = 0, and its front faces x. The floor is at z = 0, except for pieces
that hang on a wall. Sizes of boxes are (depth, width, height).
"""

from typing import TYPE_CHECKING

import numpy as np

from vobench.asset.furniture import BLACK, CHROME, DARK, SIDES, STEEL, Part, cloth, coated, mm, put, stood, wood
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, block, cushion, lathe, sheet, spline, tube
from vobench.scene.material import Material
from vobench.scene.mesh import joined, moved, two_sided

if TYPE_CHECKING:
    from trimesh import Trimesh

BED_LENGTH_M = 2.08
MATTRESS_CENTER_M = 0.4  # the height of the centre of the mattress
MIN_WIDTH_FOR_TWO_PILLOWS_M = 1.2  # narrower beds have one pillow
MIN_WIDTH_FOR_WIDE_PILLOWS_M = 1.3
PILLOW_X_M = 0.3  # the distance from the wall to the centre of a pillow
PILLOW_HEIGHT_M = 0.585  # the height of the centre of a pillow
PILLOW_LEAN_DEG = (-24, -14)  # the range of the pitch of a pillow
BLANKET_COLOURS = ("#b4533a", "#d39a3c", "#6b4353", "#27445c", "#d8c3a0")
BEDSIDE_DEPTH_M = 0.38
WARDROBE_DEPTH_M = 0.58
PLINTH_M = 0.06  # the height of the plinth of a wardrobe
DOOR_WIDTH_M = 0.48  # the approximate width of a door of a wardrobe
BOX_COLOURS = ("#a67d52", "#8a9a7b", "#c9c2b4")
ACCENT_COLOURS = ("#d39a3c", "#b4533a", "#27445c", "#f1ece0")
HOOK_HEIGHT_M = 0.5  # the height of the board and the hooks of a coat rack above its origin
HOOK_SPACING_M = 0.18  # the approximate distance between the hooks
COAT_COLOURS = ("#27445c", "#3a3c3e", "#6b4353", "#6a6a4c", "#8f6b4d")
SHOE_CABINET_DEPTH_M = 0.26
SHOE_COLOURS = ("#2b2622", "#5a3a26", "#c9c5bb", "#3a4a5a")


def bed(
    rng: Rng,
    width_m: float = 1.6,
    tones: str = "oak",
    linen: str = "#e6e1d6",
    cover: str = "#8a9a7b",
) -> list[Part]:
    """A bed with its headboard at the wall, pillows, a duvet that hangs over the sides and, on some beds, a blanket."""
    parts = _bed_frame(rng, width_m, wood(tones))
    mattress = cushion((BED_LENGTH_M - 0.1, width_m - 0.06, 0.22), power=9, cells=4)
    parts.append(put(mattress, cloth(linen), x=BED_LENGTH_M / 2 + 0.01, z=MATTRESS_CENTER_M))
    parts += _pillows(rng, width_m, cloth(linen))
    parts.append(put(_quilt(rng, width_m), cloth(cover)))

    has_blanket = rng.random() < 0.5
    if has_blanket:
        colour = one_of(rng, *BLANKET_COLOURS)
        blanket = _quilt(rng, width_m + 0.02, first_m=1.45, last_m=1.95, rise_m=0.014)
        parts.append(put(blanket, cloth(colour)))
    return parts


def _bed_frame(rng: Rng, width_m: float, look: Material) -> list[Part]:
    """The headboard, two side boards, the footboard and four legs."""
    head_height_m = float(rng.choice([0.85, 1.0, 1.15]))
    head_m = (0.05, width_m + 0.06, head_height_m)
    side_m = (BED_LENGTH_M - 0.08, 0.03, 0.18)
    foot_m = (0.03, width_m, 0.18)
    leg_m = (0.06, 0.06, 0.15)

    parts = [stood(head_m, look, x=0.035, bevel=0.008, u=rng.uniform(0, 2))]
    for side in SIDES:
        y = side * (width_m / 2 - 0.015)
        parts.append(stood(side_m, look, BED_LENGTH_M / 2 + 0.02, y, 0.14))
    parts.append(stood(foot_m, look, x=BED_LENGTH_M - 0.03, z=0.14))
    for x in (0.12, BED_LENGTH_M - 0.08):
        for side in SIDES:
            y = side * (width_m / 2 - 0.06)
            parts.append(stood(leg_m, look, x, y))
    return parts


def _pillows(rng: Rng, width_m: float, linen: Material) -> list[Part]:
    """Two pillows side by side, or one on a narrow bed. They lean against the headboard."""
    count = 1 if width_m < MIN_WIDTH_FOR_TWO_PILLOWS_M else 2
    pillow_width_m = 0.68 if width_m > MIN_WIDTH_FOR_WIDE_PILLOWS_M else 0.55
    pillow = cushion((0.42, pillow_width_m, 0.16), power=2.8, cells=4)
    parts = []
    for index in range(count):
        offset_in_pillows = index - (count - 1) / 2
        y = offset_in_pillows * 0.5 * width_m
        lean_deg = rng.uniform(*PILLOW_LEAN_DEG)
        yaw_deg = rng.normal(0, 4)
        parts.append(put(pillow, linen, x=PILLOW_X_M, y=y, z=PILLOW_HEIGHT_M, pitch=lean_deg, yaw=yaw_deg))
    return parts


def _quilt(rng: Rng, width_m: float, *, first_m: float = 0.62, last_m: float = 2.07, rise_m: float = 0.0) -> "Trimesh":
    """A duvet or blanket that lies on a mattress and hangs down at both sides.

    `first_m` is the x at which it starts.
    `last_m` is the x at which it ends.
    `rise_m` is its height above a quilt that lies directly on the mattress.
    """
    # The profile across one half of the bed: two points on the mattress, two at its rounded edge, and the hem, which
    # hangs down. The other half mirrors it.
    half_m = width_m / 2
    half_across_m = np.array([0.2 * half_m, 0.6 * half_m, half_m - 0.02, half_m + 0.03, half_m + 0.035])
    half_height_m = np.array([0.57, 0.565, 0.545, 0.42, 0.3])
    across_m = np.concatenate([-half_across_m[::-1], half_across_m])
    height_m = np.concatenate([half_height_m[::-1], half_height_m]) + rise_m
    along_m = np.linspace(first_m, last_m, 15)
    x_m, y_m = np.meshgrid(along_m, across_m, indexing="ij")

    # Two waves make the folds, and both ends are lower than the rest.
    phases_rad = rng.uniform(0, 6, 3)
    long_fold_m = 0.008 * np.sin(9 * x_m + 4 * y_m + phases_rad[0])
    short_fold_m = 0.006 * np.sin(17 * y_m - 6 * x_m + phases_rad[1])
    is_end = (along_m < first_m + 0.05) | (along_m > last_m - 0.05)
    end_drop_m = 0.03 * is_end
    fold_m = long_fold_m + short_fold_m
    z_m = np.broadcast_to(height_m, x_m.shape) + fold_m - end_drop_m[:, None]

    # The parts that hang down at the sides wave towards the bed and away from it.
    is_hanging = np.abs(y_m) > half_m
    wave_m = 0.012 * np.sin(14 * x_m + phases_rad[2]) * np.sign(y_m)
    waved_y_m = y_m + np.where(is_hanging, wave_m, 0)
    return two_sided(sheet(np.stack([x_m, waved_y_m, z_m], axis=-1)))


def bedside_table(rng: Rng, width_m: float = 0.45, tones: str = "oak") -> list[Part]:
    """A small cupboard that is 0.5 m high, with a drawer above an open shelf."""
    look = wood(tones)
    depth_m = BEDSIDE_DEPTH_M
    middle_x = depth_m / 2
    u = rng.uniform(0, 2)

    top = stood((depth_m, width_m, 0.022), look, middle_x, z=0.478, u=u)
    shelf = stood((depth_m, width_m, 0.02), look, middle_x, z=0.1, u=u)
    back = stood((0.012, width_m - 0.03, 0.36), look, 0.008, z=0.12, bevel=0)
    side_m = (depth_m - 0.01, 0.02, 0.478)
    side_y = width_m / 2 - 0.012
    sides = [stood(side_m, look, middle_x, side * side_y) for side in SIDES]
    drawer = stood((depth_m - 0.03, width_m - 0.05, 0.15), look, middle_x - 0.005, z=0.322, bevel=0)
    front = stood((0.018, width_m - 0.05, 0.145), look, depth_m - 0.012, z=0.325, u=u + 1)
    knob = cushion((0.024, 0.024, 0.024), power=2, cells=3)
    return [top, shelf, back, *sides, drawer, front, put(knob, DARK, depth_m + 0.006, z=0.4)]


def wardrobe(
    rng: Rng,
    width_m: float = 1.5,
    height_m: float = 2.1,
    colour: str = "",
    tones: str = "oak",
) -> list[Part]:
    """A wardrobe with doors, and on some wardrobes a box on top.

    `colour` is the colour of the paint; if it is empty, the wardrobe is made of wood.
    `tones` are the tones of the wood.
    """
    look = coated(colour, roughness=0.35) if colour else wood(tones)
    depth_m = WARDROBE_DEPTH_M
    body_m = (depth_m - 0.02, width_m, height_m - PLINTH_M)
    plinth_m = (depth_m - 0.06, width_m - 0.02, PLINTH_M)
    cornice_m = (depth_m + 0.01, width_m + 0.02, 0.03)
    parts = [
        stood(body_m, look, depth_m / 2 - 0.01, z=PLINTH_M, bevel=0.003),
        stood(plinth_m, DARK, depth_m / 2 - 0.02),
        stood(cornice_m, look, depth_m / 2, z=height_m - 0.03, bevel=0.004),
    ]

    door_count = max(2, round(width_m / DOOR_WIDTH_M))
    door_m = width_m / door_count
    front_m = (0.02, door_m - 0.006, height_m - 0.11)
    handle = tube(mm("0 0 -90, 28 0 -90, 28 0 90, 0 0 90"), 0.006, sections=6)
    for index in range(door_count):
        y = (index + 0.5) * door_m - width_m / 2  # the middle of the door
        parts.append(stood(front_m, look, depth_m - 0.008, y, 0.07, bevel=0.003, u=0.7 * index))
        # Doors open in pairs, so that the handles of both doors of a pair are next to each other.
        handle_side = 1 if index % 2 == 0 else -1
        handle_y = y + handle_side * (door_m / 2 - 0.05)
        parts.append(put(handle, STEEL, depth_m, handle_y, 1.05))

    has_box = rng.random() < 0.4
    if has_box:
        box_m = (0.4, 0.5, 0.24)
        box_colour = one_of(rng, *BOX_COLOURS)
        parts.append(stood(box_m, cloth(box_colour), 0.28, 0.2 * width_m, height_m))
    return parts


def armchair(rng: Rng, colour: str = "#8a9a7b", tones: str = "oak") -> list[Part]:
    """An armchair on wooden legs, in most cases with a cushion. It is centred at the origin."""
    cover = cloth(colour)
    seat = cushion((0.66, 0.6, 0.18), power=6, cells=4)
    back = cushion((0.16, 0.62, 0.62), power=5, cells=4)
    parts = [put(seat, cover, 0.04, z=0.36), put(back, cover, -0.3, z=0.64, pitch=-12)]

    arm_rest = cushion((0.64, 0.11, 0.3), power=6, cells=4)
    parts += [put(arm_rest, cover, 0.02, side * 0.34, 0.47) for side in SIDES]
    leg = lathe(mm("0 0, 14 0, 22 280, 0 280"), sections=10)
    for x in (-0.26, 0.28):
        for side in SIDES:
            parts.append(put(leg, wood(tones), x, side * 0.29))

    has_cushion = rng.random() < 0.6
    if has_cushion:
        accent = cloth(one_of(rng, *ACCENT_COLOURS))
        small = cushion((0.12, 0.4, 0.38), power=2.8, cells=5)
        parts.append(put(small, accent, -0.16, z=0.62, pitch=-16))
    return parts


def coat_rack(rng: Rng, width_m: float = 0.9, tones: str = "oak") -> list[Part]:
    """A board on a wall with hooks and coats. Together they reach from z = -0.65 m to z = 0.65 m."""
    board = stood((0.02, width_m, 0.1), wood(tones), 0.011, z=HOOK_HEIGHT_M - 0.05, bevel=0.004)

    hook_count = max(3, round(width_m / HOOK_SPACING_M))
    hooks_y = (np.arange(hook_count) + 0.5) * width_m / hook_count - width_m / 2  # evenly spaced
    hook = tube(spline(mm("15 0 20, 60 0 10, 70 0 40"), 6), 0.006, sections=6)
    hooks = [moved(hook, at(0, y, HOOK_HEIGHT_M)) for y in hooks_y.tolist()]

    parts = [board, put(joined(hooks), CHROME)]
    for y in hooks_y[::2].tolist():
        is_used = rng.random() < 0.8
        if is_used:
            coat = _coat(rng)
            colour = one_of(rng, *COAT_COLOURS)
            parts.append(put(coat, cloth(colour), 0, y, HOOK_HEIGHT_M))
    return parts


def _coat(rng: Rng) -> "Trimesh":
    """A coat on a hook: a surface with folds, which is closed around and narrow at the collar."""
    length_m = rng.uniform(0.75, 1.05)
    down = np.linspace(0, 1, 6)[:, None]  # from the collar to the hem
    angle_rad = np.linspace(0, 2 * np.pi, 19)[None]
    width_share = 0.35 + 0.65 * np.minimum(1, 3.2 * down)  # the full width is reached below the shoulders
    phase_rad = rng.uniform(0, 6)
    folds = 1 + 0.16 * down * np.sin(5 * angle_rad + phase_rad)
    x_m = 0.085 + 0.062 * width_share * folds * np.cos(angle_rad)
    y_m = 0.155 * width_share * folds * np.sin(angle_rad)
    z_m = np.broadcast_to(0.02 - length_m * down, x_m.shape)
    return two_sided(sheet(np.stack([x_m, y_m, z_m], axis=-1)))


def shoe_cabinet(rng: Rng, width_m: float = 0.9, colour: str = "#dcdbd6") -> list[Part]:
    """A narrow cupboard with two tilting fronts. It is 0.26 m deep and 0.85 m high."""
    paint = coated(colour, roughness=0.35)
    depth_m = SHOE_CABINET_DEPTH_M
    body_m = (depth_m, width_m, 0.85)
    top_m = (depth_m + 0.03, width_m + 0.01, 0.02)
    front_m = (0.018, width_m - 0.02, 0.385)
    slot_m = (0.012, 0.14, 0.02)
    parts = [
        stood(body_m, paint, depth_m / 2, bevel=0.004),
        stood(top_m, wood("oak"), depth_m / 2 + 0.01, z=0.85, u=rng.uniform(0, 2)),
    ]
    slot = stood(slot_m, BLACK, depth_m + 0.008, bevel=0.002)
    for z in (0.05, 0.445):
        parts.append(stood(front_m, paint, depth_m + 0.002, z=z, bevel=0.003))
        parts.append(slot.moved(at(z_m=z + 0.34)))  # the slot is the handle of the front
    return parts


def shoes(rng: Rng) -> list[Part]:
    """A pair of shoes."""
    colour = one_of(rng, *SHOE_COLOURS)
    leather = coated(colour, roughness=0.4)
    upper = cushion((0.27, 0.1, 0.1), power=3.0, cells=4)
    sole = block((0.28, 0.1, 0.02), bevel_m=0.008)
    parts = []
    for side in SIDES:
        y = 0.065 * side
        yaw_deg = rng.normal(0, 7)
        parts.append(put(upper, leather, 0.14, y, 0.055, yaw=yaw_deg))
        parts.append(put(sole, BLACK, 0.14, y, 0.011, yaw=yaw_deg))
    return parts
