"""The cases of scenarios: their names, what they share with the suite, and how often files are read."""

from collections import Counter, defaultdict
from dataclasses import replace

import numpy as np
import pytest

from tests.generated import GENERATOR, write_cell
from tests.suite.conftest import CLOSET
from vobench.errors import SuiteError
from vobench.suite import clearance, scene_file
from vobench.suite.suite import read_plan

DUSK = """name: dusk
base:
  scene: closet
  rig: {pitch_deg: 90, calibration_error: {level: factory}}
  trajectory: {targets_m: [[0.5, 0]]}
severity: [{}, {camera: {gain_db: 6}}, {camera: {gain_db: 9}}, {camera: {gain_db: 12}}, {camera: {gain_db: 15}},
  {scene_changes: {materials.grain.albedo: 0.1}}]
"""


@pytest.fixture
def plan(tmp_path, monkeypatch):
    """Reads the plan of a suite of scenarios; `dawn` is `dusk` with another name."""
    monkeypatch.chdir(tmp_path)
    scenarios = tmp_path / "suites" / "scenarios"
    scenarios.mkdir(parents=True)
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "closet.yaml").write_text(CLOSET)
    (scenarios / "dusk.yaml").write_text(DUSK)
    (scenarios / "dawn.yaml").write_text(DUSK.replace("name: dusk", "name: dawn"))

    def read(text):
        path = tmp_path / "suites" / "small.yaml"
        path.write_text(f"name: small\nestimators: [stand_still]\n{text}")
        return read_plan(str(path))

    return read


def test_cases_come_in_the_order_of_the_suite_each_severity_once(plan):
    cases = plan("scenarios: {dusk: [3, 0, 3], dawn: 1}\n").simulated
    assert [case.name for case in cases] == ["dusk-3", "dusk-0", "dawn-1"]
    assert [(case.scenario, case.severity) for case in cases] == [("dusk", 3), ("dusk", 0), ("dawn", 1)]


def test_without_calibrations_the_error_of_the_scenarios_rig_stays(plan):
    (case,) = plan("scenarios: {dusk: 0}\n").simulated
    assert case.rig.calibration_error.level == "factory"


def test_a_calibration_replaces_the_level_and_is_named_only_beside_another(plan):
    (alone,) = plan("scenarios: {dusk: 0}\ncalibrations: [worn]\n").simulated
    none, worn = plan("scenarios: {dusk: 0}\ncalibrations: [none, worn]\n").simulated
    assert [case.rig.calibration_error.level for case in (alone, none, worn)] == ["worn", "none", "worn"]
    assert [case.name for case in (alone, none, worn)] == ["dusk-0", "dusk-0-none", "dusk-0-worn"]
    assert none.variant["rig"] != worn.variant["rig"]
    assert alone.rig == worn.rig


def test_what_the_suite_says_for_all_cases_holds_for_scenarios(plan):
    (case,) = plan("scenarios: {dusk: 1}\nseed: 5\nframes: [1, 4]\ntruth: [depth]\n").simulated
    assert (case.seed, case.frames, case.truth) == (5, (1, 4), ("depth",))


def test_a_scene_is_read_once_for_each_set_of_changes(plan, monkeypatch):
    calls = []
    read = scene_file.read_scene_with_mistakes

    def counted(path, *changes):
        calls.append(changes)
        return read(path, *changes)

    monkeypatch.setattr(scene_file, "read_scene_with_mistakes", counted)
    cases = plan("scenarios: {dusk: [0, 1, 2, 5], dawn: [0, 5]}\n").simulated
    assert calls == [({},), ({"materials.grain.albedo": 0.1},)]
    assert [case.scene.materials["grain"].albedo for case in cases] == [0.5, 0.5, 0.5, 0.1, 0.5, 0.1]


def test_a_scenario_called_as_a_trajectory_of_the_suite_is_refused(plan):
    axes = "scenes: [closet]\ntrajectories: {dusk: {targets_m: [[0.5, 0]]}}\n"
    with pytest.raises(SuiteError, match=r"scenarios\.dusk: a trajectory of the suite has this name, too"):
        plan(f"{axes}scenarios: {{dusk: 0}}\n")


