"""The cases of scenarios: their names, what they share with the suite, and how often files are read."""

import pytest

from tests.suite.conftest import CLOSET
from vobench.errors import SuiteError
from vobench.suite import scene_file
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
