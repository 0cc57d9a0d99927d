"""Angular velocity and acceleration of a rotation given as directions or as a quaternion that change with time."""

from typing import NamedTuple

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array


class Jet(NamedTuple):
    """Vectors (K, n) with their first and second derivatives (K, n)."""

    value: Array
    rate: Array
    change: Array


class Attitude(NamedTuple):
    """Rotations R (K, 3, 3), body to world, with R' = R [turn]x and turn_rate = turn', both (K, 3) in body axes."""

    R: Array
    turn: Array
    turn_rate: Array

    def in_body(self, vectors: Array) -> Array:
        """Vectors (K, 3) of the world in body axes."""
        return turned(np.swapaxes(self.R, -1, -2), vectors)


def turned(R: Array, vectors: Array) -> Array:
    """Vectors (K, 3), each by its own rotation of (K, 3, 3)."""
    return (R @ vectors[..., None])[..., 0]


def unit(v: Jet) -> Jet:
    """The direction of v, which may nowhere be zero."""
    length = np.linalg.norm(v.value, axis=-1, keepdims=True)
    n = v.value / length
    length_rate = _dot(n, v.rate)
    rate = (v.rate - n * length_rate) / length
    length_change = _dot(rate, v.rate) + _dot(n, v.change)
    return Jet(n, rate, (v.change - 2 * rate * length_rate - n * length_change) / length)


def cross(a: Jet, b: Jet) -> Jet:
    """The product a × b."""
    rate = np.cross(a.rate, b.value) + np.cross(a.value, b.rate)
    change = np.cross(a.change, b.value) + 2 * np.cross(a.rate, b.rate) + np.cross(a.value, b.change)
    return Jet(np.cross(a.value, b.value), rate, change)


def of_axes(x: Jet, y: Jet, z: Jet) -> Attitude:
    """The attitude whose body axes are these unit vectors of the world, each square to the others."""
    turn = np.concatenate([_dot(z.value, y.rate), _dot(x.value, z.rate), _dot(y.value, x.rate)], -1)
    # y'' = R ([turn']x + [turn]x²) e_y, whose z part is turn_rate_x + turn_y turn_z; the others in turn.
    swept = np.concatenate([_dot(z.value, y.change), _dot(x.value, z.change), _dot(y.value, x.change)], -1)
    turn_rate = swept - np.roll(turn, -1, -1) * np.roll(turn, -2, -1)
    return Attitude(np.stack([x.value, y.value, z.value], -1), turn, turn_rate)


def of_quaternion(q_xyzw: Jet) -> Attitude:
    """The attitude of quaternions (K, 4) of any length above 0: turn = 2 vec(q* q'), turn_rate = 2 vec(q* q'')."""
    q = unit(q_xyzw)
    return Attitude(se3.from_quaternion(q.value), _seen(q.value, q.rate), _seen(q.value, q.change))


def _seen(q: Array, p: Array) -> Array:
    """2 vec(q* p)."""
    seen: Array = 2 * (q[:, 3:] * p[:, :3] - p[:, 3:] * q[:, :3] - np.cross(q[:, :3], p[:, :3]))
    return seen


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.sum(a * b, axis=-1, keepdims=True)
    return product
