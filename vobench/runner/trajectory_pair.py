"""Reads a ground truth and an estimate from files of any format, with stamps on the same clock."""

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np

from vobench.errors import InputError, TrajectoryError
from vobench.trajectory.any_format import ParsedTrajectory, parse_any
from vobench.trajectory.kitti import parse_times
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.quaternion_columns import QuaternionOrder
from vobench.trajectory.stamp_text import StampUnit
from vobench.trajectory.trajectory import PoseConvention, Trajectory, parse_pose_convention

UNITS: tuple[StampUnit, ...] = get_args(StampUnit)
ORDERS: tuple[QuaternionOrder, ...] = get_args(QuaternionOrder)
TRUTH = "truth.mcap"
SENSORS = "sensors.mcap"
HEAD_BYTES = 4096  # enough to distinguish text from a recording
TRUTH_WORDS = re.compile(r"(?<![a-z])(gt|ground[ _-]?truth|truth|reference)(?![a-z])", re.IGNORECASE)
BY_ROW = "neither file has stamps: poses are paired by row, and a second is a row; --times names a file with stamps"
BY_FRAME = (
    "neither file has stamps: poses are paired by frame, and a second is a frame; --times names a file with stamps"
)
SAY_WHICH = (
    "say which with the frame's number as a column in front (13 columns), or stamp each file with a --times of its own"
)


@dataclass(frozen=True, slots=True)
class TrajectorySource:
    """A file, a topic in it, and `words` that specify its unit, order or axes, such as ns, wxyz or axes:z,-x,-y."""

    path: Path
    topic: str | None = None
    words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TrajectoryReading:
    """A trajectory, and how its file was read.

    `unit` is the unit in which the stamps were read, None if the file has no stamps.
    `format_unit` is the default unit of the file's format, None for a format without stamps.
    `order` is the order in which quaternions were read, None if the file has none.
    `mentions_ground_truth` is whether the file's name or a comment in it mentions ground truth.
    `is_unit_given` is whether the user specified the unit.
    """

    trajectory: Trajectory
    unit: StampUnit | None = "s"
    format_unit: StampUnit | None = "s"
    order: QuaternionOrder | None = "xyzw"
    mentions_ground_truth: bool = False
    is_unit_given: bool = False


@dataclass(frozen=True, slots=True)
class TrajectoryPair:
    """The ground truth, the estimate, notes on how they were read, and their pairing if neither file has stamps."""

    gt: TrajectoryReading
    est: TrajectoryReading
    notes: tuple[str, ...] = ()
    by_frame: str | None = None


@dataclass(frozen=True, slots=True)
class _Read:
    parsed: ParsedTrajectory
    path: Path
    moves: tuple[PoseConvention, ...]
    mentions_ground_truth: bool
    unit: StampUnit | None = None  # as specified by the user; it overrides the file
    order: QuaternionOrder | None = None


def read_pair(
    gt: TrajectorySource, est: TrajectorySource, *, times: Sequence[Path] = (), any_unit: bool = False
) -> TrajectoryPair:
    """Read both files. Files without stamps get them from `times`, or are paired by frame if both have none.

    `any_unit` tries finer units if stamps are too large for seconds. Raises InputError.
    """
    reads = [_read(gt, any_unit=any_unit), _read(est, any_unit=any_unit)]
    unstamped = [read for read in reads if read.parsed.t_ns is None]
    if times:
        if not unstamped:
            raise InputError(f"--times is for files without stamps, but both files have theirs: {times[0]}")
        gt_read, est_read = (_stamp(read, times) for read in reads)
    elif len(unstamped) == 1:
        raise InputError(f"no stamps in {unstamped[0].path}; name the file that has them with --times")
    else:
        _require_same_frames(unstamped)
        gt_read, est_read = (_numbered(read) for read in reads)
    notes = (*_notes(reads[0]), *_notes(reads[1]))
    by_frame = None if times else _pairing(unstamped)
    return TrajectoryPair(_reading(gt_read), _reading(est_read), notes, by_frame)


def _pairing(unstamped: Sequence[_Read]) -> str | None:
    """The pairing of files without stamps; None if there are none."""
    if not unstamped:
        return None
    has_frames = any(read.parsed.frames is not None for read in unstamped)
    return BY_FRAME if has_frames else BY_ROW


def _require_same_frames(unstamped: Sequence[_Read]) -> None:
    """Raise InputError if files without stamps cannot have the same frames."""
    by_row = [read for read in unstamped if read.parsed.frames is None]
    row_counts = {len(read.parsed.T) for read in by_row}
    if len(row_counts) > 1:
        counts = " and ".join(f"{len(read.parsed.T)} in {read.path}" for read in by_row)
        raise InputError(f"files without stamps pair by row, but have {counts} rows; {SAY_WHICH}")
    if not by_row:
        return
    rows = len(by_row[0].parsed.T)
    for read in unstamped:
        frames = read.parsed.frames
        if frames is not None and frames[-1] >= rows:
            raise InputError(
                f"frames should be below {rows}, the number of rows in {by_row[0].path}, but there is {frames[-1]} "
                f"in {read.path}"
            )


def _notes(read: _Read) -> list[str]:
    frames = read.parsed.frames
    notes = list(read.parsed.notes)
    if frames is not None:
        count = f"{len(frames)} poses for frames {frames[0]} to {frames[-1]}"
        notes.append(f"the first of 13 columns was read as the number of a frame ({count}): {read.path}")
    return notes


