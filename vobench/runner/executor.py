"""Who performs the tasks of a run: this process, some processes of this machine, or the workers of a Dask cluster.

Every executor takes one task at a time and answers with a future of `Done`, which never raises; `perform_all` decides
what runs when. A task that fails takes those that need it with it, and nobody else.
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

from vobench import __version__, stop
from vobench.errors import InputError, MissingDependencyError, VobenchError
from vobench.runner.fork_server import ForkServer, WorkerProcess, shared_server, watch
from vobench.runner.key import code_digest
from vobench.runner.store import STATE, Progress, SilentProgress, Store, Tell
from vobench.runner.task import ENTRIES, NO_LIMIT, Stage, Task, perform

FailureKind = Literal["crashed", "out_of_memory", "refused"]
# What no other task can do without either.
Shortage = Literal["disk", "library"]
LOOK_S = 0.2
GRACE_S = 0.7  # for a process that is asked to stop, before it is killed
STOP_S = 0.4  # for its main thread, before another one tidies up and ends it
CONNECT_S = 10.0
MOST_OF_A_STACK = 1 << 20  # bytes
# What a library's fault ends, as once in hundreds of sequences; what is made so is the same however often it is made.
FAULTS = (-signal.SIGABRT, -signal.SIGSEGV, -signal.SIGBUS)
MADE = ("bake", "sequence")
# What a stage makes, in the words of a sentence about what needed it.
PRODUCTS: dict[Stage, str] = {
    "bake": "scene's light",
    "sequence": "sequence",
    "import": "sequence",
    "estimate": "estimate",
    "score": "score",
}
# The function of worker processes, and what they import, once for all of them.
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
class Done:
    """How a task ended: no failure, or which and why.

    `lacks` names what ends the whole run, as no other task can end better without it.
    `stack` is what a process wrote when a fault of a library ended it.
    """

    failure: FailureKind | None = None
    reason: str = ""
    wall_s: float = 0.0
    lacks: Shortage | None = None
    stack: str = ""


@dataclass(frozen=True, slots=True)
class Event:
    """News of one task: `what` happens to it, on which slot of the executor, after how many seconds, and why.

    A message that the user should read, such as for whom the task waits, is `told`, and comes at once.
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

    def submit(self, task: Task, store: Path, slot: int, threads: int, tell: Tell) -> "Future[Done]":
        """Begin a task; `threads` is how many it may use, NO_LIMIT for as many as there are.

        `tell` is called with messages for the user while the task is under way, from any thread.
        """

    def close(self) -> None:
        """End whatever still runs."""


class Serial:
    """One task after another in this process."""

    slots = 1

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress

    def submit(self, task: Task, store: Path, slot: int, threads: int, tell: Tell) -> "Future[Done]":
        """Perform it now."""
        del slot, threads
        future: Future[Done] = Future()
        future.set_result(performed(task, store, NO_LIMIT, self._progress or SilentProgress(tell)))
        return future

    def close(self) -> None:
        """Nothing runs."""


def performed(task: Task, store: Path, threads: int, progress: Progress) -> Done:
    """Perform a task; whatever it raises becomes its result, except a request to stop."""
    began = time.monotonic()
    try:
        perform(task, store, threads, progress=progress)
    except MissingDependencyError as error:
        return Done("refused", _line(error), time.monotonic() - began, lacks="library")
    except VobenchError as error:
        return Done("refused", _line(error), time.monotonic() - began)
    except MemoryError:
        return Done("out_of_memory", "there was not enough memory", time.monotonic() - began)
    except Exception as error:  # of one cell; the others go on
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return Done("refused", f"{FULL}: {error.filename or store}", time.monotonic() - began, lacks="disk")
        return Done("crashed", f"{type(error).__name__}: {_line(error)}", time.monotonic() - began)
    return Done(wall_s=time.monotonic() - began)


FULL = "no space is left on the device; free some, or let VOBENCH_CACHE name a folder elsewhere"


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


