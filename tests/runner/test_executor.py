"""Executors: the same bytes whoever performs a task, and a failure of one cell is a row of it and nobody else's."""

import os
import signal
import socket
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from queue import SimpleQueue
from types import SimpleNamespace

import pytest

from vobench.report import page
from vobench.report.verify import verify_run
from vobench.runner import executor
from vobench.runner.executor import Dask, Executor, LocalProcesses, Serial, TaskEvent, TaskOutcome, _death, perform_all
from vobench.runner.folder import PAGE, RunFolder
from vobench.runner.run import run_suite
from vobench.runner.store import locked
from vobench.runner.task import NO_LIMIT, Task, plan
from vobench.temporary import temporary_folder

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130), (0, 1)])
def test_a_worker_leaves_with_the_exit_code_of_the_signal_that_stops_it(monkeypatch, number, code):
    def left(exit_code):
        raise SystemExit(exit_code)

    monkeypatch.setattr(executor.os, "_exit", left)
    monkeypatch.setattr(executor.stop, "clean_up_all", lambda: None)
    monkeypatch.setattr(executor.stop, "requested", lambda: number)
    with pytest.raises(SystemExit) as ended:
        executor._leave()
    assert ended.value.code == code


def task(name: str, stage: str = "sequence", needs: tuple[str, ...] = ()) -> Task:
    return Task(stage, None, {"name": name}, needs)


@dataclass
class Recorder:
    """An executor that keeps what runs beside what; a task ends at the next turn, by the failures that are given."""

    slots: int
    failures: dict[str, TaskOutcome] = field(default_factory=dict)
    beside: list[tuple[str, int]] = field(default_factory=list)
    running: list = field(default_factory=list)
    threads: dict[str, int] = field(default_factory=dict)

    def submit(self, one, store, slot, threads, tell):
        from concurrent.futures import Future
        from threading import Timer

        future = Future()
        self.running.append(future)
        self.threads[one.inputs["name"]] = threads
        self.beside.append((one.inputs["name"], sum(not other.done() for other in self.running) - 1))
        Timer(0.02, lambda: future.set_result(self.failures.get(one.key, TaskOutcome()))).start()
        return future

    def close(self):
        pass


LIGHT = task("light", "bake")
PICTURES = [task(f"pictures {n}", needs=(LIGHT.key,)) for n in range(4)]
ESTIMATES = [task(f"estimate {n}", "estimate", (one.key,)) for n, one in enumerate(PICTURES)]
SCORES = [task(f"score {n}", "score", (a.key, b.key)) for n, (a, b) in enumerate(zip(PICTURES, ESTIMATES, strict=True))]
ALL = [LIGHT, *PICTURES, *ESTIMATES, *SCORES]


def test_tasks_come_after_what_they_need_and_two_at_a_time(tmp_path):
    executor, heard = Recorder(2), list[TaskEvent]()
    assert perform_all(ALL, tmp_path, executor, on_event=heard.append) == {}
    ended = list[str]()
    for event in heard:
        if event.what == "started":
            assert set(event.task.needs) <= set(ended)
        else:
            ended.append(event.task.key)
    assert sorted(ended) == sorted(one.key for one in ALL)
    assert max(count for _, count in executor.beside) == 1


def test_an_estimator_is_timed_with_nothing_beside_it_unless_that_is_asked_for(tmp_path):
    alone, shared = Recorder(3), Recorder(3)
    perform_all(ALL, tmp_path, alone)
    perform_all(ALL, tmp_path, shared, shares_time=True)
    assert {count for name, count in alone.beside if name.startswith("estimate")} == {0}
    assert max(count for name, count in shared.beside if name.startswith("estimate")) > 0


