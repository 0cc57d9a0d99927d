"""The fork server: it reports how workers end, and ends with them when nobody needs them."""

import os
import signal
import time
from pathlib import Path

import pytest

from vobench.runner.fork_server import ForkServer

END_S = 30  # far more than anything here takes

WORKERS = """
import os, signal, subprocess, time

def echo(connection, vobench_fd):
    while True:
        connection.send(connection.recv())

def ends(connection, vobench_fd):
    connection.recv()

def raises(connection, vobench_fd):
    raise ValueError("as it should")

def leaves_another(connection, vobench_fd):
    connection.send(subprocess.Popen(["sleep", "3600"], start_new_session=True).pid)
    connection.recv()

def hangs(connection, vobench_fd):
    connection.send(os.getpid())
    time.sleep(3600)
"""


@pytest.fixture
def server(tmp_path, monkeypatch):
    """Makes a server whose workers are one of the functions above."""
    (tmp_path / "workers_of_tests.py").write_text(WORKERS)
    (tmp_path / "slow_import_of_tests.py").write_text("import time\ntime.sleep(1)\n")
    monkeypatch.syspath_prepend(tmp_path)
    servers = []

    def make(function: str, *preloaded: str) -> ForkServer:
        servers.append(ForkServer(f"workers_of_tests:{function}", preloaded))
        return servers[-1]

    yield make
    for each in servers:
        each.close()


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


def is_gone_in_time(pid: int, within_s: float = END_S) -> bool:
    until_s = time.monotonic() + within_s
    while is_alive(pid) and time.monotonic() < until_s:
        time.sleep(0.01)
    return not is_alive(pid)


def test_a_worker_answers_and_ends_when_its_connection_is_closed(server):
    worker = server("echo", "fractions", "no_such_module").start_worker()
    worker.connection.send("here")
    assert worker.connection.recv() == "here"
    assert worker.is_alive
    pid = worker.pid()
    worker.close()
    assert not worker.is_alive
    assert not is_alive(pid)


@pytest.mark.parametrize(("function", "exit_code"), [("ends", 0), ("raises", 1)])
def test_an_exit_code_is_reported(server, function, exit_code):
    worker = server(function).start_worker()
    if function == "ends":
        worker.connection.send("end")
    assert worker.join(END_S) == exit_code
    worker.close()


def test_a_signal_is_reported_and_other_workers_go_on(server):
    both = server("echo")
    first, second = both.start_worker(), both.start_worker()
    assert first.pid(END_S)
    first.kill(signal.SIGSEGV)
    assert first.join(END_S) == -signal.SIGSEGV
    second.connection.send("still here")
    assert second.connection.recv() == "still here"
    first.close()
    second.close()


def test_what_a_killed_worker_leaves_behind_is_ended(server):
    worker = server("leaves_another").start_worker()
    orphan = worker.connection.recv()
    assert is_alive(orphan)
    worker.kill(signal.SIGKILL)
    assert is_gone_in_time(orphan)
    worker.close()


def test_a_killed_server_takes_its_workers_with_it_and_the_next_worker_has_a_new_one(server):
    made = server("hangs")
    worker = made.start_worker()
    pid = worker.connection.recv()
    made._process.kill()
    assert worker.join(END_S) == -signal.SIGKILL
    assert is_gone_in_time(pid)
    worker.close()
    made._process.wait()
    again = made.start_worker()
    assert is_alive(again.connection.recv())
    made.close()
    again.close()


def test_a_closed_server_ends_workers_that_do_not_listen(server):
    made = server("hangs")
    worker = made.start_worker()
    pid = worker.connection.recv()
    made.close()
    assert worker.join(END_S) is not None
    assert not is_alive(pid)
    worker.close()


def test_a_worker_that_has_yet_to_start_is_abandoned_and_ends_when_it_does(server):
    worker = server("ends", "slow_import_of_tests").start_worker()
    assert worker.abandon()
    assert worker.is_alive
    assert worker.join(END_S) == 1  # of an EOFError
    assert not worker.abandon()
    worker.close()


def test_a_worker_leaves_no_descriptor_open(server):
    made = server("echo")
    made.start_worker().close()
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(5):
        made.start_worker().close()
    assert len(os.listdir("/proc/self/fd")) == before
