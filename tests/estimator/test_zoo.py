"""Bad plugins: whatever one does, its trial has a status and a reason, nothing is left of it, and the next goes on.

Each is run as a trial of a recording of three frames; what it does happens in `process`, if nothing else is said.
"""

import json
import os
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from vobench.estimator.manifest import Limits
from vobench.estimator.process import EstimatorProcess
from vobench.estimator.program import EstimatorFailure, sandbox_works
from vobench.estimator.protocol import Frame
from vobench.estimator.sandbox import Sandbox
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import stereo_rig
from vobench.runner.estimate import LOG, estimate, read_outcome
from vobench.runner.frames import ANSWERS, TIMES, read_table
from vobench.runner.store import SilentProgress
from vobench.sequence import SequenceWriter
from vobench.suite.estimator_entry import EstimatorEntry
from vobench.suite.manifest import read_manifest
from vobench.suite.plan import Trial
from vobench.suite.source import RecordedCase, Source

# ruff: noqa: E501 - one animal is one line

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the tree of processes is Linux's /proc")

HEAD = """
import ctypes, json, os, pickle, resource, signal, struct, subprocess, sys, threading, time
import numpy as np
from vobench.errors import VobenchError
from vobench.estimator import Result, Status, Tracks
I = np.eye(4)
OUT = 4  # where answers go
def send(tag, payload=b"", length=None):
    os.write(OUT, struct.pack("<4sI", tag, len(payload) if length is None else length) + payload)
def pose(index, what=1, rest=b""):
    send(b"POSE", struct.pack("<qII", index, 1, what) + np.eye(4)[:3].tobytes() + rest)
def message(tag, payload=b""): return struct.pack("<4sI", tag, len(payload)) + payload
def posed(index): return message(b"POSE", struct.pack("<qII", index, 1, 1) + np.eye(4)[:3].tobytes())
class Bomb:
    def __reduce__(self): return os.system, (f"touch {os.environ['PYTHONPATH'].split(':')[0]}/executed",)
def shared(number, size):
    mark = os.environ["PYTHONPATH"].split(":")[0].replace("/", "_")
    fd = os.open(f"/dev/shm/{mark}{number}", os.O_CREAT | os.O_RDWR)
    for _ in range(size >> 20): os.write(fd, bytes(1 << 20))
    return fd
class Vile(Exception):
    def __str__(self): raise RuntimeError("not even that")
def away(and_then):
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            and_then()
            time.sleep(600)
        os._exit(0)
    os.wait()
"""
OK = "return Result(I)"
FINISHED, CRASHED, INVALID, LATE, MEMORY, REFUSED = (
    "finished",
    "crashed",
    "invalid_output",
    "timeout",
    "out_of_memory",
    "refused",
)


@dataclass(frozen=True, slots=True)
class Animal:
    kind: str
    body: str
    reason: str = ""
    head: str = ""
    start: str = "pass"
    finish: str = "return {}"
    # On a slow machine the limits that are not the matter of a test should not be met.
    frame_s: float = 60.0
    start_s: float = 120.0
    trial_s: float = 300.0
    memory_mib: int = 4096
    disk_mib: int = 4096


def late(body, **more):
    return Animal(LATE, body, "no answer within 0.4 s", frame_s=0.4, **more)


def writes(code, reason, kind=INVALID, **more):
    """Speaks for itself, past our worker, which it keeps from answering."""
    return Animal(kind, f"{code}\ntime.sleep(600)", reason, **more)


