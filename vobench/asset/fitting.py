"""Fittings: doors, windows, pictures, pipes and lamps. They are on a wall at x = 0 that faces x, or below z = 0."""

from typing import TYPE_CHECKING

import numpy as np

from vobench.asset import picture
from vobench.asset.furniture import (
    BLACK,
    CHROME,
    CREAM,
    DARK,
    GREY,
    PAGE,
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
from vobench.asset.picture import BRICK, INK, SAND, Rng
from vobench.asset.shape import at, block, card, lathe, sheet, spline, tube
from vobench.scene.material import Material
from vobench.scene.mesh import joined, moved, two_sided

if TYPE_CHECKING:
    from trimesh import Trimesh

MIRROR = Material("mirror", tint=0.85)
PANE = Material("pane", eta=1.5)


def bars(
    width_m: float,
    height_m: float,
    thick_m: float,
    deep_m: float,
    *,
    bevel_m: float = 0.003,
) -> "Trimesh":
    """A frame of four bars around a rectangle that is centred at the origin."""
    upright = block((deep_m, thick_m, height_m + 2 * thick_m), bevel_m=bevel_m)
    level = block((deep_m, width_m, thick_m), bevel_m=bevel_m)
    y = (width_m + thick_m) / 2
    z = (height_m + thick_m) / 2
    return joined(
        [
            moved(upright, at(0, -y)),
            moved(upright, at(0, y)),
            moved(level, at(0, 0, -z)),
            moved(level, at(0, 0, z)),
        ]
    )


def door(
    rng: Rng,
    width_m: float = 0.92,
    height_m: float = 2.05,
    label: str = "2.14",
    tones: str = "beech",
) -> list[Part]:
    """A door leaf in its frame, with a handle, hinges and a sign."""
    w = width_m
    h = height_m
    jamb = block((0.07, 0.07, h), bevel_m=0.006)
    jamb_y = w / 2 + 0.035
    lintel = block((0.07, w + 0.14, 0.07), bevel_m=0.006)
    frame = joined(
        [
            moved(jamb, at(0, -jamb_y, h / 2)),
            moved(jamb, at(0, jamb_y, h / 2)),
            moved(lintel, at(0, 0, h + 0.035)),
        ]
    )

    leaf_m = (0.03, w - 0.004, h - 0.01)
    hinge_m = (0.02, 0.012, 0.1)
    handle_y = 0.4 * w
    handle_plate = block((0.008, 0.045, 0.19))
    handle_path = spline(mm("0 0 0, 40 0 0, 58 -35 0, 56 -130 0"), 12)
    plate = matt(texture=picture.sign(label))
    return [
        stood(leaf_m, wood(tones), 0.016, 0, 0.006, u=rng.uniform(0, 1)),
        put(frame, DARK, 0.035),
        stood(hinge_m, STEEL, 0.035, -w / 2, 0.3),
        stood(hinge_m, STEEL, 0.035, -w / 2, 1.85),
        put(handle_plate, STEEL, 0.034, handle_y, 1.0),
        put(tube(handle_path, 0.009), CHROME, 0.033, handle_y, 1.04),
        put(card((0.2, 0.1)), plate, 0.033, 0, 1.55),
    ]


def window_frame(
    _: Rng,
    width_m: float = 1.8,
    height_m: float = 1.5,
    depth_m: float = 0.15,
) -> list[Part]:
    """The frame, mullion, transom, handle and sill of a window centred at the origin, `depth_m` behind x = 0."""
    x = 0.035 - depth_m
    w = width_m
    h = height_m
    border = bars(w - 0.12, h - 0.12, 0.06, 0.06, bevel_m=0.006)
    mullion = block((0.06, 0.06, h - 0.12))
    transom = block((0.056, w - 0.12, 0.05))
    frame = joined([border, mullion, moved(transom, at(0, 0, 0.21 * h))])
    handle = block((0.02, 0.03, 0.12), bevel_m=0.006)
    sill_m = (depth_m + 0.04, w + 0.1, 0.03)
    return [
        put(frame, WHITE, x),
        put(handle, STEEL, x + 0.04, 0.01, -0.1),
        stood(sill_m, WHITE, 0.06 - depth_m / 2, 0, -h / 2 - 0.028, bevel=0.008),
    ]


def blind(
    rng: Rng,
    width_m: float = 1.8,
    drop_m: float = 0.7,
    slat_deg: float = 40.0,
) -> list[Part]:
    """A blind: a rail with slats down to drop_m below it, and two cords."""
    slat = block((0.05, width_m - 0.02, 0.0025), bevel_m=0)
    depths_m = 0.05 + 0.042 * np.arange(int(drop_m / 0.042))
    slats = []
    for depth in depths_m:
        pitch = slat_deg + rng.normal(0, 1.5)
        slats.append(moved(slat, at(0, 0, -depth, pitch=pitch)))

    cords = []
    for share in (-0.35, 0.35):
        y = share * width_m
        cords.append(tube([[0, y, -0.03], [0, y, -depths_m[-1]]], 0.0012, sections=4))
    rail_m = (0.06, width_m, 0.04)
    return [
        Part(joined(slats), coated("#cfcabd")),
        Part(joined(cords), PAGE),
        stood(rail_m, WHITE, 0, 0, -0.03),
    ]


def curtain(
    rng: Rng,
    width_m: float = 0.5,
    height_m: float = 1.9,
    colour: str = SAND,
    columns: int = 41,
) -> list[Part]:
    """A curtain that hangs in folds from z = 0; `columns` of vertices form them."""
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(1, 0, 6))
    unevenness = 0.15 * np.sin(5 * u + rng.uniform(0, 6))
    phase = 2 * np.pi * (u * width_m / 0.11 + unevenness)
    folds = 0.05 + (0.02 + 0.02 * v) * np.sin(phase)
    x = folds + 0.008 * np.sin(2.3 * phase) * v
    y = (u - 0.5) * width_m * (1 - 0.08 * np.sin(np.pi * v))
    hanging = sheet(np.stack([x, y, -height_m * v], axis=-1))
    return [Part(two_sided(hanging), cloth(colour))]


