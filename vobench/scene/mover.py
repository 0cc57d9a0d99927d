"""Things that move on a script: their surfaces, and where they are at any time."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.scene.surface import Surface


@dataclass(frozen=True, slots=True)
class Path:
    """Straight ways between positions_m (K, 3) and yaw_deg (K,) at increasing times_s (K,), even in time.

    Before the first and after the last time the mover rests, or starts again where `repeats`.
    """

    times_s: Array
    positions_m: Array
    yaw_deg: Array
    repeats: bool = False

    def pose(self, t_ns: float) -> Array:
        """T_world_mover (4, 4) at an instant."""
        t_s = t_ns / 1e9
        if self.repeats:
            t_s = self.times_s[0] + (t_s - self.times_s[0]) % (self.times_s[-1] - self.times_s[0])
        position = [np.interp(t_s, self.times_s, axis) for axis in self.positions_m.T]
        yaw = np.deg2rad(np.interp(t_s, self.times_s, self.yaw_deg))
        return se3.transform(se3.rotation_z(yaw), np.array(position))


@dataclass(frozen=True, slots=True)
class Mover:
    """A rigid thing on a path; its surfaces are in its own frame."""

    name: str
    surfaces: tuple[Surface, ...]
    path: Path
