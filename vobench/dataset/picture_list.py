"""Finds the picture files of a dataset, from lists of stamps and names or from their numbers, and pairs them."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os.path import isfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vobench.dataset.picture import EncodedPicture, inside, listed, read_bytes, read_text
from vobench.dataset.recording import Notes, PictureStream, RecordedFrame
from vobench.errors import InputError
from vobench.trajectory.associate import associate
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.stamp_text import StampUnit, stamps_ns
from vobench.trajectory.text_table import NUMBER, Line, TextTable, content_lines
from vobench.trajectory.trajectory import Stamps

LONGEST_ROW_SHOWN = 80  # the largest number of characters of a row in a message


@dataclass(frozen=True, slots=True)
class PictureList:
    """The pictures of one camera in order of time: stamps (N,) and paths of files, which may not exist."""

    name: str
    t_ns: Stamps
    paths: tuple[Path, ...]

    def at(self, index: Stamps) -> "PictureList":
        """The pictures with some indices (K,)."""
        paths = tuple(self.paths[i] for i in index.tolist())
        return PictureList(self.name, self.t_ns[index], paths)


def read_list(
    path: Path,
    folder: Path,
    *,
    separator: str | None,
    unit: StampUnit,
) -> PictureList:
    """Read a list of stamps and names of pictures below `folder`. Raises InputError with file and line."""
    lines = content_lines(read_text(path))
    if not lines:
        raise InputError(f"the list has no picture: {path}")
    cells = [_stripped(line.text.split(separator, 1)) for line in lines]
    has_header = separator == "," and not NUMBER.fullmatch(cells[0][0])  # one that does not begin with #
    if has_header:
        lines = lines[1:]
        cells = cells[1:]
    _require_stamps_and_names(path, lines, cells)

    table = TextTable(
        file_name=str(path),
        line_numbers=[line.number for line in lines],
        first_fields=[row[0] for row in cells],
        values=np.empty((len(lines), 0)),  # the names of pictures are no numbers
    )
    t_ns = stamps_ns(table, unit)
    paths = [inside(folder, row[1], table.place(index)) for index, row in enumerate(cells)]
    return PictureList(str(path), t_ns, tuple(paths))


def _require_stamps_and_names(
    path: Path,
    lines: list[Line],
    cells: list[list[str]],
) -> None:
    """Raise InputError unless each line has two cells, of which the first is a number."""
    for line, row in zip(lines, cells, strict=True):
        if len(row) != 2 or not NUMBER.fullmatch(row[0]):
            start = line.text[:LONGEST_ROW_SHOWN]
            raise InputError(f"{path}:{line.number}: a row should be a stamp and a picture's name, but is {start!r}")


def _stripped(cells: list[str]) -> list[str]:
    return [cell.strip() for cell in cells]


def listed_pictures(
    *lists: tuple[Path, Path],
    separator: str | None,
    unit: StampUnit,
    within_ns: int = 0,
) -> tuple[list[PictureList], Notes]:
    """The existing pictures of one or two cameras, and notes on what was dropped.

    Each of `lists` is the file with the list of a camera, and the folder at which its names start. Two pictures are a
    pair if their stamps differ by at most `within_ns`. Raises InputError as in `read_list`, and if there is no pair.
    """
    cameras = [read_list(path, folder, separator=separator, unit=unit) for path, folder in lists]
    notes = Notes()
    if len(cameras) > 1:
        left, right = cameras
        pairs = partners(left.t_ns, right.t_ns, within_ns, f"{left.name} and {right.name}")
        cameras = [left.at(pairs.left), right.at(pairs.right)]
        notes = pairs.notes
    present, absence_notes = _present(cameras)
    return present, (*notes, *absence_notes)


def _present(cameras: list[PictureList]) -> tuple[list[PictureList], Notes]:
    """The pictures whose files exist for every camera, and a note on the others."""
    rows = list(zip(*(camera.paths for camera in cameras), strict=True))
    # Path.is_file raises an error for a name that is too long.
    exists = np.array([all(map(isfile, paths)) for paths in rows])
    if exists.all():
        return cameras, ()

    first_incomplete = rows[int(np.flatnonzero(~exists)[0])]
    first_absent = next(path for path in first_incomplete if not isfile(path))
    what = "pairs" if len(cameras) > 1 else "pictures"
    if not exists.any():
        names = " and ".join(camera.name for camera in cameras)
        raise InputError(
            f"the files of all {len(exists)} {what} in {names} are missing; the first missing file is {first_absent}"
        )
    ending = "/".join(first_absent.parts[-3:])
    note = f"{_dropped(exists, cameras[0].t_ns, what)} The first is {ending}."
    indices = np.flatnonzero(exists)
    return [camera.at(indices) for camera in cameras], (note,)


def _dropped(
    exists: NDArray[np.bool_],
    t_ns: Stamps,
    what: str,
) -> str:
    """The number of missing pictures, and how many of them leave gaps between others."""
    indices = np.flatnonzero(exists)
    dropped = len(exists) - len(indices)
    at_start = int(indices[0])
    at_end = len(exists) - 1 - int(indices[-1])
    between = dropped - (at_start + at_end)
    longest_s = np.diff(t_ns[indices]).max(initial=0) / NS_PER_S

    places = []
    if at_start:
        places.append(f"{at_start} at the start")
    if between:
        places.append(f"{between} between others (a gap of up to {longest_s:.3g} s)")
    if at_end:
        places.append(f"{at_end} at the end")
    return f"{dropped} of {len(exists)} {what} were dropped because files are missing: {', '.join(places)}."


NUMBERED = re.compile(r"([0-9]{1,12})[A-Za-z_]*\.(?:png|jpg|jpeg)", re.IGNORECASE)


def numbered(*folders: Path) -> list[tuple[Path, ...]]:
    """The numbered pictures of one or two cameras.

    Raises InputError with a picture if a number is missing or repeated, or if the cameras have different numbers.
    """
    cameras = [_numbered(folder) for folder in folders]
    first_camera = cameras[0]
    last_camera = cameras[-1]
    left = tuple(first_camera.values())
    right = tuple(last_camera.values())
    if len(left) != len(right):
        counts = f"{len(left)} left and {len(right)} right pictures"
        raise InputError(f"{counts}; there should be as many of each: {folders[0]} and {folders[-1]}")
    if min(first_camera) != min(last_camera):
        raise InputError(f"the first left and right pictures should have the same number: {left[0]} and {right[0]}")
    return [left] if len(folders) == 1 else [left, right]


def _numbered(folder: Path) -> dict[int, Path]:
    """The pictures in a folder by number. Raises InputError if a number is missing or repeated."""
    names = []
    for name in listed(folder):
        match = NUMBERED.fullmatch(name)
        if match:
            names.append((int(match[1]), name))
    if not names:
        raise InputError(f"no numbered PNG or JPEG picture in {folder}")

    names.sort()
    first_number, first_name = names[0]
    for expected, (number, name) in enumerate(names, first_number):
        if number < expected:
            raise InputError(f"two pictures have the number {number}: {folder / name}")
        if number > expected:
            raise InputError(f"a picture is missing: {folder / _renumbered(first_name, expected)}")
    return {number: folder / name for number, name in names}


def _renumbered(name: str, number: int) -> str:
    """The name of a numbered picture with another number."""
    stem = name.partition(".")[0]
    width = sum(character.isdigit() for character in stem)
    return f"{number:0{width}d}{name[width:]}"


class Partners(NamedTuple):
    """The indices (K,) of the left and right pictures of all pairs, and notes on them."""

    left: Stamps
    right: Stamps
    notes: Notes


def partners(
    left_ns: Stamps,
    right_ns: Stamps,
    within_ns: int,
    name: str,
) -> Partners:
    """The pairs of pictures whose stamps differ by at most `within_ns`. Raises InputError if there are none."""
    pairs = associate(left_ns, right_ns, max_diff_ns=within_ns)
    if not len(pairs):
        raise InputError(f"no left and right picture have stamps within {within_ns} ns of each other in {name}")

    notes = []
    left_alone = len(left_ns) - len(pairs)
    right_alone = len(right_ns) - len(pairs)
    if left_alone or right_alone:
        notes.append(f"{left_alone} left and {right_alone} right pictures without a partner were dropped.")
    apart_ns = np.abs(left_ns[pairs.gt] - right_ns[pairs.est]).max()
    if apart_ns:
        notes.append(f"Stamps of a pair are up to {apart_ns} ns apart; the left picture's stamp was used for both.")
    return Partners(pairs.gt, pairs.est, tuple(notes))


def picture_files(t_ns: Stamps, *cameras: Sequence[Path]) -> PictureStream:
    """The pictures of one or two cameras. Each file is read when it is iterated.

    Raises InputError if the first pictures cannot be read.
    """

    def shots() -> Iterator[RecordedFrame]:
        for t, paths in zip(t_ns.tolist(), zip(*cameras, strict=True), strict=True):
            pictures = [EncodedPicture(str(path), read_bytes(path)) for path in paths]
            yield RecordedFrame(t, tuple(pictures))

    return PictureStream.open(shots)