ZOO = {
    # It raises.
    "raises": Animal(CRASHED, "raise RuntimeError('a\\nb')", "RuntimeError: a b"),
    "raises at import": Animal(REFUSED, OK, "estimator 'bad' cannot be imported: RuntimeError: no", head="raise RuntimeError('no')"),
    "raises in __init__": Animal(REFUSED, OK, "Bad() RuntimeError: no", head="def init(self): raise RuntimeError('no')"),
    "raises in start": Animal(CRASHED, OK, "ZeroDivisionError: division by zero", start="1 / 0"),
    "raises in finish": Animal(CRASHED, OK, "ZeroDivisionError: division by zero", finish="1 / 0"),
    "raises what is no Exception": Animal(CRASHED, "raise BaseException('x')", "the process ended with exit code 1: BaseException: x"),
    "raises what cannot be said": Animal(CRASHED, "raise Vile", "the process ended with exit code 1: RuntimeError: not even that"),
    "recurses": Animal(CRASHED, "f = lambda: f()\nf()", "RecursionError: maximum recursion depth exceeded"),
    "raises 20 MB of ESC and surrogates": Animal(CRASHED, "raise ValueError('\\x1b[2J\\0\\ud800' * 4_000_000)", "ValueError: [2J [2J"),
    # It ends.
    "exits": Animal(CRASHED, "sys.exit(3)", "the process ended with exit code 3"),
    "exits in silence": Animal(INVALID, "os._exit(0)", "frame 0: it ended, with exit code 0"),
    "exits in start": Animal(CRASHED, OK, "the process ended with exit code 9", start="os._exit(9)"),
    "exits in finish": Animal(CRASHED, OK, "the process ended with exit code 9", finish="os._exit(9)"),
    "aborts": Animal(CRASHED, "os.abort()", "the process ended with signal SIGABRT"),
    "segfaults": Animal(CRASHED, "ctypes.string_at(0)", "the process ended with signal SIGSEGV"),
    "is killed": Animal(MEMORY, "os.kill(os.getpid(), 9)", "killed by the system"),
    "terminates its group": Animal(CRASHED, "os.killpg(0, signal.SIGTERM)\ntime.sleep(30)", "the process ended with signal SIGTERM"),
    "closes its files": Animal(CRASHED, f"os.closerange(3, 64)\n{OK}", "the process ended with exit code 1"),
    # It hangs.
    "hangs in Python": late("while True: pass"),
    "sleeps": late("time.sleep(600)"),
    "hangs in C with the GIL held": late("ctypes.PyDLL(None).pause()"),
    "hangs deaf to signals": late("for n in set(signal.Signals) - {9, 19}: signal.signal(n, signal.SIG_IGN)\ntime.sleep(600)"),
    "hangs at import": Animal(LATE, OK, "no answer within 0.8 s", head="time.sleep(600)", start_s=0.8),
    "hangs in start": Animal(LATE, OK, "no answer within 1 s", start="time.sleep(600)", start_s=1),
    "hangs in finish": Animal(LATE, OK, "", finish="time.sleep(600)", trial_s=2),
    "stops": late("os.kill(os.getpid(), signal.SIGSTOP)"),
    "stops after an answer": late(f"threading.Timer(0.02, os.kill, (os.getpid(), signal.SIGSTOP)).start()\ntime.sleep(0.1 * frame.index)\n{OK}"),
    "takes too long in all": Animal(LATE, "time.sleep(1.5)\n" + OK, "the whole trial took more than 2.5 s", trial_s=2.5),
    # It answers what is none.
    "None": Animal(INVALID, "return None", "frame 0: process() must return a vobench.estimator.Result, got NoneType"),
    "a tuple": Animal(INVALID, "return I, 'ok'", "frame 0: process() must return"),
    "a class": Animal(INVALID, "return Result", "frame 0: process() must return"),
    "NaN": Animal(INVALID, "return Result(I * np.nan)", "frame 0: the pose should be a finite"),
    "infinite": Animal(INVALID, "return Result(I + np.diag([0, 0, np.inf], 1))", "frame 0: the pose should be a finite"),
    "a reflection": Animal(INVALID, "return Result(np.diag([-1, 1, 1, 1]))", "frame 0: the pose is not a rigid transform"),
    "scaled": Animal(INVALID, "return Result(2 * I)", "frame 0: the pose is not a rigid transform"),
    "enormous": Animal(INVALID, "return Result(1e300 * I)", "frame 0: the pose is not a rigid transform"),
    "projective": Animal(INVALID, "return Result(I + np.eye(4)[[3]].T * 0.1)", "frame 0: the pose is not a rigid transform"),
    "far away": Animal(INVALID, "T = I.copy(); T[0, 3] = 1e300\nreturn Result(T)", "frame 0: the pose is farther than"),
    "3 x 3": Animal(INVALID, "return Result(np.eye(3))", "frame 0: the pose should be a finite (4, 4) array"),
    "ragged": Animal(INVALID, "return Result([[1, 0], [0]])", "frame 0: the pose should be an array"),
    "complex": Animal(INVALID, "return Result(I * 1j)", "frame 0: the pose should be an array of real numbers"),
    "text": Animal(INVALID, "return Result('here')", "frame 0: the pose should be an array of real numbers"),
    "objects": Animal(INVALID, "return Result(np.array([[Bomb()] * 4] * 4))", "frame 0: the pose should be an array of real numbers"),
    "an unknown status": Animal(INVALID, "return Result(I, '\\x1b[2Jfine' * 10**6)", "frame 0: no status '\\x1b[2Jfine"),
    "ok without a pose": Animal(INVALID, "return Result(None)", "frame 0: status 'ok' needs a pose"),
    "stats that are none": Animal(INVALID, "return Result(I, stats=[1])", "frame 0: stats should be numbers by name"),
    "stats beyond a float": Animal(INVALID, "return Result(I, stats={'n': 10**400})", "frame 0: stats should be numbers by name"),
    "ten thousand stats": Animal(INVALID, "return Result(I, stats={str(n): 0 for n in range(10**4)})", "frame 0: 128890 bytes of stats"),
    "ragged tracks": Animal(INVALID, "return Result(I, tracks=Tracks(np.zeros((3, 2)), np.zeros((2, 2)), np.zeros(3, bool)))", "frame 0: tracks should be"),
    "80 MB of tracks": Animal(INVALID, "z = np.zeros((2 * 10**6, 2), np.float16)\nreturn Result(I, tracks=Tracks(z, z, z[:, 0] > 0))", "frame 0: an answer of 80"),
    "points of a plane": Animal(INVALID, "return Result(I, points=np.zeros((9, 2)))", "frame 0: points should be (N, 3)"),
    "a covariance that is none": Animal(INVALID, "return Result(I, covariance=-np.eye(6))", "frame 0: the covariance is not symmetric and positive"),
    "an infinite covariance": Animal(INVALID, "return Result(I, covariance=np.eye(6) * np.inf)", "frame 0: the covariance should be a finite"),
    "a covariance that no score can use": Animal(INVALID, "return Result(I, covariance=np.eye(6) * 1e-320)", "frame 0: the covariance has a variance below 1e-24"),
    "revises what is none": Animal(INVALID, OK, "finish() must return poses", finish="return [np.eye(4)]"),
    "revises with NaN": Animal(INVALID, OK, "finish(): the pose should be a finite", finish="return {0: np.eye(4) * np.nan}"),
    "revises for ever": Animal(INVALID, OK, "the end: more revised poses than the 3 frames it had", finish="while True: send(b'REVI', struct.pack('<q', 0) + np.eye(4)[:3].tobytes())"),
    # It speaks past our worker.
    "half a header": writes("os.write(OUT, b'POS')", "no answer within 0.4 s", LATE, frame_s=0.4),
    "half a message": writes("send(b'POSE', b'1234', 112)", "no answer within 0.4 s", LATE, frame_s=0.4),
    "half a message and ends": Animal(CRASHED, "send(b'POSE', b'1234', 112)\nos._exit(5)", "the process ended with exit code 5: its answer breaks off after 4 of 112 bytes"),
    "a byte now and then": writes("send(b'POSE', b'', 10**6)\nwhile True: os.write(OUT, b'x'); time.sleep(0.01)", "no answer within 0.4 s", LATE, frame_s=0.4),
    "4 GB": writes("send(b'POSE', b'', 2**32 - 1)", "frame 0: it should answer POSE, but says b'POSE' and 4294967295 bytes"),
    "noise": writes("os.write(OUT, b'\\x1b\\x00\\xff' * 2000)", "frame 0: it should answer POSE, but says b'\\x1b"),
    "another message": writes("send(b'REDY')", "frame 0: it should answer POSE, but says b'REDY'"),
    "the wrong frame": writes("pose(frame.index + 1)", "frame 0: the answer is to frame 1"),
    "the last frame again": Animal(INVALID, f"if frame.index: pose(frame.index - 1)\n{OK}", "frame 1: the answer is to frame 0"),
    "two answers": Animal(INVALID, f"pose(frame.index)\n{OK}", "frame 1"),  # whether it comes before the question is a matter of time
    "what is not asked for": writes("pose(frame.index, what=1 << 9)", "frame 0: no status 1 with contents 512"),
    "a billion tracks": writes("pose(0, 9, struct.pack('<I', 10**9))", "frame 0: a message of 116 bytes should have 40000000116 or more"),
    "deep JSON": writes("said = b'[' * 60000\npose(0, 5, struct.pack('<I', len(said)) + said)", "frame 0: "),
    "odd JSON": writes("said = b'{\"a\": {}}'\npose(0, 5, struct.pack('<I', len(said)) + said)", "frame 0: stats should be numbers by name"),
    "a pickle": writes("send(b'POSE', pickle.dumps(Bomb()))", "frame 0: "),
    "a pickle of stats": writes("said = pickle.dumps(Bomb())\npose(0, 5, struct.pack('<I', len(said)) + said)", "frame 0: "),
    "a pickle without a header": writes("os.write(OUT, pickle.dumps(Bomb()))", "frame 0: it should answer POSE"),
    "20 MB of failure": writes("send(b'FAIL', b'\\x1b\\xff' * 3000, 20_000_000)", "", REFUSED),
    # It does well, and more.
    "20 MB of a reason": Animal(FINISHED, "return Result(I, reason='x' * 20_000_000)"),
    "a reason of surrogates, ESC and NUL": Animal(FINISHED, "return Result(I, Status.DEGRADED, '\\ud800\\x1b[2J\\0dark\\u202e', stats={'\\x1b\\ud800n': 1})"),
    "a reason that is a formula": Animal(FINISHED, "return Result(I, reason='=cmd|calc')"),
    "stats that are no numbers": Animal(FINISHED, "return Result(I, stats={'a': float('nan'), 'b': float('inf')})"),
    "prints 30 MB": Animal(FINISHED, f"print('\\x1b[2J' + 'y' * 10_000_000)\n{OK}"),
    "prints secrets": Animal(FINISHED, f"print(sorted(os.environ.items()))\n{OK}"),
    "closes what it prints to": Animal(FINISHED, f"if not frame.index: os.close(1); os.close(2)\n{OK}", start="os.close(0)"),
    "patched checks": Animal(INVALID, "worker = sys.modules['__main__']\nworker.checked = lambda answer, frame: answer\nreturn Result(I * np.nan)", "frame 0: the pose should be a finite"),
    "patched clock": Animal(FINISHED, f"time.perf_counter = time.monotonic = time.process_time = lambda: 0.0\nresource.getrusage = None\nuntil = os.times().user + 0.05\nwhile os.times().user < until: pass\n{OK}"),
    "reads /proc of its parents": Animal(FINISHED, f"for pid in os.listdir('/proc'):\n    try: open(f'/proc/{{pid}}/cmdline').read()\n    except OSError: pass\n{OK}"),
    "looks for the truth beside it": Animal(CRASHED, "open('truth.mcap')", "FileNotFoundError"),
    "deletes its folder": Animal(FINISHED, f"if not frame.index: os.rmdir(os.getcwd())\n{OK}"),
    "tracks and points beyond float32": Animal(FINISHED, "z = np.full((3, 2), 1e300)\nreturn Result(I, tracks=Tracks(z, z, z[:, 0] > 0), points=np.full((3, 3), 1e300))"),
    "infinite points": Animal(FINISHED, "return Result(I, points=np.full((3, 3), np.inf))"),
    # It takes, and leaves behind.
    "allocates 10 GB": Animal(MEMORY, "np.ones(10 * 2**27)", "MemoryError: Unable to allocate 10.0 GiB"),
    "children that hold memory": Animal(MEMORY, "pid = os.fork()\nheld = bytearray(b'1') * (200 << 20)\ntime.sleep(30)", "its processes hold", memory_mib=300),
    "an orphan that holds memory": Animal(MEMORY, "for _ in range(3): away(lambda: globals().update(held=bytearray(b'1') * (150 << 20)))\ntime.sleep(30)", "its processes hold", memory_mib=450),
    "shared memory": Animal(CRASHED, "os.ftruncate(os.memfd_create('x'), 5 << 30)", "OSError: [Errno 27] File too large"),
    "shared memory in pieces": Animal(MEMORY, "fds = [os.memfd_create(str(n)) for n in range(20)]\nfor fd in fds: os.write(fd, bytes(8 << 20))\ntime.sleep(30)", "its files hold more than the limit of 64 MiB", disk_mib=64),
    "shared memory with a name": Animal(FINISHED, f"if not frame.index: self.held = shared(0, 32 << 20)\n{OK}"),
    "too much shared memory with a name": Animal(MEMORY, "self.held = [shared(n, 60 << 20) for n in range(4)]\ntime.sleep(30)", "its processes hold", memory_mib=200),
    "too much shared memory in closed files": Animal(MEMORY, "for n in range(4): os.close(shared(n, 60 << 20))\ntime.sleep(30)", "its processes hold", memory_mib=200),
    "full sockets": Animal(MEMORY, "import socket\npairs = []\nfor _ in range(450):\n    pairs.append(socket.socketpair())\n    for end in pairs[-1]:\n        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 8 << 20); end.setblocking(False)\n        try:\n            while True: end.send(bytes(4096))\n        except BlockingIOError: pass\ntime.sleep(30)", "its sockets can hold", memory_mib=200),
    "processes without end": Animal(MEMORY, "for _ in range(600):\n    if os.fork() == 0: time.sleep(600)\ntime.sleep(30)", "", memory_mib=8192),
    "page tables": Animal(MEMORY, "import mmap\nmaps = [mmap.mmap(-1, 1 << 38, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | 0x4000, mmap.PROT_READ) for _ in range(2)]\nfor place in maps:\n    for at in range(0, 1 << 38, 2 << 20): place[at]\ntime.sleep(30)", "its processes hold", memory_mib=400),
    "more files than the disk has": Animal(MEMORY, "for n in range(20000): open(str(n), 'w').close()\ntime.sleep(30)", "", disk_mib=64),
    "fills the disk and the error is caught": Animal(MEMORY, "try:\n    for n in range(200): open(str(n), 'wb').write(bytes(1 << 20))\nexcept OSError: pass\ntime.sleep(30)", "its files hold more than the limit of 64 MiB", disk_mib=64),
    "nests folders": Animal(FINISHED, f"if not frame.index:\n    for _ in range(3000): os.mkdir('a'); os.chdir('a')\n{OK}"),
    "nests folders without permissions": Animal(FINISHED, f"if not frame.index:\n    os.makedirs('a/b/c'); os.chmod('a/b', 0); os.chmod('a', 0)\n{OK}"),
    "renames its folder": Animal(FINISHED, f"if not frame.index:\n    try: os.rename(os.getcwd(), os.getcwd() + '.away')\n    except OSError: pass\n{OK}"),
    "puts a link in the place of its folder": Animal(FINISHED, f"if not frame.index:\n    home = os.getcwd()\n    try: os.rename(home, home + '.away'); os.symlink('/etc', home)\n    except OSError: pass\n{OK}"),
    "makes files immutable": Animal(FINISHED, f"open('x', 'w').close()\nos.system('chattr +i x . 2>/dev/null')\n{OK}"),
    "takes its log away": Animal(FINISHED, f"os.fchmod(2, 0)\nos.ftruncate(2, 0)\n{OK}"),
    "takes its log away and ends": Animal(CRASHED, "os.fchmod(2, 0)\nos._exit(3)", "the process ended with exit code 3"),
    "answers before it is asked": Animal(INVALID, OK, "frame 0, before it was asked: it should answer nothing, but says b'POSE' and 112 bytes", start="os.write(OUT, message(b'REDY') + b''.join(posed(n) for n in range(5))); time.sleep(600)"),
    "answers the next frame as well": Animal(INVALID, "os.write(OUT, posed(0) + posed(1)); time.sleep(600)", "frame 1, before it was asked: it should answer nothing"),
    "answers the end before it is asked": Animal(INVALID, f"if frame.index == 2: os.write(OUT, posed(2) + message(b'DONE')); time.sleep(600)\n{OK}", "the end, before it was asked: it should answer nothing"),
    "one file fills the disk": Animal(CRASHED, "with open('x', 'wb') as file:\n    while True: file.write(bytes(1 << 20))", "OSError: [Errno 27] File too large", disk_mib=64),
    "many files fill the disk": Animal(MEMORY, "for n in range(100): open(str(n), 'wb').write(bytes(1 << 20))\ntime.sleep(30)", "", disk_mib=64),
    "a deleted file fills the disk": Animal(MEMORY, "files = [open(str(n), 'wb') for n in range(10)]\nfor n, file in enumerate(files): file.write(bytes(8 << 20)); os.remove(str(n))\ntime.sleep(30)", "", disk_mib=64),  # what it holds, or that no space is left
    "a deleted file fills the disk and the error is caught": Animal(MEMORY, "files = [open(str(n), 'wb') for n in range(10)]\ntry:\n    for n, file in enumerate(files): file.write(bytes(8 << 20)); file.flush(); os.remove(str(n))\nexcept OSError: pass\ntime.sleep(30)", "its files hold", disk_mib=64),
    "forks": Animal(FINISHED, f"if os.fork() == 0: time.sleep(600)\n{OK}"),
    "forks, and both answer": Animal(INVALID, f"if frame.index: time.sleep(600)\nos.fork()\n{OK}", "frame 1"),
    "an orphan in a session of its own": Animal(FINISHED, f"away(lambda: None)\n{OK}"),
    "an orphan without a variable": Animal(FINISHED, f"away(lambda: os.execve('/bin/sleep', ['sleep', '600', os.environ['PYTHONPATH']], {{}}))\n{OK}"),
    "an orphan that holds the pipe, and an end": Animal(CRASHED, "away(lambda: None)\nos._exit(4)", "the process ended with exit code 4"),
    "stops its guard": Animal(FINISHED, f"os.kill(os.getppid(), signal.SIGSTOP)\n{OK}"),
    "kills its guard": Animal(CRASHED, "os.kill(os.getppid(), signal.SIGKILL)\ntime.sleep(0.2)\nos._exit(4)", "the process ended with exit code 4") if sandbox_works() else Animal(MEMORY, "os.kill(os.getppid(), signal.SIGKILL)\ntime.sleep(600)", "killed by the system"),
}  # fmt: skip


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder, lens = tmp_path_factory.mktemp("store") / "sequences" / "hash", Pinhole(64, 48, 60.0, 60.0, 31.5, 23.5)
    picture = np.random.default_rng(1).integers(0, 255, (48, 64)).astype(np.uint8)
    with SequenceWriter(folder, stereo_rig(lens, pitch_deg=90), case_json=b"{}") as writer:
        for index in range(3):
            writer.write_frame(index * 10**8, picture, picture)
            writer.write_truth(index * 10**8, np.eye(4), np.zeros(6))
    return folder


