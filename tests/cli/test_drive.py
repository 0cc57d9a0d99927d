"""vobench drive: what the bodies of a suite do, without a picture being drawn."""

import csv

import numpy as np
import pytest

from vobench.trajectory.tum import parse_tum

WAYS = """name: ways
scenes: [closet]
rigs: {it: {pitch_deg: 45, height_m: 0.3, forward_m: 0}}
trajectories:
  legs: {targets_m: [[0.3, 0], [0.3, 0.3]], tolerance_m: 0.05}
  spin: {kind: pure_rotation, angle_deg: 90, mover: unicycle, encoders: exact}
  away: {kind: stop_and_go, legs_m: [2], mover: unicycle}
  lift: {kind: rail, points_m: [[0, 0, 0.2], [0.5, 0, 0.6]]}
estimators: [stand_still]
"""


@pytest.fixture
def ways(here):
    (here / "suites" / "ways.yaml").write_text(WAYS)
    return here


def test_every_trajectory_has_its_line_and_what_a_run_would_refuse_its_sentence(vobench, ways):
    said = vobench("drive", "ways")
    assert (said.code, said.err) == (0, "")
    rows = [line.split() for line in said.out.splitlines() if line[:5].strip() and not line.startswith("vobench")]
    assert [row[0] for row in rows if row[0] in {"legs", "spin", "away", "lift"}] == ["legs", "spin", "away", "lift"]
    (refused,) = [line for line in said.out.splitlines() if line.startswith("vobench run will refuse this: ")]
    assert "ways.yaml:7: trajectories.away: a camera of rig 'it' leaves the room" in refused


def test_json_has_the_facts_in_full(vobench, ways):
    legs, spin, away, lift = vobench("drive", "ways", "--json").json["trajectories"]
    assert legs["kind"] == "waypoints, pioneer"
    assert len(legs["reached_s"]) == 2
    assert legs["reached_s"][-1] == pytest.approx(legs["duration_s"])
    assert legs["frames"] == round(legs["duration_s"] * 30) + 1
    assert spin["max_turn_degps"] == pytest.approx(np.rad2deg(1), rel=1e-3)
    assert spin["max_turn_per_frame_deg"] == pytest.approx(np.rad2deg(1 / 30), rel=1e-3)
    assert spin["path_m"] == pytest.approx(0, abs=1e-9)
    assert spin["wheel_error_m"] == pytest.approx(0, abs=1e-3)
    assert away["path_m"] == pytest.approx(2, abs=1e-3)
    assert [len(one["refused"]) for one in (legs, spin, away, lift)] == [0, 0, 1, 0]
    assert (lift["reached_s"], lift["wheel_error_m"]) == (None, None)


def test_some_frames_of_a_way_are_as_they_are_in_the_whole(vobench, ways):
    def legs():
        said = vobench("drive", "ways", "-t", "legs", "--csv", "it.csv", "--out", "it.svg", "--json").json
        with (ways / "it.csv").open() as file:
            return said["trajectories"][0], list(csv.DictReader(file))

    whole, rows = legs()
    (ways / "suites" / "ways.yaml").write_text(f"{WAYS}frames: [40, 70]\n")
    part, some = legs()
    assert some == rows[40:70]
    assert part["reached_s"] == whole["reached_s"]
    assert 0 < part["wheel_error_m"] < whole["wheel_error_m"]


def test_one_trajectory_may_be_chosen_and_exported(vobench, ways):
    said = vobench("drive", "ways", "-t", "lift", "--tum", "it.tum", "--csv", "it.csv", "--json").json
    assert [one["trajectory"] for one in said["trajectories"]] == ["lift"]
    assert said["files"] == ["it.tum", "it.csv"]
    true = parse_tum((ways / "it.tum").read_text(), name="it")
    np.testing.assert_allclose(true.positions_m[[0, -1]], [[0, 0, 0.2], [0.5, 0, 0.6]], atol=1e-3)
    with (ways / "it.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["t_ns"]) for row in rows] == true.t_ns.tolist()
    assert max(float(row["vx_mps"]) for row in rows) == pytest.approx(0.3, rel=1e-3)
    assert max(float(row["ax_mps2"]) for row in rows) == pytest.approx(0.5, rel=0.05)


def test_the_plot_shows_the_floor_and_the_point_that_is_led_where_there_are_such(vobench, ways):
    suite = ways / "suites" / "ways.yaml"
    patch = "floor: [{surface: carpet, center_m: [0.2, 0.1], size_m: [0.1, 0.4], yaw_deg: 90}]"
    suite.write_text(WAYS.replace("mover: unicycle, encoders: exact", patch))
    for name in ("legs", "spin"):
        assert vobench("drive", "ways", "-t", name, "--out", f"{name}.svg").code == 0
    legs, spin = ((ways / f"{name}.svg").read_text() for name in ("legs", "spin"))
    assert [word in legs for word in ("point h", "carpet", "u requested")] == [True, False, True]
    assert [word in spin for word in ("point h", "carpet", "u requested")] == [False, True, True]


@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
def test_the_plot_is_the_same_file_each_time(vobench, ways, ending):
    files = []
    for name in ("a", "b"):
        assert vobench("drive", "ways", "-t", "legs", "--out", f"{name}.{ending}").code == 0
        files.append((ways / f"{name}.{ending}").read_bytes())
    assert files[0] == files[1]


def test_a_suite_of_the_house_needs_no_file(vobench, here):
    assert {one["trajectory"] for one in vobench("drive", "paper", "--json").json["trajectories"]} == {
        "fig12",
        "fig12_smooth",
        "fig10",
    }


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("-t", "leg"), "no trajectory named 'leg'. Did you mean 'legs'? Known: away, legs, lift, spin"),
        (("--out", "a.jpg"), "--out should end in .svg, .png, .pdf, got a.jpg"),
        (("--out", "no/a.svg"), "should be a file in an existing folder: no/a.svg"),
        (
            ("--tum", "a.tum"),
            "--tum and --csv need one trajectory; choose one with --trajectory: legs, spin, away, lift",
        ),
    ],
)
def test_a_mistake_is_one_line_before_anything_is_driven(vobench, ways, words, sentence):
    said = vobench("drive", "ways", *words)
    assert (said.code, said.out, said.err) == (1, "", f"vobench: {sentence}\n")


def test_a_target_out_of_reach_is_one_line_with_its_place(vobench, ways):
    suite = ways / "suites" / "ways.yaml"
    suite.write_text(WAYS.replace("tolerance_m: 0.05", "max_time_s: 1"))
    said = vobench("drive", "ways")
    assert said.code == 1
    assert said.err.startswith(f"vobench: {suite}:5: trajectories.legs: target 1 at (0.3, 0) m was not entered")
