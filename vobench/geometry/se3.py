"""Rigid transforms as (..., 4, 4) float64 arrays: T_a_b takes coordinates in b to coordinates in a."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def transform(R_a_b: ArrayLike, t_a_b: ArrayLike) -> Array:
    """Stack rotations (..., 3, 3) and translations (..., 3) in metres into (..., 4, 4)."""
    R = np.asarray(R_a_b, float)
    t = np.asarray(t_a_b, float)
    T = np.zeros((*np.broadcast_shapes(R.shape[:-2], t.shape[:-1]), 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = t
    T[..., 3, 3] = 1.0
    return T


def inverse(T_a_b: Array) -> Array:
    """T_b_a, using that the inverse of a rotation is its transpose."""
    R_b_a = np.swapaxes(T_a_b[..., :3, :3], -1, -2)
    return transform(R_b_a, -(R_b_a @ T_a_b[..., :3, 3:])[..., 0])


def apply(T_a_b: Array, points_b: ArrayLike) -> Array:
    """Points (..., N, 3) in b to points in a."""
    return np.asarray(points_b, float) @ np.swapaxes(T_a_b[..., :3, :3], -1, -2) + T_a_b[..., None, :3, 3]


def rotation_angle(R: Array) -> Array:
    """Angle in rad of rotations (..., 3, 3): exact near 0, where acos of the trace is not."""
    vee = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1)
    angle: Array = np.arctan2(np.linalg.norm(vee, axis=-1), np.trace(R, axis1=-2, axis2=-1) - 1.0)
    return angle


def roll_pitch_yaw_rad(R: Array) -> Array:
    """Angles (..., 3) of R = Rz(yaw) Ry(pitch) Rx(roll); at 90° of pitch, where they merge, roll is 0."""
    pitch = np.arctan2(-R[..., 2, 0], np.hypot(R[..., 0, 0], R[..., 1, 0]))
    merged = np.hypot(R[..., 2, 1], R[..., 2, 2]) < 1e-12
    roll = np.where(merged, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    yaw = np.where(merged, np.arctan2(-R[..., 0, 1], R[..., 1, 1]), np.arctan2(R[..., 1, 0], R[..., 0, 0]))
    return np.stack([roll, pitch, yaw], -1)


def is_rotation(R: Array, *, tolerance: float = 1e-6) -> bool:
    """Whether every (..., 3, 3) is finite, orthonormal to `tolerance` and right-handed."""
    if not np.isfinite(R).all():
        return False
    residual = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(initial=0.0)
    return bool(residual <= tolerance and (np.linalg.det(R) > 0).all())


def nearest_rotation(M: Array) -> Array:
    """The rotation closest to M (..., 3, 3) in the Frobenius norm, by SVD."""
    U, _, Vt = np.linalg.svd(M)
    U[..., :, 2] *= np.linalg.det(U @ Vt)[..., None]
    nearest: Array = U @ Vt
    return nearest


def rotation_z(angle_rad: ArrayLike) -> Array:
    """Rotations (..., 3, 3) about z by `angle_rad` (...)."""
    angle = np.asarray(angle_rad, float)
    R = np.zeros((*angle.shape, 3, 3))
    R[..., 0, 0] = R[..., 1, 1] = np.cos(angle)
    R[..., 1, 0] = np.sin(angle)
    R[..., 0, 1] = -R[..., 1, 0]
    R[..., 2, 2] = 1.0
    return R


def from_quaternion(q_xyzw: ArrayLike) -> Array:
    """Rotations (..., 3, 3) of unit quaternions (..., 4), scalar last."""
    x, y, z, w = np.moveaxis(np.asarray(q_xyzw, float), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def to_quaternion(R: Array) -> Array:
    """Unit quaternions (..., 4), scalar last and non-negative, of rotations (..., 3, 3).

    Source: Shepperd (1978): of four equivalent forms, take the best conditioned one.
    """
    m = R
    trace = np.trace(m, axis1=-2, axis2=-1)
    d = np.stack([m[..., 0, 0], m[..., 1, 1], m[..., 2, 2], trace], -1)
    x = m[..., 2, 1] - m[..., 1, 2]
    y = m[..., 0, 2] - m[..., 2, 0]
    z = m[..., 1, 0] - m[..., 0, 1]
    xy = m[..., 0, 1] + m[..., 1, 0]
    xz = m[..., 0, 2] + m[..., 2, 0]
    yz = m[..., 1, 2] + m[..., 2, 1]
    diagonal = 1 - trace[..., None] + 2 * d[..., :3]
    forms = np.stack(
        [
            np.stack([diagonal[..., 0], xy, xz, x], -1),
            np.stack([xy, diagonal[..., 1], yz, y], -1),
            np.stack([xz, yz, diagonal[..., 2], z], -1),
            np.stack([x, y, z, 1 + trace], -1),
        ],
        -2,
    )
    q = np.take_along_axis(forms, np.argmax(d, -1)[..., None, None], -2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    quaternion: Array = np.where(q[..., 3:] < 0, -q, q)
    return quaternion