def radiator(_: Rng, width_m: float = 1.4, height_m: float = 0.55) -> list[Part]:
    """A radiator: columns between two headers, a valve and a pipe into the floor."""
    w = width_m / 2
    bottom = 0.14
    top = 0.1 + height_m
    columns = []
    for y in np.arange(-width_m / 2 + 0.025, width_m / 2, 0.05):
        for x in (0.05, 0.1):
            axis = [[x, y, bottom], [x, y, top]]
            columns.append(tube(axis, 0.013))
    headers = []
    for z in (bottom, top):
        axis = [[0.075, -w, z], [0.075, w, z]]
        headers.append(tube(axis, 0.027, sections=12))

    feed_path = spline(mm("75 0 140, 75 60 140, 75 90 110, 75 90 0"), 12)
    feed = tube(feed_path, 0.01)
    valve = lathe(mm("0 0, 20 0, 22 50, 14 56, 0 56"))
    return [
        Part(joined([*columns, *headers]), CREAM),
        put(feed, STEEL, 0, w),
        put(valve, WHITE, 0.075, w + 0.03, 0.14),
    ]


def panel_radiator(_: Rng, width_m: float = 1.4, height_m: float = 0.55) -> list[Part]:
    """A radiator of two steel panels with a grille between them, a valve and a pipe into the floor."""
    bottom = 0.12
    panel = block((0.02, width_m, height_m), bevel_m=0.006)
    count = max(2, round(width_m / 0.09))
    ribs_y = (np.arange(count) + 0.5) * width_m / count - width_m / 2
    rib = block((0.006, 0.03, height_m - 0.08), bevel_m=0)
    ribs = [moved(rib, at(0.126, y, bottom + height_m / 2)) for y in ribs_y.tolist()]
    grille = block((0.1, width_m - 0.004, 0.012), bevel_m=0.002)
    panels = [moved(panel, at(x, 0, bottom + height_m / 2)) for x in (0.05, 0.114)]
    feed = tube(mm("80 0 0, 80 0 150"), 0.009, sections=6)
    valve = lathe(mm("0 0, 20 0, 22 50, 14 56, 0 56"), sections=12)
    enamel = coated("#e4e2dc", roughness=0.25)
    return [
        Part(joined([*panels, *ribs]), enamel),
        put(grille, GREY, 0.082, 0, bottom + height_m - 0.006),
        put(feed, WHITE, 0, width_m / 2 - 0.03),
        put(valve, WHITE, 0.08, width_m / 2 + 0.02, bottom + height_m - 0.1, roll=-90),
    ]


def socket(_: Rng, count: int = 2) -> list[Part]:
    """A plate with `count` socket outlets side by side."""
    well = lathe(mm("0 0, 21 0, 21 2, 0 2"), sections=20)
    pin = lathe(mm("0 0, 3 0, 0 2"), sections=8)
    plate = block((0.012, 0.072 * count + 0.012, 0.082), bevel_m=0.004)
    outlets_y = 0.072 * (np.arange(count) - (count - 1) / 2)

    wells = [put(well, GREY, 0.0115, y, pitch=90) for y in outlets_y]
    pins_y = [y + offset for y in outlets_y for offset in (-0.009, 0.009)]
    pins = [put(pin, BLACK, 0.0134, y, pitch=90) for y in pins_y]
    return [put(plate, WHITE, 0.006), *wells, *pins]


