"""Bedrooms and halls of homes: beds, bedside tables, wardrobes, coats. They stand with their backs at x = 0, face x."""

from typing import TYPE_CHECKING

import numpy as np

from vobench.asset.furniture import BLACK, CHROME, DARK, STEEL, Part, cloth, coated, mm, put, stood, wood
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, block, cushion, lathe, sheet, spline, tube
from vobench.scene.mesh import joined, moved, two_sided

if TYPE_CHECKING:
    from trimesh import Trimesh

BED_LENGTH_M = 2.08
RACK_M = 0.5  # of the board of a coat rack above the middle of what hangs on it


def bed(
    rng: Rng,
    width_m: float = 1.6,
    tones: str = "oak",
    linen: str = "#e6e1d6",
    cover: str = "#8a9a7b",
) -> list[Part]:
    """A made bed with its headboard at the wall, pillows, a duvet that hangs over its sides, and a blanket."""
    look = wood(tones)
    w = width_m
    length = BED_LENGTH_M
    head_m = float(rng.choice([0.85, 1.0, 1.15]))
    parts = [stood((0.05, w + 0.06, head_m), look, 0.035, 0, bevel=0.008, u=rng.uniform(0, 2))]
    parts += [
        stood((length - 0.08, 0.03, 0.18), look, length / 2 + 0.02, side * (w / 2 - 0.015), 0.14) for side in (-1, 1)
    ]
    parts.append(stood((0.03, w, 0.18), look, length - 0.03, 0, 0.14))
    legs = [(x, side * (w / 2 - 0.06)) for x in (0.12, length - 0.08) for side in (-1, 1)]
    parts += [stood((0.06, 0.06, 0.15), look, x, y) for x, y in legs]
    mattress = cushion((length - 0.1, w - 0.06, 0.22), power=9, cells=4)
    parts.append(put(mattress, cloth(linen), length / 2 + 0.01, 0, 0.4))

    count = 1 if w < 1.2 else 2
    pillow = cushion((0.42, 0.68 if w > 1.3 else 0.55, 0.16), power=2.8, cells=4)
    for k in range(count):
        y = (k - (count - 1) / 2) * 0.5 * w
        lean = rng.uniform(-24, -14)
        parts.append(put(pillow, cloth(linen), 0.3, y, 0.585, pitch=lean, yaw=rng.normal(0, 4)))
    parts.append(put(_duvet(rng, w), cloth(cover)))
    has_blanket = rng.random() < 0.5
    if has_blanket:
        colour = one_of(rng, "#b4533a", "#d39a3c", "#6b4353", "#27445c", "#d8c3a0")
        parts.append(put(_duvet(rng, w + 0.02, first_m=1.45, last_m=1.95, rise_m=0.014), cloth(colour)))
    return parts


def _duvet(rng: Rng, width_m: float, *, first_m: float = 0.62, last_m: float = 2.07, rise_m: float = 0.0) -> "Trimesh":
    """A quilt over a mattress: it lies on top, and hangs down at both sides."""
    along = np.linspace(first_m, last_m, 15)
    half = width_m / 2
    profile = np.array([-half - 0.035, -half - 0.03, -half + 0.02, -0.6 * half, -0.2 * half, 0.2 * half, 0.6 * half])
    profile = np.append(profile, [half - 0.02, half + 0.03, half + 0.035])
    height = np.array([0.3, 0.42, 0.545, 0.565, 0.57, 0.57, 0.565, 0.545, 0.42, 0.3]) + rise_m
    x, y = np.meshgrid(along, profile, indexing="ij")
    phases = rng.uniform(0, 6, 3)
    folds = 0.008 * np.sin(9 * x + 4 * y + phases[0]) + 0.006 * np.sin(17 * y - 6 * x + phases[1])
    is_edge = (along < first_m + 0.05) | (along > last_m - 0.05)
    z = np.broadcast_to(height, x.shape) + folds - 0.03 * is_edge[:, None]
    hanging = np.abs(y) > half
    y = y + np.where(hanging, 0.012 * np.sin(14 * x + phases[2]) * np.sign(y), 0)
    return two_sided(sheet(np.stack([x, y, z], axis=-1)))


