"""Rigid transforms as (..., 4, 4) float64 arrays: T_a_b takes coordinates in b to coordinates in a."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MERGED_COSINE = 1e-12  # of the pitch: below it roll and yaw turn about the same axis


def transform(R_a_b: ArrayLike, t_a_b: ArrayLike) -> Array:
    """Transforms (..., 4, 4) of rotations (..., 3, 3) and translations (..., 3) in metres."""
    R = np.asarray(R_a_b, float)
    t = np.asarray(t_a_b, float)
    batch_shape = np.broadcast_shapes(R.shape[:-2], t.shape[:-1])

    T = np.zeros((*batch_shape, 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = t
    T[..., 3, 3] = 1.0
    return T


def transposed(R: Array) -> Array:
    """Transposes (..., 3, 3) of rotations, which are their inverses."""
    return np.swapaxes(R, -1, -2)


def inverse(T_a_b: Array) -> Array:
    """T_b_a, using that the inverse of a rotation is its transpose."""
    R_b_a = transposed(T_a_b[..., :3, :3])
    rotated_origin = R_b_a @ T_a_b[..., :3, 3:]
    return transform(R_b_a, -rotated_origin[..., 0])


def apply(T_a_b: Array, points_b: ArrayLike) -> Array:
    """Coordinates in a of points (..., N, 3) in b."""
    R_b_a = transposed(T_a_b[..., :3, :3])
    t_a_b = T_a_b[..., None, :3, 3]
    return np.asarray(points_b, float) @ R_b_a + t_a_b


def rotation_angle(R: Array) -> Array:
    """Angles (...) in rad of rotations (..., 3, 3), accurate near 0, where acos of the trace is not."""
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = _entries(R)
    axis_times_sine = np.stack([zy - yz, xz - zx, yx - xy], -1)  # twice the sine of the angle along the axis
    twice_sine = np.linalg.norm(axis_times_sine, axis=-1)
    twice_cosine = np.trace(R, axis1=-2, axis2=-1) - 1.0
    angle: Array = np.arctan2(twice_sine, twice_cosine)
    return angle


def roll_pitch_yaw_rad(R: Array) -> Array:
    """Angles (..., 3) of R = Rz(yaw) Ry(pitch) Rx(roll); at 90° of pitch, where they merge, roll is 0."""
    (xx, xy, _), (yx, yy, _), (zx, zy, zz) = _entries(R)
    pitch = np.arctan2(-zx, np.hypot(xx, yx))
    is_merged = np.hypot(zy, zz) < MERGED_COSINE
    roll = np.where(is_merged, 0.0, np.arctan2(zy, zz))
    merged_yaw = np.arctan2(-xy, yy)
    yaw = np.where(is_merged, merged_yaw, np.arctan2(yx, xx))
    return np.stack([roll, pitch, yaw], -1)


def is_rotation(R: Array, *, tolerance: float = 1e-6) -> bool:
    """Whether every (..., 3, 3) is finite, orthonormal to `tolerance` and right-handed."""
    if not np.isfinite(R).all():
        return False
    residual = np.abs(transposed(R) @ R - np.eye(3)).max(initial=0.0)
    is_right_handed = (np.linalg.det(R) > 0).all()
    return bool(residual <= tolerance and is_right_handed)


def nearest_rotation(M: Array) -> Array:
    """Rotations closest to M (..., 3, 3) in the Frobenius norm, by singular value decomposition."""
    U, _, Vt = np.linalg.svd(M)
    handedness = np.linalg.det(U @ Vt)  # 1, or -1 for a reflection
    U[..., :, 2] *= handedness[..., None]
    nearest: Array = U @ Vt
    return nearest


def rotation_z(angle_rad: ArrayLike) -> Array:
    """Rotations (..., 3, 3) about z by `angle_rad` (...)."""
    angle = np.asarray(angle_rad, float)
    cosine = np.cos(angle)
    sine = np.sin(angle)

    R = np.zeros((*angle.shape, 3, 3))
    R[..., 0, 0] = cosine
    R[..., 1, 1] = cosine
    R[..., 1, 0] = sine
    R[..., 0, 1] = -sine
    R[..., 2, 2] = 1.0
    return R


def from_quaternion(q_xyzw: ArrayLike) -> Array:
    """Rotations (..., 3, 3) of unit quaternions (..., 4), scalar last."""
    q = np.asarray(q_xyzw, float)
    x, y, z, w = np.moveaxis(q, -1, 0)
    R = np.empty((*q.shape[:-1], 3, 3))
    R[..., 0, 0] = 1 - 2 * (y * y + z * z)
    R[..., 0, 1] = 2 * (x * y - z * w)
    R[..., 0, 2] = 2 * (x * z + y * w)
    R[..., 1, 0] = 2 * (x * y + z * w)
    R[..., 1, 1] = 1 - 2 * (x * x + z * z)
    R[..., 1, 2] = 2 * (y * z - x * w)
    R[..., 2, 0] = 2 * (x * z - y * w)
    R[..., 2, 1] = 2 * (y * z + x * w)
    R[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return R


def to_quaternion(R: Array) -> Array:
    """Unit quaternions (..., 4), scalar last and non-negative, of rotations (..., 3, 3).

    Source: Shepperd (1978): of four equivalent forms, take the best conditioned one.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = _entries(R)
    trace = np.trace(R, axis1=-2, axis2=-1)

    # Products of the components, each times 4: of two of x, y and z, and of one of them with w.
    x_y = xy + yx
    x_z = xz + zx
    y_z = yz + zy
    x_w = zy - yz
    y_w = xz - zx
    z_w = yx - xy
    x_x = 1 - trace + 2 * xx
    y_y = 1 - trace + 2 * yy
    z_z = 1 - trace + 2 * zz
    w_w = 1 + trace

    # Each form is the quaternion times 4 times one of its components.
    form_x = np.stack([x_x, x_y, x_z, x_w], -1)
    form_y = np.stack([x_y, y_y, y_z, y_w], -1)
    form_z = np.stack([x_z, y_z, z_z, z_w], -1)
    form_w = np.stack([x_w, y_w, z_w, w_w], -1)
    forms = np.stack([form_x, form_y, form_z, form_w], -2)  # (..., 4, 4)

    largest = np.argmax(np.stack([xx, yy, zz, trace], -1), -1)
    form = np.take_along_axis(forms, largest[..., None, None], -2)[..., 0, :]
    q = form / np.linalg.norm(form, axis=-1, keepdims=True)
    is_negative = q[..., 3:] < 0
    quaternion: Array = np.where(is_negative, -q, q)
    return quaternion


def _entries(R: Array) -> Array:
    """The entries of matrices (..., 3, 3), by row and column: (3, 3, ...)."""
    return np.moveaxis(R, (-2, -1), (0, 1))
