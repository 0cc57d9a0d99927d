"""Where drawing lands: layers of float samples, their mean summed over sub-frames, and the way back to numpy.

Each layer of a `Canvas` is the whole picture with one sample a pixel, and each layer's viewport is shifted by a part
of a pixel: supersampling on any grid, a strip of rows is one scissor box, and a mirror's picture has the same samples.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from OpenGL import GL

from vobench.errors import RenderError
from vobench.render.mirror import Box
from vobench.render.renderer import Radiance


@dataclass(frozen=True, slots=True)
class Grid:
    """Where in a pixel samples lie, one a layer, and how many mipmap levels finer than OpenGL would each looks."""

    points: tuple[tuple[float, float], ...]
    lod_bias: tuple[float, ...]


# Four rows and four columns: an edge along either is placed to an eighth of a pixel.
# Each sample looks at the one nearest mipmap level: by different choices, levels blend from one into the next.
TURNED = Grid(((0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)), (-2.875, -2.375, -2.625, -2.125))
# The same in two halves, each even about the centre, for sub-frames by turns.
HALVES = tuple(
    Grid((TURNED.points[a], TURNED.points[b]), (TURNED.lod_bias[a], TURNED.lod_bias[b])) for a, b in ((0, 3), (1, 2))
)
# For pictures of twice as many pixels each way.
CENTRE = Grid(((0.5, 0.5),), (-1.5,))


@dataclass(frozen=True, slots=True)
class Canvas:
    """A framebuffer with one layer a sample: one float channel and depth, as textures."""

    width_px: int
    height_px: int
    grid: Grid
    framebuffer: Any
    colour: Any
    depth: Any

    @property
    def layers(self) -> int:
        """How many samples a pixel has."""
        return len(self.grid.points)

    def begin(self, box: Box) -> None:
        """Draw here from now on, within a box of the picture."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self.framebuffer)
        for index, (x, y) in enumerate(self.grid.points):
            GL.glViewportIndexedf(index, 0.5 - x, 0.5 - y, self.width_px, self.height_px)
        u0, u1, v0, v1 = box
        GL.glScissor(u0, self.height_px - v1, u1 - u0, v1 - v0)

    def clear(self, box: Box) -> None:
        """Black and nothing near, within a box, in which to draw from now on."""
        self.begin(box)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)

    def delete(self) -> None:
        """Free it on the graphics side."""
        GL.glDeleteFramebuffers(1, [self.framebuffer])
        GL.glDeleteTextures([self.colour, self.depth])


def canvas(width_px: int, height_px: int, grid: Grid) -> Canvas:
    """A canvas of some size. Raises RenderError where the driver has no room or form for it."""
    framebuffer = GL.glGenFramebuffers(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    names = []
    for attachment, internal, form in (
        (GL.GL_COLOR_ATTACHMENT0, GL.GL_R32F, GL.GL_RED),
        (GL.GL_DEPTH_ATTACHMENT, GL.GL_DEPTH_COMPONENT32F, GL.GL_DEPTH_COMPONENT),
    ):
        names.append(GL.glGenTextures(1))
        GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, names[-1])
        size = (width_px, height_px, len(grid.points))
        GL.glTexImage3D(GL.GL_TEXTURE_2D_ARRAY, 0, internal, *size, 0, form, GL.GL_FLOAT, None)
        for filtering in (GL.GL_TEXTURE_MIN_FILTER, GL.GL_TEXTURE_MAG_FILTER):
            GL.glTexParameteri(GL.GL_TEXTURE_2D_ARRAY, filtering, GL.GL_NEAREST)
        GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, attachment, names[-1], 0)
    _require_complete(width_px, height_px)
    return Canvas(width_px, height_px, grid, framebuffer, *names)


@dataclass(frozen=True, slots=True)
class Sum:
    """A picture of one float channel to which means of canvases are added."""

    width_px: int
    height_px: int
    framebuffer: Any
    colour: Any

    def begin(self, box: Box) -> None:
        """Draw here from now on, within a box of the picture."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self.framebuffer)
        GL.glViewport(0, 0, self.width_px, self.height_px)
        u0, u1, v0, v1 = box
        GL.glScissor(u0, self.height_px - v1, u1 - u0, v1 - v0)

    def clear(self, box: Box, value: float = 0.0) -> None:
        """One value all over a box."""
        self.begin(box)
        GL.glClearBufferfv(GL.GL_COLOR, 0, [value, 0.0, 0.0, 0.0])

    def read(self, box: Box) -> Radiance:
        """A box of the picture (rows, columns) float32, top row first; an array of its own."""
        u0, u1, v0, v1 = box
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self.framebuffer)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        buffer = GL.glReadPixels(u0, self.height_px - v1, u1 - u0, v1 - v0, GL.GL_RED, GL.GL_FLOAT)
        # OpenGL's first row is the lowest; a copy, as OpenCV takes no array that runs backwards.
        return np.ascontiguousarray(np.frombuffer(buffer, np.float32).reshape(v1 - v0, u1 - u0)[::-1])

    def delete(self) -> None:
        """Free it on the graphics side."""
        GL.glDeleteFramebuffers(1, [self.framebuffer])
        GL.glDeleteTextures([self.colour])


def summed(width_px: int, height_px: int) -> Sum:
    """A sum of some size. Raises RenderError where the driver has no room or form for it."""
    return Sum(width_px, height_px, *flat(width_px, height_px, GL.GL_R32F, GL.GL_RED))


def flat(width_px: int, height_px: int, internal: Any, form: Any) -> tuple[Any, Any]:
    """A framebuffer of float channels without depth, and its texture."""
    framebuffer, colour = GL.glGenFramebuffers(1), GL.glGenTextures(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    GL.glBindTexture(GL.GL_TEXTURE_2D, colour)
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal, width_px, height_px, 0, form, GL.GL_FLOAT, None)
    for filtering in (GL.GL_TEXTURE_MIN_FILTER, GL.GL_TEXTURE_MAG_FILTER):
        GL.glTexParameteri(GL.GL_TEXTURE_2D, filtering, GL.GL_NEAREST)
    GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, colour, 0)
    _require_complete(width_px, height_px)
    return framebuffer, colour


def _require_complete(width_px: int, height_px: int) -> None:
    status = GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER)
    if status != GL.GL_FRAMEBUFFER_COMPLETE:
        raise RenderError(f"OpenGL has no float framebuffer of {width_px} x {height_px} pixels (status {status:#x})")
