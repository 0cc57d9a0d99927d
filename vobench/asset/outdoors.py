"""Objects for outdoor scenes: cars, people, plants and street furniture. They stand on z = 0 and face x."""

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture
from vobench.asset.furniture import (
    BLACK,
    CHROME,
    DARK,
    GREY,
    STEEL,
    Part,
    cloth,
    coated,
    matt,
    mm,
    put,
    stood,
)
from vobench.asset.picture import (
    BRICK,
    INK,
    NAVY,
    OCHRE,
    PLUM,
    SAGE,
    SAND,
    TEAL,
    Rng,
    one_of,
)
from vobench.asset.shape import (
    at,
    block,
    card,
    cards_arrays,
    cushion,
    lathe,
    sheet,
    spline,
    tube,
)
from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import (
    as_arrays,
    face_corners,
    flat_shaded,
    flipped,
    joined,
    make_mesh,
    moved,
    texture_coordinates,
)
from vobench.scene.scene import jointed

if TYPE_CHECKING:
    from trimesh import Trimesh

PAINTS = ("#8d1f1c", "#20334e", "#d9dad7", "#5d6468", "#2f3a34", "#b7bcc0", "#17191b", "#3f6c87")
GLASS = coated("#12161a", roughness=0.12)
# Cross sections of a car's body from tail to nose, in mm: x, height of the underside, height of the waist, half width.
BODY = """-2100 420 840 740, -2050 320 920 830, -1850 250 950 870, -1300 220 945 890, -400 210 930 900,
 500 210 910 900, 1000 220 880 890, 1500 240 830 865, 1850 280 740 820, 2050 340 650 740, 2110 410 580 660"""
# Cross sections of the cabin, in mm: x, half width at the roof, height of the roof.
CABIN = "-1800 680 930, -1560 610 1240, -1200 590 1400, -650 585 1450, 0 585 1435, 400 600 1290, 980 700 900"


@dataclass(frozen=True, slots=True, eq=False)
class _Outline:
    """Cross sections (K,) of a car's body from tail to nose: x, underside, waist and half the width."""

    x_m: Array
    low_m: Array
    high_m: Array
    half_width_m: Array


def _outline(points_m: Array) -> _Outline:
    """The columns of a table (K, 4) like BODY."""
    return _Outline(*points_m.T)


def car(rng: Rng, colour: str = "") -> list[Part]:
    """A hatchback, 4.2 m long, with wheels, lamps, number plates, mirrors and dark windows."""
    paint = coated(colour or one_of(rng, *PAINTS), roughness=0.12)
    parts = [Part(_body(), paint), *_cabin(paint)]
    for side in (-1, 1):
        parts += _wheels(side)
        parts += _side_fittings(side, paint)
    letters = "".join(rng.choice([*"ABCDEFGHKLMNPRSTVX"], 2))
    digits = rng.integers(100, 999)
    return parts + _plates_and_bumpers(f"{letters} {digits}")


def _wheels(side: int) -> list[Part]:
    """The front and rear wheel of one side (-1 right, 1 left), each in its wheel arch."""
    arch = lathe(mm("0 0, 350 0, 350 6, 0 6"), sections=18)
    roll = -90 * side
    parts = []
    for x in (-1.27, 1.32):
        T_car_wheel = at(x, side * 0.815, 0.31, roll=roll)
        parts.append(put(arch, BLACK, x, side * 0.876, 0.36, roll=roll))
        parts += [part.moved(T_car_wheel) for part in _wheel()]
    return parts