def test_scenarios_replay_poses_that_lie_beside_them(plan, tmp_path):
    rows = "".join(f"{k / 10} {k / 100} 0 0.5 0 0 0 1\n" for k in range(20))
    scenarios = tmp_path / "suites" / "scenarios"
    (scenarios / "path.tum").write_text(rows)
    text = (scenarios / "dusk.yaml").read_text()
    replaying = text.replace("{targets_m: [[0.5, 0]]}", "{kind: replay, file: path.tum}")
    (scenarios / "dusk.yaml").write_text(replaying)
    replayed, driven = plan("scenarios: {dusk: 0, dawn: 0}\n").simulated
    assert len(replayed.replayed.splitlines()) == 20
    assert driven.replayed is None


NAMES = ("mist", "haze", "dust", "rain", "hail", "frost")
PLAIN = """name: {name}
base: {{scene: closet, rig: {{pitch_deg: 90}}, trajectory: {{targets_m: [[0.5, 0]]}}}}
severity: [{{}}, {{camera: {{gain_db: 6}}}}, {{camera: {{gain_db: 9}}}}, {{camera: {{gain_db: 12}}}},
  {{camera: {{gain_db: 15}}}}, {{camera: {{gain_db: 18}}}}]
"""
SPREAD = """scenes: [{name: cell, seeds: 4}]
trajectories: {tour: {kind: wander, length_m: 1, seeds: 2}}
spread: {units: 8, each: 2}
"""


@pytest.fixture
def spread_plan(plan, tmp_path):
    """Reads the plan of a suite of scenarios that suit any place, and of `dusk`, which changes its own."""
    write_cell(tmp_path / "scenes" / "cell")
    for name in NAMES:
        (tmp_path / "suites" / "scenarios" / f"{name}.yaml").write_text(PLAIN.format(name=name))
    listed = ", ".join(f"{name}: [1, 3]" for name in NAMES)
    return lambda more="": plan(f"{SPREAD}{more}scenarios: {{{listed}, dusk: [0, 5]}}\n")


def unit(case):
    """The place and the drive of a case."""
    return case.variant["scene"], case.variant["trajectory"]


def test_each_scenario_has_its_units_in_two_places_and_each_unit_has_as_many_cases(spread_plan):
    cases = [case for case in spread_plan().simulated if case.scenario in NAMES]
    assert len(cases) == len(NAMES) * 2 * 2

    units_of = defaultdict(set)
    for case in cases:
        units_of[case.scenario].add(unit(case))
    for name in NAMES:
        assert len(units_of[name]) == 2
        assert len({place for place, _ in units_of[name]}) == 2

    load = Counter(unit(case) for case in cases)
    places = Counter(case.variant["scene"] for case in cases)
    drives = Counter(case.variant["trajectory"] for case in cases)
    assert len(load) == 8
    assert max(load.values()) - min(load.values()) <= 2  # a scenario has two severities
    assert max(places.values()) - min(places.values()) <= 2
    assert max(drives.values()) - min(drives.values()) <= 2


def test_severities_of_a_scenario_share_its_units_and_differ_by_severity_alone(spread_plan):
    cases = spread_plan().simulated
    for name in NAMES:
        by_severity = defaultdict(list)
        for case in cases:
            if case.scenario == name:
                by_severity[case.severity].append(case)
        assert [unit(case) for case in by_severity[1]] == [unit(case) for case in by_severity[3]]
        for mild, strong in zip(by_severity[1], by_severity[3], strict=True):
            assert (mild.scene, mild.trajectory, mild.rig, mild.seed) == (
                strong.scene,
                strong.trajectory,
                strong.rig,
                strong.seed,
            )
            assert (mild.camera.gain_db, strong.camera.gain_db) == (6, 12)


def test_cases_in_units_are_named_by_scenario_severity_place_and_drive(spread_plan):
    names = [case.name for case in spread_plan().simulated]
    assert len(set(names)) == len(names)
    assert all(name.split("-")[1] in "13" for name in names if name.startswith(NAMES))
    assert any(name.startswith("mist-1-cell.") and ".1" in name for name in names)


def test_a_scenario_that_changes_its_scene_stays_in_its_own_place(spread_plan):
    cases = [case for case in spread_plan().simulated if case.scenario == "dusk"]
    assert [case.name for case in cases] == ["dusk-0", "dusk-5"]
    assert {case.scene.name for case in cases} == {"closet"}


