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

A4_LONG_M = 0.297  # ISO 216
A4_SHORT_M = 0.21
DESK_TOP_M = 0.026  # thickness
CASTORS = 5  # of a swivel chair
CASTOR_RADIUS_M = 0.3  # distance of the castors from the column
SHELF_BOARD_M = 0.022  # thickness of the uprights
SHELF_ROW_M = 0.37  # height of a row, about
WIDEST_BAY_M = 1.1
BINDER_HEIGHT_M = 0.3  # higher books are binders
BINDER_DEPTH_M = 0.24
BOOK_GAP_M = 0.0012  # between neighbours
SCREEN_ASPECT = 0.58  # height of a display over its width
SCREEN_CD_M2 = (176.0, 180.0, 188.0)  # luminance of white, a little bluish
KEY_PITCH_M = 0.019  # 19 mm from key to key, as on most keyboards
KEY_ROWS = 5
KEY_COLUMNS = 23
GAP_COLUMNS = (14, 18)  # before the cursor keys, and before the number pad
CABLE_RADIUS_M = 0.0045
CABLES = 3
CRATE_PLANK_M = 0.14  # width of a plank, about
CRATE_LID_BOARDS = 5
SOFA_SEATS = 3
ARMREST_M = 0.18  # width
CRUMPLED_PAGES = 7
PLINTH_M = 0.06  # height of the plinth of a cabinet
BENCH_TOP_M = 0.05  # thickness
BENCH_PLANKS = 4


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
    top_m = (depth_m, width_m, DESK_TOP_M)
    parts = [stood(top_m, wood(tones), z=height_m - DESK_TOP_M, bevel=0.004, u=rng.uniform(0, 2))]

    foot_m = (depth_m - 0.08, 0.06, 0.03)
    post_m = (0.06, 0.08, height_m - 0.08)
    bearer_m = (depth_m - 0.14, 0.06, 0.024)
    for y in (-leg_y, leg_y):
        parts.append(stood(foot_m, BLACK, 0, y))
        parts.append(stood(post_m, BLACK, 0, y, 0.03))
        parts.append(stood(bearer_m, BLACK, 0, y, height_m - 0.05))

    rail_m = (0.03, 2 * leg_y, 0.05)
    tray_profile = mm("0 0, 100 0, 100 60, 97 60, 97 3, 3 3, 3 60, 0 60")
    tray = extrusion(tray_profile, 1.4 * leg_y)
    parts.append(stood(rail_m, BLACK, z=height_m - 0.08))
    parts.append(put(tray, DARK, 0.06 - depth_m / 2, 0.7 * leg_y, height_m - 0.16, roll=90))

    pedestal_m = (depth_m - 0.22, 0.4, 0.54)
    pedestal_y = (leg_y - 0.26) * rng.choice([-1, 1])
    parts.append(stood(pedestal_m, GREY, -0.02, pedestal_y, 0.06))
    grip_path = spline(mm("0 -70 0, 28 -55 0, 28 55 0, 0 70 0"), 12)
    grip = tube(grip_path, 0.005)
    front_m = (0.016, 0.385, 0.165)
    for drawer_z in (0.075, 0.25, 0.425):
        parts.append(stood(front_m, GREY, depth_m / 2 - 0.125, pedestal_y, drawer_z, bevel=0.004))
        parts.append(put(grip, STEEL, depth_m / 2 - 0.118, pedestal_y, drawer_z + 0.12))
    return parts


