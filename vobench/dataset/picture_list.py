"""Which pictures there are and when: lists with stamps, numbered files, and the pairs of two eyes."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from os.path import isfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.dataset.files import inside, listed, read_bytes, read_text
from vobench.dataset.picture import Picture
from vobench.dataset.stream import Shot, Shots
from vobench.errors import InputError
from vobench.trajectory.associate import associate
from vobench.trajectory.table import NUMBER, Table, Unit, content, stamps_ns
from vobench.trajectory.trajectory import Stamps

NUMBERED = re.compile(r"([0-9]{1,12})[A-Za-z_]*\.(?:png|jpg|jpeg)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class PictureList:
    """One eye's pictures, in order of time: stamps (N,) and files, which may be absent."""

    name: str
    t_ns: Stamps
    paths: tuple[Path, ...]

    def at(self, index: Stamps) -> "PictureList":
        """The pictures (K,) of these indices."""
        return PictureList(self.name, self.t_ns[index], tuple(self.paths[i] for i in index.tolist()))


def read_list(path: Path, folder: Path, *, separator: str | None, unit: Unit) -> PictureList:
    """A list of stamps and names of pictures below `folder`.

    Raises InputError naming file and line for what is no stamp, does not rise, or names a file outside the folder.
    """
    rows = content(read_text(path))
    if not rows:
        raise InputError(f"the list has no picture: {path}")
    fields = [[field.strip() for field in body.split(separator, 1)] for _, body in rows]
    if separator == "," and not NUMBER.fullmatch(fields[0][0]):
        rows, fields = rows[1:], fields[1:]  # a header without its #
    for (line, body), row in zip(rows, fields, strict=True):
        if len(row) != 2 or not NUMBER.fullmatch(row[0]):
            raise InputError(f"{path}:{line}: a row should be a stamp and a picture's name, but is {body[:80]!r}")
    stamps = [row[0] for row in fields]
    table = Table(str(path), [line for line, _ in rows], stamps, np.empty((len(rows), 0)))
    t_ns = stamps_ns(table, unit)
    paths = tuple(inside(folder, row[1], table.place(index)) for index, row in enumerate(fields))
    return PictureList(str(path), t_ns, paths)


def present(*eyes: PictureList) -> tuple[list[PictureList], tuple[str, ...]]:
    """The pictures of lists in step whose files are there for every eye, and what is to be said of the others.

    Raises InputError where none is.
    """
    # pathlib's own is_file raises for a name that is too long.
    is_there = np.array([all(map(isfile, paths)) for paths in zip(*(eye.paths for eye in eyes), strict=True)])
    if is_there.all():
        return list(eyes), ()
    absent = [path for at in np.flatnonzero(~is_there) for eye in eyes if not isfile(path := eye.paths[at])]
    what = "pairs" if len(eyes) > 1 else "pictures"
    if not is_there.any():
        named = " and ".join(eye.name for eye in eyes)
        raise InputError(f"of none of the {len(is_there)} {what} in {named} the files are there; missing: {absent[0]}")
    found = np.flatnonzero(is_there)
    first = "/".join(absent[0].parts[-3:])
    return [eye.at(found) for eye in eyes], (f"{_dropped(is_there, eyes[0].t_ns, what)} The first is {first}.",)


def _dropped(is_there: NDArray[np.bool_], t_ns: Stamps, what: str) -> str:
    """How many pictures are missing, and where: those amid the others leave gaps."""
    found = np.flatnonzero(is_there)
    ends = int(found[0]), len(is_there) - 1 - int(found[-1])
    amid = len(is_there) - len(found) - sum(ends)
    longest_s = np.diff(t_ns[found]).max(initial=0) / 1e9
    counts = {
        "at the start": ends[0],
        f"amid the others (a gap of up to {longest_s:.3g} s)": amid,
        "at the end": ends[1],
    }
    where = ", ".join(f"{count} {place}" for place, count in counts.items() if count)
    return f"{len(is_there) - len(found)} of {len(is_there)} {what} were dropped, for files are missing: {where}."


def numbered(folder: Path) -> tuple[Path, ...]:
    """The pictures of a folder that are numbered without a gap. Raises InputError naming the first that is missing."""
    found = sorted((int(match[1]), name) for name in listed(folder) if (match := NUMBERED.fullmatch(name)))
    if not found:
        raise InputError(f"no numbered PNG or JPEG picture in {folder}")
    first, pattern = found[0]
    for expected, (number, name) in enumerate(found, first):
        if number < expected:
            raise InputError(f"two pictures have the number {number}: {folder / name}")
        if number > expected:
            width = sum(character.isdigit() for character in pattern.partition(".")[0])
            raise InputError(f"a picture is missing: {folder / (f'{expected:0{width}d}' + pattern[width:])}")
    return tuple(folder / name for _, name in found)


def in_step(left: Sequence[Path], right: Sequence[Path] | None) -> None:
    """Raise InputError unless two eyes have as many pictures, of the same numbers."""
    if right is None:
        return
    if len(left) != len(right):
        raise InputError(
            f"{len(left)} left and {len(right)} right pictures; there should be as many: "
            f"{left[0].parent} and {right[0].parent}"
        )
    first = [NUMBERED.fullmatch(paths[0].name) for paths in (left, right)]
    if first[0] and first[1] and int(first[0][1]) != int(first[1][1]):
        raise InputError(f"the first left and right pictures have other numbers: {left[0]} and {right[0]}")


def partners(left_ns: Stamps, right_ns: Stamps, within_ns: int, name: str) -> tuple[Stamps, Stamps, tuple[str, ...]]:
    """Indices (K,) of the left and right stamps that make pairs, and what is to be said of the others.

    Raises InputError where there is no pair.
    """
    pairs = associate(left_ns, right_ns, max_diff_ns=within_ns)
    if not len(pairs):
        raise InputError(f"no left and right picture have stamps within {within_ns} ns of each other in {name}")
    notes = []
    lonely = len(left_ns) - len(pairs), len(right_ns) - len(pairs)
    if any(lonely):
        notes.append(f"{lonely[0]} left and {lonely[1]} right pictures without a partner were dropped.")
    apart_ns = int(np.abs(left_ns[pairs.gt] - right_ns[pairs.est]).max())
    if apart_ns:
        notes.append(f"Stamps of the two eyes are up to {apart_ns} ns apart; the left one's stands for both.")
    return pairs.gt, pairs.est, tuple(notes)


def paired(left: PictureList, right: PictureList, within_ns: int) -> tuple[PictureList, PictureList, tuple[str, ...]]:
    """Both lists with the same stamps, and sentences on what that took. Raises InputError where there is no pair."""
    at_left, at_right, notes = partners(left.t_ns, right.t_ns, within_ns, f"{left.name} and {right.name}")
    return left.at(at_left), replace(right.at(at_right), t_ns=left.t_ns[at_left]), notes


def shots_of(t_ns: Stamps, *eyes: Sequence[Path]) -> Shots:
    """The pictures of one or two eyes, read from their files as one goes."""

    def shots() -> Iterator[Shot]:
        for t, paths in zip(t_ns.tolist(), zip(*eyes, strict=True), strict=True):
            yield Shot(t, tuple(Picture(str(path), read_bytes(path)) for path in paths))

    return shots
