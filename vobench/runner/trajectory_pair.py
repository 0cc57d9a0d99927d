"""Reads a ground truth and an estimate from files of any format, with stamps on the same clock."""

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, get_args

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
MOST_BYTES_OF_CHARACTER = 4  # in UTF-8; the head can end in the middle of a character
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


class _Interpretation(NamedTuple):
    """How the user wants a file to be read. None means that the file's format decides."""

    unit: StampUnit | None
    order: QuaternionOrder | None
    conventions: tuple[PoseConvention, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _ReadFile:
    """The poses in a file as they were parsed, and what is known about them."""

    path: Path
    parsed: ParsedTrajectory
    interpretation: _Interpretation
    mentions_ground_truth: bool = False


def read_pair(
    gt: TrajectorySource, est: TrajectorySource, *, times: Sequence[Path] = (), any_unit: bool = False
) -> TrajectoryPair:
    """Read both files. Files without stamps get them from `times`, or are paired by frame if both have none.

    `any_unit` tries finer units if stamps are too large for seconds. Raises InputError.
    """
    files = [_read(gt, any_unit=any_unit), _read(est, any_unit=any_unit)]
    unstamped = [file for file in files if file.parsed.t_ns is None]
    if times:
        if not unstamped:
            raise InputError(f"--times is for files without stamps, but both files have theirs: {times[0]}")
        gt_file, est_file = (_stamped(file, times) for file in files)
    elif len(unstamped) == 1:
        raise InputError(f"no stamps in {unstamped[0].path}; name the file that has them with --times")
    else:
        _require_same_frames(unstamped)
        gt_file, est_file = (_stamped_by_frame(file) for file in files)
    return TrajectoryPair(
        gt=_reading(gt_file),
        est=_reading(est_file),
        notes=(*_notes(files[0]), *_notes(files[1])),
        by_frame=None if times else _pairing(unstamped),
    )


def _pairing(unstamped: Sequence[_ReadFile]) -> str | None:
    """The pairing of files without stamps; None if there are none."""
    if not unstamped:
        return None
    has_frames = any(file.parsed.frames is not None for file in unstamped)
    return BY_FRAME if has_frames else BY_ROW


def _require_same_frames(unstamped: Sequence[_ReadFile]) -> None:
    """Raise InputError if files without stamps cannot have the same frames."""
    by_row = [file for file in unstamped if file.parsed.frames is None]
    row_counts = {len(file.parsed.T) for file in by_row}
    if len(row_counts) > 1:
        counts = " and ".join(f"{len(file.parsed.T)} in {file.path}" for file in by_row)
        raise InputError(f"files without stamps pair by row, but have {counts} rows; {SAY_WHICH}")
    if not by_row:
        return
    rows = len(by_row[0].parsed.T)
    for file in unstamped:
        frames = file.parsed.frames
        if frames is not None and frames[-1] >= rows:
            raise InputError(
                f"frames should be below {rows}, the number of rows in {by_row[0].path}, but there is {frames[-1]} "
                f"in {file.path}"
            )


def _notes(file: _ReadFile) -> list[str]:
    """The notes on how a file was read."""
    frames = file.parsed.frames
    notes = list(file.parsed.notes)
    if frames is not None:
        count = f"{len(frames)} poses for frames {frames[0]} to {frames[-1]}"
        notes.append(f"the first of 13 columns was read as the number of a frame ({count}): {file.path}")
    return notes


def read_one(
    source: TrajectorySource,
    *,
    times: Sequence[Path] = (),
    any_unit: bool = False,
    needs_stamps: bool = True,
) -> TrajectoryReading:
    """Read a single file. Raises InputError.

    A file without stamps needs `times`. If the caller needs no stamps, a row is a second, and `unit` is None; this is
    not for files with the numbers of frames, since these would be lost.
    """
    file = _read(source, any_unit=any_unit)
    if times:
        file = _stamped(file, times)
    elif not needs_stamps and file.parsed.frames is None:
        file = _stamped_by_frame(file)
    if file.parsed.t_ns is None:
        raise InputError(f"no stamps in {source.path}; name the file that has them with --times")
    return _reading(file)


def _reading(file: _ReadFile) -> TrajectoryReading:
    """The trajectory in a file with stamps, in the usual convention."""
    parsed = file.parsed
    assert parsed.t_ns is not None
    T = parsed.T
    for convention in file.interpretation.conventions:
        T = convention.apply(T)
    unit = file.interpretation.unit
    return TrajectoryReading(
        Trajectory(parsed.t_ns, T),
        unit=parsed.unit,
        format_unit=unit or parsed.format_unit,
        order=None if file.interpretation.order else parsed.order,
        mentions_ground_truth=file.mentions_ground_truth,
        is_unit_given=unit is not None,
    )


def _stamped(file: _ReadFile, times: Sequence[Path]) -> _ReadFile:
    """The file with stamps from the only file of times that fits its poses; a file that has stamps is unchanged."""
    stamps_by_path = {path: parse_times(_text(path), name=str(path)) for path in times}
    parsed = file.parsed
    if parsed.t_ns is not None:
        return file
    fitting = {}
    for path, frames_ns in stamps_by_path.items():
        stamps = parsed.stamped_by(frames_ns)
        if stamps is not None:
            fitting[path] = stamps
    if not fitting:
        given = f"none of {len(times)} files of times is"
        if len(times) == 1:
            given = f"{len(stamps_by_path[times[0]])} stamps in {times[0]}"
        raise InputError(f"{given} for {len(parsed.T)} poses in {file.path}; {SAY_WHICH}")
    first, *others = fitting.values()
    if any(not np.array_equal(stamps, first) for stamps in others):
        names = " and ".join(map(str, fitting))
        raise InputError(f"one file of times should fit the {len(parsed.T)} poses in {file.path}, but {names} do")
    return replace(file, parsed=replace(parsed, t_ns=first, unit="s", format_unit="s"))


def _stamped_by_frame(file: _ReadFile) -> _ReadFile:
    """The file with stamps that increase by one second per frame; a file that has stamps is unchanged."""
    parsed = file.parsed
    if parsed.t_ns is not None:
        return file
    frames = parsed.frames
    if frames is None:
        frames = np.arange(len(parsed.T), dtype=np.int64)
    return replace(file, parsed=replace(parsed, t_ns=frames * NS_PER_S))


def _read(source: TrajectorySource, *, any_unit: bool) -> _ReadFile:
    """Read a recording or a text file. `any_unit` tries finer units if stamps are too large for seconds."""
    if _is_recording(source.path):
        return _read_recording(source)
    path = source.path
    interpretation = _interpretation(source.words)
    unit = interpretation.unit
    order = interpretation.order
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
    return _ReadFile(
        path=path,
        parsed=parsed,
        interpretation=interpretation,
        mentions_ground_truth=mentions_ground_truth,
    )


def _read_recording(source: TrajectorySource) -> _ReadFile:
    """Read the poses of a topic, or the ground truth of a sequence."""
    interpretation = _interpretation(source.words)
    if interpretation.unit or interpretation.order:
        raise InputError(f"a recording states its stamps' unit and quaternions' order itself: {source.path}")
    trajectory = _recorded(source.path, source.topic)
    parsed = ParsedTrajectory(trajectory.t_ns, trajectory.T_world_frame, unit="ns", format_unit="ns")
    return _ReadFile(path=source.path, parsed=parsed, interpretation=interpretation)


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


def _interpretation(words: Iterable[str]) -> _Interpretation:
    """The interpretation that words such as ns, wxyz or axes:z,-x,-y specify; later words override earlier ones."""
    unit: StampUnit | None = None
    order: QuaternionOrder | None = None
    conventions = []
    for word in words:
        if word in UNITS:
            unit = word
        elif word in ORDERS:
            order = word
        else:
            conventions.append(parse_pose_convention(word))
    return _Interpretation(unit, order, tuple(conventions))


def _is_recording(path: Path) -> bool:
    """Whether a path is a folder or a binary file."""
    if path.is_dir():
        return True
    head = _bytes(path, HEAD_BYTES)
    if b"\0" in head:
        return True
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        is_cut_character = error.start >= len(head) - MOST_BYTES_OF_CHARACTER
        return not is_cut_character
    return False


def _bytes(path: Path, most: int = -1) -> bytes:
    """The content of a file, at most that many bytes. Raises InputError if it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(most)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None


def _text(path: Path) -> str:
    """The content of a text file. Raises InputError if it cannot be read or is not UTF-8."""
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
