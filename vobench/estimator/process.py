"""Runs an estimator that gets one frame at a time: a program in any language, or a Python class in a worker process.

Its answers are not trusted: their length is limited, they are checked, and each must arrive before a deadline.
"""

import fcntl
import json
import os
import pickle
import select
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from vobench.estimator.check import InvalidOutputError
from vobench.estimator.command import filled
from vobench.estimator.frame_memory import FrameMemory, frame_memory
from vobench.estimator.manifest import Limits
from vobench.estimator.message import (
    ANSWER_BYTES,
    FAILURES,
    HEADER,
    REASON_BYTES,
    VERSION,
    calibration,
    counted_parts,
    framed,
    pickled,
    read_answer,
    read_revision,
    shared_parts,
)
from vobench.estimator.program import LOOK_S, Answer, EstimatorFailure, Program
from vobench.estimator.program_path import hint_on_modules
from vobench.estimator.protocol import Frame
from vobench.estimator.sandbox import Sandbox
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array

PIPE_BYTES = 1 << 20  # the largest pipe of a user without privileges
READ_BYTES = 1 << 20
WORKER = (sys.executable, "-P", "-m", "vobench.estimator.worker")


@dataclass(frozen=True, slots=True)
class Connector:
    """The protocol of a kind of estimator.

    `opened` returns the argv and the payload of the message CALB. `framed` returns the parts of the message FRAM. It is
    None for vobench's worker, which gets the descriptor of a FrameMemory as its last argument.
    """

    opened: Callable[[Rig, Mapping[str, Any], int], tuple[Sequence[str], bytes]]
    framed: Callable[[Frame], list[bytes | memoryview]] | None


