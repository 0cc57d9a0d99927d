"""Furniture and objects on it. They stand on z = 0 at the origin and face x; their width is along y."""

from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from vobench.asset import picture
from vobench.asset.picture import (
    BRICK,
    INK,
    NAVY,
    OCHRE,
    PAPER,
    SAGE,
    SAND,
    TEAL,
    Rng,
    Spines,
    one_of,
)
from vobench.asset.shape import (
    at,
    block,
    block_arrays,
    card,
    cushion,
    extrusion,
    lathe,
    sheet,
    sheet_arrays,
    spline,
    tube,
    tube_arrays,
)
from vobench.geometry.se3 import Array
from vobench.scene.material import Material, Texture, linear
from vobench.scene.mesh import as_arrays, as_mesh, joined, moved, textured
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

if TYPE_CHECKING:
    from trimesh import Trimesh


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Faces with one material.

    `geometry` is a mesh or the arrays of a mesh. Arrays are much faster to move.
    """

    geometry: "Trimesh | MeshArrays"
    material: Material

    @property
    def arrays(self) -> MeshArrays:
        """The geometry as arrays."""
        return self.geometry if isinstance(self.geometry, MeshArrays) else as_arrays(self.geometry)

    @property
    def mesh(self) -> "Trimesh":
        """The geometry as a mesh."""
        return as_mesh(self.geometry) if isinstance(self.geometry, MeshArrays) else self.geometry

    def moved(self, T_a_b: Array) -> "Part":
        """The part transformed from frame b to frame a by T_a_b (4, 4)."""
        return Part(self.arrays.moved(T_a_b), self.material)


def matt(colour: str = "#ffffff", texture: Texture | None = None) -> Material:
    """A diffuse material with the colour #rrggbb. A texture is multiplied by the colour."""
    srgb = np.array(picture.rgb(colour), np.uint8)
    red, green, blue = linear(srgb).tolist()
    return Material(colour=(red, green, blue), texture=texture)


def coated(colour: str = "#ffffff", texture: Texture | None = None, roughness: float = 0.3) -> Material:
    """A diffuse material under a clear coat, such as lacquer, plastic or glaze."""
    return replace(matt(colour, texture), eta=1.5, roughness=roughness)


SIDES = (-1, 1)  # left and right, as factors of y
STEEL = Material(colour=(0.52, 0.53, 0.54), metal=1.0, roughness=0.25)
CHROME = Material(colour=(0.65, 0.66, 0.67), metal=1.0, roughness=0.06)
BLACK = coated("#26282a")
DARK = coated("#3d4144")
GREY = coated("#a4a7a6")
WHITE = coated("#dcdbd6")
CREAM = coated("#e6e1d3")
PAGE = matt("#e9e4d8")


def wood(kind: str) -> Material:
    """Lacquered wood. `kind` is one of the woods in `picture.TONES`."""
    return coated(texture=picture.boards(kind), roughness=0.28)


def cloth(colour: str) -> Material:
    """Woven cloth."""
    return matt(colour, picture.fabric())


def mm(places: str) -> Array:
    """Points (N, K) in metres from a text in millimetres, such as "0 0, 34 0, 40 8"."""
    rows = [point.split() for point in places.split(",")]
    return np.array(rows, float) / 1000


def put(
    mesh: "Trimesh | MeshArrays",
    material: Material,
    x: float = 0,
    y: float = 0,
    z: float = 0,
    **turn: float,
) -> Part:
    """A part at a position in metres. `turn` are the yaw, pitch and roll in degrees, as in `at`."""
    T = at(x, y, z, **turn)
    return Part(mesh, material).moved(T)


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
    """A block whose bottom face is at z. `u` shifts its texture, so that equal blocks look different."""
    height = float(np.asarray(size_m)[2])
    mesh = block_arrays(size_m, bevel_m=bevel, uv_m=(u, 1.7 * u))
    return put(mesh, material, x, y, z + height / 2)


