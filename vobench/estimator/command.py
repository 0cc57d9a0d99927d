"""A program of any language that reads a whole recording from files, and writes all its poses to one."""

import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from vobench.errors import TrajectoryError, VobenchError
from vobench.estimator.check import FARTHEST_M
from vobench.estimator.home import Home
from vobench.estimator.manifest import OUT, PLACEHOLDER, Limits
from vobench.estimator.program import Answer, EstimatorFailure, Program
from vobench.estimator.protocol import Frame, Result, Status
from vobench.estimator.sandbox import Sandbox
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.trajectory.formats import Parsed, Unit, content, parse_any
from vobench.trajectory.trajectory import Stamps

UNITS: tuple[Unit | None, ...] = (None, "ns", "us", "ms")
CALIBRATION = "camchain.yaml"
# More than any form of poses takes; a frame's pose has a line.
OUT_BYTES = 1 << 20
OUT_BYTES_PER_FRAME = 4096


def filled(argv: Sequence[str], folder: Path, values: Mapping[str, Any]) -> list[str]:
    """A manifest's words for the system: {name} is filled in, and what begins with ./ lies in the manifest's folder."""
    words = [PLACEHOLDER.sub(lambda name: str(values[name[1]]), word) for word in argv]
    placed = [str(folder.resolve() / word[2:]) if word.startswith("./") else word for word in words]
    if not Path(placed[0]).is_absolute() and shutil.which(placed[0]) is None:
        raise EstimatorFailure("refused", f"no executable {placed[0]!r} on PATH; install it, or name it by its path")
    return placed


class CommandProgram:
    """A program that is run once at the start; each frame is then answered with what it wrote of it.

    `write_dataset` fills the folder of {dataset}; a frame's cost is the program's, divided among all frames (N,).
    """

    def __init__(
        self,
        argv: Sequence[str],
        folder: Path,
        *,
        log: Path,
        limits: Limits,
        out: str = OUT,
        t_ns: Stamps,
        write_dataset: Callable[[Path], object],
        hidden: Sequence[Path] = (),
    ) -> None:
        self._argv = argv
        self._folder = folder
        self._log = log
        self._limits = limits
        self._out = out
        self._t_ns = t_ns
        self._write_dataset = write_dataset
        self._hidden = hidden
        self._cost = (0.0, 0.0, 0.0)
        self._poses = dict[int, Array]()
        self.sandbox: Sandbox | None = None  # what the program could see; None where it has not been started

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Write the recording, run the program on it and read its poses. Raises EstimatorFailure."""
        del rig  # which is in the files
        with Home(self._log) as home:
            dataset = home.path / "dataset"
            dataset.mkdir()
            try:
                self._write_dataset(dataset)
            except VobenchError as error:
                raise EstimatorFailure("refused", str(error)) from None
            values = {"dataset": dataset, "calib": dataset / CALIBRATION, "out": home.path / self._out, "seed": seed}
            argv = filled(self._argv, self._folder, {**params, **values, "rate_hz": rate_hz(self._t_ns)})
            began = time.monotonic()
            with Program(
                argv, log=self._log, limits=self._limits, home=home, hidden=self._hidden, folder=self._folder.resolve()
            ) as program:
                self.sandbox = program.sandbox
                program.wait()
                most_bytes = OUT_BYTES + OUT_BYTES_PER_FRAME * len(self._t_ns)
                text = program.read(self._out, most_bytes=most_bytes).decode("utf-8", "replace")
            self._poses = poses_in(text, self._t_ns)
        wall_s = time.monotonic() - began
        frames_per_ms = len(self._t_ns) / 1e3
        self._cost = wall_s / frames_per_ms, program.cpu_s / frames_per_ms, program.peak_mib

    def process(self, frame: Frame) -> Answer:
        """What it wrote of a frame."""
        T = self._poses.get(frame.t_ns)
        return Answer(Result(T) if T is not None else Result(None, Status.LOST, "no_pose"), *self._cost)

    def finish(self) -> dict[int, Array]:
        """All that it revised is in its poses already."""
        return {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """The program has ended at the start."""


def rate_hz(t_ns: Stamps) -> float:
    """Frames a second, by the median of the steps of stamps (N,)."""
    return round(1e9 / float(np.median(np.diff(t_ns))), 6) if len(t_ns) > 1 else 1.0


def poses_in(text: str, t_ns: Stamps) -> dict[int, Array]:
    """The poses that a program wrote, by the stamps of the frames, each within half a step of its own.

    Any form that `vobench score` reads; one without stamps has a pose for each frame. Raises EstimatorFailure.
    """
    if not content(text):
        raise EstimatorFailure("lost", "it ended well, but {out} is empty")
    errors = list[str]()
    for unit in UNITS:
        try:
            parsed = parse_any(text, name="{out}", unit=unit)
            if not (unit and parsed.notes):  # too fine a unit makes one stamp of several
                return _matched(parsed, t_ns)
        except TrajectoryError as error:
            errors.append(" ".join(str(error).split()))
    raise EstimatorFailure("invalid_output", errors[0])


def _matched(parsed: Parsed, t_ns: Stamps) -> dict[int, Array]:
    """Each pose at the frame whose stamp is nearest. Raises TrajectoryError where that is none of the poses' own."""
    stamps = parsed.t_ns if parsed.t_ns is not None else parsed.stamped_by(t_ns)
    if stamps is None:
        raise TrajectoryError(f"{{out}} has {len(parsed.T)} poses without stamps, for {len(t_ns)} frames")
    if np.abs(parsed.T[:, :3, 3]).max() > FARTHEST_M:
        raise TrajectoryError(f"{{out}} has a pose farther than {FARTHEST_M:g} m away")
    after = np.clip(np.searchsorted(t_ns, stamps), 1, max(len(t_ns) - 1, 1))
    near = np.where(stamps - t_ns[after - 1] < t_ns[after] - stamps, after - 1, after) if len(t_ns) > 1 else after - 1
    half_ns = np.diff(t_ns).min() / 2 if len(t_ns) > 1 else np.inf
    off = np.abs(t_ns[near] - stamps) > half_ns
    again = np.diff(near, prepend=-1) < 1
    for wrong, said in ((off, "no frame"), (again, "the same frame as the one before")):
        if wrong.any():
            row = int(np.argmax(wrong))
            raise TrajectoryError(f"{{out}}: pose {row}, stamped {stamps[row] / 1e9:.9f} s, is of {said}")
    return dict(zip(t_ns[near].tolist(), parsed.T, strict=True))
