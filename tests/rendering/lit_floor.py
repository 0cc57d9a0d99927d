"""A floor of 2 x 2 m around the origin whose light is computed, among other things that are not lit."""

import numpy as np

from tests.rendering.rectangles import rectangle
from vobench.geometry.se3 import Array
from vobench.rendering.texel import Texels, texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.texel_owner import owners
from vobench.rendering.unwrap import unwrap
from vobench.rendering.visibility import Visibility
from vobench.scene.light import PointLight
from vobench.scene.material import Material
from vobench.scene.scene import ceiling_light
from vobench.scene.triangles import Thing, triangle_table

MATERIALS = {"a": Material(), "glass": Material("pane", eta=1.5), "mirror": Material("mirror", tint=0.8)}
X, Y, Z = np.eye(3)
FLOOR = rectangle(0 * Z, 2 * X, 2 * Y, "a", "floor")
BULB = PointLight("bulb", np.array([0.3, -0.2, 1.5]), 4 * np.pi * 100)
PANEL_M = np.array([0.2, 0.1, 2.0])
PANEL = ceiling_light("panel", PANEL_M, (0.4, 0.3), power_lm=500)


def open_floor(*more: Thing, spacing_m: float = 0.1) -> tuple[Texels, TexelLayout, Visibility]:
    """The points of the floor; the others only hide light."""
    things = [FLOOR, *more]
    faces = triangle_table(things, [-1] * len(things), [-1] * len(things))
    lit = faces.thing == 0
    atlas = unwrap(faces, np.full(len(faces), spacing_m), lit)
    visibility = Visibility(faces, MATERIALS, np.arange(len(faces)))
    points, layout = texels(faces, MATERIALS, atlas, owners(atlas), among=lit, seed=0, visibility=visibility)
    return points, layout, visibility


def by_inverse_square(points_m: Array, position_m: Array, intensity_cd: float) -> Array:
    """The illuminance (P,) of points (P, 3) on the floor by a lamp at a position (3,)."""
    vectors = position_m - points_m
    return intensity_cd * vectors[:, 2] / np.linalg.norm(vectors, axis=1) ** 3
