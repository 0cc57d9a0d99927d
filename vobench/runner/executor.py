"""Executes the tasks of a run in this process, in processes of this machine, or on the workers of a Dask cluster.

An executor takes one task at a time and returns a future of `TaskOutcome`, which never raises. `perform_all` decides
the order. If a task fails, only the tasks that need it fail as well.
"""

import errno
import faulthandler
import os
import signal
import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.reduction import recv_handle, send_handle
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryFile
from typing import IO, Any, Literal, Protocol
from uuid import uuid4

from vobench import __version__, stop, trust
from vobench.errors import InputError, MissingDependencyError, VobenchError
from vobench.runner.fork_server import ForkServer, WorkerProcess, shared_server, watch
from vobench.runner.key import code_digest
from vobench.runner.simulate import last_renderer
from vobench.runner.store import STATE, Progress, SilentProgress, Store, Tell
from vobench.runner.task import ENTRIES, NO_LIMIT, Stage, Task, perform
from vobench.temporary import remove_abandoned_folders
from vobench.trust import TrustPolicy

FailureKind = Literal["crashed", "out_of_memory", "refused"]
# Missing resources that would make all other tasks fail, too.
Shortage = Literal["disk", "library"]
LOOK_S = 0.2
GRACE_S = 0.7  # the time for a process to stop, before it is killed
STOP_S = 0.4  # the time for its main thread to stop, before another thread cleans up and ends the process
CONNECT_S = 10.0
STACK_BYTES = 1 << 20  # the largest size of a stack that is stored
END_LOOK_S = 0.01
# The exit codes of a process that a fault in a library ended, which happens once in hundreds of sequences.
FAULTS = (-signal.SIGABRT, -signal.SIGSEGV, -signal.SIGBUS)
# The stages that are repeated after a fault, because their result is deterministic.
REPEATABLE = ("bake", "sequence")
# The result of a stage as a noun.
PRODUCTS: dict[Stage, str] = {
    "bake": "scene's light",
    "sequence": "sequence",
    "import": "sequence",
    "estimate": "estimate",
    "score": "score",
}
# The function of worker processes, and the modules that are imported once for all of them.
ENTRY = "vobench.runner.executor:work"
PRELOADED = [
    "vobench.runner.executor",
    "vobench.runner.simulate",
    "vobench.runner.estimate",
    "vobench.runner.score",
    "vobench.runner.sensors",
    "vobench.runner.stereo_camera",
    "vobench.rendering.raster",
    "vobench.suite.scene_build",
]


@dataclass(frozen=True, slots=True)
class TaskOutcome:
    """The outcome of a task: empty, or the kind of failure and the reason.

    `lacks` names a missing resource that ends the whole run, because all other tasks would lack it, too.
    `stack` is the stack that a process wrote when a fault in a library ended it.
    """

    failure: FailureKind | None = None
    reason: str = ""
    wall_s: float = 0.0
    lacks: Shortage | None = None
    stack: str = ""


@dataclass(frozen=True, slots=True)
class TaskEvent:
    """An event of one task: what happened, in which slot of the executor, after how many seconds, and why.

    `told` is a message for the user, for example that the task waits for another process.
    """

    what: Literal["started", "told", "done", "failed"]
    task: Task
    slot: int
    wall_s: float = 0.0
    reason: str = ""
    told: str = ""


class Executor(Protocol):
    """Performs one task in each of its slots."""

    slots: int

    def submit(self, task: Task, store: Path, slot: int, threads: int, tell: Tell) -> "Future[TaskOutcome]":
        """Begin a task. `threads` is the number of threads that it may use; NO_LIMIT does not limit them.

        `tell` is called with messages for the user while the task runs, from any thread.
        """

    def close(self) -> None:
        """End all tasks that still run."""


class Serial:
    """Performs tasks sequentially in this process."""

    slots = 1

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        last_renderer.is_kept = True

    def submit(self, task: Task, store: Path, slot: int, threads: int, tell: Tell) -> "Future[TaskOutcome]":
        """Perform the task immediately."""
        del slot, threads
        future: Future[TaskOutcome] = Future()
        future.set_result(performed(task, store, NO_LIMIT, self._progress or SilentProgress(tell)))
        return future

    def close(self) -> None:
        """Close the renderer of the last sequence. No task runs."""
        last_renderer.close()
        last_renderer.is_kept = False


