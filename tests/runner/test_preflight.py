"""What is known of a plan before anything is made."""

import pytest

from vobench.dataset.export import export
from vobench.errors import SuiteError
from vobench.runner import preflight
from vobench.runner.folder import SEQUENCE
from vobench.runner.preflight import IN_CACHE, TO_SIMULATE, summarize
from vobench.sequence import Sequence
from vobench.suite.suite import read_plan


@pytest.fixture
def empty_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("VOBENCH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_a_summary_counts_frames_and_trials_and_makes_nothing(bench, empty_cache):
    planned = bench.plan()
    summary = summarize(planned)
    assert [case.case for case in summary.cases] == [case.name for case in planned.cases]
    assert all(case.frames > 1 and case.duration_s > 0 for case in summary.cases)
    assert {case.sequence for case in summary.cases} == {TO_SIMULATE}
    assert summary.trials == len(planned.cases) * len(planned.estimator_entries) * planned.suite.repeats
    assert not (empty_cache / "sequences").exists()


def test_stages_are_counted_only_where_they_are_asked_for(bench, empty_cache):
    assert "tasks" not in summarize(bench.plan()).as_dict()
    stages = {row["stage"]: row for row in summarize(bench.plan(), with_stages=True).as_dict()["tasks"]}
    assert stages["sequence"]["to do"] == stages["sequence"]["tasks"] > 0
    assert stages["sequence"][IN_CACHE] == 0


def test_a_case_that_has_been_made_is_in_the_cache(bench, first, monkeypatch):
    monkeypatch.setenv("VOBENCH_CACHE", str(bench.folder / "cache"))
    assert {case.sequence for case in summarize(bench.plan()).cases} == {IN_CACHE}


def test_a_recording_is_to_be_imported_and_has_its_own_frames_and_notes(first, empty_cache, tmp_path):
    sequence = (first.case("full") / SEQUENCE).resolve()
    recording = tmp_path / "kitti"
    export(sequence, recording, "kitti")
    suite = tmp_path / "real.yaml"
    suite.write_text("name: real\nsource: kitti\nestimators: [stand_still]\n")
    (case,) = summarize(read_plan(str(suite))).cases
    assert case.sequence == f"to import from {recording}"
    assert case.frames == len(Sequence.open(sequence))
    assert not case.simulated
    assert any("left grey camera" in note for note in case.notes)


def test_a_traced_case_is_planned_without_any_light(bench, empty_cache):
    traced = bench.plan(("seed: 1", "seed: 1\nrendering: {engine: path}"))
    assert {case.sequence for case in summarize(traced).cases} == {TO_SIMULATE}


def test_all_that_cannot_be_driven_is_said_at_once(bench, empty_cache):
    changed = bench.plan(("targets_m: [[0.3, 0]]", "targets_m: [[30, 0]]"))
    with pytest.raises(SuiteError, match=r"wall|room|runs into"):
        preflight.preflight(changed)
