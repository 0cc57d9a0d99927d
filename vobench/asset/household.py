"""Furniture and lamps for homes and halls. They stand on the plane z = 0 at the origin, and face x."""

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture
from vobench.asset.furniture import (
    BLACK,
    DARK,
    SIDES,
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
    Draw,
    Rng,
    one_of,
)
from vobench.asset.shape import at, block, card, cushion, lathe, sheet, spline, tube
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import flipped, joined, moved

if TYPE_CHECKING:
    from trimesh import Trimesh

Slat = tuple[tuple[float, float, float], float, float]  # the size of a slat, and the y and z of its centre

# The back of a chair with slats
SLAT_BACK_X_M = -0.2  # the x of its centre
SLAT_BACK_Z_M = 0.45  # the z of its centre
SLAT_BACK_TILT_DEG = -5
SLAT_BACK_SLOPE = 0.0875  # the tangent of the tilt

# Couches
MORE_THAN_TWO_SEATS_M = 1.95  # a wider couch has three seats instead of two
SLIM_ARM_M = 0.12  # an arm that is wider is also higher

# Rugs
LOZENGES = 16  # the number of lozenges in each row of a woven rug, and the number of rows
BORDER_PX = 14  # the width of each stripe of the border

# Televisions
SCREEN_ASPECT = 0.57  # the height divided by the width
TELEVISION_CD_M2 = (120.0, 120.0, 120.0)  # the luminance of white

# Lamps
SHADE_M = 0.28  # the height of the shade of a floor lamp
SHADE_TAPER = 0.35  # the top of a shade is narrower than the bottom by this share
INNER_SCALE = 0.985  # the width of the inside of a shade relative to the outside
CEILING_LAMP_M = 0.07  # the height of a ceiling lamp
PENDANT_WIDTH_M = 0.4  # the width of a pendant lamp to which the profile of its shade applies

FRUITS = 7  # the number of fruits in a bowl; the last one lies on top of the others
FRUIT_COLOURS = ("#a62a22", "#8fa03a", "#d8812a", "#c9492c")


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
    leg_m = height_m - 0.03  # the height of a leg
    leg_profile = np.array([[0, 0], [0.018, 0], [0.03, leg_m], [0, leg_m]])
    leg = lathe(leg_profile, sections=12)
    parts = [put(leg, look, end * leg_x, side * leg_y) for end, side in product(SIDES, SIDES)]

    side_apron_m = (0.02, 2 * leg_y, 0.07)
    end_apron_m = (2 * leg_x, 0.02, 0.07)
    apron_z = height_m - 0.1
    parts += [stood(side_apron_m, look, end * leg_x, z=apron_z) for end in SIDES]
    parts += [stood(end_apron_m, look, 0, side * leg_y, apron_z) for side in SIDES]

    top_m = (depth_m, width_m, 0.03)
    u = rng.uniform(0, 2)
    parts.append(stood(top_m, look, z=height_m - 0.03, bevel=0.006, u=u))
    return parts


def dining_chair(_: Rng, colour: str = SAND, tones: str = "oak") -> list[Part]:
    """A wooden chair with a cushion. A person who sits on it looks along x."""
    look = wood(tones)
    legs = []
    for side in SIDES:
        front = [[0.2, side * 0.19, 0], [0.19, side * 0.18, 0.44]]
        legs.append(tube(front, 0.016, sections=10))
    for side in SIDES:
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
    """A chair made of square bars, with slats in its back. A person who sits on it looks along x."""
    look = wood(tones)
    seat_m = (0.42, 0.42, 0.028)
    leg_m = (0.036, 0.036, 0.43)
    post = block((0.032, 0.036, 0.9), bevel_m=0.004)  # a hind leg that continues upwards as a side of the back
    parts = [stood(seat_m, look, z=0.43, bevel=0.008, u=rng.uniform(0, 2))]
    for side in SIDES:
        y = side * 0.18
        parts.append(stood(leg_m, look, 0.18, y, bevel=0.003))
        parts.append(put(post, look, SLAT_BACK_X_M, y, SLAT_BACK_Z_M, pitch=SLAT_BACK_TILT_DEG))

    has_level_slats = rng.random() < 0.5
    slats = _level_slats() if has_level_slats else _upright_slats()
    for size_m, y, z in slats:
        x = SLAT_BACK_X_M - SLAT_BACK_SLOPE * (z - SLAT_BACK_Z_M)
        parts.append(put(block(size_m, bevel_m=0.003), look, x, y, z, pitch=SLAT_BACK_TILT_DEG))
    if has_pad:
        pad = cushion((0.4, 0.4, 0.045), power=6, cells=4)
        parts.append(put(pad, cloth(colour), 0.01, z=0.477))
    return parts


