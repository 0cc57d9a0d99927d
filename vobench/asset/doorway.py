"""Doorways: the lining of a hole in a wall, and a leaf that stands open. x is the direction of passage."""

from vobench.asset.furniture import CHROME, DARK, STEEL, Part, mm, put, stood
from vobench.asset.picture import Rng
from vobench.asset.shape import at, block, spline, tube
from vobench.scene.material import Material
from vobench.scene.mesh import joined

LINING_M = 0.022  # thickness of the boards in the hole
CASING_M = 0.065  # width of the boards around it
CASING_DEPTH_M = 0.014
LEAF_M = 0.04


def lining(width_m: float, height_m: float, wall_m: float, material: Material, *, is_cased: bool = True) -> list[Part]:
    """Boards in the hole of a wall, and a casing around it on both of its faces.

    The hole is `width_m` wide along y and centred at the origin; the wall reaches from -wall_m / 2 to wall_m / 2.
    """
    jamb_m = (wall_m + 0.002, LINING_M, height_m)
    lintel_m = (wall_m + 0.002, width_m - 2 * LINING_M, LINING_M)
    jamb_y = (width_m - LINING_M) / 2
    parts = [stood(jamb_m, material, 0, side * jamb_y, bevel=0) for side in (-1, 1)]
    parts.append(stood(lintel_m, material, 0, 0, height_m - LINING_M, bevel=0))
    if not is_cased:
        return parts
    for face in (-1, 1):
        x = face * (wall_m + CASING_DEPTH_M) / 2
        upright_m = (CASING_DEPTH_M, CASING_M, height_m + CASING_M - 0.01)
        head_m = (CASING_DEPTH_M, width_m - 0.02, CASING_M)
        for side in (-1, 1):
            y = side * (width_m / 2 + CASING_M / 2 - 0.01)
            parts.append(stood(upright_m, material, x, y, bevel=0))
        parts.append(stood(head_m, material, x, 0, height_m - 0.01, bevel=0))
    return parts


def _handle(side: int, y: float) -> list[Part]:
    """A handle on one face of a leaf."""
    lever = spline(mm("0 0 0, 40 0 0, 56 -35 0, 56 -125 0") * [side, 1, 1], 8)
    plate = block((0.008, 0.045, 0.19), bevel_m=0.002)
    return [
        put(plate, STEEL, side * (LEAF_M / 2 + 0.003), y, 1.02),
        put(tube(lever, 0.009, sections=6), CHROME, side * LEAF_M / 2, y, 1.05),
    ]


def leaf(rng: Rng, width_m: float, height_m: float, material: Material, *, has_panels: bool = True) -> list[Part]:
    """A door leaf from y = 0, where it hangs, to y = width_m, with handles on both faces and raised panels."""
    size_m = (LEAF_M, width_m, height_m - 0.008)
    body = stood(size_m, material, 0, width_m / 2, 0.006, bevel=0.002, u=rng.uniform(0, 1))
    parts = [body, *_handle(1, width_m - 0.06), *_handle(-1, width_m - 0.06)]
    if has_panels:
        frames = []
        for low_m, high_m in ((0.16, 0.86), (1.14, height_m - 0.16)):
            panel_m = (LEAF_M + 0.012, width_m - 0.28, high_m - low_m)
            frames.append(block(panel_m, bevel_m=0.006, transform=at(0, width_m / 2, (low_m + high_m) / 2)))
        parts.append(Part(joined(frames), material))
    hinge_m = (LEAF_M + 0.004, 0.014, 0.1)
    return [*parts, *(stood(hinge_m, DARK, 0, 0, z, bevel=0) for z in (0.25, height_m - 0.3))]


def entrance(rng: Rng, width_m: float, height_m: float, material: Material) -> list[Part]:
    """A closed front door on a wall at x = 0 that faces x."""
    T_wall_leaf = at(0.022, -width_m / 2)
    closed = [part.moved(T_wall_leaf) for part in leaf(rng, width_m, height_m, material)]
    around = [part.moved(at(0.02)) for part in lining(width_m + 0.05, height_m + 0.03, 0.04, material)]
    return [*closed, *around]
