"""Trajectories, which are stamped poses, their interpolation, and changes of their axes and frames."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vobench.errors import InputError, TrajectoryError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.trajectory.nanoseconds import NS_PER_S

Stamps = NDArray[np.int64]
SKEW = 1e-2  # the largest element of RᵀR - I; it is up to 3e-3 in a text with three digits
LARGEST_M = 1e18  # a hundred light years; larger squares overflow float32, in which the KITTI devkit adds them
BLOCK = 1 << 14  # the number of poses that are checked together, which fit into the processor's cache
SMALL_SINE = 1e-9


@dataclass(frozen=True, slots=True)
class Trajectory:
    """The poses of a moving frame in a fixed frame, in order of time.

    t_ns is (N,) int64, strictly increasing; T_world_frame is (N, 4, 4) in metres.
    Raises TrajectoryError for wrong shapes, order or size, or an invalid rotation.
    """

    t_ns: Stamps
    T_world_frame: Array

    def __post_init__(self) -> None:
        has_one_pose_per_stamp = self.T_world_frame.shape == (len(self.t_ns), 4, 4)
        if not has_one_pose_per_stamp or self.t_ns.dtype != np.int64:
            raise TrajectoryError(
                f"a trajectory needs (N,) int64 stamps and (N, 4, 4) poses, "
                f"got {self.t_ns.shape} {self.t_ns.dtype} and {self.T_world_frame.shape}"
            )
        late = np.flatnonzero(np.diff(self.t_ns) <= 0)
        if late.size:
            raise TrajectoryError(f"stamps must increase, but pose {late[0] + 1} is not later than the one before it")
        for begin in range(0, len(self.t_ns), BLOCK):
            block = self.T_world_frame[begin : begin + BLOCK]
            _require_positions(block, begin)
            _require_rotations(block, begin)

    def __len__(self) -> int:
        return len(self.t_ns)

    def __repr__(self) -> str:
        if not len(self):
            return "Trajectory(no pose)"
        first_s = self.t_ns[0] / 1e9
        last_s = self.t_ns[-1] / 1e9
        path_m = self.distances_m()[-1]
        return f"Trajectory({len(self)} poses from {first_s:.3f} s to {last_s:.3f} s, path {path_m:.4g} m)"

    @property
    def positions_m(self) -> Array:
        """The positions (N, 3)."""
        return self.T_world_frame[:, :3, 3]

    def distances_m(self) -> Array:
        """The path length (N,) from the first pose to each pose."""
        return path_lengths_m(self.positions_m)

    def of_mounted(self, T_frame_mounted: Array) -> "Trajectory":
        """The trajectory of a frame fixed to this one, such as a camera on a body."""
        return Trajectory(self.t_ns, self.T_world_frame @ T_frame_mounted)


def mean_rate_hz(t_ns: Stamps) -> float:
    """The mean rate of stamps (N,); 0 for fewer than two different stamps."""
    if len(t_ns) < 2:
        return 0.0
    span_ns = int(t_ns[-1]) - int(t_ns[0])
    if span_ns == 0:
        return 0.0
    return (len(t_ns) - 1) * float(NS_PER_S) / span_ns


def step_lengths_m(positions_m: Array) -> Array:
    """The distances (N - 1,) between successive positions (N, 3)."""
    return np.asarray(np.linalg.norm(np.diff(positions_m, axis=0), axis=1))


def path_lengths_m(positions_m: Array) -> Array:
    """The path length (N,) from the first of positions (N, 3) to each of them."""
    sums_m = np.cumsum(step_lengths_m(positions_m))
    return np.concatenate([[0.0], sums_m])[: len(positions_m)]


def _require_positions(T: Array, begin: int) -> None:
    """Raise TrajectoryError for the first of poses (N, 4, 4) that is not finite or too far away.

    `begin` is the number of the first pose, for the message.
    """
    is_wrong = ~(np.abs(T) < LARGEST_M).all((1, 2))  # comparisons with NaN are false
    if not is_wrong.any():
        return
    bad = int(np.flatnonzero(is_wrong)[0])
    is_finite = np.isfinite(T[bad]).all()
    what = f"is {np.abs(T[bad]).max():.3g} m away" if is_finite else "is not finite"
    raise TrajectoryError(f"pose {begin + bad} {what}; positions should be finite and below {LARGEST_M:g} m")


def _require_rotations(T: Array, begin: int) -> None:
    """Raise TrajectoryError for the first of poses (N, 4, 4) whose rotation is skew or mirrored.

    `begin` is the number of the first pose, for the message.
    """
    R = T[:, :3, :3]
    residual = se3.transposed(R) @ R - np.eye(3)
    skew = np.abs(residual).max((1, 2))
    x_cross_y = np.cross(R[:, :, 0], R[:, :, 1])
    is_mirrored = np.sum(x_cross_y * R[:, :, 2], axis=1) < 0
    wrong = np.flatnonzero(is_mirrored | (skew > SKEW))
    if wrong.size:
        bad = int(wrong[0])
        what = "is mirrored (determinant -1)" if is_mirrored[bad] else f"is off by {skew[bad]:.3g} (RᵀR - 1)"
        raise TrajectoryError(f"the rotation of pose {begin + bad} {what}; it should be orthonormal and right-handed")


def poses_at(trajectory: Trajectory, t_ns: Stamps) -> Array:
    """The poses (N, 4, 4) of a trajectory, interpolated at t_ns (N,). Outside of its time, the end poses are returned.

    The trajectory must have a pose. Source: Shoemake (1985), slerp along the shorter arc.
    """
    stamps = trajectory.t_ns
    T = trajectory.T_world_frame
    last_start = max(len(stamps) - 2, 0)
    before = np.searchsorted(stamps, t_ns, side="right") - 1
    before = np.clip(before, 0, last_start)
    after = np.minimum(before + 1, len(stamps) - 1)

    step_ns = np.maximum(stamps[after] - stamps[before], 1)
    elapsed_ns = t_ns - stamps[before]
    share = np.clip(elapsed_ns / step_ns, 0.0, 1.0)[:, None]
    positions_m = (1 - share) * T[before, :3, 3] + share * T[after, :3, 3]
    R = _slerp(T[before, :3, :3], T[after, :3, :3], share)
    return se3.transform(R, positions_m)


def _slerp(R_begin: Array, R_end: Array, share: Array) -> Array:
    """The rotations (N, 3, 3) at shares (N, 1) of the shorter arcs between rotations (N, 3, 3)."""
    begin = se3.to_quaternion(R_begin)
    end = se3.to_quaternion(R_end)
    cosine = np.sum(begin * end, axis=-1, keepdims=True)
    end = np.where(cosine < 0, -end, end)
    cosine = np.abs(cosine)
    sine = np.linalg.norm(end - cosine * begin, axis=-1, keepdims=True)
    angle = np.arctan2(sine, cosine)

    is_small = sine < SMALL_SINE  # linear weights are accurate for small angles
    divisor = np.where(is_small, 1.0, sine)
    begin_weight = np.where(is_small, 1 - share, np.sin((1 - share) * angle) / divisor)
    end_weight = np.where(is_small, share, np.sin(share * angle) / divisor)
    q = begin_weight * begin
    q = q + end_weight * end
    return se3.from_quaternion(q / np.linalg.norm(q, axis=-1, keepdims=True))


Kind = Literal["axes", "positions", "mount", "inverse", "rotations"]
INVERSES: dict[str, Kind] = {"inverse": "inverse", "rotations:inverse": "rotations"}
AXIS = re.compile(r"([+-]?)([xyz])")
MOUNT_VALUES = 7
NORM_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True)
class PoseConvention:
    """A change of the convention of poses. `matrix` is a signed permutation S (3, 3), or T_est_gt (4, 4) of a mount.

    `axes`: poses use other axes; T' = S T S⁻¹.
    `positions`: only positions use other axes; p' = S p.
    `mount`: poses are those of another frame of the same body; T' = T T_est_gt.
    `inverse`: poses transform from the world to the frame; T' = T⁻¹.
    `rotations`: only rotations are inverted; R' = Rᵀ.
    """

    kind: Kind
    matrix: Array = field(default_factory=lambda: np.eye(3))

    def apply(self, T: Array) -> Array:
        """The poses (..., 4, 4) in the changed convention."""
        R = T[..., :3, :3]
        positions_m = T[..., :3, 3]
        if self.kind == "mount":
            moved: Array = T @ self.matrix
            return moved
        if self.kind == "inverse":
            return se3.inverse(T)
        if self.kind == "rotations":
            return se3.transform(se3.transposed(R), positions_m)
        S = self.matrix
        if self.kind == "axes":
            R = S @ R @ S.T
        return se3.transform(R, positions_m @ S.T)

    def __str__(self) -> str:
        for word, kind in INVERSES.items():
            if kind == self.kind:
                return word
        if self.kind == "mount":
            q_xyzw = se3.to_quaternion(self.matrix[:3, :3])
            values = [*self.matrix[:3, 3], *q_xyzw]
            return f"mount:{','.join(f'{value:.6g}' for value in values)}"
        axes = [_axis_name(row) for row in self.matrix]
        return f"{self.kind}:{','.join(axes)}"


def parse_pose_convention(word: str) -> PoseConvention:
    """The change that a word describes, such as `axes:z,-x,-y`, `inverse` or `mount:x,y,z,qx,qy,qz,qw`.

    Raises InputError.
    """
    if word in INVERSES:
        return PoseConvention(INVERSES[word])
    kind, _, arguments = word.partition(":")
    values = [part.strip() for part in arguments.split(",")]
    if kind == "mount":
        return PoseConvention("mount", _mount(values, word))
    if kind == "axes":
        return PoseConvention("axes", _axes(values, word))
    if kind == "positions":
        return PoseConvention("positions", _axes(values, word))
    raise InputError(
        f"a file may be read as axes:…, positions:…, mount:…, inverse or rotations:inverse, but not as {word!r}"
    )


def _axes(values: Sequence[str], word: str) -> Array:
    """The signed permutation (3, 3) that three names of axes describe."""
    rows = []
    names = []
    for value in values:
        match = AXIS.fullmatch(value)
        if match:
            sign = -1.0 if match[1] == "-" else 1.0
            names.append(match[2])
            rows.append(sign * np.eye(3)["xyz".index(match[2])])
    if len(values) != 3 or sorted(names) != ["x", "y", "z"]:
        raise InputError(f"axes are x, y and z, each once, with or without a minus, such as z,-x,-y; not {word!r}")
    return np.stack(rows)


def _mount(values: Sequence[str], word: str) -> Array:
    """The transform (4, 4) with the position and the quaternion in seven texts."""
    try:
        numbers = np.array([float(value) for value in values])
    except ValueError:
        numbers = np.zeros(0)
    position_m = numbers[:3]
    q_xyzw = numbers[3:]
    norm = np.linalg.norm(q_xyzw)
    is_complete = len(numbers) == MOUNT_VALUES and np.isfinite(numbers).all()
    if not is_complete or abs(norm - 1) > NORM_TOLERANCE:
        raise InputError(f"a mount is x,y,z,qx,qy,qz,qw in metres with a quaternion of norm 1, not {word!r}")
    return se3.transform(se3.from_quaternion(q_xyzw / norm), position_m)


def _axis_name(row: Array) -> str:
    axis = int(np.argmax(np.abs(row)))
    sign = "-" if row[axis] < 0 else ""
    return f"{sign}{'xyz'[axis]}"