def trial_of(animal, place):
    """A folder of its own with the plugin, and the trial of it."""
    folder = place / "bad"
    folder.mkdir()
    (folder / "estimator.yaml").write_text(
        "name: bad\nversion: '1'\nclass: estimator:Bad\nneeds: [stereo]\npose_of: left_camera\nsummary: Bad\n"
    )
    body, start, finish = (text.replace("\n", "\n        ") for text in (animal.body, animal.start, animal.finish))
    init = "    __init__ = init\n" if "def init" in animal.head else ""
    (folder / "estimator.py").write_text(
        f"{HEAD}{animal.head}\nclass Bad:\n{init}    def start(self, rig, params, seed):\n        {start}\n"
        f"    def process(self, frame):\n        {body}\n    def finish(self):\n        {finish}\n"
    )
    names = ("start_s", "frame_s", "trial_s", "memory_mib", "disk_mib")
    limits = Limits(**{name: getattr(animal, name) for name in names})
    manifest = read_manifest(folder)
    case = RecordedCase(name="case", variant={}, source=Source(path="."))
    return Trial(case, EstimatorEntry("bad", folder, manifest, {}, limits), 0)


def left_over(mark):
    """Processes whose environment or words have a mark in them."""
    found = []
    for pid in filter(str.isdigit, os.listdir("/proc")):
        with suppress(OSError):
            said = b"".join(Path("/proc", pid, name).read_bytes() for name in ("environ", "cmdline"))
            if mark.encode() in said:
                found.append((int(pid), said[-200:]))
    return found