def _side_fittings(side: int, paint: Material) -> list[Part]:
    """Headlamp, tail lamp, mirror, door handle and door gaps of one side (-1 right, 1 left)."""
    lamp = cushion((0.2, 0.36, 0.14), power=3, cells=5)
    mirror = cushion((0.13, 0.2, 0.13), power=3, cells=4)
    handle = block((0.14, 0.012, 0.022), bevel_m=0.005)
    gap = block((0.006, 0.01, 0.42))
    clear = coated("#c9d0d4", roughness=0.1)
    red = coated("#8c1210", roughness=0.15)
    return [
        put(lamp, clear, 1.95, side * 0.58, 0.62, yaw=side * -24),
        put(lamp, red, -2.0, side * 0.66, 0.82, yaw=side * 16),
        put(mirror, paint, 0.62, side * 0.98, 0.97),
        put(handle, CHROME, -0.5, side * 0.903, 0.78),
        put(gap, BLACK, -0.62, side * 0.897, 0.62),
        put(gap, BLACK, 0.52, side * 0.897, 0.62),
    ]


def _plates_and_bumpers(number: str) -> list[Part]:
    """A number plate and a bumper at both ends."""
    plate = card((0.46, 0.11))
    bumper = block((0.08, 1.1, 0.16), bevel_m=0.03)
    look = matt(texture=picture.sign(number))
    parts = []
    for x, yaw in ((2.13, 0), (-2.13, 180)):
        parts.append(put(plate, look, x, 0, 0.5, yaw=yaw))
        parts.append(put(bumper, DARK, 0.975 * x, 0, 0.42))
    return parts


def _body() -> "Trimesh":
    """The body of a car below its waist, each cross section a superellipse."""
    outline = _outline(spline(mm(BODY), 30))
    angle_rad = np.linspace(0, 2 * np.pi, 29)
    unit_y = _signed_power(np.cos(angle_rad), 0.35)
    unit_z = _signed_power(np.sin(angle_rad), 0.5)

    low = outline.low_m[:, None]
    high = outline.high_m[:, None]
    middle = (low + high) / 2
    half_height = (high - low) / 2
    z = middle + half_height * unit_z
    y = outline.half_width_m[:, None] * unit_y
    x = np.broadcast_to(outline.x_m[:, None], z.shape)
    grid = np.stack([x, y, z], axis=-1)  # (sections, points around, 3)
    return joined([_outward(sheet(grid)), _cap(grid[0], -1.0), _cap(grid[-1], 1.0)])


def _signed_power(values: Array, power: float) -> Array:
    """Magnitudes to a power, with the signs of the values."""
    return np.sign(values) * np.abs(values) ** power


def _cap(ring_m: Array, side: float) -> "Trimesh":
    """The flat end of a body within a ring (C, 3) of vertices; it faces x (side 1) or -x (side -1)."""
    center = np.broadcast_to(ring_m.mean(axis=0), ring_m.shape)
    mesh = _outward(sheet(np.stack([center, ring_m])))
    normals = np.tile([side, 0.0, 0.0], (len(mesh.vertices), 1))
    return make_mesh(mesh.vertices, mesh.faces, texture_coordinates(mesh), normals)


def _outward(mesh: "Trimesh") -> "Trimesh":
    """The mesh with its front towards the outside, away from the centre of the car."""
    corners_m = face_corners(mesh)
    from_center = corners_m.mean(axis=1) - [0, 0, 0.6]
    a, b, c = corners_m.swapaxes(0, 1)
    area_vectors = np.cross(b - a, c - a)
    is_outward = (area_vectors * from_center).sum() > 0
    return mesh if is_outward else flipped(mesh)


def _cabin(paint: Material) -> list[Part]:
    """Windows on all sides, and a roof and pillars in the paint of the body."""
    grid = _cabin_grid()
    glass = _outward(sheet(grid))
    roof = _outward(sheet(grid[7:22, 5:20] + [0, 0, 0.008]))

    pillars = []
    pillar_sections = (6, 14, 22)
    right_side = slice(1, 7)
    left_side = slice(18, 24)
    for section in pillar_sections:
        for points in (right_side, left_side):
            path = grid[section, points] + [0, 0, 0.002]
            pillars.append(tube(path, 0.024, sections=6))
    return [Part(glass, GLASS), Part(roof, paint), Part(joined(pillars), paint)]


