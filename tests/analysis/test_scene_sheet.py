"""The parts of a sheet are where they belong."""

import numpy as np
import pytest

from tests.analysis.test_scene_plan import tone
from tests.analysis.test_scene_survey import FLOOR, crate, scene
from vobench.analysis.scene_sheet import (
    CELL_HEIGHT_PX,
    CELL_WIDTH_PX,
    LENS,
    VIEWS_DEG,
    _text,
    plan,
    sheet,
)
from vobench.analysis.scene_survey import scene_survey


def test_the_four_views_of_a_sheet_are_as_wide_as_their_directions_are_apart() -> None:
    edges_px = [[-0.5, 159.5], [CELL_WIDTH_PX - 0.5, 159.5]]
    left, right = LENS.rays(edges_px)
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(360 / len(VIEWS_DEG))
    assert np.diff(VIEWS_DEG).tolist() == [360 / len(VIEWS_DEG)] * (len(VIEWS_DEG) - 1)
    steps = np.diff(LENS.project([[0, 0, 1.0], [0.01, 0.01, 1.0]]), axis=0).ravel()
    assert steps[0] == pytest.approx(steps[1])


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