def performed(task: Task, store: Path, threads: int, progress: Progress) -> TaskOutcome:
    """Perform a task, and return its outcome. An exception becomes the outcome, except a request to stop."""
    began_s = time.monotonic()
    try:
        perform(task, store, threads, progress=progress)
        done = TaskOutcome()
    except MissingDependencyError as error:
        done = TaskOutcome("refused", _line(error), lacks="library")
    except VobenchError as error:
        done = TaskOutcome("refused", _line(error))
    except MemoryError:
        done = TaskOutcome("out_of_memory", "there was not enough memory")
    except Exception as error:  # the other tasks continue
        done = _unexpected(error, store)
    return replace(done, wall_s=time.monotonic() - began_s)


FULL = "no space is left on the device; free some, or let VOBENCH_CACHE name a folder elsewhere"


def _unexpected(error: Exception, store: Path) -> TaskOutcome:
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return TaskOutcome("refused", f"{FULL}: {error.filename or store}", lacks="disk")
    return TaskOutcome("crashed", f"{type(error).__name__}: {_line(error)}")


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


class LocalProcesses:
    """Performs each task in a process, which is forked from a server that has imported the modules of tasks.

    Only sequences with the same light that follow each other in a slot share a process, which has their scene loaded.
    Unless `pins_cores` is False, each slot has separate cores, as many as a task gets threads, because libraries use
    as many threads as there are cores. `makers` says which makers of scenes may run; by default, it is this process's.
    """

    def __init__(
        self,
        slots: int,
        *,
        server: ForkServer | None = None,
        pins_cores: bool = True,
        makers: TrustPolicy | None = None,
    ) -> None:
        self.slots = slots
        self._makers = makers
        self._cores = sorted(os.sched_getaffinity(0))
        self._pins_cores = pins_cores
        self._server = server or shared_server(ENTRY, PRELOADED)
        self._running: set[WorkerProcess] = set()
        self._idle: dict[int, _Worker] = {}
        self._stores: set[Path] = set()

    def submit(self, task: Task, store: Path, slot: int, threads: int, tell: Tell) -> "Future[TaskOutcome]":
        """Give the task to a process. A thread waits for its messages and its end."""
        future: Future[TaskOutcome] = Future()
        self._stores.add(store)
        has_all = threads == NO_LIMIT or not self._pins_cores
        cores = self._cores if has_all else _share(self._cores, slot, threads)
        limit = len(cores) if self._pins_cores else threads
        first = self._worker(slot, task, cores)

        def outcome() -> TaskOutcome:
            worker = first
            done = worker.ask(task, store, limit, tell)
            if worker.had_fault and task.stage in REPEATABLE:
                tell(f"{task.key}: {done.reason}, because of a fault in a library; it is repeated once")
                self._running.discard(worker.process)
                worker.leave()
                worker = self._worker(slot, task, cores)
                done = worker.ask(task, store, limit, tell)
            if task.stage == "sequence" and worker.process.is_alive:
                self._idle[slot] = worker
            else:
                worker.leave()
            self._running.discard(worker.process)
            return done

        def await_end() -> None:
            try:
                future.set_result(outcome())
            except BaseException as error:  # otherwise the future would never be resolved
                first.leave()
                future.set_exception(error)

        threading.Thread(target=await_end, name=f"task {task.key}", daemon=True).start()
        return future

    def _worker(self, slot: int, task: Task, cores: list[int]) -> "_Worker":
        """The idle process of a slot if it has the task's input loaded and runs on these cores, or a new process."""
        idle = self._idle.pop(slot, None)
        if idle and idle.suits(task, cores):
            self._running.add(idle.process)
            return idle
        if idle:
            idle.leave()
        process = self._server.start_worker()
        self._running.add(process)
        trace = TemporaryFile()  # noqa: SIM115 - open as long as the worker runs
        worker = _Worker(process, cores, _main_input(task), trace, self._makers or trust.policy())
        worker.begin()
        return worker

    def close(self) -> None:
        """End idle processes, ask running ones to stop, and kill those that still run after GRACE_S."""
        while self._idle:
            _, idle = self._idle.popitem()
            idle.leave()
        self._signal_all(signal.SIGTERM)
        was_killed = self._signal_all(signal.SIGKILL)
        if was_killed:
            for store in self._stores:
                Store(store).sweep()
            remove_abandoned_folders()

    def _signal_all(self, number: int) -> bool:
        """Signal the running processes, and wait at most GRACE_S for them. Returns whether there were any."""
        running = [process for process in list(self._running) if process.is_alive and not process.abandon()]
        for process in running:
            process.kill(number)
        ends_s = time.monotonic() + GRACE_S
        while any(process.is_alive for process in running) and time.monotonic() < ends_s:
            time.sleep(END_LOOK_S)
        return bool(running)


