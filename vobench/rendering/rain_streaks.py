"""Drops of rain in pictures: each covers pixels along its path during the exposure, and shows what is around it.

Source: Garg and Nayar (2007), Vision and rain, IJCV 75(1). A drop refracts light from a wide cone, so its luminance is
that of the surroundings on average; while it passes a pixel for a share of the exposure, it replaces that share of the
background. Drops do not oscillate here.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Mask
from vobench.rendering.geometry import FAR_M, RayCaster, are_panes, tangents
from vobench.rendering.rain_kernels import draw_streaks
from vobench.rendering.renderer import Radiance, View
from vobench.scene.rain import FallingDrops, NearDrops, Rain
from vobench.scene.scene import Scene, triangles
from vobench.sensor.lens_drops import APERTURE_M
from vobench.trajectory.nanoseconds import NS_PER_S

LEAST_DISTANCE_M = 0.1  # nearer drops fall on the camera
PROBE_M = 1e-4  # the length of the steps by which the magnification is measured
OUTSIDE_PX = 4.0  # how far beyond the border of the picture the paths of drops are still drawn


class RainStreaks:
    """Draws the drops that fall in a scene into its pictures."""

    def __init__(self, scene: Scene, rain: Rain) -> None:
        self._scene = scene
        self._drops = FallingDrops(rain)
        self._at_rest = _solid_faces(scene, 0)

    def cover(self, camera: Camera, views: Sequence[View]) -> Radiance:
        """The share (H, W) of each pixel and of its exposure that drops cover."""
        cover = np.zeros((camera.height_px, camera.width_px))
        drops = self._candidates(camera, views)
        for view in views:
            strip = np.zeros_like(cover)
            for index in range(len(view.start_ns)):
                _draw(strip, camera, view, index, drops)
            cover[view.rows] = strip[view.rows]
        return np.minimum(cover, 1.0).astype(np.float32)

    def _candidates(self, camera: Camera, views: Sequence[View]) -> NearDrops:
        """The drops that may be seen during the exposure of a picture."""
        start_ns = min(int(view.start_ns[0]) for view in views)
        end_ns = max(int(view.end_ns[-1]) for view in views)
        t_ns = (start_ns + end_ns) / 2
        middle = views[len(views) // 2]
        camera_m = middle.T_world_camera[len(middle.start_ns) // 2, :3, 3]
        drops = self._drops.near(camera_m, t_ns)
        drops = drops.take(_may_be_seen(camera, views, drops))

        caster = _solid_faces(self._scene, t_ns) if self._scene.movers else self._at_rest
        eyes_m = np.broadcast_to(camera_m, drops.positions_m.shape)
        is_hidden = caster.occluded(eyes_m, drops.positions_m)
        drops = drops.take(~is_hidden)
        fallen_from = -unit(drops.velocities_mps) * FAR_M
        is_sheltered = caster.stops(drops.positions_m, fallen_from)
        return drops.take(~is_sheltered)


def _solid_faces(scene: Scene, t_ns: float) -> RayCaster:
    """A ray caster for the faces of a scene at an instant, without panes, which drops are seen through."""
    faces = triangles(scene, t_ns=t_ns)
    return RayCaster(faces, np.flatnonzero(~are_panes(faces, scene.materials)))


def _may_be_seen(camera: Camera, views: Sequence[View], drops: NearDrops) -> Mask:
    """Whether each drop (N,) is in the picture at the start, in the middle or at the end of the exposure, or between.

    Drops that cross a corner of the picture between these instants are left out.
    """
    first = views[0]
    last = views[-1]
    middle = views[len(views) // 2]
    middle_index = len(middle.start_ns) // 2
    instants = (
        (first.T_world_camera[0], float(first.start_ns[0])),
        (middle.T_world_camera[middle_index], drops.t_ns),
        (last.T_world_camera[-1], float(last.end_ns[-1])),
    )
    low_px = np.full((len(drops), 2), np.inf)
    high_px = np.full((len(drops), 2), -np.inf)
    for T_world_camera, at_ns in instants:
        px = camera.project(_in_camera(T_world_camera, drops, at_ns))
        low_px = np.fmin(low_px, px)
        high_px = np.fmax(high_px, px)
    size_px = np.array([camera.width_px, camera.height_px])
    distances_m = np.linalg.norm(drops.positions_m - middle.T_world_camera[middle_index, :3, 3], axis=1)
    is_near_picture = (high_px > -OUTSIDE_PX).all(1) & (low_px < size_px + OUTSIDE_PX).all(1)
    return np.asarray(is_near_picture & (distances_m > LEAST_DISTANCE_M))


def _in_camera(T_world_camera: Array, drops: NearDrops, t_ns: float) -> Array:
    """The positions (N, 3) of drops in the frame of a camera at an instant."""
    passed_s = (t_ns - drops.t_ns) / NS_PER_S
    positions_m = drops.positions_m + drops.velocities_mps * passed_s
    return se3.apply(se3.inverse(T_world_camera), positions_m)


@dataclass(frozen=True, slots=True)
class _Discs:
    """The images of drops: the diameters (N,) of blurred discs, and the areas (N,) that they cover."""

    diameters_px: Array
    areas_px2: Array


def _draw(cover: Array, camera: Camera, view: View, index: int, drops: NearDrops) -> None:
    """Add the paths of drops during a sub-frame to the cover (H, W)."""
    T_world_camera = view.T_world_camera[index]
    start_ns = float(view.start_ns[index])
    end_ns = float(view.end_ns[index])
    starts_m = _in_camera(T_world_camera, drops, start_ns)
    ends_m = _in_camera(T_world_camera, drops, end_ns)
    starts_px = camera.project(starts_m)
    ends_px = camera.project(ends_m)
    discs = _discs(camera, (starts_m + ends_m) / 2, drops.diameters_m)
    is_drawn: NDArray[np.bool_] = np.isfinite(starts_px + ends_px).all(1) & np.isfinite(discs.diameters_px)
    sub_frame_count = len(view.start_ns)
    draw_streaks(
        cover,
        starts_px[is_drawn],
        ends_px[is_drawn],
        discs.diameters_px[is_drawn],
        discs.areas_px2[is_drawn] / sub_frame_count,
    )


def _discs(camera: Camera, positions_m: Array, diameters_m: Array) -> _Discs:
    """The images of drops at positions (N, 3) in the camera's frame.

    The lens is focused on infinity. So the image of a drop is blurred by a disc that is as large as the image of the
    aperture would be at the distance of the drop; the two discs are replaced by one of the same second moment.
    """
    right, down = tangents(unit(positions_m))
    middle_px = camera.project(positions_m)
    to_right_px = camera.project(positions_m + PROBE_M * right) - middle_px
    to_down_px = camera.project(positions_m + PROBE_M * down) - middle_px
    determinant = to_right_px[:, 0] * to_down_px[:, 1] - to_right_px[:, 1] * to_down_px[:, 0]
    px_per_m = np.sqrt(np.abs(determinant)) / PROBE_M
    blurred_m = np.hypot(diameters_m, APERTURE_M)
    return _Discs(px_per_m * blurred_m, np.pi / 4 * (px_per_m * diameters_m) ** 2)
