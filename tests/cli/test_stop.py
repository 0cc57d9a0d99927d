"""Ctrl-C and SIGTERM: one sentence and 130 or 143 wherever a run is, nothing left behind, and the run goes on later."""

import os
import pkgutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from vobench import stop
from vobench.runner import motion

SENTENCE = "vobench: stopped; finished stages are kept, the same command goes on from there"
HANGING = """
import os, time
class Hanging:
    def start(self, rig, params, seed): ...
    def process(self, frame):
        print("hanging", flush=True)
        time.sleep(600)
"""
SCRIPT = """
import sys, time
import pytest
from conftest import make_cheap
from vobench import cli
from vobench.runner import simulate
def sleep(case, folder, **_):
    (folder / "begun").write_text("")
    print("asleep", file=sys.stderr, flush=True)
    time.sleep(600)
with pytest.MonkeyPatch.context() as patch:
    make_cheap(patch)
    if "asleep" in sys.argv:
        sys.argv.remove("asleep")
        simulate.simulate = sleep
    if "patient" in sys.argv:
        sys.argv.remove("patient")
        cli.GRACE_S = 3600
    cli.main()
"""


def interrupting(function, number=signal.SIGINT):
    """The same function, before which Ctrl-C is pressed once."""
    presses = iter([number])

    def interrupted(*args, **options):
        for press in presses:
            signal.raise_signal(press)
        return function(*args, **options)

    return interrupted


def children():
    """The processes, dead ones included, that this one has started."""
    stats = [read(path).rpartition(")")[2].split() for path in Path("/proc").glob("[0-9]*/stat")]
    return [fields for fields in stats if fields[1:2] == [str(os.getpid())]]


def read(path):
    try:
        return path.read_text()
    except OSError:  # a process that has just ended
        return ""


def left_behind(folder):
    return [path for path in folder.rglob("*") if path.name.startswith(".") or "-gone" in path.name]


PLACES = {
    "run.motion": "body_motion",
    "render.bake": "bake",
    "render.raster.RasterRenderer": "radiance",
    "estimator.process.EstimatorProcess": "process",
    "run.score": "score_trial",
    "report.page": "html",
    "run.folder.RunFolder": "estimate",
    "cli.report": "print_board",
}


@pytest.mark.parametrize(("owner", "name"), PLACES.items(), ids=PLACES.values())
def test_wherever_a_run_is_stopped_it_says_one_sentence_and_goes_on_later(vobench, here, monkeypatch, owner, name):
    number = signal.SIGTERM if name in {"bake", "process"} else signal.SIGINT
    place, before = pkgutil.resolve_name(f"vobench.{owner}"), children()
    with monkeypatch.context() as patch:
        patch.setattr(place, name, interrupting(getattr(place, name), number))
        said = vobench("run", "tiny")
    assert said.code == 128 + number
    assert said.err.splitlines()[-1] == SENTENCE
    assert said.err.count("vobench: ") == 1
    assert "Traceback" not in said.err
    assert left_behind(here) == []
    assert children() == before
    assert vobench("run", "tiny").code == 0


def test_an_error_that_comes_of_a_stop_is_not_said_as_well(vobench, here, monkeypatch):
    def failing(_):
        signal.raise_signal(signal.SIGINT)
        raise OSError("a library's own words")

    monkeypatch.setattr(motion, "body_motion", failing)
    assert vobench("run", "tiny").err == f"{SENTENCE}\n"
    said = vobench("run", "tiny", "--json")
    assert (said.code, said.json["error"], said.err) == (130, SENTENCE.removeprefix("vobench: "), f"{SENTENCE}\n")


@pytest.fixture
def started(here):
    """Starts `vobench run` as a process of its own, and reads what it says up to a line that ends so."""
    running = []

    def start(*words, until):
        search = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
        command = [sys.executable, "-c", SCRIPT, "run", "tiny", *words]
        environment = os.environ | {"PYTHONPATH": search}
        process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        running.append(process)
        for line in process.stderr:
            if line.strip().endswith(until):
                return process
        raise AssertionError(process.wait())

    yield start
    for process in running:
        process.kill()
        process.communicate()


def said(cmdline: Path) -> bytes:
    try:
        return cmdline.read_bytes()
    except OSError:
        return b""


def test_an_estimator_that_hangs_is_no_reason_to_wait_and_goes_with_the_run(started, here):
    plug = here / "estimators" / "hanging"
    plug.mkdir(parents=True)
    (plug / "estimator.yaml").write_text(
        "name: hanging\nversion: '1'\nclass: estimator:Hanging\npose_of: body\nsummary: Hangs\n"
    )
    (plug / "estimator.py").write_text(HANGING)
    process = started("-e", "hanging", until="frames")  # of the simulation
    assert "hanging on short" in process.stderr.readline()
    while not any("hanging" in read(log) for log in here.glob("cache/estimates/.unfinished-*/log.txt")):
        assert process.poll() is None
    process.terminate()
    assert process.communicate() == ("", f"{SENTENCE}\n")
    assert process.returncode == 143
    assert not [path for path in Path("/proc").glob("[0-9]*/cmdline") if str(plug).encode() in said(path)]
    assert left_behind(here) == []


@pytest.mark.parametrize("grace", [(), ("patient",)], ids=["after a grace", "by a second"])
def test_what_looks_at_no_flag_is_ended_after_a_grace_or_by_a_second_ctrl_c(started, here, grace):
    process = started("asleep", *grace, until="asleep")
    assert list((here / "cache").glob("sequences/.unfinished-*/begun"))
    process.send_signal(signal.SIGINT)
    while grace and process.poll() is None:  # two at once are one to the kernel
        process.send_signal(signal.SIGINT)
        time.sleep(0.05)
    assert process.communicate() == ("", f"{SENTENCE}\n")
    assert process.returncode == 130
    assert left_behind(here) == []


def test_what_is_left_of_a_folder_that_was_being_filled_is_never_published(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "half").write_text("")
    with stop.undone(lambda: stop.remove(folder)):
        stop.undo_all()  # by the thread that watches
        assert list(tmp_path.iterdir()) == []
        with pytest.raises(FileNotFoundError):
            folder.rename(tmp_path / "final")


def test_the_latest_is_undone_first_but_processes_before_all():
    order = []
    with (
        stop.undone(lambda: order.append("folder")),
        stop.undone(lambda: order.append("process"), is_awaited=True),
        stop.undone(lambda: order.append("file")),
    ):
        stop.undo_all()
        assert order == ["process", "file", "process", "folder"]
