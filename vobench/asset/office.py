"""Furniture of offices with few faces: chairs, screens between desks, laptops, copiers, panes between rooms."""

import numpy as np

from vobench.asset import picture
from vobench.asset.fitting import PANE, bars
from vobench.asset.furniture import (
    BLACK,
    DARK,
    GREY,
    STEEL,
    WHITE,
    Part,
    cloth,
    coated,
    matt,
    mm,
    put,
    stood,
    wood,
)
from vobench.asset.picture import Rng
from vobench.asset.shape import at, block, block_arrays, card, cushion, lathe, spline, tube, tube_arrays
from vobench.scene.material import Material
from vobench.scene.mesh_arrays import joined_arrays


def task_chair(rng: Rng, colour: str = "#27445c") -> list[Part]:
    """A swivel chair on five castors, with or without arms; a person on it looks along x."""
    column = lathe(mm("0 70, 42 70, 34 120, 20 130, 20 420, 0 420"), sections=8)
    turn_deg = rng.uniform(0, 72)
    metal = []
    for k in range(5):
        leg = tube_arrays(mm("20 0 95, 300 0 62"), 0.017, sections=5)
        wheel = block_arrays((0.05, 0.045, 0.05), bevel_m=0.014).moved(at(0.29, 0, 0.026))
        metal += [part.moved(at(yaw=turn_deg + 72 * k)) for part in (leg, wheel)]
    has_arms = rng.random() < 0.6
    if has_arms:
        for side in (-1, 1):
            post = tube_arrays(
                mm(f"-20 {side * 200} 440, -30 {side * 290} 470, -30 {side * 290} 660"), 0.014, sections=5
            )
            rest = block_arrays((0.24, 0.07, 0.025), bevel_m=0.01).moved(at(-0.01, side * 0.29, 0.67))
            metal += [post, rest]
    fabric = cloth(colour)
    is_mesh = rng.random() < 0.4
    back = cushion((0.06, 0.45, 0.56), power=4.5, cells=4)
    support = tube(mm("-20 0 430, -250 0 440, -285 0 600, -275 0 760"), 0.018, sections=5)
    return [
        put(column, BLACK),
        Part(joined_arrays(metal), BLACK),
        put(support, BLACK),
        put(cushion((0.47, 0.48, 0.085), power=4.5, cells=4), fabric, 0.02, 0, 0.475),
        put(back, DARK if is_mesh else fabric, -0.235, 0, 0.85, pitch=-9),
    ]


def plain_desk(
    rng: Rng, width_m: float = 1.6, depth_m: float = 0.8, height_m: float = 0.74, look: Material = WHITE
) -> list[Part]:
    """A desk top on a steel frame."""
    y = width_m / 2 - 0.06
    x = depth_m / 2 - 0.06
    legs = [
        stood((0.05, 0.05, height_m - 0.025), STEEL, sx * x, sy * y, bevel=0.003) for sx in (-1, 1) for sy in (-1, 1)
    ]
    rail = stood((0.03, 2 * y, 0.05), STEEL, -x + 0.1, 0, height_m - 0.08, bevel=0)
    top = stood((depth_m, width_m, 0.025), look, 0, 0, height_m - 0.025, bevel=0.004, u=rng.uniform(0, 2))
    return [*legs, rail, top]


def pedestal(_: Rng, height_m: float = 0.56) -> list[Part]:
    """A steel pedestal of three drawers on castors."""
    parts = [stood((0.55, 0.4, height_m - 0.04), GREY, 0, 0, 0.04, bevel=0.004)]
    parts.append(stood((0.45, 0.32, 0.04), BLACK, bevel=0))
    for z in (0.06, 0.22, 0.38):
        parts.append(stood((0.016, 0.385, 0.15), GREY, 0.28, 0, z, bevel=0.003))
        parts.append(stood((0.012, 0.12, 0.012), STEEL, 0.291, 0, z + 0.11, bevel=0))
    return parts


def desk_screen(_: Rng, width_m: float = 1.6, height_m: float = 0.42, colour: str = "#8a9a7b") -> list[Part]:
    """A screen of cloth in a frame, which stands on the edge between two desks."""
    panel_m = (0.022, width_m - 0.03, height_m - 0.03)
    return [
        stood(panel_m, cloth(colour), 0, 0, 0.015, bevel=0.004),
        put(bars(width_m - 0.03, height_m - 0.03, 0.012, 0.028, bevel_m=0), GREY, 0, 0, height_m / 2),
    ]


