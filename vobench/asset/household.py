"""Furniture and lamps for homes and halls. They stand on z = 0 at the origin and face x."""

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture
from vobench.asset.furniture import (
    BLACK,
    DARK,
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
from vobench.asset.picture import (
    BRICK,
    INK,
    NAVY,
    OCHRE,
    SAGE,
    SAND,
    Rng,
    one_of,
)
from vobench.asset.shape import at, block, card, cushion, lathe, sheet, spline, tube
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import flipped, joined, moved

if TYPE_CHECKING:
    from trimesh import Trimesh


def table(
    rng: Rng,
    width_m: float = 1.5,
    depth_m: float = 0.85,
    height_m: float = 0.74,
    tones: str = "oak",
) -> list[Part]:
    """A table top on an apron and four tapered legs."""
    look = wood(tones)
    leg_x = depth_m / 2 - 0.06
    leg_y = width_m / 2 - 0.06
    h = height_m

    leg_profile = np.array([[0, 0], [0.018, 0], [0.03, h - 0.03], [0, h - 0.03]])
    leg = lathe(leg_profile, sections=12)
    parts = [put(leg, look, s * leg_x, t * leg_y) for s, t in product((-1, 1), (-1, 1))]

    side_m = (0.02, 2 * leg_y, 0.07)
    end_m = (2 * leg_x, 0.02, 0.07)
    parts += [stood(side_m, look, s * leg_x, 0, h - 0.1) for s in (-1, 1)]
    parts += [stood(end_m, look, 0, t * leg_y, h - 0.1) for t in (-1, 1)]

    top_m = (depth_m, width_m, 0.03)
    u = rng.uniform(0, 2)
    parts.append(stood(top_m, look, 0, 0, h - 0.03, bevel=0.006, u=u))
    return parts


def dining_chair(_: Rng, colour: str = SAND, tones: str = "oak") -> list[Part]:
    """A wooden chair with a cushion; a person on it looks along x."""
    look = wood(tones)
    legs = []
    for side in (-1, 1):
        front = [[0.2, side * 0.19, 0], [0.19, side * 0.18, 0.44]]
        legs.append(tube(front, 0.016, sections=10))
    for side in (-1, 1):
        back = mm(f"-240 {side * 190} 0, -190 {side * 180} 440, -250 {side * 175} 860")
        legs.append(tube(spline(back, 10), 0.016, sections=10))

    rails = []
    for x, z in ((-232, 740), (-243, 820)):
        bend = mm(f"{x} -175 {z}, {x - 30} 0 {z}, {x} 175 {z}")
        rails.append(tube(spline(bend, 9), 0.02))

    seat_m = (0.42, 0.42, 0.025)
    pad = cushion((0.4, 0.4, 0.05), power=6)
    return [
        Part(joined(legs), look),
        Part(joined(rails), look),
        stood(seat_m, look, 0, 0, 0.425, bevel=0.01),
        put(pad, cloth(colour), 0, 0, 0.47),
    ]


def slat_chair(rng: Rng, colour: str = SAND, tones: str = "oak", *, has_pad: bool = True) -> list[Part]:
    """A chair of square bars with slats in its back; a person on it looks along x."""
    look = wood(tones)
    parts = [stood((0.42, 0.42, 0.028), look, 0, 0, 0.43, bevel=0.008, u=rng.uniform(0, 2))]
    for side in (-1, 1):
        parts.append(stood((0.036, 0.036, 0.43), look, 0.18, side * 0.18, bevel=0.003))
        post = block((0.032, 0.036, 0.9), bevel_m=0.004)
        parts.append(put(post, look, -0.2, side * 0.18, 0.45, pitch=-5))
    level = rng.random() < 0.5
    slats = [((0.016, 0.34, 0.06), 0.0, z) for z in (0.58, 0.7, 0.82)]
    if not level:
        slats = [((0.014, 0.03, 0.36), y, 0.68) for y in (-0.1, 0.0, 0.1)]
        slats.append(((0.02, 0.34, 0.06), 0.0, 0.86))
    for size_m, y, z in slats:
        x = -0.2 - 0.0875 * (z - 0.45)
        parts.append(put(block(size_m, bevel_m=0.003), look, x, y, z, pitch=-5))
    if has_pad:
        pad = cushion((0.4, 0.4, 0.045), power=6, cells=4)
        parts.append(put(pad, cloth(colour), 0.01, 0, 0.477))
    return parts


def couch(
    rng: Rng,
    width_m: float = 2.0,
    colour: str = SAGE,
    tones: str = "oak",
    accents: tuple[str, str] = (OCHRE, BRICK),
) -> list[Part]:
    """A sofa 0.9 m deep for two or three on wooden legs, with cushions; its middle is at the origin."""
    cover = cloth(colour)
    seats = 3 if width_m > 1.95 else 2
    arm_m = float(rng.choice([0.1, 0.16, 0.2]))
    seat_m = (width_m - 2 * arm_m) / seats
    rises = float(rng.choice([0.12, 0.16]))
    base = cushion((0.86, width_m - 0.02, 0.2), power=14, cells=4)
    back = cushion((0.2, width_m - 0.04, 0.5), power=9, cells=4)
    arm = cushion((0.86, arm_m, 0.42 if arm_m > 0.12 else 0.34), power=8, cells=4)
    parts = [put(base, cover, 0, 0, rises + 0.1), put(back, cover, -0.34, 0, 0.53, pitch=-5)]
    for side in (-1, 1):
        parts.append(put(arm, cover, 0, side * (width_m - arm_m) / 2, 0.36))
        leg_y = side * (width_m / 2 - 0.09)
        parts += [stood((0.05, 0.05, rises + 0.03), wood(tones), x, leg_y, bevel=0.004) for x in (-0.36, 0.36)]
    seat = cushion((0.68, seat_m - 0.006, 0.16), power=7, cells=4)
    rest = cushion((0.17, seat_m - 0.012, 0.4), power=5, cells=4)
    for k in range(seats):
        y = (k - (seats - 1) / 2) * seat_m
        parts.append(put(seat, cover, 0.09, y, 0.37))
        parts.append(put(rest, cover, -0.18, y, 0.6, pitch=-11))
    loose = cushion((0.12, 0.42, 0.4), power=2.8, cells=4)
    for side, accent in zip((-1, 1), accents, strict=True):
        if rng.random() < 0.75:
            y = side * (width_m / 2 - arm_m - 0.24)
            parts.append(put(loose, cloth(accent), -0.03, y, 0.61, pitch=-18, yaw=side * 8))
    return parts


@picture.painted
def _weave(seed: int, px: int = 1024) -> Picture:
    """A woven pattern: rows of lozenges in a few colours, inside a border."""
    rng = np.random.default_rng(seed)
    inks = rng.permutation([NAVY, BRICK, OCHRE, SAGE, INK, "#7d6a58"]).tolist()
    image = Image.new("RGB", (px, px), SAND)
    draw = ImageDraw.Draw(image)
    side = px / 16

    for row in range(16):
        band = row if row < 8 else 15 - row
        ink = inks[band % 5]
        half_width = side * (0.62 if row % 3 else 0.3)
        y = (row + 0.5) * side
        for column in range(16):
            x = (column + 0.5) * side
            lozenge = [
                (x - half_width, y),
                (x, y - 0.45 * side),
                (x + half_width, y),
                (x, y + 0.45 * side),
            ]
            dot = 0.1 * side
            draw.polygon(lozenge, fill=ink)
            draw.ellipse([x - dot, y - dot, x + dot, y + dot], fill=SAND)

    for k, ink in enumerate((inks[5], SAND, inks[0])):
        start = k * 14
        end = px - 1 - k * 14
        draw.rectangle([start, start, end, end], outline=ink, width=14)

    coarse = picture.noise(rng, px, 120, 500, slope=0.0)
    fine = picture.noise(rng, px, 2, 12)
    pile = 1 + 0.1 * coarse + 0.05 * fine
    woven = np.asarray(image) * pile[..., None]
    return Picture(np.clip(woven, 0, 255).astype(np.uint8))


def rug(
    _: Rng,
    width_m: float = 2.4,
    depth_m: float = 1.7,
    seed: int = 0,
) -> list[Part]:
    """A woven rug on the floor."""
    base_m = (depth_m, width_m, 0.008)
    top = moved(card((width_m, depth_m)), at(z_m=0.0085, pitch=-90))
    return [
        stood(base_m, cloth(SAND), bevel=0.003),
        Part(top, matt(texture=_weave(seed))),
    ]


def television(
    _: Rng,
    width_m: float = 1.2,
    seed: int = 0,
) -> list[Part]:
    """A flat screen on two feet that shows hills."""
    h = 0.57 * width_m
    glow = Material(
        colour=(0.02, 0.02, 0.02),
        emission_cd_m2=(120.0, 120.0, 120.0),
        emission_texture=picture.poster("hills", seed, 960, 540),
    )
    foot_m = (0.22, 0.03, 0.05)
    body_m = (0.04, width_m, h)
    screen = card((width_m - 0.02, h - 0.02))
    return [
        stood(foot_m, BLACK, 0, -0.3 * width_m),
        stood(foot_m, BLACK, 0, 0.3 * width_m),
        stood(body_m, BLACK, 0, 0, 0.04, bevel=0.004),
        put(screen, glow, 0.0205, 0, 0.04 + h / 2),
    ]


SHADE_M = 0.28  # height of the shade of a floor lamp


def _shade(colour: str, width_m: float, height_m: float) -> list[Part]:
    """A conical lampshade of cloth on z = 0, open at both ends and white inside."""
    angle = np.linspace(0, 2 * np.pi, 33)
    share = np.array([0.0, 1.0])[:, None]
    radius = width_m / 2 * (1 - 0.35 * share)
    x = radius * np.cos(angle)
    y = radius * np.sin(angle)
    z = height_m * share + 0 * angle

    cone = sheet(np.stack([x, y, z], axis=-1))
    looks_outward = cone.vertex_normals[0] @ [1, 0, 0] > 0
    outer = cone if looks_outward else flipped(cone)
    inner = moved(flipped(outer), np.diag([0.985, 0.985, 1, 1]))
    return [Part(outer, cloth(colour)), Part(inner, WHITE)]


def bulb(x_m: float, y_m: float, z_m: float, width_m: float = 0.07) -> "Trimesh":
    """A round bulb, for the mesh of a lamp."""
    ball = cushion((width_m, width_m, width_m), power=2, cells=3)
    return moved(ball, at(x_m, y_m, z_m))


def floor_lamp(
    _: Rng,
    height_m: float = 1.6,
    colour: str = SAND,
    wide_m: float = 0.42,
) -> list[Part]:
    """A floor lamp with a cloth shade. The bulb belongs 0.15 m below `height_m`."""
    foot_profile = mm("0 0, 130 0, 130 12, 40 22, 12 30, 0 30") * [1, 1]
    foot = lathe(foot_profile * (0.6 + 0.25 * height_m))
    stem = tube(np.array([[0, 0, 0.01], [0, 0, height_m - 0.2]]), 0.011)
    raised = at(z_m=height_m - SHADE_M)
    shade = [part.moved(raised) for part in _shade(colour, wide_m, SHADE_M)]
    return [put(foot, BLACK), put(stem, STEEL), *shade]


def pendant(
    rng: Rng,
    drop_m: float = 1.0,
    colour: str = "",
    wide_m: float = 0.4,
    sections: int = 36,
) -> list[Part]:
    """A pendant lamp. Its shade ends `drop_m` below z = 0, and the bulb belongs 0.08 m above that."""
    scale = wide_m / 0.4
    profile = mm("200 0, 196 60, 160 130, 70 190, 30 230, 0 232") * [scale, scale]
    shade = lathe(profile, sections=sections)
    inner = moved(flipped(shade), np.diag([0.985, 0.985, 0.985, 1]))
    paint = coated(colour or one_of(rng, NAVY, INK, "#5c6b5a"), roughness=0.3)
    cord = tube(np.array([[0, 0, 0.2 - drop_m], [0, 0, 0]]), 0.004, sections=6)
    rose = lathe(mm("0 -30, 50 -25, 50 0, 0 0"))
    return [
        put(shade, paint, z=-drop_m),
        put(inner, WHITE, z=-drop_m),
        put(cord, DARK),
        put(rose, WHITE),
    ]


def diffuser(x_m: float, y_m: float, z_m: float, width_m: float) -> "Trimesh":
    """A disc that looks down, for the mesh of a lamp in a shade."""
    angle = np.linspace(0, 2 * np.pi, 17)
    ring = np.stack([width_m / 2 * np.cos(angle), width_m / 2 * np.sin(angle), 0 * angle], axis=-1)
    middle = np.zeros_like(ring)
    disc = sheet(np.stack([middle, ring]))
    looks_down = disc.face_normals[0, 2] < 0
    return moved(disc if looks_down else flipped(disc), at(x_m, y_m, z_m))


def glowing_shade(x_m: float, y_m: float, top_m: float, width_m: float) -> "Trimesh":
    """The outside of the shade of a floor lamp whose top is at `top_m`, for the mesh of a lamp."""
    outer = _shade(SAND, 1.01 * width_m, SHADE_M)[0]
    return moved(outer.mesh, at(x_m, y_m, top_m - SHADE_M))


CEILING_LAMP_M = 0.07  # height of a ceiling lamp


def ceiling_lamp(_: Rng, width_m: float = 0.4, *, is_round: bool = True) -> list[Part]:
    """The body of a flat lamp below z = 0, round or square. What shines is to be at its lower face."""
    paint = matt("#dcdbd6")
    if is_round:
        profile = [[0, -CEILING_LAMP_M], [width_m / 2, -CEILING_LAMP_M], [width_m / 2, 0], [0, 0]]
        return [put(lathe(np.array(profile), sections=24), paint)]
    return [stood((width_m, width_m, CEILING_LAMP_M), paint, 0, 0, -CEILING_LAMP_M, bevel=0.006)]


def fruit_bowl(rng: Rng) -> list[Part]:
    """A bowl of apples and oranges."""
    bowl = lathe(mm("0 0, 50 0, 55 8, 120 50, 150 95, 146 96, 112 56, 50 16, 0 14"), sections=32)
    parts = [put(bowl, coated("#d8d2c4", roughness=0.15))]

    fruit = cushion((0.074, 0.074, 0.066), power=2.1, cells=5)
    for k in range(7):
        is_on_top = k == 6
        angle = 2 * np.pi * k / 6
        radius = 0.0 if is_on_top else 0.068
        x = radius * np.cos(angle)
        y = radius * np.sin(angle)
        z = 0.12 if is_on_top else 0.075
        colour = one_of(rng, "#a62a22", "#8fa03a", "#d8812a", "#c9492c")
        parts.append(put(fruit, coated(colour, roughness=0.25), x, y, z))
    return parts


def low_board(
    rng: Rng,
    width_m: float = 1.9,
    height_m: float = 0.46,
    depth_m: float = 0.42,
    tones: str = "oak",
) -> list[Part]:
    """A low cupboard on a recessed foot, with doors and an open bay of boxes in its middle."""
    look = wood(tones)
    w = width_m
    d = depth_m
    h = height_m
    third = w / 3
    inner = h - 0.1

    board_m = (d, w, 0.022)
    back_m = (0.01, w - 0.04, inner)
    parts = [
        stood((d - 0.1, w - 0.12, 0.06), DARK),
        stood(board_m, look, 0, 0, h - 0.022, u=rng.uniform(0, 2)),
        stood(board_m, look, 0, 0, 0.06),
        stood(back_m, look, 0.01 - d / 2, 0, 0.07),
    ]

    body_m = (d - 0.01, third, inner - 0.02)
    door_m = (0.018, third - 0.006, inner - 0.026)
    knob = cushion((0.03, 0.03, 0.03), power=2, cells=4)
    for side in (-1, 1):
        y = side * third
        knob_y = side * 0.62 * third
        parts.append(stood(body_m, look, -0.01, y, 0.08, u=side))
        parts.append(stood(door_m, look, d / 2 - 0.008, y, 0.083, u=3 * side))
        parts.append(put(knob, DARK, d / 2 + 0.01, knob_y, 0.55 * h))

    box = cloth(one_of(rng, SAGE, SAND, NAVY))
    box_m = (0.28, 0.42 * third, 0.6 * inner)
    parts += [stood(box_m, box, 0, side * 0.24 * third, 0.083) for side in (-1, 1)]
    return parts
