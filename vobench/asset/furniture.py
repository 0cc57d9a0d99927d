"""Furniture and what lies on it: parts on z = 0 around the origin, their front towards x, their width along y."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from vobench.asset import picture
from vobench.asset.picture import BRICK, INK, NAVY, OCHRE, PAPER, SAGE, SAND, TEAL, Rng, Spines, some
from vobench.asset.shape import at, block, card, cushion, extrusion, lathe, sheet, spline, tube
from vobench.geometry.se3 import Array
from vobench.scene.material import Material, Texture, linear
from vobench.scene.mesh import Mesh, joined


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A mesh of one material."""

    mesh: Mesh
    material: Material

    def moved(self, T_a_b: Array) -> "Part":
        """The part of a frame b in the frame a."""
        return replace(self, mesh=self.mesh.moved(T_a_b))


def matt(colour: str = "#ffffff", texture: Texture | None = None) -> Material:
    """A surface of #rrggbb (times a texture) without gloss."""
    r, g, b = (float(c) for c in linear(np.array(picture.rgb(colour), np.uint8)))
    return Material(colour=(r, g, b), texture=texture)


def coated(colour: str = "#ffffff", texture: Texture | None = None, roughness: float = 0.3) -> Material:
    """Lacquer, plastic or glaze over a surface."""
    return replace(matt(colour, texture), eta=1.5, roughness=roughness)


STEEL = Material(colour=(0.52, 0.53, 0.54), metal=1.0, roughness=0.25)
CHROME = Material(colour=(0.65, 0.66, 0.67), metal=1.0, roughness=0.06)
BLACK, DARK, GREY, WHITE, CREAM = (coated(c) for c in ("#26282a", "#3d4144", "#a4a7a6", "#dcdbd6", "#e6e1d3"))
PAGE = matt("#e9e4d8")


def wood(kind: str) -> Material:
    """Lacquered wood of one of the pictures' tones."""
    return coated(texture=picture.boards(kind), roughness=0.28)


def cloth(colour: str) -> Material:
    """Woven cloth."""
    return matt(colour, picture.fabric())


def mm(places: str) -> Array:
    """Places (N, K) in metres of a text like "0 0, 34 0, 40 8" in millimetres."""
    return np.array([[float(part) for part in place.split()] for place in places.split(",")]) / 1000


def put(mesh: Mesh, material: Material, x: float = 0, y: float = 0, z: float = 0, **turn: float) -> Part:
    """A part at a place; turn: yaw, pitch, roll in degrees."""
    return Part(mesh.moved(at(x, y, z, **turn)), material)


def stood(
    size_m: ArrayLike,
    material: Material,
    x: float = 0,
    y: float = 0,
    z: float = 0,
    *,
    bevel: float = 0.003,
    u: float = 0,
) -> Part:
    """A block whose underside is at z; its texture begins at u."""
    high = float(np.asarray(size_m)[2])
    return put(block(size_m, bevel_m=bevel, uv_m=(u, 1.7 * u)), material, x, y, z + high / 2)


def desk(
    rng: Rng, width_m: float = 1.6, depth_m: float = 0.8, height_m: float = 0.74, tones: str = "oak"
) -> list[Part]:
    """A table top on two steel legs, with a pedestal of three drawers and a cable tray."""
    w = width_m / 2 - 0.12
    d = depth_m
    h = height_m
    parts = [stood((d, width_m, 0.026), wood(tones), 0, 0, h - 0.026, bevel=0.004, u=rng.uniform(0, 2))]
    for y in (-w, w):
        parts += [stood((d - 0.08, 0.06, 0.03), BLACK, 0, y), stood((0.06, 0.08, h - 0.08), BLACK, 0, y, 0.03)]
        parts.append(stood((d - 0.14, 0.06, 0.024), BLACK, 0, y, h - 0.05))
    tray = mm("0 0, 100 0, 100 60, 97 60, 97 3, 3 3, 3 60, 0 60")
    parts += [stood((0.03, 2 * w, 0.05), BLACK, 0, 0, h - 0.08)]
    parts += [put(extrusion(tray, 1.4 * w), DARK, 0.06 - d / 2, 0.7 * w, h - 0.16, roll=90)]
    side = (w - 0.26) * rng.choice([-1, 1])
    parts.append(stood((d - 0.22, 0.4, 0.54), GREY, -0.02, side, 0.06))
    grip = tube(spline(mm("0 -70 0, 28 -55 0, 28 55 0, 0 70 0"), 12), 0.005)
    for z in (0.075, 0.25, 0.425):
        parts.append(stood((0.016, 0.385, 0.165), GREY, d / 2 - 0.125, side, z, bevel=0.004))
        parts.append(put(grip, STEEL, d / 2 - 0.118, side, z + 0.12))
    return parts


