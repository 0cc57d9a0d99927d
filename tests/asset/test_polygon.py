"""Triangulation: triangles cover the polygon once, leave its holes free, and are counter-clockwise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.asset.polygon import oriented, triangulated
from vobench.geometry.se3 import Array

SQUARE = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]])


def areas(triangles: Array) -> Array:
    """Signed areas (F,)."""
    a, b, c = triangles.swapaxes(0, 1)
    u, v = b - a, c - a
    return (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2


def covers(triangles: Array, point: Array) -> int:
    """How many triangles a point is in."""
    a, b, c = triangles.swapaxes(0, 1)
    sides = [(q - p)[:, 0] * (point - p)[:, 1] - (q - p)[:, 1] * (point - p)[:, 0] for p, q in ((a, b), (b, c), (c, a))]
    return int((np.array(sides) > 0).all(axis=0).sum())


def star(radii: list[float]) -> Array:
    angle = np.linspace(0, 2 * np.pi, len(radii), endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.array(radii)[:, None]


@given(st.lists(st.floats(0.2, 2.0), min_size=4, max_size=14))
def test_triangles_of_a_star_shaped_polygon_are_counter_clockwise_and_have_its_area(radii: list[float]) -> None:
    outline = star(radii)
    following = np.roll(outline, -1, axis=0)
    shoelace = (outline[:, 0] * following[:, 1] - outline[:, 1] * following[:, 0]).sum() / 2
    parts = areas(triangulated([outline]))
    assert (parts > 0).all()
    assert parts.sum() == pytest.approx(shoelace)


def test_holes_stay_free_and_all_else_is_covered_once() -> None:
    holes = [SQUARE / 4 + 0.5, SQUARE / 4 + 2.5, SQUARE / 8 + [3, 1]]
    triangles = triangulated([SQUARE, *(oriented(hole, counter_clockwise=False) for hole in holes)])
    assert areas(triangles).sum() == pytest.approx(16 - 1 - 1 - 0.25)
    for point in np.random.default_rng(4).uniform(0, 4, (300, 2)):
        is_in_hole = any((hole.min(0) < point).all() and (point < hole.max(0)).all() for hole in holes)
        assert covers(triangles, point) == (0 if is_in_hole else 1)


@pytest.mark.parametrize("counter_clockwise", [True, False])
def test_an_oriented_ring_has_the_same_corners_and_the_orientation_asked_for(counter_clockwise: bool) -> None:
    for ring in (SQUARE, SQUARE[::-1]):
        result = oriented(ring, counter_clockwise=counter_clockwise)
        assert {tuple(point) for point in result} == {tuple(point) for point in SQUARE}
        assert (areas(result[None, :3])[0] > 0) == counter_clockwise