@pytest.fixture
def run(tmp_path, recording, monkeypatch):
    """Runs a trial; gives its folder."""
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    monkeypatch.setenv("SECRET_TOKEN", "hush")

    def run(animal):
        folder = tmp_path / "estimate"
        folder.mkdir()
        estimate(trial_of(animal, tmp_path), recording, folder, SilentProgress())
        return folder

    return run


@pytest.mark.parametrize("animal", ZOO.values(), ids=ZOO)
def test_a_bad_plugin_is_a_row_with_a_reason_and_nothing_is_left_of_it(run, tmp_path, capfd, animal):
    outcome = read_outcome(run(animal))
    assert (outcome.kind, outcome.reason[: len(animal.reason)]) == (animal.kind, animal.reason)
    assert len(outcome.reason) <= 500
    assert outcome.reason.isprintable()
    assert capfd.readouterr() == ("", "")  # in the harness
    assert left_over(str(tmp_path)) == []
    assert not (tmp_path / "executed").exists()
    assert not list(Path("/dev/shm").glob(f"{str(tmp_path).replace(os.sep, '_')}*"))
    said = (tmp_path / "estimate" / ANSWERS).read_text()
    assert not {"\x1b", "\0", "\ud800", "\u202e"} & set(said)
    assert ",=" not in said
    if outcome.kind == FINISHED:
        assert [len(row["reason"]) <= 500 for row in read_table(tmp_path / "estimate" / ANSWERS)] == [True] * 3