def chair(rng: Rng, colour: str = NAVY) -> list[Part]:
    """A swivel chair on five castors; who sits on it looks along x."""
    turn = rng.uniform(0, 72)
    parts = [put(lathe(mm("0 70, 40 70, 35 120, 30 220, 18 230, 18 420, 0 420")), BLACK)]
    wheel = lathe(mm("0 -22, 24 -22, 30 -14, 30 14, 24 22, 0 22"), sections=16)
    leg = tube(spline(mm("20 0 100, 160 0 95, 300 0 65"), 6), 0.017)
    for a in np.deg2rad(turn + 72 * np.arange(5)):
        parts.append(put(leg, BLACK, yaw=np.rad2deg(a)))
        parts.append(put(wheel, DARK, 0.3 * np.cos(a), 0.3 * np.sin(a), 0.03, yaw=rng.uniform(0, 360), roll=90))
    parts.append(put(cushion((0.48, 0.5, 0.085), power=4.5), cloth(colour), 0.02, 0, 0.475))
    parts.append(put(cushion((0.075, 0.46, 0.58), power=4.5), cloth(colour), -0.235, 0, 0.86, pitch=-9))
    parts.append(put(tube(spline(mm("-20 0 430, -240 0 440, -290 0 580, -285 0 850"), 12), 0.018), BLACK))
    parts.append(stood((0.3, 0.24, 0.02), BLACK, 0, 0, 0.415))
    for s in (-1, 1):
        arm = spline(mm("-40 200 435, -40 300 460, -40 295 660") * [1, s, 1], 10)
        parts.append(put(tube(arm, 0.013), BLACK))
        parts.append(put(cushion((0.25, 0.075, 0.03), cells=4), BLACK, -0.01, s * 0.295, 0.675))
    return parts


def _book(spines: Spines, k: int, depth_m: float) -> Mesh:
    """A closed book, its spine towards x: spine and covers from its cell of the picture, pages from the last row."""
    (u0, u1, v0, v1) = spines.cells[k]
    (thick, high) = spines.sizes_m[k]
    mesh = block((depth_m, thick, high), bevel_m=0).moved(at(0, 0, high / 2))
    share = mesh.vertices_m / [1, thick, high]
    n = mesh.normals
    spine = np.stack([u0 + (share[:, 1] + 0.5) * (u1 - u0), v1 - share[:, 2] * (v1 - v0)], axis=-1)
    cover = [(u0 + u1) / 2, v0 + 0.993 * (v1 - v0)]
    paper = [(u0 + u1) / 2, 0.997]
    uv = np.where(n[:, :1] > 0.5, spine, np.where(np.abs(n[:, 1:2]) > 0.5, cover, paper))
    return replace(mesh, uv=uv)


def _books(rng: Rng, spines: Spines, width_m: float, height_m: float) -> Mesh:
    """A row of books between ±width_m / 2, in runs of neighbours, some leaning, and a pile in what is left."""
    fits = [k for k, (_, high) in enumerate(spines.sizes_m) if high < height_m - 0.01]
    y = -width_m / 2
    end = width_m / 2 - rng.choice([0.0, 0.05, 0.3])
    meshes = []
    k = int(rng.integers(len(fits)))
    while True:
        k = int(rng.integers(len(fits))) if rng.random() < 0.12 else (k + 1) % len(fits)
        thick, high = spines.sizes_m[fits[k]]
        lean = rng.uniform(5, 11) if rng.random() < 0.05 else 0.0
        step = thick + 0.0012 + high * float(np.sin(np.deg2rad(lean)))
        if y + step > end:
            break
        deep = 0.24 if high > 0.3 else 0.72 * high
        mesh = _book(spines, fits[k], deep)
        meshes.append(mesh.moved(at(-deep / 2 - rng.uniform(0, 0.025), y + step / 2, 0, roll=lean)))
        y += step
    if width_m / 2 - end > 0.2:
        meshes.append(_pile(rng, spines, 3).moved(at(-0.12, end + 0.15)))
    return joined(meshes)


