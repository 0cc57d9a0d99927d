"""What YAML may say of trajectories: their kinds, the keys that fit who goes, and the files of replayed ones."""

from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
from pydantic import ValidatorFunctionWrapHandler, WrapSerializer, WrapValidator

from vobench.errors import SettingError, SuiteError, TrajectoryError
from vobench.geometry import se3
from vobench.motion.course import Planar
from vobench.motion.drive import Waypoints
from vobench.motion.handheld import Handheld
from vobench.motion.quadrotor import Quadrotor
from vobench.motion.rail import Rail
from vobench.motion.replay import Replay
from vobench.motion.spline import PoseSpline
from vobench.motion.wheeled import MOVER_KEYS, Wheeled
from vobench.setting import ByKind, hints
from vobench.trajectory.formats import NS_PER_S, Parsed, format_tum, parse_any, parse_times
from vobench.trajectory.trajectory import Stamps, Trajectory

Spatial = PoseSpline | Handheld | Rail | Quadrotor
AnyTrajectory = Waypoints | Planar | Spatial | Replay
KINDS = {get_args(hints(each)["kind"])[0]: each for each in get_args(AnyTrajectory)}
SOME_MOVERS = {key for keys in MOVER_KEYS.values() for key in keys}


def known_keys(spec: Wheeled) -> set[str]:
    """The keys that its mover takes."""
    return set(hints(type(spec))) - SOME_MOVERS | set(spec.mover_keys[spec.mover])


def _fitting(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    """A trajectory whose keys all belong to its mover. Raises SettingError."""
    spec = handler(value)
    if not isinstance(spec, Wheeled) or not isinstance(value, dict):
        return spec
    known = known_keys(spec)
    for key in sorted(set(value) - known):
        belongs = f"does not belong to mover '{spec.mover}', which has {', '.join(sorted(known))}"
        raise SettingError(belongs, key)
    if {"robot", "motors"} <= set(value):
        raise SettingError("gives the robot anew, which is given by robot; leave one of them out", "motors")
    return spec


def _of_mover(spec: Any, handler: Any) -> Any:
    """What belongs to the mover: all that its motion depends on, and what can be read again."""
    dumped = handler(spec)
    if not isinstance(spec, Wheeled):
        return dumped
    unused = SOME_MOVERS - known_keys(spec) | ({"robot"} if spec.motors else {"motors"})
    return {key: value for key, value in dumped.items() if key not in unused}


TrajectorySpec = Annotated[
    AnyTrajectory, ByKind("trajectory", default="waypoints"), WrapValidator(_fitting), WrapSerializer(_of_mover)
]


def read_times(spec: Replay, folder: Path) -> Stamps | None:
    """The stamps in the file `times`, where there is one. Raises InputError."""
    path = folder / spec.times if spec.times else None
    return parse_times(_text(path), name=str(path)) if path else None


def read_replayed(spec: Replay, folder: Path, times: Stamps | None) -> str:
    """The poses of the file as TUM text, in our axes; relative paths start in `folder`. Raises InputError."""
    path = folder / spec.file
    parsed = parse_any(_text(path), name=str(path))
    t_ns = parsed.t_ns if parsed.t_ns is not None else _stamps(spec, times, parsed)
    if parsed.t_ns is not None and (spec.times or spec.recorded_hz):
        raise SuiteError(f"times and recorded_hz are for files without stamps, but this one has its own: {path}")
    move = spec.move()
    T = move.apply(parsed.T) if move else parsed.T
    # KITTI's six digits are made rotations again.
    return format_tum(Trajectory(t_ns, se3.transform(se3.nearest_rotation(T[:, :3, :3]), T[:, :3, 3])))


def _stamps(spec: Replay, times: Stamps | None, parsed: Parsed) -> Stamps:
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
