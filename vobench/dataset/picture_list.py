"""Finds the picture files of a dataset, from lists of stamps and file names or from numbered files, and pairs them."""

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
    """The pictures of one camera in order of time.

    `name` is the path of the list, for messages.
    `t_ns` (N,) are the stamps.
    `paths` are the paths of the N files, which need not exist.
    """

    name: str
    t_ns: Stamps
    paths: tuple[Path, ...]

    def at(self, index: Stamps) -> "PictureList":
        """The pictures with the given indices (K,)."""
        paths = tuple(self.paths[i] for i in index.tolist())
        return PictureList(self.name, self.t_ns[index], paths)


def read_list(
    path: Path,
    folder: Path,
    *,
    separator: str | None,
    unit: StampUnit,
) -> PictureList:
    """Read a list of the stamps and file names of pictures.

    `path` is the file with the list.
    `folder` is the folder to which the file names are relative.
    `separator` is the separator of the two columns; None for white space.
    `unit` is the unit of the stamps.
    Raises InputError with the file and line if the list is empty or a row is not valid.
    """
    lines = content_lines(read_text(path))
    if not lines:
        raise InputError(f"the list has no image: {path}")
    cells = [_split_row(line.text, separator) for line in lines]
    # `content_lines` removes a header that begins with #, but some CSV files have one without it.
    has_header = separator == "," and not NUMBER.fullmatch(cells[0][0])
    if has_header:
        lines = lines[1:]
        cells = cells[1:]
    _require_stamps_and_names(path, lines, cells)

    table = TextTable(
        file_name=str(path),
        line_numbers=[line.number for line in lines],
        first_fields=[row[0] for row in cells],
        values=np.empty((len(lines), 0)),  # there are no columns of numbers besides the stamps
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
            raise InputError(f"{path}:{line.number}: a row should be a stamp and an image's name, but is {start!r}")


def _split_row(text: str, separator: str | None) -> list[str]:
    """The stamp and the file name of a row; fewer cells if the row has no separator."""
    return [cell.strip() for cell in text.split(separator, 1)]


def listed_pictures(
    *lists: tuple[Path, Path],
    separator: str | None,
    unit: StampUnit,
    within_ns: int = 0,
) -> tuple[list[PictureList], Notes]:
    """The existing pictures of one or two cameras, and notes on what was dropped.

    Each of `lists` is the file with the list of a camera, and the folder to which its file names are relative.
    `separator` is the separator of the two columns of a list; None for white space.
    `unit` is the unit of the stamps.
    `within_ns` is the largest difference between the stamps of a pair.
    Raises InputError if a list is not valid, if there is no pair, or if all files are missing.
    """
    cameras = [read_list(path, folder, separator=separator, unit=unit) for path, folder in lists]
    return paired_pictures(cameras, within_ns=within_ns)


def paired_pictures(cameras: list[PictureList], *, within_ns: int) -> tuple[list[PictureList], Notes]:
    """The existing pictures of one or two cameras, paired by their stamps, and notes on what was dropped.

    `within_ns` is the largest difference between the stamps of a pair.
    Raises InputError if there is no pair, or if all files are missing.
    """
    notes = Notes()
    if len(cameras) > 1:
        left, right = cameras
        pairs = partners(left.t_ns, right.t_ns, within_ns, f"{left.name} and {right.name}")
        cameras = [left.at(pairs.left), right.at(pairs.right)]
        notes = pairs.notes
    existing, missing_notes = _drop_missing(cameras)
    return existing, (*notes, *missing_notes)


def _drop_missing(cameras: list[PictureList]) -> tuple[list[PictureList], Notes]:
    """The pictures whose files exist for all cameras, and a note on the others.

    Raises InputError if no files exist.
    """
    camera_paths = [camera.paths for camera in cameras]
    shots = list(zip(*camera_paths, strict=True))  # the paths of the one or two pictures that belong together
    exists = np.array([_all_exist(paths) for paths in shots])  # (N,), for each shot
    if exists.all():
        return cameras, ()

    first_incomplete = int(np.argmin(exists))
    first_missing = next(path for path in shots[first_incomplete] if not isfile(path))
    noun = "pairs" if len(cameras) > 1 else "images"
    if not exists.any():
        names = " and ".join(camera.name for camera in cameras)
        raise InputError(
            f"the files of all {len(exists)} {noun} in {names} are missing; the first missing file is {first_missing}"
        )
    short_path = "/".join(first_missing.parts[-3:])
    note = f"{_missing_note(exists, cameras[0].t_ns, noun)} The first is {short_path}."
    indices = np.flatnonzero(exists)
    return [camera.at(indices) for camera in cameras], (note,)


def _all_exist(paths: Sequence[Path]) -> bool:
    """Whether all files exist. Unlike Path.is_file, isfile raises no error for a name that is too long."""
    return all(isfile(path) for path in paths)


def _missing_note(
    exists: NDArray[np.bool_],
    t_ns: Stamps,
    noun: str,
) -> str:
    """A sentence with the number of dropped pictures, and where in the recording they are.

    `exists` (N,) is whether the files of each picture or pair exist.
    `t_ns` (N,) are the stamps.
    `noun` is "pairs" or "images".
    """
    indices = np.flatnonzero(exists)
    dropped = len(exists) - len(indices)
    at_start = int(indices[0])
    at_end = len(exists) - 1 - int(indices[-1])
    between = dropped - (at_start + at_end)
    longest_gap_ns = np.diff(t_ns[indices]).max(initial=0)
    longest_gap_s = longest_gap_ns / NS_PER_S

    places = []
    if at_start:
        places.append(f"{at_start} at the start")
    if between:
        places.append(f"{between} between others (a gap of up to {longest_gap_s:.3g} s)")
    if at_end:
        places.append(f"{at_end} at the end")
    return f"{dropped} of {len(exists)} {noun} were dropped because files are missing: {', '.join(places)}."


NUMBERED_NAME = re.compile(r"([0-9]{1,12})[A-Za-z_]*\.(?:png|jpg|jpeg)", re.IGNORECASE)


def numbered(*folders: Path) -> list[tuple[Path, ...]]:
    """The paths of the numbered pictures of one or two cameras, in order of the numbers.

    `folders` are the folder of each camera.
    Raises InputError if a number is missing or repeated, or if the cameras have different numbers.
    """
    cameras = [_pictures_by_number(folder) for folder in folders]
    if len(cameras) == 1:
        return [tuple(cameras[0].values())]

    left_by_number, right_by_number = cameras
    left = tuple(left_by_number.values())
    right = tuple(right_by_number.values())
    if len(left) != len(right):
        counts = f"{len(left)} left and {len(right)} right images"
        raise InputError(f"{counts}; there should be as many of each: {folders[0]} and {folders[1]}")
    if min(left_by_number) != min(right_by_number):
        raise InputError(f"the first left and right images should have the same number: {left[0]} and {right[0]}")
    return [left, right]


def _pictures_by_number(folder: Path) -> dict[int, Path]:
    """The paths of the pictures in a folder by number, in order.

    Raises InputError if a number is missing or repeated.
    """
    numbered_names = []
    for name in listed(folder):
        match = NUMBERED_NAME.fullmatch(name)
        if match:
            numbered_names.append((int(match[1]), name))
    if not numbered_names:
        raise InputError(f"no numbered PNG or JPEG image in {folder}")

    numbered_names.sort()
    first_number, first_name = numbered_names[0]
    for expected, (number, name) in enumerate(numbered_names, first_number):
        if number < expected:
            raise InputError(f"two images have the number {number}: {folder / name}")
        if number > expected:
            raise InputError(f"an image is missing: {folder / _renumbered(first_name, expected)}")
    return {number: folder / name for number, name in numbered_names}


def _renumbered(name: str, number: int) -> str:
    """The name of a numbered picture, with its number replaced."""
    stem = name.partition(".")[0]
    width = sum(character.isdigit() for character in stem)
    return f"{number:0{width}d}{name[width:]}"


class Partners(NamedTuple):
    """The pairs of the pictures of two cameras.

    `left` (K,) are the indices of the left pictures of the pairs.
    `right` (K,) are the indices of the right pictures of the pairs.
    `notes` are sentences for the user, on pictures without a partner and on differences between stamps.
    """

    left: Stamps
    right: Stamps
    notes: Notes


def partners(
    left_ns: Stamps,
    right_ns: Stamps,
    within_ns: int,
    name: str,
) -> Partners:
    """The pairs of left and right pictures with nearly equal stamps.

    `left_ns` are the stamps of the left pictures.
    `right_ns` are the stamps of the right pictures.
    `within_ns` is the largest difference between the stamps of a pair.
    `name` is the name of the recording, for messages.
    Raises InputError if there are no pairs.
    """
    pairs = associate(left_ns, right_ns, max_diff_ns=within_ns)
    if not len(pairs):
        raise InputError(f"no left and right image have stamps within {within_ns} ns of each other in {name}")

    notes = []
    left_indices = pairs.gt
    right_indices = pairs.est
    unpaired_left = len(left_ns) - len(pairs)
    unpaired_right = len(right_ns) - len(pairs)
    if unpaired_left or unpaired_right:
        notes.append(f"{unpaired_left} left and {unpaired_right} right images without a partner were dropped.")
    differences_ns = np.abs(left_ns[left_indices] - right_ns[right_indices])
    largest_ns = differences_ns.max()
    if largest_ns:
        notes.append(f"Stamps of a pair are up to {largest_ns} ns apart; the left image's stamp was used for both.")
    return Partners(left_indices, right_indices, tuple(notes))


def picture_files(t_ns: Stamps, *cameras: Sequence[Path]) -> PictureStream:
    """A stream of the pictures of one or two cameras. A file is read only when the stream reaches it.

    `t_ns` (N,) are the stamps.
    `cameras` are the paths of the N pictures of each camera.
    Raises InputError if the first pictures cannot be read.
    """

    def frames() -> Iterator[RecordedFrame]:
        paths_by_frame = zip(*cameras, strict=True)
        for frame_ns, paths in zip(t_ns.tolist(), paths_by_frame, strict=True):
            pictures = [EncodedPicture(str(path), read_bytes(path)) for path in paths]
            yield RecordedFrame(frame_ns, tuple(pictures))

    return PictureStream.open(frames)
