"""What stands and moves outdoors: cars, people, trees, street lamps; parts on z = 0, their front towards x."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture
from vobench.asset.furniture import BLACK, CHROME, DARK, GREY, STEEL, Part, cloth, coated, matt, mm, put, stood
from vobench.asset.picture import BRICK, INK, NAVY, OCHRE, PLUM, SAGE, SAND, TEAL, Rng, some
from vobench.asset.shape import at, block, card, cushion, lathe, sheet, spline, tube
from vobench.geometry.se3 import Array
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import Mesh, flat, joined, unit
from vobench.scene.scene import jointed

PAINTS = ("#8d1f1c", "#20334e", "#d9dad7", "#5d6468", "#2f3a34", "#b7bcc0", "#17191b", "#3f6c87")
GLASS = coated("#12161a", roughness=0.12)
# A car's body from tail to nose: x, the height of its underside, that of its waist, half its width.
BODY = """-2100 420 840 740, -2050 320 920 830, -1850 250 950 870, -1300 220 945 890, -400 210 930 900,
 500 210 910 900, 1000 220 880 890, 1500 240 830 865, 1850 280 740 820, 2050 340 650 740, 2110 410 580 660"""
# The cabin on it: x, half its width at the roof, its height.
CABIN = "-1800 680 930, -1560 610 1240, -1200 590 1400, -650 585 1450, 0 585 1435, 400 600 1290, 980 700 900"


def car(rng: Rng, colour: str = "") -> list[Part]:
    """A hatchback 4.2 m long with wheels, lamps, plates and mirrors, its windows dark."""
    paint = coated(colour or some(rng, *PAINTS), roughness=0.12)
    parts = [Part(_body(), paint), *_cabin(paint)]
    arch = lathe(mm("0 0, 350 0, 350 6, 0 6"), sections=18)
    lamp = cushion((0.2, 0.36, 0.14), power=3, cells=5)
    for s in (-1, 1):
        for x in (-1.27, 1.32):
            parts.append(put(arch, BLACK, x, s * 0.876, 0.36, roll=-90 * s))
            parts += [part.moved(at(x, s * 0.815, 0.31, roll=-90 * s)) for part in _wheel()]
        parts.append(put(lamp, coated("#c9d0d4", roughness=0.1), 1.95, s * 0.58, 0.62, yaw=s * -24))
        parts.append(put(lamp, coated("#8c1210", roughness=0.15), -2.0, s * 0.66, 0.82, yaw=s * 16))
        parts.append(put(cushion((0.13, 0.2, 0.13), power=3, cells=4), paint, 0.62, s * 0.98, 0.97))
        parts.append(put(block((0.14, 0.012, 0.022), bevel_m=0.005), CHROME, -0.5, s * 0.903, 0.78))
        parts += [put(block((0.006, 0.01, 0.42)), BLACK, x, s * 0.897, 0.62) for x in (-0.62, 0.52)]
    plate = f"{''.join(rng.choice([*'ABCDEFGHKLMNPRSTVX'], 2))} {rng.integers(100, 999)}"
    for x, yaw in ((2.13, 0), (-2.13, 180)):
        parts.append(put(card((0.46, 0.11)), matt(texture=picture.sign(plate)), x, 0, 0.5, yaw=yaw))
        parts.append(put(block((0.08, 1.1, 0.16), bevel_m=0.03), DARK, 0.975 * x, 0, 0.42))
    return parts


def _body() -> Mesh:
    """The body of a car, rounded at waist and sill."""
    x, low, high, half = spline(mm(BODY), 30).T
    turn = np.linspace(0, 2 * np.pi, 29)
    y, z = (np.sign(f(turn)) * np.abs(f(turn)) ** p for f, p in ((np.cos, 0.35), (np.sin, 0.5)))
    height = (low + high)[:, None] / 2 + (high - low)[:, None] / 2 * z
    grid = np.stack([np.broadcast_to(x[:, None], height.shape), half[:, None] * y, height], axis=-1)
    return joined([_outward(sheet(grid)), _cap(grid[0], -1.0), _cap(grid[-1], 1.0)])


def _cap(ring: Array, side: float) -> Mesh:
    """The flat end of a body, towards x times side."""
    mesh = _outward(sheet(np.stack([np.broadcast_to(ring.mean(axis=0), ring.shape), ring])))
    return replace(mesh, normals=np.tile([side, 0.0, 0.0], (len(mesh.vertices_m), 1)))


def _outward(mesh: Mesh) -> Mesh:
    """The mesh seen from outside of what it lies around."""
    away = mesh.corners_m.mean(axis=1) - [0, 0, 0.6]
    a, b, c = mesh.corners_m.swapaxes(0, 1)
    return mesh if (np.cross(b - a, c - a) * away).sum() > 0 else mesh.flipped()


def _cabin(paint: Material) -> list[Part]:
    """Glass all around below a roof and pillars in the body's paint."""
    x, half, high = spline(mm(CABIN), 30).T
    waist = np.interp(x, *mm(BODY)[:, [0, 2]].T) - 0.04
    bottom = np.interp(x, *mm(BODY)[:, [0, 3]].T) - 0.05
    t = np.linspace(-1, 1, 25)
    up = np.minimum(1, 2.2 * (1 - np.abs(t))) ** 0.9
    wide = np.sign(t) * np.where(np.abs(t) < 0.55, np.abs(t) / 0.55, 1)
    across = wide * (half[:, None] * up + bottom[:, None] * (1 - up))
    level = waist[:, None] + (high - waist)[:, None] * (up - 0.04 * np.abs(wide) ** 2)
    grid = np.stack([np.broadcast_to(x[:, None], across.shape), across, level], axis=-1)
    roof = grid[7:22, 5:20] + [0, 0, 0.008]
    sides = [(k, side) for k in (6, 14, 22) for side in (slice(1, 7), slice(18, 24))]
    pillars = [tube(grid[k, side] + [0, 0, 0.002], 0.024, sections=6) for k, side in sides]
    glass, top = (_outward(sheet(points)) for points in (grid, roof))
    return [Part(glass, GLASS), Part(top, paint), Part(joined(pillars), paint)]


