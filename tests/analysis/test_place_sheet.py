"""The contact sheet of a generator: a picture for each seed, in order, in the light of the place."""

import weakref

import cv2
import numpy as np
import pytest

from tests.analysis.test_scene_survey import scene
from tests.generated import write_cell
from vobench.analysis import place_sheet
from vobench.analysis.place_sheet import (
    GAP_PX,
    PLACE_HEIGHT_PX,
    PLACE_WIDTH_PX,
    _widest_view,
    contact_sheet,
    save_place_sheet,
)
from vobench.analysis.scene_survey import scene_survey
from vobench.asset.shape import at, block
from vobench.errors import SuiteError, UnknownNameError
from vobench.rendering.baked_scene import BakeSettings
from vobench.scene.mesh import flipped, moved
from vobench.scene.scene import triangles
from vobench.scene.triangles import Thing

pytestmark = pytest.mark.slow  # light is computed; run by `pytest -m slow`, and by CI
CELL_PX = PLACE_WIDTH_PX + PLACE_HEIGHT_PX + GAP_PX  # a view and a plan


@pytest.fixture
def cell(tmp_path, monkeypatch):
    """The path of the scene, whose light is computed more coarsely than a sheet's."""
    monkeypatch.setattr(place_sheet, "COARSE", BakeSettings(0.3, 1, 0.5, 4, 0))
    return str(write_cell(tmp_path / "cell"))


def parts(path, count):
    """The pictures of a sheet in one row, without their labels."""
    sheet = cv2.imread(str(path)).astype(int)
    assert sheet.shape == (PLACE_HEIGHT_PX + GAP_PX, count * CELL_PX, 3)
    return [sheet[GAP_PX:-30, column * CELL_PX + GAP_PX : (column + 1) * CELL_PX] for column in range(count)]


def test_each_seed_has_a_picture_of_its_own_and_the_same_seed_the_same(cell, tmp_path):
    save_place_sheet(cell, tmp_path / "two.png", seeds=2, first_seed=4, lighting="day")
    save_place_sheet(cell, tmp_path / "next.png", seeds=1, first_seed=5, lighting="day")
    fourth, fifth = parts(tmp_path / "two.png", 2)
    (again,) = parts(tmp_path / "next.png", 1)
    assert np.array_equal(again, fifth)
    assert np.mean(np.abs(fourth - fifth).max(-1) > 8) > 0.1
    assert fourth.std() > 10


def test_a_place_of_a_sheet_is_gone_before_the_next_one_is_built(cell, tmp_path, monkeypatch):
    meshes = []
    alive_before = []
    build_once = place_sheet.build_once

    def observed(place, lighting):
        alive_before.append(sum(mesh() is not None for mesh in meshes))
        built = build_once(place, lighting)
        meshes.extend(weakref.ref(thing.mesh) for thing in built.things)
        return built

    monkeypatch.setattr(place_sheet, "build_once", observed)
    save_place_sheet(cell, tmp_path / "three.png", seeds=3, lighting="day")
    assert alive_before == [0, 0, 0]
    assert len(meshes) >= 3


def test_a_scene_without_a_generator_and_an_unknown_one_are_refused(tmp_path):
    with pytest.raises(SuiteError, match="'hall' has no generator"):
        save_place_sheet("hall", tmp_path / "it.png", seeds=2)
    with pytest.raises(UnknownNameError, match="no scene named 'flatt'"):
        save_place_sheet("flatt", tmp_path / "it.png", seeds=2)
    assert not (tmp_path / "it.png").exists()


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