def test_a_scenario_stays_in_its_own_place_if_the_suite_says_so(spread_plan, plan):
    spread = {case.name for case in spread_plan().simulated}
    text = SPREAD.replace("each: 2", "each: 2, own_place: [mist]")
    listed = ", ".join(f"{name}: [1, 3]" for name in NAMES)
    cases = plan(f"{text}scenarios: {{{listed}, dusk: [0, 5]}}\n").simulated
    assert [case.name for case in cases if case.scenario == "mist"] == ["mist-1", "mist-3"]
    assert {case.scene.name for case in cases if case.scenario == "mist"} == {"closet"}
    assert sum(case.scenario == "haze" for case in cases) == sum(name.startswith("haze") for name in spread) == 4


def test_a_scenario_that_stays_must_be_one_of_the_suite(spread_plan, plan):
    del spread_plan  # it writes the files
    text = SPREAD.replace("each: 2", "each: 2, own_place: [mits]")
    with pytest.raises(SuiteError, match="own_place names scenarios that the suite does not have: mits"):
        plan(f"{text}scenarios: {{mist: 1}}\n")


FOGGY = """name: smog
base: {scene: closet, rig: {pitch_deg: 90}, trajectory: {targets_m: [[0.5, 0]]}}
severity: [{}, {scene_changes: {fog: {visibility_m: 100}}}, {scene_changes: {fog: {visibility_m: 50}}},
  {scene_changes: {fog: {visibility_m: 25}}}, {scene_changes: {fog: {visibility_m: 12}}},
  {scene_changes: {fog: {visibility_m: 6}}}]
"""


@pytest.fixture
def weather_plan(spread_plan, plan, tmp_path):
    """Reads the plan of a suite with a scenario `smog` in two kinds of places."""
    del spread_plan  # it writes the files
    write_cell(tmp_path / "scenes" / "yard", name="yard")
    (tmp_path / "suites" / "scenarios" / "smog.yaml").write_text(FOGGY)
    scenes = "scenes: [{name: cell, seeds: 2}, {name: yard, seeds: 3}]\n"
    drives = "trajectories: {tour: {kind: wander, length_m: 1}}\n"

    def read(spread, *, each=2, scenarios="smog: [0, 2, 4], mist: [1]"):
        return plan(f"{scenes}{drives}spread: {{units: 5, each: {each}{spread}}}\nscenarios: {{{scenarios}}}\n")

    return read


def test_the_weather_changes_in_the_places_that_the_suite_names_and_nothing_else(weather_plan):
    cases = [case for case in weather_plan(", places: {smog: [yard]}").simulated if case.scenario == "smog"]
    assert len(cases) == 3 * 2
    assert {case.scene.name for case in cases} == {"yard"}
    by_severity = defaultdict(list)
    for case in cases:
        by_severity[case.severity].append(case)
    visibility_m = {
        severity: [case.scene.fog and case.scene.fog.visibility_m for case in same]
        for severity, same in by_severity.items()
    }
    assert visibility_m == {0: [None, None], 2: [50, 50], 4: [12, 12]}
    for clear, foggy in zip(by_severity[0], by_severity[4], strict=True):
        assert unit(clear) == unit(foggy)
        assert replace(foggy.scene, fog=None) == clear.scene
        assert (foggy.camera, foggy.rig, foggy.trajectory) == (clear.camera, clear.rig, clear.trajectory)


TILED = """name: tiles
base: {scene: closet, scene_changes: {materials.grain.albedo: 0.2, floor: {pattern: plain, albedo: 0.4, eta: 1,
  kind: polished}}, rig: {pitch_deg: 90}, trajectory: {targets_m: [[0.5, 0]]}}
severity: [{}, {scene_changes: {floor: {eta: 1.5}}}, {}, {}, {}, {scene_changes: {floor: {eta: 2}, paint: {cover: 1}}}]
"""