def laptop(rng: Rng, seed: int = 0) -> list[Part]:
    """An open laptop that is switched on."""
    shell = coated("#8f9294", roughness=0.25)
    glow = Material(
        colour=(0.02, 0.02, 0.02),
        emission_cd_m2=(140.0, 143.0, 150.0),
        emission_texture=picture.screen(seed),
    )
    tilt = float(rng.uniform(-24, -10))
    lid = [put(block((0.008, 0.33, 0.22), bevel_m=0.002), shell, 0, 0, 0.11)]
    lid.append(put(card((0.31, 0.195)), glow, 0.0046, 0, 0.112))
    keys = [stood((0.014, 0.29, 0.002), BLACK, 0.005 - 0.017 * k, 0, 0.016, bevel=0) for k in range(5)]
    return [
        stood((0.23, 0.33, 0.016), shell, 0, 0, 0, bevel=0.003),
        *keys,
        *(part.moved(at(-0.11, 0, 0.014, pitch=tilt)) for part in lid),
    ]


def copier(_: Rng) -> list[Part]:
    """A copier 1.05 m high with paper trays and a display."""
    parts = [stood((0.6, 0.58, 0.62), coated("#c9cac6"), 0, 0, 0.04, bevel=0.01)]
    parts.append(stood((0.5, 0.5, 0.04), BLACK, bevel=0))
    parts.append(stood((0.56, 0.58, 0.2), coated("#d8d8d3"), 0, 0, 0.68, bevel=0.015))
    parts.append(stood((0.52, 0.58, 0.15), coated("#5b5f62"), -0.03, 0, 0.89, bevel=0.02))
    for z in (0.08, 0.26, 0.44):
        parts.append(stood((0.016, 0.54, 0.16), coated("#d8d8d3"), 0.305, 0, z, bevel=0.004))
        parts.append(stood((0.012, 0.16, 0.018), DARK, 0.314, 0, z + 0.12, bevel=0))
    plate = matt(texture=picture.sign("READY", "#26404c"))
    parts.append(put(card((0.2, 0.1)), plate, 0.3, 0.1, 0.93, pitch=-40))
    parts.append(stood((0.05, 0.24, 0.03), DARK, 0.285, 0.1, 0.9, bevel=0.004))
    return parts


def meeting_table(rng: Rng, length_m: float = 2.4, width_m: float = 1.1, look: Material = WHITE) -> list[Part]:
    """A table top on two panels; its length is along y."""
    top = stood((width_m, length_m, 0.032), look, 0, 0, 0.708, bevel=0.006, u=rng.uniform(0, 2))
    panels = [stood((0.7 * width_m, 0.04, 0.708), look, 0, side * 0.32 * length_m, bevel=0.003) for side in (-1, 1)]
    beam = stood((0.04, 0.64 * length_m, 0.12), look, 0, 0, 0.5, bevel=0.003)
    return [top, *panels, beam]


def coat_stand(rng: Rng, tones: str = "beech") -> list[Part]:
    """A stand with four hooks, mostly with a coat on one of them."""
    look = wood(tones)
    foot = lathe(mm("0 0, 190 0, 185 20, 30 40, 20 60, 20 1750, 0 1760"), sections=12)
    hook = tube(spline(mm("0 0 1620, 70 0 1640, 110 0 1720"), 5), 0.01, sections=5)
    parts = [put(foot, look), *(put(hook, look, yaw=90 * k + 20) for k in range(4))]
    if rng.random() < 0.7:
        angle = np.linspace(0, 2 * np.pi, 13)[None]
        down = np.linspace(0, 1, 5)[:, None]
        spread = 0.3 + 0.7 * np.minimum(1, 3 * down)
        x = 0.1 + 0.075 * spread * np.cos(angle)
        y = 0.15 * spread * np.sin(angle) * (1 + 0.12 * np.sin(5 * angle))
        z = 1.66 - 0.85 * down + 0 * angle
        from vobench.asset.shape import sheet_arrays

        coat = sheet_arrays(np.stack([x, y, z], axis=-1)).two_sided()
        colours = ("#27445c", "#3a3c3e", "#6b4353", "#8f6b4d")
        parts.append(put(coat, cloth(str(rng.choice(colours))), yaw=20))
    return parts


def glazing(_: Rng, width_m: float, height_m: float, frame: Material = BLACK) -> list[Part]:
    """A pane in a frame that fills a hole, centred at the origin, with one bar for each metre of its width."""
    border = bars(width_m - 0.08, height_m - 0.08, 0.04, 0.06, bevel_m=0)
    count = max(1, round(width_m / 1.0))
    posts = []
    for k in range(1, count):
        y = k * width_m / count - width_m / 2
        posts.append(put(block((0.05, 0.03, height_m - 0.08), bevel_m=0), frame, 0, y))
    return [put(card((width_m - 0.08, height_m - 0.08)), PANE), put(border, frame), *posts]