def _cabin_grid() -> Array:
    """Points (sections, points across, 3) of the cabin; each section runs from the right waist over the roof."""
    x, roof_half_width, roof_z = spline(mm(CABIN), 30).T
    body = _outline(mm(BODY))
    waist_z = np.interp(x, body.x_m, body.high_m) - 0.04
    waist_half_width = np.interp(x, body.x_m, body.half_width_m) - 0.05

    t = np.linspace(-1, 1, 25)  # from the right waist to the left one
    roof_t = 0.55  # on the roof, t is between ± this
    rise = np.minimum(1, 2.2 * (1 - np.abs(t))) ** 0.9  # 0 at the waist, 1 on the roof
    is_on_roof = np.abs(t) < roof_t
    side = np.sign(t) * np.where(is_on_roof, np.abs(t) / roof_t, 1)
    camber = 0.04 * np.abs(side) ** 2

    half_width = roof_half_width[:, None] * rise + waist_half_width[:, None] * (1 - rise)
    y = side * half_width
    z = waist_z[:, None] + (roof_z - waist_z)[:, None] * (rise - camber)
    return np.stack([np.broadcast_to(x[:, None], y.shape), y, z], axis=-1)


@cache
def _wheel() -> tuple[Part, ...]:
    """A wheel whose axis is z, with its outer side up."""
    tyre_profile = mm("0 -90, 200 -90, 290 -80, 310 -60, 310 60, 290 85, 205 90, 200 70, 0 70")
    rim_profile = mm("0 0, 195 0, 195 14, 160 6, 50 10, 40 22, 0 22")
    tyre = lathe(tyre_profile, sections=18)
    rim = lathe(rim_profile, sections=18)

    spoke = block((0.13, 0.045, 0.02), bevel_m=0.006)
    spokes = []
    for angle in np.deg2rad(72 * np.arange(5)):
        x = 0.11 * np.cos(angle)
        y = 0.11 * np.sin(angle)
        spokes.append(moved(spoke, at(x, y, 0.085, yaw=np.rad2deg(angle))))
    return (
        Part(tyre, matt("#1b1c1d")),
        put(rim, STEEL, 0, 0, 0.07),
        Part(joined(spokes), GREY),
    )


SKINS = ("#8d5a3f", "#b98263", "#d0a285", "#5c3a28")
HAIR = ("#1d1613", "#3b2a1e", "#6b4d30", "#8b8580")
COATS = (NAVY, TEAL, BRICK, PLUM, OCHRE, SAGE, INK, SAND)
TROUSERS = ("#2b3442", "#3c3a38", "#5a5142")
# Cross sections of a trunk from the hips up, in mm: height, half depth, half width.
TRUNK = "830 105 165, 930 118 172, 1050 105 150, 1200 118 172, 1340 118 198, 1420 88 165, 1470 60 80, 1500 50 52"
STEPS = 24  # poses per gait cycle, which is two steps of a person
LEG_M = 0.9  # from the hip to the sole
STANCE_KNEE_RAD = 0.07  # bend of the knee while the foot is on the ground
NOMINAL_HEIGHT_M = 1.74  # of a person with TRUNK and the joint positions below


@dataclass(frozen=True, slots=True, eq=False)
class Limb:
    """Parts of a person that move together, and their rotation over a gait cycle.

    The parts are in upright posture. `joints_m` (J, 3) are the joints, from the body outwards. `pitch_rad` (K, J) are
    their angles at the K steps of the cycle; see `LimbMotion`.
    """

    parts: list[Part]
    joints_m: Array
    pitch_rad: Array

    def posed(self, step: int) -> list[Part]:
        """The parts at one of the K steps of a cycle."""
        T_body_limb = jointed(self.joints_m, self.pitch_rad[step])
        return [part.moved(T_body_limb) for part in self.parts]

    def scaled(self, factor: float) -> "Limb":
        """The limb of a person who is `factor` times as tall."""
        T = np.diag([factor, factor, factor, 1.0])
        return Limb([part.moved(T) for part in self.parts], factor * self.joints_m, self.pitch_rad)

    def lowest_m(self, step: int) -> float:
        """The lowest z of the limb at a step."""
        T_body_limb = jointed(self.joints_m, self.pitch_rad[step])
        return min(_lowest_z_m(part.arrays.vertices_m, T_body_limb) for part in self.parts)