def test_the_surfaces_of_the_places_that_the_suite_names_change_and_nothing_else(weather_plan, tmp_path):
    cases = cases_in_yards(weather_plan, tmp_path, "tiles", TILED)
    etas = [[case.scene.floor.eta for case in same] for same in cases.values()]
    assert etas == [[1, 1], [1.5, 1.5], [2, 2]]
    for bare, painted in zip(cases[0], cases[5], strict=True):
        assert painted.scene.paint.cover == 1
        assert replace(painted.scene, paint=None, floor=bare.scene.floor) == bare.scene
        assert bare.scene.materials == {}  # what all severities change of the own place stays there
        assert (painted.camera, painted.rig, painted.trajectory) == (bare.camera, bare.rig, bare.trajectory)


def test_a_scenario_that_changes_other_surfaces_too_cannot_leave_its_place(weather_plan, tmp_path):
    varied = TILED.replace("severity: [{}, ", "severity: [{scene_changes: {materials.grain.albedo: 0.3}}, ")
    with pytest.raises(SuiteError, match="its severities change its own place"):
        cases_in_yards(weather_plan, tmp_path, "tiles", varied)


FLASHING = """name: flash
base: {scene: closet, rig: {pitch_deg: 90}, trajectory: {targets_m: [[0.5, 0]]}}
severity: [{}, {lighting: {lamps: {level: {steady: 0.5}}}}, {}, {}, {}, {lighting: {lamps: {level: {steady: 0.1}}}}]
"""

SLOW = """name: slow
base: {scene: closet, rig: {pitch_deg: 90}, trajectory: {targets_m: [[0.5, 0]], rate_hz: 8}}
severity: [{}, {trajectory: {rate_hz: 4}}, {}, {}, {}, {trajectory: {rate_hz: 1}}]
"""

MOVED = """name: moved
base: {scene: closet, rig: {pitch_deg: 90}, trajectory: {targets_m: [[0.5, 0]], rate_hz: 8}}
severity: [{}, {trajectory: {rate_hz: 4}}, {trajectory: {targets_m: [[0.6, 0]]}}, {}, {}, {}]
"""


def cases_in_yards(weather_plan, tmp_path, name, content):
    """The cases of a scenario at severities 0, 1 and 5 in two yards, by severity."""
    (tmp_path / "suites" / "scenarios" / f"{name}.yaml").write_text(content)
    plan = weather_plan(f", places: {{{name}: [yard]}}", scenarios=f"{name}: [0, 1, 5]")
    by_severity = defaultdict(list)
    for case in plan.simulated:
        by_severity[case.severity].append(case)
    assert {case.scene.name for case in plan.simulated} == {"yard"}
    assert [len(same) for same in by_severity.values()] == [2, 2, 2]
    return by_severity


def test_all_lamps_of_the_places_that_the_suite_names_change_and_nothing_else(weather_plan, tmp_path):
    cases = cases_in_yards(weather_plan, tmp_path, "flash", FLASHING)
    levels = [[case.lighting["lamps"].level.steady for case in cases[severity]] for severity in (1, 5)]
    assert levels == [[0.5, 0.5], [0.1, 0.1]]
    for steady, dim in zip(cases[0], cases[5], strict=True):
        assert steady.lighting == {}
        assert (dim.scene, dim.camera, dim.rig, dim.trajectory) == (
            steady.scene,
            steady.camera,
            steady.rig,
            steady.trajectory,
        )


def test_the_rate_of_a_drive_changes_by_the_same_ratio_and_nothing_else(weather_plan, tmp_path):
    cases = cases_in_yards(weather_plan, tmp_path, "slow", SLOW)
    for usual, half, slow in zip(cases[0], cases[1], cases[5], strict=True):
        assert half.trajectory.rate_hz == pytest.approx(usual.trajectory.rate_hz / 2)
        assert slow.trajectory.rate_hz == pytest.approx(usual.trajectory.rate_hz / 8)
        assert replace(slow.trajectory, rate_hz=usual.trajectory.rate_hz) == usual.trajectory
        assert slow.scene == usual.scene
        assert slow.variant["trajectory"] == f"{usual.variant['trajectory']}.slow.5"


def test_a_scenario_with_another_drive_cannot_leave_its_place(weather_plan, tmp_path):
    with pytest.raises(SuiteError, match="its severities change its own place, single lights or its drive"):
        cases_in_yards(weather_plan, tmp_path, "moved", MOVED)


