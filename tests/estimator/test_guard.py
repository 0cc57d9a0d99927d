"""The guard: it ends as its program ends, and ends everything that the program has started when it is told to."""

import ctypes
import errno
import marshal
import os
import select
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from vobench.estimator.guard import CANNOT_START, START_REPORT, descendants, stat
from vobench.estimator.program import GUARD

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="it needs /proc")

NO_SUCH_PROCESS = 2**22 + 1  # beyond the largest process id: proc(5), pid_max
PATIENCE_S = 20.0
SET_NAME = 15  # PR_SET_NAME of linux/prctl.h


@contextmanager
def guarded(*argv, file_bytes=1 << 20, program=None):
    """A guard that has been sent the plan of a program without isolation; with the socket to it."""
    plan = {
        "program": program or argv[0],
        "argv": list(argv),
        "is_isolated": False,
        "file_bytes": file_bytes,
        "inherited": [],
    }
    line, guard_line = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    line.settimeout(PATIENCE_S)
    number = guard_line.fileno()
    guard = subprocess.Popen([*GUARD, str(number)], stdout=subprocess.PIPE, pass_fds=[number], start_new_session=True)
    guard_line.close()
    with line, guard:
        line.send(marshal.dumps(plan))
        try:
            yield guard, line
        finally:
            guard.kill()


def python(code, **plan):
    return guarded(sys.executable, "-I", "-S", "-c", code, **plan)


def is_alive(pid):
    fields = stat(pid)
    return bool(fields) and fields[0] != "Z"


def test_the_kernel_ends_the_program_before_the_guard_if_memory_runs_out():
    with python("print(open('/proc/self/oom_score_adj').read())") as (guard, _):
        assert int(Path(f"/proc/{guard.pid}/oom_score_adj").read_text()) < 1000
        assert int(guard.stdout.read()) == 1000


def test_the_number_of_descriptors_is_limited_for_good():
    code = "import resource; print(*resource.getrlimit(resource.RLIMIT_NOFILE))"
    with python(code) as (guard, _):
        soft, hard = map(int, guard.stdout.read().split())
        assert soft <= hard <= 1024


@pytest.mark.parametrize("code", [0, 3, 255])
def test_it_ends_with_the_exit_code_of_the_program(code):
    with python(f"raise SystemExit({code})") as (guard, line):
        assert line.recv(100) == START_REPORT + b"0"
        assert guard.wait(PATIENCE_S) == code


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGSEGV])
def test_it_ends_by_the_signal_that_ended_the_program(number):
    with python(f"import os; os.kill(os.getpid(), {int(number)})") as (guard, _):
        assert guard.wait(PATIENCE_S) == -number


def test_a_program_that_is_not_there_is_reported_by_its_error_number():
    with guarded("/no/such/program") as (guard, line):
        assert line.recv(100) == START_REPORT + str(errno.ENOENT).encode()
        assert guard.wait(PATIENCE_S) == CANNOT_START


def test_a_program_is_started_by_its_path_and_named_by_its_first_argument():
    with guarded("dash", "-c", 'echo "$0" "$1"', "one", "two", program="/bin/sh") as (guard, line):
        assert line.recv(100) == START_REPORT + b"0"
        assert guard.stdout.read() == b"one two\n"


def test_a_program_has_limits_of_its_files_and_of_a_core():
    code = "import resource as r; print(r.getrlimit(r.RLIMIT_FSIZE), r.getrlimit(r.RLIMIT_CORE))"
    with python(code, file_bytes=12345) as (guard, _):
        assert guard.stdout.read() == b"(12345, 12345) (1, 1)\n"


@pytest.fixture
def heeds_sigint():
    """SIGINT is not ignored, as it is where a shell has started the tests in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_a_program_has_none_of_the_guards_descriptors_and_handlers_of_signals(heeds_sigint):
    code = (
        "import os, signal\n"
        "numbers = set(map(int, os.listdir('/proc/self/fd')))\n"
        "others = [n for n in sorted(numbers - {0, 1, 2}) if os.path.exists(f'/proc/self/fd/{n}')]\n"
        "status = open('/proc/self/status').read()\n"
        "print(others, 'SigCgt:\\t0000000000000002' in status)\n"
    )
    with python(code) as (guard, _):
        assert guard.stdout.read() == b"[] True\n"  # SIGINT is caught by the interpreter of the program


ORPHAN = """
import os, time
reads, writes = os.pipe()
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        os.write(writes, str(os.getpid()).encode())
        time.sleep(60)
    os._exit(0)
os.wait()
print(os.read(reads, 20).decode(), flush=True)
"""


@pytest.mark.parametrize("end", ["", "time.sleep(60)"])
def test_an_orphan_in_a_session_of_its_own_ends_with_the_program_or_with_the_socket(end):
    with python(ORPHAN + end) as (guard, line):
        assert select.select([guard.stdout], [], [], PATIENCE_S)[0]
        orphan = int(guard.stdout.readline())
        if end:
            assert is_alive(orphan)
            assert orphan in descendants(guard.pid)
            line.close()
        assert guard.wait(PATIENCE_S) == 0
        assert not is_alive(orphan)


def test_vobench_notices_when_a_program_closes_its_output_though_it_still_runs():
    with python("import os, time; os.close(1); time.sleep(60)") as (guard, _):
        assert select.select([guard.stdout], [], [], PATIENCE_S)[0]
        assert guard.stdout.read() == b""
        assert guard.poll() is None


def test_descendants_are_children_and_their_children_but_neither_oneself_nor_ones_parent():
    code = "import subprocess; subprocess.run(['sleep', '60'])"
    child = subprocess.Popen([sys.executable, "-I", "-S", "-c", code], start_new_session=True)
    try:
        until = time.monotonic() + PATIENCE_S
        while len(family := descendants(child.pid)) < 1 and time.monotonic() < until:
            time.sleep(0.01)
        assert len(family) == 1
        assert int(stat(family[0])[1]) == child.pid
        mine = descendants(os.getpid())
        assert {child.pid, *family} <= set(mine)
        assert mine.index(child.pid) < mine.index(family[0])
        assert not {os.getpid(), os.getppid()} & set(mine)
    finally:
        os.killpg(child.pid, signal.SIGKILL)
        child.wait()
    assert descendants(child.pid) == []


def test_the_fields_of_a_process_are_found_whatever_its_name():
    """The name stands in brackets before the fields, and may have brackets and blanks of its own."""
    libc = ctypes.CDLL(None)
    before = Path("/proc/self/comm").read_bytes().strip()
    libc.prctl(SET_NAME, b"a) R 1 (b)")
    try:
        fields = stat(os.getpid())
    finally:
        libc.prctl(SET_NAME, before)
    state, parent, group, session = fields[:4]
    assert state in ("R", "S", "D")
    assert (int(parent), int(group), int(session)) == (os.getppid(), os.getpgrp(), os.getsid(0))


def test_a_process_that_is_gone_has_no_fields():
    assert stat(NO_SUCH_PROCESS) == []
