"""Bathrooms: tubs, showers, basins, toilets and towels. They stand at a wall at x = 0 and face x."""

from typing import TYPE_CHECKING

import numpy as np

from vobench.asset.fitting import MIRROR, PANE, bars
from vobench.asset.furniture import BLACK, CHROME, STEEL, WHITE, Part, cloth, coated, mm, put, stood, wood
from vobench.asset.picture import Rng
from vobench.asset.shape import at, block, card, cushion, extrusion, lathe, sheet, spline, tube
from vobench.geometry.se3 import Array
from vobench.scene.mesh import flipped, joined, moved, quad, two_sided

if TYPE_CHECKING:
    from trimesh import Trimesh

CERAMIC = coated("#e9e8e3", roughness=0.08)


def _tap(height_m: float = 0.14) -> list[Part]:
    """A tap with a lever, on z = 0."""
    spout = spline(mm(f"0 0 0, 0 0 {900 * height_m}, 40 0 {1000 * height_m}, 130 0 {800 * height_m}"), 10)
    lever = mm(f"0 0 {1000 * height_m}, -10 0 {1000 * height_m + 30}, 50 0 {1000 * height_m + 45}")
    return [put(joined([tube(spout, 0.014), tube(lever, 0.006)]), CHROME)]


def _ring(x_m: float, y_m: float, *, sections: int = 28, power: float = 4.0) -> Array:
    """An outline (N, 2) between an ellipse and a rectangle, with half axes x_m and y_m."""
    angle = 2 * np.pi * np.arange(sections) / sections
    cosine = np.cos(angle)
    sine = np.sin(angle)
    radius = (np.abs(cosine) ** power + np.abs(sine) ** power) ** (-1 / power)
    return np.stack([x_m * radius * cosine, y_m * radius * sine], axis=-1)


def _bowl(rings_m: list[tuple[Array, float]]) -> "Trimesh":
    """The inside of a basin: rings (N, 2) with their heights, from the rim down, closed by the last one."""
    closed = [np.concatenate([ring, ring[:1]]) for ring, _ in rings_m]
    heights = [height for _, height in rings_m]
    points = [np.column_stack([ring, np.full(len(ring), z)]) for ring, z in zip(closed, heights, strict=True)]
    middle = np.broadcast_to(points[-1].mean(axis=0), points[-1].shape)
    return sheet(np.stack([*points, middle]))


def bathtub(_: Rng, length_m: float = 1.7, width_m: float = 0.75, height_m: float = 0.56) -> list[Part]:
    """A built-in tub along the wall, with a tap at one end."""
    x = width_m / 2
    y = length_m / 2
    rim = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    inner = _ring(x - 0.06, y - 0.07)
    deck = extrusion(rim, 0.03, holes_m=[inner])
    inside = _bowl([(inner, height_m), (inner * 0.93, 0.3), (inner * [0.85, 0.88], 0.14)])
    apron_x = quad((x - 0.004, -y + 0.002, 0), (0, length_m - 0.004, 0), (0, 0, height_m - 0.03))
    apron_first = quad((-x, -y + 0.002, 0), (width_m - 0.004, 0, 0), (0, 0, height_m - 0.03))
    apron_last = flipped(quad((-x, y - 0.002, 0), (width_m - 0.004, 0, 0), (0, 0, height_m - 0.03)))
    tap = [part.moved(at(0.05, 0, height_m, yaw=0)) for part in _tap(0.1)]
    drain = lathe(mm("0 0, 28 0, 26 4, 0 4"))
    return [
        put(deck, CERAMIC, x, 0, height_m - 0.03),
        put(inside, CERAMIC, x),
        put(joined([apron_x, apron_first, apron_last]), CERAMIC, x),
        put(drain, CHROME, x, -0.6 * y, 0.141),
        *tap,
    ]


def shower(_: Rng, width_m: float = 0.9, depth_m: float = 0.9) -> list[Part]:
    """A shower tray with a pane of glass on one side, a riser, a hand shower and a drain."""
    tray = stood((depth_m, width_m, 0.05), CERAMIC, depth_m / 2, 0, bevel=0.012)
    pane_m = (depth_m - 0.03, 1.94)
    pane = put(card(pane_m), PANE, depth_m / 2, width_m / 2 - 0.02, 1.03, yaw=90)
    frame = put(bars(*pane_m, 0.016, 0.016, bevel_m=0.002), CHROME, depth_m / 2, width_m / 2 - 0.02, 1.03, yaw=90)
    riser = tube(spline(mm("30 0 950, 30 0 1900, 60 0 2080, 200 0 2090, 300 0 2060"), 20), 0.01)
    head = lathe(mm("0 0, 90 0, 95 8, 20 26, 0 26"))
    valve = block((0.05, 0.24, 0.04), bevel_m=0.012)
    drain = lathe(mm("0 0, 45 0, 45 2, 0 2"))
    return [
        tray,
        pane,
        frame,
        put(riser, CHROME),
        put(head, CHROME, 0.3, 0, 2.035),
        put(valve, CHROME, 0.03, 0, 1.05),
        put(drain, STEEL, depth_m / 2, 0, 0.0495),
    ]


