"""vobench cache, as it is typed; what a damaged cache comes to in a run."""

import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from vobench.cli.cache import DAY_S, _cells, _facts
from vobench.runner.store import GB

KINDS = {"bakes": 1, "sequences": 1, "estimates": 2, "scores": 2}


def counts(said):
    return {kind["kind"]: kind["count"] for kind in said.json["kinds"] if kind["kind"] != "modules"}


def test_ls_says_what_is_kept_and_gc_makes_it_smaller(vobench, here):
    assert vobench("run", "tiny").code == 0
    assert counts(vobench("cache", "ls", "--json")) == KINDS
    assert "sequences" in vobench("cache").out
    assert counts(vobench("cache", "gc", "--json")) == KINDS
    assert counts(vobench("cache", "gc", "--older", "1", "--json")) == KINDS
    said = vobench("cache", "gc", "--keep-gb", "0", "--json")
    assert said.json["removed"]["count"] >= sum(KINDS.values())
    assert said.json["kinds"] == []
    assert vobench("cache", "gc").out.splitlines()[-1] == "removed 0 entries of 0 GB"
    assert vobench("run", "tiny").code == 0


def test_verify_names_what_is_damaged_and_the_next_run_mends_it_with_a_sentence(vobench, here):
    assert vobench("run", "tiny").code == 0
    assert vobench("cache", "verify").out == f"6 of 6 entries unchanged: {here / 'cache'}\n"
    estimate = next((here / "cache" / "estimates").glob("*/estimate.tum"))
    right = estimate.read_bytes()
    estimate.write_bytes(right[: len(right) // 2])
    said = vobench("cache", "verify")
    assert said.code == 1
    assert f"estimate.tum has {len(right) // 2} bytes, should have {len(right)}: {estimate.parent}" in said.out
    assert vobench("cache", "verify", "--json").json["wrong"][0]["path"] == str(estimate.parent)
    said = vobench("run", "tiny")
    assert said.code == 0
    (sentence,) = [line for line in said.err.splitlines() if "damaged" in line]
    assert sentence.startswith("vobench: a damaged result is computed again, because estimate.tum has ")
    assert estimate.read_bytes() == right
    assert vobench("cache", "verify").code == 0


def test_options_of_another_action_and_unknown_actions_are_refused(vobench):
    assert vobench("cache", "ls", "--older", "3").err == "vobench: --keep-gb and --older require gc, not ls\n"
    assert "no action named 'lss'. Did you mean 'ls'?" in vobench("cache", "lss").err


TWICE = """
import os, sys
import pytest
from conftest import make_cheap
from vobench import cli
from vobench.runner import task
def counted(stage, perform):
    def performed(*args):
        with open("made", "a") as file:
            file.write(stage + "\\n")
        perform(*args)
    return performed
task.PERFORMERS.update({stage: counted(stage, perform) for stage, perform in task.PERFORMERS.items()})
with pytest.MonkeyPatch.context() as patch:
    make_cheap(patch)
    sys.stdin.readline()
    cli.main()
"""


@pytest.mark.slow
def test_two_runs_at_once_on_one_empty_cache_make_nothing_twice(here):
    search = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    command, environment = [sys.executable, "-c", TWICE, "run", "tiny"], os.environ | {"PYTHONPATH": search}
    runs = [subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, text=True) for _ in range(2)]
    for run in runs:
        run.stdin.write("go\n")
        run.stdin.flush()
    for run in runs:
        run.communicate()
        assert run.returncode == 0
    made = (here / "made").read_text().split()
    assert {stage: made.count(stage) for stage in made} == {"bake": 1, "sequence": 1, "estimate": 2, "score": 2}
    assert len(list((here / "runs" / "tiny").glob("2*"))) == 2


def test_facts_are_of_the_oldest_and_of_the_last_used_entry():
    now_s = time.time()
    entries = [
        SimpleNamespace(made_s=now_s - 3 * DAY_S, used_s=now_s - 2 * DAY_S, bytes=10, is_damaged=False),
        SimpleNamespace(made_s=now_s - 5 * DAY_S, used_s=now_s - 1 * DAY_S, bytes=20, is_damaged=True),
    ]
    facts = _facts("light", entries)
    assert (facts["count"], facts["damaged"], facts["bytes"]) == (2, 1, 30)
    assert facts["oldest_days"] == pytest.approx(5, abs=0.01)
    assert facts["used_days"] == pytest.approx(1, abs=0.01)
    assert _cells({**facts, "bytes": 2.5 * GB}) == ["light", "2", "1", "2.5", "5.0", "1.0"]
