"""Two trajectories out of whatever files they lie in, on one clock."""

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import get_args

import numpy as np

from vobench.errors import InputError, TrajectoryError
from vobench.trajectory.formats import Order, Parsed, Reading, Unit, parse_any, parse_times
from vobench.trajectory.trajectory import Move, Trajectory, parse_move

NS_PER_S = 10**9
UNITS: tuple[Unit, ...] = get_args(Unit)
ORDERS: tuple[Order, ...] = get_args(Order)
TRUTH = "truth.mcap"
SENSORS = "sensors.mcap"
HEAD_BYTES = 4096  # enough to tell text from a recording
SAYS_TRUTH = re.compile(r"(?<![a-z])(gt|ground[ _-]?truth|truth|reference)(?![a-z])", re.IGNORECASE)
BY_ROW = "neither file has stamps: poses are paired by row, and a second is a row; --times names a file with stamps"
BY_FRAME = (
    "neither file has stamps: poses are paired by frame, and a second is a frame; --times names a file with stamps"
)
SAY_WHICH = (
    "say which with the frame's number as a column in front (13 columns), or stamp each file with a --times of its own"
)


@dataclass(frozen=True, slots=True)
class TrajectorySource:
    """A file, the topic in it, and what differs from its form: `words` such as ns, wxyz or axes:z,-x,-y."""

    path: Path
    topic: str | None = None
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TrajectoryPair:
    """Ground truth and estimate, what was done to the files, and how they are paired where neither has stamps."""

    gt: Reading
    est: Reading
    notes: tuple[str, ...] = ()
    by_frame: str | None = None


@dataclass(frozen=True, slots=True)
class _Read:
    parsed: Parsed
    path: Path
    moves: tuple[Move, ...]
    says_truth: bool
    unit: Unit | None = None  # as told, which nothing in the file can make wrong
    order: Order | None = None


def read_pair(
    gt: TrajectorySource, est: TrajectorySource, *, times: Sequence[Path] = (), any_unit: bool = False
) -> TrajectoryPair:
    """Read both; files without stamps get them from `times`, or are paired by frame where both have none.

    `any_unit` tries the finer units where stamps are too large for seconds. Raises InputError.
    """
    reads = [_read(gt, any_unit=any_unit), _read(est, any_unit=any_unit)]
    unstamped = [read for read in reads if read.parsed.t_ns is None]
    by_frame = None
    if times:
        if not unstamped:
            raise InputError(f"--times is for files without stamps, but both files have theirs: {times[0]}")
        stamped = [_stamp(read, times) for read in reads]
    elif len(unstamped) == 1:
        raise InputError(f"no stamps in {unstamped[0].path}; name the file that has them with --times")
    else:
        _require_same_frames(unstamped)
        stamped = [_numbered(read) for read in reads]
        if unstamped:
            has_frames = any(read.parsed.frames is not None for read in reads)
            by_frame = BY_FRAME if has_frames else BY_ROW
    notes = [note for read in reads for note in _notes(read)]
    return TrajectoryPair(_reading(stamped[0]), _reading(stamped[1]), tuple(notes), by_frame)


def _require_same_frames(reads: Sequence[_Read]) -> None:
    """Raise InputError where files without stamps can't be of the same frames."""
    rows = {len(read.parsed.T) for read in reads if read.parsed.frames is None}
    if len(rows) > 1:
        counts = " and ".join(f"{len(read.parsed.T)} in {read.path}" for read in reads)
        raise InputError(f"files without stamps pair by row, but have {counts} rows; {SAY_WHICH}")
    for read in reads:
        frames = read.parsed.frames
        if frames is not None and rows and frames[-1] >= min(rows):
            other = next(other for other in reads if other.parsed.frames is None)
            raise InputError(
                f"frames should be below {min(rows)}, the number of rows in {other.path}, but there is {frames[-1]} "
                f"in {read.path}"
            )


def _notes(read: _Read) -> list[str]:
    frames = read.parsed.frames
    notes = list(read.parsed.notes)
    if frames is not None:
        count = f"{len(frames)} poses for frames {frames[0]} to {frames[-1]}"
        notes.append(f"the first of 13 columns was read as the number of a frame ({count}): {read.path}")
    return notes


def read_one(source: TrajectorySource, *, times: Sequence[Path] = (), any_unit: bool = False) -> Reading:
    """Read one alone; a file without stamps needs `times`. Raises InputError."""
    read = _read(source, any_unit=any_unit)
    if times:
        read = _stamp(read, times)
    if read.parsed.t_ns is None:
        raise InputError(f"no stamps in {source.path}; name the file that has them as `times`")
    return _reading(read)


