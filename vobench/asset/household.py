"""What stands and hangs in homes and halls; parts on z = 0 around the origin, their front towards x."""

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture
from vobench.asset.furniture import BLACK, DARK, STEEL, WHITE, Part, cloth, coated, matt, mm, put, stood, wood
from vobench.asset.picture import BRICK, INK, NAVY, OCHRE, SAGE, SAND, Rng, some
from vobench.asset.shape import at, card, cushion, lathe, sheet, spline, tube
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import Mesh, joined


def table(
    rng: Rng, width_m: float = 1.5, depth_m: float = 0.85, height_m: float = 0.74, tones: str = "oak"
) -> list[Part]:
    """A table top on an apron and four tapered legs."""
    look = wood(tones)
    d = depth_m / 2 - 0.06
    w = width_m / 2 - 0.06
    h = height_m
    leg = lathe(np.array([[0, 0], [0.018, 0], [0.03, h - 0.03], [0, h - 0.03]]), sections=12)
    parts = [put(leg, look, s * d, t * w) for s in (-1, 1) for t in (-1, 1)]
    parts += [stood((0.02, 2 * w, 0.07), look, s * d, 0, h - 0.1) for s in (-1, 1)]
    parts += [stood((2 * d, 0.02, 0.07), look, 0, t * w, h - 0.1) for t in (-1, 1)]
    return [*parts, stood((depth_m, width_m, 0.03), look, 0, 0, h - 0.03, bevel=0.006, u=rng.uniform(0, 2))]


def dining_chair(_: Rng, colour: str = SAND, tones: str = "oak") -> list[Part]:
    """A wooden chair with a cushion; who sits on it looks along x."""
    look = wood(tones)
    legs = [[[0.2, s * 0.19, 0], [0.19, s * 0.18, 0.44]] for s in (-1, 1)]
    legs += [spline(mm(f"-240 {s * 190} 0, -190 {s * 180} 440, -250 {s * 175} 860"), 10).tolist() for s in (-1, 1)]
    rails = [spline(mm(f"{x} -175 {z}, {x - 30} 0 {z}, {x} 175 {z}"), 9) for x, z in ((-232, 740), (-243, 820))]
    return [
        Part(joined([tube(leg, 0.016, sections=10) for leg in legs]), look),
        Part(joined([tube(rail, 0.02) for rail in rails]), look),
        stood((0.42, 0.42, 0.025), look, 0, 0, 0.425, bevel=0.01),
        put(cushion((0.4, 0.4, 0.05), power=6), cloth(colour), 0, 0, 0.47),
    ]


@picture.painted
def _weave(seed: int, px: int = 1024) -> Picture:
    """Bands of lozenges in few colours within a border, woven."""
    rng = np.random.default_rng(seed)
    inks = rng.permutation([NAVY, BRICK, OCHRE, SAGE, INK, "#7d6a58"])
    image = Image.new("RGB", (px, px), SAND)
    draw = ImageDraw.Draw(image)
    side = px / 16
    for row in range(16):
        y = (row + 0.5) * side
        ink = str(inks[row % 5 if row < 8 else (15 - row) % 5])
        for k in range(16):
            x = (k + 0.5) * side
            r = side * (0.62 if row % 3 else 0.3)
            draw.polygon([(x - r, y), (x, y - 0.45 * side), (x + r, y), (x, y + 0.45 * side)], fill=ink)
            draw.ellipse([x - 0.1 * side, y - 0.1 * side, x + 0.1 * side, y + 0.1 * side], fill=SAND)
    for k, ink in enumerate((str(inks[5]), SAND, str(inks[0]))):
        draw.rectangle([k * 14, k * 14, px - 1 - k * 14, px - 1 - k * 14], outline=ink, width=14)
    pile = 1 + 0.1 * picture.noise(rng, px, 120, 500, slope=0.0) + 0.05 * picture.noise(rng, px, 2, 12)
    return Picture(np.clip(np.asarray(image) * pile[..., None], 0, 255).astype(np.uint8))


def rug(_: Rng, width_m: float = 2.4, depth_m: float = 1.7, seed: int = 0) -> list[Part]:
    """A woven rug on the floor."""
    top = card((width_m, depth_m)).moved(at(z_m=0.0085, pitch=-90))
    return [stood((depth_m, width_m, 0.008), cloth(SAND), bevel=0.003), Part(top, matt(texture=_weave(seed)))]


def television(_: Rng, width_m: float = 1.2, seed: int = 0) -> list[Part]:
    """A flat screen on two feet that shows hills."""
    h = 0.57 * width_m
    shows = picture.poster("hills", seed, 960, 540)
    glow = Material(colour=(0.02, 0.02, 0.02), emission_cd_m2=(120.0, 120.0, 120.0), emission_texture=shows)
    feet = [stood((0.22, 0.03, 0.05), BLACK, 0, s * 0.3 * width_m) for s in (-1, 1)]
    body = stood((0.04, width_m, h), BLACK, 0, 0, 0.04, bevel=0.004)
    return [*feet, body, put(card((width_m - 0.02, h - 0.02)), glow, 0.0205, 0, 0.04 + h / 2)]


