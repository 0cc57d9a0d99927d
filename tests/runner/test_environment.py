"""Where figures come from: what a processor is called, what is recorded beside a result, and what differs."""

import json
import os
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from vobench.portable import PORTABLE
from vobench.runner import environment as environments
from vobench.runner.environment import (
    MADE_ON,
    UNKNOWN,
    Environment,
    Origin,
    Processor,
    differences,
    joined,
    merged_environment,
    origin_here,
    parse_cpuinfo,
    processor,
    read_environment,
    read_origin,
)
from vobench.runner.folder import ENVIRONMENT, RunFolder
from vobench.runner.store import write_json
from vobench.runner.task import plan

V3_FLAGS = "abm avx avx2 bmi1 bmi2 cx16 f16c fma lahf_lm movbe pni popcnt sse4_1 sse4_2 ssse3 xsave"
V4_FLAGS = f"{V3_FLAGS} avx512bw avx512cd avx512dq avx512f avx512vl"


def x86(flags, model="AMD EPYC 7B13"):
    return f"processor : 0\ncpu family : 25\nmodel : 1\nmodel name : {model}\nflags : {flags}\n\nprocessor : 1\n"


@pytest.mark.parametrize(
    ("flags", "level"),
    [
        (V4_FLAGS, "x86-64-v4"),
        (V3_FLAGS, "x86-64-v3"),
        (V4_FLAGS.replace(" fma", ""), "x86-64-v2"),
        ("sse2", "x86-64-v1"),
        ("", UNKNOWN),
    ],
)
def test_the_level_of_a_processor_is_the_highest_whose_flags_it_has_all_of(flags, level):
    assert parse_cpuinfo(x86(flags), "x86_64").simd == level


def test_a_processor_is_its_model_and_the_numbers_that_tell_models_of_one_name_apart():
    assert parse_cpuinfo(x86(V3_FLAGS), "x86_64") == Processor("AMD EPYC 7B13, family 25, model 1", "x86-64-v3")


def test_an_arm_processor_is_named_by_its_numbers():
    text = "processor : 0\nFeatures : fp asimd sve\nCPU implementer : 0x41\nCPU part : 0xd40\n"
    assert parse_cpuinfo(text, "aarch64") == Processor("Arm implementer 0x41, part 0xd40", "SVE")


def test_without_cpuinfo_the_instruction_set_is_unknown():
    assert parse_cpuinfo("", "arm64", fallback="arm") == Processor("arm", UNKNOWN)
    assert parse_cpuinfo("", "x86_64") == Processor(UNKNOWN, UNKNOWN)


def test_the_processor_of_this_machine_is_the_one_that_linux_names():
    assert processor().model.split(",")[0] in Path("/proc/cpuinfo").read_text()


def test_a_result_carries_the_origins_of_all_that_it_was_made_from(tmp_path):
    elsewhere = Processor("another", "x86-64-v3")
    made = {"processors": [{"model": elsewhere.model, "simd": elsewhere.simd}], "drawn_by": ["a driver"]}
    (tmp_path / MADE_ON).write_text(json.dumps(made))
    origin = origin_here([tmp_path, tmp_path / "of an older vobench"])
    assert set(origin.processors) == {elsewhere, processor()}
    assert origin.drawn_by == ("a driver",)


def test_joining_origins_depends_neither_on_order_nor_on_repetition():
    one = Origin((Processor("a", "x"),), ("driver",))
    other = Origin((Processor("b", "y"),), ())
    assert joined([one, other, one]) == joined([other, one])


def test_the_line_names_everything_that_changes_scores_and_leaves_out_what_is_unknown():
    stated = Environment(
        vobench="1.0",
        commit="abc+changes",
        python="3.12.1",
        processors=(Processor("a", "x86-64-v3"),),
        cores=2,
        cores_total=8,
        drawn_by=("llvmpipe",),
        libraries={"numpy": "2.4", "pandas": "3.0"},
        date="2026-11-24",
    )
    assert stated.line() == (
        "a (x86-64-v3), 2 of 8 cores, drawn by llvmpipe, vobench 1.0 (abc+changes), Python 3.12.1, numpy 2.4, "
        "2026-11-24"
    )
    assert Environment().line() == ""


