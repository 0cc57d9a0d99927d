"""The raster engine: pictures of a baked scene, drawn by OpenGL without a display.

Stock pyrender multisamples (its depth and colour then sit off the pixel's centre), clips to 8 bits and knows no
mirrors. Here each pixel is the mean of four or sixteen samples of linear light, read back as float.
"""

from collections.abc import Sequence

from vobench.geometry.camera import Camera
from vobench.rendering.baked_scene import BakedScene
from vobench.rendering.context import DriverFacts, create_context, driver_facts
from vobench.rendering.renderer import Radiance, View
from vobench.scene.material import LUMINANCE, Rgb

USUAL_SAMPLES = 4

__all__ = ["DriverFacts", "RasterRenderer", "driver_facts", "require_drawing"]


def require_drawing() -> None:
    """Raise MissingDependencyError where no picture could be drawn."""
    create_context().release()


class RasterRenderer:
    """Pictures of a baked scene by OpenGL, with 4 or 16 samples of each pixel. One per process is enough."""

    def __init__(self, baked: BakedScene, *, samples: int = USUAL_SAMPLES) -> None:
        self._context = create_context()
        # Imported here: it loads OpenGL, whose absence `create_context` reports in one line.
        from vobench.rendering.frame import FrameRenderer

        self._frames = FrameRenderer(baked, samples=samples)

    def radiance(
        self,
        camera: Camera,
        views: Sequence[View],
        *,
        weights: Rgb | None = LUMINANCE,
    ) -> Radiance:
        """Luminance (H, W) in cd/m² of weighted channels, or (H, W, 3) without weights; see `Renderer`."""
        self._context.make_current()
        return self._frames.picture(camera, views, weights)

    def close(self) -> None:
        """Free the OpenGL context and all in it."""
        self._context.release()