@cache
def _wheel() -> tuple[Part, ...]:
    """A wheel around z, its outer side up."""
    tyre = lathe(mm("0 -90, 200 -90, 290 -80, 310 -60, 310 60, 290 85, 205 90, 200 70, 0 70"), sections=18)
    rim = lathe(mm("0 0, 195 0, 195 14, 160 6, 50 10, 40 22, 0 22"), sections=18)
    turns = np.deg2rad(72 * np.arange(5))
    spoke = block((0.13, 0.045, 0.02), bevel_m=0.006)
    spokes = [spoke.moved(at(0.11 * np.cos(a), 0.11 * np.sin(a), 0.085, yaw=np.rad2deg(a))) for a in turns]
    return Part(tyre, matt("#1b1c1d")), put(rim, STEEL, 0, 0, 0.07), Part(joined(spokes), GREY)


SKINS = ("#8d5a3f", "#b98263", "#d0a285", "#5c3a28")
HAIR = ("#1d1613", "#3b2a1e", "#6b4d30", "#8b8580")
# A trunk from the hips up: height, half its depth, half its width.
TRUNK = "830 105 165, 930 118 172, 1050 105 150, 1200 118 172, 1340 118 198, 1420 88 165, 1470 60 80, 1500 50 52"


@dataclass(frozen=True, slots=True, eq=False)
class Limb:
    """Parts that move together, as they are when somebody stands upright, and how they turn while they walk.

    joints_m (J, 3) from the body on and pitch_rad (K, J) are those of a `Gait`.
    """

    parts: list[Part]
    joints_m: Array
    pitch_rad: Array

    def posed(self, step: int) -> list[Part]:
        """The parts at one of the K steps of a cycle."""
        T = jointed(self.joints_m, self.pitch_rad[step])
        return [part.moved(T) for part in self.parts]


@dataclass(frozen=True, slots=True, eq=False)
class Walker:
    """The limbs of somebody, the length of two of their steps, and how high their body is (K,) within these."""

    limbs: list[Limb]
    cycle_m: float
    rise_m: Array


STEPS = 24  # of a cycle
LEG_M = 0.9  # from the hip to the sole