RING = """name: ring
base:
  scene: closet
  rig: {pitch_deg: 90}
  trajectory: {kind: circle, radius_m: 0.3, mover: unicycle, rate_hz: 8}
  camera: {exposure_ms: 1, exposure_gain: 5}
severity: [{}, {trajectory: {speed_mps: 0.4}}, {}, {}, {}, {trajectory: {speed_mps: 0.8}}]
"""


def test_a_scenario_that_keeps_its_trajectory_has_a_free_start_in_each_unit(weather_plan, tmp_path):
    (tmp_path / "suites" / "scenarios" / "ring.yaml").write_text(RING)
    plan = weather_plan(", keep: {ring: [trajectory, camera]}", scenarios="ring: [0, 5], mist: [1]")
    cases = [case for case in plan.simulated if case.scenario == "ring"]
    usual, fast = cases[:2], cases[2:]
    assert [case.trajectory.speed_mps for case in cases] == [0.3, 0.3, 0.8, 0.8]
    assert [unit(case)[0] for case in usual] == [unit(case)[0] for case in fast]
    assert {case.scene.name for case in cases} <= {"cell", "yard"}
    assert len({(case.trajectory.start_m, case.trajectory.start_heading_deg) for case in usual}) == 2
    assert len({case.variant["trajectory"] for case in cases}) == 4
    for slow_case, fast_case in zip(usual, fast, strict=True):
        assert replace(fast_case.trajectory, speed_mps=0.3) == slow_case.trajectory
        assert slow_case.name.removeprefix("ring-0") == fast_case.name.removeprefix("ring-5")
        assert slow_case.name.startswith(f"ring-0-{unit(slow_case)[0]}-start.")
    for case in cases:
        assert (case.camera.exposure_ms, case.camera.exposure_gain) == (1, 1)
    assert any(case.trajectory.kind == "wander" for case in plan.simulated if case.scenario == "mist")


WIDE_RING = RING.replace("radius_m: 0.3", "radius_m: 1.5")  # takes 3.6 m, and a cell is at most 4 m wide
HALL = GENERATOR.replace("rng.uniform(3.0, 4.0)", "rng.uniform(8.0, 9.0)")


@pytest.fixture
def hall_plan(weather_plan, tmp_path):
    """Reads the plan of a suite in two cells and three halls with a scenario that drives a circle of 1.5 m."""
    write_cell(tmp_path / "scenes" / "yard", HALL, name="yard")
    (tmp_path / "suites" / "scenarios" / "ring.yaml").write_text(WIDE_RING)
    keep = ", keep: {ring: [trajectory, camera]}"
    return lambda each, places="": weather_plan(f"{keep}{places}", each=each, scenarios="ring: [0, 5], mist: [1]")


def test_a_scenario_that_keeps_its_trajectory_runs_only_where_it_fits(hall_plan):
    cases = [case for case in hall_plan(3).simulated if case.scenario == "ring"]
    assert {case.variant["scene"] for case in cases} == {"yard.1", "yard.2", "yard.3"}
    assert len(cases) == 3 * 2


def test_a_path_that_fits_into_too_few_units_is_a_mistake_of_its_scenario(hall_plan):
    with pytest.raises(SuiteError, match=r"scenarios\.ring: spread runs .* in 4 units, but the path .* in only 3 of 5"):
        hall_plan(4)
    with pytest.raises(SuiteError, match=r"in 2 units, but the path that it keeps has a free start in only 0 of 2"):
        hall_plan(2, ", places: {ring: [cell]}")


TALL = RING.replace("{trajectory: {speed_mps: 0.8}}", "{rig: {height_m: 1.2}}")
SHELF = GENERATOR.replace(
    "    lamp = ",
    '    things.append(Thing("shelf", block((1.2, 4.0, 0.02), transform=at(0.9, 0.0, 0.91)), "plaster"))\n    lamp = ',
)