def _level_slats() -> list[Slat]:
    """Three horizontal slats."""
    size_m = (0.016, 0.34, 0.06)
    return [(size_m, 0.0, z) for z in (0.58, 0.7, 0.82)]


def _upright_slats() -> list[Slat]:
    """Three vertical slats below a horizontal one."""
    size_m = (0.014, 0.03, 0.36)
    top_m = (0.02, 0.34, 0.06)
    upright = [(size_m, y, 0.68) for y in (-0.1, 0.0, 0.1)]
    top = (top_m, 0.0, 0.86)
    return [*upright, top]


def couch(
    rng: Rng,
    width_m: float = 2.0,
    colour: str = SAGE,
    tones: str = "oak",
    accents: tuple[str, str] = (OCHRE, BRICK),
) -> list[Part]:
    """A sofa with two or three seats on wooden legs, with cushions. It is 0.9 m deep, and centred at the origin."""
    cover = cloth(colour)
    seats = 3 if width_m > MORE_THAN_TWO_SEATS_M else 2
    arm_m = float(rng.choice([0.1, 0.16, 0.2]))
    arm_height_m = 0.42 if arm_m > SLIM_ARM_M else 0.34
    seat_m = (width_m - 2 * arm_m) / seats
    base_z = float(rng.choice([0.12, 0.16]))  # the height of the visible part of the legs

    base = cushion((0.86, width_m - 0.02, 0.2), power=14, cells=4)
    back = cushion((0.2, width_m - 0.04, 0.5), power=9, cells=4)
    arm = cushion((0.86, arm_m, arm_height_m), power=8, cells=4)
    leg_m = (0.05, 0.05, base_z + 0.03)
    parts = [put(base, cover, z=base_z + 0.1), put(back, cover, -0.34, z=0.53, pitch=-5)]
    for side in SIDES:
        parts.append(put(arm, cover, 0, side * (width_m - arm_m) / 2, 0.36))
        leg_y = side * (width_m / 2 - 0.09)
        parts += [stood(leg_m, wood(tones), x, leg_y, bevel=0.004) for x in (-0.36, 0.36)]

    seat = cushion((0.68, seat_m - 0.006, 0.16), power=7, cells=4)
    rest = cushion((0.17, seat_m - 0.012, 0.4), power=5, cells=4)
    for number in range(seats):
        y = (number - (seats - 1) / 2) * seat_m
        parts.append(put(seat, cover, 0.09, y, 0.37))
        parts.append(put(rest, cover, -0.18, y, 0.6, pitch=-11))

    loose = cushion((0.12, 0.42, 0.4), power=2.8, cells=4)
    for side, accent in zip(SIDES, accents, strict=True):
        has_cushion = rng.random() < 0.75
        if has_cushion:
            y = side * (width_m / 2 - arm_m - 0.24)
            parts.append(put(loose, cloth(accent), -0.03, y, 0.61, pitch=-18, yaw=side * 8))
    return parts


@picture.painted
def _weave(seed: int, px: int = 1024) -> Picture:
    """A woven pattern: rows of lozenges in a few colours inside a border. It is symmetrical from top to bottom."""
    rng = np.random.default_rng(seed)
    inks = rng.permutation([NAVY, BRICK, OCHRE, SAGE, INK, "#7d6a58"]).tolist()
    *row_inks, border_ink = inks
    image = Image.new("RGB", (px, px), SAND)
    draw = ImageDraw.Draw(image)
    cell_px = px / LOZENGES
    for row in range(LOZENGES):
        mirrored_row = min(row, LOZENGES - 1 - row)
        ink = row_inks[mirrored_row % len(row_inks)]
        is_narrow = row % 3 == 0
        half_width_px = cell_px * (0.3 if is_narrow else 0.62)
        y = (row + 0.5) * cell_px
        for column in range(LOZENGES):
            x = (column + 0.5) * cell_px
            _draw_lozenge(draw, x, y, half_width_px, cell_px=cell_px, ink=ink)

    for number, ink in enumerate((border_ink, SAND, row_inks[0])):
        start_px = number * BORDER_PX
        end_px = px - 1 - number * BORDER_PX
        draw.rectangle([start_px, start_px, end_px, end_px], outline=ink, width=BORDER_PX)

    coarse = picture.noise(rng, px, 120, 500, slope=0.0)
    fine = picture.noise(rng, px, 2, 12)
    pile = 1 + 0.1 * coarse + 0.05 * fine
    woven = np.asarray(image) * pile[..., None]
    return Picture(np.clip(woven, 0, 255).astype(np.uint8))


