"""What a program's processes use: counted as the system counts it, and each thing once."""

import os
import resource
import sys
import time
from io import StringIO
from types import SimpleNamespace

import pytest

from vobench.estimator import program
from vobench.estimator.home import Home
from vobench.estimator.manifest import Limits
from vobench.estimator.process import EstimatorProcess
from vobench.estimator.program import EstimatorFailure, Program, _cpu_s, _nameless, _proportional_bytes, _used_bytes
from vobench.estimator.readable_folders import SWITCH_VARIABLE, is_switched_off
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import stereo_rig

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="what /proc says")


def run(tmp_path, code, **limits):
    with Program([sys.executable, "-c", code], log=tmp_path / "log", limits=Limits(**limits)) as running:
        running.wait()
        return running


def failure(tmp_path, code, **limits):
    with pytest.raises(EstimatorFailure) as raised:
        run(tmp_path, code, **limits)
    return raised.value.kind, raised.value.reason


def test_a_program_that_ends_well_has_its_time_and_its_memory(tmp_path):
    ended = run(tmp_path, "x = b'1' * (80 << 20)\nimport time\nwhile time.process_time() < 0.8: pass")
    assert 0.3 < ended.cpu_s < 3
    assert 80 < ended.peak_mib < 400


@pytest.mark.parametrize(
    ("code", "kind", "sentence"),
    [
        ("print('last words'); raise SystemExit(3)", "crashed", "the process ended with exit code 3: last words"),
        (
            "print('a', flush=True); import os; os.kill(os.getpid(), 11)",
            "crashed",
            "the process ended with signal SIGSEGV: a",
        ),
        ("import os; os.kill(os.getpid(), 9)", "out_of_memory", "killed by the system, most likely for memory"),
        ("print('a'); print('b'); print(' '); raise SystemExit(1)", "crashed", "ended with exit code 1: b"),
    ],
)
def test_an_end_before_its_time_has_its_cause_and_the_last_line(tmp_path, code, kind, sentence):
    found = failure(tmp_path, code)
    assert found[0] == kind
    assert sentence in found[1]


def test_a_long_last_line_is_cut_to_what_fits_on_one_line_of_a_board(tmp_path):
    _, reason = failure(tmp_path, "print('first'); print('y' * 5000); raise SystemExit(3)")
    last_line = reason.removeprefix("the process ended with exit code 3: ")
    assert set(last_line) == {"y"}
    assert 80 <= len(last_line) <= 200


@pytest.mark.parametrize(("file_count", "is_too_much"), [(1, False), (3, True)])
def test_files_that_were_in_its_folder_before_do_not_count(tmp_path, monkeypatch, file_count, is_too_much):
    """Without a private file system, the size of the folder is measured before and after."""
    monkeypatch.setenv(SWITCH_VARIABLE, "off")
    monkeypatch.setattr(program, "WEIGH_S", 0.1)
    code = f"for name in 'abc'[:{file_count}]: open(name, 'wb').write(bytes(2 << 20))\nimport time; time.sleep(0.8)"
    log = tmp_path / "log"
    with Home(log) as home:
        (home.path / "given").write_bytes(bytes(20 << 20))
        outcome = "it ended well"
        try:
            with Program([sys.executable, "-c", code], log=log, limits=Limits(disk_mib=4), home=home) as running:
                running.wait()
        except EstimatorFailure as error:
            outcome = error.reason
    assert outcome == ("its files hold more than the limit of 4 MiB" if is_too_much else "it ended well")


def test_a_program_that_takes_too_long_or_too_much_is_ended(tmp_path):
    assert failure(tmp_path, "import time; time.sleep(60)", trial_s=0.5) == (
        "timeout",
        "the whole trial took more than 0.5 s",
    )
    kind, reason = failure(tmp_path, "x = b'1' * (200 << 20); import time; time.sleep(60)", memory_mib=100)
    assert kind == "out_of_memory"
    assert reason.endswith("MiB, where the limit is 100 MiB")


def test_a_trial_may_take_all_of_its_time_and_no_more(tmp_path, monkeypatch):
    code = "import time; time.sleep(60)"
    with Program([sys.executable, "-c", code], log=tmp_path / "log", limits=Limits(trial_s=100.0)) as running:
        end_s = time.monotonic() + running.left_s()
        with monkeypatch.context() as patch:
            patch.setattr(time, "monotonic", lambda: end_s - 0.01)
            running.look()
            patch.setattr(time, "monotonic", lambda: end_s + 0.01)
            with pytest.raises(EstimatorFailure, match="the whole trial took more than 100 s"):
                running.look()