def desk(
    rng: Rng,
    width_m: float = 1.6,
    depth_m: float = 0.8,
    height_m: float = 0.74,
    tones: str = "oak",
) -> list[Part]:
    """A table top on two steel legs, with a pedestal of three drawers and a cable tray."""
    leg_y = width_m / 2 - 0.12
    d = depth_m
    h = height_m
    top_m = (d, width_m, 0.026)
    parts = [stood(top_m, wood(tones), 0, 0, h - 0.026, bevel=0.004, u=rng.uniform(0, 2))]

    foot_m = (d - 0.08, 0.06, 0.03)
    post_m = (0.06, 0.08, h - 0.08)
    bearer_m = (d - 0.14, 0.06, 0.024)
    for y in (-leg_y, leg_y):
        parts.append(stood(foot_m, BLACK, 0, y))
        parts.append(stood(post_m, BLACK, 0, y, 0.03))
        parts.append(stood(bearer_m, BLACK, 0, y, h - 0.05))

    rail_m = (0.03, 2 * leg_y, 0.05)
    tray_profile = mm("0 0, 100 0, 100 60, 97 60, 97 3, 3 3, 3 60, 0 60")
    tray = extrusion(tray_profile, 1.4 * leg_y)
    parts.append(stood(rail_m, BLACK, 0, 0, h - 0.08))
    parts.append(put(tray, DARK, 0.06 - d / 2, 0.7 * leg_y, h - 0.16, roll=90))

    pedestal_m = (d - 0.22, 0.4, 0.54)
    pedestal_y = (leg_y - 0.26) * rng.choice([-1, 1])
    parts.append(stood(pedestal_m, GREY, -0.02, pedestal_y, 0.06))
    grip_path = spline(mm("0 -70 0, 28 -55 0, 28 55 0, 0 70 0"), 12)
    grip = tube(grip_path, 0.005)
    front_m = (0.016, 0.385, 0.165)
    for z in (0.075, 0.25, 0.425):
        parts.append(stood(front_m, GREY, d / 2 - 0.125, pedestal_y, z, bevel=0.004))
        parts.append(put(grip, STEEL, d / 2 - 0.118, pedestal_y, z + 0.12))
    return parts


def chair(rng: Rng, colour: str = NAVY) -> list[Part]:
    """A swivel chair on five castors; a person on it looks along x."""
    turn_deg = rng.uniform(0, 72)
    column = lathe(mm("0 70, 40 70, 35 120, 30 220, 18 230, 18 420, 0 420"))
    parts = [put(column, BLACK)]

    castor = lathe(mm("0 -22, 24 -22, 30 -14, 30 14, 24 22, 0 22"), sections=16)
    leg_path = spline(mm("20 0 100, 160 0 95, 300 0 65"), 6)
    leg = tube(leg_path, 0.017)
    for angle in np.deg2rad(turn_deg + 72 * np.arange(5)):
        x = 0.3 * np.cos(angle)
        y = 0.3 * np.sin(angle)
        parts.append(put(leg, BLACK, yaw=np.rad2deg(angle)))
        heading = rng.uniform(0, 360)
        parts.append(put(castor, DARK, x, y, 0.03, yaw=heading, roll=90))

    fabric = cloth(colour)
    seat = cushion((0.48, 0.5, 0.085), power=4.5)
    back = cushion((0.075, 0.46, 0.58), power=4.5)
    support_path = spline(mm("-20 0 430, -240 0 440, -290 0 580, -285 0 850"), 12)
    parts.append(put(seat, fabric, 0.02, 0, 0.475))
    parts.append(put(back, fabric, -0.235, 0, 0.86, pitch=-9))
    parts.append(put(tube(support_path, 0.018), BLACK))
    parts.append(stood((0.3, 0.24, 0.02), BLACK, 0, 0, 0.415))

    armrest = cushion((0.25, 0.075, 0.03), cells=4)
    arm_points = mm("-40 200 435, -40 300 460, -40 295 660")
    for side in (-1, 1):
        arm_path = spline(arm_points * [1, side, 1], 10)
        parts.append(put(tube(arm_path, 0.013), BLACK))
        parts.append(put(armrest, BLACK, -0.01, side * 0.295, 0.675))
    return parts


