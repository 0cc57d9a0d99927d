"""Furniture of offices with few faces: chairs, screens between desks, laptops, copiers, panes between rooms."""

from itertools import product

import numpy as np

from vobench.asset import picture
from vobench.asset.fitting import PANE, bars
from vobench.asset.furniture import (
    BLACK,
    DARK,
    GREY,
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
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, block, block_arrays, card, cushion, lathe, sheet_arrays, spline, tube, tube_arrays
from vobench.scene.material import Material
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

CASTORS = 5
ARM_REST_M = 0.29  # from the middle of a chair
DESK_TOP_M = 0.025  # thickness
DRAWERS_M = (0.06, 0.22, 0.38)  # heights of the drawers of a pedestal
LAPTOP_CD_M2 = (140.0, 143.0, 150.0)  # luminance of white, a little bluish
KEY_ROWS = 5
KEY_ROW_PITCH_M = 0.017
COPIER_BODY = "#c9cac6"
COPIER_LID = "#5b5f62"
COPIER_TRAYS_M = (0.08, 0.26, 0.44)  # heights
TABLE_M = 0.708  # height of the underside of a meeting table
HOOKS = 4  # of a coat stand
COAT_COLOURS = ("#27445c", "#3a3c3e", "#6b4353", "#8f6b4d")
GLAZING_FRAME_M = 0.04  # width of the border
GLAZING_SECTION_M = 1.0  # width of a section between posts, about


def task_chair(rng: Rng, colour: str = "#27445c") -> list[Part]:
    """A swivel chair on five castors, with or without arms; a person on it looks along x."""
    column = lathe(mm("0 70, 42 70, 34 120, 20 130, 20 420, 0 420"), sections=8)
    base_and_arms = _castor_base(yaw_deg=rng.uniform(0, 360 / CASTORS))
    has_arms = rng.random() < 0.6
    if has_arms:
        base_and_arms += _chair_arms()
    has_mesh_back = rng.random() < 0.4

    fabric = cloth(colour)
    support = tube(mm("-20 0 430, -250 0 440, -285 0 600, -275 0 760"), 0.018, sections=5)
    seat = cushion((0.47, 0.48, 0.085), power=4.5, cells=4)
    back = cushion((0.06, 0.45, 0.56), power=4.5, cells=4)
    return [
        put(column, BLACK),
        Part(joined_arrays(base_and_arms), BLACK),
        put(support, BLACK),
        put(seat, fabric, 0.02, z=0.475),
        put(back, DARK if has_mesh_back else fabric, -0.235, z=0.85, pitch=-9),
    ]


def _castor_base(yaw_deg: float) -> list[MeshArrays]:
    """Five legs with castors."""
    leg = tube_arrays(mm("20 0 95, 300 0 62"), 0.017, sections=5)
    castor = block_arrays((0.05, 0.045, 0.05), bevel_m=0.014).moved(at(0.29, 0, 0.026))
    base = []
    for index in range(CASTORS):
        T_base_leg = at(yaw=yaw_deg + 360 / CASTORS * index)
        base += [leg.moved(T_base_leg), castor.moved(T_base_leg)]
    return base


def _chair_arms() -> list[MeshArrays]:
    """An arm rest on a bent post on each side of a chair."""
    rest = block_arrays((0.24, 0.07, 0.025), bevel_m=0.01)
    arms = []
    for side in SIDES:
        inner_mm = side * 200
        outer_mm = side * 290
        post_path = mm(f"-20 {inner_mm} 440, -30 {outer_mm} 470, -30 {outer_mm} 660")
        arms.append(tube_arrays(post_path, 0.014, sections=5))
        arms.append(rest.moved(at(-0.01, side * ARM_REST_M, 0.67)))
    return arms


def plain_desk(
    rng: Rng,
    width_m: float = 1.6,
    depth_m: float = 0.8,
    height_m: float = 0.74,
    look: Material = WHITE,
) -> list[Part]:
    """A desk top on a steel frame."""
    leg_x = depth_m / 2 - 0.06
    leg_y = width_m / 2 - 0.06
    below_top_m = height_m - DESK_TOP_M
    leg_m = (0.05, 0.05, below_top_m)
    rail_m = (0.03, 2 * leg_y, 0.05)
    top_m = (depth_m, width_m, DESK_TOP_M)
    legs = [stood(leg_m, STEEL, end * leg_x, side * leg_y, bevel=0.003) for end, side in product(SIDES, SIDES)]
    rail = stood(rail_m, STEEL, -leg_x + 0.1, z=height_m - 0.08, bevel=0)
    top = stood(top_m, look, z=below_top_m, bevel=0.004, u=rng.uniform(0, 2))
    return [*legs, rail, top]


def pedestal(_: Rng, height_m: float = 0.56) -> list[Part]:
    """A steel pedestal of three drawers on castors."""
    body_m = (0.55, 0.4, height_m - 0.04)
    base_m = (0.45, 0.32, 0.04)
    front_m = (0.016, 0.385, 0.15)
    grip_m = (0.012, 0.12, 0.012)
    parts = [stood(body_m, GREY, z=0.04, bevel=0.004), stood(base_m, BLACK, bevel=0)]
    for drawer_z in DRAWERS_M:
        parts.append(stood(front_m, GREY, 0.28, z=drawer_z, bevel=0.003))
        parts.append(stood(grip_m, STEEL, 0.291, z=drawer_z + 0.11, bevel=0))
    return parts


def desk_screen(_: Rng, width_m: float = 1.6, height_m: float = 0.42, colour: str = "#8a9a7b") -> list[Part]:
    """A screen of cloth in a frame, which stands on the edge between two desks."""
    panel_m = (0.022, width_m - 0.03, height_m - 0.03)
    panel = stood(panel_m, cloth(colour), z=0.015, bevel=0.004)
    frame = bars(width_m - 0.03, height_m - 0.03, 0.012, 0.028, bevel_m=0)
    return [panel, put(frame, GREY, z=height_m / 2)]


def laptop(rng: Rng, seed: int = 0) -> list[Part]:
    """An open laptop that is switched on."""
    shell = coated("#8f9294", roughness=0.25)
    glow = Material(
        colour=(0.02, 0.02, 0.02),
        emission_cd_m2=LAPTOP_CD_M2,
        emission_texture=picture.screen(seed),
    )
    body = stood((0.23, 0.33, 0.016), shell, bevel=0.003)
    key_row_m = (0.014, 0.29, 0.002)
    key_rows = []
    for index in range(KEY_ROWS):
        x = 0.005 - KEY_ROW_PITCH_M * index
        key_rows.append(stood(key_row_m, BLACK, x, z=0.016, bevel=0))

    T_body_lid = at(-0.11, 0, 0.014, pitch=float(rng.uniform(-24, -10)))
    lid = put(block((0.008, 0.33, 0.22), bevel_m=0.002), shell, z=0.11)
    screen = put(card((0.31, 0.195)), glow, 0.0046, z=0.112)
    return [body, *key_rows, lid.moved(T_body_lid), screen.moved(T_body_lid)]


def copier(_: Rng) -> list[Part]:
    """A copier 1.05 m high with paper trays and a display."""
    pale = coated("#d8d8d3")
    body = stood((0.6, 0.58, 0.62), coated(COPIER_BODY), z=0.04, bevel=0.01)
    base = stood((0.5, 0.5, 0.04), BLACK, bevel=0)
    scanner = stood((0.56, 0.58, 0.2), pale, z=0.68, bevel=0.015)
    lid = stood((0.52, 0.58, 0.15), coated(COPIER_LID), -0.03, z=0.89, bevel=0.02)
    parts = [body, base, scanner, lid]

    tray_m = (0.016, 0.54, 0.16)
    grip_m = (0.012, 0.16, 0.018)
    for tray_z in COPIER_TRAYS_M:
        parts.append(stood(tray_m, pale, 0.305, z=tray_z, bevel=0.004))
        parts.append(stood(grip_m, DARK, 0.314, z=tray_z + 0.12, bevel=0))

    ready = matt(texture=picture.sign("READY", "#26404c"))
    display = put(card((0.2, 0.1)), ready, 0.3, 0.1, 0.93, pitch=-40)
    panel = stood((0.05, 0.24, 0.03), DARK, 0.285, 0.1, 0.9, bevel=0.004)
    return [*parts, display, panel]


def meeting_table(rng: Rng, length_m: float = 2.4, width_m: float = 1.1, look: Material = WHITE) -> list[Part]:
    """A table top on two panels; its length is along y."""
    panel_m = (0.7 * width_m, 0.04, TABLE_M)
    panel_y = 0.32 * length_m
    top = stood((width_m, length_m, 0.032), look, z=TABLE_M, bevel=0.006, u=rng.uniform(0, 2))
    panels = [stood(panel_m, look, 0, side * panel_y, bevel=0.003) for side in SIDES]
    beam = stood((0.04, 0.64 * length_m, 0.12), look, z=0.5, bevel=0.003)
    return [top, *panels, beam]


def coat_stand(rng: Rng, tones: str = "beech") -> list[Part]:
    """A stand with four hooks, mostly with a coat on one of them."""
    look = wood(tones)
    post = lathe(mm("0 0, 190 0, 185 20, 30 40, 20 60, 20 1750, 0 1760"), sections=12)
    hook = tube(spline(mm("0 0 1620, 70 0 1640, 110 0 1720"), 5), 0.01, sections=5)
    first_hook_deg = 20
    hooks = [put(hook, look, yaw=90 * index + first_hook_deg) for index in range(HOOKS)]
    parts = [put(post, look), *hooks]
    has_coat = rng.random() < 0.7
    if has_coat:
        colour = one_of(rng, *COAT_COLOURS)
        parts.append(put(_coat(), cloth(colour), yaw=first_hook_deg))
    return parts


def _coat() -> MeshArrays:
    """A coat on a hook of a stand, narrow at its collar, in five folds."""
    angle_rad = np.linspace(0, 2 * np.pi, 13)[None]
    down = np.linspace(0, 1, 5)[:, None]  # from the collar to the hem
    width_share = 0.3 + 0.7 * np.minimum(1, 3 * down)  # it is at its widest below the shoulders
    folds = 1 + 0.12 * np.sin(5 * angle_rad)
    x = 0.1 + 0.075 * width_share * np.cos(angle_rad)
    y = 0.15 * width_share * np.sin(angle_rad) * folds
    z = np.broadcast_to(1.66 - 0.85 * down, x.shape)
    return sheet_arrays(np.stack([x, y, z], axis=-1)).two_sided()


def glazing(_: Rng, width_m: float, height_m: float, frame: Material = BLACK) -> list[Part]:
    """A pane in a frame that fills a hole, centred at the origin, with one bar for each metre of its width."""
    pane_width_m = width_m - 2 * GLAZING_FRAME_M
    pane_height_m = height_m - 2 * GLAZING_FRAME_M
    pane = put(card((pane_width_m, pane_height_m)), PANE)
    border = put(bars(pane_width_m, pane_height_m, GLAZING_FRAME_M, 0.06, bevel_m=0), frame)

    section_count = max(1, round(width_m / GLAZING_SECTION_M))
    post = block((0.05, 0.03, pane_height_m), bevel_m=0)
    posts = []
    for index in range(1, section_count):
        y = index * width_m / section_count - width_m / 2
        posts.append(put(post, frame, 0, y))
    return [pane, border, *posts]