def test_a_start_is_free_for_the_highest_rig_of_all_severities(weather_plan, tmp_path):
    """A board hangs 0.9 m above the floor from x = 0.3 m on: below the mast of severity 5, above that of 0."""
    write_cell(tmp_path / "scenes" / "cell", SHELF)
    (tmp_path / "suites" / "scenarios" / "ring.yaml").write_text(
        TALL.replace("pitch_deg: 90", "pitch_deg: 90, height_m: 0.4")
    )
    plan = weather_plan(
        ", keep: {ring: [trajectory, rig]}, places: {ring: [cell]}", each=2, scenarios="ring: [0, 5], mist: [1]"
    )
    low, high = (
        [case.trajectory for case in plan.simulated if case.scenario == "ring" and case.severity == severity]
        for severity in (0, 5)
    )
    assert low == high
    assert all(path.start_m[0] < 0.3 for path in high)


GATE = """name: gate
base: {scene: closet, rig: {pitch_deg: 0}, trajectory: {kind: stop_and_go, legs_m: [0.5], mover: unicycle,
  start_m: [1, 2], start_heading_deg: 90}}
severity: [{}, {}, {}, {}, {}, {scene_changes: {materials: {lead: {pattern: plain, albedo: 0.1}}, boards: [{name: gate,
  center_m: [1, 3.5, 0.5], size_m: [0.8, 1], yaw_deg: -90, material: lead}]}}]
"""
KEEPS_GATE = ", keep: {gate: [trajectory, props]}"


def test_props_that_a_scenario_keeps_stay_where_they_are_relative_to_its_path(weather_plan, tmp_path):
    write_cell(tmp_path / "scenes" / "yard", HALL, name="yard")
    (tmp_path / "suites" / "scenarios" / "gate.yaml").write_text(GATE)
    cases = [
        case
        for case in weather_plan(KEEPS_GATE, scenarios="gate: [0, 5], mist: [1]").simulated
        if case.scenario == "gate"
    ]
    assert [len(case.scene.boards) for case in cases] == [0, 0, 1, 1]
    for open_case, gated in zip(cases[:2], cases[2:], strict=True):
        path, (board,) = gated.trajectory, gated.scene.boards
        ahead = np.array([np.cos(np.radians(path.start_heading_deg)), np.sin(np.radians(path.start_heading_deg))])
        np.testing.assert_allclose(np.array(board.center_m[:2]) - path.start_m, 1.5 * ahead, atol=1e-9)
        assert board.yaw_deg - path.start_heading_deg == pytest.approx(-180)
        assert gated.trajectory == open_case.trajectory
        assert replace(gated.scene, boards=(), materials={}) == open_case.scene


def test_a_scenario_with_props_leaves_its_place_only_if_it_keeps_them(weather_plan, tmp_path):
    (tmp_path / "suites" / "scenarios" / "gate.yaml").write_text(GATE)
    with pytest.raises(SuiteError, match="its severities change its own place"):
        weather_plan(", keep: {gate: [trajectory]}", scenarios="gate: [0, 5], mist: [1]")
    with pytest.raises(SuiteError, match="should also keep the trajectory of gate"):
        weather_plan(", keep: {gate: [props]}", scenarios="gate: [0, 5], mist: [1]")


def test_free_starts_are_looked_for_only_for_scenarios_that_keep_their_trajectory(weather_plan, monkeypatch):
    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr(clearance, "place_clearance", refuse)
    assert weather_plan(", places: {smog: [yard]}").simulated


@pytest.mark.parametrize(
    ("keep", "message"),
    [
        ("{moved: [trajectory]}", "it keeps its trajectory, which has no free start"),
        ("{dusk: [trajectory]}", "it keeps its trajectory, which has no free start"),
        ("{ringg: [trajectory]}", "keep names scenarios that the suite does not have: ringg"),
        ("{mist: [place]}", "keep"),
    ],
)
def test_what_a_scenario_cannot_keep_is_refused(weather_plan, tmp_path, keep, message):
    (tmp_path / "suites" / "scenarios" / "moved.yaml").write_text(MOVED)
    with pytest.raises(SuiteError, match=message):
        weather_plan(f", keep: {keep}", scenarios="moved: [1], mist: [1], dusk: [0]")


def test_a_scenario_of_the_weather_stays_in_its_own_place_unless_the_suite_names_places(weather_plan):
    cases = [case for case in weather_plan("").simulated if case.scenario == "smog"]
    assert [case.scene.name for case in cases] == ["closet"] * 3


def test_a_scenario_that_suits_any_place_can_be_kept_to_some(weather_plan):
    cases = weather_plan(", places: {mist: [cell]}").simulated
    assert {case.scene.name for case in cases if case.scenario == "mist"} == {"cell"}


