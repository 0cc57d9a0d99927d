"""OpenGL framebuffers that pictures are drawn into, with textures of floats as attachments."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from OpenGL import GL

from vobench.errors import RenderError
from vobench.rendering.renderer import Radiance
from vobench.rendering.sample_pattern import SamplePattern
from vobench.rendering.view import Box

# The internal format and the pixel format by the number of channels. Drivers need not support drawing into three
# channels, so colours have a fourth.
COLOUR_FORMATS = {
    1: (GL.GL_R32F, GL.GL_RED),
    3: (GL.GL_RGBA32F, GL.GL_RGBA),
}


@dataclass(frozen=True, slots=True)
class LayeredFramebuffer:
    """A framebuffer with one layer for each sample of a pixel, and with depth.

    channels: 1 for grey, 3 for colours. pattern: the positions of the samples.
    id, colour_texture and depth_texture are names of OpenGL objects.
    """

    width_px: int
    height_px: int
    channels: int
    pattern: SamplePattern
    id: Any
    colour_texture: Any
    depth_texture: Any

    @property
    def is_mono(self) -> bool:
        """Whether it has one channel."""
        return self.channels == 1

    @property
    def layers(self) -> int:
        """The number of samples of a pixel."""
        return len(self.pattern.positions)

    def bind(self, box: Box) -> None:
        """Make all following draw calls draw here, inside a box of the picture."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self.id)
        for layer, (x, y) in enumerate(self.pattern.positions):
            GL.glViewportIndexedf(layer, 0.5 - x, 0.5 - y, self.width_px, self.height_px)
        _set_scissor(box, self.height_px)

    def clear(self, box: Box) -> None:
        """Bind it, and clear a box to black at an infinite distance."""
        self.bind(box)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)

    def reversed_depth(self) -> Radiance:
        """The depth buffer (H, W) of the first sample of each pixel, top row first; 0 at infinity, see `view`."""
        GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, self.depth_texture)
        buffer = GL.glGetTexImage(GL.GL_TEXTURE_2D_ARRAY, 0, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT)
        layers = np.frombuffer(buffer, np.float32).reshape(self.layers, self.height_px, self.width_px)
        return layers[0, ::-1]


def layered_framebuffer(
    width_px: int,
    height_px: int,
    pattern: SamplePattern,
    channels: int,
) -> LayeredFramebuffer:
    """Create a framebuffer with a layer for each sample. Raises RenderError if the driver does not support it."""
    framebuffer = GL.glGenFramebuffers(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    size = (width_px, height_px, len(pattern.positions))
    internal_format, pixel_format = COLOUR_FORMATS[channels]
    colour_texture = _texture_array(size, internal_format, pixel_format)
    GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, colour_texture, 0)
    depth_texture = _texture_array(size, GL.GL_DEPTH_COMPONENT32F, GL.GL_DEPTH_COMPONENT)
    GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, depth_texture, 0)
    _require_complete(width_px, height_px)
    return LayeredFramebuffer(width_px, height_px, channels, pattern, framebuffer, colour_texture, depth_texture)


def _texture_array(
    size: tuple[int, int, int],
    internal_format: int,
    pixel_format: int,
) -> Any:
    """The id of an empty texture array; its size is the width and height in pixels and the number of layers."""
    texture = GL.glGenTextures(1)
    GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, texture)
    GL.glTexImage3D(GL.GL_TEXTURE_2D_ARRAY, 0, internal_format, *size, 0, pixel_format, GL.GL_FLOAT, None)
    GL.glTexParameteri(GL.GL_TEXTURE_2D_ARRAY, GL.GL_TEXTURE_MIN_FILTER, GL.GL_NEAREST)
    GL.glTexParameteri(GL.GL_TEXTURE_2D_ARRAY, GL.GL_TEXTURE_MAG_FILTER, GL.GL_NEAREST)
    return texture


@dataclass(frozen=True, slots=True)
class Framebuffer:
    """A framebuffer with one sample per pixel and without depth, whose pixels can be read.

    channels: 1 for grey, 3 for colours. id: the name of the OpenGL object.
    """

    width_px: int
    height_px: int
    channels: int
    id: Any

    @property
    def whole(self) -> Box:
        """The box of the whole picture."""
        return 0, self.width_px, 0, self.height_px

    def bind(self, box: Box) -> None:
        """Make all following draw calls draw here, inside a box of the picture."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self.id)
        GL.glViewport(0, 0, self.width_px, self.height_px)
        _set_scissor(box, self.height_px)

    def clear(self, box: Box) -> None:
        """Bind it, and clear a box to black."""
        self.bind(box)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT)

    def read(self, box: Box) -> Radiance:
        """A new array with a box of the picture, (rows, columns) or (rows, columns, 3) float32, top row first."""
        u0, u1, v0, v1 = box
        width = u1 - u0
        height = v1 - v0
        _, pixel_format = COLOUR_FORMATS[self.channels]
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self.id)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        buffer = GL.glReadPixels(u0, self.height_px - v1, width, height, pixel_format, GL.GL_FLOAT)
        pixels = np.frombuffer(buffer, np.float32).reshape(height, width, -1)
        colours = cv2.cvtColor(pixels, cv2.COLOR_RGBA2RGB) if self.channels == 3 else pixels
        # The first row of OpenGL is the lowest.
        return np.asarray(cv2.flip(colours, 0), np.float32)


def framebuffer(width_px: int, height_px: int, channels: int) -> Framebuffer:
    """Create a framebuffer with one sample per pixel. Raises RenderError if the driver does not support it."""
    internal_format, pixel_format = COLOUR_FORMATS[channels]
    framebuffer_id = GL.glGenFramebuffers(1)
    texture = GL.glGenTextures(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer_id)
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal_format, width_px, height_px, 0, pixel_format, GL.GL_FLOAT, None)
    GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, texture, 0)
    _require_complete(width_px, height_px)
    return Framebuffer(width_px, height_px, channels, framebuffer_id)


def _set_scissor(box: Box, height_px: int) -> None:
    """Restrict drawing to a box, whose rows count from the top."""
    u0, u1, v0, v1 = box
    GL.glScissor(u0, height_px - v1, u1 - u0, v1 - v0)


def _require_complete(width_px: int, height_px: int) -> None:
    """Raise RenderError if the bound framebuffer is not complete."""
    status = GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER)
    if status != GL.GL_FRAMEBUFFER_COMPLETE:
        raise RenderError(f"OpenGL has no float framebuffer of {width_px} x {height_px} pixels (status {status:#x})")
