"""One picture drawn: batches of rectangles, mirrors, background, panes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from OpenGL import GL

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.render.culling import Batch, CullingSet
from vobench.render.opengl import (
    PASS_BINDING,
    Canvas,
    FlatTarget,
    FloatTexture,
    Grid,
    Program,
    bind,
    canvas,
    flat_target,
)
from vobench.render.view import FAR_M, NEAR_M, Box, PinholeView, Plane, visible_box
from vobench.scene.material import Glass, Mirror, Polished

# As the shaders say.
BODY_UNIT, LIGHT_UNIT, LAYERS_UNIT, DEPTH_UNIT, ROUGH_UNIT = (GL.GL_TEXTURE0 + unit for unit in (0, 1, 2, 3, 3))
LAYERS = GL.GL_TEXTURE_2D_ARRAY
PASS_FLOATS = 56
MIRRORS = 3  # followed, each seen in the one before
NONE = -1.0


@dataclass(frozen=True, slots=True)
class RenderTarget:
    """The picture's canvas and one for each mirror behind a mirror; what rough ones need; the total of sub-frames.

    smooth: a mirrored picture as luminance, 1 / depth and presence, with mipmaps; rough: what a rough mirror shows.
    """

    canvases: tuple[Canvas, ...]
    smooth: FlatTarget
    rough: FlatTarget
    total: FlatTarget

    @property
    def canvas(self) -> Canvas:
        """What the picture itself is drawn on."""
        return self.canvases[0]


def render_target(width_px: int, height_px: int, grid: Grid) -> RenderTarget:
    """Target for pictures of some size and grid of samples."""
    size = width_px, height_px
    canvases = tuple(canvas(*size, grid) for _ in range(1 + MIRRORS))
    return RenderTarget(canvases, flat_target(*size, mipmaps=True), flat_target(*size), flat_target(*size))


class DrawCalls:
    """Single draw calls, with the programs and state they share, as long as their context is current."""

    def __init__(self, light: FloatTexture) -> None:
        self._program, self._light = cache(Program), light
        self._block = GL.glGenBuffers(1)
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._block)
        GL.glBufferData(GL.GL_UNIFORM_BUFFER, 4 * PASS_FLOATS, None, GL.GL_DYNAMIC_DRAW)
        GL.glBindBufferBase(GL.GL_UNIFORM_BUFFER, PASS_BINDING, self._block)
        self._vertices = GL.glGenVertexArrays(1)
        for ability in (GL.GL_SCISSOR_TEST, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
            GL.glEnable(ability)
        GL.glDepthFunc(GL.GL_LEQUAL)

    def begin(self, view: PinholeView, canvas: Canvas) -> None:
        """Set what all draw calls of one view share."""
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
        bind(LIGHT_UNIT, self._light.id)

    def surface(self, batch: Batch, view: PinholeView, copies: int, *abilities: str) -> None:
        """A batch as it is seen; the reflections that it is able to show must be bound."""
        program = self._program("surface", "surface", *abilities, *_abilities(batch, view))
        program.use(**_uniforms(batch, view))
        if isinstance(batch.material, Glass):
            self._pane(batch, copies)
            return
        if batch.texture:
            bind(BODY_UNIT, batch.texture.id)
        _rectangles(batch, copies)

    def resolve(self, group: "Group", view: PinholeView, reflections: Canvas, target: FlatTarget) -> None:
        """The smooth picture of mirrors in one plane, from the samples of their reflections."""
        target.clear(target.whole)
        bind(LAYERS_UNIT, reflections.colour, LAYERS)
        bind(DEPTH_UNIT, reflections.depth, LAYERS)
        program = self._program("surface", "resolve")
        for batch in group:
            program.use(count=reflections.layers, near_m=NEAR_M, far_m=FAR_M)
            self._flat(batch, view, program)

    def rough(self, group: "Group", view: PinholeView, plane: Plane, target: RenderTarget) -> None:
        """What rough mirrors in a plane show, without their tint, from its smooth picture."""
        target.rough.clear(target.rough.whole, NONE)
        bind(LAYERS_UNIT, target.smooth.texture)
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
        facing, focal_px = np.array([*plane.normal, plane.offset_m]), max(view.camera.fx_px, view.camera.fy_px)
        for batch in group:
            coated = isinstance(batch.material, Polished)
            program = self._program("surface", "rough", *(["HAS_FRESNEL"] if coated else []))
            program.use(plane=facing, roughness=_roughness(batch), focal_px=focal_px)
            if isinstance(batch.material, Polished):
                program.use(eta=batch.material.eta)
            self._flat(batch, view, program)
        bind(ROUGH_UNIT, target.rough.texture)

    def background(self, view: PinholeView, copies: int) -> None:
        """The skies, wherever nothing has been drawn."""
        # Nothing has been drawn there yet, so that several skies add up.
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        for gradation, scatter, sun in view.skies:
            program = self._program("background", "background")
            program.use(world_from_screen=view.world_from_screen, gradation=gradation, scatter=scatter, sun=sun)
            self._cover(copies)
        GL.glDisable(GL.GL_BLEND)

    def add(self, canvas: Canvas, total: FlatTarget, box: Box, weight: float) -> None:
        """Add the mean of a canvas's samples in a box, weighted, to a total."""
        total.begin(box)
        bind(LAYERS_UNIT, canvas.colour, LAYERS)
        self._program("fullscreen", "mean").use(count=canvas.layers, weight=weight / canvas.layers)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        GL.glDisable(GL.GL_DEPTH_TEST)
        self._cover(1)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDisable(GL.GL_BLEND)

    def _flat(self, batch: Batch, view: PinholeView, program: Program) -> None:
        """A batch in one sample a pixel, whatever is in front of it."""
        program.use(model=view.pose(batch.mover))
        GL.glDisable(GL.GL_DEPTH_TEST)
        _rectangles(batch, 1)
        GL.glEnable(GL.GL_DEPTH_TEST)

    def _cover(self, copies: int) -> None:
        """A triangle over the whole picture, in the program in use."""
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glBindVertexArray(self._vertices)
        GL.glDrawArraysInstanced(GL.GL_TRIANGLES, 0, 3, copies)
        GL.glEnable(GL.GL_CULL_FACE)

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
    names = {
        "IS_MIRRORED": view.mirror is not None,
        "HAS_FRESNEL": isinstance(batch.material, Polished | Glass),
        "HAS_BODY": not isinstance(batch.material, Mirror | Glass),
        "IS_PANE": isinstance(batch.material, Glass),
    }
    return [name for name, has in names.items() if has]