def test_only_what_can_change_scores_is_a_difference_and_both_values_are_named():
    old = Environment(
        vobench="1.0", processors=(Processor("a", "v3"),), drawn_by=("x",), libraries={"numpy": "2.3", "pandas": "2"}
    )
    new = replace(old, processors=(Processor("a", "v4"),), libraries={"numpy": "2.4", "pandas": "3"}, vobench="1.1")
    assert differences(old, old) == []
    assert differences(old, Environment()) == []  # unknown is no difference
    assert differences(old, new) == ["processor a (v3) → a (v4)", "numpy 2.3 → 2.4"]


def test_merged_runs_name_all_processors_and_both_versions():
    one = Environment(vobench="1.0", processors=(Processor("a", "v3"),), libraries={"numpy": "2.3"})
    other = Environment(vobench="1.0", processors=(Processor("b", "v4"),), libraries={"numpy": "2.4"})
    stated = merged_environment([one, other])
    assert [each["model"] for each in stated["processors"]] == ["a", "b"]
    assert (stated["vobench"], stated["libraries"]) == ("1.0", {"numpy": "2.3 and 2.4"})


def test_a_run_states_where_its_figures_come_from_and_the_date_is_that_of_its_name(first):
    stated = read_environment(first)
    assert stated.processors == (processor(),)
    assert stated.cores == len(os.sched_getaffinity(0))
    assert all(driver and driver != UNKNOWN for driver in stated.drawn_by)
    assert len(stated.drawn_by) == 1
    assert stated.date.replace("-", "") == first.path.name[:8]
    assert "date" not in json.loads((first.path / ENVIRONMENT).read_text())
    for case in ("full", "dim"):
        assert read_origin((first.case(case) / "sequence").resolve()).drawn_by == stated.drawn_by


def test_the_environment_of_an_older_run_is_read_as_far_as_it_goes(tmp_path):
    folder = RunFolder(tmp_path)
    assert read_environment(folder) is None
    write_json(tmp_path / ENVIRONMENT, {"vobench": "0.1", "python": "3.11.2", "platform": "Linux", "libraries": {}})
    assert read_environment(folder) == Environment(vobench="0.1", python="3.11.2", platform="Linux")


def test_a_clone_is_named_by_its_commit_and_by_whether_its_files_differ(tmp_path, monkeypatch):
    def git(*words):
        identity = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
        subprocess.run(["git", "-C", tmp_path, *identity, *words], check=True, capture_output=True)

    monkeypatch.setattr(environments, "PACKAGE", tmp_path / "vobench")
    assert environments.commit.__wrapped__() == ""
    (tmp_path / "vobench").mkdir()
    (tmp_path / "vobench" / "a.py").write_text("a = 1\n")
    git("init")
    git("add", ".")
    git("commit", "-m", "first")
    named = environments.commit.__wrapped__()
    assert len(named) == 10
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "board.md").write_text("no part of a result\n")
    assert environments.commit.__wrapped__() == named
    (tmp_path / "estimators" / "mine").mkdir(parents=True)
    (tmp_path / "estimators" / "mine" / "estimator.py").write_text("a user's own\n")
    assert environments.commit.__wrapped__() == named
    (tmp_path / "vobench" / "b.py").write_text("b = 1\n")
    assert environments.commit.__wrapped__() == f"{named}+changes"
    (tmp_path / "vobench" / "b.py").unlink()
    (tmp_path / "vobench" / "a.py").write_text("a = 2\n")
    assert environments.commit.__wrapped__() == f"{named}+changes"


def test_a_git_that_fails_names_nothing_whatever_it_prints(tmp_path, monkeypatch):
    (tmp_path / ".git").mkdir()
    git = tmp_path / "git"
    git.write_text("#!/bin/sh\necho 0123456789\nexit 1\n")
    git.chmod(0o755)
    monkeypatch.setattr(environments, "PACKAGE", tmp_path / "vobench")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert environments.commit.__wrapped__() == ""


def test_a_release_has_its_version_and_its_commit_if_there_is_one():
    assert Environment(vobench="1.2", commit="abc").release == "vobench 1.2 (abc)"
    assert Environment(vobench="1.2").release == "vobench 1.2"


def test_portable_results_have_keys_of_their_own(bench, monkeypatch):
    def keys():
        return {task.key for task in plan(bench.plan(), {})}

    monkeypatch.delenv(PORTABLE, raising=False)
    usual = keys()
    monkeypatch.setenv(PORTABLE, "1")
    assert not usual & keys()
