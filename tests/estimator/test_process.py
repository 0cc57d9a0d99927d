"""An estimator's process: whatever it does, the answer is a checked result or a failure with its status."""

import os
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from vobench.estimator import Frame, Status
from vobench.estimator.manifest import Limits
from vobench.estimator.process import EstimatorProcess
from vobench.estimator.program import LOG_BYTES, EstimatorFailure
from vobench.geometry.rig import LENSES, stereo_rig

# ruff: noqa: E501 - one way to fail is one line


RIG = stereo_rig(LENSES["paper_blender"], pitch_deg=90)
PICTURE = np.zeros((480, 720), np.uint8)
HEAD = """
import os, sys, time
import numpy as np
from vobench.errors import VobenchError
from vobench.estimator import Result, Status, Tracks
I = np.eye(4)
class Own(float): ...
"""


@contextmanager
def running(tmp_path, body, *, start="pass", head="", limits=None):
    """An estimator whose process() is `body`, started."""
    lines = body.replace("\n", "\n        ")
    (tmp_path / "mine.py").write_text(
        f"{head}{HEAD}class Mine:\n    def start(self, rig, params, seed):\n        {start}\n"
        f"    def process(self, frame):\n        {lines}\n"
    )
    limits = limits or Limits(start_s=20, frame_s=10)
    with EstimatorProcess.of_class(
        tmp_path, "mine:Mine", name="mine", log=tmp_path / "log.txt", limits=limits
    ) as process:
        process.start(RIG, {"speed": 2.0}, 7)
        yield process


def frame(index=0, picture=PICTURE):
    return Frame(index, index * 10**8, picture, picture, None)


FAILURES = {
    "raises": ("raise RuntimeError('a\\nb')", "crashed", "RuntimeError: a b"),
    "exits": ("sys.exit(3)", "crashed", "the process ended with exit code 3"),
    "exits in silence": ("os._exit(0)", "invalid_output", "frame 0: it ended, with exit code 0"),
    "segfaults": ("import ctypes; ctypes.string_at(0)", "crashed", "the process ended with signal SIGSEGV"),
    "interrupts itself": ("raise KeyboardInterrupt", "crashed", "the process ended with signal SIGINT"),
    "is killed": ("os.kill(os.getpid(), 9)", "out_of_memory", "killed by the system, most likely for memory"),
    "allocates 10 GB": ("np.ones(10 * 2**27)", "out_of_memory", "MemoryError: Unable to allocate 10.0 GiB"),
    "gives up": ("raise VobenchError('too dark')", "refused", "too dark"),
    "returns None": ("return None", "invalid_output", "frame 0: process() must return a vobench.estimator.Result"),
    "returns a pose": ("return I", "invalid_output", "frame 0: process() must return a vobench.estimator.Result"),
    "NaN": ("return Result(I * np.nan)", "invalid_output", "frame 0: the pose should be a finite (4, 4) array"),
    "3 x 3": ("return Result(np.eye(3))", "invalid_output", "frame 0: the pose should be a finite (4, 4) array, got shape (3, 3)"),
    "scaled": ("return Result(2 * I)", "invalid_output", "frame 0: the pose is not a rigid transform"),
    "mirrored": ("return Result(np.diag([-1, 1, 1, 1]))", "invalid_output", "frame 0: the pose is not a rigid transform"),
    "complex": ("return Result(I * (1 + 0j))", "invalid_output", "frame 0: the pose should be an array of real numbers"),
    "objects": ("return Result(np.array([[None] * 4] * 4))", "invalid_output", "frame 0: the pose should be an array of"),
    "text": ("return Result('here')", "invalid_output", "frame 0: the pose should be an array of real numbers"),
    "status": ("return Result(I, 'fine')", "invalid_output", "frame 0: no status 'fine'. Known: init, ok, stationary"),
    "stats": ("return Result(I, stats=[1])", "invalid_output", "frame 0: stats should be numbers by name, got list"),
    "tracks": ("return Result(I, tracks=Tracks(np.zeros((3, 2)), np.zeros((2, 2)), np.zeros(3, bool)))", "invalid_output", "frame 0: tracks should be (N, 2), (N, 2) and (N,), got (3, 2), (2, 2) and (3,)"),
    "closes its files": ("os.closerange(3, 64); return Result(I)", "crashed", "the process ended with exit code 1"),
    "writes into the connection": ("os.write(4, b'x' * 9)", "invalid_output", "frame 0: it should answer POSE, but says b'xxxx' and 2021161080 bytes"),
}  # fmt: skip


