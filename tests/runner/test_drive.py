"""Trajectories of a suite, driven without a picture."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest

from tests.runner.conftest import CLOSET
from vobench.errors import SuiteError, UnknownNameError
from vobench.runner import drive
from vobench.runner.drive import chosen_trajectories, drive_plan
from vobench.suite.suite import read_plan
from vobench.trajectory.tum import parse_tum

SUITE = """
name: trajectories
scenes: [closet]
rigs: {ahead: {pitch_deg: 45, height_m: 0.3, forward_m: 0}}
trajectories:
  legs: {targets_m: [[0.3, 0], [0.3, 0.3]], tolerance_m: 0.05, motors: {}}
  spin: {kind: pure_rotation, angle_deg: 90, mover: unicycle, encoders: exact}
  away: {kind: stop_and_go, legs_m: [2], mover: unicycle}
  lift: {kind: rail, points_m: [[0, 0, 0.2], [0.5, 0, 0.6]]}
estimators: [stand_still]
"""


@pytest.fixture
def read(tmp_path):
    """Reads the suite, with some of its text replaced."""

    def read(*changes):
        text = SUITE
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (tmp_path / "closet.yaml").write_text(CLOSET)
        (tmp_path / "suite.yaml").write_text(text)
        return read_plan(str(tmp_path / "suite.yaml"))

    return read


def test_every_trajectory_of_the_suite_is_driven_in_its_order(read):
    found = drive_plan(read())
    assert [drive.name for drive in found.drives] == ["legs", "spin", "away", "lift"]
    assert [drive.kind for drive in found.drives] == [
        "waypoints, pioneer",
        "pure_rotation, unicycle",
        "stop_and_go, unicycle",
        "rail",
    ]


def test_what_a_run_would_refuse_is_told_of_the_trajectory_that_it_is_about(read):
    found = drive_plan(read())
    assert [len(drive.refusals) for drive in found.drives] == [0, 0, 1, 0]
    (sentence,) = found.refusals
    assert "leaves the room" in sentence


def test_each_quantity_is_there_only_for_a_body_that_has_it(read):
    legs, spin, _, lift = drive_plan(read()).drives
    assert legs.voltages_V.shape == legs.references.shape == legs.rim_rad.shape == (len(legs.motion.t_ns), 2)
    assert (spin.voltages_V, spin.references, spin.reached_s) == (None, None, None)
    assert spin.rim_rad is not None
    assert (lift.voltages_V, lift.references, lift.reached_s, lift.rim_rad) == (None, None, None, None)


def test_legs_end_in_their_order_and_the_last_one_with_the_drive(read):
    (legs,) = drive_plan(read(), trajectory="legs").drives
    assert (np.diff(legs.reached_s) > 0).all()
    assert legs.reached_s[-1] == pytest.approx(legs.as_dict()["duration_s"])


def test_rims_that_turn_backwards_and_forwards_alike_are_a_turn_on_the_spot(read):
    (spin,) = drive_plan(read(), trajectory="spin").drives
    left_rad, right_rad = spin.rim_rad[-1]
    assert left_rad == pytest.approx(-right_rad)
    assert right_rad > 0  # to the left
    assert spin.as_dict()["path_m"] == pytest.approx(0, abs=1e-9)


def test_a_turn_at_a_constant_rate_is_the_same_angle_from_frame_to_frame(read):
    changes = ("angle_deg: 90, mover: unicycle", "angle_deg: 90, mover: unicycle, rate_hz: 20")
    (spin,) = drive_plan(read(changes), trajectory="spin").drives
    facts = spin.as_dict()
    assert facts["max_turn_per_frame_deg"] == pytest.approx(facts["max_turn_degps"] / 20, rel=1e-3)


def test_csv_and_tum_hold_the_true_motion_of_every_frame(read):
    (lift,) = drive_plan(read(), trajectory="lift").drives
    path = parse_tum(lift.tum(), name="lift")
    np.testing.assert_allclose(path.positions_m[[0, -1]], [[0, 0, 0.2], [0.5, 0, 0.6]], atol=1e-3)
    rows = list(csv.DictReader(io.StringIO(lift.csv())))
    assert [int(row["t_ns"]) for row in rows] == path.t_ns.tolist()
    assert [float(row["z_m"]) for row in rows] == pytest.approx(path.positions_m[:, 2].tolist(), abs=1e-6)
    assert "left_V" not in rows[0]


def test_some_frames_are_those_of_the_whole_drive(read):
    whole = drive_plan(read(), trajectory="legs").drives[0]
    part = drive_plan(read(("name: trajectories", "name: trajectories\nframes: [40, 70]")), trajectory="legs").drives[0]
    for name in ("voltages_V", "references", "rim_rad"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[40:70])
    t_ns = whole.motion.t_ns
    assert part.as_dict()["duration_s"] == pytest.approx((t_ns[69] - t_ns[40]) / 1e9)


def test_the_table_has_the_values_of_the_dictionaries(read):
    found = drive_plan(read())
    frame = found.to_frame()
    facts = found.as_dict()["trajectories"]
    assert list(frame.columns) == list(facts[0])
    assert frame["path_m"].tolist() == [row["path_m"] for row in facts]


def test_an_unknown_name_is_refused_and_a_suite_of_scenarios_is_driven(read, tmp_path):
    with pytest.raises(UnknownNameError, match=r"no trajectory named 'leg'\. Did you mean 'legs'"):
        chosen_trajectories(read(), trajectory="leg")
    (tmp_path / "scenario.yaml").write_text("name: none\nscenarios: {spin_in_place: [1]}\nestimators: [stand_still]\n")
    assert chosen_trajectories(read_plan(str(tmp_path / "scenario.yaml"))) == ("spin_in_place.1",)


def test_a_target_out_of_reach_names_its_line(read):
    with pytest.raises(SuiteError, match=r"suite.yaml:6: trajectories.legs: target 1 at \(0.3, 0\) m was not entered"):
        drive_plan(read(("tolerance_m: 0.05", "max_time_s: 1")))


def test_a_drive_through_several_places_has_no_outlines_but_their_shape(read):
    log = drive_plan(read()).drives[0]
    assert replace(log, place=None).outlines_m().shape == (0, 2, 2)


def test_a_place_that_cannot_be_built_has_no_outlines(read, monkeypatch):
    def fails(_):
        raise SuiteError("there is no floor")

    monkeypatch.setattr(drive, "floor_outlines_m", fails)
    log = drive_plan(read()).drives[0]
    assert log.place is not None
    assert log.outlines_m().shape == (0, 2, 2)
