"""Reads a ground truth from a trajectory file in any text format."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from vobench.dataset.picture import read_text
from vobench.dataset.recording import Notes, ReadOptions
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.any_format import ParsedTrajectory, parse_any
from vobench.trajectory.trajectory import Stamps, Trajectory

EXACT = 1e-9  # the largest |RᵀR - I| of a rotation that was written with all digits


def read_truth_file(path: Path, frames_ns: Stamps) -> tuple[Trajectory, Notes]:
    """The trajectory in a file, and notes on its conversion. A row without a stamp gets the stamp of its picture.

    A row of 13 numbers has the number of the picture, from 0, before a pose in KITTI's format. If several rows have the
    same stamp, the first one is used.
    Raises TrajectoryError with file and line for an invalid pose, and InputError if rows and pictures do not match.
    """
    parsed = parse_any(read_text(path), name=str(path))
    t_ns = parsed.stamped_by(frames_ns) if parsed.t_ns is None else parsed.t_ns
    if t_ns is None:
        raise _unstamped(parsed, len(frames_ns), path)

    T = parsed.T
    notes = list(parsed.notes)
    if parsed.frames is not None:
        notes.append(f"{path.name} has poses of {len(T)} of {len(frames_ns)} images, by their numbers.")

    R = T[:, :3, :3]
    gram = np.swapaxes(R, -1, -2) @ R  # the identity for a rotation
    deviation = np.abs(gram - np.eye(3)).max(initial=0.0)
    if deviation > EXACT:
        T = se3.transform(se3.nearest_rotation(R), T[:, :3, 3])
        notes.append(f"Rotations of {path.name} were made exact; they were up to {deviation:.1g} off.")
    return Trajectory(t_ns, T), tuple(notes)


def _unstamped(parsed: ParsedTrajectory, frame_count: int, path: Path) -> InputError:
    if parsed.frames is not None:
        return InputError(
            f"the first of 13 columns should be an image's number, from 0 to {frame_count - 1}, "
            f"but there is {parsed.frames[-1]}: {path}"
        )
    return InputError(
        f"{len(parsed.T)} poses without stamps for {frame_count} images: give one pose per image, or each "
        f"row its image's number, from 0, as a first of 13 columns: {path}"
    )


def truth_file(
    options: ReadOptions,
    beside: Iterable[Path],
    frames_ns: Stamps,
    whose: str,
    turn: Array | None = None,
) -> tuple[Trajectory | None, Notes]:
    """The ground truth in the file that the options name, or otherwise in the first existing file of `beside`.

    Returns the trajectory, None if there is no file, and notes about it for the user.

    `frames_ns` (N,) are the stamps of the pictures, for files without stamps.
    `whose` describes the body of the poses. It is the end of the note that names the file.
    `turn` (4, 4) is the change of axes that is applied to the world and to the body; None for no change.
    """
    path = options.truth
    if path is None:
        path = next((candidate for candidate in beside if candidate.exists()), None)
    if path is None:
        return None, ()
    truth, notes = read_truth_file(path, frames_ns)
    if turn is not None:
        truth = Trajectory(truth.t_ns, turn @ truth.T_world_frame @ turn.T)
    return truth, (f"The truth is {path.name}, {whose}", *notes)