def _pile(rng: Rng, spines: Spines, count: int) -> Mesh:
    z = 0.0
    meshes = []
    for k in rng.choice([k for k, size in enumerate(spines.sizes_m) if size[1] < 0.3], count, replace=False):
        thick, high = spines.sizes_m[k]
        flat = _book(spines, int(k), 0.7 * high).moved(at(0, high / 2, thick / 2, roll=90))
        meshes.append(flat.moved(at(0, 0, z, yaw=rng.normal(0, 7))))
        z += thick
    return joined(meshes)


def book_stack(rng: Rng, count: int = 4, seed: int = 0) -> list[Part]:
    """Books that lie on one another."""
    spines = picture.spines(seed)
    return [Part(_pile(rng, spines, count), matt(texture=spines.picture))]


def shelf(
    rng: Rng, width_m: float = 1.0, depth_m: float = 0.3, height_m: float = 2.0, *, tones: str = "walnut", seed: int = 0
) -> list[Part]:
    """An open bookcase of bays at most 1.1 m wide with books, binders and boxes."""
    board = wood(tones)
    rows = max(2, round(height_m / 0.37))
    bays = int(np.ceil(width_m / 1.1))
    wide = (width_m - 0.022) / bays
    pitch = (height_m - 0.1) / rows
    half = (width_m - 0.022) / 2
    sides = [stood((depth_m, 0.022, height_m), board, 0, b * wide - half, u=b, bevel=0.002) for b in range(bays + 1)]
    back = stood((0.008, width_m - 0.03, height_m - 0.04), board, 0.005 - depth_m / 2, 0, 0.02, bevel=0)
    top = stood((depth_m, width_m, 0.024), board, 0.002, 0, height_m - 0.02, bevel=0.002)
    parts = [*sides, back, top]
    spines = picture.spines(seed)
    books = []
    for y, z in ((b * wide + wide / 2 - half, 0.06 + r * pitch) for b in range(bays) for r in range(rows)):
        plank = (depth_m - 0.012, wide - 0.022, 0.02)
        parts.append(stood(plank, board, 0, y, z - 0.02, bevel=0.002, u=rng.uniform(0, 2)))
        if rng.random() < 0.12:
            colour = matt(some(rng, SAGE, SAND, NAVY))
            parts += [
                stood((0.24, 0.3 * wide, 0.16), colour, depth_m / 2 - 0.15, y + s * 0.2 * wide, z) for s in (-1, 1)
            ]
        else:
            books.append(_books(rng, spines, wide - 0.03, pitch - 0.03).moved(at(depth_m / 2 - 0.02, y, z)))
    return [*parts, Part(joined(books), matt(texture=spines.picture))]


def papers(rng: Rng, count: int = 4, spread_m: float = 0.07, seed: int = 0) -> list[Part]:
    """Sheets of A4 that lie over one another, a corner of each lifted."""
    sheets = []
    for k in range(count):
        u, v = np.meshgrid(np.linspace(0, 1, 6), np.linspace(1, 0, 7))
        lift = 0.0006 * (k + 1) + 0.012 * rng.random() * np.clip(u + v - 1.3, 0, 1) ** 2
        mesh = sheet(np.stack([0.297 * (v - 0.5), 0.21 * (u - 0.5), lift], axis=-1))
        uv = np.stack([rng.integers(3) + u, rng.integers(2) + v], axis=-1).reshape(-1, 2) / [3, 2]
        x, y = rng.normal(0, spread_m, 2)
        sheets.append(replace(mesh, uv=uv).moved(at(x, y, yaw=rng.normal(0, 14))))
    return [Part(joined(sheets), matt(texture=picture.pages(seed)))]


def monitor(rng: Rng, width_m: float = 0.6, seed: int = 0) -> list[Part]:
    """A display on a foot, switched on, tilted a little."""
    h = width_m * 0.58
    tilt = rng.uniform(-4, 0)
    shines = picture.screen(seed)
    glow = replace(BLACK, roughness=0.12, emission_cd_m2=(176.0, 180.0, 188.0), emission_texture=shines)
    z = 0.066 + h / 2
    foot = lathe(mm(f"0 0, 115 0, 115 6, 30 12, 18 20, 18 {1000 * z}, 0 {1000 * z}"), sections=32)
    return [
        put(foot, BLACK, -0.03),
        put(block((0.022, width_m, h), bevel_m=0.004), BLACK, 0.02, 0, z, pitch=tilt),
        put(block((0.03, 0.3, 0.2), bevel_m=0.012), BLACK, 0, 0, z, pitch=tilt),
        put(card((width_m - 0.014, h - 0.018)).moved(at(0.0115)), glow, 0.02, 0, z + 0.002, pitch=tilt),
    ]


