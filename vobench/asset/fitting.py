"""Fittings of rooms: doors, windows, pictures, pipes and lamps, on a wall at x = 0 that faces x, or hung from z = 0."""

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
from vobench.scene.mesh import Mesh, joined

MIRROR = Material("mirror", tint=0.85)
PANE = Material("pane", eta=1.5)


def bars(width_m: float, height_m: float, thick_m: float, deep_m: float, *, bevel_m: float = 0.003) -> Mesh:
    """Four bars around a rectangle around the origin."""
    upright = block((deep_m, thick_m, height_m + 2 * thick_m), bevel_m=bevel_m)
    level = block((deep_m, width_m, thick_m), bevel_m=bevel_m)
    y = (width_m + thick_m) / 2
    z = (height_m + thick_m) / 2
    return joined([*(upright.moved(at(0, s * y)) for s in (-1, 1)), *(level.moved(at(0, 0, s * z)) for s in (-1, 1))])


def door(
    rng: Rng, width_m: float = 0.92, height_m: float = 2.05, label: str = "2.14", tones: str = "beech"
) -> list[Part]:
    """A leaf in its frame, with a handle, hinges and a plate."""
    jamb = block((0.07, 0.07, height_m), bevel_m=0.006)
    lintel = block((0.07, width_m + 0.14, 0.07), bevel_m=0.006)
    jambs = [jamb.moved(at(0, s * (width_m / 2 + 0.035), height_m / 2)) for s in (-1, 1)]
    frame = joined([*jambs, lintel.moved(at(0, 0, height_m + 0.035))])
    grip = tube(spline(mm("0 0 0, 40 0 0, 58 -35 0, 56 -130 0"), 12), 0.009)
    return [
        stood((0.03, width_m - 0.004, height_m - 0.01), wood(tones), 0.016, 0, 0.006, u=rng.uniform(0, 1)),
        put(frame, DARK, 0.035),
        *(stood((0.02, 0.012, 0.1), STEEL, 0.035, -width_m / 2, z) for z in (0.3, 1.85)),
        put(block((0.008, 0.045, 0.19)), STEEL, 0.034, 0.4 * width_m, 1.0),
        put(grip, CHROME, 0.033, 0.4 * width_m, 1.04),
        put(card((0.2, 0.1)), matt(texture=picture.sign(label)), 0.033, 0, 1.55),
    ]


def window_frame(_: Rng, width_m: float = 1.8, height_m: float = 1.5, depth_m: float = 0.15) -> list[Part]:
    """Frame, mullion, transom and handle in a hole around the origin, depth_m before its pane, and a sill."""
    x = 0.035 - depth_m
    w = width_m
    h = height_m
    mullion = block((0.06, 0.06, h - 0.12))
    transom = block((0.056, w - 0.12, 0.05)).moved(at(0, 0, 0.21 * h))
    frame = joined([bars(w - 0.12, h - 0.12, 0.06, 0.06, bevel_m=0.006), mullion, transom])
    sill = stood((depth_m + 0.04, w + 0.1, 0.03), WHITE, 0.06 - depth_m / 2, 0, -h / 2 - 0.028, bevel=0.008)
    return [put(frame, WHITE, x), put(block((0.02, 0.03, 0.12), bevel_m=0.006), STEEL, x + 0.04, 0.01, -0.1), sill]


def blind(rng: Rng, width_m: float = 1.8, drop_m: float = 0.7, slat_deg: float = 40.0) -> list[Part]:
    """Slats that hang drop_m from a rail, and their cords."""
    slat = block((0.05, width_m - 0.02, 0.0025), bevel_m=0)
    levels = 0.05 + 0.042 * np.arange(int(drop_m / 0.042))
    slats = [slat.moved(at(0, 0, -z, pitch=slat_deg + rng.normal(0, 1.5))) for z in levels]
    cords = [tube([[0, s * width_m, -0.03], [0, s * width_m, -levels[-1]]], 0.0012, sections=4) for s in (-0.35, 0.35)]
    rail = stood((0.06, width_m, 0.04), WHITE, 0, 0, -0.03)
    return [Part(joined(slats), coated("#cfcabd")), Part(joined(cords), PAGE), rail]


def curtain(rng: Rng, width_m: float = 0.5, height_m: float = 1.9, colour: str = SAND) -> list[Part]:
    """Cloth in folds that hangs down."""
    u, v = np.meshgrid(np.linspace(0, 1, 41), np.linspace(1, 0, 6))
    phase = 2 * np.pi * (u * width_m / 0.11 + 0.15 * np.sin(5 * u + rng.uniform(0, 6)))
    fold = 0.05 + (0.02 + 0.02 * v) * np.sin(phase) + 0.008 * np.sin(2.3 * phase) * v
    y = (u - 0.5) * width_m * (1 - 0.08 * np.sin(np.pi * v))
    return [Part(sheet(np.stack([fold, y, -height_m * v], axis=-1)).two_sided(), cloth(colour))]


