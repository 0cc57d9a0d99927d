"""One picture drawn: batches of rectangles, mirrors, background, panes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from OpenGL import GL

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.render.culling import Batch, CullingSet
from vobench.render.opengl import PASS_BINDING, Canvas, FloatTexture, Grid, Program, Programs, Sum, canvas, flat, summed
from vobench.render.view import FAR_M, NEAR_M, Box, PinholeView, Plane, visible_box
from vobench.scene.material import Glass, Mirror, Polished

MIRRORED_UNIT, DEPTH_UNIT, HAZE_UNIT = GL.GL_TEXTURE2, GL.GL_TEXTURE3, GL.GL_TEXTURE3
NONE = -1.0


@dataclass(frozen=True, slots=True)
class RoughBlur:
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
        """Let surfaces view the spread up."""
        GL.glActiveTexture(HAZE_UNIT)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.spread.colour)

    def delete(self) -> None:
        """Free it on the graphics side."""
        GL.glDeleteFramebuffers(1, [self.smooth_framebuffer])
        GL.glDeleteTextures([self.smooth])
        self.spread.delete()


def rough_blur(width_px: int, height_px: int) -> RoughBlur:
    """Target for the mirrors of pictures of some size."""
    framebuffer, smooth = flat(width_px, height_px, GL.GL_RGBA32F, GL.GL_RGBA)
    for key, value in (
        (GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_LINEAR),
        (GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR),
        (GL.GL_TEXTURE_WRAP_S, GL.GL_CLAMP_TO_EDGE),
        (GL.GL_TEXTURE_WRAP_T, GL.GL_CLAMP_TO_EDGE),
    ):
        GL.glTexParameteri(GL.GL_TEXTURE_2D, key, value)
    return RoughBlur(framebuffer, smooth, summed(width_px, height_px))


MIRRORS = 3  # followed, each seen in the one before


@dataclass(frozen=True, slots=True)
class RenderTarget:
    """The picture's canvas, one for each mirror behind a mirror, what rough ones need, and the total of sub-frames."""

    canvases: tuple[Canvas, ...]
    haze: RoughBlur
    total: Sum

    @property
    def canvas(self) -> Canvas:
        """What the picture itself is drawn on."""
        return self.canvases[0]

    @property
    def whole(self) -> Box:
        """The box of the whole picture."""
        return 0, self.canvas.width_px, 0, self.canvas.height_px

    def delete(self) -> None:
        """Free it on the graphics side."""
        for sheet in self.canvases:
            sheet.delete()
        self.haze.delete()
        self.total.delete()


def render_target(width_px: int, height_px: int, grid: Grid) -> RenderTarget:
    """Target for pictures of some size and grid of samples."""
    size = width_px, height_px
    canvases = tuple(canvas(*size, grid) for _ in range(1 + MIRRORS))
    return RenderTarget(canvases, rough_blur(*size), summed(*size))


PASS_FLOATS = 56
BODY_UNIT, LIGHT_UNIT, LAYERS_UNIT = GL.GL_TEXTURE0, GL.GL_TEXTURE1, GL.GL_TEXTURE2


