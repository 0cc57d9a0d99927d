"""A trajectory: stamps and poses; interpolation, and changes of axes and frame."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vobench.errors import InputError, TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array

Stamps = NDArray[np.int64]
SKEW = 1e-2  # text with three digits leaves RᵀR up to 3e-3 off the identity; what is no rotation by far more
LARGEST_M = 1e18  # a hundred light years; beyond it squares overflow float32, which the KITTI devkit sums in
BLOCK = 1 << 14  # poses looked at together: little memory, and they stay in the processor's cache


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Poses of one moving frame in one fixed frame, in order of time.

    t_ns is (N,) int64, strictly increasing; T_world_frame is (N, 4, 4) in metres.
    Raises TrajectoryError where shapes, order or size are wrong, or a rotation is none.
    """

    t_ns: Stamps
    T_world_frame: Array

    def __post_init__(self) -> None:
        if self.T_world_frame.shape != (len(self.t_ns), 4, 4) or self.t_ns.dtype != np.int64:
            raise TrajectoryError(
                f"a trajectory needs (N,) int64 stamps and (N, 4, 4) poses, "
                f"got {self.t_ns.shape} {self.t_ns.dtype} and {self.T_world_frame.shape}"
            )
        late = np.flatnonzero(np.diff(self.t_ns) <= 0)
        if late.size:
            raise TrajectoryError(f"stamps must increase, but pose {late[0] + 1} is not later than the one before it")
        for begin in range(0, len(self.t_ns), BLOCK):
            _require_poses(self.T_world_frame[begin : begin + BLOCK], begin)

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        if not len(self):
            return "Trajectory(no pose)"
        first, last = (f"{t_ns / 1e9:.3f}" for t_ns in (self.t_ns[0], self.t_ns[-1]))
        return f"Trajectory({len(self)} poses from {first} s to {last} s, path {self.distances_m()[-1]:.4g} m)"

    @property
    def positions_m(self) -> Array:
        """Positions (N, 3)."""
        return self.T_world_frame[:, :3, 3]

    def distances_m(self) -> Array:
        """Path length (N,) from the first pose to each pose."""
        steps = np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])[: len(self)]

    def of_mounted(self, T_frame_mounted: Array) -> "Trajectory":
        """The trajectory of something fixed to this frame, such as a camera on a body."""
        return Trajectory(self.t_ns, self.T_world_frame @ T_frame_mounted)


def _require_poses(T: Array, begin: int) -> None:
    """Raise TrajectoryError for the first of poses (N, 4, 4) that is none; `begin` is the number of the first."""
    if not (np.abs(T) < LARGEST_M).all():  # which nan isn't either
        bad = int(np.flatnonzero(~(np.abs(T) < LARGEST_M).all((1, 2)))[0])
        what = "is not finite" if not np.isfinite(T[bad]).all() else f"is {np.abs(T[bad]).max():.3g} m away"
        raise TrajectoryError(f"pose {begin + bad} {what}; positions should be finite and below {LARGEST_M:g} m")
    R = T[:, :3, :3]
    skew = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max((1, 2))
    mirrors = np.sum(np.cross(R[:, :, 0], R[:, :, 1]) * R[:, :, 2], axis=1) < 0
    wrong = np.flatnonzero(mirrors | (skew > SKEW))
    if wrong.size:
        bad = int(wrong[0])
        what = "is mirrored (determinant -1)" if mirrors[bad] else f"is off by {skew[bad]:.3g} (RᵀR - 1)"
        raise TrajectoryError(f"the rotation of pose {begin + bad} {what}; it should be orthonormal and right-handed")


def poses_at(trajectory: Trajectory, t_ns: Stamps) -> Array:
    """Poses (N, 4, 4) of a trajectory of one pose or more at t_ns (N,); before and after it its ends.

    Source: Shoemake (1985), eq. of slerp, along the shorter way round.
    """
    stamps = trajectory.t_ns
    T = trajectory.T_world_frame
    before = np.clip(np.searchsorted(stamps, t_ns, side="right") - 1, 0, max(len(stamps) - 2, 0))
    after = np.minimum(before + 1, len(stamps) - 1)
    step_ns = np.maximum(stamps[after] - stamps[before], 1)
    share = np.clip((t_ns - stamps[before]) / step_ns, 0.0, 1.0)[:, None]
    positions = (1 - share) * T[before, :3, 3] + share * T[after, :3, 3]
    return se3.transform(_slerp(T[before, :3, :3], T[after, :3, :3], share), positions)


