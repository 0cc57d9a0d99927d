"""Where pyrender's drawing lands: a supersampled float framebuffer, averaged and read back as light.

This module subclasses pyrender's Renderer and Texture and overrides their private hooks, because
pyrender 0.1.45 offers no public way to choose a framebuffer's format or a texture's.
"""

from typing import Any

import numpy as np

if not hasattr(np, "infty"):
    setattr(np, "infty", np.inf)  # noqa: B010 - pyrender 0.1.45 still says infty, numpy 2 has none

from OpenGL import GL
from pyrender import RenderFlags
from pyrender.renderer import Renderer
from pyrender.shader_program import ShaderProgramCache
from pyrender.texture import Texture

from vobench.render.renderer import Radiance

FLAGS = RenderFlags.FLAT | RenderFlags.OFFSCREEN


class FloatTexture(Texture):  # type: ignore[misc]
    """A (H, W) float32 map without mipmaps, row 0 at v = 0."""

    def __init__(self, values: Radiance) -> None:
        super().__init__(source=None, source_channels="R", width=values.shape[1], height=values.shape[0])
        self._values = values

    def _add_to_context(self) -> None:
        self._texid = _texture(GL.GL_R32F, self._values, GL.GL_FLOAT)
        _texture_parameters(GL.GL_LINEAR, GL.GL_CLAMP_TO_EDGE)


class ReflectanceTexture(Texture):  # type: ignore[misc]
    """A (N, N) float32 tile in [0, 1] that repeats, with mipmaps; 16 bits, linear, row 0 at v = 0."""

    def __init__(self, values: Radiance) -> None:
        super().__init__(source=None, source_channels="R", width=values.shape[1], height=values.shape[0])
        self._values = values

    def _add_to_context(self) -> None:
        # Eight bits would make steps of 2 % where a surface reflects 20 %.
        counts = np.rint(self._values * 65535).astype(np.uint16)
        self._texid = _texture(GL.GL_R16, counts, GL.GL_UNSIGNED_SHORT)
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
        _texture_parameters(GL.GL_LINEAR_MIPMAP_LINEAR, GL.GL_REPEAT)


def _texture(internal: int, values: np.ndarray[Any, Any], kind: int) -> Any:
    texture = GL.glGenTextures(1)
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    rows, columns = values.shape
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal, columns, rows, 0, GL.GL_RED, kind, np.ascontiguousarray(values))
    return texture


def _texture_parameters(minify: int, wrap: int) -> None:
    for key, value in (
        (GL.GL_TEXTURE_MIN_FILTER, minify),
        (GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR),
        (GL.GL_TEXTURE_WRAP_S, wrap),
        (GL.GL_TEXTURE_WRAP_T, wrap),
    ):
        GL.glTexParameteri(GL.GL_TEXTURE_2D, key, value)


class LinearRenderer(Renderer):  # type: ignore[misc]
    """pyrender's draw loop into a one-channel float framebuffer, several samples a pixel."""

    def __init__(self, shader_dir: str, *, supersampling: int) -> None:
        super().__init__(1, 1)
        self._program_cache = ShaderProgramCache(shader_dir=shader_dir)
        self._supersampling = supersampling
        self._main_fb_dims: tuple[int | None, int | None] = (None, None)

    def picture(self, scene: Any, *, width: int, height: int) -> Radiance:
        """Draw the scene; (height, width) float32, top row first."""
        self.viewport_width, self.viewport_height = width * self._supersampling, height * self._supersampling
        picture: Radiance = self.render(scene, FLAGS)
        return picture

    def _configure_main_framebuffer(self) -> None:
        size = (self.viewport_width, self.viewport_height)
        if self._main_fb_dims == size:
            return
        self._delete_main_framebuffer()
        small = (size[0] // self._supersampling, size[1] // self._supersampling)
        self._main_fb_ms, self._main_cb_ms, self._main_db_ms = _framebuffer(*size)
        self._main_fb, self._main_cb, self._main_db = _framebuffer(*small)
        self._main_fb_dims = size

    def _read_main_framebuffer(self, scene: Any, flags: int) -> Radiance:
        del scene, flags
        width, height = self.viewport_width, self.viewport_height
        small = (width // self._supersampling, height // self._supersampling)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb_ms)
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._main_fb)
        # Halving with linear filtering reads amid each four samples: their exact mean.
        GL.glBlitFramebuffer(0, 0, width, height, 0, 0, *small, GL.GL_COLOR_BUFFER_BIT, GL.GL_LINEAR)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        buffer = GL.glReadPixels(0, 0, *small, GL.GL_RED, GL.GL_FLOAT)
        # OpenGL's first row is the lowest; a copy, as OpenCV takes no array that runs backwards.
        return np.ascontiguousarray(np.frombuffer(buffer, np.float32).reshape(small[1], small[0])[::-1])


def _framebuffer(width: int, height: int) -> tuple[Any, Any, Any]:
    """A framebuffer of one float channel with depth: its name and those of its two buffers."""
    colour, depth = GL.glGenRenderbuffers(2)
    framebuffer = GL.glGenFramebuffers(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    for buffer, form, attachment in (
        (colour, GL.GL_R32F, GL.GL_COLOR_ATTACHMENT0),
        (depth, GL.GL_DEPTH_COMPONENT24, GL.GL_DEPTH_ATTACHMENT),
    ):
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
        GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, form, width, height)
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, attachment, GL.GL_RENDERBUFFER, buffer)
    return framebuffer, colour, depth
