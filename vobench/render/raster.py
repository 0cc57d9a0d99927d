"""The raster engine: pyrender's scene graph and EGL context, with our shaders, framebuffers and draw loop.

Stock pyrender multisamples (its depth and colour then sit off the pixel's centre), clips to 8 bits and knows no
mirrors. Here each pixel is the mean of four samples of linear light, read back as float.
"""

from collections.abc import Sequence

from vobench.geometry.camera import Camera
from vobench.render import egl
from vobench.render.bake import BakedScene
from vobench.render.renderer import Radiance, View


class RasterRenderer:
    """Pictures of a baked scene by OpenGL. One per process is enough."""

    def __init__(self, baked: BakedScene) -> None:
        self._platform = egl.context()
        # Imported late: they need the context's library to be loadable.
        from vobench.render.frame import FrameRenderer

        self._studio = FrameRenderer(baked)

    def radiance(self, camera: Camera, views: Sequence[View]) -> Radiance:
        """Luminance (H, W) in cd/m², linear and unclipped, averaged over each pixel's area; views tile the rows."""
        self._platform.make_current()
        return self._studio.picture(camera, views)

    def close(self) -> None:
        """Free the OpenGL context and all in it."""
        self._platform.make_current()
        self._studio.delete()
        egl.release(self._platform)