def _book(spines: Spines, k: int, depth_m: float) -> MeshArrays:
    """A closed book with its spine towards x.

    The texture of spine and covers is from the book's cell of the picture; pages are the colour of the lowest row.
    """
    u0, u1, v0, v1 = spines.cells[k]
    thickness, height = spines.sizes_m[k]
    closed = block_arrays((depth_m, thickness, height), bevel_m=0)
    mesh = closed.moved(at(0, 0, height / 2))

    share_y = mesh.vertices_m[:, 1] / thickness + 0.5
    share_z = mesh.vertices_m[:, 2] / height
    spine_u = u0 + share_y * (u1 - u0)
    spine_v = v1 - share_z * (v1 - v0)
    spine_uv = np.stack([spine_u, spine_v], axis=-1)
    middle_u = (u0 + u1) / 2
    cover_uv = [middle_u, v0 + 0.993 * (v1 - v0)]
    paper_uv = [middle_u, 0.997]

    is_spine = mesh.normals[:, :1] > 0.5
    is_cover = np.abs(mesh.normals[:, 1:2]) > 0.5
    cover_or_paper_uv = np.where(is_cover, cover_uv, paper_uv)
    return replace(mesh, uv=np.where(is_spine, spine_uv, cover_or_paper_uv))


def _books(rng: Rng, spines: Spines, width_m: float, height_m: float) -> MeshArrays:
    """A row of books between ±width_m / 2, and a pile if there is space left.

    Books that are neighbours in the picture mostly stand side by side, and a few lean.
    """
    fitting = [k for k, (_, book_height) in enumerate(spines.sizes_m) if book_height < height_m - 0.01]
    y = -width_m / 2
    end = width_m / 2 - rng.choice([0.0, 0.05, 0.3])
    meshes = []

    k = int(rng.integers(len(fitting)))
    while True:
        starts_new_run = rng.random() < 0.12
        k = int(rng.integers(len(fitting))) if starts_new_run else (k + 1) % len(fitting)
        thickness, height = spines.sizes_m[fitting[k]]
        leans = rng.random() < 0.05
        lean_deg = rng.uniform(5, 11) if leans else 0.0
        overhang = height * float(np.sin(np.deg2rad(lean_deg)))
        step = thickness + 0.0012 + overhang
        if y + step > end:
            break

        is_binder = height > 0.3
        depth = 0.24 if is_binder else 0.72 * height
        book = _book(spines, fitting[k], depth)
        x = -depth / 2 - rng.uniform(0, 0.025)
        meshes.append(book.moved(at(x, y + step / 2, 0, roll=lean_deg)))
        y += step

    if width_m / 2 - end > 0.2:
        pile = _pile(rng, spines, 3)
        meshes.append(pile.moved(at(-0.12, end + 0.15)))
    return joined_arrays(meshes)


def _pile(rng: Rng, spines: Spines, count: int) -> MeshArrays:
    """A stack of books, each rotated a little."""
    books = [k for k, (_, height) in enumerate(spines.sizes_m) if height < 0.3]
    z = 0.0
    meshes = []
    for k in rng.choice(books, count, replace=False):
        thickness, height = spines.sizes_m[k]
        upright = _book(spines, int(k), 0.7 * height)
        lying = upright.moved(at(0, height / 2, thickness / 2, roll=90))
        meshes.append(lying.moved(at(0, 0, z, yaw=rng.normal(0, 7))))
        z += thickness
    return joined_arrays(meshes)


