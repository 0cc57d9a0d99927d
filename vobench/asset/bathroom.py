"""Furniture of bathrooms: tubs, showers, basins, toilets and towels. The wall is at x = 0; the front faces x."""

from typing import TYPE_CHECKING

import numpy as np

from vobench.asset.fitting import MIRROR, PANE, bars
from vobench.asset.furniture import BLACK, CHROME, SIDES, STEEL, WHITE, Part, cloth, coated, mm, put, stood, wood
from vobench.asset.picture import Rng
from vobench.asset.shape import at, block, card, cushion, extrusion, lathe, sheet, spline, tube
from vobench.geometry.se3 import Array
from vobench.scene.mesh import flipped, joined, moved, quad, two_sided

if TYPE_CHECKING:
    from trimesh import Trimesh

CERAMIC = coated("#e9e8e3", roughness=0.08)


def _tap(height_m: float = 0.14) -> list[Part]:
    """A tap with a lever, on z = 0."""
    height_mm = 1000 * height_m
    spout = spline(mm(f"0 0 0, 0 0 {900 * height_m}, 40 0 {height_mm}, 130 0 {800 * height_m}"), 10)
    lever = mm(f"0 0 {height_mm}, -10 0 {height_mm + 30}, 50 0 {height_mm + 45}")
    return [put(joined([tube(spout, 0.014), tube(lever, 0.006)]), CHROME)]


def _superellipse(half_x_m: float, half_y_m: float, *, power: float) -> Array:
    """An outline (28, 2) with the given half axes: an ellipse for a power of 2, and nearly a rectangle for a large one.

    Source: Lamé (1818).
    """
    angle = 2 * np.pi * np.arange(28) / 28
    cosine = np.cos(angle)
    sine = np.sin(angle)
    radius = (np.abs(cosine) ** power + np.abs(sine) ** power) ** (-1 / power)
    return np.stack([half_x_m * radius * cosine, half_y_m * radius * sine], axis=-1)


def _bowl(outlines_m: list[Array], heights_m: list[float]) -> "Trimesh":
    """The inside of a basin: outlines (N, 2) at heights, from the rim down, closed by a flat bottom at the last one."""
    rings_m = []
    for outline_m, height_m in zip(outlines_m, heights_m, strict=True):
        closed_m = np.concatenate([outline_m, outline_m[:1]])
        rings_m.append(np.column_stack([closed_m, np.full(len(closed_m), height_m)]))
    middle_m = np.broadcast_to(rings_m[-1].mean(axis=0), rings_m[-1].shape)
    return sheet(np.stack([*rings_m, middle_m]))


def bathtub(_: Rng, length_m: float = 1.7, width_m: float = 0.75, height_m: float = 0.56) -> list[Part]:
    """A built-in tub along the wall, with a tap at one end."""
    x = width_m / 2
    y = length_m / 2
    border = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    rim = _superellipse(x - 0.06, y - 0.07, power=4.0)
    deck = extrusion(border, 0.03, holes_m=[rim])
    inside = _bowl([rim, rim * 0.93, rim * [0.85, 0.88]], [height_m, 0.3, 0.14])

    # The apron covers the front and both ends.
    up_m = (0, 0, height_m - 0.03)
    along_m = (0, length_m - 0.004, 0)
    across_m = (width_m - 0.004, 0, 0)
    front = quad((x - 0.004, -y + 0.002, 0), along_m, up_m)
    first_end = quad((-x, -y + 0.002, 0), across_m, up_m)
    last_end = flipped(quad((-x, y - 0.002, 0), across_m, up_m))
    apron = joined([front, first_end, last_end])

    tap = [part.moved(at(0.05, 0, height_m, yaw=0)) for part in _tap(0.1)]
    drain = lathe(mm("0 0, 28 0, 26 4, 0 4"))
    return [
        put(deck, CERAMIC, x, z=height_m - 0.03),
        put(inside, CERAMIC, x),
        put(apron, CERAMIC, x),
        put(drain, CHROME, x, -0.6 * y, 0.141),
        *tap,
    ]