def _slerp(R_begin: Array, R_end: Array, share: Array) -> Array:
    a = se3.to_quaternion(R_begin)
    b = se3.to_quaternion(R_end)
    cosine = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(cosine < 0, -b, b)
    cosine = np.abs(cosine)
    sine = np.linalg.norm(b - cosine * a, axis=-1, keepdims=True)
    angle = np.arctan2(sine, cosine)
    near = sine < 1e-9  # there the weights of a straight line are exact
    safe = np.where(near, 1.0, sine)
    q = np.where(near, 1 - share, np.sin((1 - share) * angle) / safe) * a
    q = q + np.where(near, share, np.sin(share * angle) / safe) * b
    return se3.from_quaternion(q / np.linalg.norm(q, axis=-1, keepdims=True))


Kind = Literal["axes", "positions", "mount", "inverse", "rotations"]
INVERSES: dict[str, Kind] = {"inverse": "inverse", "rotations:inverse": "rotations"}
AXIS = re.compile(r"([+-]?)([xyz])")
MOUNT_VALUES = 7


@dataclass(frozen=True, slots=True)
class Move:
    """A change of poses: `matrix` is signed axes S (3, 3), or for a mount T_est_gt (4, 4).

    `axes`: the file's axes are others, T' = S T S⁻¹. `positions`: only its positions are in
    other axes, p' = S p. `mount`: it is of another frame of the same body, T' = T T_est_gt.
    `inverse`: it takes the world to the frame, T' = T⁻¹. `rotations`: only its rotations do, R' = Rᵀ.
    """

    kind: Kind
    matrix: Array = field(default_factory=lambda: np.eye(3))

    def apply(self, T: Array) -> Array:
        """Poses (..., 4, 4), changed."""
        if self.kind == "mount":
            moved: Array = T @ self.matrix
            return moved
        if self.kind == "inverse":
            return se3.inverse(T)
        if self.kind == "rotations":
            return se3.transform(np.swapaxes(T[..., :3, :3], -1, -2), T[..., :3, 3])
        S = self.matrix
        R = S @ T[..., :3, :3] @ S.T if self.kind == "axes" else T[..., :3, :3]
        return se3.transform(R, T[..., :3, 3] @ S.T)

    def __str__(self) -> str:
        for word, kind in INVERSES.items():
            if kind == self.kind:
                return word
        if self.kind != "mount":
            return f"{self.kind}:{','.join(map(_axis_name, self.matrix))}"
        q_xyzw = se3.to_quaternion(self.matrix[:3, :3])
        return f"mount:{','.join(f'{v:.6g}' for v in (*self.matrix[:3, 3], *q_xyzw))}"


def parse_move(word: str) -> Move:
    """The move in words such as `axes:z,-x,-y`, `inverse` or `mount:x,y,z,qx,qy,qz,qw`. Raises InputError."""
    if word in INVERSES:
        return Move(INVERSES[word])
    kind, _, stated = word.partition(":")
    values = [part.strip() for part in stated.split(",")]
    if kind == "mount":
        return Move("mount", _mount(values, word))
    if kind in ("axes", "positions"):
        return Move("axes" if kind == "axes" else "positions", _axes(values, word))
    raise InputError(
        f"a file may be read as axes:…, positions:…, mount:…, inverse or rotations:inverse, but not as {word!r}"
    )


def _axes(values: Sequence[str], word: str) -> Array:
    found = [AXIS.fullmatch(value) for value in values]
    if len(values) != 3 or sorted(match[2] for match in found if match) != ["x", "y", "z"]:
        raise InputError(f"axes are x, y and z, each once, with or without a minus, such as z,-x,-y; not {word!r}")
    rows = [(-1.0 if m[1] == "-" else 1.0) * np.eye(3)["xyz".index(m[2])] for m in found if m]
    return np.stack(rows)


def _mount(values: Sequence[str], word: str) -> Array:
    try:
        numbers = np.array([float(value) for value in values])
    except ValueError:
        numbers = np.zeros(0)
    if len(numbers) != MOUNT_VALUES or not np.isfinite(numbers).all() or abs(np.linalg.norm(numbers[3:]) - 1) > 1e-3:
        raise InputError(f"a mount is x,y,z,qx,qy,qz,qw in metres with a quaternion of norm 1, not {word!r}")
    return se3.transform(se3.from_quaternion(numbers[3:] / np.linalg.norm(numbers[3:])), numbers[:3])


def _axis_name(row: Array) -> str:
    axis = int(np.argmax(np.abs(row)))
    return f"{'-' if row[axis] < 0 else ''}{'xyz'[axis]}"
