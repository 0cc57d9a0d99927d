"""What every renderer promises, whatever draws the picture."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array

Radiance = NDArray[np.float32]
Depth = NDArray[np.float32]


class Renderer(Protocol):
    """Pictures of one scene."""

    def radiance(self, camera: Pinhole, T_world_camera: Array) -> Radiance:
        """Luminance (H, W) in cd/m², linear and unclipped, averaged over each pixel's area."""

    def depth(self, camera: Pinhole, T_world_camera: Array) -> Depth:
        """Depth (H, W) in metres along the optical axis at each pixel's centre; NaN where nothing is."""

    def close(self) -> None:
        """Give back what the renderer holds."""