def skirting(_: Rng, length_m: float = 1.0, height_m: float = 0.08) -> list[Part]:
    """A skirting board along the base of a wall."""
    return [stood((0.014, length_m, height_m), WHITE, 0.007, bevel=0.004)]


def framed(
    _: Rng,
    style: str = "hills",
    width_m: float = 0.5,
    height_m: float = 0.7,
    seed: int = 0,
    frame: str = INK,
) -> list[Part]:
    """A picture in a frame: a style of poster, `whiteboard` or `mirror`."""
    face = _framed_face(style, width_m, height_m, seed)
    border = bars(width_m, height_m, 0.025, 0.02)
    return [
        put(card((width_m, height_m)), face, 0.01),
        put(border, coated(frame), 0.011),
    ]


def _framed_face(style: str, width_m: float, height_m: float, seed: int) -> Material:
    """The material of the picture in a frame."""
    if style == "mirror":
        return MIRROR
    if style == "whiteboard":
        return matt(texture=picture.whiteboard(seed))
    px_per_m = 900 / max(width_m, height_m)
    width_px = round(px_per_m * width_m)
    height_px = round(px_per_m * height_m)
    return matt(texture=picture.poster(style, seed, width_px, height_px))


def noticeboard(rng: Rng, width_m: float = 1.2, height_m: float = 0.9) -> list[Part]:
    """A cork board with sheets of paper pinned to it."""
    cork = matt(texture=picture.ground("cork", tile_m=1.0))
    pin = lathe(mm("0 0, 5 0, 5 8, 0 9"), sections=8)
    free_m = [width_m - 0.3, height_m - 0.36]
    sheets = []
    pins = []
    for k in range(int(width_m * height_m * 9)):
        x = 0.0165 + 0.0006 * k
        y, z = rng.uniform(-0.5, 0.5, 2) * free_m
        scale = rng.choice([0.5, 0.7, 1.0])
        column = k % 3
        row = k // 3 % 2
        cell = (column / 3, (column + 1) / 3, row / 2, (row + 1) / 2)
        page = card((0.21 * scale, 0.297 * scale), cell=cell)
        sheets.append(moved(page, at(x, y, z, roll=rng.normal(0, 5))))
        pins.append(moved(pin, at(x, y, z + 0.13 * scale, pitch=90)))
    return [
        put(block((0.014, width_m, height_m)), cork, 0.009),
        put(bars(width_m, height_m, 0.025, 0.02), STEEL, 0.011),
        Part(joined(sheets), matt(texture=picture.pages(0))),
        Part(joined(pins), coated(BRICK)),
    ]


def glass_wall(_: Rng, width_m: float = 1.6, height_m: float = 2.2) -> list[Part]:
    """A pane of glass on the floor in a narrow steel frame."""
    pane_m = (width_m, height_m - 0.06)
    frame = bars(*pane_m, 0.03, 0.03)
    middle = height_m / 2
    return [put(card(pane_m), PANE, 0, 0, middle), put(frame, BLACK, 0, 0, middle)]


def pipe(
    _: Rng,
    length_m: float = 4.0,
    radius_m: float = 0.03,
    colour: str = "#a4a7a6",
) -> list[Part]:
    """A level pipe along y with flanges, 6 cm off the wall."""
    end = length_m / 2
    rod = tube([[0, -length_m / 2, 0], [0, end, 0]], radius_m, sections=16)
    flange = lathe(mm("0 -12, 1350 -12, 1350 12, 0 12") * [radius_m, 1])
    flanges = [moved(flange, at(0, y, 0, roll=90)) for y in np.arange(0.4 - length_m / 2, end, 1.2)]
    return [put(joined([rod, *flanges]), coated(colour), 0.06 + radius_m)]


def lamp_housing(_: Rng, size_m: tuple[float, float] = (1.2, 0.3), hang_m: float = 0.1) -> list[Part]:
    """The housing above a light panel at z = 0 that faces down, and the rods to the ceiling hang_m above it."""
    length, width = size_m
    tray_m = (length + 0.03, width + 0.03, 0.035)
    rods = []
    for share in (-0.35, 0.35):
        x = share * length
        rods.append(tube([[x, 0, 0.03], [x, 0, hang_m]], 0.004))
    return [
        stood(tray_m, WHITE, 0, 0, 0.001, bevel=0.006),
        Part(joined(rods), STEEL),
    ]


def spot_housing(_: Rng) -> list[Part]:
    """A cylindrical housing behind a spot light at the origin that shines along x."""
    can = lathe(mm("0 -160, 30 -160, 45 -140, 45 -4, 0 -4"))
    return [put(can, BLACK, pitch=90)]