def radiator(_: Rng, width_m: float = 1.4, height_m: float = 0.55) -> list[Part]:
    """Columns between two headers, a valve and a pipe into the floor."""
    w = width_m / 2
    ys = np.arange(-width_m / 2 + 0.025, width_m / 2, 0.05)
    columns = [tube([[x, y, 0.14], [x, y, 0.1 + height_m]], 0.013) for y in ys for x in (0.05, 0.1)]
    heads = [tube([[0.075, -w, z], [0.075, w, z]], 0.027, sections=12) for z in (0.14, 0.1 + height_m)]
    pipe = tube(spline(mm("75 0 140, 75 60 140, 75 90 110, 75 90 0"), 12), 0.01)
    valve = lathe(mm("0 0, 20 0, 22 50, 14 56, 0 56"))
    return [Part(joined([*columns, *heads]), CREAM), put(pipe, STEEL, 0, w), put(valve, WHITE, 0.075, w + 0.03, 0.14)]


def socket(_: Rng, count: int = 2) -> list[Part]:
    """Outlets in a plate."""
    well = lathe(mm("0 0, 21 0, 21 2, 0 2"), sections=20)
    pin = lathe(mm("0 0, 3 0, 0 2"), sections=8)
    ys = 0.072 * (np.arange(count) - (count - 1) / 2)
    plate = put(block((0.012, 0.072 * count + 0.012, 0.082), bevel_m=0.004), WHITE, 0.006)
    wells = [put(well, GREY, 0.0115, y, pitch=90) for y in ys]
    return [plate, *wells, *(put(pin, BLACK, 0.0134, y + s, pitch=90) for y in ys for s in (-0.009, 0.009))]


def skirting(_: Rng, length_m: float = 1.0, height_m: float = 0.08) -> list[Part]:
    """A board along the foot of a wall."""
    return [stood((0.014, length_m, height_m), WHITE, 0.007, bevel=0.004)]


def framed(
    _: Rng, style: str = "hills", width_m: float = 0.5, height_m: float = 0.7, seed: int = 0, frame: str = INK
) -> list[Part]:
    """A picture in a frame: a style of poster, `whiteboard` or `mirror`."""
    w, h = (round(900 / max(width_m, height_m) * side) for side in (width_m, height_m))
    print_ = picture.whiteboard(seed) if style == "whiteboard" else None
    face = MIRROR if style == "mirror" else matt(texture=print_ or picture.poster(style, seed, w, h))
    return [put(card((width_m, height_m)), face, 0.01), put(bars(width_m, height_m, 0.025, 0.02), coated(frame), 0.011)]


def noticeboard(rng: Rng, width_m: float = 1.2, height_m: float = 0.9) -> list[Part]:
    """Cork with sheets pinned to it."""
    cork = matt(texture=picture.ground("cork", tile_m=1.0))
    sheets = []
    pins = []
    pin = lathe(mm("0 0, 5 0, 5 8, 0 9"), sections=8)
    for k in range(int(width_m * height_m * 9)):
        (y, z) = rng.uniform(-0.5, 0.5, 2) * [width_m - 0.3, height_m - 0.36]
        scale = rng.choice([0.5, 0.7, 1.0])
        c = k % 3
        r = k // 3 % 2
        x = 0.0165 + 0.0006 * k
        page = card((0.21 * scale, 0.297 * scale), cell=(c / 3, (c + 1) / 3, r / 2, (r + 1) / 2))
        sheets.append(page.moved(at(x, y, z, roll=rng.normal(0, 5))))
        pins.append(pin.moved(at(x, y, z + 0.13 * scale, pitch=90)))
    return [
        put(block((0.014, width_m, height_m)), cork, 0.009),
        put(bars(width_m, height_m, 0.025, 0.02), STEEL, 0.011),
        Part(joined(sheets), matt(texture=picture.pages(0))),
        Part(joined(pins), coated(BRICK)),
    ]


def glass_wall(_: Rng, width_m: float = 1.6, height_m: float = 2.2) -> list[Part]:
    """A pane on the floor in a slender frame of steel."""
    pane = put(card((width_m, height_m - 0.06)), PANE, 0, 0, height_m / 2)
    return [pane, put(bars(width_m, height_m - 0.06, 0.03, 0.03), BLACK, 0, 0, height_m / 2)]


def pipe(_: Rng, length_m: float = 4.0, radius_m: float = 0.03, colour: str = "#a4a7a6") -> list[Part]:
    """A level pipe along y with flanges, 6 cm off the wall."""
    flange = lathe(mm("0 -12, 1350 -12, 1350 12, 0 12") * [radius_m, 1])
    rings = [flange.moved(at(0, y, 0, roll=90)) for y in np.arange(0.4 - length_m / 2, length_m / 2, 1.2)]
    rod = tube([[0, -length_m / 2, 0], [0, length_m / 2, 0]], radius_m, sections=16)
    return [put(joined([rod, *rings]), coated(colour), 0.06 + radius_m)]


def lamp_housing(_: Rng, size_m: tuple[float, float] = (1.2, 0.3), hang_m: float = 0.1) -> list[Part]:
    """What is above a level panel that shines down at z = 0 and hangs hang_m below its ceiling."""
    x, y = size_m
    rods = [tube([[s * x, 0, 0.03], [s * x, 0, hang_m]], 0.004) for s in (-0.35, 0.35)]
    return [stood((x + 0.03, y + 0.03, 0.035), WHITE, 0, 0, 0.001, bevel=0.006), Part(joined(rods), STEEL)]


def spot_housing(_: Rng) -> list[Part]:
    """A can behind a bulb at the origin that shines along x."""
    return [put(lathe(mm("0 -160, 30 -160, 45 -140, 45 -4, 0 -4")), BLACK, pitch=90)]