def washbasin(
    _: Rng,
    width_m: float = 0.6,
    colour: str = "#d8d6d0",
    tones: str = "",
    mirror_m: tuple[float, float] | None = None,
) -> list[Part]:
    """A basin on a cupboard that hangs on the wall, and a mirror of a width and height above it."""
    look = wood(tones) if tones else coated(colour, roughness=0.3)
    depth_m = 0.46
    x = depth_m / 2
    y = width_m / 2
    outer = _ring(x, y, power=9.0)
    inner = _ring(x - 0.06, min(y - 0.06, 0.3), power=3.5)
    forward_m = np.array([0.03, 0.0])
    top = extrusion(outer, 0.05, holes_m=[inner + forward_m])
    inside = _bowl([(share * inner + forward_m, z) for share, z in ((1.0, 0.05), (0.85, -0.02), (0.5, -0.06))])
    body_m = (depth_m - 0.04, width_m - 0.03, 0.44)
    front_m = (0.018, width_m - 0.036, 0.21)
    parts = [
        stood(body_m, look, x - 0.012, 0, 0.36, bevel=0.003),
        put(top, CERAMIC, x, 0, 0.8),
        put(inside, CERAMIC, x, 0, 0.8),
        *(part.moved(at(0.07, 0, 0.85)) for part in _tap()),
    ]
    for z in (0.365, 0.583):
        parts.append(stood(front_m, look, depth_m - 0.024, 0, z, bevel=0.003))
        parts.append(stood((0.014, 0.16, 0.012), STEEL, depth_m - 0.01, 0, z + 0.17))
    if mirror_m is not None:
        parts.append(put(card(mirror_m), MIRROR, 0.014, 0, 1.12 + mirror_m[1] / 2))
        parts.append(put(bars(*mirror_m, 0.014, 0.022, bevel_m=0.002), STEEL, 0.011, 0, 1.12 + mirror_m[1] / 2))
    return parts


def toilet(_: Rng) -> list[Part]:
    """A toilet that hangs on the wall, with its lid closed and a flush plate above it."""
    bowl = moved(cushion((0.5, 0.36, 0.3), power=2.6, cells=5), at(0.3, 0, 0.26))
    neck = block((0.24, 0.3, 0.24), bevel_m=0.05, transform=at(0.12, 0, 0.28))
    lid = extrusion(_ring(0.225, 0.185, power=2.5), 0.03)
    plate = block((0.012, 0.24, 0.16), bevel_m=0.004)
    buttons = [put(block((0.006, 0.1, 0.12), bevel_m=0.002), CHROME, 0.014, y, 1.02) for y in (-0.055, 0.055)]
    return [
        put(joined([bowl, neck]), CERAMIC),
        put(lid, WHITE, 0.315, 0, 0.4),
        put(plate, WHITE, 0.006, 0, 1.02),
        *buttons,
    ]


def paper_holder(_: Rng) -> list[Part]:
    """A roll of paper on a bar, centred at z = 0."""
    roll = moved(lathe(mm("0 -50, 55 -50, 55 50, 0 50")), at(0.075, 0, 0, roll=90))
    arm = tube(mm("0 70 60, 40 70 60, 75 70 0, 75 -60 0"), 0.006)
    return [put(roll, cloth("#efece6")), put(arm, CHROME)]


def towel_rail(_: Rng, width_m: float = 0.5, height_m: float = 1.1, colour: str = "#8fb3c7") -> list[Part]:
    """A heated rail on a wall, centred at z = 0, with a towel over one of its bars."""
    low = -height_m / 2
    high = height_m / 2
    bars_z = np.arange(low, high, 0.12)
    rungs = [tube([[0.07, -width_m / 2, z], [0.07, width_m / 2, z]], 0.01, sections=6) for z in bars_z]
    posts = [
        tube([[0.07, side * width_m / 2, low - 0.04], [0.07, side * width_m / 2, high]], 0.016, sections=8)
        for side in (-1, 1)
    ]
    feet = [
        tube([[0, side * width_m / 2, z], [0.07, side * width_m / 2, z]], 0.01, sections=6)
        for side in (-1, 1)
        for z in (low + 0.06, high - 0.06)
    ]
    top = float(bars_z[-2])
    drape = mm("52 0 -420, 54 0 -200, 58 0 0, 71 0 14, 84 0 0, 88 0 -250, 86 0 -520")
    across = np.linspace(-0.36 * width_m, 0.36 * width_m, 9)
    waves = 0.004 * np.sin(40 * across)
    points = drape[:, None] + np.stack([waves, across, 0 * across], axis=-1)[None]
    towel = two_sided(sheet(points))
    return [put(joined([*rungs, *posts, *feet]), WHITE), put(towel, cloth(colour), 0, 0, top)]


def bath_mat(_: Rng, width_m: float = 0.8, depth_m: float = 0.5, colour: str = "#8a9a7b") -> list[Part]:
    """A mat on the floor."""
    return [stood((depth_m, width_m, 0.014), cloth(colour), bevel=0.006)]


def toilet_brush(_: Rng) -> list[Part]:
    """A brush in its holder."""
    holder = lathe(mm("0 0, 48 0, 50 8, 46 150, 0 152"))
    handle = tube(mm("0 0 150, 0 0 380"), 0.008)
    return [put(holder, WHITE), put(handle, BLACK)]