def _shade(colour: str, wide_m: float, high_m: float) -> list[Part]:
    """A cone of cloth, open at both ends, from z = 0 up, white within."""
    turn = np.linspace(0, 2 * np.pi, 33)
    z = np.array([0.0, 1.0])[:, None]
    r = wide_m / 2 * (1 - 0.35 * z)
    cone = sheet(np.stack([r * np.cos(turn), r * np.sin(turn), high_m * z + 0 * turn], axis=-1))
    outer = cone if cone.normals[0] @ [1, 0, 0] > 0 else cone.flipped()
    return [Part(outer, cloth(colour)), Part(outer.flipped().moved(np.diag([0.985, 0.985, 1, 1])), WHITE)]


def bulb(x_m: float, y_m: float, z_m: float, width_m: float = 0.07) -> Mesh:
    """A round bulb, to be the mesh of a lamp."""
    return cushion((width_m, width_m, width_m), power=2, cells=3).moved(at(x_m, y_m, z_m))


def floor_lamp(_: Rng, height_m: float = 1.6, colour: str = SAND, wide_m: float = 0.42) -> list[Part]:
    """A lamp on a foot with a shade of cloth; its bulb would be at height_m less 0.15."""
    foot = lathe(mm("0 0, 130 0, 130 12, 40 22, 12 30, 0 30") * [1, 1] * (0.6 + 0.25 * height_m))
    stem = tube(np.array([[0, 0, 0.01], [0, 0, height_m - 0.2]]), 0.011)
    shade = [part.moved(at(z_m=height_m - 0.28)) for part in _shade(colour, wide_m, 0.28)]
    return [put(foot, BLACK), put(stem, STEEL), *shade]


def pendant(rng: Rng, drop_m: float = 1.0, colour: str = "", wide_m: float = 0.4) -> list[Part]:
    """A lamp that hangs from z = 0 by a cord; its shade ends drop_m below, its bulb would be 0.08 higher."""
    shade = lathe(mm("200 0, 196 60, 160 130, 70 190, 30 230, 0 232") * [wide_m / 0.4, wide_m / 0.4], sections=36)
    inner = shade.flipped().moved(np.diag([0.985, 0.985, 0.985, 1]))
    paint = coated(colour or some(rng, NAVY, INK, "#5c6b5a"), roughness=0.3)
    cord = tube(np.array([[0, 0, 0.2 - drop_m], [0, 0, 0]]), 0.004, sections=6)
    rose = lathe(mm("0 -30, 50 -25, 50 0, 0 0"))
    return [put(shade, paint, z=-drop_m), put(inner, WHITE, z=-drop_m), put(cord, DARK), put(rose, WHITE)]


def fruit_bowl(rng: Rng) -> list[Part]:
    """A bowl of apples and oranges."""
    bowl = lathe(mm("0 0, 50 0, 55 8, 120 50, 150 95, 146 96, 112 56, 50 16, 0 14"), sections=32)
    parts = [put(bowl, coated("#d8d2c4", roughness=0.15))]
    for k in range(7):
        a = 2 * np.pi * k / 6
        r = 0.068 if k < 6 else 0.0
        z = 0.075 if k < 6 else 0.12
        skin = coated(some(rng, "#a62a22", "#8fa03a", "#d8812a", "#c9492c"), roughness=0.25)
        parts.append(put(cushion((0.074, 0.074, 0.066), power=2.1, cells=5), skin, r * np.cos(a), r * np.sin(a), z))
    return parts


def low_board(
    rng: Rng, width_m: float = 1.9, height_m: float = 0.46, depth_m: float = 0.42, tones: str = "oak"
) -> list[Part]:
    """A low cupboard on a recessed foot, with doors and an open bay of boxes in its middle."""
    look = wood(tones)
    w = width_m
    d = depth_m
    h = height_m
    third = w / 3
    inner = h - 0.1
    parts = [stood((d - 0.1, w - 0.12, 0.06), DARK), stood((d, w, 0.022), look, 0, 0, h - 0.022, u=rng.uniform(0, 2))]
    parts += [stood((d, w, 0.022), look, 0, 0, 0.06), stood((0.01, w - 0.04, inner), look, 0.01 - d / 2, 0, 0.07)]
    for s in (-1, 1):
        parts.append(stood((d - 0.01, third, inner - 0.02), look, -0.01, s * third, 0.08, u=s))
        parts.append(stood((0.018, third - 0.006, inner - 0.026), look, d / 2 - 0.008, s * third, 0.083, u=3 * s))
        parts.append(put(cushion((0.03, 0.03, 0.03), power=2, cells=4), DARK, d / 2 + 0.01, s * 0.62 * third, 0.55 * h))
    box = cloth(some(rng, SAGE, SAND, NAVY))
    return [*parts, *(stood((0.28, 0.42 * third, 0.6 * inner), box, 0, s * 0.24 * third, 0.083) for s in (-1, 1))]
