"""What YAML may say of a path that was recorded elsewhere, and that a body follows here."""

from math import radians
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from vobench.catalog.catalog import unknown
from vobench.errors import InputError, SuiteError, TrajectoryError
from vobench.geometry import se3
from vobench.suite.strict import Positive, Rate, Strict, Triple, wrong_key
from vobench.trajectory import replay
from vobench.trajectory.correction import Move, parse_move
from vobench.trajectory.curve import CurveMotion
from vobench.trajectory.form import Parsed, parse_any
from vobench.trajectory.replay import AXES
from vobench.trajectory.text import NS_PER_S, format_tum, parse_tum
from vobench.trajectory.trajectory import Stamps, Trajectory
from vobench.trajectory.unstamped import parse_times


def _known_axes(word: str) -> str:
    """A name of AXES, or words that `parse_move` reads. Raises ValueError."""
    try:
        _move(word)
    except InputError as error:
        raise ValueError(str(error)) from None
    return word


def _move(word: str) -> Move | None:
    if word in AXES:
        return AXES[word]
    if ":" not in word:
        raise InputError(unknown("convention of axes", word, list(AXES)))
    return parse_move(word)


class ReplaySpec(Strict):
    """The poses of a TUM, EuRoC, KITTI or TartanAir file, told by content, and how the body goes through them.

    Smoothed by a least-squares spline with knots at `knot_hz`, or `exact`, which is for cameras alone. Files
    without stamps need `times`, a file of them, or `recorded_hz`. Without `start_m` it starts as recorded.
    """

    kind: Literal["replay"] = "replay"
    file: str
    times: str | None = None
    recorded_hz: Positive | None = None
    axes: Annotated[str, AfterValidator(_known_axes)] = "body"
    exact: bool = False
    knot_hz: Annotated[float, Field(gt=0, le=1000)] = 10.0
    speed: Annotated[float, Field(ge=0.01, le=100)] = 1.0
    max_gap_s: Positive = 1.0
    start_m: Triple | None = None
    start_heading_deg: float = 0.0
    rate_hz: Rate = 30.0

    @model_validator(mode="after")
    def _heading_with_place(self) -> Self:
        if self.start_m is None and self.start_heading_deg:
            raise wrong_key("start_heading_deg", "belongs to start_m; without it the body starts as recorded")
        return self

    def motion(self, replayed: str) -> CurveMotion:
        """The motion through what `read_replayed` gave. Raises MotionError."""
        recorded = parse_tum(replayed, name=self.file)
        start = (*self.start_m, radians(self.start_heading_deg)) if self.start_m else None
        if self.exact:
            return replay.interpolated(recorded, start=start, speed=self.speed, max_gap_s=self.max_gap_s)
        return replay.smoothed(recorded, knot_hz=self.knot_hz, start=start, speed=self.speed, max_gap_s=self.max_gap_s)


def read_times(spec: ReplaySpec, folder: Path) -> Stamps | None:
    """The stamps in the file `times`, where there is one. Raises InputError."""
    path = folder / spec.times if spec.times else None
    return parse_times(_text(path), name=str(path)) if path else None


def read_replayed(spec: ReplaySpec, folder: Path, times: Stamps | None) -> str:
    """The poses of the file as TUM text, in our axes; relative paths start in `folder`. Raises InputError."""
    path = folder / spec.file
    parsed = parse_any(_text(path), name=str(path))
    t_ns = parsed.t_ns if parsed.t_ns is not None else _stamps(spec, times, parsed)
    if parsed.t_ns is not None and (spec.times or spec.recorded_hz):
        raise SuiteError(f"times and recorded_hz are for files without stamps, but this one has its own: {path}")
    move = _move(spec.axes)
    T = move.apply(parsed.T) if move else parsed.T
    # KITTI's six digits are made rotations again.
    return format_tum(Trajectory(t_ns, se3.transform(se3.nearest_rotation(T[:, :3, :3]), T[:, :3, 3])))


def _stamps(spec: ReplaySpec, times: Stamps | None, parsed: Parsed) -> Stamps:
    if times is not None:
        t_ns = parsed.stamped_by(times)
        if t_ns is None:
            raise TrajectoryError(f"{len(times)} stamps in {spec.times} for {len(parsed.T)} poses in {spec.file}")
        return t_ns
    if spec.recorded_hz:
        frames = np.arange(len(parsed.T)) if parsed.frames is None else parsed.frames
        return np.rint(frames * NS_PER_S / spec.recorded_hz).astype(np.int64)
    raise SuiteError(f"no stamps in {spec.file}; give times, a file that has them, or recorded_hz")


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise SuiteError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SuiteError(f"not a text file in UTF-8: {path}") from None