@pytest.mark.parametrize(("body", "kind", "reason"), FAILURES.values(), ids=FAILURES)
def test_every_way_to_fail_has_its_status_and_a_reason_in_one_line(tmp_path, body, kind, reason):
    with running(tmp_path, body) as process, pytest.raises(EstimatorFailure) as failed:
        process.process(frame())
    assert failed.value.kind == kind
    assert failed.value.reason.startswith(reason)
    assert "\n" not in failed.value.reason


@pytest.mark.parametrize(
    ("start", "head", "kind", "reason"),
    [
        ("sys.exit(4)", "", "crashed", "the process ended with exit code 4"),
        ("raise VobenchError('needs equal lenses')", "", "refused", "needs equal lenses"),
        ("pass", "import no_such_library\n", "refused", "estimator 'mine' cannot be imported: ModuleNotFoundError"),
    ],
)
def test_a_failure_before_the_first_frame_is_a_failure_too(tmp_path, start, head, kind, reason):
    with pytest.raises(EstimatorFailure) as failed, running(tmp_path, "...", start=start, head=head):
        pass
    assert failed.value.kind == kind
    assert failed.value.reason.startswith(reason)


def test_one_that_sleeps_is_stopped_at_its_limit(tmp_path):
    began = time.monotonic()
    limits = Limits(start_s=20, frame_s=0.3)
    with running(tmp_path, "time.sleep(600)", limits=limits) as process, pytest.raises(EstimatorFailure) as failed:
        process.process(frame())
    assert (failed.value.kind, failed.value.reason) == ("timeout", "no answer within 0.3 s")
    assert time.monotonic() - began < 60


def test_one_that_starts_processes_takes_them_along_when_it_goes(tmp_path):
    body = "pid = os.fork()\nif pid == 0:\n    time.sleep(600)\nreturn Result(I)"
    with running(tmp_path, body) as process:
        process.process(frame())
        assert len(workers_of(tmp_path)) == 2
    await_end(tmp_path)