def test_files_without_a_name_may_fill_the_limit_to_its_last_byte(tmp_path, monkeypatch):
    file = SimpleNamespace(device=-1, target="/nowhere/gone", size=4 << 20)
    monkeypatch.setattr(program, "_nameless", lambda _: [file])
    monkeypatch.setattr(program, "WEIGH_S", 0.0)
    code = "import time; time.sleep(60)"
    with Program([sys.executable, "-c", code], log=tmp_path / "log", limits=Limits(disk_mib=4)) as running:
        running.look(at_once=True)
        file.size += 1
        with pytest.raises(EstimatorFailure, match="its files hold more than the limit of 4 MiB"):
            running.look(at_once=True)


def test_a_program_that_is_not_there_is_refused_by_its_name(tmp_path):
    with pytest.raises(EstimatorFailure, match="refused: no-such-program cannot be started"):
        Program(["no-such-program"], log=tmp_path / "log", limits=Limits())


def test_a_log_without_end_is_cut_and_says_so(tmp_path):
    log_bytes = program.LOG_BYTES
    code = f"print('x' * {3 * log_bytes}, flush=True)"
    with Program([sys.executable, "-c", code], log=tmp_path / "log", limits=Limits()) as running:
        running.process.wait()  # without a look, which cuts the log and can do so in the middle of the line
    text = (tmp_path / "log").read_text()
    assert len(text) < log_bytes + 200
    assert f"the estimator printed at least {3 * log_bytes + 1} bytes" in text


def test_a_log_is_cut_while_its_program_runs(tmp_path):
    log_bytes = program.LOG_BYTES
    code = f"print('x' * {3 * log_bytes}, flush=True); import time; time.sleep(60)"
    with Program([sys.executable, "-c", code], log=tmp_path / "log", limits=Limits()) as running:
        while (tmp_path / "log").stat().st_size <= 3 * log_bytes:
            time.sleep(0.01)
        running.look(at_once=True)
        assert (tmp_path / "log").stat().st_size == log_bytes


def test_open_files_without_a_name_are_counted_and_others_are_not(tmp_path):
    with open(tmp_path / "shown", "wb") as shown, open(tmp_path / "gone", "wb") as gone:
        for file in (shown, gone):
            file.write(b"1" * 100_000)
            file.flush()
        os.unlink(tmp_path / "gone")
        reads, writes = os.pipe()
        names = {file.target for file in _nameless([os.getpid(), os.getpid()])}
        sizes = [file.size for file in _nameless([os.getpid()]) if "gone" in file.target]
        os.close(reads)
        os.close(writes)
    assert not any("shown" in name for name in names)
    assert not any("pipe:" in name for name in names)
    assert any("gone" in name for name in names)
    assert len(sizes) == 1
    assert 100_000 <= sizes[0] <= 200_000


def test_the_use_of_a_file_system_is_that_of_its_blocks_or_of_its_files(monkeypatch):
    def facts(blocks, free_blocks, files, free_files):
        return SimpleNamespace(f_blocks=blocks, f_bfree=free_blocks, f_frsize=1000, f_files=files, f_ffree=free_files)

    for stated, used in ((facts(100, 30, 10, 9), 70_000), (facts(100, 99, 50, 20), 30 * 4096)):
        monkeypatch.setattr(os, "fstatvfs", lambda _, stated=stated: stated)
        assert _used_bytes(0) == used


def test_the_time_of_a_process_is_that_of_its_clock_and_of_its_ended_children():
    ticks = os.sysconf("SC_CLK_TCK")
    fields = ["0"] * 22
    fields[13] = str(3 * ticks)
    fields[14] = str(4 * ticks)
    before_s = time.process_time()
    assert before_s + 7 <= _cpu_s(os.getpid(), fields) <= time.process_time() + 7
    fields[11] = str(5 * ticks)
    fields[12] = str(6 * ticks)
    assert _cpu_s(2**22 + 1, fields) == 18  # no such process: by ticks


