"""The OpenGL draw calls for surfaces, skies and the mean of samples, and the uniforms that they read."""

from collections.abc import Mapping, Sequence
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
    PanoramaTexture,
    ShaderProgram,
    SurfaceTexture,
    bind,
)
from vobench.rendering.probe import PROBE_MOST, Probe, level_of
from vobench.rendering.render_target import RenderTarget
from vobench.rendering.uniform_block import BATCH, PASS
from vobench.rendering.view import Box, PinholeView, Plane
from vobench.scene.material import Rgb, emitted_cd_m2, inner_reflectance

# Texture units; the shaders use the same numbers.
BODY_UNIT = GL.GL_TEXTURE0
LIGHT_UNIT = GL.GL_TEXTURE0 + 1
LAYERS_UNIT = GL.GL_TEXTURE0 + 2
EMISSION_UNIT = GL.GL_TEXTURE0 + 3
PROBE_UNIT = GL.GL_TEXTURE0 + 4
PANORAMA_UNIT = GL.GL_TEXTURE0 + 5

LAYERS = GL.GL_TEXTURE_2D_ARRAY
CLIP_MARGIN_PX = 1 / 8  # the distance of the clip plane behind a mirror
Block = NDArray[np.void]  # the values of one uniform block, a structured array of shape ()
FADE = 0.1  # the width of the range of roughness below PROBE_MOST in which the share of the probe decreases to 0


