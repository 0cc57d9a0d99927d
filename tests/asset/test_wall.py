"""Walls: areas less their holes, one texture throughout, laps behind the borders, and reveals that close a hole."""

import numpy as np
import pytest
from trimesh import Trimesh

from vobench.asset import wall as walls
from vobench.geometry.se3 import Array


def areas(mesh: Trimesh) -> Array:
    """Area vectors (F, 3)."""
    a, b, c = mesh.triangles.swapaxes(0, 1)
    return np.cross(b - a, c - a) / 2


def test_a_pierced_wall_has_the_area_that_its_holes_leave_and_one_texture_throughout() -> None:
    holes = [(0.5, 1.5, 0.8, 2.0), (2.0, 3.0, 1.0, 2.2)]
    wall = walls.pierced((1, 2, 0), (4, 0, 0), (0, 0, 3), holes)
    on_plane = np.isclose(wall.triangles[:, :, 1], 2).all(axis=1)
    assert np.linalg.norm(areas(wall)[on_plane], axis=1).sum() == pytest.approx(12 - 2.4)
    np.testing.assert_allclose(wall.visual.uv, wall.vertices[:, [0, 2]] - [1, 0], atol=1e-12)


def test_laps_lie_behind_a_wall_and_cross_its_borders() -> None:
    wall = walls.pierced((0, 0, 0), (4, 0, 0), (0, 3, 0))
    laps = wall.vertices[wall.vertices[:, 2] != 0]
    assert set(laps[:, 2].round(9)) == {-walls.LAP_BEHIND_M}
    np.testing.assert_allclose([laps[:, 0].min(), laps[:, 0].max()], [-walls.LAP_M, 4 + walls.LAP_M])
    np.testing.assert_allclose([laps[:, 1].min(), laps[:, 1].max()], [-walls.LAP_M, 3 + walls.LAP_M])


def test_a_reveal_and_its_pane_and_face_enclose_the_hole() -> None:
    hole = (0.5, 1.5, 0.8, 2.0)
    sides = walls.reveal((0, 0, 0), (4, 0, 0), (0, 0, 3), hole, 0.15)
    # Open to the front and back, its area vectors still cancel; its normals look at the middle of the hole.
    np.testing.assert_allclose(areas(sides).sum(axis=0), 0, atol=1e-12)
    inward = np.array([1.0, 0.075, 1.4]) - sides.triangles.mean(axis=1)
    assert (np.einsum("fk,fk->f", inward, areas(sides)) > 0).all()
    assert sides.vertices[:, 1].max() == pytest.approx(0.15)