def _uniforms(batch: Batch, view: PinholeView) -> dict[str, float | Array]:
    material = batch.material
    values: dict[str, float | Array] = {"model": view.pose(batch.mover)}
    if batch.texture:
        values["body_scale"] = batch.texture.scale / np.pi
    if isinstance(material, Polished | Mirror | Glass):
        values["tint"] = material.tint
    if isinstance(material, Polished | Glass) and batch.plane is not None:
        values["eta"] = material.eta
        values["eye_height"] = abs(view.plane(batch.plane, batch.mover).distance_m(view.eye_m))
    return values


Group = Sequence[Batch]


class BatchDraw:
    """Draws batches onto targets, as long as its context is current."""

    def __init__(self, batches: Sequence[Batch], light: FloatTexture) -> None:
        self._calls, self._culling = DrawCalls(light), CullingSet(batches)
        # Small things first: they hide much of what is large, which is then not shaded there.
        self._plain = sorted((batch for batch in batches if batch.plane is None), key=_area_m2)
        self._mirrors = _by_plane(batch for batch in batches if isinstance(batch.material, Polished | Mirror))
        self._panes = _by_plane(batch for batch in batches if isinstance(batch.material, Glass))

    def draw(self, view: PinholeView, target: RenderTarget, box: Box) -> None:
        """Fill a box of the target's canvas for as many mirrors as the view goes by, which must be clear there."""
        visible = self._culling.visible(view, box)
        canvas = self._begin(view, target, box)
        for batch in self._plain:
            if batch.index in visible:
                self._calls.surface(batch, view, canvas.layers)
        for group in _among(visible, self._mirrors):
            self._draw_mirror(group, view, target, box)
        self._calls.background(view, canvas.layers)
        panes = _among(visible, self._panes)
        for group in sorted(panes, key=lambda group: -np.linalg.norm(_in_camera(group, view), axis=-1).min()):
            self._draw_mirror(group, view, target, box)

    def add(self, target: RenderTarget, total: FlatTarget, box: Box, weight: float) -> None:
        """Add the mean of a target's samples in a box, weighted, to a total."""
        self._calls.add(target.canvas, total, box, weight)

    def _begin(self, view: PinholeView, target: RenderTarget, box: Box) -> Canvas:
        canvas = target.canvases[view.depth]
        canvas.begin(box)
        self._calls.begin(view, canvas)
        return canvas

    def _draw_mirror(self, group: Group, view: PinholeView, target: RenderTarget, box: Box) -> None:
        """What lies in one plane, with what it mirrors; nothing where the picture does not show it."""
        plane = _plane_towards(view.eye_m, group[0], view)
        if plane is None or (view.mirror is not None and view.mirror.key in (plane.key, plane.flipped().key)):
            return
        copies = target.canvas.layers
        if view.depth == MIRRORS:
            for batch in group:
                self._calls.surface(batch, view, copies)
            return
        rough = [batch for batch in group if _roughness(batch) > 0]
        within = target.total.whole if rough else box  # a rough one gathers from beyond a strip
        seen = visible_box(view.camera, _in_camera(group, view), within, near_m=NEAR_M)
        if seen is None:
            return
        reflections = target.canvases[view.depth + 1]
        reflections.clear(seen)
        self.draw(view.through(plane), target, seen)
        if rough:
            self._calls.begin(view, target.canvas)
            self._calls.resolve(group, view, reflections, target.smooth)
            self._calls.rough(rough, view, plane, target)
        self._begin(view, target, box)
        bind(LAYERS_UNIT, reflections.colour, LAYERS)
        for batch in group:
            abilities = ("HAS_REFLECTION", "HAS_ROUGHNESS") if batch in rough else ("HAS_REFLECTION",)
            self._calls.surface(batch, view, copies, *abilities)


