"""The files of an estimate: poses, one row per frame, tracked points, and how it ended."""

import csv
import io
import json
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from vobench.errors import TrajectoryError
from vobench.trajectory.text import parse_tum
from vobench.trajectory.trajectory import Trajectory

ESTIMATE = "estimate.tum"
FRAMES = "frames.csv"
TRACKS = "tracks.zip"
OUTCOME = "outcome.json"
LOG = "log.txt"
FINISHED = "finished"


class Outcome(BaseModel):
    """How an estimator's process ended: FINISHED, or the kind of its failure and why."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: str
    reason: str


@dataclass(frozen=True, slots=True)
class FrameRow:
    """What an estimator said of one frame, and what it cost; `stats` is a JSON object."""

    frame: int
    t_ns: int
    status: str
    reason: str
    stats: str
    wall_ms: float
    cpu_ms: float

    @classmethod
    def columns(cls) -> list[str]:
        """The header of the file."""
        return [field.name for field in fields(cls)]

    def as_text(self) -> list[str]:
        """The cells of one line."""
        cells = [str(self.frame), str(self.t_ns), self.status, self.reason, self.stats]
        return [*cells, f"{self.wall_ms:.3f}", f"{self.cpu_ms:.3f}"]


def read_outcome(folder: Path) -> Outcome:
    """How the estimate ended."""
    return Outcome(**json.loads((folder / OUTCOME).read_text(encoding="utf-8")))


def read_frames(folder: Path) -> list[FrameRow]:
    """One row per frame that the estimator answered."""
    with (folder / FRAMES).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [
        FrameRow(
            int(r["frame"]),
            int(r["t_ns"]),
            r["status"],
            r["reason"],
            r["stats"],
            float(r["wall_ms"]),
            float(r["cpu_ms"]),
        )
        for r in rows
    ]


def read_tum(path: Path) -> Trajectory:
    """The trajectory in a TUM file of a run; empty where an estimator gave no pose at all.

    Raises TrajectoryError where the file is none.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise TrajectoryError(f"not a text file in UTF-8 (byte {error.start}): {path}") from None
    return parse_tum(text, name=str(path))


def tracks_member(index: int) -> str:
    """The name of a frame's table in the archive of tracks."""
    return f"{index:08d}.npy"


def read_tracks(folder: Path) -> Iterator[tuple[int, NDArray[np.float32]]]:
    """Frame index and its table (N, 5): u, v before, u, v now, inlier."""
    with zipfile.ZipFile(folder / TRACKS) as archive:
        for name in archive.namelist():
            yield int(name.removesuffix(".npy")), np.load(io.BytesIO(archive.read(name)))