def chair(rng: Rng, colour: str = NAVY) -> list[Part]:
    """A swivel chair on five castors; a person on it looks along x."""
    castor_angle_deg = 360 / CASTORS
    first_castor_deg = rng.uniform(0, castor_angle_deg)
    column = lathe(mm("0 70, 40 70, 35 120, 30 220, 18 230, 18 420, 0 420"))
    parts = [put(column, BLACK)]

    castor = lathe(mm("0 -22, 24 -22, 30 -14, 30 14, 24 22, 0 22"), sections=16)
    leg_path = spline(mm("20 0 100, 160 0 95, 300 0 65"), 6)
    leg = tube(leg_path, 0.017)
    for angle_rad in np.deg2rad(first_castor_deg + castor_angle_deg * np.arange(CASTORS)):
        x = CASTOR_RADIUS_M * np.cos(angle_rad)
        y = CASTOR_RADIUS_M * np.sin(angle_rad)
        parts.append(put(leg, BLACK, yaw=np.rad2deg(angle_rad)))
        heading_deg = rng.uniform(0, 360)
        parts.append(put(castor, DARK, x, y, 0.03, yaw=heading_deg, roll=90))

    fabric = cloth(colour)
    seat = cushion((0.48, 0.5, 0.085), power=4.5)
    back = cushion((0.075, 0.46, 0.58), power=4.5)
    support_path = spline(mm("-20 0 430, -240 0 440, -290 0 580, -285 0 850"), 12)
    seat_plate_m = (0.3, 0.24, 0.02)
    parts.append(put(seat, fabric, 0.02, z=0.475))
    parts.append(put(back, fabric, -0.235, z=0.86, pitch=-9))
    parts.append(put(tube(support_path, 0.018), BLACK))
    parts.append(stood(seat_plate_m, BLACK, z=0.415))

    armrest = cushion((0.25, 0.075, 0.03), cells=4)
    arm_points = mm("-40 200 435, -40 300 460, -40 295 660")
    for side in SIDES:
        arm_path = spline(arm_points * [1, side, 1], 10)
        parts.append(put(tube(arm_path, 0.013), BLACK))
        parts.append(put(armrest, BLACK, -0.01, side * 0.295, 0.675))
    return parts


def _book(spines: Spines, number: int, depth_m: float) -> MeshArrays:
    """A closed book with its spine towards x.

    `number` is that of its spine in the picture. The texture of spine and covers is from the cell of that spine; the
    colour of the pages is from the lowest row of the picture.
    """
    u_left, u_right, v_top, v_bottom = spines.cells[number]
    thickness_m, height_m = spines.sizes_m[number]
    closed = block_arrays((depth_m, thickness_m, height_m), bevel_m=0)
    book = closed.moved(at(0, 0, height_m / 2))

    share_y = book.vertices_m[:, 1] / thickness_m + 0.5
    share_z = book.vertices_m[:, 2] / height_m
    spine_u = u_left + share_y * (u_right - u_left)
    spine_v = v_bottom - share_z * (v_bottom - v_top)
    spine_uv = np.stack([spine_u, spine_v], axis=-1)
    # All of a cover and all pages have the colour of one point, near the bottom of the cell and of the picture.
    middle_u = (u_left + u_right) / 2
    cover_uv = [middle_u, v_top + 0.993 * (v_bottom - v_top)]
    paper_uv = [middle_u, 0.997]

    is_spine = book.normals[:, :1] > 0.5
    is_cover = np.abs(book.normals[:, 1:2]) > 0.5
    cover_or_paper_uv = np.where(is_cover, cover_uv, paper_uv)
    return replace(book, uv=np.where(is_spine, spine_uv, cover_or_paper_uv))


def _books(rng: Rng, spines: Spines, width_m: float, height_m: float) -> MeshArrays:
    """A row of books between ±width_m / 2, and a pile if there is space left.

    Books that are neighbours in the picture mostly stand side by side, and a few lean.
    """
    fitting = _fitting_books(spines, height_m - 0.01)
    y = -width_m / 2
    free_m = rng.choice([0.0, 0.05, 0.3])  # at the end of the row
    end = width_m / 2 - free_m
    meshes = []

    nth = int(rng.integers(len(fitting)))
    while True:
        starts_new_run = rng.random() < 0.12
        nth = int(rng.integers(len(fitting))) if starts_new_run else (nth + 1) % len(fitting)
        thickness_m, book_height_m = spines.sizes_m[fitting[nth]]
        is_leaning = rng.random() < 0.05
        lean_deg = rng.uniform(5, 11) if is_leaning else 0.0
        overhang_m = book_height_m * float(np.sin(np.deg2rad(lean_deg)))
        step_m = thickness_m + BOOK_GAP_M + overhang_m
        if y + step_m > end:
            break

        is_binder = book_height_m > BINDER_HEIGHT_M
        depth_m = BINDER_DEPTH_M if is_binder else 0.72 * book_height_m
        book = _book(spines, fitting[nth], depth_m)
        x = -depth_m / 2 - rng.uniform(0, 0.025)
        meshes.append(book.moved(at(x, y + step_m / 2, 0, roll=lean_deg)))
        y += step_m

    has_space_for_pile = width_m / 2 - end > 0.2
    if has_space_for_pile:
        pile = _pile(rng, spines, 3)
        meshes.append(pile.moved(at(-0.12, end + 0.15)))
    return joined_arrays(meshes)