def keyboard(_: Rng) -> list[Part]:
    """Five rows of keys, the digits apart from the letters, on a board."""
    key = block((0.016, 0.016, 0.008), bevel_m=0)
    space = block((0.016, 0.111, 0.008), bevel_m=0)
    places = [(r, c) for r in range(5) for c in range(23) if c not in (14, 18) and not (r == 4 and 3 <= c <= 8)]
    keys = [key.moved(at(0.038 - 0.019 * r, 0.019 * c - 0.209, 0.014)) for r, c in places]
    keys.append(space.moved(at(-0.038, -0.1045, 0.014)))
    return [stood((0.125, 0.45, 0.011), BLACK), Part(joined(keys), DARK)]


def mouse(rng: Rng) -> list[Part]:
    """A mouse on its mat."""
    mat = stood((0.2, 0.24, 0.003), matt(some(rng, NAVY, TEAL, INK)), bevel=0.001)
    return [mat, put(cushion((0.11, 0.06, 0.036), power=2.6), BLACK, 0.01, 0, 0.019)]


def mug(rng: Rng) -> list[Part]:
    """A glazed mug with a handle and coffee."""
    glaze = coated(some(rng, BRICK, PAPER, TEAL, OCHRE, NAVY), roughness=0.08)
    turn = rng.uniform(0, 360)
    body = lathe(mm("0 0, 34 0, 40 8, 41 94, 38 96, 36 90, 35 12, 0 10"), sections=32)
    grip = tube(spline(mm("38 0 22, 68 0 26, 68 0 72, 39 0 78"), 12), 0.006)
    coffee = lathe(mm("0 60, 35.9 70, 0 70.1"))
    return [put(body, glaze), put(grip, glaze, yaw=turn), put(coffee, coated("#2a1a10", roughness=0.02))]


def pens(rng: Rng) -> list[Part]:
    """A cup with pens."""
    parts = [put(lathe(mm("0 0, 40 0, 40 100, 37 100, 37 5, 0 5")), DARK)]
    for ink in rng.choice([NAVY, BRICK, OCHRE, INK, TEAL, PAPER], 6):
        pen = tube(mm(f"-20 0 7, {rng.uniform(15, 32)} 0 155"), 0.004)
        parts.append(put(pen, coated(str(ink)), yaw=rng.uniform(0, 360)))
    return parts


def desk_lamp(rng: Rng, colour: str = TEAL) -> list[Part]:
    """A lamp with a bent arm and a conical shade."""
    paint = coated(colour, roughness=0.2)
    foot = lathe(mm("0 0, 85 0, 85 12, 70 20, 12 28, 10 50, 0 50"), sections=32)
    arm = tube(spline(mm("0 0 40, -20 0 200, 50 0 420, 200 0 470"), 20), 0.007)
    shade = lathe(mm("0 46, 32 44, 75 -50, 78 -50, 35 50, 20 60, 0 60"), sections=32)
    return [put(foot, paint), put(arm, STEEL), put(shade, paint, 0.23, 0, 0.45, pitch=rng.uniform(8, 24))]


def cables(rng: Rng, length_m: float = 1.2, height_m: float = 0.7) -> list[Part]:
    """Leads that sag from a desk at height_m to a socket on the wall length_m behind it."""
    paths = []
    for k in range(3):
        x = length_m * np.array([0, -0.02, -0.3, -0.8, -1])
        y = np.array([*rng.normal(0, 0.12, 4), 0.04 * k])
        path = spline(np.stack([x, y, [height_m, 0.45 * height_m, 0.01, 0.01, 0.22]], axis=1), 28)
        paths.append(tube(np.maximum(path, [-9, -9, 0.006]), 0.0045, sections=6))
    return [Part(joined(paths), BLACK)]


