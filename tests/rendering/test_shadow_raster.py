"""Shadows drawn into the cells of a plane: no cell with a shadowed point is missed, and no lit point is covered."""

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.rendering import shadow_raster
from vobench.rendering.lamp import Lamp
from vobench.rendering.receiver_plane import ReceiverPlane
from vobench.rendering.shadow_raster import DrawnShadows, ProjectedTriangles, lamp_projection

AXES = np.eye(3)
PLANE = ReceiverPlane(np.zeros(3), AXES[0], AXES[1], AXES[2], cell_m=0.05, height=40, width=40)
BULB = Lamp(np.array([1.1, 0.9, 1.5]), np.zeros(3))
SUN = Lamp(None, np.array([0.6, 0.0, 0.8]))
ERROR_M = 1e-6


def drawn(lamp: Lamp, corners_m: Array) -> DrawnShadows:
    """The shadows of solid triangles (T, 3, 3) on the plane z = 0."""
    triangles = ProjectedTriangles(PLANE, corners_m[..., :2], corners_m[..., 2])
    everything = np.ones(len(corners_m), bool)
    projection = lamp_projection(PLANE, lamp)
    assert projection is not None
    return triangles.shadows(projection, everything, everything, ERROR_M)


def random_triangles() -> Array:
    """Triangles (30, 3, 3) above the plane; some reach above the bulb."""
    rng = np.random.default_rng(3)
    middles_m = rng.uniform([0, 0, 0.3], [2, 2, 1.4], (30, 1, 3))
    return middles_m + rng.uniform(-0.25, 0.25, (30, 3, 3))


def is_in_shadow(lamp: Lamp, points_m: Array, corners_m: Array) -> Array:
    """Whether any triangle is between points (P, 3) and a lamp, by Cramer's rule."""
    result = np.zeros(len(points_m), bool)
    direction = np.tile(lamp.axis, (len(points_m), 1)) if lamp.center_m is None else lamp.center_m - points_m
    longest = np.inf if lamp.center_m is None else 1.0
    for start, second, third in corners_m:
        edges = np.broadcast_to(np.stack([second - start, third - start], -1), (len(points_m), 3, 2))
        matrices = np.concatenate([-direction[..., None], edges], -1)
        t, u, v = np.linalg.solve(matrices, (points_m - start)[..., None])[..., 0].T
        result |= (u > 0) & (v > 0) & (u + v < 1) & (t > 0) & (t < longest)
    return result


@pytest.mark.parametrize("lamp", [BULB, SUN], ids=["bulb", "sun"])
def test_a_shadowed_point_is_in_a_touched_cell_and_a_lit_one_in_no_covered_cell(lamp: Lamp) -> None:
    corners_m = random_triangles()
    points_m = np.random.default_rng(1).uniform([0, 0, 0], [2, 2, 0], (4000, 3))
    cell = PLANE.cell(points_m)
    shadows = drawn(lamp, corners_m)
    in_shadow = is_in_shadow(lamp, points_m, corners_m)
    assert shadows.touched[cell[in_shadow]].all()
    assert not shadows.covered[cell[~in_shadow]].any()
    assert shadows.covered.any()
    assert not shadows.touched.all()


def test_shadows_drawn_alone_are_those_drawn_together(monkeypatch: pytest.MonkeyPatch) -> None:
    together = drawn(BULB, random_triangles())
    monkeypatch.setattr(shadow_raster, "MAX_CELLS_TOGETHER", 0)
    alone = drawn(BULB, random_triangles())
    np.testing.assert_array_equal(alone, together)


def test_a_triangle_seen_edge_on_touches_its_line_and_covers_nothing() -> None:
    upright = np.array([[[0.5, 0.52, 0.2], [1.0, 0.52, 0.2], [0.8, 0.52, 0.6]]])
    sun_along_it = Lamp(None, np.array([0.6, 0.0, 0.8]))
    shadows = drawn(sun_along_it, upright)
    rows = np.flatnonzero(shadows.touched.reshape(PLANE.height, PLANE.width).any(1))
    assert rows.tolist() == [10]
    assert not shadows.covered.any()


@pytest.mark.parametrize(
    "lamp",
    [
        Lamp(np.array([1.0, 1.0, -1.0]), np.zeros(3)),
        Lamp(np.array([1.0, 1.0, 0.04]), np.zeros(3)),
        Lamp(np.array([90.0, 1.0, 1.0]), np.zeros(3)),
        Lamp(None, np.array([1.0, 0.0, 0.01])),
    ],
    ids=["behind the plane", "close to the plane", "far away beside the plane", "a sun at the horizon"],
)
def test_a_lamp_that_is_too_low_has_no_projection(lamp: Lamp) -> None:
    assert lamp_projection(PLANE, lamp) is None
