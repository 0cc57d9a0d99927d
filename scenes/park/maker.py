"""A park: hills with paths of gravel, a pond, trees, bushes, grass, boulders, benches and lamps."""

from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from vobench.plugin import (
    NAVY,
    AreaLight,
    Part,
    Picture,
    Piece,
    Steady,
    at,
    bulb,
    card,
    cards,
    coated,
    joined,
    make_mesh,
    matt,
    picture,
    put,
    quad,
    sheet,
    stood,
    textured,
    things,
    wood,
)

LONG = 72.0
WIDE = 52.0
CELL_M = 0.5
LOOP = ((-25, -9), (-14, -14), (1, -9.5), (14, -13), (25, -6), (21, 8), (9, 14.5), (-4, 10), (-15, 14), (-26, 4))
ACROSS = ((-13.2, -12.7), (-9, -4), (-8.5, 4), (-4.9, 8.9))
POND = np.array([10.0, 2.0])
POND_M = np.array([6.5, 4.5])
LEVEL_M = -0.62
PATH_M = 2.2
LAMP_M = 3.3


def make(seed):
    """Its things, their materials and its lamps."""
    rng = np.random.default_rng([seed, 7])
    ways = [_curve(LOOP, closed=True), _curve(ACROSS, closed=False)]
    near = cKDTree(np.concatenate(ways))
    turf = list(_turf(near))
    ground, known = things(
        [("path", _paths(ways)), ("grass_near", turf[:3]), ("grass_far", turf[3:]), ("pond", _pond())]
    )
    lamps = []
    pieces = []
    for k, (x, y, yaw) in enumerate(_beside(ways[0], 12.0, PATH_M / 2 + 0.5)):
        pieces.append(Piece("park_lamp", f"lamp_{k}", (x, y, height(x, y) - 0.03), yaw, size={"height_m": LAMP_M}))
        lamps.append(bulb(x, y, height(x, y) - 0.03 + LAMP_M, 0.26))
    for k, (x, y, yaw) in enumerate(_beside(ways[0], 23.0, -PATH_M / 2 - 0.7)):
        pieces.append(Piece("park_bench", f"bench_{k}", (x, y, height(x, y) - 0.02), yaw - 180))
        side = np.array([x, y]) + 1.4 * np.array([-np.sin(np.deg2rad(yaw)), np.cos(np.deg2rad(yaw))])
        pieces.append(
            Piece(
                "waste_bin",
                f"bin_{k}",
                (*side.tolist(), height(*side) - 0.02),
                size={"width_m": 0.42, "height_m": 0.75},
            )
        )
    pieces += _growth(rng, near)
    made, known = things([piece.build(seed) for piece in pieces], known)
    small, known = things([("tufts", _tufts(rng, near)), ("map", _map()), *_people(seed)], known)
    spaced = [replace(thing, spacing_m=_spacing_m(thing.name)) for thing in (*ground, *made, *small)]
    lantern = AreaLight("lamps", joined(lamps), 5200.0 * len(lamps), Steady(0.4), colour=(1.12, 0.98, 0.79))
    return tuple(spaced), known, (lantern,)


def _spacing_m(name):
    """Fine on the ground near the paths, coarse on leaves and on what is far."""
    return {"path": 0.14, "grass_near": 0.26, "grass_far": 0.6, "tree": 0.9, "bush": 0.4, "tufts": 0.5}.get(
        name.rsplit("_", 1)[0] if name[-1].isdigit() else name, 0.16
    )


def height(x, y):
    """The ground above z = 0: hills, a hollow for the pond, and a rim that hides what lies beyond."""
    hills = (
        0.75 * np.sin(x / 9 + 0.6) * np.cos(y / 8 - 0.4)
        + 0.3 * np.sin(x / 4.3 - y / 5.1)
        + 0.05 * np.sin(1.3 * x + 2) * np.sin(1.1 * y)
    )
    far = (((np.stack(np.broadcast_arrays(x, y), -1) - POND) / POND_M) ** 2).sum(-1)
    edge = np.maximum(np.abs(x) / (LONG / 2), np.abs(y) / (WIDE / 2))
    rim = 3.2 * np.clip((edge - 0.68) / 0.32, 0, 1) ** 2
    dry = np.clip(far - 0.6, 0, 1)
    return hills * dry - 1.35 * np.exp(-0.9 * far) + rim


