"""Runs an estimator that is a program in any language: it reads a recording from files and writes a trajectory."""

import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vobench.errors import TrajectoryError, VobenchError
from vobench.estimator.check import FARTHEST_M
from vobench.estimator.home import Home
from vobench.estimator.manifest import OUT, PLACEHOLDER, Limits
from vobench.estimator.program import Answer, EstimatorFailure, Program
from vobench.estimator.protocol import Frame, Result, Status
from vobench.estimator.sandbox import Sandbox
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.trajectory.any_format import ParsedTrajectory, parse_any
from vobench.trajectory.stamp_text import StampUnit
from vobench.trajectory.text_table import content_lines
from vobench.trajectory.trajectory import Stamps

UNITS: tuple[StampUnit | None, ...] = (None, "ns", "us", "ms")
CALIBRATION = "camchain.yaml"
# Larger than the line of a pose in any format.
OUT_BYTES = 1 << 20
OUT_BYTES_PER_FRAME = 4096


def filled(argv: Sequence[str], folder: Path, values: Mapping[str, Any]) -> list[str]:
    """The argv of a manifest in which each {name} is replaced by its value, and ./ by the folder of the manifest.

    Raises EstimatorFailure if there is no such program.
    """
    words = []
    for template in argv:
        word = PLACEHOLDER.sub(lambda name: str(values[name[1]]), template)
        if word.startswith("./"):
            word = str(folder.resolve() / word.removeprefix("./"))
        words.append(word)
    program = words[0]
    if not Path(program).is_absolute() and shutil.which(program) is None:
        raise EstimatorFailure("refused", f"no executable {program!r} on PATH; install it, or name it by its path")
    return words


class CommandProgram:
    """An estimator whose program runs once, at the start. Each frame is answered with a pose that the program wrote.

    `write_dataset` fills the folder {dataset}. The cost of the program is divided evenly among all frames (N,).
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
        self._wall_ms = 0.0  # per frame
        self._cpu_ms = 0.0
        self._memory_mib = 0.0
        self._poses = dict[int, Array]()
        self.sandbox: Sandbox | None = None  # None until the program has been started

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Write the recording, run the program, and read its poses. Raises EstimatorFailure."""
        del rig  # it is in the files
        frame_count = len(self._t_ns)
        with Home(self._log) as home:
            dataset = self._written_dataset(home)
            values = {
                **params,
                "dataset": dataset,
                "calib": dataset / CALIBRATION,
                "out": home.path / self._out,
                "seed": seed,
                "rate_hz": rate_hz(self._t_ns),
            }
            argv = filled(self._argv, self._folder, values)

            began_s = time.monotonic()
            with Program(
                argv,
                log=self._log,
                limits=self._limits,
                home=home,
                hidden=self._hidden,
                folder=self._folder.resolve(),
            ) as program:
                self.sandbox = program.sandbox
                program.wait()
                content = program.read(self._out, most_bytes=OUT_BYTES + OUT_BYTES_PER_FRAME * frame_count)
            self._poses = poses_in(content.decode("utf-8", "replace"), self._t_ns)
        wall_s = time.monotonic() - began_s
        self._wall_ms = 1e3 * wall_s / frame_count
        self._cpu_ms = 1e3 * program.cpu_s / frame_count
        self._memory_mib = program.peak_mib

    def _written_dataset(self, home: Home) -> Path:
        """Write the recording to a folder. Raises EstimatorFailure if its layout cannot represent this recording."""
        dataset = home.path / "dataset"
        dataset.mkdir()
        try:
            self._write_dataset(dataset)
        except VobenchError as error:
            raise EstimatorFailure("refused", str(error)) from None
        return dataset

    def process(self, frame: Frame) -> Answer:
        """The pose that the program wrote for a frame."""
        T = self._poses.get(frame.t_ns)
        result = Result(None, Status.LOST, "no_pose") if T is None else Result(T)
        return Answer(result, self._wall_ms, self._cpu_ms, self._memory_mib)

    def finish(self) -> dict[int, Array]:
        """No revised poses, because the program has written its final poses already."""
        return {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to do, because the program has ended already."""


def rate_hz(t_ns: Stamps) -> float:
    """The frame rate of stamps (N,), from the median of their steps."""
    if len(t_ns) < 2:
        return 1.0
    step_ns = float(np.median(np.diff(t_ns)))
    return round(1e9 / step_ns, 6)


def poses_in(text: str, t_ns: Stamps) -> dict[int, Array]:
    """The poses that a program wrote, by the stamps (N,) of their frames.

    The text can have any format that `vobench score` reads. Without stamps, it must have one pose for each frame. With
    stamps, each must be within half a step of that of a frame. Raises EstimatorFailure.
    """
    if not content_lines(text):
        raise EstimatorFailure("lost", "it ended well, but {out} is empty")
    errors = list[str]()
    for unit in UNITS:
        try:
            parsed = parse_any(text, name="{out}", unit=unit)
            has_dropped_rows = bool(parsed.notes)
            if unit is not None and has_dropped_rows:
                continue  # this unit is too fine: it made several stamps equal
            return _matched(parsed, t_ns)
        except TrajectoryError as error:
            errors.append(" ".join(str(error).split()))
    raise EstimatorFailure("invalid_output", errors[0])


def _matched(parsed: ParsedTrajectory, t_ns: Stamps) -> dict[int, Array]:
    """The poses by the stamp of the nearest frame.

    Raises TrajectoryError if a pose is too far from any frame, or if a frame has several poses.
    """
    stamps = parsed.stamped_by(t_ns) if parsed.t_ns is None else parsed.t_ns
    if stamps is None:
        raise TrajectoryError(f"{{out}} has {len(parsed.T)} poses without stamps, for {len(t_ns)} frames")
    positions_m = parsed.T[:, :3, 3]
    if np.abs(positions_m).max() > FARTHEST_M:
        raise TrajectoryError(f"{{out}} has a pose farther than {FARTHEST_M:g} m away")

    frames = _nearest(t_ns, stamps)
    largest_offset_ns = np.diff(t_ns).min() / 2 if len(t_ns) > 1 else np.inf
    offsets_ns = np.abs(t_ns[frames] - stamps)
    _refuse_any(offsets_ns > largest_offset_ns, stamps, "no frame")
    frames_since_last_pose = np.diff(frames, prepend=-1)
    _refuse_any(frames_since_last_pose < 1, stamps, "the same frame as the one before")
    return dict(zip(t_ns[frames].tolist(), parsed.T, strict=True))


def _refuse_any(is_wrong: NDArray[np.bool_], stamps: Stamps, cause: str) -> None:
    """Raise TrajectoryError about the first pose that is wrong (M,), if any is."""
    if is_wrong.any():
        row = int(np.argmax(is_wrong))
        raise TrajectoryError(f"{{out}}: pose {row}, stamped {stamps[row] / 1e9:.9f} s, is of {cause}")


def _nearest(t_ns: Stamps, stamps: Stamps) -> NDArray[np.intp]:
    """The index (M,) of the frame in t_ns (N,) that is nearest to each stamp (M,); of two, the later one."""
    if len(t_ns) == 1:
        return np.zeros(len(stamps), np.intp)
    after = np.clip(np.searchsorted(t_ns, stamps), 1, len(t_ns) - 1)
    before = after - 1
    is_nearer_before = stamps - t_ns[before] < t_ns[after] - stamps
    return np.where(is_nearer_before, before, after)