def workers_of(folder):
    """The ids of living processes of the estimator in a folder, which their words name."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            words = (place / "cmdline").read_bytes()
            is_dead = (place / "stat").read_text().rpartition(")")[2].split()[0] == "Z"
            if b"vobench.estimator.worker" in words and f"\0{folder}\0".encode() in words and not is_dead:
                found.append(int(place.name))
    return found


def await_end(folder, patience_s=60.0):
    until = time.monotonic() + patience_s
    while workers_of(folder):
        assert time.monotonic() < until
        time.sleep(0.02)


def test_what_it_prints_is_kept_up_to_a_limit_and_what_it_writes_is_gone(tmp_path):
    body = "open('left.txt', 'w').write('x')\nprint(os.getcwd(), flush=True)\nprint('y' * 3_000_000)\nreturn Result(I)"
    with running(tmp_path, body) as process:
        process.process(frame())
    log = (tmp_path / "log.txt").read_text()
    assert LOG_BYTES < len(log) < LOG_BYTES + 200
    assert log.splitlines()[-1].startswith("[vobench: cut here; the estimator printed at least 3000")
    assert not Path(log.splitlines()[0]).exists()


def test_a_result_arrives_in_plain_types_with_numbers_that_are_none_left_out(tmp_path):
    body = "return Result(np.eye(4, dtype=int).tolist(), 'degraded', 'a\\nb', stats={'a': Own(1), 'b': float('nan')})"
    with running(tmp_path, body) as process:
        answer = process.process(frame())
    result = answer.result
    assert result.T_odom_frame.dtype == np.float64
    assert (result.status, result.reason, result.stats) == (Status.DEGRADED, "a b", {"a": 1.0})
    assert type(result.stats["a"]) is float
    assert answer.wall_ms > 0


def test_a_frame_without_a_pose_is_an_answer(tmp_path):
    with running(tmp_path, "return Result(None, Status.LOST, 'dark')") as process:
        assert process.process(frame()).result.T_odom_frame is None


def test_it_sees_its_parameters_and_neither_our_files_nor_our_variables(tmp_path, monkeypatch):
    monkeypatch.setenv("VOBENCH_CACHE", "/somewhere")
    start = "print(params, seed, sorted(os.environ), os.listdir(), flush=True)"
    with running(tmp_path, "return Result(I)", start=start) as process:
        process.process(frame())
    said = (tmp_path / "log.txt").read_text()
    assert said.startswith("{'speed': 2.0} 7 ")
    assert "VOBENCH" not in said
    assert said.rstrip().endswith("[]")


def test_it_imports_nothing_from_the_folder_that_it_starts_in(tmp_path):
    start = "open('wave.py', 'w').write('at_home = True')\n        import wave; print(wave.__file__, flush=True)"
    with running(tmp_path, "return Result(I)", start=start) as process:
        process.process(frame())
    assert Path((tmp_path / "log.txt").read_text().strip()).parent == Path(os.__file__).parent


def test_what_it_does_to_a_picture_stays_with_it(tmp_path):
    picture = np.zeros((480, 720), np.uint8)
    with running(tmp_path, "frame.left[:] = 9; return Result(I, stats={'max': frame.left.max()})") as process:
        assert process.process(frame(picture=picture)).result.stats == {"max": 9.0}
    assert picture.max() == 0


@pytest.mark.skipif(sys.platform != "linux", reason="the signal at a parent's death is Linux's")
def test_an_endless_estimator_does_not_outlive_a_vobench_that_was_killed(tmp_path):
    script = """
import sys
from pathlib import Path
import test_process as t
with t.running(Path(sys.argv[1]), "print('here', flush=True)\\nwhile True: pass") as process:
    process.process(t.frame())
"""
    search = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"PYTHONPATH": search}
    log = tmp_path / "log.txt"
    with subprocess.Popen([sys.executable, "-c", script, str(tmp_path)], env=environment) as process:
        until = time.monotonic() + 120
        while not (log.exists() and log.read_text().strip()):
            assert time.monotonic() < until
            time.sleep(0.02)
        assert workers_of(tmp_path)
        process.kill()
    await_end(tmp_path)


ORPHAN = """
import os, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        open("orphan", "w").close()
        time.sleep(600)
    os._exit(0)
os.wait()
while not os.path.exists("orphan"):
    time.sleep(0.01)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="orphans are taken in on Linux alone")
@pytest.mark.parametrize("how", ["killed", "done"])
def test_no_orphan_in_a_session_of_its_own_is_left_even_where_vobench_is_killed(tmp_path, how):
    script = f"""
import os, sys, signal
from pathlib import Path
import test_process as t
with t.running(Path(sys.argv[1]), {("exec(" + repr(ORPHAN) + "); return Result(I)")!r}) as process:
    process.process(t.frame())
    print(len(t.workers_of(sys.argv[1])), flush=True)
    if {how == "killed"}:
        os.kill(os.getpid(), signal.SIGKILL)
"""
    search = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    said = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path)],
        env=os.environ | {"PYTHONPATH": search},
        stdout=subprocess.PIPE,
        check=False,
    )
    assert said.stdout.split() == [b"2"]
    await_end(tmp_path)
