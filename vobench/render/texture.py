"""Textures on the graphics side: floats and 16-bit reflectance, which pyrender's own 8 bits cannot hold.

These classes subclass pyrender's Texture and override its private upload, so that pyrender binds and frees them.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL
from pyrender.texture import Texture

Floats = NDArray[np.float32]


class FloatTexture(Texture):  # type: ignore[misc]
    """A (H, W) float32 map without mipmaps, row 0 at v = 0."""

    def __init__(self, values: Floats) -> None:
        super().__init__(source=None, source_channels="R", width=values.shape[1], height=values.shape[0])
        self._values = values

    def update(self, values: Floats) -> None:
        """Replace the map by another (H, W); the very array that is there already costs nothing."""
        if values is self._values:
            return
        self._values = values
        rows, columns = values.shape
        self._bind()
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        data = np.ascontiguousarray(values, np.float32)
        GL.glTexSubImage2D(GL.GL_TEXTURE_2D, 0, 0, 0, columns, rows, GL.GL_RED, GL.GL_FLOAT, data)

    def _add_to_context(self) -> None:
        self._texid = _texture(GL.GL_R32F, self._values, GL.GL_FLOAT)
        _texture_parameters(GL.GL_LINEAR, GL.GL_CLAMP_TO_EDGE)


class ReflectanceTexture(Texture):  # type: ignore[misc]
    """A (N, N) float32 tile that repeats, with mipmaps; 16 bits of `scale`, linear, row 0 at v = 0."""

    def __init__(self, values: Floats) -> None:
        super().__init__(source=None, source_channels="R", width=values.shape[1], height=values.shape[0])
        self._values = values
        # Under a coat a bright texture may give back more than 1.
        self.scale = max(1.0, float(values.max()))

    def _add_to_context(self) -> None:
        # Eight bits would make steps of 2 % where a surface reflects 20 %.
        counts = np.rint(self._values * (65535 / self.scale)).astype(np.uint16)
        self._texid = _texture(GL.GL_R16, counts, GL.GL_UNSIGNED_SHORT)
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
        _texture_parameters(GL.GL_LINEAR_MIPMAP_NEAREST, GL.GL_REPEAT)


def _texture(internal: int, values: NDArray[Any], kind: int) -> Any:
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