def _lowest_z_m(points_m: Array, T_a_b: Array) -> float:
    """The lowest z in frame a of points (N, 3) in frame b."""
    moved_m = points_m @ T_a_b[:3, :3].T + T_a_b[:3, 3]
    return float(moved_m[:, 2].min())


@dataclass(frozen=True, slots=True, eq=False)
class Walker:
    """A walking person: limbs, distance per gait cycle, and height of the body (K,) over the cycle."""

    limbs: list[Limb]
    cycle_m: float
    rise_m: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Clothes:
    """Materials of a person."""

    coat: Material
    trousers: Material
    skin: Material
    shoe: Material


def walker(rng: Rng, height_m: float = NOMINAL_HEIGHT_M, stride_deg: float = 22.0) -> Walker:
    """A person who walks along x without slipping. `stride_deg` is the largest angle of a thigh."""
    coat = one_of(rng, *COATS)
    trousers = one_of(rng, *TROUSERS)
    skin = matt(one_of(rng, *SKINS))
    clothes = _Clothes(cloth(coat), cloth(trousers), skin, matt("#241f1c"))
    hair = matt(one_of(rng, *HAIR))

    hip_rad, knee_rad = _leg_angles(stride_deg)
    trunk = Limb(_trunk(clothes.coat, skin, hair), np.zeros((0, 3)), np.zeros((STEPS, 0)))
    limbs = [trunk]
    for side in (-1, 1):
        delay = 0 if side > 0 else STEPS // 2  # the right leg follows the left one by half a cycle
        side_hip_rad = np.roll(hip_rad, delay)
        side_knee_rad = np.roll(knee_rad, delay)
        limbs += _leg(side, clothes, side_hip_rad, side_knee_rad)
        limbs.append(_arm(side, clothes, side_hip_rad))

    # The body is raised so that the lowest foot touches the ground at every step.
    scale = height_m / NOMINAL_HEIGHT_M
    lowest_m = np.array([_lowest_m(limbs, step) for step in range(STEPS)])
    reach = np.sin(np.deg2rad(stride_deg))
    return Walker(
        limbs=[limb.scaled(scale) for limb in limbs],
        cycle_m=4 * scale * LEG_M * reach,
        rise_m=-scale * lowest_m,
    )


def _lowest_m(limbs: list[Limb], step: int) -> float:
    """The lowest z of all limbs at a step of a cycle."""
    return min(limb.lowest_m(step) for limb in limbs)


def _leg_angles(stride_deg: float) -> tuple[Array, Array]:
    """Pitch (STEPS,) of the left thigh and bend (STEPS,) of the left knee in radians, over a gait cycle.

    In the first half the foot is on the ground and moves backwards at a constant speed. In the second half the leg
    swings forward.
    """
    half = STEPS // 2
    reach = np.sin(np.deg2rad(stride_deg))
    stance = np.linspace(1, -1, half, endpoint=False)
    swing_share = np.arange(half) / half
    swing = -np.cos(np.pi * swing_share)
    hip_rad = np.arcsin(reach * np.concatenate([stance, swing]))

    fades = 1 - 0.3 * swing_share
    swing_bend_rad = 2.6 * reach * np.sin(np.pi * swing_share) * fades
    stance_knee_rad = np.full(half, STANCE_KNEE_RAD)
    knee_rad = np.concatenate([stance_knee_rad, STANCE_KNEE_RAD + swing_bend_rad])
    return hip_rad, knee_rad