def plant(rng: Rng, height_m: float = 1.2, leaves: int = 26) -> list[Part]:
    """Broad leaves on stems in a pot of clay."""
    h = 0.28 * height_m
    stems = []
    blades = []
    pot = mm("0 0, 360 0, 480 920, 520 930, 520 1000, 460 1000, 440 850, 0 860") * h
    t = np.linspace(0, 1, 8)[:, None]
    for _ in range(leaves):
        way = at(yaw=rng.uniform(0, 360))
        rise = rng.uniform(0.4, 0.95) * height_m
        reach, long, drop = rng.uniform([0.05, 0.14, 0.1], [0.3, 0.26, 0.9]) * [height_m, height_m, 1]
        bend = spline([[0, 0, 0.85 * h], [0.3 * reach, 0, 0.6 * rise], [reach, 0, rise]], 6)
        stems.append(tube(bend, 0.0035 * height_m, sections=5).moved(way))
        side = (0.26 * long * np.sin(np.pi * t**0.75) + 0.0005) * np.array([1, 0.5, 0, -0.5, -1])
        up = rise + long * (0.35 * t - drop * t**2) + 0.25 * np.abs(side) + 0.006 * np.sin(9 * t)
        blade = sheet(np.stack([reach + long * (t + 0 * side), side, up], axis=-1))
        blades.append(blade.moved(way).two_sided())
    leaf = coated("#e8f0d8", picture.ground("leaf", 0, 512, 0.4), roughness=0.35)
    return [
        put(lathe(pot, sections=32), matt(texture=picture.ground("clay", 0, 512, 0.6))),
        put(lathe(mm("0 800, 450 870, 0 900") * h), matt("#3a2c22")),
        Part(joined(stems), matt("#4b5a2e")),
        Part(joined(blades), leaf),
    ]


def carton(_: Rng, size_m: tuple[float, float, float] = (0.36, 0.46, 0.3), seed: int = 0) -> list[Part]:
    """A cardboard box, taped and labelled."""
    tile = max(size_m)
    box = block(size_m, bevel_m=0.002, uv_m=(tile / 2, tile / 2)).moved(at(0, 0, size_m[2] / 2))
    return [Part(box, matt(texture=picture.carton(seed, tile)))]


def crate(rng: Rng, size_m: tuple[float, float, float] = (0.8, 0.8, 1.2)) -> list[Part]:
    """A box of rough planks on posts, with a plate."""
    (x, y, z) = size_m
    rough = matt(texture=picture.boards("beech", 5, rows=6))
    parts = [stood((x - 0.06, y - 0.06, z - 0.01), matt("#2b221a"), bevel=0)]
    rows = max(2, round(z / 0.14))
    for s in (-1, 1):
        for k in range(rows):
            high = z / rows - rng.uniform(0.003, 0.01)
            u = rng.uniform(0, 3)
            parts.append(stood((x - 0.04, 0.02, high), rough, 0, s * (y / 2 - 0.03), k * z / rows, u=u))
            parts.append(stood((0.02, y - 0.04, high), rough, s * (x / 2 - 0.03), 0, k * z / rows, u=u + 0.4))
        for t in (-1, 1):
            u = rng.uniform(0, 3)
            parts.append(stood((0.09, 0.02, z), rough, s * (x / 2 - 0.055), t * (y / 2 - 0.01), u=u))
            parts.append(stood((0.02, 0.07, z), rough, s * (x / 2 - 0.01), t * (y / 2 - 0.055), u=u + 0.2))
    parts += [stood((x / 5 - 0.006, y, 0.02), rough, (k - 2) * x / 5, 0, z - 0.01, u=0.3 * k) for k in range(5)]
    return [*parts, put(card((0.36, 0.18)), matt(texture=picture.sign("M-12", SAND)), x / 2 - 0.0185, 0, 0.6 * z)]


