"""A scene by its name or file, in lines, as a dictionary, and as a picture."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.cli.conftest import CLOSET, make_cheap
from vobench.analysis.scene_report import SceneReport, strength, survey_scene
from vobench.errors import UnknownNameError
from vobench.scene.light import PointLight, Sky


@pytest.fixture
def closet(tmp_path: Path) -> SceneReport:
    (tmp_path / "closet.yaml").write_text(CLOSET)
    return survey_scene(str(tmp_path / "closet.yaml"))


def test_the_lines_say_what_the_dictionary_says(closet: SceneReport) -> None:
    facts, lines = closet.as_dict(), closet.lines()
    assert lines[0] == f"closet: {facts['things']} things, {facts['faces']} faces, {facts['materials']} materials"
    assert lines[1] == "size: 2.02 x 2.02 x 1.52 m"  # the walls are 1 cm thick
    assert lines[-1] == "light: lamp, 600 lm"
    assert facts["white_cd_m2"] == 50
    assert facts["free"]["floor_m"] == 0
    assert "floor at 0.00 m" in lines[5]


def test_the_picture_is_a_plan_and_four_views(closet: SceneReport, tmp_path: Path, monkeypatch) -> None:
    make_cheap(monkeypatch)
    monkeypatch.setenv("VOBENCH_CACHE", str(tmp_path / "cache"))
    closet.save_picture(tmp_path / "look.png")
    assert cv2.imread(str(tmp_path / "look.png")).shape == (640, 1440, 3)


def test_faces_without_area_in_a_model_are_told_of(tmp_path: Path) -> None:
    vertices = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\n"
    (tmp_path / "table.obj").write_text(f"{vertices}f 1 2 3\nf 1 3 4\nf 1 2 5\nf 2 2 5\n")
    report = survey_scene(str(tmp_path / "table.obj"))
    assert "table.obj: 1 faces without area were dropped" in report.notes
    assert report.as_dict()["faces"] == 3


def test_a_misspelt_name_gets_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'office'"):
        survey_scene("offise")


def test_white_is_known_once_the_light_of_a_scene_without_it_is_computed(tmp_path: Path, monkeypatch) -> None:
    make_cheap(monkeypatch)
    monkeypatch.setenv("VOBENCH_CACHE", str(tmp_path / "cache"))
    (tmp_path / "closet.yaml").write_text(CLOSET.replace("white_cd_m2: 50\n", ""))
    report = survey_scene(str(tmp_path / "closet.yaml"))
    assert report.as_dict()["white_cd_m2"] is None
    assert report.doubts() == []
    report.save_picture(tmp_path / "look.png")
    assert report.as_dict()["white_cd_m2"] > 0
    assert report.doubts() == []


def test_a_wrong_white_is_doubted_once_the_light_is_computed(tmp_path: Path, monkeypatch) -> None:
    make_cheap(monkeypatch)
    monkeypatch.setenv("VOBENCH_CACHE", str(tmp_path / "cache"))
    (tmp_path / "closet.yaml").write_text(CLOSET.replace("white_cd_m2: 50\n", "white_cd_m2: 1\n"))
    report = survey_scene(str(tmp_path / "closet.yaml"))
    assert report.doubts() == []
    report.save_picture(tmp_path / "look.png")
    (doubt,) = report.doubts()
    assert "raise white_cd_m2 of the scene from 1 to about" in doubt


def test_an_object_is_called_one(tmp_path: Path) -> None:
    (tmp_path / "tile.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 0 -1\nv 0 0 -1\nf 1 2 3\nf 1 3 4\n")
    report = survey_scene(str(tmp_path / "tile.obj"))
    assert not report.survey.is_place
    assert any(line.startswith("an object rather than a place") for line in report.lines())


def test_the_strength_of_a_light_has_its_unit() -> None:
    assert strength(PointLight("bulb", np.zeros(3), 500.0)) == "500 lm"
    assert strength(Sky("sky", 1234.5)) == "1234 lx"