def test_the_memory_of_a_process_is_its_part_of_each_page_or_all_that_is_resident():
    private, shared = _proportional_bytes(os.getpid(), 10**6)
    most = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert 10 << 20 < private <= most
    assert shared >= 0
    assert _proportional_bytes(2**22 + 1, 3) == (3 * resource.getpagesize(), 0)


def test_the_page_tables_of_a_process_are_some_pages_and_those_of_an_ended_one_nothing():
    used = program._page_table_bytes(os.getpid())
    assert resource.getpagesize() <= used < 100 << 20
    assert program._page_table_bytes(2**22 + 1) == 0


SOCKSTAT = """sockets: used 9
TCP: inuse 3 orphan 0 tw 0 alloc 3 mem 0
UDP: inuse 4 mem 0
UDPLITE: inuse 0
RAW: inuse 1
FRAG: inuse 0 memory 0
"""
SOCKSTAT6 = """TCP6: inuse 2
UDP6: inuse 5
UDPLITE6: inuse 0
RAW6: inuse 0
FRAG6: inuse 0 memory 0
"""


def test_sockets_of_a_network_are_counted_and_those_of_tcp_by_both_protocols(monkeypatch):
    network = {"/proc/7/net/sockstat": SOCKSTAT, "/proc/7/net/sockstat6": SOCKSTAT6}
    monkeypatch.setattr(program, "open", lambda path, **_: StringIO(network[path]), raising=False)
    assert program._socket_counts(7) == (9, 5)


FAULT = """
import ctypes, faulthandler, threading, time
faulthandler.enable()
threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
print('y' * {printed})
def track():
    ctypes.string_at(0)
track()
"""


@pytest.mark.parametrize("printed", [10, 3_000_000])
def test_the_stack_of_a_fault_is_kept_in_the_log_and_its_place_named(tmp_path, printed):
    script = tmp_path / "own" / "estimator.py"
    script.parent.mkdir()
    script.write_text(FAULT.format(printed=printed))
    argv = [sys.executable, str(script)]
    with (
        pytest.raises(EstimatorFailure) as raised,
        Program(argv, log=tmp_path / "log.txt", limits=Limits(), folder=script.parent) as running,
    ):
        running.wait()
    place = f"in track at {script}:7"
    assert raised.value.reason == f"the process ended with signal SIGSEGV {place} (its stack is in log.txt)"
    stack = (tmp_path / "log.txt").read_text().rpartition("Fatal Python error: ")[2]
    assert stack.startswith("Segmentation fault")
    assert "Current thread" in stack
    assert "threading.py" in stack


def test_a_fault_in_the_worker_of_a_class_is_kept_as_well(tmp_path):
    (tmp_path / "estimator.py").write_text(
        "import ctypes\nclass Bad:\n"
        "    def start(self, *given): ctypes.string_at(0)\n    def process(self, frame): ...\n"
    )
    rig = stereo_rig(Pinhole(64, 48, 60.0, 60.0, 31.5, 23.5), pitch_deg=90)
    log = tmp_path / "log.txt"
    process = EstimatorProcess.of_class(tmp_path, "estimator:Bad", name="bad", log=log, limits=Limits())
    with process, pytest.raises(EstimatorFailure, match=f"SIGSEGV in start at {tmp_path}/estimator.py:3"):
        process.start(rig, {}, 0)
    assert "Fatal Python error: Segmentation fault" in log.read_text()


def test_if_the_isolation_itself_fails_the_cause_is_in_the_reason(tmp_path, monkeypatch):
    if is_switched_off():
        pytest.skip("nothing is isolated")
    whole = program.guard_plan
    monkeypatch.setattr(
        program, "guard_plan", lambda *words, **options: whole(*words, **options) | {"disk_bytes": "a lot"}
    )
    kind, reason = failure(tmp_path, "print('ran')")
    assert kind == "crashed"
    assert "exit code 1" in reason
    assert "ValueError" in reason


def test_a_log_is_marked_at_its_end_wherever_the_program_moved_its_position(tmp_path):
    code = (
        "import fcntl, os, time\nprint('y' * 3_000_000, flush=True)\nfcntl.fcntl(1, fcntl.F_SETFL, 0)\n"
        "os.lseek(1, 1 << 30, os.SEEK_SET)"
    )
    run(tmp_path, code)
    assert (tmp_path / "log").stat().st_size < 2 << 20
    assert (tmp_path / "log").read_text().endswith("bytes]\n")
