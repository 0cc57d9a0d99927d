"""What rough mirrors show: the picture of a smooth one, spread by as much as its facets scatter."""

from dataclasses import dataclass
from typing import Any

from OpenGL import GL

from vobench.render.framebuffer import Canvas, Sum, flat, summed
from vobench.render.look import FAR_M, NEAR_M
from vobench.render.program import Program

MIRRORED_UNIT, DEPTH_UNIT, HAZE_UNIT = GL.GL_TEXTURE2, GL.GL_TEXTURE3, GL.GL_TEXTURE3
NONE = -1.0


@dataclass(frozen=True, slots=True)
class Haze:
    """The mirrored picture as luminance, 1 / depth and presence, with mipmaps; and its spread by a rough mirror."""

    smooth_framebuffer: Any
    smooth: Any
    spread: Sum

    def settle(self, reflections: Canvas, program: Program) -> None:
        """What is drawn from now on with the program is the smooth picture of a mirror."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self.smooth_framebuffer)
        GL.glViewport(0, 0, self.spread.width_px, self.spread.height_px)
        GL.glScissor(0, 0, self.spread.width_px, self.spread.height_px)
        GL.glClearBufferfv(GL.GL_COLOR, 0, [0.0, 0.0, 0.0, 0.0])
        for unit, texture in ((MIRRORED_UNIT, reflections.colour), (DEPTH_UNIT, reflections.depth)):
            GL.glActiveTexture(unit)
            GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, texture)
        program.use()
        program.count("count", reflections.layers)
        program.number("near_m", NEAR_M)
        program.number("far_m", FAR_M)

    def finish(self) -> None:
        """What is drawn from now on is the spread."""
        self.spread.clear((0, self.spread.width_px, 0, self.spread.height_px), NONE)
        GL.glActiveTexture(MIRRORED_UNIT)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.smooth)
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)

    def bind(self) -> None:
        """Let surfaces look the spread up."""
        GL.glActiveTexture(HAZE_UNIT)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.spread.colour)

    def delete(self) -> None:
        """Free it on the graphics side."""
        GL.glDeleteFramebuffers(1, [self.smooth_framebuffer])
        GL.glDeleteTextures([self.smooth])
        self.spread.delete()


def haze(width_px: int, height_px: int) -> Haze:
    """Paper for the mirrors of pictures of some size."""
    framebuffer, smooth = flat(width_px, height_px, GL.GL_RGBA32F, GL.GL_RGBA)
    for key, value in (
        (GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_LINEAR),
        (GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR),
        (GL.GL_TEXTURE_WRAP_S, GL.GL_CLAMP_TO_EDGE),
        (GL.GL_TEXTURE_WRAP_T, GL.GL_CLAMP_TO_EDGE),
    ):
        GL.glTexParameteri(GL.GL_TEXTURE_2D, key, value)
    return Haze(framebuffer, smooth, summed(width_px, height_px))