class LocalProcesses:
    """Processes forked from a server that has imported what tasks import and nothing else, one for each task.

    Only sequences of one light, one after the other in a slot, share a process, which then has their scene at hand.
    Unless `pins_cores` is False, each slot has its own cores, as many as a task is given threads: libraries that draw,
    trace, filter and multiply look at which cores they may use.
    """

    def __init__(self, slots: int, *, server: ForkServer | None = None, pins_cores: bool = True) -> None:
        self.slots = slots
        self._cores = sorted(os.sched_getaffinity(0))
        self._pins_cores = pins_cores
        self._server = server or shared_server(ENTRY, PRELOADED)
        self._running: set[WorkerProcess] = set()
        self._idle: dict[int, _Worker] = {}
        self._stores: set[Path] = set()

    def submit(self, task: Task, store: Path, slot: int, threads: int, tell: Tell) -> "Future[Done]":
        """Give the task to a process; a thread waits for its messages and its end."""
        future: Future[Done] = Future()
        self._stores.add(store)
        has_all = threads == NO_LIMIT or not self._pins_cores
        cores = self._cores if has_all else _share(self._cores, slot, threads)
        limit = len(cores) if self._pins_cores else threads
        first = self._worker(slot, task, cores)

        def await_end() -> None:
            worker = first
            done = worker.ask(task, store, limit, tell)
            fault = worker.process.exit_code in FAULTS
            if fault:
                done = worker.traced(done, task, store)
            if fault and task.stage in MADE:
                tell(f"{task.key}: {done.reason}, by a fault in a library; it is made once more")
                self._running.discard(worker.process)
                worker.leave()
                worker = self._worker(slot, task, cores)
                done = worker.ask(task, store, limit, tell)
                if worker.process.exit_code in FAULTS:
                    done = worker.traced(done, task, store)
            if task.stage == "sequence" and worker.process.is_alive:
                self._idle[slot] = worker
            else:
                worker.leave()
            self._running.discard(worker.process)
            future.set_result(done)

        threading.Thread(target=await_end, name=f"task {task.key}", daemon=True).start()
        return future

    def _worker(self, slot: int, task: Task, cores: list[int]) -> "_Worker":
        idle = self._idle.pop(slot, None)
        if idle and (idle.at_hand, idle.cores) == (_takes_up(task), cores) and idle.process.is_alive:
            self._running.add(idle.process)
            return idle
        if idle:
            idle.leave()
        process = self._server.start_worker()
        self._running.add(process)
        worker = _Worker(process, cores, _takes_up(task), TemporaryFile())  # noqa: SIM115 - it lives as long as the worker
        worker.begin()
        return worker

    def close(self) -> None:
        """End the idle processes; ask those that run to stop, kill them after a grace period, and tidy up."""
        while self._idle:
            self._idle.popitem()[1].leave()
        was_killed = False
        for number in (signal.SIGTERM, signal.SIGKILL):
            running = [process for process in list(self._running) if process.is_alive and not process.abandon()]
            for process in running:
                process.kill(number)
                was_killed = was_killed or number == signal.SIGKILL
            ends_s = time.monotonic() + GRACE_S
            while any(process.is_alive for process in running) and time.monotonic() < ends_s:
                time.sleep(0.01)
        for store in self._stores if was_killed else ():
            Store(store).sweep()