def book_stack(rng: Rng, count: int = 4, seed: int = 0) -> list[Part]:
    """A stack of books."""
    spines = picture.spines(seed)
    pile = _pile(rng, spines, count)
    return [Part(pile, matt(texture=spines.picture))]


def shelf(
    rng: Rng,
    width_m: float = 1.0,
    depth_m: float = 0.3,
    height_m: float = 2.0,
    *,
    tones: str = "walnut",
    seed: int = 0,
) -> list[Part]:
    """An open bookcase with books, binders and boxes; its bays are at most 1.1 m wide."""
    board = wood(tones)
    rows = max(2, round(height_m / 0.37))
    bays = int(np.ceil(width_m / 1.1))
    bay_m = (width_m - 0.022) / bays
    row_m = (height_m - 0.1) / rows
    half = (width_m - 0.022) / 2

    parts = []
    upright_m = (depth_m, 0.022, height_m)
    for bay in range(bays + 1):
        y = bay * bay_m - half
        parts.append(stood(upright_m, board, 0, y, u=bay, bevel=0.002))
    back_m = (0.008, width_m - 0.03, height_m - 0.04)
    top_m = (depth_m, width_m, 0.024)
    parts.append(stood(back_m, board, 0.005 - depth_m / 2, 0, 0.02, bevel=0))
    parts.append(stood(top_m, board, 0.002, 0, height_m - 0.02, bevel=0.002))

    spines = picture.spines(seed)
    books = []
    plank_m = (depth_m - 0.012, bay_m - 0.022, 0.02)
    box_m = (0.24, 0.3 * bay_m, 0.16)
    for bay, row in product(range(bays), range(rows)):
        y = bay * bay_m + bay_m / 2 - half
        z = 0.06 + row * row_m
        start_u = rng.uniform(0, 2)
        parts.append(stood(plank_m, board, 0, y, z - 0.02, bevel=0.002, u=start_u))
        has_boxes = rng.random() < 0.12
        if has_boxes:
            cardboard = matt(one_of(rng, SAGE, SAND, NAVY))
            for side in (-1, 1):
                box_y = y + side * 0.2 * bay_m
                parts.append(stood(box_m, cardboard, depth_m / 2 - 0.15, box_y, z))
        else:
            row_of_books = _books(rng, spines, bay_m - 0.03, row_m - 0.03)
            books.append(row_of_books.moved(at(depth_m / 2 - 0.02, y, z)))
    return [*parts, Part(joined_arrays(books), matt(texture=spines.picture))]


def papers(rng: Rng, count: int = 4, spread_m: float = 0.07, seed: int = 0) -> list[Part]:
    """Overlapping sheets of A4 paper, each with one raised corner."""
    u, v = np.meshgrid(np.linspace(0, 1, 6), np.linspace(1, 0, 7))
    corner = np.clip(u + v - 1.3, 0, 1) ** 2
    page_x = 0.297 * (v - 0.5)
    page_y = 0.21 * (u - 0.5)
    sheets = []
    for k in range(count):
        page_z = 0.0006 * (k + 1) + 0.012 * rng.random() * corner
        points_m = np.stack([page_x, page_y, page_z], axis=-1)
        column = rng.integers(3)
        row = rng.integers(2)
        cells = np.stack([column + u, row + v], axis=-1).reshape(-1, 2)
        page = textured(sheet(points_m), cells / [3, 2])
        center_x, center_y = rng.normal(0, spread_m, 2)
        sheets.append(moved(page, at(center_x, center_y, yaw=rng.normal(0, 14))))
    return [Part(joined(sheets), matt(texture=picture.pages(seed)))]