def sofa(_: Rng, width_m: float = 2.0, depth_m: float = 0.9, height_m: float = 0.7, colour: str = SAGE) -> list[Part]:
    """A sofa of three seats on short legs with two loose cushions."""
    cover = cloth(colour)
    wide = (width_m - 0.36) / 3
    d = depth_m / 2
    back = cushion((0.22, width_m - 0.06, height_m - 0.14), power=7, cells=8)
    parts = [put(cushion((2 * d - 0.04, width_m - 0.1, 0.2), power=12), cover, 0, 0, 0.2)]
    parts.append(put(back, cover, 0.11 - d, 0, 0.07 + height_m / 2))
    for s in (-1, 1):
        parts.append(put(cushion((2 * d - 0.02, 0.18, 0.44), power=7), cover, 0.01, s * (width_m / 2 - 0.09), 0.34))
        parts += [stood((0.05, 0.05, 0.12), wood("walnut"), x, s * (width_m / 2 - 0.1)) for x in (0.08 - d, d - 0.08)]
        loose = cushion((0.13, 0.42, 0.4), power=2.8)
        accent = cloth(OCHRE if s > 0 else BRICK)
        parts.append(put(loose, accent, -0.12, s * 0.58, 0.6, pitch=-18, yaw=s * 6))
    for y in (-wide, 0, wide):
        parts.append(put(cushion((2 * d - 0.22, wide - 0.005, 0.15), power=6), cover, 0.1, y, 0.36))
        parts.append(put(cushion((0.17, wide - 0.01, 0.36), power=4.5), cover, 0.27 - d, y, 0.56, pitch=-10))
    return parts


def waste_bin(rng: Rng, width_m: float = 0.3, height_m: float = 0.4) -> list[Part]:
    """A waste bin with crumpled paper."""
    profile = mm("0 0, 400 0, 500 1000, 480 1000, 385 20, 0 20") * [width_m, height_m]
    balls = []
    for _ in range(7):
        x, y, z = rng.uniform(-0.25, 0.25, 3) * [width_m, width_m, height_m] + [0, 0, 0.6 * height_m]
        ball = cushion((0.1, 0.09, 0.08), power=2, cells=4)
        balls.append(ball.moved(at(x, y, z, yaw=rng.uniform(0, 360), roll=rng.uniform(0, 90))))
    return [put(lathe(profile, sections=32), DARK), Part(joined(balls), PAGE)]


def cabinet(
    _: Rng, width_m: float = 0.8, depth_m: float = 0.6, height_m: float = 1.2, colour: str = "#8b9493"
) -> list[Part]:
    """A steel cupboard with two doors on a plinth."""
    paint = coated(colour, roughness=0.35)
    w = width_m
    d = depth_m
    h = height_m
    parts = [stood((d - 0.02, w, h - 0.06), paint, -0.01, 0, 0.06, bevel=0.005)]
    parts.append(stood((d - 0.06, w - 0.03, 0.06), BLACK, -0.01))
    grip = tube(spline(mm("0 0 -80, 30 0 -60, 30 0 60, 0 0 80"), 12), 0.006)
    for s in (-1, 1):
        parts.append(stood((0.018, w / 2 - 0.006, h - 0.08), paint, d / 2 - 0.01, s * w / 4, 0.07, bevel=0.004))
        parts.append(put(grip, CHROME, d / 2, s * 0.04, 0.6 * h))
        label = matt(texture=picture.sign("FILES"))
        parts.append(put(card((0.12, 0.06)), label, d / 2 - 0.0005, s * w / 4, 0.85 * h))
    return parts


def bench(rng: Rng, width_m: float = 2.0, depth_m: float = 0.9, height_m: float = 0.7) -> list[Part]:
    """A work bench of beech with a shelf below."""
    beech = wood("beech")
    d = depth_m
    w = width_m
    h = height_m
    legs = [(s * (d / 2 - 0.07), t * (w / 2 - 0.09)) for s in (-1, 1) for t in (-1, 1)]
    parts = [stood((0.09, 0.09, h - 0.05), beech, x, y, u=rng.uniform(0, 2), bevel=0.005) for x, y in legs]
    tops = [((k - 1.5) * d / 4, rng.uniform(0, 2)) for k in range(4)]
    parts += [stood((d / 4 - 0.003, w, 0.05), beech, x, 0, h - 0.05, u=u) for x, u in tops]
    return [*parts, stood((d - 0.1, w - 0.12, 0.025), beech, 0, 0, 0.18, u=rng.uniform(0, 2))]


def pillar(rng: Rng, width_m: float = 0.4, height_m: float = 3.0) -> list[Part]:
    """A column of raw concrete with chamfered edges, a kick plate and a sign."""
    raw = matt(texture=picture.ground("concrete"))
    w = width_m
    plate = put(card((0.24, 0.12)), matt(texture=picture.sign("P2", OCHRE)), w / 2 + 0.001, 0, 1.7)
    shaft = stood((w, w, height_m), raw, bevel=0.015, u=rng.uniform(0, 2))
    return [shaft, stood((w + 0.006, w + 0.006, 0.1), STEEL, bevel=0.002), plate]
