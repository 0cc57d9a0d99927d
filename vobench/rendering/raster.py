"""The raster engine: an OpenGL context without a display, and pictures drawn in it.

Stock pyrender multisamples (its depth and colour then sit off the pixel's centre), clips to 8 bits and knows no
mirrors. Here each pixel is the mean of four samples of linear light, read back as float.
"""

import ctypes.util
import re
import sys
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

from vobench.errors import MissingDependencyError
from vobench.geometry.camera import Camera
from vobench.rendering.bake import BakedScene
from vobench.rendering.renderer import Radiance, View
from vobench.scene.material import LUMINANCE, Rgb

EGL_PACKAGES = ("libegl1", "libgl1", "libopengl0", "libgl1-mesa-dri")
EGL_REMEDY = f"apt-get update && apt-get install -y {' '.join(EGL_PACKAGES)}"


def missing_libraries() -> list[str]:
    """Names of the system libraries that drawing needs and this machine lacks."""
    return [name for name in ("EGL", "GL", "OpenGL") if ctypes.util.find_library(name) is None]


def context() -> Any:
    """A current OpenGL context of pyrender's EGL platform.

    Raises MissingDependencyError where the machine has no EGL or no driver for it, or PyOpenGL is too old.
    """
    _check_opengl()
    try:
        from pyrender.platforms.egl import EGLPlatform

        class Platform(EGLPlatform):  # type: ignore[misc]
            """One that, forgotten, does not end the display that all contexts of a process share."""

            def __del__(self) -> None:
                """Nothing: see `release`."""

        # The size matters to windows only; we draw into framebuffers of our own.
        platform = Platform(1, 1)
        platform.init_context()
        platform.make_current()
    except Exception as error:  # PyOpenGL fails with whatever it trips over first
        raise MissingDependencyError(f"cannot draw without a display ({_cause(error)}); run: {EGL_REMEDY}") from error
    return platform


def require_drawing() -> None:
    """Raise MissingDependencyError where no picture could be drawn."""
    release(context())


def release(platform: Any) -> None:
    """Free the context that `context` made.

    pyrender's own `delete_context` ends the display too, which all contexts of a process share.
    """
    from OpenGL import EGL

    display, context = platform._egl_display, platform._egl_context
    EGL.eglMakeCurrent(display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, EGL.EGL_NO_CONTEXT)
    EGL.eglDestroyContext(display, context)


def _check_opengl() -> None:
    """Pip, unlike uv in this repository, obeys pyrender's pin of PyOpenGL 3.1.0, which Python 3.12 breaks."""
    found = version("PyOpenGL")
    if sys.version_info >= (3, 12) and [int(n) for n in re.findall(r"\d+", found)[:3]] < [3, 1, 10]:
        remedy = f"{sys.executable} -m pip install 'PyOpenGL>=3.1.10'"
        raise MissingDependencyError(f"cannot draw with PyOpenGL {found} on Python 3.12 or later; run: {remedy}")


def _cause(error: Exception) -> str:
    missing = missing_libraries()
    if missing:
        return f"missing lib{', lib'.join(missing)}"
    return f"EGL says {type(error).__name__}: {' '.join(str(error).split())}"


class RasterRenderer:
    """Pictures of a baked scene by OpenGL. One per process is enough."""

    def __init__(self, baked: BakedScene) -> None:
        self._platform = context()
        # Imported late: it needs the context's library to be loadable.
        from vobench.rendering.frame import FrameRenderer

        self._frames = FrameRenderer(baked)

    def radiance(self, camera: Camera, views: Sequence[View], *, weights: Rgb | None = LUMINANCE) -> Radiance:
        """Luminance (H, W) in cd/m² of weighted channels, or (H, W, 3) without weights; see `Renderer`."""
        self._platform.make_current()
        return self._frames.picture(camera, views, weights)

    def close(self) -> None:
        """Free the OpenGL context and all in it."""
        release(self._platform)