def _curve(points, *, closed):
    """Points 0.25 m apart along a smooth way."""
    p = np.array([*points, points[0]] if closed else points, float)
    t = np.linspace(0, 1, len(p))
    way = CubicSpline(t, p, bc_type="periodic" if closed else "not-a-knot")
    rough = way(np.linspace(0, 1, 2000))
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(rough, axis=0), axis=1))])
    steps = np.linspace(0, length[-1], int(length[-1] / 0.25))
    return np.stack([np.interp(steps, length, axis) for axis in rough.T], axis=1)


def _beside(way, apart_m, aside_m):
    """Places (x, y, yaw) along a way, beside it, that face it."""
    for k in range(int(apart_m * 2), len(way) - 8, int(apart_m * 4)):
        ahead = way[k + 4] - way[k - 4]
        left = np.array([-ahead[1], ahead[0]]) / np.linalg.norm(ahead)
        yield *(way[k] + aside_m * left).tolist(), float(np.rad2deg(np.arctan2(*(-np.sign(aside_m) * left)[::-1])))


def _gravel():
    """Pebbles of some tones in sand."""
    rng = np.random.default_rng(11)
    px = 2048
    tone = 150 + 8 * picture.noise(rng, px, 2, 16) + 16 * picture.noise(rng, px, 90, 900, slope=0.1)
    sand = np.clip(tone[..., None] * np.array([1.0, 0.93, 0.8]), 20, 235).astype(np.uint8)
    image = Image.fromarray(sand)
    draw = ImageDraw.Draw(image)
    places = rng.uniform(0, px, (9000, 2))
    radii = 1.4 + rng.exponential(1.7, 9000)
    tones = rng.normal(0.95, 0.2, 9000)
    for (x, y), r, t in zip(places, radii, tones, strict=True):
        ink = tuple(int(np.clip(c * t, 30, 230)) for c in (158, 148, 132))
        draw.ellipse([x - r, y - 0.8 * r, x + r, y + 0.8 * r], fill=ink)
    return Picture(np.asarray(image), 2.4)


def _grass():
    """Blades that lie over one another, from dark ones below to light ones above, with clover between."""
    rng = np.random.default_rng(1)
    px = 2048
    count = 26000
    image = Image.new("RGB", (px, px), (46, 58, 26))
    draw = ImageDraw.Draw(image)
    start = rng.uniform(0, px, (count, 2))
    turn = rng.uniform(0, 2 * np.pi, count)
    long = px * rng.uniform(0.008, 0.028, count)
    end = start + long[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    for k in range(count):
        t = (0.55 + 0.5 * k / count) * rng.normal(1, 0.12)
        ink = tuple(int(np.clip(c * t, 0, 255)) for c in ((112, 128, 58) if rng.random() > 0.16 else (150, 142, 86)))
        draw.line([*start[k].tolist(), *end[k].tolist()], fill=ink, width=int(rng.integers(3, 7)))
    for x, y in rng.uniform(0, px, (120, 2)):
        for a in np.deg2rad(120 * np.arange(3) + rng.uniform(0, 90)):
            cx = x + 9 * np.cos(a)
            cy = y + 9 * np.sin(a)
            draw.ellipse([cx - 8, cy - 8, cx + 8, cy + 8], fill=(66, 104, 44))
    wide = 1 + 0.1 * picture.noise(rng, px, 1, 8)[..., None]
    return Picture(np.clip(np.asarray(image) * wide, 0, 255).astype(np.uint8), 2.6)


def _paths(ways):
    """Strips of gravel with edges that sink into the ground."""
    meshes = []
    for way in ways:
        ahead = np.gradient(way, axis=0)
        left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) / np.linalg.norm(ahead, axis=1, keepdims=True)
        s = np.arange(len(way))[:, None] * 0.25
        aside = np.linspace(-0.5, 0.5, 9) * (PATH_M + 0.25 * np.sin(0.9 * s) + 0.15 * np.sin(2.3 * s + 1))
        p = way[:, None] + aside[..., None] * left[:, None]
        crown = 0.035 - 0.11 * (2 * np.linspace(-0.5, 0.5, 9)) ** 6
        grid = np.concatenate([p, (height(p[..., 0], p[..., 1]) + crown)[..., None]], axis=-1)
        mesh = sheet(grid[:, ::-1])
        meshes.append(textured(mesh, mesh.vertices[:, :2]))
    meshes[1].apply_translation([0, 0, -0.012])
    return [Part(joined(meshes), matt("#f2ece0", _gravel()))]