def _draw_lozenge(draw: Draw, x: float, y: float, half_width_px: float, *, cell_px: float, ink: str) -> None:
    """Draw a lozenge around (x, y), with a dot in its middle."""
    half_height_px = 0.45 * cell_px
    dot_px = 0.1 * cell_px
    corners_px = [
        (x - half_width_px, y),
        (x, y - half_height_px),
        (x + half_width_px, y),
        (x, y + half_height_px),
    ]
    draw.polygon(corners_px, fill=ink)
    draw.ellipse([x - dot_px, y - dot_px, x + dot_px, y + dot_px], fill=SAND)


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
    """A flat television on two feet. It shows a picture of hills."""
    height_m = SCREEN_ASPECT * width_m
    glow = Material(
        colour=(0.02, 0.02, 0.02),
        emission_cd_m2=TELEVISION_CD_M2,
        emission_texture=picture.poster("hills", seed, 960, 540),
    )
    foot_m = (0.22, 0.03, 0.05)
    body_m = (0.04, width_m, height_m)
    screen = card((width_m - 0.02, height_m - 0.02))
    return [
        stood(foot_m, BLACK, 0, -0.3 * width_m),
        stood(foot_m, BLACK, 0, 0.3 * width_m),
        stood(body_m, BLACK, z=0.04, bevel=0.004),
        put(screen, glow, 0.0205, z=0.04 + height_m / 2),
    ]


def _shade(colour: str, width_m: float, height_m: float) -> list[Part]:
    """A conical lampshade of cloth on the plane z = 0. It is open at both ends, and white inside."""
    angle = np.linspace(0, 2 * np.pi, 33)
    height_share = np.array([0.0, 1.0])[:, None]  # at the bottom and at the top
    radius = width_m / 2 * (1 - SHADE_TAPER * height_share)
    x = radius * np.cos(angle)
    y = radius * np.sin(angle)
    z = height_m * height_share + 0 * angle

    cone = sheet(np.stack([x, y, z], axis=-1))
    faces_outward = cone.vertex_normals[0] @ [1, 0, 0] > 0
    outer = cone if faces_outward else flipped(cone)
    inner = moved(flipped(outer), np.diag([INNER_SCALE, INNER_SCALE, 1, 1]))
    return [Part(outer, cloth(colour)), Part(inner, WHITE)]


def bulb(x_m: float, y_m: float, z_m: float, width_m: float = 0.07) -> "Trimesh":
    """The mesh of a round light bulb."""
    ball = cushion((width_m, width_m, width_m), power=2, cells=3)
    return moved(ball, at(x_m, y_m, z_m))


def floor_lamp(
    _: Rng,
    height_m: float = 1.6,
    colour: str = SAND,
    wide_m: float = 0.42,
) -> list[Part]:
    """A floor lamp with a cloth shade. Its bulb has to be placed 0.15 m below `height_m`."""
    foot_profile = mm("0 0, 130 0, 130 12, 40 22, 12 30, 0 30")
    foot_scale = 0.6 + 0.25 * height_m  # a higher lamp needs a larger foot
    foot = lathe(foot_profile * foot_scale)
    stem_path = np.array([[0, 0, 0.01], [0, 0, height_m - 0.2]])
    stem = tube(stem_path, 0.011)
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
    """A pendant lamp. Its shade ends `drop_m` below z = 0. Its bulb has to be placed 0.08 m above that end."""
    scale = wide_m / PENDANT_WIDTH_M
    profile = mm("200 0, 196 60, 160 130, 70 190, 30 230, 0 232")
    shade = lathe(profile * scale, sections=sections)
    inner = moved(flipped(shade), np.diag([INNER_SCALE, INNER_SCALE, INNER_SCALE, 1]))
    paint = coated(colour or one_of(rng, NAVY, INK, "#5c6b5a"), roughness=0.3)
    cord_path = np.array([[0, 0, 0.2 - drop_m], [0, 0, 0]])
    cord = tube(cord_path, 0.004, sections=6)
    ceiling_rose = lathe(mm("0 -30, 50 -25, 50 0, 0 0"))
    return [
        put(shade, paint, z=-drop_m),
        put(inner, WHITE, z=-drop_m),
        put(cord, DARK),
        put(ceiling_rose, WHITE),
    ]