@dataclass(frozen=True, slots=True)
class _Worker:
    """A process that performs tasks on certain cores until its connection is closed.

    `main_input` is the key of the light or sequence that it has loaded. `trace` is the file to which it writes its
    stack when a fault ends it. `makers` says which makers of scenes it may run.
    """

    process: WorkerProcess
    cores: list[int]
    main_input: str
    trace: IO[bytes]
    makers: TrustPolicy

    @property
    def had_fault(self) -> bool:
        """Whether a fault in a library has ended the process."""
        return self.process.exit_code in FAULTS

    def suits(self, task: Task, cores: list[int]) -> bool:
        """Whether the process runs on these cores and has the task's input loaded."""
        has_input = self.main_input == _main_input(task) and self.cores == cores
        return has_input and self.process.is_alive

    def begin(self) -> None:
        """Send the process its folder, environment and cores. It may not have started yet."""
        with suppress(OSError):  # the process is dead, which `ask` reports
            self.process.connection.send((os.getcwd(), dict(os.environ), self.cores, self.makers))
            send_handle(self.process.connection, self.trace.fileno(), None)

    def ask(self, task: Task, store: Path, threads: int, tell: Tell) -> TaskOutcome:
        """The outcome of a task that the process performs, or of the death of the process. Messages go to `tell`."""
        began_s = time.monotonic()
        try:
            self.process.connection.send((task, store, threads))
            while True:
                answer = self.process.connection.recv()
                if isinstance(answer, TaskOutcome):
                    return answer
                tell(answer)
        except (EOFError, OSError):
            done = _death(self.process.join(), time.monotonic() - began_s)
            return self._with_stack(done, task, store) if self.had_fault else done

    def _with_stack(self, done: TaskOutcome, task: Task, store: Path) -> TaskOutcome:
        """The failure with the stack that the process wrote when a fault ended it. The stack is stored."""
        self.trace.seek(0)
        stack = self.trace.read(STACK_BYTES).decode("utf-8", "replace")
        if not stack:
            return done
        name = f"{STATE}/faults/{task.key.replace('/', '-')}.txt"
        path = store / name
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(f"{task.stage} {task.name}: {done.reason}\n\n{stack}", encoding="utf-8")
        return replace(done, reason=f"{done.reason} (its stack: {name} in the cache)", stack=stack)

    def leave(self) -> None:
        """End the process."""
        self.process.close()
        self.trace.close()


def _share(cores: Sequence[int], slot: int, threads: int) -> list[int]:
    """The cores of a slot: one for each of its threads, or all cores if there are fewer."""
    count = min(threads, len(cores))
    first = slot * threads
    return [cores[(first + n) % len(cores)] for n in range(count)]


def _death(exit_code: int | None, wall_s: float) -> TaskOutcome:
    if exit_code == -signal.SIGKILL:
        return TaskOutcome("out_of_memory", "its process was killed by the system, most likely for memory", wall_s)
    cause = f"exit code {exit_code}"
    if exit_code and exit_code < 0:
        cause = f"signal {signal.Signals(-exit_code).name}"
    return TaskOutcome("crashed", f"its process ended with {cause}", wall_s)


