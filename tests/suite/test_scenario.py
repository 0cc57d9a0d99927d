"""Scenarios: one factor at six severities, all else the same."""

from collections import Counter, defaultdict
from pathlib import Path

import pytest

from vobench.errors import SuiteError
from vobench.suite import catalog, yaml_file
from vobench.suite.axis import AXES
from vobench.suite.catalog import builtin_root
from vobench.suite.plan import Plan
from vobench.suite.scenario import read_scenario
from vobench.suite.suite import read_plan
from vobench.suite.suite_spec import Suite

CLOSET = """name: closet
white_cd_m2: 50
materials: {grain: {pattern: terrazzo, albedo: 0.5, resolution_px: 8}}
room: {size_m: [3, 3, 1.5], floor: grain, wall: grain, ceiling: grain}
lamps: [{name: lamp, center_m: [0, 0, 1.4], size_m: [0.4, 0.4], power_lm: 600}]
"""
DUSK = """name: dusk
base:
  scene: closet
  rig: {pitch_deg: 90}
  trajectory: {targets_m: [[0.5, 0]]}
  camera: {sensor: mt9v034, chip: {read_noise_e: 5}}
severity:
  - {}
  - {camera: {gain_db: 6}}
  - {camera: {gain_db: 12, chip: {prnu: 0.1}}}
  - {lighting: {lamp: {power_lm: 100}}}
  - {scene_changes: {materials.grain.albedo: 0.1}}
  - {trajectory: {rate_hz: 5}}
"""
SUITE = "name: tiny\nscenarios: {dusk: [0, 2, 3, 4, 5]}\nestimators: [stand_still]\n"


@pytest.fixture
def plan(tmp_path, monkeypatch):
    """Reads the plan of a suite with one scenario, texts of both replaced."""
    monkeypatch.chdir(tmp_path)
    for folder in ("scenes", "suites/scenarios"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "scenes" / "closet.yaml").write_text(CLOSET)

    def read(old: str = "", new: str = "", *, suite: str = SUITE) -> Plan:
        assert old in DUSK
        (tmp_path / "suites" / "scenarios" / "dusk.yaml").write_text(DUSK.replace(old, new, 1))
        (tmp_path / "suites" / "tiny.yaml").write_text(suite)
        return read_plan("./suites/tiny.yaml")

    return read


def test_a_case_says_its_scenario_and_severity_and_others_say_none(plan):
    axes = "scenes: [closet]\nrigs: {down: {pitch_deg: 90}}\ntrajectories: {short: {targets_m: [[0.5, 0]]}}\n"
    plain, *severe = plan(suite=SUITE + axes).cases
    assert (plain.scenario, plain.severity) == (None, None)
    assert [(case.name, case.scenario, case.severity) for case in severe] == [
        (f"dusk-{n}", "dusk", n) for n in (0, 2, 3, 4, 5)
    ]


def test_a_severity_changes_the_keys_it_names_and_no_others(plan):
    first, second, third, fourth, fifth = plan().cases
    assert (second.camera.gain_db, second.camera.chip.prnu, second.camera.chip.read_noise_e) == (12, 0.1, 5)
    assert (third.camera, fourth.camera, fifth.camera) == (first.camera,) * 3
    assert third.lighting["lamp"].power_lm == 100
    assert (first.scene.materials["grain"].albedo, fourth.scene.materials["grain"].albedo) == (0.5, 0.1)
    assert fifth.trajectory.rate_hz == 5
    changed = [
        [axis for axis in AXES if getattr(case, axis) != getattr(first, axis)]
        for case in (second, third, fourth, fifth)
    ]
    assert changed == [["camera"], ["lighting"], ["scene"], ["trajectory"]]


def test_a_scenario_has_the_base_of_what_it_includes_with_its_own_keys_over_it(plan, tmp_path):
    whole = plan().cases
    base, severity = DUSK.index("base:"), DUSK.index("severity:")
    setups = tmp_path / "suites" / "scenarios" / "setups"
    setups.mkdir()
    (setups / "down.yaml").write_text(DUSK[base:severity].replace("pitch_deg: 90", "pitch_deg: 80"))
    own = "include: setups/down.yaml\nname: dusk\nbase: {rig: {pitch_deg: 90}}\n"
    parted = plan(DUSK[:severity], own).cases
    assert parted == whole
    (setups / "down.yaml").write_text(DUSK[base:severity].replace("mt9v034", "mt9v035"))
    with pytest.raises(SuiteError, match=r"down\.yaml:5: .*mt9v035"):
        plan(DUSK[:severity], own)
    with pytest.raises(SuiteError, match="a scenario cannot include itself"):
        plan("name: dusk\n", "include: dusk\nname: dusk\n")


def test_variants_of_an_axis_are_called_alike_just_where_they_are(plan):
    cases = plan().cases
    for axis in AXES:
        names = [case.variant[axis] for case in cases]
        values = [getattr(case, axis) for case in cases]
        assert [[a == b for a in names] for b in names] == [[a == b for a in values] for b in values]


def test_calibrations_stand_side_by_side_and_are_told_alike(plan):
    cases = plan(suite=SUITE.replace("[0, 2, 3, 4, 5]", "2") + "calibrations: [none, worn]\n").cases
    assert [case.name for case in cases] == ["dusk-2-none", "dusk-2-worn"]
    none, worn = cases
    assert none.build_rig().T_body_right.tobytes() == worn.build_rig().T_body_right.tobytes()
    assert none.build_true_rig().T_body_right.tobytes() != worn.build_true_rig().T_body_right.tobytes()
    assert worn.build_true_rig().T_body_right.tobytes() == worn.build_true_rig().T_body_right.tobytes()


