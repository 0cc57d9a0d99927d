"""Ctrl-C and SIGTERM: one sentence and 130 or 143 wherever a run is, nothing left behind, and the run goes on later."""

import os
import pkgutil
import random
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from vobench import stop
from vobench.runner import motion

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI

SENTENCE = "vobench: stopped; completed stages are cached, run the same command again to resume"
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
    "runner.motion": "body_motion",
    "rendering.bake": "bake",
    "rendering.raster.RasterRenderer": "radiance",
    "estimator.process.EstimatorProcess": "process",
    "runner.score": "score_trial",
    "report.page": "board_page",
    "runner.folder.RunFolder": "estimate",
    "cli.board": "print_board",
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
        lines = []
        for line in process.stderr:
            if line.strip().endswith(until):
                return process
            lines.append(line)
        raise AssertionError(f"exit code {process.wait()} after it printed:\n{''.join(lines)}")

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


# Runs the command that it is given; whoever the command started and left behind becomes its child.
KEEPER = """
import ctypes, subprocess, sys, time
ctypes.CDLL(None).prctl(36, 1, 0, 0, 0)
print(subprocess.Popen(sys.argv[1:]).pid, flush=True)
time.sleep(3600)
"""
GONE_S = 2.0


@dataclass
class Kept:
    """A vobench whose processes are all below one that we know, dead or alive."""

    keeper: subprocess.Popen
    pid: int

    def alive(self) -> list[int]:
        """The processes that vobench has started, and vobench itself."""
        children = dict[int, list[int]]()
        for path in Path("/proc").glob("[0-9]*/stat"):
            fields = read(path).rpartition(")")[2].split()
            if fields and fields[0] not in "ZX":
                children.setdefault(int(fields[1]), []).append(int(path.parent.name))
        found = list(children.get(self.keeper.pid, []))
        for pid in found:  # which grows
            found += children.get(pid, [])
        return found

    def ended_within(self, seconds: float) -> list[int]:
        """Who is alive after so many seconds at most."""
        until_s = time.monotonic() + seconds
        while (alive := self.alive()) and time.monotonic() < until_s:
            time.sleep(0.02)
        return alive


@pytest.fixture
def kept(here, monkeypatch):
    """Starts vobench with two jobs under a process that adopts its orphans, with a TMPDIR of its own."""
    keepers = []
    (here / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(here / "tmp"))

    def start(*words):
        command = [sys.executable, "-c", "from vobench.cli import main; main()", "run", "tiny", "-j", "2", *words]
        with (here / "log.txt").open("wb") as log:
            keeper = subprocess.Popen(
                [sys.executable, "-c", KEEPER, *command], stdout=subprocess.PIPE, stderr=log, text=True
            )
        keepers.append(keeper)
        return Kept(keeper, int(keeper.stdout.readline()))

    yield start
    for keeper in keepers:
        for pid in Kept(keeper, 0).alive():
            os.kill(pid, signal.SIGKILL)
        keeper.kill()
        keeper.communicate()


def hanging_in(here: Path) -> Path:
    """The folder of an estimator that hangs, and starts a process that would go on for an hour."""
    plug = here / "estimators" / "hanging"
    plug.mkdir(parents=True)
    (plug / "estimator.yaml").write_text(
        "name: hanging\nversion: '1'\nclass: estimator:Hanging\npose_of: body\nsummary: Hangs\n"
        "limits: {frame_s: 3600}\n"
    )
    (plug / "estimator.py").write_text(HANGING_FOR_EVER)
    return plug


HANGING_FOR_EVER = """
import subprocess, sys, time
class Hanging:
    def start(self, rig, params, seed): ...
    def process(self, frame):
        subprocess.Popen(["sleep", "3600"], start_new_session=True)
        print("hangs", file=sys.stderr, flush=True)
        time.sleep(100_000)
"""


def await_hanging(here: Path) -> None:
    until_s = time.monotonic() + 120
    while not any("hangs" in read(log) for log in (here / "cache").glob("estimates/.unfinished-*/log.txt")):
        assert time.monotonic() < until_s, read(here / "log.txt")
        time.sleep(0.05)


def test_nobody_outlives_a_killed_vobench_with_two_jobs(kept, here):
    hanging_in(here)
    run = kept("-e", "hanging")
    await_hanging(here)
    assert len(run.alive()) > 4  # vobench, the fork server, a worker, the guard, the estimator
    os.kill(run.pid, signal.SIGKILL)
    assert run.ended_within(GONE_S) == []


def test_a_stop_with_two_jobs_takes_two_seconds_at_most_and_leaves_nothing(kept, here):
    hanging_in(here)
    run = kept("-e", "hanging")
    await_hanging(here)
    os.kill(run.pid, signal.SIGTERM)
    assert run.ended_within(GONE_S) == []
    assert SENTENCE in read(here / "log.txt")
    assert list((here / "tmp").iterdir()) == []
    assert left_behind(here) == []


def test_killed_at_any_moment_with_two_jobs_nobody_lives_on_and_the_same_command_resumes(kept, here):
    def hashes():
        return (here / "runs" / "tiny" / "latest" / "hashes.json").read_bytes()

    began = time.monotonic()
    assert kept().ended_within(120) == []
    whole_s = time.monotonic() - began
    whole = hashes()
    dice = random.Random(1)
    for _ in range(3):
        for name in ("cache", "runs"):
            shutil.rmtree(here / name)
        run = kept()
        time.sleep(dice.uniform(0.2, whole_s))
        os.kill(run.pid, signal.SIGKILL)
        assert run.ended_within(GONE_S) == []
        assert kept().ended_within(120) == []
        assert hashes() == whole
        assert left_behind(here) == []
        assert list((here / "tmp").iterdir()) == []


def test_a_command_that_vobench_runs_ends_with_it_when_it_is_killed(tmp_path):
    pid_file = tmp_path / "pid"
    code = f"from vobench import stop; stop.run(['sh', '-c', 'echo $$ > {pid_file}; exec sleep 3600'])"
    process = subprocess.Popen([sys.executable, "-c", code])
    while not read(pid_file).endswith("\n"):
        assert process.poll() is None
        time.sleep(0.01)
    process.kill()
    process.wait()
    stat, until_s = Path(f"/proc/{read(pid_file).strip()}/stat"), time.monotonic() + GONE_S
    while read(stat).rpartition(")")[2].split()[:1] not in ([], ["Z"]):
        assert time.monotonic() < until_s
        time.sleep(0.01)


def test_what_is_left_of_a_folder_that_was_being_filled_is_never_published(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "half").write_text("")
    with stop.cleanup_after(lambda: stop.remove(folder)):
        stop.clean_up_all()  # by the thread that watches
        assert list(tmp_path.iterdir()) == []
        with pytest.raises(FileNotFoundError):
            folder.rename(tmp_path / "final")


def test_the_latest_is_undone_first_but_processes_before_all():
    order = []
    with (
        stop.cleanup_after(lambda: order.append("folder")),
        stop.cleanup_after(lambda: order.append("process"), is_awaited=True),
        stop.cleanup_after(lambda: order.append("file")),
    ):
        stop.clean_up_all()
        assert order == ["process", "file", "process", "folder"]
