"""The plan of a scene shows where things are, and the sheet where its parts are."""

import numpy as np
import pytest

from tests.analysis.test_scene_survey import FLOOR, LIGHT, crate, scene
from vobench.analysis.scene_sheet import (
    CELL_HEIGHT_PX,
    CELL_WIDTH_PX,
    CIRCLE_RGB,
    GAP_PX,
    LENS,
    VIEWS_DEG,
    _PlanScale,
    _text,
    _widest_view,
    contact_sheet,
    plan,
    sheet,
)
from vobench.analysis.scene_survey import SceneSurvey, scene_survey
from vobench.asset.shape import at, block
from vobench.scene.material import Material, srgb
from vobench.scene.mesh import flipped, make_mesh, moved, texture_coordinates
from vobench.scene.scene import Scene, triangles
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


def test_the_four_views_of_a_sheet_are_as_wide_as_their_directions_are_apart() -> None:
    edges_px = [[-0.5, 159.5], [CELL_WIDTH_PX - 0.5, 159.5]]
    left, right = LENS.rays(edges_px)
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(360 / len(VIEWS_DEG))
    assert np.diff(VIEWS_DEG).tolist() == [360 / len(VIEWS_DEG)] * (len(VIEWS_DEG) - 1)
    steps = np.diff(LENS.project([[0, 0, 1.0], [0.01, 0.01, 1.0]]), axis=0).ravel()
    assert steps[0] == pytest.approx(steps[1])


def test_without_a_free_circle_none_is_drawn_and_heights_are_from_the_lowest_point() -> None:
    from vobench.scene.mesh import quad

    wall = Thing("wall", quad((0, 0, 0), (1, 0, 0), (0, 0, 1)), "grey")
    room = scene(wall)
    drawn = plan(room, scene_survey(room))
    assert (drawn[..., 0] == drawn[..., 1]).all()


def test_lines_of_text_are_one_below_the_other() -> None:
    rows = [np.flatnonzero((_text([""] * number + ["H"]) < 128).any((1, 2))) for number in range(3)]
    first, second, third = (of_line.max() for of_line in rows)
    assert second - first == third - second == 22
    assert (_text([]) == 255).all()
    columns = np.flatnonzero((_text(["H"]) < 128).any((0, 2)))
    assert columns.min() == pytest.approx(16, abs=2)


class Renderer:
    """Renders grey pictures that are the brighter the later, and remembers the poses."""

    def __init__(self) -> None:
        self.poses = []

    def radiance(self, lens, shot, weights):
        self.poses.append(shot)
        return np.full((CELL_HEIGHT_PX, CELL_WIDTH_PX, 3), 0.1 * len(self.poses) * 1.5 * 50, np.float32)


def test_a_sheet_is_a_plan_lines_and_four_views() -> None:
    room = scene(FLOOR, crate(1.0, 0.0))
    found = scene_survey(room)
    renderer = Renderer()
    drawn = sheet(room, found, renderer, 50.0, ["crate"])
    assert drawn.shape == (640, 1440, 3)
    cells = [
        drawn[320 * row : 320 * (row + 1), 480 * column : 480 * (column + 1)] for row in (0, 1) for column in range(3)
    ]
    np.testing.assert_array_equal(cells[0], plan(room, found))
    np.testing.assert_array_equal(cells[3], _text(["crate"]))
    for number, cell in enumerate((cells[1], cells[2], cells[4], cells[5]), 1):
        assert (cell == tone(0.1 * number)).all()
    assert len(renderer.poses) == 4


def test_pictures_of_a_sheet_stand_side_by_side_with_white_between_them() -> None:
    black = np.zeros((5, 7, 3), np.uint8)
    page = contact_sheet([black, black])
    assert page.shape == (5 + GAP_PX, 2 * (7 + GAP_PX), 3)
    assert (page[:GAP_PX] == 255).all()
    assert (page[:, :GAP_PX] == 255).all()
    assert (page[GAP_PX:, GAP_PX : GAP_PX + 7] == 0).all()


def test_a_last_row_that_is_not_full_is_filled_with_white() -> None:
    black = np.zeros((5, 7, 3), np.uint8)
    page = contact_sheet([black] * 5)
    assert page.shape == (2 * (5 + GAP_PX), 4 * (7 + GAP_PX), 3)
    assert (page[5 + GAP_PX :, 7 + GAP_PX :] == 255).all()


def test_a_view_of_a_place_looks_along_the_corridor() -> None:
    corridor = moved(flipped(block((3.0, 20.0, 2.6), bevel_m=0)), at(0.0, 0.0, 1.3))
    place = scene(Thing("corridor", corridor, "grey"))
    viewpoint = _widest_view(triangles(place, t_ns=0), scene_survey(place))
    along_y = abs(np.sin(np.deg2rad(viewpoint.yaw_deg)))
    assert along_y > np.cos(np.deg2rad(25.0))