class EstimatorProcess:
    """A running estimator, whose output is written to `log`. Its methods raise EstimatorFailure."""

    def __init__(
        self, door: Connector, *, log: Path, limits: Limits, hidden: Sequence[Path] = (), folder: Path | None = None
    ) -> None:
        self._door = door
        self._log = log
        self._limits = limits
        self._hidden = hidden
        self._folder = folder
        self._running: AbstractContextManager[Program] | None = None
        self._memory: FrameMemory | None = None

    @property
    def sandbox(self) -> Sandbox | None:
        """What the estimator could see; None if it has not been started."""
        return self._program.sandbox if self._running else None

    @classmethod
    def of_class(
        cls,
        folder: Path,
        class_path: str,
        *,
        name: str,
        log: Path,
        limits: Limits,
        is_watched: bool = False,
        hidden: Sequence[Path] = (),
    ) -> Self:
        """An estimator that is a Python class. It runs in a worker process.

        With `is_watched`, it fails if it modifies a frame.
        """
        folder = folder.resolve()
        memory_bytes = limits.memory_mib << 20
        argv = [*WORKER, str(folder), class_path, name, str(memory_bytes)]

        def opened(rig: Rig, params: Mapping[str, Any], seed: int) -> tuple[Sequence[str], bytes]:
            return argv, pickle.dumps((rig, dict(params), seed, is_watched))

        return cls(Connector(opened, framed=None), log=log, limits=limits, hidden=hidden, folder=folder)

    @classmethod
    def of_stream(
        cls,
        argv: Sequence[str],
        folder: Path,
        *,
        log: Path,
        limits: Limits,
        rate_hz: float,
        hidden: Sequence[Path] = (),
    ) -> Self:
        """An estimator that is a program. It reads frames from standard input and writes poses to standard output."""

        def opened(rig: Rig, params: Mapping[str, Any], seed: int) -> tuple[Sequence[str], bytes]:
            content = {
                "version": VERSION,
                "seed": seed,
                "rate_hz": rate_hz,
                "params": dict(params),
                **calibration(rig),
            }
            words = filled(argv, folder, {**params, "seed": seed, "rate_hz": rate_hz})
            return words, json.dumps(content, default=str).encode()

        return cls(Connector(opened, framed=framed), log=log, limits=limits, hidden=hidden, folder=folder)

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Start the estimator, send the calibration, and wait until it is ready. A second call starts it again."""
        argv, payload = self._door.opened(rig, params, seed)
        if self._running is None:
            self._open(list(argv), rig)
        self._frames = 0
        until = self._until(self._limits.start_s)
        self._send(b"CALB", [payload], until)
        self._receive("its start", {b"REDY"}, until)
        self._program.look(at_once=True)

    def _open(self, argv: list[str], rig: Rig) -> None:
        inherited = []
        if self._door.framed is None:
            self._memory = frame_memory(rig)
            if self._memory:
                inherited = [self._memory.descriptor]
            argv = [*argv, str(self._memory.descriptor if self._memory else -1)]
        pipe = subprocess.PIPE
        self._program = self._running = Program(
            argv,
            log=self._log,
            limits=self._limits,
            hidden=self._hidden,
            folder=self._folder,
            inherited=inherited,
            stdin=pipe,
            stdout=pipe,
            bufsize=0,
        )
        process = self._program.process
        assert process.stdin
        assert process.stdout
        self._input = process.stdin.fileno()
        self._output = process.stdout.fileno()
        os.set_blocking(self._input, False)
        with suppress(OSError, AttributeError):  # only Linux can enlarge a pipe so that a picture fits into it
            fcntl.fcntl(self._input, fcntl.F_SETPIPE_SZ, PIPE_BYTES)

    def process(self, frame: Frame) -> Answer:
        """Send the next frame, and return the checked answer."""
        cpu_before_s = self._program.cpu_s
        self._refuse_early_answer(f"frame {frame.index}")

        began_s = time.monotonic()
        until = self._until(self._limits.frame_s)
        self._send_frame(frame, until)
        _, payload = self._receive(f"frame {frame.index}", {b"POSE"}, until)
        wall_s = time.monotonic() - began_s

        self._frames += 1
        self._program.look(at_once=True)
        try:
            result = read_answer(payload, frame.index)
        except InvalidOutputError as error:
            raise EstimatorFailure("invalid_output", str(error)) from None
        cpu_s = self._program.cpu_s - cpu_before_s
        return Answer(result, 1e3 * wall_s, 1e3 * cpu_s, self._program.peak_mib)

    def _send_frame(self, frame: Frame, until: float) -> None:
        """Send a frame. The arrays for a worker are in shared memory, if there is one and they fit into it."""
        if self._door.framed:
            self._send(b"FRAM", self._door.framed(frame), until)
            return
        contents = pickled(frame)
        if self._memory and self._memory.write(contents[1:]):
            self._send(b"SHRD", shared_parts(contents), until)
        else:
            self._send(b"FRAM", counted_parts(contents), until)

    def finish(self) -> dict[int, Array]:
        """Tell the estimator that there are no more frames, and return the poses that it revises."""
        self._refuse_early_answer("the end")
        revised = dict[int, Array]()
        until = self._until(self._program.left_s())
        self._send(b"DONE", [], until)
        for _ in range(self._frames + 1):
            tag, payload = self._receive("the end", {b"REVI", b"DONE", b""}, until)
            if tag != b"REVI":
                return revised
            try:
                revised.update(read_revision(payload))
            except InvalidOutputError as error:
                raise EstimatorFailure("invalid_output", str(error)) from None
        raise EstimatorFailure("invalid_output", f"the end: more revised poses than the {self._frames} frames it had")

    def _refuse_early_answer(self, what: str) -> None:
        """Raise EstimatorFailure if the estimator has sent an answer before the request."""
        readable, _, _ = select.select([self._output], [], [], 0)
        if readable:
            self._receive(f"{what}, before it was asked", set(), self._until(self._limits.frame_s))

    def _until(self, limit_s: float) -> float:
        self._limit_s = limit_s
        return time.monotonic() + limit_s

    def _send(self, tag: bytes, parts: Sequence[bytes | memoryview], until: float) -> None:
        length = sum(map(len, parts))
        unsent = [memoryview(part) for part in (HEADER.pack(tag, length), *parts)]
        while unsent:
            try:
                sent = os.writev(self._input, unsent)
            except BlockingIOError:
                self._await([], [self._input], until)
                continue
            except BrokenPipeError:
                if tag != b"DONE":
                    self._receive("its input", set(), until)  # raises the failure that the estimator reports
                return
            unsent = unsent_after(unsent, sent)

    def _receive(self, what: str, tags: set[bytes], until: float) -> tuple[bytes, bytes]:
        """The tag and payload of the next message. The tag is empty if the program has ended and `tags` allows that."""
        head = self._read(HEADER.size, what, until, may_end=b"" in tags)
        if not head:
            return b"", b""
        tag, length = HEADER.unpack(head)
        if tag in FAILURES:
            reason = self._read(min(length, REASON_BYTES), what, until).decode("utf-8", "replace")
            self._program.look(at_once=True)  # if a limit was exceeded, that is the cause of the failure
            is_isolated = self._program.sandbox.level != "none"
            if is_isolated and "ModuleNotFoundError" in reason:
                reason += hint_on_modules(self._folder)
            raise EstimatorFailure(FAILURES[tag], reason)
        if tag not in tags or length > ANSWER_BYTES:
            names = sorted(tag.decode() for tag in tags if tag)
            expected = " or ".join(names) or "nothing"
            raise EstimatorFailure(
                "invalid_output", f"{what}: it should answer {expected}, but says {tag!r} and {length} bytes"
            )
        return tag, self._read(length, what, until)

    def _read(self, length: int, what: str, until: float, *, may_end: bool = False) -> bytes:
        content = bytearray()
        while len(content) < length:
            self._await([self._output], [], until)
            missing = length - len(content)
            part = os.read(self._output, min(missing, READ_BYTES))
            if not part:
                kind, reason = self._end(what)
                if may_end and not content and kind == "invalid_output":
                    return b""
                torn = f": its answer breaks off after {len(content)} of {length} bytes" if content else ""
                raise EstimatorFailure(kind, reason + torn)
            content += part
        return bytes(content)

    def _end(self, what: str) -> tuple[str, str]:
        """The status and the reason of a premature end."""
        kind, reason = self._program.death()
        return kind, f"{what}: {reason}" if kind == "invalid_output" else reason

    def _await(self, reads: list[int], writes: list[int], until: float) -> None:
        while True:
            left_s = until - time.monotonic()
            ready = select.select(reads, writes, [], max(min(LOOK_S, left_s), 0))
            self._program.look()
            if any(ready):
                return
            if time.monotonic() > until:
                raise EstimatorFailure("timeout", f"no answer within {self._limit_s:g} s")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *end: Any) -> None:
        """End the estimator and all processes that it has started."""
        try:
            if self._running:
                self._running.__exit__(*end)
        finally:
            if self._memory:
                self._memory.close()


def unsent_after(parts: Sequence[memoryview], count: int) -> list[memoryview]:
    """What remains of the parts of a message after its first `count` bytes."""
    for number, part in enumerate(parts):
        if count < len(part):
            return [part[count:], *parts[number + 1 :]]
        count -= len(part)
    return []
