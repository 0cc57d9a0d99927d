"""Ground truth beside pictures: read from its file, its rotations made exact, cut to the pictures' time."""

from pathlib import Path

import numpy as np

from vobench.dataset.files import read_text
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.trajectory.form import KITTI, TUM, parse_any
from vobench.trajectory.table import content
from vobench.trajectory.trajectory import Stamps, Trajectory

Rows = list[tuple[int, str]]  # line numbers and what the lines say
NUMBERED_KITTI = KITTI + 1
EXACT = 1e-9  # a rotation this far off its transpose's inverse was written with all its digits


def read_truth_file(path: Path, frames_ns: Stamps) -> tuple[Trajectory, tuple[str, ...]]:
    """A trajectory in any form of text, and what was done to it; a row without a stamp has that of its picture.

    A row of 13 numbers is KITTI's behind the picture's number, from 0. Of rows with one stamp the first is kept.
    Raises TrajectoryError naming file and line for a pose that is none, InputError where rows and pictures differ.
    """
    text, notes = read_text(path), []
    rows = content(text)
    numbers = _numbers(rows, len(frames_ns), path)
    if numbers is not None:
        text = _with_rows(text, {line: body.split(None, 1)[1] for line, body in rows})
        notes.append(f"{path.name} has poses of {len(numbers)} of {len(frames_ns)} pictures, by their numbers.")
    elif repeats := _repeats(rows):
        text = _with_rows(text, dict.fromkeys(repeats, ""))
        notes.append(
            f"{len(repeats)} of {len(rows)} rows of {path.name} repeat a stamp, first in line {repeats[0]}; "
            "the first pose of each stamp was kept."
        )
    parsed = parse_any(text, name=str(path))
    t_ns = frames_ns if numbers is None else frames_ns[numbers]
    if parsed.t_ns is None and len(parsed.T) != len(t_ns):
        raise InputError(
            f"{len(parsed.T)} poses without stamps for {len(frames_ns)} pictures: give one pose a picture, or each "
            f"row its picture's number, from 0, as a first of 13 columns: {path}"
        )
    T, off = parsed.T, _skew(parsed.T)
    if off > EXACT:
        T = se3.transform(se3.nearest_rotation(T[:, :3, :3]), T[:, :3, 3])
        notes.append(f"Rotations of {path.name} were made exact; they were up to {off:.1g} off.")
    return Trajectory(t_ns if parsed.t_ns is None else parsed.t_ns, T), tuple(notes)


def _numbers(rows: Rows, count: int, path: Path) -> Stamps | None:
    """The pictures (N,) that rows of 13 columns name; None for other rows. Raises InputError for what is no picture."""
    if not rows or "," in rows[0][1] or len(rows[0][1].split()) != NUMBERED_KITTI:
        return None
    last = -1
    for line, body in rows:
        first = body.split(None, 1)
        number = int(first[0]) if len(first) > 1 and first[0].isascii() and first[0].isdigit() else -1
        if not last < number < count:
            raise InputError(
                f"{path}:{line}: the first of 13 columns should be a picture's number, rising, from 0 to {count - 1}, "
                f"but is {first[0][:80]}"
            )
        last = number
    return np.array([int(body.split(None, 1)[0]) for _, body in rows], np.int64)


def _repeats(rows: Rows) -> list[int]:
    """The lines whose stamp is that of the row before; none in forms without stamps."""
    first = rows[0][1] if rows else ""
    if "," not in first and len(first.split()) != TUM:
        return []
    stamps = [body.replace(",", " ").split(None, 1)[:1] for _, body in rows]
    return [line for (line, _), this, last in zip(rows[1:], stamps[1:], stamps, strict=False) if this == last]


def _with_rows(text: str, bodies: dict[int, str]) -> str:
    """Text with other bodies in some lines, each still of its number."""
    return "\n".join(bodies.get(line, body) for line, body in enumerate(text.split("\n"), 1))


def cut_to(truth: Trajectory, frames_ns: Stamps) -> tuple[Trajectory | None, tuple[str, ...]]:
    """The truth from the last pose before the first picture to the first after the last one, and what that dropped."""
    t_ns, inside = truth.t_ns, around(truth.t_ns, frames_ns)
    if inside is None:
        return None, (apart("truth", t_ns, frames_ns),)
    kept = Trajectory(t_ns[inside], truth.T_world_frame[inside])
    notes = []
    if len(kept) < len(truth):
        notes.append(f"{len(truth) - len(kept)} of {len(truth)} true poses lie outside the pictures' time; dropped.")
    bare = int(np.sum((frames_ns < t_ns[0]) | (frames_ns > t_ns[-1])))
    if bare:
        notes.append(f"{bare} of {len(frames_ns)} pictures lie outside the truth's time; they have no true pose.")
    return kept, tuple(notes)


def around(t_ns: Stamps, frames_ns: Stamps) -> slice | None:
    """From the last stamp before the first picture to the first after the last one; None where they share no time."""
    first, last = frames_ns[0], frames_ns[-1]
    if not len(t_ns) or t_ns[-1] < first or t_ns[0] > last:
        return None
    begin = max(int(np.searchsorted(t_ns, first, side="right")) - 1, 0)
    return slice(begin, int(np.searchsorted(t_ns, last, side="left")) + 1)


def apart(what: str, t_ns: Stamps, frames_ns: Stamps) -> str:
    """The sentence on truth or readings whose time is not the pictures'."""
    when = f" ({t_ns[0]} to {t_ns[-1]} ns)" if len(t_ns) else ""
    return f"The {what}{when} was dropped: it shares no time with the pictures ({frames_ns[0]} to {frames_ns[-1]} ns)."


def _skew(T: np.ndarray) -> float:
    R = T[:, :3, :3]
    return float(np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(initial=0.0))