class DrawCalls:
    """The draw calls of a scene, and the shader programs and buffers that they share.

    The OpenGL context in which an instance was created must be current whenever the instance is used.
    `light` is the id of the light-map texture.
    `panoramas` maps the index of a sky to its panorama; skies without a panorama are absent.
    The attribute `abilities` lists, for each batch, the preprocessor names of its shader.
    """

    def __init__(
        self,
        geometry: Geometry,
        light: int,
        panoramas: Mapping[int, PanoramaTexture],
    ) -> None:
        self._program = cache(ShaderProgram)
        self._light = light
        self._panoramas = panoramas
        self._batches = geometry.batches
        self._uploaded_poses = b""
        self._textures = _textures(geometry.batches)
        self._elements = Elements(geometry.vertices, geometry.indices)
        self._pass_values = np.zeros((), PASS.dtype)
        self._pass = Blocks(PASS.binding, self._pass_values[None])

        textures = [self._textures.get(id(batch.material.texture)) for batch in self._batches]
        batches_with_texture = list(zip(self._batches, textures, strict=True))
        self.abilities = [_abilities(batch, texture) for batch, texture in batches_with_texture]
        self._batch_values = np.zeros(len(self._batches), BATCH.dtype)
        for batch, texture in batches_with_texture:
            _set_batch(self._batch_values[batch.index], batch, texture)
        self._block = Blocks(BATCH.binding, self._batch_values)

        self._empty_vertex_array = GL.glGenVertexArrays(1)
        for capability in (GL.GL_SCISSOR_TEST, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
            GL.glEnable(capability)
        # The depth buffer is reversed: it is 0 at infinity, and nearer surfaces have larger values; see `view`.
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
        """Set the uniforms, textures and state that are the same for all draw calls of a view."""
        values = self._pass_values
        values[...] = np.zeros((), PASS.dtype)
        _set_view(values, view, canvas, weights)
        if probe:
            _set_probe(values, view, probe)
            bind(PROBE_UNIT, probe.texture.id, GL.GL_TEXTURE_CUBE_MAP)
        self._pass.update(0, values)
        self._pass.use(0)
        self._move(view)
        # Each reflection reverses the winding order of the faces.
        GL.glFrontFace(GL.GL_CW if view.depth % 2 else GL.GL_CCW)
        bind(LIGHT_UNIT, self._light)

    def _move(self, view: PinholeView) -> None:
        """Upload the poses of the movers if they have changed since the last view."""
        poses = np.array(view.T_world_movers).tobytes()
        if poses == self._uploaded_poses:
            return
        self._uploaded_poses = poses
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
        """Draw the visible triangles of a batch. The textures of its reflections must be bound.

        `abilities` are preprocessor names for the shader, in addition to those of the batch, the view and the canvas.
        """
        batch_abilities = self.abilities[batch.index]
        view_abilities = ["IS_MIRRORED"] if view.mirror else []
        program = self._program("surface", "surface", *abilities, *view_abilities, *batch_abilities, *canvas.abilities)
        program.use()
        self._block.use(batch.index)
        material = batch.material
        for unit, texture in ((BODY_UNIT, material.texture), (EMISSION_UNIT, material.emission_texture)):
            if texture:
                bind(unit, self._textures[id(texture)].id)
        runs = visible.get(batch.index, ())
        if batch.is_pane:
            self._pane(runs, canvas.layers, is_grey="IS_GREY" in batch_abilities)
        elif "IS_RIM" in abilities:
            self._rim(runs, canvas.layers)
        else:
            self._elements.draw(runs, canvas.layers)

    def background(self, view: PinholeView, canvas: Canvas, weights: Rgb) -> None:
        """Draw the sum of all skies in the pixels without a surface."""
        # These pixels are black, so additive blending yields the sum.
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        is_mono = canvas.abilities != ()
        for index, (gradation, scatter, sun, colour) in enumerate(view.skies):
            if index in self._panoramas:
                bind(PANORAMA_UNIT, self._panoramas[index].id)
                program = self._program("background", "panorama", *canvas.abilities)
                program.use(
                    world_from_screen=view.world_from_screen,
                    illuminance_lx=float(gradation[2]),
                    lamp_share=float(gradation[3]),
                    weights=np.array([*weights, 0.0]),
                )
                self._cover(canvas.layers)
                continue
            mono_colour = np.array([colour[:3] @ weights, 0, 0, 0])
            canvas_colour = mono_colour if is_mono else colour
            program = self._program("background", "background")
            program.use(
                world_from_screen=view.world_from_screen,
                gradation=gradation,
                scatter=scatter,
                sun=sun,
                colour=canvas_colour,
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
        """Add the mean of a target's samples, multiplied by `share`, to the pixels of `total` inside a box."""
        total.begin(box)
        canvas = target.canvas
        bind(LAYERS_UNIT, canvas.colour, LAYERS)
        is_colour_to_mono = total.channels == 1 and canvas.abilities == ()
        channel_weights = target.weights if is_colour_to_mono else np.ones(3)
        defines = ["IS_MONO"] if is_colour_to_mono else []
        program = self._program("fullscreen", "mean", *defines)
        weight = share / canvas.layers * np.array([*channel_weights, 0.0])
        program.use(count=canvas.layers, weight=weight)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        GL.glDisable(GL.GL_DEPTH_TEST)
        self._cover(1)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDisable(GL.GL_BLEND)

    def _cover(self, copies: int) -> None:
        """Cover the whole picture with one triangle, drawn by the current program."""
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glBindVertexArray(self._empty_vertex_array)
        GL.glDrawArraysInstanced(GL.GL_TRIANGLES, 0, 3, copies)
        GL.glEnable(GL.GL_CULL_FACE)

    def _pane(
        self,
        runs: Sequence[tuple[int, int]],
        copies: int,
        *,
        is_grey: bool,
    ) -> None:
        """Draw both sides of a pane over the surfaces behind it.

        The transmittance is the alpha of the colour if the pane is grey, otherwise the second colour output.
        """
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glDepthMask(GL.GL_FALSE)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_SRC_ALPHA if is_grey else GL.GL_SRC1_COLOR)
        self._elements.draw(runs, copies)
        GL.glDisable(GL.GL_BLEND)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glEnable(GL.GL_CULL_FACE)

    def _rim(self, runs: Sequence[tuple[int, int]], copies: int) -> None:
        """Blend the partly transparent rims of holes over the surfaces behind them.

        A rim is not drawn over the opaque part of its own surface, which has the same depth.
        """
        GL.glDepthMask(GL.GL_FALSE)
        GL.glDepthFunc(GL.GL_GREATER)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_SRC_ALPHA, GL.GL_ONE_MINUS_SRC_ALPHA)
        self._elements.draw(runs, copies)
        GL.glDisable(GL.GL_BLEND)
        GL.glDepthFunc(GL.GL_GEQUAL)
        GL.glDepthMask(GL.GL_TRUE)