def work(connection: Connection, vobench_fd: int) -> None:
    """Perform tasks in a forked process until vobench needs no more of them, or ends.

    `vobench_fd` becomes readable when vobench ends. It is -1 on systems without such descriptors.
    """
    os.setsid()  # Ctrl-C in the terminal is handled by vobench
    signals_fd, wakes_fd = os.pipe()
    os.set_blocking(wakes_fd, False)
    signal.set_wakeup_fd(wakes_fd)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: stop.request(number))
    watching = partial(watch, connection, vobench_fd, signals_fd, grace_s=STOP_S, leave=_leave)
    threading.Thread(target=watching, name="watch vobench", daemon=True).start()
    try:
        folder, environment, cores, makers = connection.recv()
        trust.adopt(makers)
        # If a fault ends this process, the stack of every thread is written; since Python 3.14 also that of libraries.
        faulthandler.enable(recv_handle(connection))
        os.environ.clear()
        os.environ.update(environment)
        with suppress(OSError):
            os.chdir(folder)
        os.sched_setaffinity(0, cores)
        last_renderer.is_kept = True
        while True:
            task, store, threads = connection.recv()
            connection.send(performed(task, store, threads, SilentProgress(connection.send)))
    except (EOFError, OSError):
        return  # vobench has closed the connection
    except stop.Stopped:
        os._exit(128 + stop.requested())


def _leave() -> None:
    """Clean up and end this process, regardless of what its main thread does."""
    stop.clean_up_all()
    number = stop.requested()
    os._exit(128 + number if number else 1)


class Dask:
    """Performs tasks on the workers of a Dask scheduler, which share the folder of the store and have the same code."""

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise InputError("--scheduler needs Dask; run: pip install 'vobench[dask]'") from None
        try:
            self._client = Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(f"no Dask scheduler answers ({_line(error)}): {address}") from None
        try:
            self._workers = self._checked_workers(address)
        except InputError:
            self.close()
            raise
        self.slots = len(self._workers)
        # Every worker that performs tasks of this client holds the lease, which expires with the client.
        self._lease = f"vobench-lease-{uuid4().hex}"
        self._held = self._client.submit(str, self._lease, key=self._lease, pure=False)
        self._tells: dict[str, Tell] = {}
        self._client.subscribe_topic(self._lease, self._hear)

    def _checked_workers(self, address: str) -> list[str]:
        """The addresses of the workers. Raises InputError if there are none, or if one has different versions."""
        expected = versions()
        try:
            versions_of = self._client.run(versions)
        except OSError as error:
            raise InputError(f"a Dask worker left during the check, try again ({_line(error)}): {address}") from None
        for worker, its_versions in versions_of.items():
            for name, version in its_versions.items():
                if version != expected[name]:
                    raise InputError(f"the worker has {name} {version}, not {expected[name]}: {worker}")
        if not versions_of:
            raise InputError(f"this Dask scheduler has no workers: {address}")
        return list(versions_of)

    def submit(self, task: Task, store: Path, slot: int, threads: int, tell: Tell) -> "Future[TaskOutcome]":
        """Send the task to the worker of the slot, or to another one if that has left."""
        future: Future[TaskOutcome] = Future()
        worker = self._workers[slot]
        self._tells[task.key] = tell
        sent = self._client.submit(
            _performed_for, self._held, task, store, threads, trust.policy(),
            key=task.key, workers=[worker], allow_other_workers=True, pure=False,
        )  # fmt: skip

        def ended(sent: Any) -> None:
            error = sent.exception()
            done = TaskOutcome("crashed", f"on {worker}: {_line(error)}") if error else sent.result()
            future.set_result(done)

        sent.add_done_callback(ended)
        return future

    def _hear(self, event: tuple[float, tuple[str, str]]) -> None:
        """Pass on a message of a running task."""
        _, (key, sentence) = event
        self._tells[key](sentence)

    def close(self) -> None:
        """Cancel all tasks and disconnect from the scheduler."""
        self._client.close()


_processes_for: dict[str, LocalProcesses] = {}
_leases_lock = threading.Lock()


