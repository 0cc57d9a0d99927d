"""Recordings in a suite: paths, patterns, names, and what is said where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import SuiteError
from vobench.suite.source import Source, as_sources, case_name, recorded_cases
from vobench.suite.suite import read_plan


@pytest.fixture
def suite(tmp_path):
    """Writes a suite of recordings and reads its plan."""
    for name in ("MH 01", "MH_02", "V1"):
        (tmp_path / "data" / name / "mav0").mkdir(parents=True)
    (tmp_path / "data" / "run.bag").write_bytes(b"")

    def read(source, rest=""):
        path = tmp_path / "suite.yaml"
        path.write_text(f"name: real\nsource: {source}\nestimators: [stand_still]\n{rest}")
        return read_plan(str(path))

    return read


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("data/V1", ["v1"]),
        ("data/V1/mav0", ["v1"]),
        ("data/run.bag", ["run"]),
        ("data/MH*", ["mh_01", "mh_02"]),
        ("'data/**/mav0'", ["mh_01", "mh_02", "v1"]),
        ("[data/V1, data/MH_02]", ["v1", "mh_02"]),
        ("{path: data/V1, name: other}", ["other"]),
        ("[data/V1, {path: data/V1, name: again, rate_hz: 10}]", ["v1", "again"]),
    ],
)
def test_a_source_is_a_path_a_pattern_or_a_list_of_either_from_the_suites_folder(suite, tmp_path, source, names):
    cases = suite(source).cases
    assert [case.name for case in cases] == names
    assert all(case.source.path.startswith(str(tmp_path / "data")) for case in cases)
    assert [case.variant for case in cases] == [{"source": name} for name in names]
    assert [case.entry for case in cases] == sorted(case.entry for case in cases)


def test_files_beside_a_recording_are_found_from_the_suites_folder_too(suite, tmp_path):
    (case,) = suite("{path: data/V1, calibration: chain.yaml, truth: /elsewhere/truth.tum}").cases
    assert case.source.calibration == str(tmp_path / "chain.yaml")
    assert case.source.truth == "/elsewhere/truth.tum"
    assert case.source.imu is None


def test_home_is_found(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "mine").mkdir()
    (case,) = recorded_cases(Source(path="~/mine"), tmp_path / "elsewhere")
    assert case.source.path == str(tmp_path / "mine")


@pytest.mark.parametrize(
    ("source", "sentence"),
    [
        ("data/none", r":2: source: no folder or file at .*/data/none$"),
        (
            "'data/a**'",
            r":2: source: 'data/a\*\*' cannot be searched for \(Invalid pattern.*\)$|no folder or file matches",
        ),
        ("[data/V1, 'data/x*']", r":2: source\.1: no folder or file matches .*/data/x\*$"),
        ("{path: 'data/MH*', name: one}", "2 recordings match 'data/MH\\*', so one name 'one' is not enough"),
        ("[data/V1, data/V1/mav0]", "two cases are called 'v1'; rename one of them: .*/data/V1/mav0"),
        ("{pth: data/V1}", r":2: source\.pth: unknown key. Did you mean 'path'"),
        ("{path: data/V1, rate_hz: 0}", "rate_hz: should be greater than 0"),
        ("{path: data/V1, topics: {lft: /cam0}}", "topics.lft: no topic named 'lft'. Did you mean 'left'"),
    ],
)
def test_what_is_wrong_names_the_place_in_the_suite(suite, source, sentence):
    with pytest.raises(SuiteError, match=sentence):
        suite(source)


def test_a_pattern_may_not_match_too_many_files(suite, tmp_path, monkeypatch):
    monkeypatch.setattr("vobench.suite.source.MOST_MATCHES", 3)
    assert len(suite("'data/[MV]*'").cases) == 3
    with pytest.raises(SuiteError, match=r":2: source: more than 3 files and folders match 'data/\*'$"):
        suite("'data/*'")


def test_a_suite_has_all_axes_or_a_source_alone(suite):
    said = "scenes: this key is missing; a suite needs scenes, or only scenarios or a source"
    with pytest.raises(SuiteError, match=said):
        suite("data/V1", "rigs: {down: {pitch_deg: 90}}\n")


def test_a_scene_without_rigs_and_trajectories_gets_a_rig_and_a_way_round(suite):
    plan = suite("data/V1", "scenes: [room]\n")
    assert [case.name for case in plan.cases] == ["found", "v1"]
    case = plan.simulated[0]
    assert case.rig.pitch_deg == 10
    positions_m = case.trajectory.motion().at(np.array([0])).T_world_body[:, :3, 3]
    assert positions_m[0, 2] == 0


def test_recordings_stand_beside_simulated_cases(suite):
    plan = suite(
        "data/V1",
        "scenes: [room]\nrigs: {down: {pitch_deg: 90}}\ntrajectories: {short: {targets_m: [[0.5, 0]]}}\n",
    )
    assert [case.name for case in plan.cases] == ["short", "v1"]
    assert [run.case.name for case in plan.cases for run in plan.trials(case)] == ["short", "v1"]


def test_only_estimators_that_are_not_deterministic_are_repeated_on_recordings(suite):
    plan = suite("data/V1", "repeats: 3\n")
    (case,) = plan.cases
    entry = plan.estimator_entries[0]
    random = replace(entry, manifest=replace(entry.manifest, deterministic=False))
    assert [trial.repeat for trial in plan.trials(case)] == [0, 1]
    assert [trial.repeat for trial in replace(plan, estimator_entries=(random,)).trials(case)] == [0, 1, 2]


def test_a_recording_may_not_take_a_simulated_cases_name(suite):
    with pytest.raises(SuiteError, match="two cases are called 'v1'"):
        suite(
            "data/V1",
            "scenes: [room]\nrigs: {down: {pitch_deg: 90}}\ntrajectories: {v1: {targets_m: [[0.5, 0]]}}\n",
        )


@pytest.mark.parametrize(("called", "name"), [("Ünïcode (1)", "n_code_1"), ("...", "recording"), ("00", "00")])
def test_any_folder_has_a_name_that_is_fit_for_a_case(tmp_path, called, name):
    path = tmp_path / called if called != "..." else tmp_path / "_._"
    path.mkdir()
    assert case_name(path) == name


def test_one_path_is_a_list_of_one():
    assert as_sources("a") == as_sources(("a",)) == as_sources({"path": "a"}) == ({"path": "a"},)
