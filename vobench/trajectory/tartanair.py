"""Poses in the format of TartanAir: positions and quaternions without stamps."""

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array

TARTANAIR_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")


def format_tartanair(T: Array) -> str:
    """Poses (N, 4, 4) as TartanAir's text, with all digits. The axes stay as they are."""
    q_xyzw = se3.to_quaternion(T[:, :3, :3])
    rows = np.hstack([T[:, :3, 3], q_xyzw]).tolist()
    return "".join(" ".join(map(repr, row)) + "\n" for row in rows)
