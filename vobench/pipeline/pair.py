"""Two trajectories out of whatever files they lie in, on one clock."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from vobench.errors import InputError, TrajectoryError
from vobench.trajectory.correction import Move, parse_move
from vobench.trajectory.form import Parsed, Reading, parse_any
from vobench.trajectory.table import Order, Unit
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.unstamped import parse_times

NS_PER_S = 10**9
UNITS: tuple[Unit, ...] = get_args(Unit)
TRUTH, SENSORS = "truth.mcap", "sensors.mcap"
HEAD_BYTES = 4096  # enough to tell text from a recording
SAYS_TRUTH = re.compile(r"(?<![a-z])(gt|ground[ _-]?truth|truth|reference)(?![a-z])", re.IGNORECASE)
BY_ROW = "neither file has stamps: poses are paired by row, and a second is a row; --times names a file with stamps"


@dataclass(frozen=True, slots=True)
class Source:
    """A file, the topic in it, and what differs from its form: `words` such as ns, wxyz or axes:z,-x,-y."""

    path: Path
    topic: str | None = None
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Pair:
    """Ground truth and estimate, and what a reader of their scores should know."""

    gt: Reading
    est: Reading
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Read:
    parsed: Parsed
    path: Path
    moves: tuple[Move, ...]
    says_truth: bool


def read_pair(gt: Source, est: Source, *, times: Path | None = None, any_unit: bool = False) -> Pair:
    """Read both; files without stamps get them from `times`, or are paired by row where both have none.

    `any_unit` tries the finer units where stamps are too large for seconds. Raises InputError.
    """
    reads = {"gt": _read(gt, any_unit=any_unit), "est": _read(est, any_unit=any_unit)}
    unstamped = [read for read in reads.values() if read.parsed.t_ns is None]
    notes: tuple[str, ...] = ()
    if times is not None:
        stamped = {side: _stamp(read, times) for side, read in reads.items()}
        if not unstamped:
            raise InputError(f"--times is for files without stamps, but both files have theirs: {times}")
    elif len(unstamped) == 1:
        raise InputError(f"no stamps in {unstamped[0].path}; name the file that has them with --times")
    elif unstamped and len({len(read.parsed.T) for read in unstamped}) != 1:
        counts = " and ".join(f"{len(read.parsed.T)} in {read.path}" for read in unstamped)
        raise InputError(f"files without stamps pair by row, but have {counts} rows; stamp them with --times")
    else:
        stamped = {side: _numbered(read) for side, read in reads.items()}
        notes = (BY_ROW,) if unstamped else ()
    return Pair(_reading(stamped["gt"]), _reading(stamped["est"]), notes)


def read_one(source: Source, *, times: Path | None = None, any_unit: bool = False) -> Reading:
    """Read one alone; a file without stamps needs `times`. Raises InputError."""
    read = _read(source, any_unit=any_unit)
    if times is not None:
        read = _stamp(read, times)
    if read.parsed.t_ns is None:
        raise InputError(f"no stamps in {source.path}; name the file that has them as `times`")
    return _reading(read)


def _reading(read: _Read) -> Reading:
    parsed = read.parsed
    assert parsed.t_ns is not None
    T = parsed.T
    for move in read.moves:
        T = move.apply(T)
    return Reading(Trajectory(parsed.t_ns, T), parsed.unit, parsed.form_unit, parsed.order, read.says_truth)


def _stamp(read: _Read, times: Path) -> _Read:
    if read.parsed.t_ns is not None:
        return read
    t_ns = parse_times(_text(times), name=str(times))
    if len(t_ns) != len(read.parsed.T):
        raise InputError(f"{len(t_ns)} stamps in {times} for {len(read.parsed.T)} poses in {read.path}")
    return replace(read, parsed=replace(read.parsed, t_ns=t_ns, unit="s", form_unit="s"))


def _numbered(read: _Read) -> _Read:
    if read.parsed.t_ns is not None:
        return read
    return replace(read, parsed=replace(read.parsed, t_ns=np.arange(len(read.parsed.T), dtype=np.int64) * NS_PER_S))


def _read(source: Source, *, any_unit: bool) -> _Read:
    unit, order, moves = _words(source.words)
    path = source.path
    if _is_recording(path):
        if unit or order:
            raise InputError(f"a recording says its stamps' unit and quaternions' order itself: {path}")
        trajectory = _recorded(path, source.topic)
        return _Read(Parsed(trajectory.t_ns, trajectory.T_world_frame, "ns", "ns"), path, moves, says_truth=False)
    if source.topic:
        raise InputError(f"a topic is for a recording, but this is a text file: {path}")
    written = _text(path)
    says_truth = bool(SAYS_TRUTH.search(path.stem) or SAYS_TRUTH.search(_leading_comments(written)))
    parsed = _parse(written, str(path), unit, order, any_unit=any_unit)
    if (unit and parsed.t_ns is None) or (order and parsed.order is None):
        raise InputError(f"no {'stamps' if unit else 'quaternions'} to read as {unit or order} in {path}")
    return _Read(parsed, path, moves, says_truth)


def _parse(written: str, name: str, unit: Unit | None, order: Order | None, *, any_unit: bool) -> Parsed:
    try:
        return parse_any(written, name=name, unit=unit, order=order)
    except TrajectoryError:
        if not any_unit or unit:
            raise
        for finer in UNITS[1:]:
            try:
                return parse_any(written, name=name, unit=finer, order=order)
            except TrajectoryError:
                continue
        raise


def _words(words: Iterable[str]) -> tuple[Unit | None, Order | None, tuple[Move, ...]]:
    unit: Unit | None = None
    order: Order | None = None
    moves = []
    for word in words:
        if word in UNITS:
            unit = next(known for known in UNITS if known == word)
        elif word in ("xyzw", "wxyz"):
            order = "xyzw" if word == "xyzw" else "wxyz"
        else:
            moves.append(parse_move(word))
    return unit, order, tuple(moves)


def _is_recording(path: Path) -> bool:
    if path.is_dir():
        return True
    with _opened(path) as file:
        head = file.read(HEAD_BYTES)
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start < len(head) - 4 or b"\0" in head
    return b"\0" in head


def _opened(path: Path) -> Any:
    try:
        return path.open("rb")
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None


def _text(path: Path) -> str:
    with _opened(path) as file:
        content: bytes = file.read()
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise TrajectoryError(f"{path}:{line}: not a text in UTF-8") from None


def _leading_comments(written: str) -> str:
    head = written[:HEAD_BYTES].splitlines()
    return "\n".join(line for line in head if line.startswith("#"))


def _recorded(path: Path, topic: str | None) -> Trajectory:
    """A sequence's true path of the left camera, or the poses of a topic."""
    folder = path if path.is_dir() else path.parent
    is_sequence = (folder / TRUTH).is_file() and (folder / SENSORS).is_file()
    if topic is None and is_sequence and (path.is_dir() or path.name == TRUTH):
        from vobench.pipeline.truth_path import left_truth

        return left_truth(folder)
    from vobench.sequence.pose_topic import is_recording, read_poses

    if not is_recording(path):
        kinds = "a sequence, nor a ROS 2 bag" if path.is_dir() else "text, nor an MCAP file or ROS bag"
        raise InputError(f"neither {kinds}: {path}")
    return read_poses(path, topic)