@dataclass(frozen=True, slots=True)
class _Worker:
    """A process that performs tasks, on these cores, until nobody can send it another.

    `trace` is the file to which it writes its stack when a fault ends it.
    """

    process: WorkerProcess
    cores: list[int]
    at_hand: str
    trace: IO[bytes]

    def begin(self) -> None:
        """Tell the process where it works; it may not have started yet."""
        with suppress(OSError):  # it is dead: `ask` says so
            self.process.connection.send((os.getcwd(), dict(os.environ), self.cores))
            send_handle(self.process.connection, self.trace.fileno(), None)

    def ask(self, task: Task, store: Path, threads: int, tell: Tell) -> Done:
        """How the process reports that a task ended, or how the process died; its messages go to `tell` at once."""
        began = time.monotonic()
        try:
            self.process.connection.send((task, store, threads))
            while not isinstance(answer := self.process.connection.recv(), Done):
                tell(answer)
        except (EOFError, OSError):
            return _death(self.process.join(), time.monotonic() - began)
        return answer

    def traced(self, done: Done, task: Task, store: Path) -> Done:
        """The same failure with the stack that the process wrote when a fault ended it, which is kept in the store."""
        self.trace.seek(0)
        stack = self.trace.read(MOST_OF_A_STACK).decode("utf-8", "replace")
        if not stack:
            return done
        name = f"{STATE}/faults/{task.key.replace('/', '-')}.txt"
        with suppress(OSError):
            (store / name).parent.mkdir(parents=True, exist_ok=True)
            (store / name).write_text(f"{task.stage} {task.name}: {done.reason}\n\n{stack}", encoding="utf-8")
        return replace(done, reason=f"{done.reason} (its stack: {name} in the cache)", stack=stack)

    def leave(self) -> None:
        """End the process."""
        self.process.close()
        self.trace.close()


def _share(cores: Sequence[int], slot: int, threads: int) -> list[int]:
    first = slot * threads % len(cores)
    return [cores[(first + n) % len(cores)] for n in range(min(threads, len(cores)))]


def _death(exitcode: int | None, wall_s: float) -> Done:
    if exitcode == -signal.SIGKILL:
        return Done("out_of_memory", "its process was killed by the system, most likely for memory", wall_s)
    by = f"signal {signal.Signals(-exitcode).name}" if exitcode and exitcode < 0 else f"exit code {exitcode}"
    return Done("crashed", f"its process ended with {by}", wall_s)


def work(connection: Connection, vobench_fd: int) -> None:
    """Perform tasks in a forked process until vobench needs no more, or is gone.

    `vobench_fd` becomes readable when vobench ends; -1 on systems without such descriptors.
    """
    os.setsid()  # the terminal's Ctrl-C is vobench's
    signals_fd, wakes_fd = os.pipe()
    os.set_blocking(wakes_fd, False)
    signal.set_wakeup_fd(wakes_fd)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: stop.request(number))
    watching = partial(watch, connection, vobench_fd, signals_fd, grace_s=STOP_S, leave=_leave)
    threading.Thread(target=watching, name="watch vobench", daemon=True).start()
    try:
        folder, environment, cores = connection.recv()
        # The stack of every thread, that of the libraries too since Python 3.14, where a fault ends this process.
        faulthandler.enable(recv_handle(connection))
        os.environ.clear()
        os.environ.update(environment)
        with suppress(OSError):
            os.chdir(folder)
        os.sched_setaffinity(0, cores)
        while True:
            task, store, threads = connection.recv()
            connection.send(performed(task, store, threads, SilentProgress(connection.send)))
    except (EOFError, OSError):
        return  # nobody asks or listens any more
    except stop.Stopped:
        os._exit(128 + stop.requested())


def _leave() -> None:
    """Tidy up and end this process, whatever its main thread does."""
    stop.undo_all()
    os._exit(128 + stop.requested() if stop.requested() else 1)