@pytest.mark.parametrize(
    ("spread", "message"),
    [
        (", places: {smug: [yard]}", "places names scenarios that the suite does not have: smug"),
        (", places: {smog: [yart]}", "places.smog names scenes that the suite does not have: yart"),
        (", places: {dusk: [yard]}", "spread.places names it, but its severities change its own place"),
        (", over: [trajectory], places: {smog: [yard]}", "is for designs over scenes"),
    ],
)
def test_places_that_do_not_fit_are_named(weather_plan, spread, message):
    with pytest.raises(SuiteError, match=message):
        weather_plan(spread, scenarios="smog: 1, dusk: 1")


def test_more_units_than_the_places_of_a_scenario_have_are_refused(weather_plan):
    with pytest.raises(SuiteError, match="spread runs each scenario in 4 units, but yard has 3"):
        weather_plan(", places: {smog: [yard]}", each=4)


def test_the_rig_and_the_camera_of_the_suite_are_those_of_scenarios_in_units(spread_plan):
    more = "rigs: {ahead: {pitch_deg: 10}}\ncameras: {short: {exposure_ms: 2}}\n"
    case = next(case for case in spread_plan(more).simulated if case.scenario == "mist")
    assert case.rig.pitch_deg == 10
    assert (case.camera.exposure_ms, case.camera.gain_db) == (2, 6)


def test_a_base_seed_shifts_places_and_drives_and_keeps_the_design(spread_plan):
    shifted = spread_plan("base_seed: 500\n").simulated
    assert {case.scene.generated.seed for case in shifted if case.scene.generated} == {501, 502, 503, 504}
    assert {case.variant["trajectory"] for case in shifted if case.scene.generated} == {"tour.501", "tour.502"}
    counts = Counter(case.scenario for case in shifted)
    assert counts == Counter(case.scenario for case in spread_plan().simulated)


def test_more_units_in_each_than_there_are_is_a_mistake_of_spread(spread_plan, plan):
    del spread_plan  # it writes the files
    text = SPREAD.replace("each: 2", "each: 9")
    with pytest.raises(SuiteError, match=r"spread: spread runs each scenario in 9 units, but there are 8"):
        plan(f"{text}scenarios: {{mist: 1}}\n")


def test_the_body_of_a_unit_carries_the_rig_as_its_mount_says(spread_plan, monkeypatch):
    mounted = "{walk: {kind: wander, length_m: 1, body: hand, mount: {height_m: 0, pitch_deg: 3}}, tour"
    monkeypatch.setitem(globals(), "SPREAD", SPREAD.replace("{tour", mounted).replace("seeds: 2}}", "seeds: 1}}"))
    cases = [case for case in spread_plan().simulated if case.scenario in NAMES]
    by_drive = {case.variant["trajectory"]: case.rig for case in cases}
    assert by_drive.keys() == {"walk", "tour.1"}
    assert (by_drive["walk"].height_m, by_drive["walk"].pitch_deg) == (0, 3)
    assert by_drive["walk"].forward_m == by_drive["tour.1"].forward_m
    assert (by_drive["tour.1"].height_m, by_drive["tour.1"].pitch_deg) == (0.4, 90)


def test_a_scenario_that_changes_what_a_mount_sets_is_refused(plan, tmp_path, spread_plan):
    del spread_plan  # it writes the files
    tilt = PLAIN.format(name="tilt").replace("{camera: {gain_db: 18}}", "{rig: {pitch_deg: 60}}")
    (tmp_path / "suites" / "scenarios" / "tilt.yaml").write_text(tilt)
    text = SPREAD.replace("length_m: 1", "length_m: 1, mount: {pitch_deg: 3}")
    with pytest.raises(SuiteError, match="tilt: its severities change pitch_deg of the rig, which the mount"):
        plan(f"{text}scenarios: {{tilt: [0, 5]}}\n")
    free = SPREAD.replace("length_m: 1", "length_m: 1, mount: {height_m: 1}")
    pitches = {case.rig.pitch_deg for case in plan(f"{free}scenarios: {{tilt: [0, 5]}}\n").simulated}
    assert pitches == {90, 60}
