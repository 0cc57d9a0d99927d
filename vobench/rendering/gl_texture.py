"""OpenGL textures: the light map, the surfaces of materials, and panoramas."""

import ctypes
from collections.abc import Iterable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from vobench.scene.material import linear
from vobench.scene.panorama import PanoramaMap

Float32s = NDArray[np.float32]

# The linear value of each sRGB value, as 16 bits. With 8 bits, steps are 2 % where a surface reflects 20 %; and drivers
# that convert sRGB themselves err by up to 1 %.
LINEAR_16_BITS = np.rint(65535 * linear(np.arange(256, dtype=np.uint8))).astype(np.uint16)

# The internal format and the pixel format by the number of channels.
COLOUR_FORMATS = {
    1: (GL.GL_R16, GL.GL_RED),
    3: (GL.GL_RGBA16, GL.GL_RGB),
    4: (GL.GL_RGBA16, GL.GL_RGBA),
}


class LightTexture:
    """A texture of linear float32 values without mipmaps, for the light map. Row 0 is at v = 0.

    values: (H, W, 3) in colour, or (H, W) in grey. Colours with three equal channels are stored as one channel.
    """

    def __init__(self, values: Float32s) -> None:
        self._values: Float32s | None = None
        self.id = GL.glGenTextures(1)
        self.update(values)

    def update(self, values: Float32s) -> None:
        """Upload other values. Nothing is uploaded if they are the same array as before."""
        if values is self._values:
            return
        self._values = values
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        is_grey = values.ndim == 2 or bool((values[..., :1] == values[..., 1:]).all())
        if is_grey:
            channel = values if values.ndim == 2 else values[..., 0]
            _upload(GL.GL_R32F, GL.GL_RED, channel, GL.GL_FLOAT)
        else:
            _upload(GL.GL_RGBA32F, GL.GL_RGB, values, GL.GL_FLOAT)
        _set_swizzle(is_grey)
        _set_sampling(GL.GL_LINEAR, GL.GL_LINEAR, GL.GL_CLAMP_TO_EDGE)


class TiledLightTexture:
    """A texture of linear float32 colours (height, width, 3) without mipmaps, of which parts can be replaced."""

    def __init__(self, width: int, height: int) -> None:
        self.id = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, GL.GL_RGBA32F, width, height, 0, GL.GL_RGB, GL.GL_FLOAT, None)
        _set_sampling(GL.GL_LINEAR, GL.GL_LINEAR, GL.GL_CLAMP_TO_EDGE)

    def replace(self, values: Float32s, parts: Iterable[tuple[slice, slice]]) -> None:
        """Upload the given rows and columns of a map (height, width, 3), a contiguous array."""
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        GL.glPixelStorei(GL.GL_UNPACK_ROW_LENGTH, values.shape[1])
        for rows, columns in parts:
            part = values[rows, columns]
            height, width = part.shape[:2]
            first_value = ctypes.c_void_p(part.ctypes.data)
            place = (columns.start, rows.start, width, height)
            GL.glTexSubImage2D(GL.GL_TEXTURE_2D, 0, *place, GL.GL_RGB, GL.GL_FLOAT, first_value)
        GL.glPixelStorei(GL.GL_UNPACK_ROW_LENGTH, 0)


class SurfaceTexture:
    """A repeating texture with mipmaps: linear values in 16 bits. Row 0 is at v = 0.

    values: (H, W) float32, or (H, W, 3 or 4) uint8 in sRGB. halvings: how often the width and height are halved.
    The attribute `scale` is the value of a texel that is stored as 1.
    """

    def __init__(
        self,
        values: NDArray[Any],
        *,
        halvings: int = 0,
    ) -> None:
        self.scale = 1.0
        self.is_grey = values.ndim == 2
        self.id = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        if self.is_grey:
            self.scale = max(1.0, float(values.max()))
            texels = np.rint(values * (65535 / self.scale)).astype(np.uint16)
            channels = 1
        else:
            texels = LINEAR_16_BITS[values]
            texels[..., 3:] = np.uint16(257) * values[..., 3:]  # opacity is linear already
            channels = values.shape[2]
        internal_format, pixel_format = COLOUR_FORMATS[channels]
        _upload(internal_format, pixel_format, _reduced(texels, halvings), GL.GL_UNSIGNED_SHORT)
        _set_swizzle(self.is_grey)
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
        _set_sampling(GL.GL_LINEAR_MIPMAP_NEAREST, GL.GL_LINEAR, GL.GL_REPEAT)


class PanoramaTexture:
    """An equirectangular texture with mipmaps: daylight in RGB, the luminance of lamps in the alpha channel."""

    def __init__(self, panorama: PanoramaMap) -> None:
        lamps = panorama.lamps[..., None]
        texels = np.concatenate([panorama.daylight, lamps], axis=2)
        self.id = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        _upload(GL.GL_RGBA16F, GL.GL_RGBA, texels, GL.GL_HALF_FLOAT)
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
        _set_sampling(GL.GL_LINEAR_MIPMAP_LINEAR, GL.GL_LINEAR, GL.GL_REPEAT)
        GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_WRAP_T, GL.GL_CLAMP_TO_EDGE)


def bind(
    unit: int,
    texture: Any,
    target: int = GL.GL_TEXTURE_2D,
) -> None:
    """Bind a texture to a texture unit, from which shaders sample it."""
    GL.glActiveTexture(unit)
    GL.glBindTexture(target, texture)


def _reduced(
    texels: NDArray[np.uint16],
    halvings: int,
) -> NDArray[np.uint16]:
    """Texels (H, W) or (H, W, C) after their width and height have been halved a number of times."""
    if not halvings:
        return texels
    width = max(1, texels.shape[1] >> halvings)
    height = max(1, texels.shape[0] >> halvings)
    return np.asarray(cv2.resize(texels, [width, height], interpolation=cv2.INTER_AREA))


def _upload(
    internal_format: int,
    pixel_format: int,
    texels: NDArray[Any],
    pixel_type: int,
) -> None:
    """Upload texels (H, W) or (H, W, C) to the bound 2-D texture."""
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    height, width = texels.shape[:2]
    contiguous = np.ascontiguousarray(texels)
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal_format, width, height, 0, pixel_format, pixel_type, contiguous)


def _set_swizzle(is_grey: bool) -> None:
    """Make shaders read the bound texture as RGBA: the single channel as all three colours if it is grey."""
    if is_grey:
        swizzle = [GL.GL_RED, GL.GL_RED, GL.GL_RED, GL.GL_ONE]
    else:
        swizzle = [GL.GL_RED, GL.GL_GREEN, GL.GL_BLUE, GL.GL_ALPHA]
    GL.glTexParameteriv(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_SWIZZLE_RGBA, np.array(swizzle, np.int32))


def _set_sampling(minification: int, magnification: int, wrap: int) -> None:
    """Set the filters of the bound 2-D texture, and how it continues beyond its edges."""
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MIN_FILTER, minification)
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MAG_FILTER, magnification)
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_WRAP_S, wrap)
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_WRAP_T, wrap)