def shower(_: Rng, width_m: float = 0.9, depth_m: float = 0.9) -> list[Part]:
    """A shower tray with a pane of glass on one side, a riser, a hand shower and a drain."""
    middle_x = depth_m / 2
    tray = stood((depth_m, width_m, 0.05), CERAMIC, middle_x, bevel=0.012)

    pane_m = (depth_m - 0.03, 1.94)
    pane_y = width_m / 2 - 0.02
    pane = put(card(pane_m), PANE, middle_x, pane_y, 1.03, yaw=90)
    frame = put(bars(*pane_m, 0.016, 0.016, bevel_m=0.002), CHROME, middle_x, pane_y, 1.03, yaw=90)

    riser = tube(spline(mm("30 0 950, 30 0 1900, 60 0 2080, 200 0 2090, 300 0 2060"), 20), 0.01)
    head = lathe(mm("0 0, 90 0, 95 8, 20 26, 0 26"))
    valve = block((0.05, 0.24, 0.04), bevel_m=0.012)
    drain = lathe(mm("0 0, 45 0, 45 2, 0 2"))
    return [
        tray,
        pane,
        frame,
        put(riser, CHROME),
        put(head, CHROME, 0.3, z=2.035),
        put(valve, CHROME, 0.03, z=1.05),
        put(drain, STEEL, middle_x, z=0.0495),
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

    border = _superellipse(x, y, power=9.0)
    bowl = _superellipse(x - 0.06, min(y - 0.06, 0.3), power=3.5)
    forward_m = np.array([0.03, 0.0])  # the bowl is in front of the middle, so that the tap has room
    top = extrusion(border, 0.05, holes_m=[bowl + forward_m])
    inside = _bowl([share * bowl + forward_m for share in (1.0, 0.85, 0.5)], [0.05, -0.02, -0.06])

    body_m = (depth_m - 0.04, width_m - 0.03, 0.44)
    parts = [
        stood(body_m, look, x - 0.012, z=0.36, bevel=0.003),
        put(top, CERAMIC, x, z=0.8),
        put(inside, CERAMIC, x, z=0.8),
        *(part.moved(at(0.07, 0, 0.85)) for part in _tap()),
    ]
    drawer_front_m = (0.018, width_m - 0.036, 0.21)
    for z in (0.365, 0.583):
        parts.append(stood(drawer_front_m, look, depth_m - 0.024, z=z, bevel=0.003))
        parts.append(stood((0.014, 0.16, 0.012), STEEL, depth_m - 0.01, z=z + 0.17))
    if mirror_m is not None:
        mirror_z = 1.12 + mirror_m[1] / 2
        frame = bars(*mirror_m, 0.014, 0.022, bevel_m=0.002)
        parts.append(put(card(mirror_m), MIRROR, 0.014, z=mirror_z))
        parts.append(put(frame, STEEL, 0.011, z=mirror_z))
    return parts


def toilet(_: Rng) -> list[Part]:
    """A toilet that hangs on the wall, with its lid closed and a flush plate above it."""
    bowl = moved(cushion((0.5, 0.36, 0.3), power=2.6, cells=5), at(0.3, 0, 0.26))
    neck = block((0.24, 0.3, 0.24), bevel_m=0.05, transform=at(0.12, 0, 0.28))
    lid = extrusion(_superellipse(0.225, 0.185, power=2.5), 0.03)
    flush_plate = block((0.012, 0.24, 0.16), bevel_m=0.004)
    button = block((0.006, 0.1, 0.12), bevel_m=0.002)
    return [
        put(joined([bowl, neck]), CERAMIC),
        put(lid, WHITE, 0.315, z=0.4),
        put(flush_plate, WHITE, 0.006, z=1.02),
        *(put(button, CHROME, 0.014, y, 1.02) for y in (-0.055, 0.055)),
    ]


def paper_holder(_: Rng) -> list[Part]:
    """A roll of paper on a bar, centred at z = 0."""
    roll = moved(lathe(mm("0 -50, 55 -50, 55 50, 0 50")), at(0.075, 0, 0, roll=90))
    arm = tube(mm("0 70 60, 40 70 60, 75 70 0, 75 -60 0"), 0.006)
    return [put(roll, cloth("#efece6")), put(arm, CHROME)]


def towel_rail(_: Rng, width_m: float = 0.5, height_m: float = 1.1, colour: str = "#8fb3c7") -> list[Part]:
    """A heated rail on a wall, centred at z = 0, with a towel over one of its bars."""
    x = 0.07  # of the rail, in front of the wall
    low_z = -height_m / 2
    high_z = height_m / 2
    rungs_z = np.arange(low_z, high_z, 0.12)
    rungs = [tube([[x, -width_m / 2, z], [x, width_m / 2, z]], 0.01, sections=6) for z in rungs_z]
    posts = []
    feet = []
    for side in SIDES:
        y = side * width_m / 2
        posts.append(tube([[x, y, low_z - 0.04], [x, y, high_z]], 0.016, sections=8))
        feet += [tube([[0, y, z], [x, y, z]], 0.01, sections=6) for z in (low_z + 0.06, high_z - 0.06)]

    towel_z = float(rungs_z[-2])
    profile = mm("52 0 -420, 54 0 -200, 58 0 0, 71 0 14, 84 0 0, 88 0 -250, 86 0 -520")  # from the wall to the front
    across = np.linspace(-0.36 * width_m, 0.36 * width_m, 9)
    waves = 0.004 * np.sin(40 * across)
    offsets = np.stack([waves, across, 0 * across], axis=-1)
    towel = two_sided(sheet(profile[:, None] + offsets[None]))
    return [put(joined([*rungs, *posts, *feet]), WHITE), put(towel, cloth(colour), z=towel_z)]


def bath_mat(_: Rng, width_m: float = 0.8, depth_m: float = 0.5, colour: str = "#8a9a7b") -> list[Part]:
    """A mat on the floor."""
    return [stood((depth_m, width_m, 0.014), cloth(colour), bevel=0.006)]


def toilet_brush(_: Rng) -> list[Part]:
    """A brush in its holder."""
    holder = lathe(mm("0 0, 48 0, 50 8, 46 150, 0 152"))
    handle = tube(mm("0 0 150, 0 0 380"), 0.008)
    return [put(holder, WHITE), put(handle, BLACK)]
