"""Single draw calls: a batch of triangles, the sky, and the mean of samples; with the uniforms that they read."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from vobench.geometry.se3 import Array
from vobench.rendering.batch import Batch, Geometry
from vobench.rendering.culling import Runs
from vobench.rendering.opengl import (
    Blocks,
    Canvas,
    Elements,
    FlatTarget,
    LightTexture,
    ShaderProgram,
    SurfaceTexture,
    bind,
)
from vobench.rendering.probe import PROBE_MOST, Probe, level_of
from vobench.rendering.render_target import RenderTarget
from vobench.rendering.uniform_block import BATCH, PASS
from vobench.rendering.view import Box, PinholeView, Plane
from vobench.scene.material import Rgb, emitted_cd_m2, inner_reflectance

# Texture units, numbered as in the shaders.
BODY_UNIT = GL.GL_TEXTURE0
LIGHT_UNIT = GL.GL_TEXTURE0 + 1
LAYERS_UNIT = GL.GL_TEXTURE0 + 2
EMISSION_UNIT = GL.GL_TEXTURE0 + 3
PROBE_UNIT = GL.GL_TEXTURE0 + 4

LAYERS = GL.GL_TEXTURE_2D_ARRAY
CLIP_MARGIN_PX = 1 / 8
Block = NDArray[np.void]  # a single value () of a uniform block's type
FADE = 0.1  # of roughness, over which the probe gives way


class DrawCalls:
    """Single draw calls, with the programs and state they share, as long as their context is current."""

    def __init__(self, geometry: Geometry, light: LightTexture) -> None:
        self._program = cache(ShaderProgram)
        self._light = light
        self._batches = geometry.batches
        self._poses = b""
        self._textures = _textures(geometry.batches)
        self._elements = Elements(geometry.vertices, geometry.indices)
        self._pass_values = np.zeros((), PASS.dtype)
        self._pass = Blocks(PASS.binding, self._pass_values[None])

        textures = [self._textures.get(id(batch.material.texture)) for batch in self._batches]
        pairs = list(zip(self._batches, textures, strict=True))
        self.abilities = [_abilities(batch, texture) for batch, texture in pairs]
        self._batch_values = np.zeros(len(pairs), BATCH.dtype)
        for batch, texture in pairs:
            _set_batch(self._batch_values[batch.index], batch, texture)
        self._block = Blocks(BATCH.binding, self._batch_values)

        self._vertices = GL.glGenVertexArrays(1)
        for ability in (GL.GL_SCISSOR_TEST, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
            GL.glEnable(ability)
        # Nearness instead of depth: see view.
        GL.glClipControl(GL.GL_LOWER_LEFT, GL.GL_ZERO_TO_ONE)
        GL.glDepthFunc(GL.GL_GEQUAL)
        GL.glClearDepth(0.0)

    def begin(
        self,
        view: PinholeView,
        canvas: Canvas,
        weights: Rgb,
        probe: Probe | None,
    ) -> None:
        """Set what all draw calls of one view share."""
        values = self._pass_values
        values[...] = np.zeros((), PASS.dtype)
        _set_view(values, view, canvas, weights)
        if probe:
            _set_probe(values, view, probe)
            bind(PROBE_UNIT, probe.texture.id, GL.GL_TEXTURE_CUBE_MAP)
        self._pass.update(0, values)
        self._pass.use(0)
        self._move(view)
        # Each mirror swaps left and right.
        GL.glFrontFace(GL.GL_CW if view.depth % 2 else GL.GL_CCW)
        bind(LIGHT_UNIT, self._light.id)

    def _move(self, view: PinholeView) -> None:
        """Put movers where they are."""
        poses = np.array(view.T_world_movers).tobytes()
        if poses == self._poses:
            return
        self._poses = poses
        for batch in self._batches:
            if batch.mover < 0:
                continue
            values = self._batch_values[batch.index]
            values["model"] = view.pose(batch.mover).T
            if batch.mirror:
                values["plane"] = _coefficients(view.plane(batch.mirror.plane, batch.mover))
            self._block.update(batch.index, values)

    def surface(
        self,
        batch: Batch,
        visible: Runs,
        view: PinholeView,
        canvas: Canvas,
        *abilities: str,
    ) -> None:
        """Draw what is visible of a batch; the reflections that it is able to show must be bound."""
        batch_abilities = self.abilities[batch.index]
        names = [*abilities, "IS_MIRRORED"] if view.mirror else abilities
        program = self._program("surface", "surface", *names, *batch_abilities, *canvas.abilities)
        program.use()
        self._block.use(batch.index)
        material = batch.material
        for unit, texture in ((BODY_UNIT, material.texture), (EMISSION_UNIT, material.emission_texture)):
            if texture:
                bind(unit, self._textures[id(texture)].id)
        runs = visible.get(batch.index, ())
        if batch.is_pane:
            self._pane(runs, canvas.layers, is_grey="IS_GREY" in batch_abilities)
        else:
            self._elements.draw(runs, canvas.layers)

    def background(self, view: PinholeView, canvas: Canvas, weights: Rgb) -> None:
        """Draw the skies wherever nothing has been drawn."""
        # Nothing has been drawn there yet, so that several skies add up.
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        for gradation, scatter, sun, colour in view.skies:
            is_mono = canvas.abilities != ()
            mono = np.array([colour[:3] @ weights, 0, 0, 0])
            shown = mono if is_mono else colour
            program = self._program("background", "background")
            program.use(
                world_from_screen=view.world_from_screen, gradation=gradation, scatter=scatter, sun=sun, colour=shown
            )
            self._cover(canvas.layers)
        GL.glDisable(GL.GL_BLEND)

    def add(
        self,
        target: RenderTarget,
        total: FlatTarget,
        box: Box,
        share: float,
    ) -> None:
        """Add the mean of a target's samples in a box, times a share, to a total."""
        total.begin(box)
        canvas = target.canvas
        bind(LAYERS_UNIT, canvas.colour, LAYERS)
        is_mixed = total.channels == 1 and canvas.abilities == ()
        weights = target.weights if is_mixed else np.ones(3)
        defines = ["IS_MONO"] if is_mixed else []
        program = self._program("fullscreen", "mean", *defines)
        weight = share / canvas.layers * np.array([*weights, 0.0])
        program.use(count=canvas.layers, weight=weight)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        GL.glDisable(GL.GL_DEPTH_TEST)
        self._cover(1)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDisable(GL.GL_BLEND)

    def _cover(self, copies: int) -> None:
        """Draw a triangle over the whole picture by the program in use."""
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glBindVertexArray(self._vertices)
        GL.glDrawArraysInstanced(GL.GL_TRIANGLES, 0, 3, copies)
        GL.glEnable(GL.GL_CULL_FACE)

    def _pane(
        self,
        runs: Sequence[tuple[int, int]],
        copies: int,
        *,
        is_grey: bool,
    ) -> None:
        """Draw both sides over what is behind them: alpha, or the second colour, is the share that shines through."""
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glDepthMask(GL.GL_FALSE)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_SRC_ALPHA if is_grey else GL.GL_SRC1_COLOR)
        self._elements.draw(runs, copies)
        GL.glDisable(GL.GL_BLEND)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glEnable(GL.GL_CULL_FACE)


