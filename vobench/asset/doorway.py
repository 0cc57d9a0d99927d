"""Doorways: the lining of a hole in a wall, and a leaf that stands open. x is the direction of passage."""

from typing import TYPE_CHECKING

from vobench.asset.furniture import CHROME, DARK, SIDES, STEEL, Part, mm, put, stood
from vobench.asset.picture import Rng
from vobench.asset.shape import at, block, spline, tube
from vobench.scene.material import Material
from vobench.scene.mesh import joined

if TYPE_CHECKING:
    from trimesh import Trimesh

LINING_M = 0.022  # thickness of the boards in the hole
CASING_M = 0.065  # width of the boards around it
CASING_DEPTH_M = 0.014
LEAF_M = 0.04
FRONT = 1  # the face of a leaf or wall towards x
BACK = -1


def lining(width_m: float, height_m: float, wall_m: float, material: Material, *, is_cased: bool = True) -> list[Part]:
    """Boards in the hole of a wall, and a casing around it on both of its faces.

    The hole is `width_m` wide along y and centred at the origin; the wall reaches from -wall_m / 2 to wall_m / 2.
    """
    jamb_m = (wall_m + 0.002, LINING_M, height_m)
    jamb_y = (width_m - LINING_M) / 2
    lintel_m = (wall_m + 0.002, width_m - 2 * LINING_M, LINING_M)
    parts = [stood(jamb_m, material, 0, side * jamb_y, bevel=0) for side in SIDES]
    parts.append(stood(lintel_m, material, z=height_m - LINING_M, bevel=0))
    if is_cased:
        for face in (BACK, FRONT):
            parts += _casing(face * (wall_m + CASING_DEPTH_M) / 2, width_m, height_m, material)
    return parts


def _casing(x: float, width_m: float, height_m: float, material: Material) -> list[Part]:
    """Boards around a hole, at a place x in front of or behind a wall."""
    upright_m = (CASING_DEPTH_M, CASING_M, height_m + CASING_M - 0.01)
    upright_y = width_m / 2 + CASING_M / 2 - 0.01
    head_m = (CASING_DEPTH_M, width_m - 0.02, CASING_M)
    uprights = [stood(upright_m, material, x, side * upright_y, bevel=0) for side in SIDES]
    return [*uprights, stood(head_m, material, x, z=height_m - 0.01, bevel=0)]


def _handle(face: int, y: float) -> list[Part]:
    """A handle on one face of a leaf."""
    lever = spline(mm("0 0 0, 40 0 0, 56 -35 0, 56 -125 0") * [face, 1, 1], 8)
    plate = block((0.008, 0.045, 0.19), bevel_m=0.002)
    return [
        put(plate, STEEL, face * (LEAF_M / 2 + 0.003), y, 1.02),
        put(tube(lever, 0.009, sections=6), CHROME, face * LEAF_M / 2, y, 1.05),
    ]


def leaf(rng: Rng, width_m: float, height_m: float, material: Material, *, has_panels: bool = True) -> list[Part]:
    """A door leaf from y = 0, where it hangs, to y = width_m, with handles on both faces and raised panels."""
    middle_y = width_m / 2
    handle_y = width_m - 0.06
    size_m = (LEAF_M, width_m, height_m - 0.008)
    parts = [stood(size_m, material, 0, middle_y, 0.006, bevel=0.002, u=rng.uniform(0, 1))]
    parts += [*_handle(FRONT, handle_y), *_handle(BACK, handle_y)]
    if has_panels:
        parts.append(Part(joined(_panels(width_m, height_m)), material))
    hinge_m = (LEAF_M + 0.004, 0.014, 0.1)
    parts += [stood(hinge_m, DARK, z=z, bevel=0) for z in (0.25, height_m - 0.3)]
    return parts


def _panels(width_m: float, height_m: float) -> list["Trimesh"]:
    """A lower and an upper panel, raised on both faces of a leaf."""
    panels = []
    for low_m, high_m in ((0.16, 0.86), (1.14, height_m - 0.16)):
        panel_m = (LEAF_M + 0.012, width_m - 0.28, high_m - low_m)
        panels.append(block(panel_m, bevel_m=0.006, transform=at(0, width_m / 2, (low_m + high_m) / 2)))
    return panels


def entrance(rng: Rng, width_m: float, height_m: float, material: Material) -> list[Part]:
    """A closed front door on a wall at x = 0 that faces x."""
    T_wall_leaf = at(0.022, -width_m / 2)
    closed = [part.moved(T_wall_leaf) for part in leaf(rng, width_m, height_m, material)]
    around = [part.moved(at(0.02)) for part in lining(width_m + 0.05, height_m + 0.03, 0.04, material)]
    return [*closed, *around]