class Dask:
    """The workers of a Dask scheduler, which share the store's folder and have the same code."""

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
            own = versions()
            theirs = self._client.run(versions)
        except OSError as error:
            self.close()
            raise InputError(f"a Dask worker went while we asked it, try again ({_line(error)}): {address}") from None
        for worker, found in theirs.items():
            other = [f"{name} {said}, not {own[name]}" for name, said in found.items() if said != own[name]]
            if other:
                self.close()
                raise InputError(f"the worker has {other[0]}: {worker}")
        if not theirs:
            self.close()
            raise InputError(f"this Dask scheduler has no workers: {address}")
        self._workers = list(theirs)
        self.slots = len(self._workers)
        # Every worker that performs tasks of ours holds the lease, which the scheduler takes back when we are gone.
        self._lease = f"vobench-lease-{uuid4().hex}"
        self._held = self._client.submit(str, self._lease, key=self._lease, pure=False)
        self._tells: dict[str, Tell] = {}
        self._client.subscribe_topic(self._lease, self._hear)

    def submit(self, task: Task, store: Path, slot: int, threads: int, tell: Tell) -> "Future[Done]":
        """Send the task to the worker of that slot, or to another where that one is gone."""
        future: Future[Done] = Future()
        worker = self._workers[slot]
        self._tells[task.key] = tell
        sent = self._client.submit(
            _performed_for, self._held, task, store, threads,
            key=task.key, workers=[worker], allow_other_workers=True, pure=False,
        )  # fmt: skip

        def ended(sent: Any) -> None:
            error = sent.exception()
            future.set_result(Done("crashed", f"on {worker}: {_line(error)}") if error else sent.result())

        sent.add_done_callback(ended)
        return future

    def _hear(self, event: tuple[float, tuple[str, str]]) -> None:
        """Pass on a message of a task under way."""
        _, (key, sentence) = event
        self._tells[key](sentence)

    def close(self) -> None:
        """Leave the scheduler; what was sent to it is taken back."""
        self._client.close()


_processes_for: dict[str, LocalProcesses] = {}
_leases_lock = threading.Lock()


def _performed_for(lease: str, task: Task, store: Path, threads: int) -> Done:
    """Perform a task on a Dask worker, in a process that ends as soon as the client that holds the lease is gone."""
    from distributed import get_worker

    worker = get_worker()
    with _leases_lock:
        if lease not in _processes_for:
            server = ForkServer(ENTRY, PRELOADED)
            _processes_for[lease] = LocalProcesses(1, server=server, pins_cores=False)
            leaving = partial(_leave_with, lease, worker, server)
            threading.Thread(target=leaving, name=f"watch {lease}", daemon=True).start()
        processes = _processes_for[lease]

    def tell(sentence: str) -> None:
        worker.log_event(lease, (task.key, sentence))

    return processes.submit(task, store, threading.get_ident(), threads, tell).result()


def _leave_with(lease: str, worker: Any, server: ForkServer) -> None:
    """End what runs for a client on this Dask worker once the client is gone."""
    while lease in worker.data:
        time.sleep(LOOK_S)
    _processes_for.pop(lease).close()
    server.close()


def versions() -> dict[str, str]:
    """What two machines must have in common for their results to be of one run."""
    import platform

    entries = sorted({entry for modules in ENTRIES.values() for entry in modules})
    python = ".".join(platform.python_version_tuple()[:2])
    return {"vobench": __version__, "Python": python, "code": code_digest(*entries)[:12]}


@dataclass(slots=True)
class _Queue:
    """The tasks that wait: those that are ready, timed ones apart, by what they take up; and who waits for whom."""

    ready: tuple[dict[str, deque[Task]], dict[str, deque[Task]]] = field(default_factory=lambda: ({}, {}))
    missing: dict[str, int] = field(default_factory=dict)
    after: dict[str, list[Task]] = field(default_factory=lambda: defaultdict(list))

    @classmethod
    def of(cls, tasks: Sequence[Task]) -> "_Queue":
        queue = cls()
        own = {task.key for task in tasks}
        for task in tasks:
            needs = own.intersection(task.needs)
            queue.missing[task.key] = len(needs)
            for key in needs:
                queue.after[key].append(task)
            if not needs:
                queue.add(task)
        return queue

    def add(self, task: Task) -> None:
        self.ready[_is_timed(task)].setdefault(_takes_up(task), deque()).append(task)

    def take(self, last: str, *, timed: bool) -> Task | None:
        """The first that is ready of what a slot took up last, else of anything; one that is timed only if `timed`."""
        for ready in self.ready[: 1 + timed]:
            if ready:
                first = last if last in ready else next(iter(ready))
                task = ready[first].popleft()
                if not ready[first]:
                    del ready[first]
                return task
        return None

    def __len__(self) -> int:
        return sum(len(tasks) for ready in self.ready for tasks in ready.values())

    def release(self, key: str) -> None:
        """Tasks that waited for this one alone are ready."""
        for task in self.after.pop(key, ()):
            self.missing[task.key] -= 1
            if not self.missing[task.key]:
                self.add(task)

    def fell(self, key: str) -> Iterator[Task]:
        """All that cannot be performed without this one."""
        for task in self.after.pop(key, ()):
            if self.missing.pop(task.key, None) is not None:
                yield task
                yield from self.fell(task.key)


