"""Questions from Python reach the analysis with the trial, the folders and the options that they name."""

from pathlib import Path

import pytest

import vobench
from vobench.analysis import explain_recording, explain_trial, realism_report, recording_twin, run_causes, shrink_trial
from vobench.errors import InputError
from vobench.notebook.questions import _trial_path
from vobench.report.page import write_reports


@pytest.fixture
def asked(monkeypatch):
    """The arguments with which a function of the analysis is called."""

    def listen(module, name):
        calls = []
        monkeypatch.setattr(module, name, lambda *given, **options: calls.append((given, options)))
        return calls

    return listen


def test_a_trial_is_named_by_a_path_or_by_a_run_with_case_and_estimator(ran):
    run = vobench.read_run(ran)
    assert _trial_path("runs/x/case/a", None, None, 0) == Path("runs/x/case/a")
    assert _trial_path("runs/x", "case", "a", 2) == Path("runs/x/case/a/2")
    assert _trial_path(run, "case", "a", 0) == run.path / "case" / "a" / "0"
    with pytest.raises(InputError, match=r"name a trial by its case and its estimator, as in explain\(run, case, est"):
        _trial_path(run, None, None, 0)
    for case, estimator in (("case", None), (None, "a")):
        with pytest.raises(InputError, match="name a trial by both its case and its estimator"):
            _trial_path("runs/x", case, estimator, 0)


def test_explain_asks_for_a_trial_and_a_number_of_seeds(asked):
    calls = asked(explain_trial, "explain_trial")
    vobench.explain("runs/x", "case", "a", repeat=1, repeats=5, out="there", quiet=True)
    ((path,), options) = calls[0]
    assert path == Path("runs/x/case/a/1")
    assert options["repeats"] == 5
    assert callable(options["run_plan"])


def test_shrink_writes_to_a_folder_only_where_one_is_named(asked):
    calls = asked(shrink_trial, "shrink_trial")
    vobench.shrink("runs/x/case/a", trials=4)
    vobench.shrink("runs/x/case/a", folder="small")
    assert [given for given, _ in calls] == [(Path("runs/x/case/a"),)] * 2
    assert [options["trials"] for _, options in calls] == [4, 12]
    assert [options["folder"] for _, options in calls] == [None, Path("small")]


def test_causes_takes_a_run_in_any_form(asked, ran):
    calls = asked(run_causes, "find_causes")
    vobench.causes(vobench.read_run(ran), estimator="a")
    vobench.causes("runs/x")
    assert calls == [((vobench.read_run(ran).path,), {"estimator": "a"}), ((Path("runs/x"),), {"estimator": None})]


def test_realism_compares_with_another_recording_where_one_is_named(asked):
    calls = asked(realism_report, "measure_realism")
    vobench.realism("street", form="kitti")
    vobench.realism("street", against="twin")
    assert calls == [
        ((Path("street"),), {"against": None, "domain": "car", "form": "kitti"}),
        ((Path("street"),), {"against": Path("twin"), "domain": "car", "form": None}),
    ]


def test_an_explanation_of_a_recording_has_its_folder(asked, monkeypatch):
    from vobench.notebook import questions

    plans = []
    monkeypatch.setattr(questions, "plan_runner", lambda **options: plans.append(options))
    calls = asked(explain_recording, "explain_recording")
    vobench.explain_recording("street", estimate="mine.tum", out="why", quiet=True)
    ((path,), options) = calls[0]
    assert (path, options["estimate"], options["estimator"]) == (Path("street"), Path("mine.tum"), None)
    assert (options["out"], plans[0]["out"]) == (Path("why"), Path("why/runs"))


def test_a_twin_is_made_in_its_folder_with_reports_of_its_runs(asked, monkeypatch):
    from vobench.notebook import questions

    plans = []
    monkeypatch.setattr(questions, "plan_runner", lambda **options: plans.append(options))
    calls = asked(recording_twin, "make_twin")
    vobench.twin("street", estimators="a", out="pair", jobs=2, quiet=True)
    ((path,), options) = calls[0]
    assert (path, options["out"], options["place"], options["estimators"]) == (
        Path("street"),
        Path("pair"),
        "recorded",
        ["a"],
    )
    assert (plans[0]["out"], plans[0]["jobs"], plans[0]["finish"]) == (Path("pair/runs"), 2, write_reports)
    asked(explain_trial, "explain_trial")
    vobench.explain("runs/x/case/a", out="runs")
    assert plans[1]["finish"] is None
    vobench.twin("street")
    assert [plan["make_display"].keywords["is_quiet"] for plan in plans] == [True, False, False]
    assert plans[2]["out"] == Path("twin/runs")


def test_the_suite_of_a_twin_is_compared_as_it_is(asked, monkeypatch):
    from vobench.errors import InputError
    from vobench.notebook import questions

    plans = []
    monkeypatch.setattr(questions, "plan_runner", lambda **options: plans.append(options))
    read = asked(recording_twin, "read_twin_suite")
    compared = asked(recording_twin, "compare_twin")
    vobench.twin(report="pair", quiet=True)
    assert [path for ((path,), _) in read] == [Path("pair")]
    assert plans[0]["out"] == Path("pair/runs")
    assert len(compared) == 1
    with pytest.raises(InputError, match="name either a recording, or the folder of a twin"):
        vobench.twin()


def test_drives_of_a_suite_are_those_of_its_trajectories(here):
    driven = vobench.drive("tiny", trajectory="short")
    assert [drive.name for drive in driven.drives] == ["short"]