MOST_TEXELS = 1 << 26  # of all textures: half a gigabyte in colour


def _textures(batches: Sequence[Batch]) -> dict[int, SurfaceTexture]:
    """Every texture by its identity; the finest of them are coarser where all together are too large."""
    textures = {}
    for batch in batches:
        for texture in (batch.material.texture, batch.material.emission_texture):
            if texture:
                textures[id(texture)] = texture
    pixels = {key: texture.pixels() for key, texture in textures.items()}
    sizes = np.array([np.prod(picture.shape[:2]) for picture in pixels.values()], float)
    shrink = np.zeros(len(pixels), int)
    while (sizes / 4.0**shrink).sum() > MOST_TEXELS:
        shrink[np.argmax(sizes / 4.0**shrink)] += 1
    return {key: SurfaceTexture(pixels[key], shrink=int(n)) for key, n in zip(pixels, shrink, strict=True)}


def _abilities(batch: Batch, texture: SurfaceTexture | None) -> tuple[str, ...]:
    """What the shader needs to know of a batch, as preprocessor names."""
    material = batch.material
    has_one_colour = len({*material.colour}) == 1
    is_body = material.kind == "body"
    names = {
        "IS_PLANAR": batch.mirror is not None,
        "IS_PANE": batch.is_pane,
        "IS_MIRROR": material.kind == "mirror" and not batch.is_lamp,
        "IS_LAMP": batch.is_lamp,
        "IS_GREY": has_one_colour and (texture is None or texture.is_grey),
        "HAS_GLOSS": batch.has_gloss,
        "HAS_METAL": material.metal > 0,
        "HAS_TEXTURE": is_body and material.texture is not None and not batch.is_lamp,
        "HAS_LIGHT": is_body or batch.is_lamp,
        "HAS_CUTOUT": material.cutout is not None,
        "HAS_EMISSION": batch.is_lamp or max(material.emission_cd_m2) > 0,
        "HAS_EMISSION_TEXTURE": material.emission_texture is not None,
    }
    return tuple(name for name, has in names.items() if has)