class DrawPrograms:
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

    def begin(self, view: PinholeView, canvas: Canvas) -> None:
        """Set what all strokes of one view share."""
        shared = np.zeros(PASS_FLOATS, np.float32)
        shared[:16] = view.view_projection.T.ravel()
        shared[16:19], shared[19] = view.eye_m, view.ambient_cd_m2
        if view.mirror is not None:
            # Cut an eighth of a pixel behind the mirror: what goes through it leaves no gap along the cut.
            pixel_m = view.view_projection[3] / min(view.camera.fx_px, view.camera.fy_px)
            shared[20:24] = [*view.mirror.normal, view.mirror.offset_m] + pixel_m / 8
        shared[24 : 24 + canvas.layers] = canvas.grid.lod_bias
        shared[28:44] = view.direct.T.ravel()
        for index, plane in enumerate(view.mirrors):
            shared[44 + 4 * index : 48 + 4 * index] = *plane.normal, plane.offset_m
        # Each mirror swaps left and right.
        GL.glFrontFace(GL.GL_CW if view.depth % 2 else GL.GL_CCW)
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._block)
        GL.glBufferSubData(GL.GL_UNIFORM_BUFFER, 0, shared.nbytes, shared)
        GL.glActiveTexture(LIGHT_UNIT)
        self._light._bind()

    def surface(self, batch: Batch, view: PinholeView, copies: int, *abilities: str) -> None:
        """A batch as it looks from there; the reflection and haze it is able to show must be bound."""
        program = self.programs.surface(*abilities, *_abilities(batch, view))
        program.use()
        _set_material(program, batch, view)
        if isinstance(batch.material, Glass):
            self._pane(batch, copies)
            return
        if not isinstance(batch.material, Mirror):
            GL.glActiveTexture(BODY_UNIT)
            batch.primitive.material.baseColorTexture._bind()
        _rectangles(batch, copies)

    def haze(self, batch: Batch, view: PinholeView, plane: Sequence[float]) -> None:
        """What a rough mirror in a plane (normal, offset) shows, without its tint."""
        material = batch.material
        if not isinstance(material, Mirror | Polished):
            raise TypeError(f"{material} is no rough mirror")
        program = self.programs.haze(*(["HAS_FRESNEL"] if isinstance(material, Polished) else []))
        program.use()
        program.vector("plane", np.asarray(plane))
        program.number("roughness", material.roughness)
        program.number("focal_px", max(view.camera.fx_px, view.camera.fy_px))
        if isinstance(material, Polished):
            program.number("eta", material.eta)
        self.flat(batch, view, program)

    def flat(self, batch: Batch, view: PinholeView, program: Program) -> None:
        """A batch in one sample a pixel, whatever is in front of it, by the program in use."""
        program.matrix("model", view.pose(batch.mover))
        GL.glDisable(GL.GL_DEPTH_TEST)
        _rectangles(batch, 1)
        GL.glEnable(GL.GL_DEPTH_TEST)

    def background(self, view: PinholeView, copies: int) -> None:
        """The skies, wherever nothing has been drawn."""
        if len(view.skies) == 0:
            return
        program = self.programs.background()
        program.use()
        program.matrix("world_from_screen", view.world_from_screen)
        # Nothing has been drawn there yet, so that several skies add up.
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        for sky in view.skies:
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


def _abilities(batch: Batch, view: PinholeView) -> list[str]:
    """What the shader must be able to do for a batch."""
    names = {
        "IS_MIRRORED": view.mirror is not None,
        "HAS_FRESNEL": isinstance(batch.material, Polished | Glass),
        "HAS_BODY": not isinstance(batch.material, Mirror | Glass),
        "IS_PANE": isinstance(batch.material, Glass),
    }
    return [name for name, has in names.items() if has]


def _set_material(program: Program, batch: Batch, view: PinholeView) -> None:
    program.matrix("model", view.pose(batch.mover))
    if not isinstance(batch.material, Mirror | Glass):
        program.number("body_scale", batch.body_scale)
    if isinstance(batch.material, Polished | Mirror | Glass):
        program.number("tint", batch.material.tint)
    if isinstance(batch.material, Polished | Glass) and batch.plane is not None:
        program.number("eta", batch.material.eta)
        program.number("eye_height", abs(view.plane(batch.plane, batch.mover).distance_m(view.eye_m)))


def bind_layers(texture: Any) -> None:
    """Let surfaces view a canvas's colour up."""
    GL.glActiveTexture(LAYERS_UNIT)
    GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, texture)


Group = Sequence[Batch]


