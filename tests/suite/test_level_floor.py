"""The level floor is the lowest height with a large level area, and its faces are those at that height."""

import numpy as np
import pytest

from vobench.scene.material import Material
from vobench.scene.mesh import quad
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Thing, Triangles
from vobench.suite.level_floor import FLOOR_STEP_M, floor_height_m, height_steps, level_floor

GREY = {"grey": Material(colour=(0.5, 0.5, 0.5))}


def square(side_m: float, z_m: float, *, rise_m: float = 0.0) -> Thing:
    """A square around the origin that rises along x."""
    corner_m = (-side_m / 2, -side_m / 2, z_m)
    return Thing("square", quad(corner_m, (side_m, 0, rise_m), (0, side_m, 0)), "grey")


def faces_of(*things: Thing) -> Triangles:
    return triangles(Scene("yard", things, GREY, ()), t_ns=0)


def test_the_floor_has_the_faces_at_its_height_alone() -> None:
    floor = level_floor(faces_of(square(6, 0.0), square(2, 0.75), square(8, 3.0)))
    assert floor is not None
    assert floor.height_m == 0
    assert np.ptp(floor.corners_m[..., 0]) == pytest.approx(6)
    assert np.abs(floor.corners_m[..., 2]).max() == 0


def test_a_small_pit_is_no_floor() -> None:
    assert floor_height_m(faces_of(square(1, -1.0), square(6, 0.0))) == 0


def test_a_scene_of_slopes_has_none() -> None:
    faces = faces_of(square(4, 0.0, rise_m=1.0))
    assert level_floor(faces) is None
    assert floor_height_m(faces) is None


def test_heights_are_rounded_to_steps() -> None:
    corners_m = faces_of(square(1, 0.0), square(1, 0.4 * FLOOR_STEP_M), square(1, 0.6 * FLOOR_STEP_M)).corners_m
    assert height_steps(corners_m).tolist() == [0, 0, 0, 0, 1, 1]