def bedside_table(rng: Rng, width_m: float = 0.45, tones: str = "oak") -> list[Part]:
    """A small cupboard with a drawer above an open shelf, 0.5 m high."""
    look = wood(tones)
    depth_m = 0.38
    x = depth_m / 2
    u = rng.uniform(0, 2)
    knob = cushion((0.024, 0.024, 0.024), power=2, cells=3)
    return [
        stood((depth_m, width_m, 0.022), look, x, 0, 0.478, u=u),
        stood((depth_m, width_m, 0.02), look, x, 0, 0.1, u=u),
        stood((0.012, width_m - 0.03, 0.36), look, 0.008, 0, 0.12, bevel=0),
        *(stood((depth_m - 0.01, 0.02, 0.478), look, x, side * (width_m / 2 - 0.012)) for side in (-1, 1)),
        stood((depth_m - 0.03, width_m - 0.05, 0.15), look, x - 0.005, 0, 0.322, bevel=0),
        stood((0.018, width_m - 0.05, 0.145), look, depth_m - 0.012, 0, 0.325, u=u + 1),
        put(knob, DARK, depth_m + 0.006, 0, 0.4),
    ]


def wardrobe(
    rng: Rng,
    width_m: float = 1.5,
    height_m: float = 2.1,
    colour: str = "",
    tones: str = "oak",
) -> list[Part]:
    """A wardrobe with doors, painted in a colour or of wood."""
    look = coated(colour, roughness=0.35) if colour else wood(tones)
    depth_m = 0.58
    body_m = (depth_m - 0.02, width_m, height_m - 0.06)
    parts = [
        stood(body_m, look, depth_m / 2 - 0.01, 0, 0.06, bevel=0.003),
        stood((depth_m - 0.06, width_m - 0.02, 0.06), DARK, depth_m / 2 - 0.02),
        stood((depth_m + 0.01, width_m + 0.02, 0.03), look, depth_m / 2, 0, height_m - 0.03, bevel=0.004),
    ]
    doors = max(2, round(width_m / 0.48))
    door_m = width_m / doors
    grip = tube(mm("0 0 -90, 28 0 -90, 28 0 90, 0 0 90"), 0.006, sections=6)
    for k in range(doors):
        y = (k + 0.5) * door_m - width_m / 2
        front_m = (0.02, door_m - 0.006, height_m - 0.11)
        parts.append(stood(front_m, look, depth_m - 0.008, y, 0.07, bevel=0.003, u=0.7 * k))
        side = 1 if k % 2 == 0 else -1
        parts.append(put(grip, STEEL, depth_m, y + side * (door_m / 2 - 0.05), 1.05))
    if rng.random() < 0.4:
        box_m = (0.4, 0.5, 0.24)
        parts.append(stood(box_m, cloth(one_of(rng, "#a67d52", "#8a9a7b", "#c9c2b4")), 0.28, 0.2 * width_m, height_m))
    return parts


def armchair(rng: Rng, colour: str = "#8a9a7b", tones: str = "oak") -> list[Part]:
    """An armchair on wooden legs; its middle is at the origin."""
    cover = cloth(colour)
    parts = [
        put(cushion((0.66, 0.6, 0.18), power=6, cells=4), cover, 0.04, 0, 0.36),
        put(cushion((0.16, 0.62, 0.62), power=5, cells=4), cover, -0.3, 0, 0.64, pitch=-12),
    ]
    rest = cushion((0.64, 0.11, 0.3), power=6, cells=4)
    parts += [put(rest, cover, 0.02, side * 0.34, 0.47) for side in (-1, 1)]
    legs = [(x, side * 0.29) for x in (-0.26, 0.28) for side in (-1, 1)]
    parts += [put(lathe(mm("0 0, 14 0, 22 280, 0 280"), sections=10), wood(tones), x, y) for x, y in legs]
    if rng.random() < 0.6:
        accent = cloth(one_of(rng, "#d39a3c", "#b4533a", "#27445c", "#f1ece0"))
        parts.append(put(cushion((0.12, 0.4, 0.38), power=2.8, cells=5), accent, -0.16, 0, 0.62, pitch=-16))
    return parts


