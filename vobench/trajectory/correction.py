"""What to change in a trajectory whose axes or frame are not the other one's, said in one word each."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.se3 import Array

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