def _is_timed(task: Task) -> bool:
    return task.stage == "estimate"


def _takes_up(task: Task) -> str:
    """The light or sequence that a task reads; whoever has it at hand should have the next one too."""
    return task.needs[0] if task.needs else task.key


def perform_all(
    tasks: Sequence[Task],
    store: Path,
    executor: Executor,
    *,
    shares_time: bool = False,
    heard: Callable[[Event], object] = lambda _: None,
) -> dict[str, Done]:
    """Perform tasks, each after those that it needs; the failures by key, those of what they took with them included.

    An estimator is timed: unless `shares_time`, nothing else runs beside it. `heard` is called with what happens.
    Raises InputError if the disk is full, MissingDependencyError if a library is missing, and Stopped.
    """
    queue = _Queue.of(tasks)
    failures = dict[str, Done]()
    running = dict["Future[Done]", tuple[Task, int]]()
    last = [""] * executor.slots
    messages: SimpleQueue[Event] = SimpleQueue()
    try:
        while len(queue) or running:
            stop.check()
            _fill(queue, running, last, executor, store, messages=messages, shares_time=shares_time, heard=heard)
            ended = wait(running, timeout=LOOK_S, return_when=FIRST_COMPLETED).done
            while not messages.empty():
                heard(messages.get())
            for future in ended:
                task, slot = running.pop(future)
                done = future.result()
                if done.lacks == "library":
                    raise MissingDependencyError(done.reason)
                if done.lacks:
                    raise InputError(done.reason)
                heard(Event("failed" if done.failure else "done", task, slot, done.wall_s, done.reason))
                if not done.failure:
                    queue.release(task.key)
                    continue
                failures[task.key] = done
                lost = f"its {PRODUCTS[task.stage]} could not be made: {done.reason}"
                for other in queue.fell(task.key):
                    failures[other.key] = Done(done.failure, lost, stack=done.stack)
    finally:
        executor.close()
    return failures


def _fill(
    queue: _Queue,
    running: dict["Future[Done]", tuple[Task, int]],
    last: list[str],
    executor: Executor,
    store: Path,
    *,
    messages: "SimpleQueue[Event]",
    shares_time: bool,
    heard: Callable[[Event], object],
) -> None:
    """Begin what may begin now."""
    cores = len(os.sched_getaffinity(0))
    for slot in sorted(set(range(executor.slots)) - {slot for _, slot in running.values()}):
        if not shares_time and any(_is_timed(task) for task, _ in running.values()):
            return
        task = queue.take(last[slot], timed=shares_time or not running)
        if task is None:
            return
        last[slot] = _takes_up(task)
        is_alone = not running and ((_is_timed(task) and not shares_time) or not len(queue))
        heard(Event("started", task, slot))
        threads = NO_LIMIT if is_alone or executor.slots == 1 else max(cores // executor.slots, 1)

        def tell(sentence: str, task: Task = task, slot: int = slot) -> None:
            messages.put(Event("told", task, slot, told=sentence))

        running[executor.submit(task, store, slot, threads, tell)] = (task, slot)