def test_a_calibration_may_be_run_at_some_severities_alone(plan):
    suite = SUITE.replace("[0, 2, 3, 4, 5]", "[2, 3]")
    cases = plan(suite=suite + "calibrations: {none: [2, 3], worn: 2}\n").cases
    assert [case.name for case in cases] == ["dusk-2-none", "dusk-2-worn", "dusk-3-none"]
    with pytest.raises(SuiteError, match=r"scenarios\.dusk: no calibration lists severity 3"):
        plan(suite=suite + "calibrations: {worn: 2}\n")


MISTAKES = [
    ("gain_db: 6", "gain_dbb: 6", "severity.1.camera.gain_dbb: unknown key. Did you mean 'gain_db'?"),
    ("gain_db: 6", "gain_db: 90", "dusk.yaml:9: severity.1.camera.gain_db: should be 48 or less (got 90)"),
    ("  - {}\n", "", "severity: should have 6 or more entries, but has 5"),
    ("grain.albedo", "grian.albedo", "materials.grian"),
    ("{lamp: {p", "{lmap: {p", "scenarios.dusk: lighting: no light named 'lmap'. Did you mean 'lamp'?"),
    ("scene: closet", "scene: close", "scenarios.dusk: no scene named 'close'. Did you mean 'closet'?"),
]


@pytest.mark.parametrize(("old", "new", "said"), MISTAKES, ids=[new for _, new, _ in MISTAKES])
def test_what_is_wrong_with_a_scenario_is_said_with_its_place(plan, old, new, said):
    with pytest.raises(SuiteError) as refused:
        plan(old, new)
    assert said in "\n".join(map(str, refused.value.mistakes))


@pytest.mark.parametrize(
    ("suite", "said"),
    [
        (SUITE.replace("dusk:", "dsuk:"), "scenarios.dsuk: no scenario named 'dsuk'. Did you mean 'dusk'?"),
        (SUITE.replace("[0, 2, 3, 4, 5]", "6"), "scenarios.dusk: should be 5 or less (got 6)"),
        ("name: tiny\nestimators: [stand_still]\n", "or only scenarios or a source"),
        ("name: t\nsource: x\ncalibrations: [worn]\nestimators: [stand_still]\n", "calibrations: requires scenarios"),
        (SUITE + "calibrations: [worn, 3]\n", "calibrations: should be keys with values"),
        (SUITE + "calibrations: [worn, borked]\n", "calibrations.borked: should be"),
    ],
    ids=["name", "severity", "nothing", "calibrations", "no level", "unknown level"],
)
def test_what_is_wrong_with_a_suite_of_scenarios_is_said(plan, suite, said):
    with pytest.raises(SuiteError) as refused:
        plan(suite=suite)
    assert said in "\n".join(map(str, refused.value.mistakes))


STOCK = [entry for entry in catalog.entries("scenario") if builtin_root() in entry.path.parents]


@pytest.mark.parametrize("entry", STOCK, ids=lambda entry: entry.name)
def test_a_stock_scenario_changes_something_at_every_severity_and_nothing_at_severity_0(entry):
    scenario = read_scenario(Path(entry.path))
    assert scenario.name == entry.name
    assert len({repr(setup) for setup in scenario.setups}) == len(scenario.setups)
    changed = {
        tuple(axis for axis in ("scene_changes", *AXES) if getattr(setup, axis) != getattr(scenario.setups[0], axis))
        for setup in scenario.setups[1:]
    }
    assert len(changed) == 1, "one factor, on one axis"


@pytest.mark.parametrize("name", ["daily", "full"])
def test_the_long_suites_have_every_stock_scenario(name):
    suite = yaml_file.read(catalog.find("suite", name).path, Suite)
    stock = {path.stem for path in (builtin_root() / "suites" / "scenarios").glob("*.yaml")}
    assert suite.scenarios.keys() == stock


def test_daily_is_balanced_over_places_indoors_and_out_by_robot_hand_and_car():
    plan = read_plan("daily")
    cases_of_place = Counter()
    drives = set()
    for case in plan.simulated:
        if case.scene.generated:
            cases_of_place[case.variant["scene"]] += 1
            drive, _, _ = case.variant["trajectory"].partition(".")  # without the severity of frame_rate
            drives.add(drive)
    cases_of_a_scenario = 2  # at severities 1 and 3
    assert len(cases_of_place) == 13
    assert max(cases_of_place.values()) - min(cases_of_place.values()) <= cases_of_a_scenario
    kinds = {place.split(".")[0] for place in cases_of_place}
    assert kinds == {"flat", "office", "room", "warehouse", "street", "park"}
    assert {"robot", "hand", "car"} < drives

    places_of = defaultdict(set)
    for case in plan.simulated:
        if case.scene.generated:
            places_of[case.scenario].add(case.variant["scene"])
    assert {len(places) for places in places_of.values()} == {2}
    biases = {case.severity: case.rig.imu.gyro.bias for case in plan.simulated if case.scenario == "imu_bias"}
    assert biases == {1: (0.02, -0.015, 0.02), 3: (0.09, -0.0675, 0.09)}
