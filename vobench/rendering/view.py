"""Views of a camera as matrices, and of its images behind planar mirrors."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering.background import PanoramaSky, StandardSky
from vobench.rendering.uniform_block import GLINT_ROWS

Box = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Plane:
    """All points x with normal · x + offset_m = 0; the normal is a unit vector (3,)."""

    normal: Array
    offset_m: float

    def distance_m(self, point_m: Array) -> float:
        """The signed distance of a point (3,), which is positive on the side of the normal."""
        return float(self.normal @ point_m + self.offset_m)

    def flipped(self) -> "Plane":
        """The same plane with the opposite normal."""
        return Plane(-self.normal, -self.offset_m)

    def moved(self, T_world_mover: Array) -> "Plane":
        """A plane that is given in the frame of a mover, in the world frame."""
        normal = T_world_mover[:3, :3] @ self.normal
        return Plane(normal, self.offset_m - float(normal @ T_world_mover[:3, 3]))

    @property
    def coefficients(self) -> Array:
        """The normal and the offset in metres, as one array (4,)."""
        return np.array([*self.normal, self.offset_m])

    @property
    def reflection(self) -> Array:
        """The matrix (4, 4) that maps a point to its mirror image (Householder, 1958)."""
        reflection = np.eye(4)
        reflection[:3, :3] -= 2 * np.outer(self.normal, self.normal)
        reflection[:3, 3] = -2 * self.offset_m * self.normal
        return reflection

    @property
    def key(self) -> tuple[float, ...]:
        """A key that is equal for planes that coincide to 10 µm."""
        coefficients = np.round(self.coefficients, 5)
        return tuple(float(coefficient) + 0.0 for coefficient in coefficients)


NEAR_M = 0.05  # the distance of the near plane
FARTHEST_PX = 1e6  # the largest pixel coordinate; larger ones are clipped


def visible_boxes(camera: Pinhole, outlines_camera_m: Array) -> Array:
    """The boxes (M, 4) of the pixels that convex outlines (M, K, 3) can cover: first and end column, first and end row.

    A box is empty if its first is not less than its end. Edges are clipped at the near plane.
    """
    start_m = outlines_camera_m
    end_m = np.roll(outlines_camera_m, -1, axis=1)
    start_depth_m = start_m[..., 2] - NEAR_M  # beyond the near plane
    end_depth_m = end_m[..., 2] - NEAR_M
    is_crossing = (start_depth_m < 0) != (end_depth_m < 0)
    depth_change_m = np.where(is_crossing, start_depth_m - end_depth_m, 1)
    share = np.where(is_crossing, start_depth_m / depth_change_m, 0)[..., None]
    points_m = np.concatenate([start_m, start_m + share * (end_m - start_m)], 1)
    is_ahead = np.concatenate([start_depth_m >= 0, is_crossing], 1)

    z_m = np.where(is_ahead, points_m[..., 2], 1)
    u = np.clip(points_m[..., 0] / z_m * camera.fx_px + camera.cx_px, -FARTHEST_PX, FARTHEST_PX)
    v = np.clip(points_m[..., 1] / z_m * camera.fy_px + camera.cy_px, -FARTHEST_PX, FARTHEST_PX)
    first_column = np.where(is_ahead, u, np.inf).min(1) - 1
    end_column = np.where(is_ahead, u, -np.inf).max(1) + 2
    first_row = np.where(is_ahead, v, np.inf).min(1) - 1
    end_row = np.where(is_ahead, v, -np.inf).max(1) + 2
    return np.asarray(np.floor(np.stack([first_column, end_column, first_row, end_row], -1)))


def within(box: Sequence[float], other: Sequence[float]) -> Box | None:
    """The intersection of two boxes, None if it is empty."""
    u0 = max(box[0], other[0])
    u1 = min(box[1], other[1])
    v0 = max(box[2], other[2])
    v1 = min(box[3], other[3])
    if u0 >= u1 or v0 >= v1:
        return None
    return int(u0), int(u1), int(v0), int(v1)


STATIC = -1  # the index of no mover
IDENTITY = np.eye(4)
NO_GLINTS = np.zeros((0, GLINT_ROWS, 4))
# The camera of OpenCV looks along +z, with y down; that of OpenGL along -z, with y up.
T_CV_GL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True, slots=True)
class PinholeView:
    """The view of a pinhole camera at one instant, directly or by way of mirrors.

    `T_world_movers` are the poses of movers.
    `ambient_cd_m2` (3,) is shown in mirrors whose reflections are not drawn.
    `eye_m` (3,) is the position of the camera, or that of its image behind the last mirror.
    `view_projection` (4, 4) maps the world to the screen of OpenGL. The depth on the screen is 1 at NEAR_M and
    decreases to 0. `direct` (4, 4) is the same without mirrors.
    `images` (4, 4) maps the world to the place where the camera sees it in the mirrors.
    `glints` (G, 4, 4) are as in `glint`.
    `mirrors` are the planes of the mirrors, from the camera on.
    `reflected_share` is the share of light that all these mirrors reflect.
    `extinction_per_m` and `airlight_cd_m2` (3,) are those of fog, 0 in clear air.
    """

    camera: Pinhole
    T_world_camera: Array
    T_world_movers: Sequence[Array]
    skies: Sequence[StandardSky | PanoramaSky]
    ambient_cd_m2: Array
    eye_m: Array
    direct: Array
    view_projection: Array
    images: Array
    glints: Array = field(default_factory=lambda: NO_GLINTS)
    mirrors: tuple[Plane, ...] = ()
    reflected_share: float = 1.0
    extinction_per_m: float = 0.0
    airlight_cd_m2: Array = field(default_factory=lambda: np.zeros(3))

    def through(self, mirror: Plane, *, strength: float) -> "PinholeView":
        """The view into a mirror, which reflects a share `strength` of the light."""
        reflection = mirror.reflection
        return replace(
            self,
            eye_m=reflection[:3, :3] @ self.eye_m + reflection[:3, 3],
            view_projection=self.view_projection @ reflection,
            images=self.images @ reflection,
            mirrors=(*self.mirrors, mirror),
            reflected_share=self.reflected_share * strength,
        )

    @property
    def depth(self) -> int:
        """The number of mirrors."""
        return len(self.mirrors)

    @property
    def mirror(self) -> Plane | None:
        """The last mirror, None without mirrors."""
        return self.mirrors[-1] if self.mirrors else None

    @property
    def world_from_screen(self) -> Array:
        """The matrix (3, 3) that maps (x, y, 1) on the screen of OpenGL to the direction of the ray in the world.

        x and y are from -1 to 1, and y is upwards.
        """
        camera = self.camera
        half_width = camera.width_px / 2
        half_height = camera.height_px / 2
        # The conversion from the screen to pixels, followed by the inverse of the camera matrix.
        x_axis = [half_width / camera.fx_px, 0, (half_width - 0.5 - camera.cx_px) / camera.fx_px]
        y_axis = [0, -half_height / camera.fy_px, (half_height - 0.5 - camera.cy_px) / camera.fy_px]
        camera_from_screen = np.array([x_axis, y_axis, [0, 0, 1]])
        return np.asarray(self.images[:3, :3].T @ self.T_world_camera[:3, :3] @ camera_from_screen)

    def pose(self, mover: int) -> Array:
        """T_world_mover (4, 4), the identity for STATIC."""
        return IDENTITY if mover == STATIC else self.T_world_movers[mover]

    def plane(self, mirror: Plane, mover: int) -> Plane:
        """A plane that is given in the frame of a mover, in the world frame."""
        return mirror if mover == STATIC else mirror.moved(self.T_world_movers[mover])


def pinhole_view(
    camera: Pinhole,
    T_world_camera: Array,
    T_world_movers: Sequence[Array],
    skies: Sequence[StandardSky | PanoramaSky],
    *,
    ambient_cd_m2: Array,
    glints: Array = NO_GLINTS,
) -> PinholeView:
    """The view of a camera without mirrors."""
    direct = _projection(camera) @ T_CV_GL @ se3.inverse(T_world_camera)
    return PinholeView(
        camera=camera,
        T_world_camera=T_world_camera,
        T_world_movers=T_world_movers,
        skies=skies,
        ambient_cd_m2=ambient_cd_m2,
        eye_m=T_world_camera[:3, 3],
        direct=direct,
        view_projection=direct,
        images=IDENTITY,
        glints=glints,
    )


def _projection(camera: Pinhole) -> Array:
    """The matrix (4, 4) from the camera of OpenGL to its screen, whose origin is the corner of the top-left pixel.

    The depth is NEAR_M divided by the distance along the axis, because its relative resolution is then the same at all
    distances (Reed, 2015).
    """
    P = np.zeros((4, 4))
    P[0, 0] = 2 * camera.fx_px / camera.width_px
    P[0, 2] = 1 - 2 * (camera.cx_px + 0.5) / camera.width_px
    P[1, 1] = 2 * camera.fy_px / camera.height_px
    P[1, 2] = 2 * (camera.cy_px + 0.5) / camera.height_px - 1
    P[2, 3] = NEAR_M
    P[3, 2] = -1
    return P