def coat_rack(rng: Rng, width_m: float = 0.9, tones: str = "oak") -> list[Part]:
    """A board with hooks and coats on a wall; with the coats, it reaches from -0.65 m to 0.65 m about z = 0."""
    parts = [stood((0.02, width_m, 0.1), wood(tones), 0.011, 0, RACK_M - 0.05, bevel=0.004)]
    count = max(3, round(width_m / 0.18))
    hook = tube(spline(mm("15 0 20, 60 0 10, 70 0 40"), 6), 0.006, sections=6)
    hooks_y = (np.arange(count) + 0.5) * width_m / count - width_m / 2
    parts.append(put(joined([moved(hook, at(0, y, RACK_M)) for y in hooks_y.tolist()]), CHROME))
    for k, y in enumerate(hooks_y.tolist()):
        if k % 2 == 0 and rng.random() < 0.8:
            parts.append(
                put(_coat(rng), cloth(one_of(rng, "#27445c", "#3a3c3e", "#6b4353", "#6a6a4c", "#8f6b4d")), 0, y, RACK_M)
            )
    return parts


def _coat(rng: Rng) -> "Trimesh":
    """A coat on a hook: a closed surface in folds, narrow at its collar."""
    length_m = rng.uniform(0.75, 1.05)
    down = np.linspace(0, 1, 6)[:, None]
    angle = np.linspace(0, 2 * np.pi, 19)[None]
    spread = 0.35 + 0.65 * np.minimum(1, 3.2 * down)
    folds = 1 + 0.16 * down * np.sin(5 * angle + rng.uniform(0, 6))
    x = 0.085 + 0.062 * spread * folds * np.cos(angle)
    y = 0.155 * spread * folds * np.sin(angle)
    z = 0.02 - length_m * down + 0 * angle
    coat = sheet(np.stack([x, y, z], axis=-1))
    return two_sided(coat)


def shoe_cabinet(rng: Rng, width_m: float = 0.9, colour: str = "#dcdbd6") -> list[Part]:
    """A narrow cupboard with two tilting fronts, 0.28 m deep and 0.85 m high."""
    paint = coated(colour, roughness=0.35)
    depth_m = 0.26
    body_m = (depth_m, width_m, 0.85)
    slot = stood((0.012, 0.14, 0.02), BLACK, depth_m + 0.008, 0, 0, bevel=0.002)
    parts = [stood(body_m, paint, depth_m / 2, 0, bevel=0.004)]
    parts.append(
        stood((depth_m + 0.03, width_m + 0.01, 0.02), wood("oak"), depth_m / 2 + 0.01, 0, 0.85, u=rng.uniform(0, 2))
    )
    for z in (0.05, 0.445):
        parts.append(stood((0.018, width_m - 0.02, 0.385), paint, depth_m + 0.002, 0, z, bevel=0.003))
        parts.append(slot.moved(at(0, 0, z + 0.34)))
    return parts


def shoes(rng: Rng) -> list[Part]:
    """A pair of shoes."""
    colour = one_of(rng, "#2b2622", "#5a3a26", "#c9c5bb", "#3a4a5a")
    upper = cushion((0.27, 0.1, 0.1), power=3.0, cells=4)
    sole = block((0.28, 0.1, 0.02), bevel_m=0.008)
    parts = []
    for side in (-1, 1):
        y = 0.065 * side
        turn = rng.normal(0, 7)
        parts.append(put(upper, coated(colour, roughness=0.4), 0.14, y, 0.055, yaw=turn))
        parts.append(put(sole, BLACK, 0.14, y, 0.011, yaw=turn))
    return parts