def monitor(rng: Rng, width_m: float = 0.6, seed: int = 0) -> list[Part]:
    """A display on a foot, switched on and slightly tilted."""
    h = width_m * 0.58
    tilt = rng.uniform(-4, 0)
    glow = replace(
        BLACK,
        roughness=0.12,
        emission_cd_m2=(176.0, 180.0, 188.0),
        emission_texture=picture.screen(seed),
    )
    z = 0.066 + h / 2
    stand_mm = 1000 * z
    stand_profile = mm(f"0 0, 115 0, 115 6, 30 12, 18 20, 18 {stand_mm}, 0 {stand_mm}")
    stand = lathe(stand_profile, sections=32)
    bezel = block((0.022, width_m, h), bevel_m=0.004)
    mount = block((0.03, 0.3, 0.2), bevel_m=0.012)
    screen = moved(card((width_m - 0.014, h - 0.018)), at(0.0115))
    return [
        put(stand, BLACK, -0.03),
        put(bezel, BLACK, 0.02, 0, z, pitch=tilt),
        put(mount, BLACK, 0, 0, z, pitch=tilt),
        put(screen, glow, 0.02, 0, z + 0.002, pitch=tilt),
    ]


def keyboard(_: Rng) -> list[Part]:
    """A keyboard of five rows, with a gap before the number pad."""
    key = block_arrays((0.016, 0.016, 0.008), bevel_m=0)
    space_bar = block_arrays((0.016, 0.111, 0.008), bevel_m=0)
    keys = []
    for row, column in product(range(5), range(23)):
        is_gap = column in (14, 18)
        is_space_bar = row == 4 and 3 <= column <= 8
        if not is_gap and not is_space_bar:
            x = 0.038 - 0.019 * row
            y = 0.019 * column - 0.209
            keys.append(key.moved(at(x, y, 0.014)))
    keys.append(space_bar.moved(at(-0.038, -0.1045, 0.014)))
    return [stood((0.125, 0.45, 0.011), BLACK), Part(joined_arrays(keys), DARK)]


def mouse(rng: Rng) -> list[Part]:
    """A mouse on its mat."""
    mat_colour = matt(one_of(rng, NAVY, TEAL, INK))
    mat = stood((0.2, 0.24, 0.003), mat_colour, bevel=0.001)
    body = cushion((0.11, 0.06, 0.036), power=2.6)
    return [mat, put(body, BLACK, 0.01, 0, 0.019)]


def mug(rng: Rng) -> list[Part]:
    """A glazed mug with a handle and coffee."""
    glaze = coated(one_of(rng, BRICK, PAPER, TEAL, OCHRE, NAVY), roughness=0.08)
    turn_deg = rng.uniform(0, 360)
    body = lathe(mm("0 0, 34 0, 40 8, 41 94, 38 96, 36 90, 35 12, 0 10"), sections=32)
    handle_path = spline(mm("38 0 22, 68 0 26, 68 0 72, 39 0 78"), 12)
    handle = tube(handle_path, 0.006)
    surface = lathe(mm("0 60, 35.9 70, 0 70.1"))
    coffee = coated("#2a1a10", roughness=0.02)
    return [put(body, glaze), put(handle, glaze, yaw=turn_deg), put(surface, coffee)]


def pens(rng: Rng) -> list[Part]:
    """A cup with pens."""
    cup = lathe(mm("0 0, 40 0, 40 100, 37 100, 37 5, 0 5"))
    parts = [put(cup, DARK)]
    for ink in rng.choice([NAVY, BRICK, OCHRE, INK, TEAL, PAPER], 6):
        pen = tube(mm(f"-20 0 7, {rng.uniform(15, 32)} 0 155"), 0.004)
        parts.append(put(pen, coated(str(ink)), yaw=rng.uniform(0, 360)))
    return parts


def desk_lamp(rng: Rng, colour: str = TEAL) -> list[Part]:
    """A lamp with a bent arm and a conical shade."""
    paint = coated(colour, roughness=0.2)
    foot = lathe(mm("0 0, 85 0, 85 12, 70 20, 12 28, 10 50, 0 50"), sections=32)
    arm_path = spline(mm("0 0 40, -20 0 200, 50 0 420, 200 0 470"), 20)
    arm = tube(arm_path, 0.007)
    shade = lathe(mm("0 46, 32 44, 75 -50, 78 -50, 35 50, 20 60, 0 60"), sections=32)
    return [
        put(foot, paint),
        put(arm, STEEL),
        put(shade, paint, 0.23, 0, 0.45, pitch=rng.uniform(8, 24)),
    ]