class BatchDraw:
    """Draws batches onto target, as long as its context is current."""

    def __init__(self, batches: Sequence[Batch], light: FloatTexture) -> None:
        self._brush, self._crowd = DrawPrograms(light), CullingSet(batches)
        # Small things first: they hide much of what is large, which is then not shaded there.
        self._plain = sorted((batch for batch in batches if batch.plane is None), key=_area_m2)
        self._mirrors = _by_plane(batch for batch in batches if isinstance(batch.material, Polished | Mirror))
        self._panes = _by_plane(batch for batch in batches if isinstance(batch.material, Glass))

    def paint(self, view: PinholeView, target: RenderTarget, box: Box) -> None:
        """Fill a box of the target's canvas for as many mirrors as the view goes by, which must be clear there."""
        in_sight = self._crowd.in_sight(view, box)
        canvas = self._begin(view, target, box)
        for batch in self._plain:
            if batch.index in in_sight:
                self._brush.surface(batch, view, canvas.layers)
        for group in _among(in_sight, self._mirrors):
            self._draw_mirror(group, view, target, box)
        self._brush.background(view, canvas.layers)
        for group in sorted(_among(in_sight, self._panes), key=lambda panes: -_nearest_m(panes, view)):
            self._draw_mirror(group, view, target, box)

    def add(self, canvas: Canvas, total: Sum, box: Box, weight: float) -> None:
        """Add a box of a canvas, weighted, to a total."""
        total.begin(box)
        self._brush.mean(canvas, weight)

    def delete(self) -> None:
        """Free everything on the graphics side."""
        self._brush.delete()

    def _begin(self, view: PinholeView, target: RenderTarget, box: Box) -> Canvas:
        canvas = target.canvases[view.depth]
        canvas.begin(box)
        self._brush.begin(view, canvas)
        return canvas

    def _draw_mirror(self, group: Group, view: PinholeView, target: RenderTarget, box: Box) -> None:
        """What lies in one plane, with what it mirrors; nothing where the picture does not show it."""
        plane = _plane_towards(view.eye_m, group[0], view)
        if plane is None or _lies_in(view.mirror, group[0], view):
            return
        copies = target.canvas.layers
        if view.depth == MIRRORS:
            for batch in group:
                self._brush.surface(batch, view, copies)
            return
        rough = [batch for batch in group if _is_rough(batch)]
        within = target.whole if rough else box  # a rough one gathers from beyond a strip
        seen = visible_box(view.camera, _in_camera(group, view), within, near_m=NEAR_M)
        if seen is None:
            return
        self._reflect(view.through(plane), target, seen)
        if rough:
            self._draw_haze(group, plane, view, target)
        self._begin(view, target, box)
        bind_layers(target.canvases[view.depth + 1].colour)
        for batch in group:
            abilities = ("HAS_REFLECTION", "HAS_HAZE") if batch in rough else ("HAS_REFLECTION",)
            self._brush.surface(batch, view, copies, *abilities)

    def _reflect(self, view: PinholeView, target: RenderTarget, box: Box) -> None:
        """What a mirror shows is painted as everything is, by way of one mirror more."""
        target.canvases[view.depth].clear(box)
        self.paint(view, target, box)

    def _draw_haze(self, group: Group, plane: Plane, view: PinholeView, target: RenderTarget) -> None:
        """Spread the reflections in a plane, for the rough mirrors in it to view up."""
        program = self._brush.programs.settle()
        self._brush.begin(view, target.canvas)
        target.haze.settle(target.canvases[view.depth + 1], program)
        for batch in group:
            self._brush.flat(batch, view, program)
        target.haze.finish()
        for batch in filter(_is_rough, group):
            self._brush.haze(batch, view, [*plane.normal, plane.offset_m])
        target.haze.bind()


def _among(in_sight: set[int], groups: Sequence[Group]) -> list[Group]:
    return [group for group in groups if any(batch.index in in_sight for batch in group)]


def _area_m2(batch: Batch) -> float:
    corner, along, _, up = np.moveaxis(batch.quads_m, 1, 0)
    return float(np.linalg.norm(np.cross(along - corner, up - corner), axis=-1).sum())


def _by_plane(batches: Iterable[Batch]) -> list[list[Batch]]:
    """Batches that lie in one plane of one thing, together."""
    groups: dict[tuple[object, ...], list[Batch]] = {}
    for batch in batches:
        if batch.plane is not None:
            groups.setdefault((batch.mover, batch.plane.key), []).append(batch)
    return list(groups.values())


def _is_rough(batch: Batch) -> bool:
    return isinstance(batch.material, Polished | Mirror) and batch.material.roughness > 0


def _plane_towards(eye_m: Array, batch: Batch, view: PinholeView) -> Plane | None:
    """The plane of a batch with its normal towards the eye; None where its mirroring side is not seen."""
    if batch.plane is None:
        return None
    plane = view.plane(batch.plane, batch.mover)
    if plane.distance_m(eye_m) > 0:
        return plane
    return plane.flipped() if isinstance(batch.material, Glass) else None


def _lies_in(plane: Plane | None, batch: Batch, view: PinholeView) -> bool:
    if plane is None or batch.plane is None:
        return False
    here = view.plane(batch.plane, batch.mover)
    return plane.key in (here.key, here.flipped().key)


def _in_camera(group: Group, view: PinholeView) -> Array:
    """Corners (K, 4, 3) of a group's rectangles as the camera sees them."""
    T_camera_mover = view.T_camera_world @ view.pose(group[0].mover)
    return se3.apply(T_camera_mover, np.concatenate([batch.quads_m for batch in group]))


def _nearest_m(group: Group, view: PinholeView) -> float:
    """How far away a group begins."""
    return float(np.linalg.norm(_in_camera(group, view), axis=-1).min())