def _turf(near):
    """The ground as grass in three tints, near the paths and far from them."""
    x = np.arange(-LONG / 2, LONG / 2 + 0.01, CELL_M)
    y = np.arange(-WIDE / 2, WIDE / 2 + 0.01, CELL_M)
    X, Y = np.meshgrid(x, y)
    mesh = sheet(np.stack([X, Y, height(X, Y)], axis=-1))
    mesh = textured(mesh, mesh.vertices[:, :2])
    middle = mesh.triangles.mean(axis=1)
    tint = (
        np.sin(middle[:, 0] / 5.2 + 1)
        + np.sin(middle[:, 1] / 4.1)
        + 0.8 * np.sin(middle[:, 0] / 1.9 - middle[:, 1] / 2.3)
    )
    kind = np.digitize(tint, [-0.9, 0.9])
    is_near = near.query(middle[:, :2])[0] < 5.5
    grass = _grass()
    looks = [matt(colour, grass) for colour in ("#e4efd2", "#f8fbea", "#fff3cf")]
    for want in (True, False):
        for k in range(3):
            yield Part(_some(mesh, (kind == k) & (is_near == want)), looks[k])


def _some(mesh, faces):
    """A mesh of some of its faces."""
    used, index = np.unique(mesh.faces[faces], return_inverse=True)
    return make_mesh(mesh.vertices[used], index.reshape(-1, 3), mesh.visual.uv[used], mesh.vertex_normals[used])


def _pond():
    """Still water over mud."""
    corner = np.array([*(POND - 1.7 * POND_M), LEVEL_M])
    return [
        Part(
            quad(corner, (3.4 * POND_M[0], 0, 0), (0, 3.4 * POND_M[1], 0)),
            replace(coated("#1c241c"), eta=1.33, roughness=0.0),
        )
    ]


def _free(rng, near, count, *, clear_m, apart_m, reach=(0.97, 0.97)):
    """Places on dry ground that keep clear of the paths and apart from one another."""
    chosen = []
    for x, y in rng.uniform(-0.5, 0.5, (60 * count, 2)) * [LONG * reach[0], WIDE * reach[1]]:
        is_dry = (((np.array([x, y]) - POND) / POND_M) ** 2).sum() > 1.5
        if is_dry and near.query([x, y])[0] > clear_m and all(np.hypot(x - a, y - b) > apart_m for a, b in chosen):
            chosen.append((float(x), float(y)))
        if len(chosen) == count:
            break
    return chosen


