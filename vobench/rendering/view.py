"""Views of a camera as matrices, and of its images behind planar mirrors."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array

Box = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Plane:
    """All points x with normal · x + offset_m = 0; the normal is a unit vector (3,)."""

    normal: Array
    offset_m: float

    def distance_m(self, point_m: Array) -> float:
        """Signed distance of a point (3,): positive on the side of the normal."""
        return float(self.normal @ point_m + self.offset_m)

    def flipped(self) -> "Plane":
        """The same plane, seen from its other side."""
        return Plane(-self.normal, -self.offset_m)

    def moved(self, T_world_mover: Array) -> "Plane":
        """The plane of a mover's frame where the mover is."""
        normal = T_world_mover[:3, :3] @ self.normal
        return Plane(normal, self.offset_m - float(normal @ T_world_mover[:3, 3]))

    @property
    def reflection(self) -> Array:
        """Matrix (4, 4) that takes each point to its image behind the plane (Householder, 1958)."""
        reflection = np.eye(4)
        reflection[:3, :3] -= 2 * np.outer(self.normal, self.normal)
        reflection[:3, 3] = -2 * self.offset_m * self.normal
        return reflection

    @property
    def key(self) -> tuple[float, ...]:
        """Equal for planes that coincide to 10 µm."""
        return tuple(float(x) + 0.0 for x in np.round([*self.normal, self.offset_m], 5))


NEAR_M = 0.05


def visible_boxes(camera: Pinhole, outlines_camera_m: Array) -> Array:
    """First and end column, first and end row (M, 4) that convex outlines (M, K, 3) can touch, none where first >= end.

    Edges are cut at the near plane, behind which a projection has no meaning.
    """
    here = outlines_camera_m
    there = np.roll(outlines_camera_m, -1, axis=1)
    z0 = here[..., 2] - NEAR_M
    z1 = there[..., 2] - NEAR_M
    crossing = (z0 < 0) != (z1 < 0)
    share = np.where(crossing, z0 / np.where(crossing, z0 - z1, 1), 0)[..., None]
    points = np.concatenate([here, here + share * (there - here)], 1)
    ahead = np.concatenate([z0 >= 0, crossing], 1)
    z = np.where(ahead, points[..., 2], 1)
    u, v = (
        np.clip(points[..., axis] / z * focal + centre, -1e6, 1e6)
        for axis, focal, centre in ((0, camera.fx_px, camera.cx_px), (1, camera.fy_px, camera.cy_px))
    )
    low = [np.where(ahead, x, np.inf).min(1) - 1 for x in (u, v)]
    high = [np.where(ahead, x, -np.inf).max(1) + 2 for x in (u, v)]
    return np.asarray(np.floor(np.stack([low[0], high[0], low[1], high[1]], -1)))


def within(box: Sequence[float], other: Sequence[float]) -> Box | None:
    """What two boxes share, None for nothing."""
    u0 = max(box[0], other[0])
    v0 = max(box[2], other[2])
    u1 = min(box[1], other[1])
    v1 = min(box[3], other[3])
    return (int(u0), int(u1), int(v0), int(v1)) if u0 < u1 and v0 < v1 else None


STATIC = -1
IDENTITY = np.eye(4)
NO_GLINTS = np.zeros((0, 3, 4))
# OpenCV's camera faces +z with y down, OpenGL's -z with y up.
T_CV_GL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True, slots=True)
class PinholeView:
    """A pinhole at a place and time, perhaps by way of mirrors: then the picture is what the last one shows.

    Movers' poses T_world_mover, the skies' coefficients (S, 4, 4), ambient_cd_m2 (3,) for mirrors that are not
    followed further. view_projection (4, 4): from the world to OpenGL's screen, nearness from 1 at NEAR_M to 0;
    `direct` (4, 4) as if there were no mirrors.
    eye_m (3,) is behind the last mirror, if any.
    images (4, 4) takes what the last mirror shows to where the camera sees it. glints (G, 3, 4) as in `probe`.
    """

    camera: Pinhole
    T_world_camera: Array
    T_world_movers: Sequence[Array]
    skies: Array
    ambient_cd_m2: Array
    eye_m: Array
    direct: Array
    view_projection: Array
    images: Array
    glints: Array = field(default_factory=lambda: NO_GLINTS)
    mirrors: tuple[Plane, ...] = ()

    def through(self, mirror: Plane) -> "PinholeView":
        """The view into a mirror."""
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
        return np.asarray(self.images[:3, :3].T @ self.T_world_camera[:3, :3] @ rays)

    def pose(self, mover: int) -> Array:
        """T_world_mover, the identity for what is static."""
        return IDENTITY if mover == STATIC else self.T_world_movers[mover]

    def plane(self, mirror: Plane, mover: int) -> Plane:
        """Where a plane of a mover's frame is."""
        return mirror if mover == STATIC else mirror.moved(self.T_world_movers[mover])


def pinhole_view(
    camera: Pinhole,
    T_world_camera: Array,
    T_world_movers: Sequence[Array],
    skies: Array,
    *,
    ambient_cd_m2: Array,
    glints: Array = NO_GLINTS,
) -> PinholeView:
    """The view without a mirror."""
    direct = _projection(camera) @ T_CV_GL @ se3.inverse(T_world_camera)
    eye_m = T_world_camera[:3, 3]
    return PinholeView(
        camera, T_world_camera, T_world_movers, skies, ambient_cd_m2, eye_m, direct, direct, IDENTITY, glints
    )


def _projection(camera: Pinhole) -> Array:
    """From OpenGL's camera to its screen (4, 4), which counts from the corner of the top-left pixel.

    Depth is NEAR_M over the distance ahead: floats are then as fine far away as near by (Reed, 2015).
    """
    P = np.zeros((4, 4))
    P[0, 0] = 2 * camera.fx_px / camera.width_px
    P[0, 2] = 1 - 2 * (camera.cx_px + 0.5) / camera.width_px
    P[1, 1] = 2 * camera.fy_px / camera.height_px
    P[1, 2] = 2 * (camera.cy_px + 0.5) / camera.height_px - 1
    P[2, 3] = NEAR_M
    P[3, 2] = -1
    return P
