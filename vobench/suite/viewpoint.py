"""Where cameras look at a scene from: along the path in its free space, or from around it if it has none."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.geometry import RayCaster
from vobench.scene.triangles import Triangles
from vobench.suite.free_space import (
    LEAST_PLACE_M,
    LEAST_RADIUS_M,
    FreeCircle,
    largest_free_circle,
    longer_level_side_m,
    path_radius_m,
)

# Places along the path, and how the cameras there look.
PATH_PLACES = 8
EYE_HEIGHTS_M = (0.4, 1.2)  # of cameras on a robot and in a hand, by turns along the path
EYE_SHARE = 0.7  # of the free height at a place, below which cameras stay
PATH_PITCH_DEG = 10.0
# What shows less around its path counts as an object.
LEAST_SHOWN = 0.35  # share of the rays from the path that should meet something
COARSE_LENS = Pinhole(16, 10, 7.75, 7.75, 7.5, 4.5)
# Around an object.
ORBIT_PLACES = 8
ORBIT_PITCH_DEG = 20.0
ORBIT_DISTANCE = 1.7  # in radii of the object's bounding sphere, which then fills a picture


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A camera's position (x, y, z) and its direction; yaw 0 is along x, and pitch is downwards."""

    eye_m: tuple[float, float, float]
    yaw_deg: float
    pitch_deg: float

    def T_world_camera(self) -> Array:
        """The camera's pose (4, 4)."""
        T_world_body = se3.transform(se3.rotation_z(np.deg2rad(self.yaw_deg)), self.eye_m)
        T_world_camera: Array = T_world_body @ looking(pitch_deg=self.pitch_deg, position_m=(0, 0, 0))
        return T_world_camera

    def rays(self, lens: Pinhole) -> Array:
        """The unit directions (H * W, 3) of a lens's pixels in the world."""
        columns, rows = np.meshgrid(np.arange(lens.width_px), np.arange(lens.height_px))
        pixels = np.stack([columns, rows], -1).reshape(-1, 2)
        directions = lens.rays(pixels) @ self.T_world_camera()[:3, :3].T
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        return np.asarray(directions / lengths)


def viewpoints(faces: Triangles, caster: RayCaster) -> list[Viewpoint]:
    """Cameras along the free path that look ahead and back, or around a scene that is an object."""
    free = largest_free_circle(faces, caster)
    if free is not None and is_place(faces, caster, free):
        return _along_path(free, caster)
    corners_m = faces.corners_m.reshape(-1, 3)
    return around(corners_m.min(0), corners_m.max(0), count=ORBIT_PLACES)


def is_place(faces: Triangles, caster: RayCaster, free: FreeCircle | None) -> bool:
    """Whether a body can drive in a scene with this largest free circle; otherwise the scene counts as an object.

    A chair's seat and a flat roof have free circles, too, but from there most of what is seen is the sky.
    """
    if free is None or free.radius_m < LEAST_RADIUS_M:
        return False
    if longer_level_side_m(faces) < LEAST_PLACE_M:
        return False
    is_shown = list[bool]()
    for view in _along_path(free, caster):
        directions = view.rays(COARSE_LENS)
        face = caster.nearest(np.tile(view.eye_m, (len(directions), 1)), directions)
        is_shown += (face >= 0).tolist()
    return float(np.mean(is_shown)) >= LEAST_SHOWN


def _along_path(free: FreeCircle, caster: RayCaster) -> list[Viewpoint]:
    radius_m = path_radius_m(free)
    views = list[Viewpoint]()
    for place in range(PATH_PLACES):
        angle_deg = 360 * place / PATH_PLACES
        x_m = free.x_m + radius_m * float(np.cos(np.deg2rad(angle_deg)))
        y_m = free.y_m + radius_m * float(np.sin(np.deg2rad(angle_deg)))
        height_m = EYE_HEIGHTS_M[place % len(EYE_HEIGHTS_M)]
        lowest_eye_m = np.array([[x_m, y_m, free.floor_m + min(EYE_HEIGHTS_M)]])
        above = caster.hits(lowest_eye_m, np.array([[0.0, 0.0, 1.0]]))
        if above.face[0] >= 0:
            free_height_m = min(EYE_HEIGHTS_M) + float(above.distance[0])
            height_m = min(height_m, EYE_SHARE * free_height_m)
        eye_m = (x_m, y_m, free.floor_m + height_m)
        for turn_deg in (90.0, 270.0):
            views.append(Viewpoint(eye_m, angle_deg + turn_deg, PATH_PITCH_DEG))
    return views


def around(low_m: ArrayLike, high_m: ArrayLike, *, count: int) -> list[Viewpoint]:
    """`count` cameras around the box from `low_m` to `high_m` (3,) that look at it from slightly above."""
    low = np.asarray(low_m, float)
    high = np.asarray(high_m, float)
    centre_m = (low + high) / 2
    distance_m = ORBIT_DISTANCE * max(float(np.linalg.norm(high - low)) / 2, 1e-3)
    pitch_rad = np.deg2rad(ORBIT_PITCH_DEG)
    views = list[Viewpoint]()
    for place in range(count):
        yaw_deg = 360 * (place + 0.5) / count
        ahead = np.array([np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg)), 0.0])
        offset_m = distance_m * (np.cos(pitch_rad) * ahead - np.sin(pitch_rad) * np.array([0.0, 0.0, 1.0]))
        x_m, y_m, z_m = (centre_m - offset_m).tolist()
        views.append(Viewpoint((x_m, y_m, z_m), yaw_deg, ORBIT_PITCH_DEG))
    return views
