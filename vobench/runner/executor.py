"""Who performs the tasks of a run: this process, some processes of this machine, or the workers of a Dask cluster.

Every executor takes one task at a time and answers with a future of `Done`, which never raises; `perform_all` decides
what runs when. A task that fails takes those that need it with it, and nobody else.
"""

import errno
import os
import signal
import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal, Protocol

from vobench import __version__, stop
from vobench.errors import InputError, MissingDependencyError, VobenchError
from vobench.runner.key import code_digest
from vobench.runner.store import Progress, SilentProgress
from vobench.runner.task import ENTRIES, NO_LIMIT, Stage, Task, perform

FailureKind = Literal["crashed", "out_of_memory", "refused"]
# What no other task can do without either.
Shortage = Literal["disk", "library"]
LOOK_S = 0.2
GRACE_S = 1.0  # for a process that is asked to stop
CONNECT_S = 10.0
# What a library's fault ends, as once in hundreds of sequences; what is made so is the same however often it is made.
FAULTS, MADE = (-signal.SIGABRT, -signal.SIGSEGV, -signal.SIGBUS), ("bake", "sequence")
# What a stage makes, in the words of a sentence about what needed it.
PRODUCTS: dict[Stage, str] = {
    "bake": "scene's light",
    "sequence": "sequence",
    "import": "sequence",
    "estimate": "estimate",
    "score": "score",
}
# What processes of tasks import, once for all of them.
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
    `told` are the sentences on the store that the user should read.
    """

    failure: FailureKind | None = None
    reason: str = ""
    wall_s: float = 0.0
    lacks: Shortage | None = None
    told: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Event:
    """News of one task: `what` happens to it, on which slot of the executor, after how many seconds, and why."""

    what: Literal["started", "done", "failed"]
    task: Task
    slot: int
    wall_s: float = 0.0
    reason: str = ""
    told: tuple[str, ...] = ()


class Executor(Protocol):
    """Performs one task in each of its slots."""

    slots: int

    def submit(self, task: Task, store: Path, slot: int, threads: int) -> "Future[Done]":
        """Begin a task; `threads` is how many it may use, NO_LIMIT for as many as there are."""

    def close(self) -> None:
        """End whatever still runs."""


class Serial:
    """One task after another in this process."""

    slots = 1

    def __init__(self, progress: Progress = SilentProgress()) -> None:  # noqa: B008 - no state
        self._progress = progress

    def submit(self, task: Task, store: Path, slot: int, threads: int) -> "Future[Done]":
        """Perform it now."""
        del slot, threads
        future: Future[Done] = Future()
        future.set_result(performed(task, store, NO_LIMIT, self._progress))
        return future

    def close(self) -> None:
        """Nothing runs."""


def performed(task: Task, store: Path, threads: int, progress: Progress = SilentProgress()) -> Done:  # noqa: B008
    """Perform a task; what it raises is told, but for a request to stop."""
    began, told = time.monotonic(), list[str]()
    if isinstance(progress, SilentProgress):  # nobody hears of it here
        progress = SilentProgress(told.append)
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
    return Done(wall_s=time.monotonic() - began, told=tuple(told))


FULL = "no space is left on the device; free some, or let VOBENCH_CACHE name a folder elsewhere"


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


class LocalProcesses:
    """Processes forked from a server that has imported what tasks import and nothing else, one for each task.

    Only sequences of one light, one after the other in a slot, share a process, which then has their scene at hand.
    Each slot has cores of its own, as many as a task is given threads: what draws, traces, filters and multiplies
    looks at which cores it may use.
    """

    def __init__(self, slots: int) -> None:
        self.slots, self._cores = slots, sorted(os.sched_getaffinity(0))
        self._context = get_context("forkserver")
        self._context.set_forkserver_preload(PRELOADED)
        self._running: set[Any] = set()
        self._idle: dict[int, _Worker] = {}

    def submit(self, task: Task, store: Path, slot: int, threads: int) -> "Future[Done]":
        """Give the task to a process; a thread waits for what it says, or for its end."""
        future: Future[Done] = Future()
        cores = self._cores if threads == NO_LIMIT else _share(self._cores, slot, threads)
        first = self._worker(slot, task, cores)

        def await_end() -> None:
            worker, done = first, first.ask(task, store)
            if task.stage in MADE and worker.process.exitcode in FAULTS:
                told = f"{task.key}: {done.reason}, by a fault in a library; it is made once more"
                self._running.discard(worker.process)
                worker.leave()
                worker = self._worker(slot, task, cores)
                done = worker.ask(task, store)
                done = replace(done, told=(told, *done.told))
            if task.stage == "sequence" and worker.process.is_alive():
                self._idle[slot] = worker
            else:
                worker.leave()
            self._running.discard(worker.process)
            future.set_result(done)

        threading.Thread(target=await_end, name=f"task {task.key}", daemon=True).start()
        return future

    def _worker(self, slot: int, task: Task, cores: list[int]) -> "_Worker":
        kept = self._idle.pop(slot, None)
        if kept and (kept.at_hand, kept.cores) == (_takes_up(task), cores) and kept.process.is_alive():
            self._running.add(kept.process)
            return kept
        if kept:
            kept.leave()
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_work, args=(theirs, cores), daemon=False)
        process.start()
        theirs.close()
        self._running.add(process)
        return _Worker(process, ours, cores, _takes_up(task))

    def close(self) -> None:
        """Let go what waits; ask what runs to stop, then kill it."""
        while self._idle:
            self._idle.popitem()[1].leave()
        for end in (signal.SIGTERM, signal.SIGKILL):
            for process in list(self._running):
                if process.pid and process.is_alive():
                    os.kill(process.pid, end)
            until = time.monotonic() + GRACE_S
            while self._running and time.monotonic() < until:
                time.sleep(0.01)


@dataclass(frozen=True, slots=True)
class _Worker:
    """A process that performs tasks, on these cores, until nobody can send it another."""

    process: Any
    connection: Any
    cores: list[int]
    at_hand: str

    def ask(self, task: Task, store: Path) -> Done:
        """What it says of a task, or how it died."""
        began = time.monotonic()
        try:
            self.connection.send((task, store))
            return self.connection.recv()  # type: ignore[no-any-return]
        except (EOFError, OSError):
            self.process.join()
            return _death(self.process.exitcode, time.monotonic() - began)

    def leave(self) -> None:
        self.connection.close()
        self.process.join()


def _share(cores: Sequence[int], slot: int, threads: int) -> list[int]:
    first = slot * threads % len(cores)
    return [cores[(first + n) % len(cores)] for n in range(min(threads, len(cores)))]


def _death(exitcode: int | None, wall_s: float) -> Done:
    if exitcode == -signal.SIGKILL:
        return Done("out_of_memory", "its process was killed by the system, most likely for memory", wall_s)
    by = f"signal {signal.Signals(-exitcode).name}" if exitcode and exitcode < 0 else f"exit code {exitcode}"
    return Done("crashed", f"its process ended with {by}", wall_s)


def _work(connection: Connection, cores: Sequence[int]) -> None:
    """Tasks in a process of its own, which goes when whoever started it does."""
    os.setsid()  # the terminal's Ctrl-C is the parent's
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: stop.request(number))
    os.sched_setaffinity(0, cores)
    threading.Thread(target=_leave_with, args=(os.getppid(),), daemon=True).start()
    try:
        while True:
            task, store = connection.recv()
            connection.send(performed(task, store, len(cores)))
    except (EOFError, OSError):
        return  # nobody asks or hears any more
    except stop.Stopped:
        os._exit(128 + stop.requested())


def _leave_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(LOOK_S)
    stop.undo_all()
    os._exit(1)


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
            own, theirs = versions(), self._client.run(versions)
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

    def submit(self, task: Task, store: Path, slot: int, threads: int) -> "Future[Done]":
        """Send the task to the worker of that slot, or to another where that one is gone."""
        future: Future[Done] = Future()
        worker = self._workers[slot]
        sent = self._client.submit(
            performed, task, store, threads, key=task.key, workers=[worker], allow_other_workers=True, pure=False
        )

        def ended(sent: Any) -> None:
            error = sent.exception()
            future.set_result(Done("crashed", f"on {worker}: {_line(error)}") if error else sent.result())

        sent.add_done_callback(ended)
        return future

    def close(self) -> None:
        """Leave the scheduler; what was sent to it is taken back."""
        self._client.close()


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
        queue, own = cls(), {task.key for task in tasks}
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
    queue, failures, running = _Queue.of(tasks), dict[str, Done](), dict["Future[Done]", tuple[Task, int]]()
    last = [""] * executor.slots
    try:
        while len(queue) or running:
            stop.check()
            _fill(queue, running, last, executor, store, shares_time=shares_time, heard=heard)
            for future in wait(running, timeout=LOOK_S, return_when=FIRST_COMPLETED).done:
                task, slot = running.pop(future)
                done = future.result()
                if done.lacks == "library":
                    raise MissingDependencyError(done.reason)
                if done.lacks:
                    raise InputError(done.reason)
                heard(Event("failed" if done.failure else "done", task, slot, done.wall_s, done.reason, done.told))
                if not done.failure:
                    queue.release(task.key)
                    continue
                failures[task.key] = done
                lost = f"its {PRODUCTS[task.stage]} could not be made: {done.reason}"
                for other in queue.fell(task.key):
                    failures[other.key] = Done(done.failure, lost)
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
        running[executor.submit(task, store, slot, threads)] = (task, slot)