def _growth(rng, near):
    """Trees, dense along the rim, bushes and boulders."""
    rim = [(float(s * (LONG / 2 - 2.5) + rng.normal(0, 1)), float(y)) for s in (-1, 1) for y in np.arange(-23, 24, 4.6)]
    rim += [
        (float(x + rng.normal(0, 0.6)), float(s * (WIDE / 2 - 2.5) + rng.normal(0, 1)))
        for s in (-1, 1)
        for x in np.arange(-31, 32, 4.6)
    ]
    for k, (x, y) in enumerate([*_free(rng, near, 26, clear_m=2.6, apart_m=5.0, reach=(0.84, 0.8)), *rim]):
        size = {"height_m": float(rng.uniform(5.2, 9.0)), "clumps": 120 if k < 26 else 80}
        yield Piece("tree", f"tree_{k}", (x, y, height(x, y) - 0.08), float(rng.uniform(0, 360)), size=size)
    for k, (x, y) in enumerate(_free(rng, near, 46, clear_m=1.9, apart_m=2.0)):
        size = {"height_m": float(rng.uniform(0.7, 1.5)), "width_m": float(rng.uniform(1.2, 2.2))}
        yield Piece("bush", f"bush_{k}", (x, y, height(x, y) - 0.05), float(rng.uniform(0, 360)), size=size)
    shore = [
        (POND + POND_M * r * [np.cos(a), np.sin(a)]).tolist()
        for a, r in zip(rng.uniform(0, 2 * np.pi, 22), rng.uniform(0.74, 1.02, 22), strict=True)
    ]
    for k, (x, y) in enumerate([*_free(rng, near, 34, clear_m=1.35, apart_m=1.0, reach=(0.8, 0.75)), *shore]):
        yield Piece("rock", f"rock_{k}", (x, y, height(x, y)), size={"size_m": float(0.25 + rng.exponential(0.22))})


def _tufts(rng, near):
    """Tufts of long grass, thick beside the paths and around the pond."""
    places = rng.uniform(-0.5, 0.5, (14000, 2)) * [0.9 * LONG, 0.88 * WIDE]
    away = near.query(places)[0]
    far = (((places - POND) / POND_M) ** 2).sum(1)
    chance = np.where((far > 0.75) & (far < 1.25), 0.8, 0.04) + 0.5 * np.exp(-(((away - 1.35) / 0.3) ** 2))
    chosen = places[(rng.random(len(places)) < chance) & (away > 1.12) & (far > 0.7)]
    blades = _blades()
    sizes_m = []
    poses = []
    for x, y in chosen:
        high = float(rng.uniform(0.1, 0.26))
        for turn in (0, 90):
            yaw = turn + float(rng.uniform(0, 90))
            sizes_m.append((1.5 * high, high))
            poses.append(at(x, y, float(height(x, y)) + 0.42 * high, yaw=yaw))
    return [Part(cards(sizes_m, poses), replace(matt("#f4f6e0", blades), cutout=0.5))]


def _blades(px=256):
    """A tuft of grass before nothing."""
    rng = np.random.default_rng(3)
    image = Image.new("RGBA", (px, px), (100, 118, 56, 0))
    draw = ImageDraw.Draw(image)
    for k in range(60):
        x = px / 2 + rng.normal(0, 0.16 * px)
        lean = rng.normal(0, 0.22 * px)
        high = px * rng.uniform(0.45, 0.97)
        t = 0.55 + 0.5 * k / 60
        path = [(x + lean * s**2, px - high * s) for s in np.linspace(0, 1, 7)]
        draw.line(path, fill=(int(122 * t), int(138 * t), int(62 * t), 255), width=int(rng.integers(3, 7)))
    return Picture(np.asarray(image))


def _map():
    """A board with a map where the paths part."""
    x = -15.6
    y = -12.2
    parts = [stood((0.09, 0.09, 1.9), wood("walnut"), 0, s * 0.62) for s in (-1, 1)]
    parts.append(put(card((1.15, 0.8)), matt(texture=picture.poster("circles", 41, 1000, 700)), 0.021, 0, 1.35))
    parts += [
        stood((0.04, 1.2, 0.86), wood("walnut"), 0, 0, 0.92),
        stood((0.3, 1.5, 0.05), wood("walnut"), 0.03, 0, 1.9),
    ]
    parts.append(put(card((0.6, 0.3)), matt(texture=picture.sign("PARK", NAVY)), 0.0465, 0, 1.65))
    return [part.moved(at(x, y, float(height(x, y)) - 0.04, yaw=-75)) for part in parts]


def _people(seed):
    for k, (x, y, yaw) in enumerate(((-4.3, -10.6, 22), (-3.6, -11.2, 26), (22.6, 3.2, 110), (-9.2, 1.0, -88))):
        yield Piece(
            "person", f"person_{k}", (x, y, float(height(x, y)) + 0.01), yaw, size={"height_m": 1.64 + 0.05 * k}
        ).build(seed)