def walker(rng: Rng, height_m: float = 1.74, stride_deg: float = 22.0) -> Walker:
    """Somebody who walks along x, in trousers and a coat or a jumper; their feet stay where they stand."""
    top = some(rng, NAVY, TEAL, BRICK, PLUM, OCHRE, SAGE, INK, SAND)
    legs = some(rng, "#2b3442", "#3c3a38", "#5a5142")
    skin = matt(some(rng, *SKINS))
    shoe = matt("#241f1c")
    upper = cloth(top)
    lower = cloth(legs)
    limbs = [Limb(_trunk(upper, skin, matt(some(rng, *HAIR))), np.zeros((0, 3)), np.zeros((STEPS, 0)))]
    half = STEPS // 2
    reach = np.sin(np.deg2rad(stride_deg))
    stance = np.linspace(1, -1, half, endpoint=False)
    u = np.arange(half) / half
    swing = np.arcsin(reach * np.concatenate([stance, -np.cos(np.pi * u)]))
    bend = np.concatenate([np.full(half, 0.07), 0.07 + 2.6 * reach * np.sin(np.pi * u) * (1 - 0.3 * u)])
    for s in (-1, 1):
        late = 0 if s > 0 else half
        hip = np.array([0, s * 0.095, 0.88])
        turn = np.roll(swing, late)
        knee = hip - [0, 0, 0.43]
        ankle = hip - [0, 0, 0.84]
        shin = [_limb(knee, ankle, 0.06, 0.047, lower)]
        shin.append(put(cushion((0.27, 0.095, 0.085), power=3, cells=5), shoe, 0.06, s * 0.095, 0.01))
        limbs.append(Limb([_limb(hip, knee, 0.088, 0.062, lower)], hip[None], -turn[:, None]))
        limbs.append(Limb(shin, np.stack([hip, knee]), np.stack([-turn, np.roll(bend, late)], axis=1)))
        shoulder = np.array([0, s * 0.178, 1.375])
        elbow = shoulder + 0.3 * np.array([0, s * 0.12, -1])
        wrist = elbow + 0.26 * np.array([np.sin(0.35), 0.0, -np.cos(0.35)])
        hand = put(cushion((0.09, 0.04, 0.16), power=2.5, cells=4), skin, *(wrist - [-0.01, 0, 0.06]), pitch=-20)
        arm = [_limb(shoulder, elbow, 0.052, 0.044, upper), _limb(elbow, wrist, 0.046, 0.036, upper), hand]
        limbs.append(Limb(arm, shoulder[None], 0.8 * turn[:, None]))
    scale = height_m / 1.74
    lowest = [min(p.mesh.vertices_m[:, 2].min() for x in limbs for p in x.posed(k)) for k in range(STEPS)]
    T = np.diag([scale, scale, scale, 1.0])
    grown = [Limb([p.moved(T) for p in x.parts], scale * x.joints_m, x.pitch_rad) for x in limbs]
    return Walker(grown, 4 * scale * LEG_M * reach, -scale * np.array(lowest))


def _trunk(upper: Material, skin: Material, hair: Material) -> list[Part]:
    """A body from the hips up with its head."""
    z, depth, width = spline(mm(TRUNK), 20).T
    turn = np.linspace(0, 2 * np.pi, 25)
    rings = np.stack([depth[:, None] * np.cos(turn), width[:, None] * np.sin(turn), z[:, None] + 0 * turn], axis=-1)
    trunk = sheet(rings)
    parts = [Part(trunk if trunk.normals[30] @ [*trunk.vertices_m[30][:2], 0] > 0 else trunk.flipped(), upper)]
    head = cushion((0.2, 0.155, 0.235), power=2.2, cells=7)
    mop = cushion((0.205, 0.17, 0.17), power=2.2, cells=7)
    parts += [put(head, skin, 0.02, 0, 1.62), put(mop, hair, -0.012, 0, 1.668)]
    parts += [put(lathe(mm("0 0, 52 0, 52 90, 0 90")), skin, 0, 0, 1.46)]
    parts += [put(cushion((0.035, 0.03, 0.05), power=2, cells=3), skin, 0.12, 0, 1.605)]
    eye = cushion((0.02, 0.03, 0.014), power=2, cells=3)
    return [*parts, *(put(eye, BLACK, 0.107, s * 0.035, 1.64) for s in (-1, 1))]