def threads_of(tasks, store, cores, monkeypatch, *, slots, shares_time=False):
    """The threads that each task is given on a machine of so many cores, by its name."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(cores)))
    recorder = Recorder(slots)
    perform_all(tasks, store, recorder, shares_time=shares_time)
    return recorder.threads


def test_slots_share_the_cores_and_a_task_that_runs_alone_has_all_of_them(tmp_path, monkeypatch):
    threads = threads_of(ALL, tmp_path, 8, monkeypatch, slots=4)
    assert threads["light"] == NO_LIMIT  # nothing else is ready
    assert {threads[one.inputs["name"]] for one in PICTURES} == {2}
    assert {threads[one.inputs["name"]] for one in ESTIMATES} == {NO_LIMIT}  # timed: nothing runs beside it


def test_estimators_that_share_their_time_share_the_cores_too(tmp_path, monkeypatch):
    threads = threads_of(ALL, tmp_path, 8, monkeypatch, slots=2, shares_time=True)
    assert 4 in {threads[one.inputs["name"]] for one in ESTIMATES}


@pytest.mark.parametrize(("cores", "slots", "expected"), [(8, 3, 2), (2, 4, 1), (9, 2, 4)])
def test_a_slot_has_its_whole_share_of_the_cores_and_one_at_least(tmp_path, monkeypatch, cores, slots, expected):
    independent = [task(f"pictures {n}") for n in range(12)]
    threads = threads_of(independent, tmp_path, cores, monkeypatch, slots=slots)
    assert threads["pictures 0"] == expected
    assert set(threads.values()) <= {expected, NO_LIMIT}


def test_the_only_slot_has_all_cores(tmp_path, monkeypatch):
    independent = [task(f"pictures {n}") for n in range(3)]
    assert set(threads_of(independent, tmp_path, 8, monkeypatch, slots=1).values()) == {NO_LIMIT}


@pytest.mark.parametrize(
    ("slot", "threads", "cores"),
    [(0, 2, [10, 11]), (1, 2, [12, 13]), (2, 2, [10, 11]), (1, 3, [13, 10, 11]), (0, 9, [10, 11, 12, 13])],
)
def test_each_slot_has_cores_of_its_own_as_long_as_there_are_some(slot, threads, cores):
    assert executor._share([10, 11, 12, 13], slot, threads) == cores


def test_a_failure_takes_what_needs_it_along_and_nothing_else(tmp_path):
    failures = {PICTURES[1].key: TaskOutcome("crashed", "lens fell off")}
    found = perform_all(ALL, tmp_path, Recorder(2, failures))
    assert set(found) == {PICTURES[1].key, ESTIMATES[1].key, SCORES[1].key}
    assert found[SCORES[1].key] == TaskOutcome("crashed", "its sequence could not be made: lens fell off")


def test_the_temporary_folder_of_a_process_that_was_killed_in_a_run_is_gone_after_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with temporary_folder() as folder:
        base = folder.parent

    class Killed(Recorder):
        def close(self):
            base.mkdir(mode=0o700)
            (base / "1-killed" / "home").mkdir(parents=True)  # without a lock, which ended with the process

    perform_all([LIGHT], tmp_path, Killed(1))
    assert not base.exists()


def test_ten_thousand_tasks_are_handed_out_in_little_time(tmp_path):
    class Instant(Recorder):
        def submit(self, one, store, slot, threads, tell):
            from concurrent.futures import Future

            future = Future()
            future.set_result(TaskOutcome())
            return future

    tasks = [task(f"s{n}") for n in range(2000)]
    tasks += [task(f"e{n} {k}", "estimate", (one.key,)) for n, one in enumerate(tasks) for k in range(4)]
    began = os.times().user
    assert perform_all(tasks, tmp_path, Instant(2)) == {}
    assert os.times().user - began < 20


def run(bench, tmp_path: Path, executor: Executor, *changes, on_event=lambda _: None, **options) -> RunFolder:
    try:
        return run_suite(
            bench.plan(*changes), {}, root=tmp_path / "runs", store=tmp_path / "store", executor=executor,
            finish=page.write_reports, on_event=on_event, **options,
        )  # fmt: skip
    finally:
        executor.close()


def kill_all(executor: LocalProcesses, number: int) -> None:
    """Send a signal to all that runs, once it has started."""
    for process in list(executor._running):
        assert process.pid(timeout_s=30)
        process.kill(number)


def files(folder: RunFolder) -> dict[str, bytes]:
    chosen = [path for path in folder.path.rglob("*") if path.is_file() and path.name not in ("environment.json",)]
    kept = [path for path in chosen if "times" not in path.name and path.name != PAGE]
    return {str(path.relative_to(folder.path)): path.read_bytes() for path in kept}


def test_two_processes_write_the_bytes_that_one_does(bench, first, tmp_path):
    two = run(bench, tmp_path, LocalProcesses(2))
    assert files(two) == files(first)


def test_sequences_of_one_light_share_a_process_and_nothing_else_does(tmp_path, monkeypatch):
    executor, started = LocalProcesses(1), []
    start = executor._server.start_worker
    monkeypatch.setattr(executor._server, "start_worker", lambda: started.append(start()) or started[-1])
    lit, dark = PICTURES[:3], task("pictures of another light", needs=("another",))
    counts = []
    for one in (LIGHT, *lit, dark, lit[0]):
        done = executor.submit(one, tmp_path, 0, 1, lambda _: None).result(timeout=600)
        assert done.failure  # there is no such key, and the process lives on
        counts.append(len(started))
    executor.close()
    assert counts == [1, 2, 2, 2, 3, 4]
    assert not executor._running
    assert not executor._idle


def test_a_sequence_whose_process_dies_counts_for_no_estimator(bench, tmp_path, monkeypatch):
    executor = LocalProcesses(2)
    submit = executor.submit

    def deadly(one: Task, store: Path, slot: int, threads: int, tell):
        is_doomed = one.stage == "sequence" and "dim" in one.subject.name
        if is_doomed:
            one = replace(one, subject=SimpleNamespace(name=one.subject.name))  # whatever it then trips over
        future = submit(one, store, slot, threads, tell)
        if is_doomed:
            kill_all(executor, signal.SIGSEGV)
        return future

    monkeypatch.setattr(executor, "submit", deadly)
    folder = run(bench, tmp_path, executor)
    rows = {(score.case, score.estimator): (score.status, score.reason) for score in folder.scores()}
    dim = [said for (case, _), said in rows.items() if "dim" in case]
    assert len(dim) == 2
    assert all(status == "no_sequence" and reason for status, reason in dim)
    assert all(not finding.wrong for finding in verify_run(folder))
    assert "1 of 2 cases could not be simulated or imported" in (folder.path / "leaderboard.html").read_text()
    (unmade,) = folder.unmade()
    assert unmade.cases == ("dim",)


def test_an_error_while_a_process_is_waited_for_ends_the_run_instead_of_hanging_it(tmp_path, monkeypatch):
    def fails(self, *_):
        raise ZeroDivisionError("in the thread")

    monkeypatch.setattr(executor._Worker, "ask", fails)
    with pytest.raises(ZeroDivisionError, match="in the thread"):
        perform_all([LIGHT], tmp_path, LocalProcesses(1))


def test_what_a_fault_of_a_library_ended_is_made_once_more(bench, tmp_path, monkeypatch):
    executor, hit, heard = LocalProcesses(2), [], []
    submit = executor.submit

    def once(one: Task, store: Path, slot: int, threads: int, tell):
        future = submit(one, store, slot, threads, tell)
        if one.stage == "sequence" and "dim" in one.name:
            hit.append(one.key)
            kill_all(executor, signal.SIGABRT)
        return future

    monkeypatch.setattr(executor, "submit", once)
    folder = run(bench, tmp_path, executor, on_event=heard.append)
    assert [score.reason for score in folder.scores() if score.status != "ok"] == []
    told = {event.task.key: event.told for event in heard if event.what == "told"}
    assert hit
    for key in hit:
        assert told[key].startswith(f"{key}: its process ended with signal SIGABRT")
        assert told[key].endswith(", because of a fault in a library; it is repeated once")


@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGABRT])
def test_the_stack_of_what_a_fault_ended_is_kept_with_the_task(bench, tmp_path, monkeypatch, number):
    """In a worker that waits for a lock, so that its stack is known."""
    executor, one = LocalProcesses(1), next(each for each in plan(bench.plan(), {}) if each.stage == "score")
    told = SimpleQueue()
    with locked(tmp_path / "state" / "locks" / one.key.replace("/", "-")):
        future = executor.submit(one, tmp_path, 0, 1, told.put)
        assert told.get(timeout=60).startswith("waiting for")
        kill_all(executor, number)
        done = future.result(timeout=60)
    executor.close()
    assert "in _awaited" in done.stack
    kept = f"state/faults/{one.key.replace('/', '-')}.txt"
    assert done.reason == f"its process ended with signal {number.name} (its stack: {kept} in the cache)"
    assert done.stack in (tmp_path / kept).read_text()


def test_what_a_task_raises_in_this_process_is_a_row_too(bench, tmp_path, monkeypatch):
    from vobench.runner import task as stages

    def raising(*_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setitem(stages.PERFORMERS, "score", raising)
    folder = run(bench, tmp_path, Serial())
    assert {(s.status, s.reason) for s in folder.scores()} == {("crashed", "ZeroDivisionError: division by zero")}


def test_a_missing_library_ends_the_run_with_how_to_get_it(bench, tmp_path, monkeypatch):
    from vobench.errors import MissingDependencyError
    from vobench.runner import task as stages

    def lacking(*_):
        raise MissingDependencyError("cannot draw without a display; run: apt-get install -y libegl1")

    monkeypatch.setitem(stages.PERFORMERS, "bake", lacking)
    with pytest.raises(MissingDependencyError, match="run: apt-get install -y libegl1"):
        run(bench, tmp_path, Serial())
    assert not list((tmp_path / "runs").rglob("*.json"))


@pytest.mark.parametrize("stage", ["bake", "sequence"])
def test_a_run_without_a_single_sequence_makes_no_folder_and_names_cause_and_remedy(
    bench, tmp_path, monkeypatch, stage
):
    from vobench.errors import NoSequenceError
    from vobench.runner import task as stages

    def broken(*_):
        raise AttributeError("module 'OpenGL.GL' has no attribute 'glClipControl'")

    monkeypatch.setitem(stages.PERFORMERS, stage, broken)
    with pytest.raises(NoSequenceError) as raised:
        run(bench, tmp_path, Serial())
    sentence = str(raised.value)
    assert sentence.startswith("no case could be simulated or imported, so nothing was scored: full, dim: ")
    assert sentence.count("glClipControl") == 1
    assert "vobench doctor" in sentence
    assert not list((tmp_path / "runs").rglob("*.json"))


def test_a_case_that_cannot_be_simulated_counts_for_no_estimator(bench, tmp_path, monkeypatch):
    from vobench.errors import NoSequenceError
    from vobench.runner import task as stages

    simulate = stages.PERFORMERS["sequence"]

    def some(case, *others):
        if case.name == "dim":
            raise RuntimeError("the lamp is out")
        simulate(case, *others)

    monkeypatch.setitem(stages.PERFORMERS, "sequence", some)
    folder = run(bench, tmp_path, Serial())
    board = page.run_board(folder, folder.scores())
    assert board.cases == ["full"]
    assert {total.failed for total in board.totals} == {0}
    assert {s.status for s in folder.scores() if s.case == "dim"} == {"no_sequence"}
    (remark,) = [said for said in board.remarks if "could not be simulated" in said]
    assert remark.startswith("1 of 2 cases could not be simulated or imported and count for no estimator: dim: ")
    assert "the lamp is out" in remark
    assert not [finding for finding in verify_run(folder) if finding.wrong]
    with pytest.raises(NoSequenceError, match="1 of 2 cases could not be simulated"):
        run(bench, tmp_path, Serial(), require_all=True)


def test_a_full_disk_ends_the_run_with_what_to_do(bench, tmp_path, monkeypatch):
    import errno

    from vobench.errors import InputError
    from vobench.runner import task as stages

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device", str(tmp_path / "store"))

    monkeypatch.setitem(stages.PERFORMERS, "bake", full)
    with pytest.raises(InputError, match=r"no space is left on the device; free some, or let VOBENCH_CACHE name"):
        run(bench, tmp_path, Serial())


def test_the_plan_of_a_real_suite_is_performed_whole(bench, first):
    assert perform_all(plan(bench.plan(), {}), bench.folder / "cache", Serial()) == {}


def assert_says_for_whom_it_waits(executor: Executor, store: Path) -> None:
    """The user reads for whom a task waits while it still waits."""
    one, told = task("pictures"), SimpleQueue()
    executor.submit(task("imports"), store, 0, 1, print).result(timeout=60)
    with locked(store / "state" / "locks" / one.key.replace("/", "-")):
        future = executor.submit(one, store, 0, 1, told.put)
        sentence = told.get(timeout=60)
        assert not future.done()
    assert sentence.startswith(f"waiting for process {os.getpid()} on {socket.gethostname()}, which makes sequences-")
    assert future.result(timeout=60).failure
    executor.close()


def test_a_worker_says_for_whom_it_waits_while_it_waits(tmp_path):
    assert_says_for_whom_it_waits(LocalProcesses(1), tmp_path)


@pytest.fixture
def dask():
    """A scheduler with two workers on this machine."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, worker_dashboard_address=None
    ) as cluster:
        yield cluster