def cables(rng: Rng, length_m: float = 1.2, height_m: float = 0.7) -> list[Part]:
    """Cables that hang from a desk of height_m and run to a socket on the wall length_m behind it."""
    radius_m = 0.0045
    lowest = [-9, -9, 0.006]  # so that cables lie on the floor
    x = length_m * np.array([0, -0.02, -0.3, -0.8, -1])
    z = [height_m, 0.45 * height_m, 0.01, 0.01, 0.22]
    leads = []
    for k in range(3):
        y = np.array([*rng.normal(0, 0.12, 4), 0.04 * k])
        path = spline(np.stack([x, y, z], axis=1), 28)
        leads.append(tube_arrays(np.maximum(path, lowest), radius_m, sections=6))
    return [Part(joined_arrays(leads), BLACK)]


def plant(
    rng: Rng,
    height_m: float = 1.2,
    leaves: int = 26,
) -> list[Part]:
    """Broad leaves on stems in a pot of clay."""
    pot_m = 0.28 * height_m
    stems = []
    blades = []
    t = np.linspace(0, 1, 8)[:, None]
    for _ in range(leaves):
        T_plant_leaf = at(yaw=rng.uniform(0, 360))
        rise = rng.uniform(0.4, 0.95) * height_m
        shares = rng.uniform([0.05, 0.14, 0.1], [0.3, 0.26, 0.9])
        reach, length, drop = shares * [height_m, height_m, 1]

        stem_start = [0, 0, 0.85 * pot_m]
        stem_middle = [0.3 * reach, 0, 0.6 * rise]
        stem_end = [reach, 0, rise]
        stem_path = spline([stem_start, stem_middle, stem_end], 6)
        stem = tube_arrays(stem_path, 0.0035 * height_m, sections=5)
        stems.append(stem.moved(T_plant_leaf))

        # t runs along the blade, from the stem to the tip.
        half_width = 0.26 * length * np.sin(np.pi * t**0.75) + 0.0005
        y = half_width * np.array([1, 0.5, 0, -0.5, -1])
        arch = length * (0.35 * t - drop * t**2)
        fold = 0.25 * np.abs(y)
        ripple = 0.006 * np.sin(9 * t)
        z = rise + arch + fold + ripple
        x = reach + length * (t + 0 * y)
        blade = sheet_arrays(np.stack([x, y, z], axis=-1))
        blades.append(blade.moved(T_plant_leaf).two_sided())

    pot_profile = mm("0 0, 360 0, 480 920, 520 930, 520 1000, 460 1000, 440 850, 0 860")
    pot = lathe(pot_profile * pot_m, sections=32)
    soil = lathe(mm("0 800, 450 870, 0 900") * pot_m)
    clay = matt(texture=picture.ground("clay", 0, 512, 0.6))
    leaf = coated("#e8f0d8", picture.ground("leaf", 0, 512, 0.4), roughness=0.35)
    return [
        put(pot, clay),
        put(soil, matt("#3a2c22")),
        Part(joined_arrays(stems), matt("#4b5a2e")),
        Part(joined_arrays(blades), leaf),
    ]


def carton(_: Rng, size_m: tuple[float, float, float] = (0.36, 0.46, 0.3), seed: int = 0) -> list[Part]:
    """A cardboard box with tape and a label."""
    tile_m = max(size_m)
    box = block(size_m, bevel_m=0.002, uv_m=(tile_m / 2, tile_m / 2), upright=True)
    standing = moved(box, at(0, 0, size_m[2] / 2))
    return [Part(standing, matt(texture=picture.carton(seed, tile_m)))]