def _fitting_books(spines: Spines, height_m: float) -> list[int]:
    """The numbers of the books that are lower than a height."""
    return [number for number, (_, book_height_m) in enumerate(spines.sizes_m) if book_height_m < height_m]


def _pile(rng: Rng, spines: Spines, count: int) -> MeshArrays:
    """A stack of books, each rotated a little."""
    z = 0.0
    meshes = []
    for number in rng.choice(_fitting_books(spines, BINDER_HEIGHT_M), count, replace=False):
        thickness_m, height_m = spines.sizes_m[number]
        upright = _book(spines, int(number), 0.7 * height_m)
        lying = upright.moved(at(0, height_m / 2, thickness_m / 2, roll=90))
        meshes.append(lying.moved(at(0, 0, z, yaw=rng.normal(0, 7))))
        z += thickness_m
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
    rows = max(2, round(height_m / SHELF_ROW_M))
    bays = int(np.ceil(width_m / WIDEST_BAY_M))
    bay_m = (width_m - SHELF_BOARD_M) / bays
    row_m = (height_m - 0.1) / rows
    half_m = (width_m - SHELF_BOARD_M) / 2

    parts = []
    upright_m = (depth_m, SHELF_BOARD_M, height_m)
    for bay in range(bays + 1):
        y = bay * bay_m - half_m
        parts.append(stood(upright_m, board, 0, y, u=bay, bevel=0.002))
    back_m = (0.008, width_m - 0.03, height_m - 0.04)
    top_m = (depth_m, width_m, 0.024)
    parts.append(stood(back_m, board, 0.005 - depth_m / 2, z=0.02, bevel=0))
    parts.append(stood(top_m, board, 0.002, z=height_m - 0.02, bevel=0.002))

    spines = picture.spines(seed)
    books = []
    plank_m = (depth_m - 0.012, bay_m - SHELF_BOARD_M, 0.02)
    box_m = (0.24, 0.3 * bay_m, 0.16)
    for bay, row in product(range(bays), range(rows)):
        y = bay * bay_m + bay_m / 2 - half_m
        z = 0.06 + row * row_m
        start_u = rng.uniform(0, 2)
        parts.append(stood(plank_m, board, 0, y, z - 0.02, bevel=0.002, u=start_u))
        has_boxes = rng.random() < 0.12
        if has_boxes:
            cardboard = matt(one_of(rng, SAGE, SAND, NAVY))
            for side in SIDES:
                box_y = y + side * 0.2 * bay_m
                parts.append(stood(box_m, cardboard, depth_m / 2 - 0.15, box_y, z))
        else:
            row_of_books = _books(rng, spines, bay_m - 0.03, row_m - 0.03)
            books.append(row_of_books.moved(at(depth_m / 2 - 0.02, y, z)))
    if books:  # a low shelf may have boxes only
        parts.append(Part(joined_arrays(books), matt(texture=spines.picture)))
    return parts


def papers(rng: Rng, count: int = 4, spread_m: float = 0.07, seed: int = 0) -> list[Part]:
    """Overlapping sheets of A4 paper, each with one raised corner."""
    u, v = np.meshgrid(np.linspace(0, 1, 6), np.linspace(1, 0, 7))
    raised_share = np.clip(u + v - 1.3, 0, 1) ** 2  # 0 but near one corner
    page_x = A4_LONG_M * (v - 0.5)
    page_y = A4_SHORT_M * (u - 0.5)
    sheets = []
    for number in range(count):
        page_z = 0.0006 * (number + 1) + 0.012 * rng.random() * raised_share
        points_m = np.stack([page_x, page_y, page_z], axis=-1)
        # The picture has three columns and two rows of pages.
        column = rng.integers(3)
        row = rng.integers(2)
        cells = np.stack([column + u, row + v], axis=-1).reshape(-1, 2)
        page = textured(sheet(points_m), cells / [3, 2])
        center_x, center_y = rng.normal(0, spread_m, 2)
        sheets.append(moved(page, at(center_x, center_y, yaw=rng.normal(0, 14))))
    return [Part(joined(sheets), matt(texture=picture.pages(seed)))]