def _leg(side: int, clothes: _Clothes, hip_rad: Array, knee_rad: Array) -> list[Limb]:
    """The thigh, and the shin with its shoe, of one side (-1 right, 1 left)."""
    hip = np.array([0, side * 0.095, 0.88])
    knee = hip - [0, 0, 0.43]
    ankle = hip - [0, 0, 0.84]
    shoe = cushion((0.27, 0.095, 0.085), power=3, cells=5)
    thigh = [_limb(hip, knee, 0.088, 0.062, clothes.trousers)]
    shin = [
        _limb(knee, ankle, 0.06, 0.047, clothes.trousers),
        put(shoe, clothes.shoe, 0.06, side * 0.095, 0.01),
    ]
    return [
        Limb(thigh, hip[None], -hip_rad[:, None]),
        Limb(shin, np.stack([hip, knee]), np.stack([-hip_rad, knee_rad], axis=1)),
    ]


def _arm(side: int, clothes: _Clothes, hip_rad: Array) -> Limb:
    """An arm, bent at the elbow, that swings opposite to the leg of the same side."""
    shoulder = np.array([0, side * 0.178, 1.375])
    elbow = shoulder + 0.3 * np.array([0, side * 0.12, -1])
    bend_rad = 0.35
    forearm = np.array([np.sin(bend_rad), 0.0, -np.cos(bend_rad)])
    wrist = elbow + 0.26 * forearm
    palm = wrist - [-0.01, 0, 0.06]
    hand = cushion((0.09, 0.04, 0.16), power=2.5, cells=4)
    parts = [
        _limb(shoulder, elbow, 0.052, 0.044, clothes.coat),
        _limb(elbow, wrist, 0.046, 0.036, clothes.coat),
        put(hand, clothes.skin, *palm, pitch=-20),
    ]
    return Limb(parts, shoulder[None], 0.8 * hip_rad[:, None])


def _trunk(coat: Material, skin: Material, hair: Material) -> list[Part]:
    """A trunk from the hips up, with neck and head."""
    z, half_depth, half_width = spline(mm(TRUNK), 20).T
    angle_rad = np.linspace(0, 2 * np.pi, 25)
    rings_x = half_depth[:, None] * np.cos(angle_rad)
    rings_y = half_width[:, None] * np.sin(angle_rad)
    rings_z = z[:, None] + 0 * angle_rad
    trunk = sheet(np.stack([rings_x, rings_y, rings_z], axis=-1))

    some_vertex = 30
    outward = [*trunk.vertices[some_vertex][:2], 0]
    looks_outward = trunk.vertex_normals[some_vertex] @ outward > 0

    head = cushion((0.2, 0.155, 0.235), power=2.2, cells=7)
    mop = cushion((0.205, 0.17, 0.17), power=2.2, cells=7)
    neck = lathe(mm("0 0, 52 0, 52 90, 0 90"))
    nose = cushion((0.035, 0.03, 0.05), power=2, cells=3)
    eye = cushion((0.02, 0.03, 0.014), power=2, cells=3)
    return [
        Part(trunk if looks_outward else flipped(trunk), coat),
        put(head, skin, 0.02, 0, 1.62),
        put(mop, hair, -0.012, 0, 1.668),
        put(neck, skin, 0, 0, 1.46),
        put(nose, skin, 0.12, 0, 1.605),
        put(eye, BLACK, 0.107, -0.035, 1.64),
        put(eye, BLACK, 0.107, 0.035, 1.64),
    ]