@pytest.mark.skipif(not sandbox_works(), reason="this machine has no namespaces for us")
def test_the_truth_and_other_processes_are_out_of_sight(run, tmp_path, recording):
    body = f"seen = [os.path.exists({str(recording)!r}), [int(n) for n in os.listdir('/proc') if n.isdigit()]]\n"
    raised = body + "raise ValueError(str((seen[0], max(seen[1]) < 20)))"
    outcome = read_outcome(run(Animal(CRASHED, raised)))
    assert outcome.reason.endswith("ValueError: (False, True)")
    assert outcome.sandbox == Sandbox("full")


def test_an_estimator_without_a_sandbox_is_fed_all_the_same_and_its_outcome_says_so(run, monkeypatch):
    monkeypatch.setenv("VOBENCH_SANDBOX", "off")
    outcome = read_outcome(run(Animal(FINISHED, OK)))
    assert (outcome.kind, outcome.sandbox.level) == (FINISHED, "none")


WITHOUT_A_SANDBOX = (
    "nests folders",
    "nests folders without permissions",
    "renames its folder",
    "puts a link in the place of its folder",
    "takes its log away",
    "many files fill the disk",
    "a deleted file fills the disk",
    "shared memory with a name",
    "an orphan in a session of its own",
    "answers before it is asked",
)