@pytest.mark.filterwarnings("ignore")
def test_the_workers_of_a_dask_scheduler_write_the_same_bytes(bench, first, tmp_path, dask):
    assert files(run(bench, tmp_path, Dask(dask.scheduler_address))) == files(first)


@pytest.mark.filterwarnings("ignore")
def test_a_worker_of_dask_says_for_whom_it_waits_while_it_waits(tmp_path, dask):
    assert_says_for_whom_it_waits(Dask(dask.scheduler_address), tmp_path)


@pytest.mark.filterwarnings("ignore")
def test_what_a_worker_of_dask_started_for_a_client_ends_when_the_client_is_gone(tmp_path, dask):
    executor, one, told = Dask(dask.scheduler_address), task("pictures"), SimpleQueue()
    with locked(tmp_path / "state" / "locks" / one.key.replace("/", "-")):
        executor.submit(one, tmp_path, 0, 1, told.put)
        told.get(timeout=60)
        workers = [worker.pid for worker in dask.workers.values()]
        assert started_by_vobench(workers)
        executor.close()
        until_s = time.monotonic() + 10
        while started_by_vobench(workers) and time.monotonic() < until_s:
            time.sleep(0.05)
        assert started_by_vobench(workers) == []


def started_by_vobench(ancestors: list[int]) -> list[str]:
    """The command lines of living fork servers and workers below some processes."""
    children = dict[int, list[int]]()
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, parent = path.read_text(errors="replace").rpartition(")")[2].split()[:2]
            if state not in "ZX":
                children.setdefault(int(parent), []).append(int(path.parent.name))
    below, found = [pid for ancestor in ancestors for pid in children.get(ancestor, [])], []
    for pid in below:  # which grows
        below += children.get(pid, [])
        with suppress(OSError):
            found.append(Path(f"/proc/{pid}/cmdline").read_text(errors="replace"))
    return [line for line in found if "fork_server" in line]


def test_a_scheduler_that_is_not_there_is_a_sentence(monkeypatch):
    from vobench.errors import InputError

    pytest.importorskip("distributed")
    monkeypatch.setattr(executor, "CONNECT_S", 0.5)
    with pytest.raises(InputError, match=r"no Dask scheduler answers .*: tcp://127.0.0.1:1"):
        Dask("tcp://127.0.0.1:1")


@pytest.mark.parametrize(
    ("exit_code", "status", "reason"),
    [
        (3, "crashed", "its process ended with exit code 3"),
        (0, "crashed", "its process ended with exit code 0"),
        (None, "crashed", "its process ended with exit code None"),
        (-int(signal.SIGSEGV), "crashed", "its process ended with signal SIGSEGV"),
        (-int(signal.SIGKILL), "out_of_memory", "its process was killed by the system, most likely for memory"),
    ],
)
def test_the_death_of_a_process_is_told_by_its_exit_code_or_its_signal(exit_code, status, reason):
    assert _death(exit_code, 1.5) == TaskOutcome(status, reason, 1.5)
