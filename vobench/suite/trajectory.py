"""The settings of trajectories in YAML: their kinds, the keys of each mover, and the files of replayed poses."""

from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
from pydantic import ValidatorFunctionWrapHandler, WrapSerializer, WrapValidator

from vobench.errors import SettingError, SuiteError, TrajectoryError
from vobench.geometry import se3
from vobench.motion.course import Planar
from vobench.motion.drive import Waypoints
from vobench.motion.free_start import Startable
from vobench.motion.handheld import Handheld
from vobench.motion.quadrotor import Quadrotor
from vobench.motion.rail import Rail
from vobench.motion.replay import Replay
from vobench.motion.spline import PoseSpline
from vobench.motion.wander import Wander
from vobench.motion.wheeled import MOVER_KEYS, Wheeled
from vobench.setting import ByKind, hints
from vobench.trajectory.any_format import ParsedTrajectory, parse_any
from vobench.trajectory.kitti import parse_times
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory
from vobench.trajectory.tum import format_tum

Spatial = PoseSpline | Handheld | Rail | Quadrotor
AnyTrajectory = Waypoints | Planar | Spatial | Wander | Replay


def _kind(trajectory_class: type) -> str:
    """The name of a kind of trajectory, which is the only value of the field `kind` of its class."""
    kind: str = get_args(hints(trajectory_class)["kind"])[0]
    return kind


# The class of each kind of trajectory, by the name of the kind.
KINDS = {_kind(trajectory_class): trajectory_class for trajectory_class in get_args(AnyTrajectory)}
# The keys of wheeled trajectories that only some movers have.
MOVER_SPECIFIC_KEYS = set[str]().union(*MOVER_KEYS.values())


def depends_on_place(spec: AnyTrajectory) -> bool:
    """Whether the motion depends on the place, because a free path or a free start is looked for there."""
    return isinstance(spec, Wander) or (isinstance(spec, Startable) and spec.start_seed is not None)


def known_keys(spec: Wheeled) -> set[str]:
    """The keys that a wheeled trajectory may have. They depend on its mover."""
    common_keys = set(hints(type(spec))) - MOVER_SPECIFIC_KEYS
    return common_keys | set(spec.mover_keys[spec.mover])


def _require_keys_of_mover(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    """Validate a trajectory. Raises SettingError for a key that its mover does not have."""
    spec = handler(value)
    if not isinstance(spec, Wheeled) or not isinstance(value, dict):
        return spec
    known = known_keys(spec)
    for key in sorted(set(value) - known):
        raise SettingError(f"does not belong to mover '{spec.mover}', which has {', '.join(sorted(known))}", key)
    if {"robot", "motors"} <= set(value):
        raise SettingError("sets the robot, which robot sets as well; remove one of them", "motors")
    return spec


def _keys_of_mover(spec: Any, handler: Any) -> Any:
    """Serialise a trajectory with only the keys that its mover has, so that it can be read again."""
    serialised = handler(spec)
    if not isinstance(spec, Wheeled):
        return serialised
    unused_robot_key = "robot" if spec.motors else "motors"
    unused_keys = (MOVER_SPECIFIC_KEYS - known_keys(spec)) | {unused_robot_key}
    return {key: value for key, value in serialised.items() if key not in unused_keys}


TrajectorySpec = Annotated[
    AnyTrajectory,
    ByKind("trajectory", default="waypoints"),
    WrapValidator(_require_keys_of_mover),
    WrapSerializer(_keys_of_mover),
]


def read_times(spec: Replay, folder: Path) -> Stamps | None:
    """The stamps in the file that the key `times` of a trajectory names, or None if it names no file.

    Relative paths start at `folder`. Raises InputError if the file cannot be read.
    """
    if not spec.times:
        return None
    path = folder / spec.times
    return parse_times(_read_text(path), name=str(path))


def read_replayed(spec: Replay, folder: Path, times: Stamps | None) -> str:
    """The poses in the file of a trajectory, as TUM text, in body axes.

    `folder` is the folder at which relative paths start.
    `times` are the stamps of poses that have none in the file.

    Raises InputError if the file cannot be read, and VobenchError if stamps are missing or do not fit.
    """
    path = folder / spec.file
    parsed = parse_any(_read_text(path), name=str(path))
    if parsed.t_ns is None:
        t_ns = _stamps(spec, times, parsed)
    elif spec.times or spec.recorded_hz:
        raise SuiteError(f"times and recorded_hz are for files without stamps, but this file has stamps: {path}")
    else:
        t_ns = parsed.t_ns

    move = spec.move()
    T = move.apply(parsed.T) if move else parsed.T  # (N, 4, 4)
    # KITTI's matrices have six digits, so they are not exact rotations.
    rotations = se3.nearest_rotation(T[:, :3, :3])
    positions_m = T[:, :3, 3]
    trajectory = Trajectory(t_ns, se3.transform(rotations, positions_m))
    return format_tum(trajectory)


def _stamps(spec: Replay, times: Stamps | None, parsed: ParsedTrajectory) -> Stamps:
    """The stamps for poses that have none in their file. They come from another file, or from a constant rate.

    Raises VobenchError if there is neither, or if the numbers of stamps and poses differ.
    """
    if times is not None:
        t_ns = parsed.stamped_by(times)
        if t_ns is None:
            raise TrajectoryError(f"{len(times)} stamps in {spec.times} for {len(parsed.T)} poses in {spec.file}")
        return t_ns
    if spec.recorded_hz:
        frames = np.arange(len(parsed.T)) if parsed.frames is None else parsed.frames
        return np.rint(frames * NS_PER_S / spec.recorded_hz).astype(np.int64)
    raise SuiteError(f"no stamps in {spec.file}; set times, to a file with stamps, or recorded_hz")


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise SuiteError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SuiteError(f"not a text file in UTF-8: {path}") from None