MOST_TEXELS = 1 << 26  # the largest sum of the texels of all textures; in colour they occupy half a gigabyte


def _textures(batches: Sequence[Batch]) -> dict[int, SurfaceTexture]:
    """The textures of all batches by the id of the picture, reduced if their texels exceed MOST_TEXELS."""
    texture_by_id = {}
    for batch in batches:
        for texture in (batch.material.texture, batch.material.emission_texture):
            if texture:
                texture_by_id[id(texture)] = texture
    pixels_by_id = {key: texture.pixels() for key, texture in texture_by_id.items()}

    texel_counts = np.array([np.prod(pixels.shape[:2]) for pixels in pixels_by_id.values()], float)
    halvings = _halvings(texel_counts)
    surface_textures = {}
    for (key, pixels), count in zip(pixels_by_id.items(), halvings, strict=True):
        surface_textures[key] = SurfaceTexture(pixels, shrink=int(count))
    return surface_textures


def _halvings(texel_counts: Array) -> NDArray[np.intp]:
    """How often the sides of each texture (N,) are halved, so that the texels sum to at most MOST_TEXELS.

    `texel_counts` (N,) are the texels at full resolution. In each step, the largest remaining texture is halved.
    """
    halvings = np.zeros(len(texel_counts), np.intp)
    while True:
        reduced_counts = texel_counts / 4.0**halvings
        if reduced_counts.sum() <= MOST_TEXELS:
            return halvings
        halvings[np.argmax(reduced_counts)] += 1


def _abilities(batch: Batch, texture: SurfaceTexture | None) -> tuple[str, ...]:
    """The preprocessor names that adapt the shader to a batch."""
    material = batch.material
    has_grey_colour = len({*material.colour}) == 1
    is_body = material.kind == "body"
    is_defined = {
        "IS_PLANAR": batch.mirror is not None,
        "IS_PANE": batch.is_pane,
        "IS_MIRROR": material.kind == "mirror" and not batch.is_lamp,
        "IS_LAMP": batch.is_lamp,
        "IS_GREY": has_grey_colour and (texture is None or texture.is_grey),
        "HAS_GLOSS": batch.has_gloss,
        "HAS_METAL": material.metal > 0,
        "HAS_TEXTURE": is_body and material.texture is not None and not batch.is_lamp,
        "HAS_LIGHT": is_body or batch.is_lamp,
        "HAS_CUTOUT": batch.has_holes,
        "HAS_EMISSION": batch.is_lamp or max(material.emission_cd_m2) > 0,
        "HAS_EMISSION_TEXTURE": material.emission_texture is not None,
    }
    return tuple(name for name, is_set in is_defined.items() if is_set)


def _set_view(
    values: Block,
    view: PinholeView,
    canvas: Canvas,
    weights: Rgb,
) -> None:
    """Set the uniforms of a view, without those of the probe."""
    values["direct"] = view.direct.T
    values["eye"] = view.eye_m
    if view.mirror is not None:
        # The clip plane is slightly behind the mirror, so that no gap appears where a surface crosses the mirror.
        focal_px = min(view.camera.fx_px, view.camera.fy_px)
        # The product of `pixel_width_m` (4,) and a homogeneous point is the width of a pixel at the point's depth.
        pixel_width_m = view.view_projection[3] / focal_px
        values["clip_plane"] = _coefficients(view.mirror) + pixel_width_m * CLIP_MARGIN_PX
    values["lod_bias"][: canvas.layers] = canvas.grid.lod_bias
    for index, plane in enumerate(view.mirrors):
        values["mirrors"][index] = _coefficients(plane)
    values["ambient"] = view.ambient_cd_m2
    values["weights"] = weights
    values["inverse_weight_sum"] = 1 / sum(weights)