@pytest.mark.parametrize("name", WITHOUT_A_SANDBOX)
def test_without_a_sandbox_a_bad_plugin_is_a_row_as_well_and_nothing_is_left_of_it(run, tmp_path, monkeypatch, name):
    monkeypatch.setenv("VOBENCH_SANDBOX", "off")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    animal = ZOO[name]
    outcome = read_outcome(run(animal))
    # Folders that are nested deeper than is looked at are taken for too many.
    kinds = (animal.kind, MEMORY) if name == "nests folders" else (animal.kind,)
    assert outcome.kind in kinds
    assert left_over(str(tmp_path)) == []
    assert list((tmp_path / "temporary").iterdir()) == []


def test_memory_that_forks_share_counts_once(run):
    body = "if not frame.index:\n    self.model = bytearray(b'1') * (150 << 20)\n    for _ in range(6):\n        if os.fork() == 0: time.sleep(600)\n    time.sleep(1)\n"
    shares = Animal(FINISHED, f"{body}return Result(I)", memory_mib=500)
    assert read_outcome(run(shares)).kind == FINISHED


def test_memory_that_forks_have_of_their_own_counts(run):
    body = "self.model = bytearray(b'1') * (50 << 20)\nfor _ in range(9):\n    if os.fork() == 0: held = bytearray(b'1') * (50 << 20); time.sleep(600)\ntime.sleep(5)\n"
    outcome = read_outcome(run(Animal(MEMORY, f"{body}return Result(I)", memory_mib=400)))
    assert (outcome.kind, outcome.reason[:19]) == (MEMORY, "its processes hold ")