def _performed_for(lease: str, task: Task, store: Path, threads: int, makers: TrustPolicy) -> TaskOutcome:
    """Perform a task on a Dask worker, in a process that ends when the client that holds the lease ends.

    `makers` says which makers of scenes the client trusts.
    """
    from distributed import get_worker

    worker = get_worker()
    with _leases_lock:
        if lease not in _processes_for:
            server = ForkServer(ENTRY, PRELOADED)
            _processes_for[lease] = LocalProcesses(1, server=server, pins_cores=False, makers=makers)
            leaving = partial(_leave_with, lease, worker, server)
            threading.Thread(target=leaving, name=f"watch {lease}", daemon=True).start()
        processes = _processes_for[lease]

    def tell(sentence: str) -> None:
        worker.log_event(lease, (task.key, sentence))

    return processes.submit(task, store, threading.get_ident(), threads, tell).result()


def _leave_with(lease: str, worker: Any, server: ForkServer) -> None:
    """End the tasks of a client on this Dask worker when the client ends."""
    while lease in worker.data:
        time.sleep(LOOK_S)
    _processes_for.pop(lease).close()
    server.close()


def versions() -> dict[str, str]:
    """The versions that must be equal on all machines that work on the same run."""
    import platform

    entries = sorted({entry for modules in ENTRIES.values() for entry in modules})
    python = ".".join(platform.python_version_tuple()[:2])
    return {"vobench": __version__, "Python": python, "code": code_digest(*entries)[:12]}


@dataclass(slots=True)
class _Queue:
    """The tasks that have not begun: those that are ready, by main input, and those that wait for others.

    `ready` contains tasks that may run concurrently, and `ready_timed` estimates, whose time is measured.
    `missing` is the number of tasks for which each waiting task waits, and `dependents` the tasks that wait for a task.
    """

    ready: dict[str, deque[Task]] = field(default_factory=dict)
    ready_timed: dict[str, deque[Task]] = field(default_factory=dict)
    missing: dict[str, int] = field(default_factory=dict)
    dependents: dict[str, list[Task]] = field(default_factory=lambda: defaultdict(list))

    @classmethod
    def of(cls, tasks: Sequence[Task]) -> "_Queue":
        queue = cls()
        keys = {task.key for task in tasks}
        for task in tasks:
            needs = keys.intersection(task.needs)
            queue.missing[task.key] = len(needs)
            for key in needs:
                queue.dependents[key].append(task)
            if not needs:
                queue.add(task)
        return queue

    def add(self, task: Task) -> None:
        """Add a task that is ready."""
        by_input = self.ready_timed if _is_timed(task) else self.ready
        by_input.setdefault(_main_input(task), deque()).append(task)

    def take(self, last: str, *, timed: bool) -> Task | None:
        """The first ready task with the last main input of a slot, or otherwise any. It is timed only if `timed`."""
        choices = [self.ready, self.ready_timed] if timed else [self.ready]
        for by_input in choices:
            if by_input:
                main_input = last if last in by_input else next(iter(by_input))
                task = by_input[main_input].popleft()
                if not by_input[main_input]:
                    del by_input[main_input]
                return task
        return None

    def __len__(self) -> int:
        """The number of tasks that are ready."""
        tasks = [*self.ready.values(), *self.ready_timed.values()]
        return sum(map(len, tasks))

    def release(self, key: str) -> None:
        """Make the tasks ready that waited only for this one."""
        for task in self.dependents.pop(key, ()):
            self.missing[task.key] -= 1
            if not self.missing[task.key]:
                self.add(task)

    def drop_dependents(self, key: str) -> Iterator[Task]:
        """Remove all tasks that cannot be performed without this one."""
        for task in self.dependents.pop(key, ()):
            if self.missing.pop(task.key, None) is not None:
                yield task
                yield from self.drop_dependents(task.key)


def _is_timed(task: Task) -> bool:
    return task.stage == "estimate"


def _main_input(task: Task) -> str:
    """The key of the light or sequence that a task reads. A slot that has it loaded should get the task."""
    return task.needs[0] if task.needs else task.key