def _reading(read: _Read) -> Reading:
    parsed = read.parsed
    assert parsed.t_ns is not None
    T = reduce(lambda poses, move: move.apply(poses), read.moves, parsed.T)
    return Reading(
        Trajectory(parsed.t_ns, T),
        parsed.unit,
        read.unit or parsed.form_unit,
        None if read.order else parsed.order,
        read.says_truth,
        is_unit_told=read.unit is not None,
    )


def _stamp(read: _Read, times: Sequence[Path]) -> _Read:
    """The poses with their stamps out of the one file of times that fits them."""
    clocks = [(path, parse_times(_text(path), name=str(path))) for path in times]
    if read.parsed.t_ns is not None:
        return read
    fitting = [(path, t_ns) for path, clock in clocks if (t_ns := read.parsed.stamped_by(clock)) is not None]
    if not fitting:
        path, clock = clocks[0]
        given = f"{len(clock)} stamps in {path}" if len(clocks) == 1 else f"none of {len(clocks)} files of times is"
        raise InputError(f"{given} for {len(read.parsed.T)} poses in {read.path}; {SAY_WHICH}")
    if any(not np.array_equal(t_ns, fitting[0][1]) for _, t_ns in fitting):
        names = " and ".join(str(path) for path, _ in fitting)
        raise InputError(f"one file of times should fit the {len(read.parsed.T)} poses in {read.path}, but {names} do")
    return replace(read, parsed=replace(read.parsed, t_ns=fitting[0][1], unit="s", form_unit="s"))


def _numbered(read: _Read) -> _Read:
    if read.parsed.t_ns is not None:
        return read
    frames = np.arange(len(read.parsed.T), dtype=np.int64) if read.parsed.frames is None else read.parsed.frames
    return replace(read, parsed=replace(read.parsed, t_ns=frames * NS_PER_S))


def _read(source: TrajectorySource, *, any_unit: bool) -> _Read:
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
    comments = "\n".join(line for line in written[:HEAD_BYTES].splitlines() if line.startswith("#"))
    says_truth = bool(SAYS_TRUTH.search(path.stem) or SAYS_TRUTH.search(comments))
    parsed = _parse(written, str(path), unit, order, any_unit=any_unit)
    if (unit and parsed.t_ns is None) or (order and parsed.order is None):
        raise InputError(f"no {'stamps' if unit else 'quaternions'} to read as {unit or order} in {path}")
    return _Read(parsed, path, moves, says_truth, unit, order)


def _parse(written: str, name: str, unit: Unit | None, order: Order | None, *, any_unit: bool) -> Parsed:
    try:
        return parse_any(written, name=name, unit=unit, order=order)
    except TrajectoryError:
        if any_unit and not unit:
            for finer in UNITS[1:]:
                with suppress(TrajectoryError):
                    return parse_any(written, name=name, unit=finer, order=order)
        raise


def _words(words: Iterable[str]) -> tuple[Unit | None, Order | None, tuple[Move, ...]]:
    unit: Unit | None = None
    order: Order | None = None
    moves = []
    for word in words:
        if word in UNITS:
            unit = word
        elif word in ORDERS:
            order = word
        else:
            moves.append(parse_move(word))
    return unit, order, tuple(moves)


def _is_recording(path: Path) -> bool:
    if path.is_dir():
        return True
    head = _bytes(path, HEAD_BYTES)
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        return error.start < len(head) - 4 or b"\0" in head
    return b"\0" in head


def _bytes(path: Path, most: int = -1) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(most)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None


def _text(path: Path) -> str:
    content = _bytes(path)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise TrajectoryError(f"{path}:{line}: not a text in UTF-8") from None


def _recorded(path: Path, topic: str | None) -> Trajectory:
    """A sequence's true path of the left camera, or the poses of a topic."""
    folder = path if path.is_dir() else path.parent
    is_sequence = (folder / TRUTH).is_file() and (folder / SENSORS).is_file()
    if topic is None and is_sequence and (path.is_dir() or path.name == TRUTH):
        from vobench.runner.ground_truth import left_truth

        return left_truth(folder)
    from vobench.sequence.recording import is_recording, read_poses

    if not is_recording(path):
        kinds = "a sequence, nor a ROS 2 bag" if path.is_dir() else "text, nor an MCAP file or ROS bag"
        raise InputError(f"neither {kinds}: {path}")
    return read_poses(path, topic)