def person(rng: Rng, height_m: float = NOMINAL_HEIGHT_M, stride_deg: float = 22.0) -> list[Part]:
    """A person in the middle of a step along x."""
    who = walker(rng, height_m, stride_deg)
    step = int(rng.choice([0, STEPS // 2]))
    T_ground_body = at(z_m=who.rise_m[step])
    return [part.moved(T_ground_body) for limb in who.limbs for part in limb.posed(step)]


def _limb(start_m: Array, end_m: Array, first_radius_m: float, last_radius_m: float, material: Material) -> Part:
    """A round limb between two joints, with rounded ends."""
    direction = end_m - start_m
    length = float(np.linalg.norm(direction))
    quarter_circle = np.array([[0, 1], [0.7, 0.7], [1, 0]])
    first_end = first_radius_m * quarter_circle * [1, -1]
    last_end = last_radius_m * quarter_circle[::-1] + [0, length]
    profile = np.concatenate([first_end, last_end])

    # The limb is turned around z, which T moves to the direction from start to end.
    x_axis = unit(np.cross(direction, [0.0, 1.0, 0.0]))
    z_axis = direction / length
    y_axis = np.cross(z_axis, x_axis)
    T = np.eye(4)
    T[:3, :3] = np.stack([x_axis, y_axis, z_axis], axis=1)
    T[:3, 3] = start_m
    upright = lathe(profile, sections=14)
    return Part(moved(upright, T), material)


@picture.painted
def foliage(seed: int = 0, px: int = 512) -> Picture:
    """Leaves on a transparent ground, from dark ones at the back to light ones at the front."""
    rng = np.random.default_rng(seed)
    image = Image.new("RGBA", (px, px), (96, 124, 58, 0))
    draw = ImageDraw.Draw(image)
    angle_rad = np.linspace(0, 2 * np.pi, 14)[:, None]
    leaves = 260
    for k in range(leaves):
        radius = px * 0.42 * np.sqrt(rng.random())
        position_rad = rng.uniform(0, 7)
        direction = np.array([np.cos(position_rad), np.sin(position_rad)])
        x, y = px / 2 + radius * direction

        # An ellipse that is wider at its stalk than at its tip.
        heading_rad = rng.uniform(0, 7)
        length = px * rng.uniform(0.035, 0.06)
        tone = 0.55 + 0.45 * k / leaves + rng.normal(0, 0.06)
        ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])
        side = np.array([-np.sin(heading_rad), np.cos(heading_rad)])
        taper = 1 - 0.3 * np.cos(angle_rad)
        along = length * np.cos(angle_rad) * ahead
        across = 0.45 * length * np.sin(angle_rad) * taper * side
        outline = np.array([x, y]) + along + across

        colour = (128 + rng.normal(0, 14), 160, 78)
        ink = tuple(int(np.clip(channel * tone, 0, 255)) for channel in colour)
        vein = tuple(int(channel * 1.15) for channel in ink)
        tip = (x + length * ahead[0], y + length * ahead[1])
        draw.polygon([tuple(point) for point in outline.tolist()], fill=(*ink, 255))
        draw.line([x, y, *tip], fill=(*vein, 255))
    return Picture(np.asarray(image))


def _leaves(rng: Rng, colours: tuple[str, ...], seed: int) -> Material:
    """Leaves cut out of a picture of foliage, in one of the colours."""
    material = matt(one_of(rng, *colours), foliage(seed))
    return replace(material, cutout=0.5, is_foliage=True)


def _facing(direction: Array, yaw_spread_deg: float, rng: Rng) -> float:
    """The yaw in degrees of a direction, with normal noise of yaw_spread_deg."""
    yaw_deg = np.rad2deg(np.arctan2(direction[1], direction[0]))
    return float(yaw_deg + rng.normal(0, yaw_spread_deg))


def tree(
    rng: Rng,
    height_m: float = 6.0,
    clumps: int = 110,
) -> list[Part]:
    """A broad-leaved tree with a trunk, boughs and a crown."""
    h = height_m
    bark = matt("#6d5c4b", picture.boards("walnut", 3, 512, 0.8))
    sway = rng.normal(0, 0.05, 2)
    trunk = lathe(mm("0 0, 32 0, 24 50, 17 400, 8 750, 0 760") * h, sections=14)

    boughs = []
    for _ in range(9):
        angle = rng.uniform(0, 2 * np.pi)
        z = rng.uniform(0.34, 0.6) * h
        end_xy = rng.uniform(0.14, 0.24) * h * np.array([np.cos(angle), np.sin(angle)])
        start = [0, 0, z]
        middle = [*(0.5 * end_xy), z + 0.1 * h]
        end = [*end_xy, z + 0.24 * h]
        path = spline([start, middle, end], 6)
        boughs.append(tube(path, 0.006 * h, sections=6))

    crown_m = np.array([*sway, 0.67 * h])
    crown_radii_m = np.array([0.26, 0.26, 0.3]) * h
    sizes_m = []
    poses = []
    for _ in range(clumps):
        outward = unit(rng.standard_normal(3))
        center = crown_m + crown_radii_m * outward * rng.uniform(0.55, 1.0)
        side = rng.uniform(0.16, 0.24) * h
        yaw = _facing(outward, 30, rng)
        pitch = rng.normal(-25, 30)
        roll = rng.uniform(0, 360)
        sizes_m.append((side, side))
        poses.append(at(*center, yaw=yaw, pitch=pitch, roll=roll))

    leaves = _leaves(rng, ("#f4ffe4", "#e6f0d0", "#fff6d8"), 0)
    return [Part(trunk, bark), Part(joined(boughs), bark), Part(cards_arrays(sizes_m, poses), leaves)]


def street_lamp(_: Rng, height_m: float = 5.0, reach_m: float = 1.2) -> list[Part]:
    """A steel mast with an arm along x. Its light belongs at (reach_m, 0, height_m)."""
    iron = coated("#2d3532", roughness=0.35)
    h = height_m
    top = h - 0.3
    mast_profile = np.array([[0, 0], [0.1, 0], [0.1, 0.5], [0.06, 0.6], [0.04, top], [0, top]])
    mast = lathe(mast_profile, sections=16)
    arm_start = [0, 0, h - 0.32]
    arm_middle = [0.25 * reach_m, 0, h + 0.05]
    arm_end = [reach_m, 0, h + 0.07]
    arm_path = spline([arm_start, arm_middle, arm_end], 10)
    head_m = (0.62, 0.2, 0.09)
    return [
        put(mast, iron),
        put(tube(arm_path, 0.03), iron),
        stood(head_m, iron, reach_m, 0, h + 0.005, bevel=0.03),
    ]


def bollard(_: Rng, height_m: float = 0.95) -> list[Part]:
    """An iron post with a ring."""
    profile = mm("0 0, 80 0, 80 40, 62 60, 55 800, 66 810, 66 850, 50 860, 40 930, 0 950")
    post = lathe(profile * [1, height_m / 0.95], sections=20)
    return [put(post, coated("#23282a", roughness=0.35))]


def bush(
    rng: Rng,
    height_m: float = 1.1,
    width_m: float = 1.6,
) -> list[Part]:
    """A round bush of leaves down to the ground."""
    radii_m = np.array([width_m, width_m, height_m]) / 2
    sizes_m = []
    poses = []
    for _ in range(48):
        outward = unit(rng.normal([0, 0, 0.15], 1))
        center = [0, 0, 0.42 * height_m] + radii_m * outward * rng.uniform(0.55, 0.95)
        side = rng.uniform(0.18, 0.3) * (height_m + width_m)
        yaw = _facing(outward, 25, rng)
        pitch = rng.normal(-30, 25)
        roll = rng.uniform(0, 360)
        sizes_m.append((side, side))
        poses.append(at(*center, yaw=yaw, pitch=pitch, roll=roll))

    leaves = _leaves(rng, ("#e2f0d0", "#d0e0c8", "#f4f0d0"), 1)
    core = cushion(0.9 * radii_m, power=2.2, cells=6)
    return [
        Part(cards_arrays(sizes_m, poses), leaves),
        put(core, matt("#2f4020"), z=0.22 * height_m),
    ]


def rock(rng: Rng, size_m: float = 0.6) -> list[Part]:
    """A boulder with flat breaks, a third of it in the ground."""
    extent_m = size_m * rng.uniform([0.8, 0.6, 0.5], [1.2, 1.0, 0.8])
    mesh = cushion(extent_m, power=2.4, cells=9)
    points_m = as_arrays(mesh).vertices_m

    flat_breaks = 9
    for _ in range(flat_breaks):
        normal = unit(rng.standard_normal(3))
        distance = rng.uniform(0.3, 0.42) * size_m
        beyond = np.maximum(points_m @ normal - distance, 0)
        points_m = points_m - beyond[:, None] * normal

    waves = rng.normal(0, 9 / size_m, (6, 3))
    phase = rng.uniform(0, 7, 6)
    roughness = np.sin(points_m @ waves.T + phase).sum(axis=1)
    points_m = points_m * (1 + 0.02 * roughness)[:, None]

    stone = matt(
        one_of(rng, "#c9c4ba", "#a8a59e", "#b9ad9a"),
        picture.ground("concrete", 3, 1024, 1.4),
    )
    boulder = flat_shaded(points_m, mesh.faces, texture_coordinates(mesh))
    return [put(boulder, stone, z=0.12 * size_m, yaw=rng.uniform(0, 360))]


# Slats of a park bench: x and z of their centre in metres, pitch in degrees.
SLATS = (
    (0.19, 0.45, 0),
    (0.08, 0.445, 0),
    (-0.03, 0.44, 0),
    (-0.14, 0.445, 0),
    (-0.225, 0.56, 102),
    (-0.25, 0.68, 102),
    (-0.275, 0.8, 102),
)


def park_bench(rng: Rng, width_m: float = 1.8) -> list[Part]:
    """Wooden slats on two cast-iron feet. A person on the bench looks along x."""
    iron = coated("#23282a", roughness=0.35)
    foot_path = spline(mm("240 0 0, 200 0 250, 230 0 420, 0 0 410, -200 0 430, -280 0 860"), 24)
    leg_path = spline(mm("-200 0 430, -230 0 200, -290 0 0"), 8)
    foot = tube(foot_path, 0.022)
    leg = tube(leg_path, 0.022)

    slats = []
    for x, z, pitch in SLATS:
        start_u = rng.uniform(0, 2)
        start_v = rng.uniform(0, 2)
        slat = block((0.09, width_m, 0.028), bevel_m=0.006, uv_m=(start_u, start_v))
        slats.append(moved(slat, at(x, 0, z, pitch=pitch)))

    feet = []
    for side in (-1, 1):
        T = at(0, side * (width_m / 2 - 0.2))
        feet += [moved(foot, T), moved(leg, T)]
    wood = matt("#d8c0a0", picture.boards("oak", 4, 1024))
    return [Part(joined(feet), iron), Part(joined(slats), wood)]


def park_lamp(_: Rng, height_m: float = 3.4) -> list[Part]:
    """A post with the cage and hat of a lantern. Its globe, 0.3 m wide, belongs at `height_m`."""
    iron = coated("#27302d", roughness=0.35)
    h = height_m
    post = mm("0 0, 130 0, 130 50, 80 120, 70 700, 45 780, 35 1000, 100 1000, 0 1000")
    post[6:, 1] = h - np.array([0.2, 0.16, 0.16])
    hat = lathe(mm("0 170, 160 170, 240 150, 236 165, 90 240, 20 290, 0 292"))
    rod = tube(mm("130 0 -170, 180 0 160"), 0.008)
    rods = [moved(rod, at(z_m=h, yaw=90 * k)) for k in range(4)]
    return [
        put(joined([lathe(post), *rods]), iron),
        put(hat, iron, z=h),
    ]
