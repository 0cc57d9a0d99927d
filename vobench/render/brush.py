"""Single strokes: one batch, the background, or the mean of a canvas, onto whatever framebuffer is bound."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from OpenGL import GL

from vobench.render.framebuffer import Canvas
from vobench.render.look import Look
from vobench.render.mesh import Batch
from vobench.render.program import PASS_BINDING, Program, Programs
from vobench.render.texture import FloatTexture
from vobench.scene.material import Glass, Mirror, Polished

PASS_FLOATS = 56
BODY_UNIT, LIGHT_UNIT, LAYERS_UNIT = GL.GL_TEXTURE0, GL.GL_TEXTURE1, GL.GL_TEXTURE2


class Brush:
    """Holds programs and what they share, as long as its context is current."""

    def __init__(self, light: FloatTexture) -> None:
        self.programs, self._light = Programs(), light
        self._block = GL.glGenBuffers(1)
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._block)
        GL.glBufferData(GL.GL_UNIFORM_BUFFER, 4 * PASS_FLOATS, None, GL.GL_DYNAMIC_DRAW)
        GL.glBindBufferBase(GL.GL_UNIFORM_BUFFER, PASS_BINDING, self._block)
        self._vertices = GL.glGenVertexArrays(1)
        for ability in (GL.GL_SCISSOR_TEST, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
            GL.glEnable(ability)
        GL.glDepthFunc(GL.GL_LEQUAL)

    def begin(self, look: Look, canvas: Canvas) -> None:
        """Set what all strokes of one look share."""
        shared = np.zeros(PASS_FLOATS, np.float32)
        shared[:16] = look.view_projection.T.ravel()
        shared[16:19], shared[19] = look.eye_m, look.ambient_cd_m2
        if look.mirror is not None:
            # Cut an eighth of a pixel behind the mirror: what goes through it leaves no gap along the cut.
            pixel_m = look.view_projection[3] / min(look.camera.fx_px, look.camera.fy_px)
            shared[20:24] = [*look.mirror.normal, look.mirror.offset_m] + pixel_m / 8
        shared[24 : 24 + canvas.layers] = canvas.grid.lod_bias
        shared[28:44] = look.direct.T.ravel()
        for index, plane in enumerate(look.mirrors):
            shared[44 + 4 * index : 48 + 4 * index] = *plane.normal, plane.offset_m
        # Each mirror swaps left and right.
        GL.glFrontFace(GL.GL_CW if look.depth % 2 else GL.GL_CCW)
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._block)
        GL.glBufferSubData(GL.GL_UNIFORM_BUFFER, 0, shared.nbytes, shared)
        GL.glActiveTexture(LIGHT_UNIT)
        self._light._bind()

    def surface(self, batch: Batch, look: Look, copies: int, *abilities: str) -> None:
        """A batch as it looks from there; the reflection and haze it is able to show must be bound."""
        program = self.programs.surface(*abilities, *_abilities(batch, look))
        program.use()
        _set_material(program, batch, look)
        if isinstance(batch.material, Glass):
            self._pane(batch, copies)
            return
        if not isinstance(batch.material, Mirror):
            GL.glActiveTexture(BODY_UNIT)
            batch.primitive.material.baseColorTexture._bind()
        _rectangles(batch, copies)

    def haze(self, batch: Batch, look: Look, plane: Sequence[float]) -> None:
        """What a rough mirror in a plane (normal, offset) shows, without its tint."""
        material = batch.material
        if not isinstance(material, Mirror | Polished):
            raise TypeError(f"{material} is no rough mirror")
        program = self.programs.haze(*(["HAS_FRESNEL"] if isinstance(material, Polished) else []))
        program.use()
        program.vector("plane", np.asarray(plane))
        program.number("roughness", material.roughness)
        program.number("focal_px", max(look.camera.fx_px, look.camera.fy_px))
        if isinstance(material, Polished):
            program.number("eta", material.eta)
        self.flat(batch, look, program)

    def flat(self, batch: Batch, look: Look, program: Program) -> None:
        """A batch in one sample a pixel, whatever is in front of it, by the program in use."""
        program.matrix("model", look.pose(batch.mover))
        GL.glDisable(GL.GL_DEPTH_TEST)
        _rectangles(batch, 1)
        GL.glEnable(GL.GL_DEPTH_TEST)

    def background(self, look: Look, copies: int) -> None:
        """The skies, wherever nothing has been drawn."""
        if len(look.skies) == 0:
            return
        program = self.programs.background()
        program.use()
        program.matrix("world_from_screen", look.world_from_screen)
        # Nothing has been drawn there yet, so that several skies add up.
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        for sky in look.skies:
            for name, vector in zip(("gradation", "scatter", "sun"), sky, strict=True):
                program.vector(name, vector)
            self.cover(copies)
        GL.glDisable(GL.GL_BLEND)

    def mean(self, canvas: Canvas, weight: float) -> None:
        """Add the weighted mean of a canvas's samples."""
        GL.glActiveTexture(LAYERS_UNIT)
        GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, canvas.colour)
        program = self.programs.mean()
        program.use()
        program.count("count", canvas.layers)
        program.number("weight", weight / canvas.layers)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        GL.glDisable(GL.GL_DEPTH_TEST)
        self.cover(1)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDisable(GL.GL_BLEND)

    def cover(self, copies: int) -> None:
        """A triangle over the whole picture, in the program in use."""
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glBindVertexArray(self._vertices)
        GL.glDrawArraysInstanced(GL.GL_TRIANGLES, 0, 3, copies)
        GL.glEnable(GL.GL_CULL_FACE)

    def delete(self) -> None:
        """Free programs and buffers on the graphics side."""
        self.programs.delete()
        GL.glDeleteBuffers(1, [self._block])
        GL.glDeleteVertexArrays(1, [self._vertices])

    def _pane(self, batch: Batch, copies: int) -> None:
        """Seen from both sides, and what is behind it shines through: the alpha drawn is the share that passes."""
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glDepthMask(GL.GL_FALSE)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_SRC_ALPHA)
        _rectangles(batch, copies)
        GL.glDisable(GL.GL_BLEND)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glEnable(GL.GL_CULL_FACE)


def _rectangles(batch: Batch, copies: int) -> None:
    batch.primitive._bind()
    count = batch.primitive.indices.size
    GL.glDrawElementsInstanced(GL.GL_TRIANGLES, count, GL.GL_UNSIGNED_INT, None, copies)


def _abilities(batch: Batch, look: Look) -> list[str]:
    """What the shader must be able to do for a batch."""
    names = {
        "IS_MIRRORED": look.mirror is not None,
        "HAS_FRESNEL": isinstance(batch.material, Polished | Glass),
        "HAS_BODY": not isinstance(batch.material, Mirror | Glass),
        "IS_PANE": isinstance(batch.material, Glass),
    }
    return [name for name, has in names.items() if has]


def _set_material(program: Program, batch: Batch, look: Look) -> None:
    program.matrix("model", look.pose(batch.mover))
    if not isinstance(batch.material, Mirror | Glass):
        program.number("body_scale", batch.body_scale)
    if isinstance(batch.material, Polished | Mirror | Glass):
        program.number("tint", batch.material.tint)
    if isinstance(batch.material, Polished | Glass) and batch.plane is not None:
        program.number("eta", batch.material.eta)
        program.number("eye_height", abs(look.plane(batch.plane, batch.mover).distance_m(look.eye_m)))


def bind_layers(texture: Any) -> None:
    """Let surfaces look a canvas's colour up."""
    GL.glActiveTexture(LAYERS_UNIT)
    GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, texture)
