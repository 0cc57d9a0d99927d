"""The protocol of renderers, and the views that they draw."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.scene.material import LUMINANCE, Rgb

Radiance = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class View:
    """Rows of a picture that are exposed together, and how: the mean of M equally long sub-frames.

    Sub-frame m lasts from start_ns[m] to end_ns[m] (M,) int64; lights count with their mean over it,
    the camera and movers are where they are at its middle: T_world_camera (M, 4, 4).
    """

    rows: slice
    T_world_camera: Array
    start_ns: NDArray[np.int64]
    end_ns: NDArray[np.int64]


def single_instant(
    camera: Camera,
    T_world_camera: Array,
    *,
    t_ns: int = 0,
) -> tuple[View]:
    """The whole picture at one instant."""
    instant = np.array([t_ns], np.int64)
    return (View(slice(0, camera.height_px), T_world_camera[None], instant, instant),)


class Renderer(Protocol):
    """Pictures of one scene."""

    def radiance(
        self,
        camera: Camera,
        views: Sequence[View],
        *,
        weights: Rgb | None = LUMINANCE,
    ) -> Radiance:
        """Linear, unclipped and averaged over each pixel's area; views tile the rows.

        (H, W): the sum of red, green and blue times the weights, with those of luminance in cd/m². (H, W, 3) without
        weights: the three themselves, each as bright as a white of that luminance.
        """

    def close(self) -> None:
        """Free the renderer's resources."""
