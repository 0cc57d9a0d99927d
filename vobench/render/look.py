"""Where a picture is seen from and when, as matrices for OpenGL; and the same behind a mirror."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pyrender import IntrinsicsCamera

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.render.mirror import Plane

NEAR_M, FAR_M = 0.05, 60.0
STATIC = -1
IDENTITY = np.eye(4)
# OpenCV's camera looks along +z with y down, OpenGL's along -z with y up.
T_CV_GL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True, slots=True)
class Look:
    """A pinhole at a place and time: movers' poses T_world_mover, the skies' coefficients, and a mirror or None.

    eye_m (3,) is where the picture is seen from, behind the mirror if there is one; with a mirror, the picture is
    the one that the mirror's plane shows, pixel for pixel. view_projection (4, 4): from the world to OpenGL's screen.
    """

    camera: Pinhole
    T_world_camera: Array
    T_world_movers: Sequence[Array]
    skies: Array
    eye_m: Array
    view_projection: Array
    mirror: Plane | None = None

    def through(self, mirror: Plane) -> "Look":
        """The look into a mirror."""
        reflection = mirror.reflection
        eye_m = reflection[:3, :3] @ self.eye_m + reflection[:3, 3]
        return replace(self, mirror=mirror, eye_m=eye_m, view_projection=self.view_projection @ reflection)

    @property
    def world_from_screen(self) -> Array:
        """(3, 3): from (x, y, 1) on OpenGL's screen, -1 to 1 and upwards, to the ray there in the world."""
        c = self.camera
        # The camera matrix's inverse, after the step from the screen to pixels.
        rays = np.array(
            [
                [c.width_px / 2 / c.fx_px, 0, (c.width_px / 2 - 0.5 - c.cx_px) / c.fx_px],
                [0, -c.height_px / 2 / c.fy_px, (c.height_px / 2 - 0.5 - c.cy_px) / c.fy_px],
                [0, 0, 1],
            ]
        )
        world: Array = self.T_world_camera[:3, :3] @ rays
        return world if self.mirror is None else self.mirror.reflection[:3, :3] @ world

    def pose(self, mover: int) -> Array:
        """T_world_mover, the identity for what stands still."""
        return IDENTITY if mover == STATIC else self.T_world_movers[mover]

    def plane(self, mirror: Plane, mover: int) -> Plane:
        """Where a plane of a mover's frame is."""
        return mirror if mover == STATIC else mirror.moved(self.T_world_movers[mover])


def look(camera: Pinhole, T_world_camera: Array, T_world_movers: Sequence[Array], skies: Array) -> Look:
    """The look without a mirror."""
    # OpenGL counts from the corner of the top-left pixel, OpenCV from its centre.
    lens = IntrinsicsCamera(camera.fx_px, camera.fy_px, camera.cx_px + 0.5, camera.cy_px + 0.5, NEAR_M, FAR_M)
    P = lens.get_projection_matrix(camera.width_px, camera.height_px)
    view_projection = P @ T_CV_GL @ se3.inverse(T_world_camera)
    return Look(camera, T_world_camera, T_world_movers, skies, T_world_camera[:3, 3], view_projection)
