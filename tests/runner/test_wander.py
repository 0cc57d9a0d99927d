"""The drive of a body that wanders depends on its place and its settings alone, and keeps clear of the place."""

from dataclasses import replace

import numpy as np
import pytest

from tests.generated import GENERATOR, SUITE, write_cell
from vobench.geometry.rig import CalibrationError
from vobench.motion.course import Circle
from vobench.runner import wander
from vobench.runner.motion import body_motion, motion_name
from vobench.runner.wander import wander_motion
from vobench.suite import clearance
from vobench.suite.scene_build import build
from vobench.suite.suite import read_plan

RADIUS_M = 0.25  # of the pioneer


@pytest.fixture
def cases(tmp_path, monkeypatch):
    """The cases of the suite of cells by place and drive, with nothing cached."""
    write_cell(tmp_path / "scenes" / "cell")
    (tmp_path / "cells.yaml").write_text(SUITE, encoding="utf-8")
    monkeypatch.setattr(wander, "_drives", type(wander._drives)())
    monkeypatch.setattr(clearance, "_clearances", type(clearance._clearances)())
    plan = read_plan(str(tmp_path / "cells.yaml"))
    return {(case.variant["scene"], case.variant["trajectory"]): case for case in plan.simulated}


def positions_m(case):
    return body_motion(case).at_frames().T_world_body[:, :3, 3]


def test_a_drive_is_found_once_for_a_place_and_is_the_same_when_it_is_found_again(cases):
    case = cases["cell.1", "tour.1"]
    first = wander_motion(case, case.trajectory)
    assert wander_motion(replace(case, name="other", seed=9), case.trajectory) is first
    before_m = positions_m(case)
    wander._drives.clear()
    np.testing.assert_array_equal(positions_m(case), before_m)


def test_another_place_and_another_seed_have_other_drives(cases):
    paths_m = {unit: positions_m(case)[-1] for unit, case in cases.items()}
    ends = {tuple(end_m.tolist()) for end_m in paths_m.values()}
    assert len(ends) == len(cases) == 4


def test_a_drive_keeps_clear_of_the_walls_and_the_crate_of_its_place(cases):
    for case in cases.values():
        path_m = positions_m(case)
        things = {thing.name: thing.mesh.bounds for thing in build(case.scene, {}).things}
        low_m, high_m = things["crate"]
        outside_m = np.maximum(np.maximum(low_m - path_m, path_m - high_m), 0)[:, :2]
        assert np.linalg.norm(outside_m, axis=1).min() > RADIUS_M
        assert np.abs(path_m[:, 0]).max() < things["wall_0"][0][0] - RADIUS_M
        assert body_motion(case).clearance_m > 0


def test_no_more_drives_and_places_are_kept_than_stated(cases, monkeypatch):
    monkeypatch.setattr(wander, "CACHED_DRIVES", 2)
    monkeypatch.setattr(clearance, "CACHED_PLACES", 1)
    for case in cases.values():
        wander_motion(case, case.trajectory)
    assert (len(wander._drives), len(clearance._clearances)) == (2, 1)


SHELF_FROM_X_M = 0.3  # where a board begins that hangs 0.9 m above part of the cell
WITH_SHELF = GENERATOR.replace(
    "    lamp = ",
    '    things.append(Thing("shelf", block((1.2, 4.0, 0.02), transform=at(0.9, 0.0, 0.91)), "plaster"))\n    lamp = ',
)


@pytest.mark.parametrize(("camera_m", "is_kept_clear"), [(0.4, False), (1.1, True)])
def test_a_robot_drives_under_things_only_if_its_cameras_fit_below(tmp_path, monkeypatch, camera_m, is_kept_clear):
    write_cell(tmp_path / "scenes" / "cell", WITH_SHELF)
    tall = SUITE.replace("pitch_deg: 90", f"pitch_deg: 90, height_m: {camera_m}")
    many = tall.replace("rate_hz: 4, seeds: 2", "rate_hz: 4, seeds: 12").replace("units: 4", "units: 24")
    (tmp_path / "cells.yaml").write_text(many, encoding="utf-8")
    monkeypatch.setattr(clearance, "_clearances", type(clearance._clearances)())
    monkeypatch.setattr(wander, "_drives", type(wander._drives)())

    plan = read_plan(str(tmp_path / "cells.yaml"))
    paths_m = np.concatenate([positions_m(case) for case in plan.simulated])
    is_below_shelf = paths_m[:, 0] > SHELF_FROM_X_M - RADIUS_M
    assert is_below_shelf.any() != is_kept_clear


def test_the_baseline_and_the_calibration_do_not_change_a_drive(cases):
    case = cases["cell.1", "tour.1"]
    drive = wander_motion(case, case.trajectory)
    wider = replace(case, rig=replace(case.rig, baseline_m=0.3, calibration_error=CalibrationError(right_roll_deg=1)))
    assert wander_motion(wider, case.trajectory) is drive


# --- Paths from a free start ---


def test_a_path_from_a_free_start_keeps_clear_of_the_crate_of_its_place(cases):
    ring = Circle(radius_m=0.4, mover="unicycle", rate_hz=8, start_seed=1)
    for case in cases.values():
        path_m = positions_m(replace(case, trajectory=ring))
        things = {thing.name: thing.mesh.bounds for thing in build(case.scene, {}).things}
        low_m, high_m = things["crate"]
        outside_m = np.maximum(np.maximum(low_m - path_m, path_m - high_m), 0)[:, :2]
        assert np.linalg.norm(outside_m, axis=1).min() > RADIUS_M
        assert np.abs(path_m[:, 0]).max() < things["wall_0"][0][0] - RADIUS_M


def test_starts_differ_between_places_so_motions_are_named_by_both(cases):
    ring = Circle(radius_m=0.4, mover="unicycle", rate_hz=8, start_seed=1)
    in_first = replace(cases["cell.1", "tour.1"], trajectory=ring)
    in_second = replace(cases["cell.2", "tour.1"], trajectory=ring)
    assert (positions_m(in_first)[0] != positions_m(in_second)[0]).any()
    assert motion_name(in_first) != motion_name(in_second)
    given = replace(ring, start_seed=None)
    assert motion_name(replace(in_first, trajectory=given)) == motion_name(replace(in_second, trajectory=given))