def _among(visible: set[int], groups: Sequence[Group]) -> list[Group]:
    return [group for group in groups if any(batch.index in visible for batch in group)]


def _area_m2(batch: Batch) -> float:
    corner, along, _, up = np.moveaxis(batch.quads_m, 1, 0)
    return float(np.linalg.norm(np.cross(along - corner, up - corner), axis=-1).sum())


def _by_plane(batches: Iterable[Batch]) -> list[list[Batch]]:
    groups: dict[tuple[object, ...], list[Batch]] = {}
    for batch in batches:
        if batch.plane is not None:
            groups.setdefault((batch.mover, batch.plane.key), []).append(batch)
    return list(groups.values())


def _roughness(batch: Batch) -> float:
    return batch.material.roughness if isinstance(batch.material, Polished | Mirror) else 0.0


def _plane_towards(eye_m: Array, batch: Batch, view: PinholeView) -> Plane | None:
    """The plane of a batch with its normal towards the eye; None where its mirroring side is not seen."""
    if batch.plane is None:
        return None
    plane = view.plane(batch.plane, batch.mover)
    if plane.distance_m(eye_m) > 0:
        return plane
    return plane.flipped() if isinstance(batch.material, Glass) else None


def _in_camera(group: Group, view: PinholeView) -> Array:
    """Corners (K, 4, 3) of a group's rectangles as the camera sees them."""
    T_camera_world = se3.inverse(view.T_world_camera) @ view.images
    T_camera_mover = T_camera_world @ view.pose(group[0].mover)
    return se3.apply(T_camera_mover, np.concatenate([batch.quads_m for batch in group]))