def monitor(rng: Rng, width_m: float = 0.6, seed: int = 0) -> list[Part]:
    """A display on a foot, switched on and slightly tilted."""
    height_m = width_m * SCREEN_ASPECT
    tilt_deg = rng.uniform(-4, 0)
    glow = replace(
        BLACK,
        roughness=0.12,
        emission_cd_m2=SCREEN_CD_M2,
        emission_texture=picture.screen(seed),
    )
    middle_z = 0.066 + height_m / 2
    stand_mm = 1000 * middle_z
    stand_profile = mm(f"0 0, 115 0, 115 6, 30 12, 18 20, 18 {stand_mm}, 0 {stand_mm}")
    stand = lathe(stand_profile, sections=32)
    bezel = block((0.022, width_m, height_m), bevel_m=0.004)
    mount = block((0.03, 0.3, 0.2), bevel_m=0.012)
    screen = moved(card((width_m - 0.014, height_m - 0.018)), at(0.0115))
    return [
        put(stand, BLACK, -0.03),
        put(bezel, BLACK, 0.02, z=middle_z, pitch=tilt_deg),
        put(mount, BLACK, z=middle_z, pitch=tilt_deg),
        put(screen, glow, 0.02, z=middle_z + 0.002, pitch=tilt_deg),
    ]


def keyboard(_: Rng) -> list[Part]:
    """A keyboard of five rows, with gaps before the cursor keys and the number pad."""
    key = block_arrays((0.016, 0.016, 0.008), bevel_m=0)
    space_bar = block_arrays((0.016, 0.111, 0.008), bevel_m=0)
    keys = []
    for row, column in product(range(KEY_ROWS), range(KEY_COLUMNS)):
        is_gap = column in GAP_COLUMNS
        is_space_bar = row == KEY_ROWS - 1 and 3 <= column <= 8
        if not is_gap and not is_space_bar:
            x = 0.038 - KEY_PITCH_M * row
            y = KEY_PITCH_M * column - 0.209
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
    lowest_m = [-9, -9, 0.006]  # so that cables lie on the floor
    x = length_m * np.array([0, -0.02, -0.3, -0.8, -1])
    z = [height_m, 0.45 * height_m, 0.01, 0.01, 0.22]
    leads = []
    for number in range(CABLES):
        y = np.array([*rng.normal(0, 0.12, 4), 0.04 * number])
        path = spline(np.stack([x, y, z], axis=1), 28)
        leads.append(tube_arrays(np.maximum(path, lowest_m), CABLE_RADIUS_M, sections=6))
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
    for _ in range(leaves):
        T_plant_leaf = at(yaw=rng.uniform(0, 360))
        rise_m = rng.uniform(0.4, 0.95) * height_m
        shares = rng.uniform([0.05, 0.14, 0.1], [0.3, 0.26, 0.9])
        reach_m, length_m, drop = shares * [height_m, height_m, 1]
        stem = _stem(pot_m, reach_m, rise_m, 0.0035 * height_m)
        blade = _blade(reach_m, rise_m, length_m, drop)
        stems.append(stem.moved(T_plant_leaf))
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


def _stem(pot_m: float, reach_m: float, rise_m: float, radius_m: float) -> MeshArrays:
    """A stem from the middle of a pot to the foot of a blade, at `reach_m` along x and `rise_m` above the floor."""
    start = [0, 0, 0.85 * pot_m]
    middle = [0.3 * reach_m, 0, 0.6 * rise_m]
    end = [reach_m, 0, rise_m]
    path_m = spline([start, middle, end], 6)
    return tube_arrays(path_m, radius_m, sections=5)