def _set_probe(values: Block, view: PinholeView, probe: Probe) -> None:
    """Set the uniforms of the probe and of the glints."""
    values["probe_centre"] = probe.centre_m
    values["probe_low"] = probe.low_m
    values["probe_high"] = probe.high_m
    values["probe_gradient"] = probe.light[:3]
    values["probe_mean"] = probe.light[3]
    values["probe_scale"] = view.ambient_cd_m2 / np.maximum(probe.ambient_cd_m2, 1e-12)
    values["glint_count"] = len(view.glints)
    values["glints"][: 3 * len(view.glints)] = view.glints.reshape(-1, 4)


def _coefficients(plane: Plane) -> Array:
    """The coefficients (4,) of a plane: its normal, then its offset in metres."""
    return np.array([*plane.normal, plane.offset_m])


def _set_batch(
    values: np.void,
    batch: Batch,
    texture: SurfaceTexture | None,
) -> None:
    """Set the uniforms of a batch."""
    values["model"] = np.eye(4)
    if batch.mirror:
        values["plane"] = _coefficients(batch.mirror.plane)
    values["cutout"] = batch.material.cutout or 0.0
    _set_colour(values, batch, texture)
    _set_emission(values, batch)
    _set_coat(values, batch)
    _set_gloss(values, batch)


def _set_colour(values: np.void, batch: Batch, texture: SurfaceTexture | None) -> None:
    """Set the reflectance of a body, or the colour of a mirror or pane, and its tint."""
    material = batch.material
    texture_scale = texture.scale if texture else 1.0
    scale = texture_scale if material.kind == "body" else material.tint
    values["colour"] = scale * np.array(material.colour)
    values["tint"] = material.tint


def _set_emission(values: np.void, batch: Batch) -> None:
    """Set the emission, and how often its texture is repeated in one tile of the material."""
    material = batch.material
    # The light map contains the mean emission of a lamp, so its texture is relative to the mean.
    mean_cd_m2 = emitted_cd_m2(material)
    relative_emission = np.divide(material.emission_cd_m2, mean_cd_m2, out=np.ones(3), where=mean_cd_m2 > 0)
    values["emission"] = relative_emission if batch.is_lamp else material.emission_cd_m2
    values["emission_repeats"] = 1.0
    if material.emission_texture:
        values["emission_repeats"] = material.tile_m / material.emission_texture.tile_m


def _set_coat(values: np.void, batch: Batch) -> None:
    """Set the constants of refraction for light that enters and leaves a body through its coat."""
    eta = batch.material.eta
    inner = inner_reflectance(eta)
    values["eta"] = eta
    values["inner_reflectance"] = inner
    values["inverse_eta_squared"] = 1 / eta**2
    values["arriving_over_entering"] = 1 / ((1 - inner) * eta**2)


def _set_gloss(values: np.void, batch: Batch) -> None:
    """Set the reflectance of a surface, its roughness and the share of the probe."""
    material = batch.material
    # Rougher surfaces reflect less at grazing incidence: Lagarde (2011).
    normal_reflectance = ((1 - material.eta) / (1 + material.eta)) ** 2
    grazing_loss = 0.0 if batch.mirror else np.sqrt(material.roughness)
    grazing_reflectance = max(1 - grazing_loss, normal_reflectance)
    values["normal_reflectance"] = normal_reflectance
    values["grazing_rise"] = (grazing_reflectance - normal_reflectance) / (1 - normal_reflectance)
    values["metal"] = material.metal

    values["roughness"] = material.roughness
    values["probe_level"] = level_of(material.roughness)
    values["probe_share"] = probe_share(batch)


def probe_share(batch: Batch) -> float:
    """The share of a batch's reflections that is read from the probe; it is 0 for a roughness of PROBE_MOST or more."""
    if batch.material.kind != "body":
        return 1.0
    margin = PROBE_MOST - batch.material.roughness
    return float(np.clip(margin / FADE, 0, 1))