def read_one(source: TrajectorySource, *, times: Sequence[Path] = (), any_unit: bool = False) -> TrajectoryReading:
    """Read a single file. A file without stamps needs `times`. Raises InputError."""
    read = _read(source, any_unit=any_unit)
    if times:
        read = _stamp(read, times)
    if read.parsed.t_ns is None:
        raise InputError(f"no stamps in {source.path}; name the file that has them as `times`")
    return _reading(read)


def _reading(read: _Read) -> TrajectoryReading:
    parsed = read.parsed
    assert parsed.t_ns is not None
    T = parsed.T
    for move in read.moves:
        T = move.apply(T)
    return TrajectoryReading(
        Trajectory(parsed.t_ns, T),
        unit=parsed.unit,
        format_unit=read.unit or parsed.format_unit,
        order=None if read.order else parsed.order,
        mentions_ground_truth=read.mentions_ground_truth,
        is_unit_given=read.unit is not None,
    )


def _stamp(read: _Read, times: Sequence[Path]) -> _Read:
    """The poses with stamps from the only file of times that fits them."""
    clocks = {path: parse_times(_text(path), name=str(path)) for path in times}
    parsed = read.parsed
    if parsed.t_ns is not None:
        return read
    fitting = {}
    for path, clock in clocks.items():
        stamps = parsed.stamped_by(clock)
        if stamps is not None:
            fitting[path] = stamps
    if not fitting:
        given = f"none of {len(times)} files of times is"
        if len(times) == 1:
            given = f"{len(clocks[times[0]])} stamps in {times[0]}"
        raise InputError(f"{given} for {len(parsed.T)} poses in {read.path}; {SAY_WHICH}")
    first, *others = fitting.values()
    if any(not np.array_equal(stamps, first) for stamps in others):
        names = " and ".join(map(str, fitting))
        raise InputError(f"one file of times should fit the {len(parsed.T)} poses in {read.path}, but {names} do")
    return replace(read, parsed=replace(parsed, t_ns=first, unit="s", format_unit="s"))


def _numbered(read: _Read) -> _Read:
    """The poses with stamps that increase by one second per frame instead of the missing ones."""
    parsed = read.parsed
    if parsed.t_ns is not None:
        return read
    frames = parsed.frames
    if frames is None:
        frames = np.arange(len(parsed.T), dtype=np.int64)
    return replace(read, parsed=replace(parsed, t_ns=frames * NS_PER_S))


def _read(source: TrajectorySource, *, any_unit: bool) -> _Read:
    if _is_recording(source.path):
        return _read_recording(source)
    path = source.path
    unit, order, moves = _words(source.words)
    if source.topic:
        raise InputError(f"a topic is for a recording, but this is a text file: {path}")
    text = _text(path)
    comments = [line for line in text[:HEAD_BYTES].splitlines() if line.startswith("#")]
    mentions_ground_truth = any(TRUTH_WORDS.search(line) for line in (path.stem, *comments))
    parsed = _parse(text, str(path), unit, order, any_unit=any_unit)
    if unit and parsed.t_ns is None:
        raise InputError(f"no stamps to read as {unit} in {path}")
    if order and parsed.order is None:
        raise InputError(f"no quaternions to read as {order} in {path}")
    return _Read(parsed, path, moves, mentions_ground_truth, unit, order)


def _read_recording(source: TrajectorySource) -> _Read:
    unit, order, moves = _words(source.words)
    if unit or order:
        raise InputError(f"a recording states its stamps' unit and quaternions' order itself: {source.path}")
    trajectory = _recorded(source.path, source.topic)
    parsed = ParsedTrajectory(trajectory.t_ns, trajectory.T_world_frame, "ns", "ns")
    return _Read(parsed, source.path, moves, mentions_ground_truth=False)


def _parse(
    text: str, name: str, unit: StampUnit | None, order: QuaternionOrder | None, *, any_unit: bool
) -> ParsedTrajectory:
    try:
        return parse_any(text, name=name, unit=unit, order=order)
    except TrajectoryError:
        if any_unit and not unit:
            for finer in UNITS[1:]:
                with suppress(TrajectoryError):
                    return parse_any(text, name=name, unit=finer, order=order)
        raise


def _words(words: Iterable[str]) -> tuple[StampUnit | None, QuaternionOrder | None, tuple[PoseConvention, ...]]:
    unit: StampUnit | None = None
    order: QuaternionOrder | None = None
    moves = []
    for word in words:
        if word in UNITS:
            unit = word
        elif word in ORDERS:
            order = word
        else:
            moves.append(parse_pose_convention(word))
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
        raise TrajectoryError(f"{path}:{line}: not text in UTF-8") from None


def _recorded(path: Path, topic: str | None) -> Trajectory:
    """The true path of the left camera of a sequence, or the poses of a topic."""
    folder = path if path.is_dir() else path.parent
    is_sequence = (folder / TRUTH).is_file() and (folder / SENSORS).is_file()
    names_sequence = is_sequence and path in (folder, folder / TRUTH)
    if topic is None and names_sequence:
        from vobench.runner.ground_truth import left_truth

        return left_truth(folder)
    from vobench.sequence.recording import is_recording, read_poses

    if not is_recording(path):
        kinds = "a sequence, nor a ROS 2 bag" if path.is_dir() else "text, nor an MCAP file or ROS bag"
        raise InputError(f"neither {kinds}: {path}")
    return read_poses(path, topic)