def _blade(reach_m: float, rise_m: float, length_m: float, drop: float) -> MeshArrays:
    """A blade from its foot along x. The larger `drop`, the lower its tip."""
    along = np.linspace(0, 1, 8)[:, None]  # from the stem to the tip
    half_width_m = 0.26 * length_m * np.sin(np.pi * along**0.75) + 0.0005
    y = half_width_m * np.array([1, 0.5, 0, -0.5, -1])
    arch_m = length_m * (0.35 * along - drop * along**2)
    fold_m = 0.25 * np.abs(y)
    ripple_m = 0.006 * np.sin(9 * along)
    z = rise_m + arch_m + fold_m + ripple_m
    x = np.broadcast_to(reach_m + length_m * along, y.shape)
    return sheet_arrays(np.stack([x, y, z], axis=-1))


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

    rows = max(2, round(z / CRATE_PLANK_M))
    for side in SIDES:
        for row in range(rows):
            gap_m = rng.uniform(0.003, 0.01)
            plank_m = z / rows - gap_m
            u = rng.uniform(0, 3)
            bottom = row * z / rows
            across_m = (x - 0.04, 0.02, plank_m)
            along_m = (0.02, y - 0.04, plank_m)
            front_y = side * (y / 2 - 0.03)
            flank_x = side * (x / 2 - 0.03)
            parts.append(stood(across_m, rough, 0, front_y, bottom, u=u))
            parts.append(stood(along_m, rough, flank_x, 0, bottom, u=u + 0.4))
        for other_side in SIDES:
            # A corner post consists of a board on the front or the back and one on the flank.
            u = rng.uniform(0, 3)
            front_board_m = (0.09, 0.02, z)
            flank_board_m = (0.02, 0.07, z)
            front_x = side * (x / 2 - 0.055)
            front_y = other_side * (y / 2 - 0.01)
            flank_x = side * (x / 2 - 0.01)
            flank_y = other_side * (y / 2 - 0.055)
            parts.append(stood(front_board_m, rough, front_x, front_y, u=u))
            parts.append(stood(flank_board_m, rough, flank_x, flank_y, u=u + 0.2))

    middle_board = (CRATE_LID_BOARDS - 1) // 2
    lid_board_m = (x / CRATE_LID_BOARDS - 0.006, y, 0.02)
    for number in range(CRATE_LID_BOARDS):
        board_x = (number - middle_board) * x / CRATE_LID_BOARDS
        parts.append(stood(lid_board_m, rough, board_x, z=z - 0.01, u=0.3 * number))

    plate = matt(texture=picture.sign("M-12", SAND))
    face_x = x / 2 - 0.0185
    parts.append(put(card((0.36, 0.18)), plate, face_x, z=0.6 * z))
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
    seat_m = (width_m - 2 * ARMREST_M) / SOFA_SEATS
    front_x = depth_m / 2
    back_x = -depth_m / 2
    base = cushion((depth_m - 0.04, width_m - 0.1, 0.2), power=12)
    back = cushion((0.22, width_m - 0.06, height_m - 0.14), power=7, cells=8)
    parts = [
        put(base, cover, z=0.2),
        put(back, cover, back_x + 0.11, z=0.07 + height_m / 2),
    ]

    armrest = cushion((depth_m - 0.02, ARMREST_M, 0.44), power=7)
    loose = cushion((0.13, 0.42, 0.4), power=2.8)
    leg_m = (0.05, 0.05, 0.12)
    for side in SIDES:
        armrest_y = side * (width_m / 2 - ARMREST_M / 2)
        parts.append(put(armrest, cover, 0.01, armrest_y, 0.34))
        for leg_x in (back_x + 0.08, front_x - 0.08):
            leg_y = side * (width_m / 2 - 0.1)
            parts.append(stood(leg_m, wood("walnut"), leg_x, leg_y))
        accent = cloth(OCHRE if side > 0 else BRICK)
        parts.append(put(loose, accent, -0.12, side * 0.58, 0.6, pitch=-18, yaw=side * 6))

    seat = cushion((depth_m - 0.22, seat_m - 0.005, 0.15), power=6)
    backrest = cushion((0.17, seat_m - 0.01, 0.36), power=4.5)
    for y in (-seat_m, 0, seat_m):
        parts.append(put(seat, cover, 0.1, y, 0.36))
        parts.append(put(backrest, cover, back_x + 0.27, y, 0.56, pitch=-10))
    return parts