def crate(rng: Rng, size_m: tuple[float, float, float] = (0.8, 0.8, 1.2)) -> list[Part]:
    """A box of rough planks with corner posts and a label."""
    x, y, z = size_m
    rough = matt(texture=picture.boards("beech", 5, rows=6))
    core_m = (x - 0.06, y - 0.06, z - 0.01)
    parts = [stood(core_m, matt("#2b221a"), bevel=0)]

    rows = max(2, round(z / 0.14))
    for side in (-1, 1):
        for row in range(rows):
            plank_m = z / rows - rng.uniform(0.003, 0.01)
            u = rng.uniform(0, 3)
            bottom = row * z / rows
            across_m = (x - 0.04, 0.02, plank_m)
            along_m = (0.02, y - 0.04, plank_m)
            front_y = side * (y / 2 - 0.03)
            flank_x = side * (x / 2 - 0.03)
            parts.append(stood(across_m, rough, 0, front_y, bottom, u=u))
            parts.append(stood(along_m, rough, flank_x, 0, bottom, u=u + 0.4))
        for other in (-1, 1):
            u = rng.uniform(0, 3)
            post_m = (0.09, 0.02, z)
            edge_m = (0.02, 0.07, z)
            post_x = side * (x / 2 - 0.055)
            post_y = other * (y / 2 - 0.01)
            edge_x = side * (x / 2 - 0.01)
            edge_y = other * (y / 2 - 0.055)
            parts.append(stood(post_m, rough, post_x, post_y, u=u))
            parts.append(stood(edge_m, rough, edge_x, edge_y, u=u + 0.2))

    lid_m = (x / 5 - 0.006, y, 0.02)
    for k in range(5):
        board_x = (k - 2) * x / 5
        parts.append(stood(lid_m, rough, board_x, 0, z - 0.01, u=0.3 * k))

    plate = matt(texture=picture.sign("M-12", SAND))
    face_x = x / 2 - 0.0185
    parts.append(put(card((0.36, 0.18)), plate, face_x, 0, 0.6 * z))
    return parts


def sofa(
    _: Rng,
    width_m: float = 2.0,
    depth_m: float = 0.9,
    height_m: float = 0.7,
    colour: str = SAGE,
) -> list[Part]:
    """A three-seat sofa on short legs, with two loose cushions."""
    cover = cloth(colour)
    seat_m = (width_m - 0.36) / 3
    d = depth_m / 2
    base = cushion((2 * d - 0.04, width_m - 0.1, 0.2), power=12)
    back = cushion((0.22, width_m - 0.06, height_m - 0.14), power=7, cells=8)
    parts = [
        put(base, cover, 0, 0, 0.2),
        put(back, cover, 0.11 - d, 0, 0.07 + height_m / 2),
    ]

    armrest = cushion((2 * d - 0.02, 0.18, 0.44), power=7)
    loose = cushion((0.13, 0.42, 0.4), power=2.8)
    leg_m = (0.05, 0.05, 0.12)
    for side in (-1, 1):
        armrest_y = side * (width_m / 2 - 0.09)
        parts.append(put(armrest, cover, 0.01, armrest_y, 0.34))
        for x in (0.08 - d, d - 0.08):
            leg_y = side * (width_m / 2 - 0.1)
            parts.append(stood(leg_m, wood("walnut"), x, leg_y))
        accent = cloth(OCHRE if side > 0 else BRICK)
        parts.append(put(loose, accent, -0.12, side * 0.58, 0.6, pitch=-18, yaw=side * 6))

    seat = cushion((2 * d - 0.22, seat_m - 0.005, 0.15), power=6)
    rest = cushion((0.17, seat_m - 0.01, 0.36), power=4.5)
    for y in (-seat_m, 0, seat_m):
        parts.append(put(seat, cover, 0.1, y, 0.36))
        parts.append(put(rest, cover, 0.27 - d, y, 0.56, pitch=-10))
    return parts