def perform_all(
    tasks: Sequence[Task],
    store: Path,
    executor: Executor,
    *,
    shares_time: bool = False,
    on_event: Callable[[TaskEvent], object] = lambda _: None,
) -> dict[str, TaskOutcome]:
    """Perform tasks, each after those that it needs, and return all failures by key.

    An estimator is timed, so no other task runs beside it unless `shares_time`. `on_event` is called with events.
    Raises InputError if the disk is full, MissingDependencyError if a library is missing, and Stopped.
    """
    schedule = _Schedule(_Queue.of(tasks), store, executor, shares_time=shares_time, on_event=on_event)
    try:
        while not schedule.is_finished:
            stop.check()
            schedule.begin_tasks()
            schedule.await_ends()
    finally:
        executor.close()
        remove_abandoned_folders()  # those of workers that were killed during the run
    return schedule.failures


class _Schedule:
    """Distributes the tasks of a run over the slots of an executor, and collects failures by key."""

    def __init__(
        self,
        queue: _Queue,
        store: Path,
        executor: Executor,
        *,
        shares_time: bool,
        on_event: Callable[[TaskEvent], object],
    ) -> None:
        self.failures: dict[str, TaskOutcome] = {}
        self._queue = queue
        self._store = store
        self._executor = executor
        self._shares_time = shares_time
        self._on_event = on_event
        self._cores = len(os.sched_getaffinity(0))
        self._running: dict[Future[TaskOutcome], tuple[Task, int]] = {}
        self._last_inputs = [""] * executor.slots
        self._messages: SimpleQueue[TaskEvent] = SimpleQueue()

    @property
    def is_finished(self) -> bool:
        """Whether nothing runs and nothing is ready."""
        return not self._running and not len(self._queue)

    def begin_tasks(self) -> None:
        """Begin tasks that are ready, one in each free slot."""
        busy = {slot for _, slot in self._running.values()}
        for slot in range(self._executor.slots):
            if slot in busy:
                continue
            if not self._shares_time and self._has_timed:
                return
            task = self._queue.take(self._last_inputs[slot], timed=self._shares_time or not self._running)
            if task is None:
                return
            self._begin(task, slot)

    @property
    def _has_timed(self) -> bool:
        return any(_is_timed(task) for task, _ in self._running.values())

    def _begin(self, task: Task, slot: int) -> None:
        self._last_inputs[slot] = _main_input(task)
        threads = self._threads(task)
        self._on_event(TaskEvent("started", task, slot))

        def tell(sentence: str) -> None:
            self._messages.put(TaskEvent("told", task, slot, told=sentence))

        future = self._executor.submit(task, self._store, slot, threads, tell)
        self._running[future] = (task, slot)

    def _threads(self, task: Task) -> int:
        """The number of threads of a task: all if no other task can run at the same time, or the share of its slot."""
        runs_apart = _is_timed(task) and not self._shares_time
        is_alone = not self._running and (runs_apart or not len(self._queue))
        if is_alone or self._executor.slots == 1:
            return NO_LIMIT
        return max(self._cores // self._executor.slots, 1)

    def await_ends(self) -> None:
        """Wait briefly for tasks to end, and process their messages and outcomes."""
        ended = wait(self._running, timeout=LOOK_S, return_when=FIRST_COMPLETED).done
        while not self._messages.empty():
            self._on_event(self._messages.get())
        for future in ended:
            task, slot = self._running.pop(future)
            self._end(task, slot, future.result())

    def _end(self, task: Task, slot: int, done: TaskOutcome) -> None:
        if done.lacks == "library":
            raise MissingDependencyError(done.reason)
        if done.lacks:
            raise InputError(done.reason)
        what: Literal["failed", "done"] = "failed" if done.failure else "done"
        self._on_event(TaskEvent(what, task, slot, done.wall_s, done.reason))
        if not done.failure:
            self._queue.release(task.key)
            return
        self.failures[task.key] = done
        cause = f"its {PRODUCTS[task.stage]} could not be made: {done.reason}"
        for dependent in self._queue.drop_dependents(task.key):
            self.failures[dependent.key] = TaskOutcome(done.failure, cause, stack=done.stack)
