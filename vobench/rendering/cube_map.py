"""A cube map whose mipmap levels are prefiltered for reflections in rough surfaces."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from OpenGL import GL

from vobench.geometry.se3 import Array
from vobench.rendering.gl_texture import bind
from vobench.rendering.renderer import Radiance
from vobench.rendering.shader_program import ShaderProgram

CAPABILITIES = (GL.GL_SCISSOR_TEST, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE)


class PrefilteredCubeMap:
    """A cube map of L levels. Level k has six pictures (N, N, 3), pictures[shown[k]], convolved with its GGX lobe.

    The order of the pictures is that of OpenGL, +x first. axes (6, 3, 3) has the right, down and ahead axes of each as
    rows. roughness (L,) is 0 for the first level, which shows the pictures themselves.
    """

    def __init__(
        self,
        pictures: Sequence[Sequence[Radiance]],
        shown: Sequence[int],
        axes: Array,
        roughness: Sequence[float],
    ) -> None:
        size_px = len(pictures[0][0])
        self.id = _cube_map(pictures[shown[0]])
        unfiltered = [_cube_map(six) for six in pictures]
        program = ShaderProgram("fullscreen", "probe")
        framebuffer = GL.glGenFramebuffers(1)
        GL.glBindVertexArray(GL.glGenVertexArrays(1))
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
        for capability in CAPABILITIES:
            GL.glDisable(capability)

        for level in range(1, len(roughness)):
            bind(GL.GL_TEXTURE0, unfiltered[shown[level]], GL.GL_TEXTURE_CUBE_MAP)
            level_px = size_px >> level
            GL.glViewport(0, 0, level_px, level_px)
            for face in range(len(axes)):
                target = GL.GL_TEXTURE_CUBE_MAP_POSITIVE_X + face
                GL.glFramebufferTexture2D(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, target, self.id, level)
                program.use(
                    axes=axes[face].T,
                    roughness=roughness[level],
                    size_px=float(level_px),
                    around_px=float(size_px),
                )
                GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3)

        for capability in CAPABILITIES:
            GL.glEnable(capability)
        GL.glDeleteFramebuffers(1, [framebuffer])
        GL.glDeleteTextures(unfiltered)


def _cube_map(pictures: Sequence[Radiance]) -> Any:
    """The id of a cube map of six pictures, with mipmaps."""
    texture = GL.glGenTextures(1)
    GL.glBindTexture(GL.GL_TEXTURE_CUBE_MAP, texture)
    for face, picture in enumerate(pictures):
        target = GL.GL_TEXTURE_CUBE_MAP_POSITIVE_X + face
        size_px = len(picture)
        texels = np.ascontiguousarray(picture)
        GL.glTexImage2D(target, 0, GL.GL_RGBA32F, size_px, size_px, 0, GL.GL_RGB, GL.GL_FLOAT, texels)
    GL.glGenerateMipmap(GL.GL_TEXTURE_CUBE_MAP)
    GL.glTexParameteri(GL.GL_TEXTURE_CUBE_MAP, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_LINEAR)
    GL.glEnable(GL.GL_TEXTURE_CUBE_MAP_SEAMLESS)
    return texture