def waste_bin(
    rng: Rng,
    width_m: float = 0.3,
    height_m: float = 0.4,
) -> list[Part]:
    """A waste bin with crumpled paper."""
    profile = mm("0 0, 400 0, 500 1000, 480 1000, 385 20, 0 20") * [width_m, height_m]
    size_m = [width_m, width_m, height_m]
    ball = cushion((0.1, 0.09, 0.08), power=2, cells=4)
    balls = []
    for _ in range(7):
        x, y, z = rng.uniform(-0.25, 0.25, 3) * size_m + [0, 0, 0.6 * height_m]
        yaw = rng.uniform(0, 360)
        roll = rng.uniform(0, 90)
        balls.append(moved(ball, at(x, y, z, yaw=yaw, roll=roll)))
    return [put(lathe(profile, sections=32), DARK), Part(joined(balls), PAGE)]


def cabinet(
    _: Rng,
    width_m: float = 0.8,
    depth_m: float = 0.6,
    height_m: float = 1.2,
    colour: str = "#8b9493",
) -> list[Part]:
    """A steel cabinet with two doors, on a plinth."""
    paint = coated(colour, roughness=0.35)
    w = width_m
    d = depth_m
    h = height_m
    body_m = (d - 0.02, w, h - 0.06)
    plinth_m = (d - 0.06, w - 0.03, 0.06)
    parts = [
        stood(body_m, paint, -0.01, 0, 0.06, bevel=0.005),
        stood(plinth_m, BLACK, -0.01),
    ]

    grip_path = spline(mm("0 0 -80, 30 0 -60, 30 0 60, 0 0 80"), 12)
    grip = tube(grip_path, 0.006)
    door_m = (0.018, w / 2 - 0.006, h - 0.08)
    plate = card((0.12, 0.06))
    label = matt(texture=picture.sign("FILES"))
    for side in (-1, 1):
        door_y = side * w / 4
        parts.append(stood(door_m, paint, d / 2 - 0.01, door_y, 0.07, bevel=0.004))
        parts.append(put(grip, CHROME, d / 2, side * 0.04, 0.6 * h))
        parts.append(put(plate, label, d / 2 - 0.0005, door_y, 0.85 * h))
    return parts


def bench(
    rng: Rng,
    width_m: float = 2.0,
    depth_m: float = 0.9,
    height_m: float = 0.7,
) -> list[Part]:
    """A work bench of beech with a shelf below."""
    beech = wood("beech")
    d = depth_m
    w = width_m
    h = height_m

    leg_m = (0.09, 0.09, h - 0.05)
    parts = []
    for side in (-1, 1):
        for end in (-1, 1):
            x = side * (d / 2 - 0.07)
            y = end * (w / 2 - 0.09)
            parts.append(stood(leg_m, beech, x, y, u=rng.uniform(0, 2), bevel=0.005))

    plank_m = (d / 4 - 0.003, w, 0.05)
    for k in range(4):
        x = (k - 1.5) * d / 4
        parts.append(stood(plank_m, beech, x, 0, h - 0.05, u=rng.uniform(0, 2)))
    shelf_m = (d - 0.1, w - 0.12, 0.025)
    parts.append(stood(shelf_m, beech, 0, 0, 0.18, u=rng.uniform(0, 2)))
    return parts


def pillar(
    rng: Rng,
    width_m: float = 0.4,
    height_m: float = 3.0,
) -> list[Part]:
    """A column of raw concrete with chamfered edges, a kick plate and a sign."""
    concrete = matt(texture=picture.ground("concrete"))
    sign = matt(texture=picture.sign("P2", OCHRE))
    w = width_m
    kick_m = w + 0.006
    return [
        stood((w, w, height_m), concrete, bevel=0.015, u=rng.uniform(0, 2)),
        stood((kick_m, kick_m, 0.1), STEEL, bevel=0.002),
        put(card((0.24, 0.12)), sign, w / 2 + 0.001, 0, 1.7),
    ]