def diffuser(x_m: float, y_m: float, z_m: float, width_m: float) -> "Trimesh":
    """The mesh of a disc that faces down, for the light that leaves a shade."""
    angle = np.linspace(0, 2 * np.pi, 17)
    ring = np.stack([width_m / 2 * np.cos(angle), width_m / 2 * np.sin(angle), 0 * angle], axis=-1)
    middle = np.zeros_like(ring)
    disc = sheet(np.stack([middle, ring]))
    faces_down = disc.face_normals[0, 2] < 0
    downward_disc = disc if faces_down else flipped(disc)
    return moved(downward_disc, at(x_m, y_m, z_m))


def glowing_shade(x_m: float, y_m: float, top_m: float, width_m: float) -> "Trimesh":
    """The mesh of the outside of a floor lamp's shade, which emits light. Its top is at `top_m`."""
    outer = _shade(SAND, 1.01 * width_m, SHADE_M)[0]
    return moved(outer.mesh, at(x_m, y_m, top_m - SHADE_M))


def ceiling_lamp(_: Rng, width_m: float = 0.4, *, is_round: bool = True) -> list[Part]:
    """The body of a flat lamp below z = 0, round or square. Its light has to be placed at the lower face."""
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
    ring_count = FRUITS - 1
    for number in range(FRUITS):
        is_on_top = number == ring_count
        angle = 2 * np.pi * number / ring_count
        radius = 0.0 if is_on_top else 0.068
        x = radius * np.cos(angle)
        y = radius * np.sin(angle)
        z = 0.12 if is_on_top else 0.075
        colour = one_of(rng, *FRUIT_COLOURS)
        parts.append(put(fruit, coated(colour, roughness=0.25), x, y, z))
    return parts


def low_board(
    rng: Rng,
    width_m: float = 1.9,
    height_m: float = 0.46,
    depth_m: float = 0.42,
    tones: str = "oak",
) -> list[Part]:
    """A low cupboard on a recessed base. It has two doors, and between them an open compartment with boxes."""
    look = wood(tones)
    third_m = width_m / 3
    inner_m = height_m - 0.1  # the height between the base and the top
    foot_m = (depth_m - 0.1, width_m - 0.12, 0.06)
    board_m = (depth_m, width_m, 0.022)
    back_m = (0.01, width_m - 0.04, inner_m)
    parts = [
        stood(foot_m, DARK),
        stood(board_m, look, z=height_m - 0.022, u=rng.uniform(0, 2)),
        stood(board_m, look, z=0.06),
        stood(back_m, look, 0.01 - depth_m / 2, z=0.07),
    ]

    body_m = (depth_m - 0.01, third_m, inner_m - 0.02)
    door_m = (0.018, third_m - 0.006, inner_m - 0.026)
    knob = cushion((0.03, 0.03, 0.03), power=2, cells=4)
    for side in SIDES:
        y = side * third_m
        knob_y = side * 0.62 * third_m
        parts.append(stood(body_m, look, -0.01, y, 0.08, u=side))
        parts.append(stood(door_m, look, depth_m / 2 - 0.008, y, 0.083, u=3 * side))
        parts.append(put(knob, DARK, depth_m / 2 + 0.01, knob_y, 0.55 * height_m))

    cardboard = cloth(one_of(rng, SAGE, SAND, NAVY))
    box_m = (0.28, 0.42 * third_m, 0.6 * inner_m)
    for side in SIDES:
        box_y = side * 0.24 * third_m
        parts.append(stood(box_m, cardboard, 0, box_y, 0.083))
    return parts
