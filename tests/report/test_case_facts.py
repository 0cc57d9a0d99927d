"""What the file of a case states that a board needs."""

import json

import pytest

from vobench.report.case_facts import case_facts
from vobench.report.cell import CaseFacts
from vobench.runner.folder import CASE, RunFolder


@pytest.fixture
def facts(tmp_path):
    def read(content):
        folder = RunFolder(tmp_path)
        folder.case("down").mkdir(parents=True, exist_ok=True)
        (folder.case("down") / CASE).write_text(json.dumps(content))
        return case_facts(folder, "down")

    return read


def test_a_case_without_a_file_or_facts_has_none(tmp_path, facts):
    assert case_facts(RunFolder(tmp_path), "other") == CaseFacts()
    assert facts({"rig": None, "truth_noise": None, "scenario": None}) == CaseFacts()


def test_the_level_of_the_calibration_error_is_the_group(facts):
    assert facts({"rig": {"calibration_error": {"level": "worn"}}}).group == "worn"
    assert facts({"rig": {"calibration_error": {"level": "none"}}}).group == ""
    assert facts({"rig": {"calibration_error": {"level": 3}}}).group == ""
    assert facts({"rig": {"calibration_error": None}}).group == ""


def test_scenario_and_severity_are_read(facts):
    assert facts({"scenario": "blur", "severity": 0}) == CaseFacts(scenario="blur", severity=0)
    assert facts({"severity": "much"}).severity is None


def test_the_place_is_the_scene_and_its_seed_whatever_a_scenario_changes(facts):
    assert facts({"scene": {"name": "room", "seed": 0}}).place == "room"
    assert facts({"scene": {"name": "flat", "seed": 3}}).place == "flat 3"
    assert facts({"scene": None}).place == facts({"scene": {}}).place == ""


def test_a_drive_is_its_trajectory_with_its_poses_and_frames(facts):
    circle = {"kind": "circle", "radius_m": 2.0}
    same = [facts({"trajectory": circle, "frames": None}).drive for _ in range(2)]
    others = [
        facts({"trajectory": {**circle, "radius_m": 1.0}}).drive,
        facts({"trajectory": circle, "frames": [0, 9]}).drive,
        facts({"trajectory": circle, "replayed": "0 0 0 0 0 0 0 1"}).drive,
    ]
    assert same[0] == same[1]
    assert len({same[0], *others}) == 4
    assert facts({}).drive == ""


@pytest.mark.parametrize(
    ("noise", "text"),
    [
        ({"position_m": 0.001}, "1 mm per axis"),
        ({"rotation_deg": 0.5}, "0.5° per axis"),
        ({"position_m": 0.0025, "rotation_deg": 0.5}, "2.5 mm per axis and 0.5° per axis"),
        ({"position_m": 0.0, "rotation_deg": 0}, ""),
    ],
)
def test_the_noise_of_the_ground_truth_is_in_words(facts, noise, text):
    assert facts({"truth_noise": noise}).truth_noise == text
    assert facts({"truth_noise": noise}).truth_noise_m == noise.get("position_m", 0.0)
