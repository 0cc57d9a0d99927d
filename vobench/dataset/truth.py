"""Ground truth beside pictures: read from its file, its rotations made exact, cut to the pictures' time."""

from pathlib import Path

import numpy as np

from vobench.dataset.files import read_text
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.trajectory.form import parse_any
from vobench.trajectory.trajectory import Stamps, Trajectory

EXACT = 1e-9  # a rotation this far off its transpose's inverse was written with all its digits


def read_truth_file(path: Path, frames_ns: Stamps) -> tuple[Trajectory, tuple[str, ...]]:
    """A trajectory in any form of text, and what was done to it; a row without a stamp has that of its picture.

    A row of 13 numbers is KITTI's behind the picture's number, from 0. Of rows with one stamp the first is kept.
    Raises TrajectoryError naming file and line for a pose that is none, InputError where rows and pictures differ.
    """
    parsed = parse_any(read_text(path), name=str(path))
    t_ns = parsed.stamped_by(frames_ns) if parsed.t_ns is None else parsed.t_ns
    if t_ns is None and parsed.frames is not None:
        raise InputError(
            f"the first of 13 columns should be a picture's number, from 0 to {len(frames_ns) - 1}, "
            f"but there is {parsed.frames[-1]}: {path}"
        )
    if t_ns is None:
        raise InputError(
            f"{len(parsed.T)} poses without stamps for {len(frames_ns)} pictures: give one pose a picture, or each "
            f"row its picture's number, from 0, as a first of 13 columns: {path}"
        )
    T, off = parsed.T, _skew(parsed.T)
    notes = list(parsed.notes)
    if parsed.frames is not None:
        notes.append(f"{path.name} has poses of {len(T)} of {len(frames_ns)} pictures, by their numbers.")
    if off > EXACT:
        T = se3.transform(se3.nearest_rotation(T[:, :3, :3]), T[:, :3, 3])
        notes.append(f"Rotations of {path.name} were made exact; they were up to {off:.1g} off.")
    return Trajectory(t_ns, T), tuple(notes)


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
