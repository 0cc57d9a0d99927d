"""The free space of a place is found once for a height, and decides whether a path fits in it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.generated import SUITE, write_cell
from vobench.errors import MotionError
from vobench.motion.course import Circle, StopAndGo
from vobench.motion.wander import HABITS
from vobench.scene.fog import Fog
from vobench.scene.paint import Paint
from vobench.suite import clearance
from vobench.suite.clearance import ABOVE_CAMERA_M, at_free_start, clearance_of, column_on_wheels_m, place_clearance
from vobench.suite.suite import read_plan

ROBOT_M = 0.6  # the height of a body below its cameras
CELL_M = 4.0  # at most, between the walls of a cell


@pytest.fixture
def case(tmp_path, monkeypatch):
    """A case in a cell, with nothing cached."""
    write_cell(tmp_path / "scenes" / "cell")
    (tmp_path / "cells.yaml").write_text(SUITE, encoding="utf-8")
    monkeypatch.setattr(clearance, "_clearances", type(clearance._clearances)())
    monkeypatch.setenv("VOBENCH_CACHE", str(tmp_path / "cache"))
    return read_plan(str(tmp_path / "cells.yaml")).simulated[0]


def test_the_free_space_is_found_once_for_a_place_and_a_height(case):
    first = place_clearance(case.scene, ROBOT_M)
    assert place_clearance(case.scene, ROBOT_M) is first
    assert place_clearance(case.scene, 2 * ROBOT_M) is not first


def test_the_free_space_is_kept_for_other_processes(case, monkeypatch):
    first = place_clearance(case.scene, ROBOT_M)
    clearance._clearances.clear()
    monkeypatch.setattr(clearance, "clearance_of", None)  # it is not found again
    again = place_clearance(case.scene, ROBOT_M)
    np.testing.assert_array_equal(again.distance_m, first.distance_m)


def test_a_place_without_a_floor_is_refused_in_one_line(case, monkeypatch):
    monkeypatch.setattr(clearance, "floor_map", lambda *_, **__: None)
    with pytest.raises(MotionError, match="'cell' has no level floor to wander on; is another axis up\\?"):
        clearance_of(case.scene, ROBOT_M)


@pytest.mark.parametrize("path", [Circle(radius_m=0.4, start_seed=1), StopAndGo(legs_m=(0.5,), start_seed=1)])
def test_a_path_that_fits_starts_where_the_place_is_free(case, path):
    found = at_free_start(path, case.scene, ROBOT_M)
    assert found.start_seed is None
    assert place_clearance(case.scene, ROBOT_M).at(np.array([found.start_m])) > HABITS["pioneer"].radius_m


@pytest.mark.parametrize(
    "path", [Circle(radius_m=CELL_M / 2, start_seed=1), StopAndGo(legs_m=(1.5 * CELL_M,), start_seed=1)]
)
def test_a_path_that_does_not_fit_has_no_start(case, path):
    with pytest.raises(MotionError, match="no start was found"):
        at_free_start(path, case.scene, ROBOT_M)


def test_the_weather_and_the_surfaces_do_not_change_the_free_space(case):
    free = place_clearance(case.scene, ROBOT_M)
    painted = replace(case.scene, paint=Paint(cover=0.9), fog=Fog(visibility_m=9.0))
    assert place_clearance(painted, ROBOT_M) is free


def test_the_cameras_have_to_fit_if_they_are_higher_than_the_robot(case):
    low, high = (replace(case, rig=replace(case.rig, height_m=height_m)).build_rig() for height_m in (0.1, 1.5))
    assert column_on_wheels_m(low, HABITS["pioneer"]) == HABITS["pioneer"].column_m
    assert column_on_wheels_m(high, HABITS["pioneer"]) == pytest.approx(1.5 + ABOVE_CAMERA_M)
