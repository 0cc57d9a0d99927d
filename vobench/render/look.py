"""Where a picture is seen from and when, as matrices for OpenGL; and the same behind mirrors."""

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
    """A pinhole at a place and time, perhaps by way of mirrors: then the picture is what the last one shows.

    Movers' poses T_world_mover, the skies' coefficients, ambient_cd_m2 for mirrors that are not followed further.
    view_projection (4, 4): from the world to OpenGL's screen, and `direct` (4, 4) as if there were no mirrors.
    eye_m (3,) is behind the last mirror, if any.
    images (4, 4) takes what the last mirror shows to where the camera sees it.
    """

    camera: Pinhole
    T_world_camera: Array
    T_world_movers: Sequence[Array]
    skies: Array
    ambient_cd_m2: float
    eye_m: Array
    direct: Array
    view_projection: Array
    images: Array
    mirrors: tuple[Plane, ...] = ()

    def through(self, mirror: Plane) -> "Look":
        """The look into a mirror."""
        reflection = mirror.reflection
        return replace(
            self,
            eye_m=reflection[:3, :3] @ self.eye_m + reflection[:3, 3],
            view_projection=self.view_projection @ reflection,
            images=self.images @ reflection,
            mirrors=(*self.mirrors, mirror),
        )

    @property
    def depth(self) -> int:
        """How many mirrors lie between."""
        return len(self.mirrors)

    @property
    def mirror(self) -> Plane | None:
        """The mirror whose picture it is."""
        return self.mirrors[-1] if self.mirrors else None

    @property
    def T_camera_world(self) -> Array:
        """(4, 4), mirrored where the picture is: from the world to where the camera sees it."""
        return se3.inverse(self.T_world_camera) @ self.images

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
        world: Array = self.images[:3, :3].T @ self.T_world_camera[:3, :3] @ rays
        return world

    def pose(self, mover: int) -> Array:
        """T_world_mover, the identity for what stands still."""
        return IDENTITY if mover == STATIC else self.T_world_movers[mover]

    def plane(self, mirror: Plane, mover: int) -> Plane:
        """Where a plane of a mover's frame is."""
        return mirror if mover == STATIC else mirror.moved(self.T_world_movers[mover])


def look(
    camera: Pinhole, T_world_camera: Array, T_world_movers: Sequence[Array], skies: Array, ambient_cd_m2: float
) -> Look:
    """The look without a mirror."""
    # OpenGL counts from the corner of the top-left pixel, OpenCV from its centre.
    lens = IntrinsicsCamera(camera.fx_px, camera.fy_px, camera.cx_px + 0.5, camera.cy_px + 0.5, NEAR_M, FAR_M)
    P = lens.get_projection_matrix(camera.width_px, camera.height_px)
    direct = P @ T_CV_GL @ se3.inverse(T_world_camera)
    eye_m = T_world_camera[:3, 3]
    return Look(camera, T_world_camera, T_world_movers, skies, ambient_cd_m2, eye_m, direct, direct, IDENTITY)