def person(rng: Rng, height_m: float = 1.74, stride_deg: float = 22.0) -> list[Part]:
    """Somebody amid a step along x."""
    who = walker(rng, height_m, stride_deg)
    step = int(rng.choice([0, STEPS // 2]))
    return [part.moved(at(z_m=who.rise_m[step])) for limb in who.limbs for part in limb.posed(step)]


def _limb(start: Array, end: Array, first_m: float, last_m: float, material: Material) -> Part:
    """A round limb between two joints, thinner at its end."""
    way = end - start
    long = float(np.linalg.norm(way))
    round_ = np.array([[0, 1], [0.7, 0.7], [1, 0]])
    profile = np.concatenate([first_m * round_ * [1, -1], last_m * round_[::-1] + [0, long]])
    across = unit(np.cross(way, [0.0, 1.0, 0.0]))
    T = np.eye(4)
    T[:3, :3] = np.stack([across, np.cross(way / long, across), way / long], axis=1)
    T[:3, 3] = start
    return Part(lathe(profile, sections=14).moved(T), material)


@picture.painted
def foliage(seed: int = 0, px: int = 512) -> Picture:
    """Twigs with leaves before nothing, from dark ones behind to light ones in front."""
    rng = np.random.default_rng(seed)
    image = Image.new("RGBA", (px, px), (96, 124, 58, 0))
    draw = ImageDraw.Draw(image)
    for k in range(260):
        x, y = px / 2 + px * 0.42 * np.sqrt(rng.random()) * np.array([np.cos(a := rng.uniform(0, 7)), np.sin(a)])
        a = rng.uniform(0, 7)
        long = px * rng.uniform(0.035, 0.06)
        tone = 0.55 + 0.45 * k / 260 + rng.normal(0, 0.06)
        ahead = np.array([np.cos(a), np.sin(a)])
        side = np.array([-np.sin(a), np.cos(a)])
        t = np.linspace(0, 2 * np.pi, 14)[:, None]
        shape = np.array([x, y]) + long * np.cos(t) * ahead + 0.45 * long * np.sin(t) * (1 - 0.3 * np.cos(t)) * side
        ink = tuple(int(np.clip(c * tone, 0, 255)) for c in (128 + rng.normal(0, 14), 160, 78))
        draw.polygon([tuple(p) for p in shape.tolist()], fill=(*ink, 255))
        draw.line([*(x, y), *(x + long * ahead[0], y + long * ahead[1])], fill=(*(int(c * 1.15) for c in ink), 255))
    return Picture(np.asarray(image))


def tree(rng: Rng, height_m: float = 6.0, clumps: int = 110) -> list[Part]:
    """A broad-leaved tree with a trunk, boughs and a crown."""
    h = height_m
    bark = matt("#6d5c4b", picture.boards("walnut", 3, 512, 0.8))
    sway = rng.normal(0, 0.05, 2)
    trunk = lathe(mm("0 0, 32 0, 24 50, 17 400, 8 750, 0 760") * h, sections=14)
    boughs = []
    cards = []
    middle = np.array([*sway, 0.67 * h])
    size = np.array([0.26, 0.26, 0.3]) * h
    for _ in range(9):
        a = rng.uniform(0, 2 * np.pi)
        z = rng.uniform(0.34, 0.6) * h
        out = rng.uniform(0.14, 0.24) * h * np.array([np.cos(a), np.sin(a)])
        path = spline([[0, 0, z], [*(0.5 * out), z + 0.1 * h], [*out, z + 0.24 * h]], 6)
        boughs.append(tube(path, 0.006 * h, sections=6))
    for _ in range(clumps):
        way = unit(rng.standard_normal(3))
        place = middle + size * way * rng.uniform(0.55, 1.0)
        side = rng.uniform(0.16, 0.24) * h
        yaw = np.rad2deg(np.arctan2(way[1], way[0])) + rng.normal(0, 30)
        turned = at(*place, yaw=yaw, pitch=rng.normal(-25, 30), roll=rng.uniform(0, 360))
        cards.append(card((side, side)).moved(turned).two_sided())
    leaf = replace(matt(some(rng, "#f4ffe4", "#e6f0d0", "#fff6d8"), foliage()), cutout=0.5)
    return [Part(trunk, bark), Part(joined(boughs), bark), Part(joined(cards), leaf)]


def street_lamp(_: Rng, height_m: float = 5.0, reach_m: float = 1.2) -> list[Part]:
    """A steel mast with an arm along x; its lamp would shine at (reach_m, 0, height_m)."""
    iron = coated("#2d3532", roughness=0.35)
    h = height_m
    mast = lathe(np.array([[0, 0], [0.1, 0], [0.1, 0.5], [0.06, 0.6], [0.04, h - 0.3], [0, h - 0.3]]), sections=16)
    arm = tube(spline([[0, 0, h - 0.32], [0.25 * reach_m, 0, h + 0.05], [reach_m, 0, h + 0.07]], 10), 0.03)
    return [put(mast, iron), put(arm, iron), stood((0.62, 0.2, 0.09), iron, reach_m, 0, h + 0.005, bevel=0.03)]


def bollard(_: Rng, height_m: float = 0.95) -> list[Part]:
    """An iron post with a ring."""
    profile = mm("0 0, 80 0, 80 40, 62 60, 55 800, 66 810, 66 850, 50 860, 40 930, 0 950") * [1, height_m / 0.95]
    return [put(lathe(profile, sections=20), coated("#23282a", roughness=0.35))]


def bush(rng: Rng, height_m: float = 1.1, width_m: float = 1.6) -> list[Part]:
    """A round bush of leaves down to the ground."""
    size = np.array([width_m, width_m, height_m]) / 2
    cards = []
    for _ in range(48):
        way = unit(rng.normal([0, 0, 0.15], 1))
        place = [0, 0, 0.42 * height_m] + size * way * rng.uniform(0.55, 0.95)
        side = rng.uniform(0.18, 0.3) * (height_m + width_m)
        yaw = np.rad2deg(np.arctan2(way[1], way[0])) + rng.normal(0, 25)
        turned = at(*place, yaw=yaw, pitch=rng.normal(-30, 25), roll=rng.uniform(0, 360))
        cards.append(card((side, side)).moved(turned).two_sided())
    leaf = replace(matt(some(rng, "#e2f0d0", "#d0e0c8", "#f4f0d0"), foliage(1)), cutout=0.5)
    return [Part(joined(cards), leaf), put(cushion(0.9 * size, power=2.2, cells=6), matt("#2f4020"), z=0.22 * height_m)]


def rock(rng: Rng, size_m: float = 0.6) -> list[Part]:
    """A boulder, broken and worn, a third of it in the ground."""
    mesh = cushion(size_m * rng.uniform([0.8, 0.6, 0.5], [1.2, 1.0, 0.8]), power=2.4, cells=9)
    p = mesh.vertices_m
    for _ in range(9):  # flat breaks
        way = unit(rng.standard_normal(3))
        p = p - np.maximum(p @ way - rng.uniform(0.3, 0.42) * size_m, 0)[:, None] * way
    waves = rng.normal(0, 9 / size_m, (6, 3))
    phase = rng.uniform(0, 7, 6)
    p = p * (1 + 0.02 * np.sin(p @ waves.T + phase).sum(axis=1))[:, None]
    stone = matt(some(rng, "#c9c4ba", "#a8a59e", "#b9ad9a"), picture.ground("concrete", 3, 1024, 1.4))
    return [put(flat(p, mesh.faces, mesh.uv), stone, z=0.12 * size_m, yaw=rng.uniform(0, 360))]


def park_bench(rng: Rng, width_m: float = 1.8) -> list[Part]:
    """Slats of wood on two feet of cast iron; who sits on it looks along x."""
    iron = coated("#23282a", roughness=0.35)
    slats = []
    foot = tube(spline(mm("240 0 0, 200 0 250, 230 0 420, 0 0 410, -200 0 430, -280 0 860"), 24), 0.022)
    leg = tube(spline(mm("-200 0 430, -230 0 200, -290 0 0"), 8), 0.022)
    for x, z, pitch in ((0.19, 0.45, 0), (0.08, 0.445, 0), (-0.03, 0.44, 0), (-0.14, 0.445, 0), (-0.225, 0.56, 102),
                        (-0.25, 0.68, 102), (-0.275, 0.8, 102)):  # fmt: skip
        slat = block((0.09, width_m, 0.028), bevel_m=0.006, uv_m=(rng.uniform(0, 2), rng.uniform(0, 2)))
        slats.append(slat.moved(at(x, 0, z, pitch=pitch)))
    feet = [mesh.moved(at(0, s * (width_m / 2 - 0.2))) for s in (-1, 1) for mesh in (foot, leg)]
    return [Part(joined(feet), iron), Part(joined(slats), matt("#d8c0a0", picture.boards("oak", 4, 1024)))]


def park_lamp(_: Rng, height_m: float = 3.4) -> list[Part]:
    """A post with a lantern under a hat; its globe would be at height_m, 0.3 m wide."""
    iron = coated("#27302d", roughness=0.35)
    h = height_m
    post = mm("0 0, 130 0, 130 50, 80 120, 70 700, 45 780, 35 1000, 100 1000, 0 1000")
    post[6:, 1] = h - np.array([0.2, 0.16, 0.16])
    hat = mm("0 170, 160 170, 240 150, 236 165, 90 240, 20 290, 0 292")
    rods = [tube(mm("130 0 -170, 180 0 160"), 0.008).moved(at(z_m=h, yaw=90 * k)) for k in range(4)]
    return [put(joined([lathe(post), *rods]), iron), put(lathe(hat), iron, z=h)]