def test_the_zoo_is_large():
    assert len(ZOO) >= 60


def test_after_a_bad_one_the_next_goes_on(run, tmp_path):
    assert read_outcome(run(ZOO["kills its guard"])).kind in (MEMORY, CRASHED)
    for name in ("estimate", "bad"):
        (tmp_path / name).rename(tmp_path / f"first {name}")
    assert read_outcome(run(Animal(FINISHED, OK))).kind == FINISHED


def test_who_patches_its_clock_is_timed_by_ours(run):
    rows = read_table(run(ZOO["patched clock"]) / TIMES)
    assert all(float(row["wall_ms"]) >= 40 and float(row["cpu_ms"]) >= 40 for row in rows)


def test_what_it_prints_has_none_of_our_variables_and_is_cut(run, tmp_path):
    assert "hush" not in (run(ZOO["prints secrets"]) / LOG).read_text()
    for name in ("estimate", "bad"):
        (tmp_path / name).rename(tmp_path / f"first {name}")
    assert (run(ZOO["prints 30 MB"]) / LOG).stat().st_size < 2 << 20


def test_who_reads_nothing_is_late(tmp_path):
    code = "import os, time; os.write(1, b'REDY' + bytes(4)); time.sleep(600)"
    picture, began = np.zeros((2000, 2000), np.uint8), time.monotonic()
    rig = stereo_rig(Pinhole(64, 48, 60.0, 60.0, 31.5, 23.5), pitch_deg=90)
    argv, limits = [sys.executable, "-S", "-c", code], Limits(frame_s=0.3)
    with EstimatorProcess.of_stream(argv, tmp_path, log=tmp_path / "log", limits=limits, rate_hz=1.0) as process:
        process.start(rig, {}, 0)
        with pytest.raises(EstimatorFailure, match=r"timeout: no answer within 0.3 s"):
            process.process(Frame(0, 0, picture, picture))
    assert time.monotonic() - began < 60


def test_an_outcome_is_json(run):
    json.loads((run(ZOO["raises 20 MB of ESC and surrogates"]) / "outcome.json").read_bytes())