def waste_bin(
    rng: Rng,
    width_m: float = 0.3,
    height_m: float = 0.4,
) -> list[Part]:
    """A waste bin with crumpled paper."""
    profile = mm("0 0, 400 0, 500 1000, 480 1000, 385 20, 0 20") * [width_m, height_m]
    size_m = [width_m, width_m, height_m]
    middle_m = [0, 0, 0.6 * height_m]  # of the paper
    ball = cushion((0.1, 0.09, 0.08), power=2, cells=4)
    balls = []
    for _ in range(CRUMPLED_PAGES):
        x, y, z = rng.uniform(-0.25, 0.25, 3) * size_m + middle_m
        yaw_deg = rng.uniform(0, 360)
        roll_deg = rng.uniform(0, 90)
        balls.append(moved(ball, at(x, y, z, yaw=yaw_deg, roll=roll_deg)))
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
    body_m = (depth_m - 0.02, width_m, height_m - PLINTH_M)
    plinth_m = (depth_m - 0.06, width_m - 0.03, PLINTH_M)
    parts = [
        stood(body_m, paint, -0.01, z=PLINTH_M, bevel=0.005),
        stood(plinth_m, BLACK, -0.01),
    ]

    grip_path = spline(mm("0 0 -80, 30 0 -60, 30 0 60, 0 0 80"), 12)
    grip = tube(grip_path, 0.006)
    door_m = (0.018, width_m / 2 - 0.006, height_m - 0.08)
    plate = card((0.12, 0.06))
    label = matt(texture=picture.sign("FILES"))
    front_x = depth_m / 2
    for side in SIDES:
        door_y = side * width_m / 4
        parts.append(stood(door_m, paint, front_x - 0.01, door_y, 0.07, bevel=0.004))
        parts.append(put(grip, CHROME, front_x, side * 0.04, 0.6 * height_m))
        parts.append(put(plate, label, front_x - 0.0005, door_y, 0.85 * height_m))
    return parts


def bench(
    rng: Rng,
    width_m: float = 2.0,
    depth_m: float = 0.9,
    height_m: float = 0.7,
) -> list[Part]:
    """A work bench of beech with a shelf below."""
    beech = wood("beech")
    leg_m = (0.09, 0.09, height_m - BENCH_TOP_M)
    parts = []
    for side in SIDES:
        for end in SIDES:
            x = side * (depth_m / 2 - 0.07)
            y = end * (width_m / 2 - 0.09)
            parts.append(stood(leg_m, beech, x, y, u=rng.uniform(0, 2), bevel=0.005))

    middle_plank = (BENCH_PLANKS - 1) / 2
    plank_m = (depth_m / BENCH_PLANKS - 0.003, width_m, BENCH_TOP_M)
    for number in range(BENCH_PLANKS):
        x = (number - middle_plank) * depth_m / BENCH_PLANKS
        parts.append(stood(plank_m, beech, x, z=height_m - BENCH_TOP_M, u=rng.uniform(0, 2)))
    shelf_m = (depth_m - 0.1, width_m - 0.12, 0.025)
    parts.append(stood(shelf_m, beech, z=0.18, u=rng.uniform(0, 2)))
    return parts


def pillar(
    rng: Rng,
    width_m: float = 0.4,
    height_m: float = 3.0,
) -> list[Part]:
    """A column of raw concrete with chamfered edges, a kick plate and a sign."""
    concrete = matt(texture=picture.ground("concrete"))
    sign = matt(texture=picture.sign("P2", OCHRE))
    shaft_m = (width_m, width_m, height_m)
    kick_plate_m = (width_m + 0.006, width_m + 0.006, 0.1)
    return [
        stood(shaft_m, concrete, bevel=0.015, u=rng.uniform(0, 2)),
        stood(kick_plate_m, STEEL, bevel=0.002),
        put(card((0.24, 0.12)), sign, width_m / 2 + 0.001, z=1.7),
    ]
