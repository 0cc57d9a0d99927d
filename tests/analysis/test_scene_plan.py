"""The plan of a scene shows where things are."""

import numpy as np
import pytest

from tests.analysis.test_scene_survey import FLOOR, LIGHT, crate, scene
from vobench.analysis.scene_plan import (
    CELL_HEIGHT_PX,
    CELL_WIDTH_PX,
    CIRCLE_RGB,
    _PlanScale,
    plan,
)
from vobench.analysis.scene_survey import SceneSurvey, scene_survey
from vobench.asset.shape import at, block
from vobench.scene.material import Material, srgb
from vobench.scene.mesh import make_mesh, moved, texture_coordinates
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing


def tone(linear: float) -> int:
    return int(srgb(np.full((1, 1, 3), linear, np.float32))[0, 0, 0])


def pixel_at(found: SceneSurvey, x_m: float, y_m: float) -> tuple[int, int]:
    """Row and column of a position."""
    column, row = _PlanScale(found).pixel(x_m, y_m)
    return row, column


def test_the_plan_is_as_large_as_fits_with_x_to_the_right_and_y_up() -> None:
    found = scene_survey(scene(FLOOR))  # 8 x 6 m around the origin
    scale = _PlanScale(found)
    assert scale.px_per_m == pytest.approx(0.96 * 320 / 8)
    assert scale.pixel(0, 0) == (240, 160)
    assert scale.pixel(4, 3) == (round(240 + 4 * scale.px_per_m), round(160 - 3 * scale.px_per_m))


def test_positions_and_pixels_are_each_others_inverse() -> None:
    scale = _PlanScale(scene_survey(scene(FLOOR, crate(7.0, 1.0))))
    for column, row in ((0, 0), (479, 0), (100, 319)):
        ((x_m, y_m),) = scale.positions_m(np.array([[column, row]], float))
        assert scale.pixel(x_m, y_m) == (column, row)


def test_the_plan_shows_the_floor_things_on_it_and_white_around() -> None:
    materials = {"grey": Material(colour=(0.5, 0.5, 0.5)), "dark": Material(colour=(0.1, 0.1, 0.1))}
    box = Thing("box", moved(block((1, 1, 1), bevel_m=0), at(2.0, 1.0, 0.5)), "dark")
    room = Scene("s", (FLOOR, box), materials, (LIGHT,))
    found = scene_survey(room)
    drawn = plan(room, found)
    assert drawn.shape == (CELL_HEIGHT_PX, CELL_WIDTH_PX, 3)
    for (x_m, y_m), linear in {(3.5, -2.5): 0.5, (2.0, 1.0): 0.1, (2.4, 1.4): 0.1, (5.0, 0.0): 1.0}.items():
        assert drawn[pixel_at(found, x_m, y_m)].tolist() == [tone(linear)] * 3, (x_m, y_m)


def test_what_is_higher_than_2_m_above_the_floor_is_cut_off() -> None:
    low, high = (Thing("shelf", moved(block((8, 6, 0.1), bevel_m=0), at(z_m=z)), "grey") for z in (1.9, 2.2))
    floor = Thing("floor", FLOOR.mesh, "white")
    materials = {"grey": Material(colour=(0.2, 0.2, 0.2)), "white": Material(colour=(0.7, 0.7, 0.7))}
    for shelf, linear in ((low, 0.2), (high, 0.7)):
        room = Scene("s", (floor, shelf), materials, (LIGHT,))
        found = scene_survey(room)
        assert found.free_circle is not None
        assert found.free_circle.floor_m == 0
        assert plan(room, found)[pixel_at(found, 3.5, -2.5)].tolist() == [tone(linear)] * 3


def test_a_steep_face_is_darker_than_a_level_one() -> None:
    ramp = Thing("ramp", moved(block((1, 1, 1), bevel_m=0), at(2, 1, 0.5)), "grey")
    corners = ramp.mesh.vertices.copy()
    corners[(corners[:, 2] > 0.5) & (corners[:, 0] > 2)] -= [0, 0, 0.999]  # its top falls by 45 degrees
    slope = Thing(
        "ramp", make_mesh(corners, ramp.mesh.faces, texture_coordinates(ramp.mesh), ramp.mesh.vertex_normals), "grey"
    )
    room = scene(FLOOR, slope)
    found = scene_survey(room)
    expected = 0.5 * (0.35 + 0.65 * np.sqrt(0.5))
    assert plan(room, found)[pixel_at(found, 2, 1)].tolist() == pytest.approx([tone(expected)] * 3, abs=1)


def test_the_free_circle_is_drawn_at_its_radius() -> None:
    room = scene(FLOOR, crate(1.0, 0.0))
    found = scene_survey(room)
    free = found.free_circle
    assert free is not None
    drawn = plan(room, found)
    for angle in (0.3, 2.0, 4.0):
        row, column = pixel_at(
            found, free.x_m + free.radius_m * np.cos(angle), free.y_m + free.radius_m * np.sin(angle)
        )
        nearby = drawn[row - 2 : row + 3, column - 2 : column + 3].reshape(-1, 3).tolist()
        assert list(CIRCLE_RGB) in nearby
    assert drawn[pixel_at(found, free.x_m, free.y_m)].tolist() == [tone(0.5)] * 3


def test_the_free_circle_is_green_on_a_plan_that_is_grey() -> None:
    red, green, blue = CIRCLE_RGB
    assert green > 2 * max(red, blue)


def test_without_a_free_circle_none_is_drawn_and_heights_are_from_the_lowest_point() -> None:
    from vobench.scene.mesh import quad

    wall = Thing("wall", quad((0, 0, 0), (1, 0, 0), (0, 0, 1)), "grey")
    room = scene(wall)
    drawn = plan(room, scene_survey(room))
    assert (drawn[..., 0] == drawn[..., 1]).all()