def _set_view(
    values: Block,
    view: PinholeView,
    canvas: Canvas,
    weights: Rgb,
) -> None:
    values["direct"] = view.direct.T
    values["eye"] = view.eye_m
    if view.mirror is not None:
        # Cut a little behind the mirror: what goes through it leaves no gap along the cut.
        focal_px = min(view.camera.fx_px, view.camera.fy_px)
        pixel_m = view.view_projection[3] / focal_px  # (4,): as a plane, a pixel's width at each point
        values["clip_plane"] = _coefficients(view.mirror) + pixel_m * CLIP_MARGIN_PX
    values["lod_bias"][: canvas.layers] = canvas.grid.lod_bias
    for index, plane in enumerate(view.mirrors):
        values["mirrors"][index] = _coefficients(plane)
    values["ambient"] = view.ambient_cd_m2
    values["weights"] = weights
    values["inverse_weight_sum"] = 1 / sum(weights)


def _set_probe(values: Block, view: PinholeView, probe: Probe) -> None:
    values["probe_centre"] = probe.centre_m
    values["probe_low"] = probe.low_m
    values["probe_high"] = probe.high_m
    values["probe_gradient"] = probe.light[:3]
    values["probe_mean"] = probe.light[3]
    values["probe_scale"] = view.ambient_cd_m2 / np.maximum(probe.ambient_cd_m2, 1e-12)
    values["glint_count"] = len(view.glints)
    values["glints"][: 3 * len(view.glints)] = view.glints.reshape(-1, 4)


def _coefficients(plane: Plane) -> Array:
    """The plane as (4,): its normal and its offset."""
    return np.array([*plane.normal, plane.offset_m])


def _set_batch(
    values: np.void,
    batch: Batch,
    texture: SurfaceTexture | None,
) -> None:
    material = batch.material
    values["model"] = np.eye(4)

    texture_scale = texture.scale if texture else 1.0
    scale = texture_scale if material.kind == "body" else material.tint
    values["colour"] = scale * np.array(material.colour)
    values["tint"] = material.tint

    # A lamp's light is on the map: its texture only says how that is spread.
    emitted = emitted_cd_m2(material)
    spread = np.divide(material.emission_cd_m2, emitted, out=np.ones(3), where=emitted > 0)
    values["emission"] = spread if batch.is_lamp else material.emission_cd_m2
    values["emission_repeats"] = 1.0
    if material.emission_texture:
        values["emission_repeats"] = material.tile_m / material.emission_texture.tile_m

    if batch.mirror:
        values["plane"] = _coefficients(batch.mirror.plane)
    eta = material.eta
    inner = inner_reflectance(eta)
    values["eta"] = eta
    values["inner_reflectance"] = inner
    values["inverse_eta_squared"] = 1 / eta**2
    values["arriving_over_entering"] = 1 / ((1 - inner) * eta**2)

    # How far a rough coat's facets let its reflectance rise towards grazing: Lagarde (2011).
    normal_reflectance = ((1 - eta) / (1 + eta)) ** 2
    dullness = 0.0 if batch.mirror else np.sqrt(material.roughness)
    grazing_reflectance = max(1 - dullness, normal_reflectance)
    values["metal"] = material.metal
    values["grazing_rise"] = (grazing_reflectance - normal_reflectance) / (1 - normal_reflectance)
    values["cutout"] = material.cutout or 0.0
    values["roughness"] = material.roughness
    values["probe_level"] = level_of(material.roughness)
    values["probe_share"] = probe_share(batch)
    values["normal_reflectance"] = normal_reflectance


def probe_share(batch: Batch) -> float:
    """How much a batch shows of the probe instead of what lights it."""
    if batch.material.kind != "body":
        return 1.0
    below = PROBE_MOST - batch.material.roughness
    return float(np.clip(below / FADE, 0, 1))
