"""The OpenGL draw calls for surfaces, skies and the mean of samples."""

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
from OpenGL import GL

from vobench.rendering.background import PanoramaSky, StandardSky
from vobench.rendering.batch import Batch, Geometry
from vobench.rendering.batch_texture import BatchTextures, batch_textures
from vobench.rendering.culling import TriangleRuns
from vobench.rendering.framebuffer import Framebuffer, LayeredFramebuffer
from vobench.rendering.gl_buffer import UniformBuffer, VertexArray
from vobench.rendering.gl_state import blending, disabled, set_initial_state, strictly_nearer, without_depth_writes
from vobench.rendering.gl_texture import PanoramaTexture, bind
from vobench.rendering.probe import Probe
from vobench.rendering.render_target import RenderTarget
from vobench.rendering.shader_define import NO_DEFINES, Defines, ShaderDefine
from vobench.rendering.shader_program import ShaderProgram
from vobench.rendering.uniform_block import BATCH, PASS
from vobench.rendering.uniforms import set_batch, set_probe, set_view
from vobench.rendering.view import Box, PinholeView
from vobench.scene.material import Rgb

# Texture units; the shaders use the same numbers.
BODY_UNIT = GL.GL_TEXTURE0
LIGHT_UNIT = GL.GL_TEXTURE0 + 1
LAYERS_UNIT = GL.GL_TEXTURE0 + 2
EMISSION_UNIT = GL.GL_TEXTURE0 + 3
PROBE_UNIT = GL.GL_TEXTURE0 + 4
PANORAMA_UNIT = GL.GL_TEXTURE0 + 5

MONO_DEFINES: Defines = frozenset({ShaderDefine.IS_MONO})


class DrawCalls:
    """The draw calls of a scene, and the shader programs and buffers that they share.

    The OpenGL context in which an instance was created must be current whenever the instance is used.
    `light` is the id of the light-map texture.
    `panoramas` maps the index of a sky to its panorama; skies without a panorama are absent.
    The attribute `shader_defines` lists, for each batch, the preprocessor names of its shader.
    """

    def __init__(
        self,
        geometry: Geometry,
        light: int,
        panoramas: Mapping[int, PanoramaTexture],
    ) -> None:
        self._program = cache(ShaderProgram)  # each program is compiled once for each set of preprocessor names
        self._light = light
        self._panoramas = panoramas
        self._batches = geometry.batches
        self._textures = batch_textures(geometry.batches)
        self.shader_defines = [
            _shader_defines(batch, textures) for batch, textures in zip(self._batches, self._textures, strict=True)
        ]

        self._vertex_array = VertexArray(geometry.vertices, geometry.indices)
        self._empty_vertex_array = GL.glGenVertexArrays(1)
        self._pass_uniforms = np.zeros((), PASS.dtype)
        self._pass_buffer = UniformBuffer(PASS.binding, self._pass_uniforms[None])
        self._batch_uniforms = np.zeros(len(self._batches), BATCH.dtype)
        for batch, textures in zip(self._batches, self._textures, strict=True):
            set_batch(self._batch_uniforms[batch.index], batch, textures.body)
        self._batch_buffer = UniformBuffer(BATCH.binding, self._batch_uniforms)
        self._uploaded_poses = b""  # the bytes of the mover poses that the buffer of the batches holds
        set_initial_state()

    def begin_view(
        self,
        view: PinholeView,
        framebuffer: LayeredFramebuffer,
        weights: Rgb,
        probe: Probe | None,
    ) -> None:
        """Set the uniforms, textures and state that are the same for all draw calls of a view.

        `weights` are the shares of red, green and blue in the luminance of a framebuffer with one channel.
        """
        uniforms = self._pass_uniforms
        uniforms[...] = np.zeros((), PASS.dtype)  # removes the values of the last view
        set_view(uniforms, view, framebuffer, weights)
        if probe:
            set_probe(uniforms, view, probe)
            bind(PROBE_UNIT, probe.texture.id, GL.GL_TEXTURE_CUBE_MAP)
        self._pass_buffer.update(0, uniforms)
        self._pass_buffer.use(0)
        self._upload_mover_poses(view)
        # Each reflection reverses the winding order of the faces; the depth of a view is its number of reflections.
        is_mirror_image = view.depth % 2 == 1
        GL.glFrontFace(GL.GL_CW if is_mirror_image else GL.GL_CCW)
        bind(LIGHT_UNIT, self._light)

    def _upload_mover_poses(self, view: PinholeView) -> None:
        """Upload the poses of the movers if they have changed since the last view."""
        poses = np.array(view.T_world_movers).tobytes()
        if poses == self._uploaded_poses:
            return
        self._uploaded_poses = poses
        for batch in self._batches:
            if batch.mover < 0:
                continue
            uniforms = self._batch_uniforms[batch.index]
            uniforms["model"] = view.pose(batch.mover).T
            if batch.mirror:
                uniforms["plane"] = view.plane(batch.mirror.plane, batch.mover).coefficients
            self._batch_buffer.update(batch.index, uniforms)

    def draw_surface(
        self,
        batch: Batch,
        visible: TriangleRuns,
        view: PinholeView,
        framebuffer: LayeredFramebuffer,
        defines: Defines = NO_DEFINES,
    ) -> None:
        """Draw the visible triangles of a batch. The textures of its reflections must be bound.

        `defines` are preprocessor names for the shader, in addition to those that follow from the other arguments.
        """
        batch_defines = self.shader_defines[batch.index]
        all_defines = defines | batch_defines | _framebuffer_defines(framebuffer)
        if view.mirror:
            all_defines |= {ShaderDefine.IS_MIRRORED}
        if view.extinction_per_m:
            all_defines |= {ShaderDefine.HAS_FOG}
        program = self._program("surface", "surface", all_defines)
        program.use()
        self._batch_buffer.use(batch.index)
        textures = self._textures[batch.index]
        if textures.body:
            bind(BODY_UNIT, textures.body.id)
        if textures.emission:
            bind(EMISSION_UNIT, textures.emission.id)

        # Whether a batch is a pane follows from its material. The rims of holes are drawn by a second call for the same
        # batch, with another define.
        runs = visible.get(batch.index, ())
        if batch.is_pane:
            self._draw_pane(runs, framebuffer.layers, is_grey=ShaderDefine.IS_GREY in batch_defines)
        elif ShaderDefine.IS_RIM in defines:
            self._draw_rim(runs, framebuffer.layers)
        else:
            self._vertex_array.draw(runs, framebuffer.layers)

    def draw_background(self, view: PinholeView, framebuffer: LayeredFramebuffer, weights: Rgb) -> None:
        """Draw the sum of all skies in the pixels without a surface."""
        # These pixels are black, so additive blending yields the sum.
        with blending(GL.GL_ONE, GL.GL_ONE):
            for sky in view.skies:
                if isinstance(sky, PanoramaSky):
                    self._draw_panorama(sky, view, framebuffer, weights)
                else:
                    self._draw_standard_sky(sky, view, framebuffer, weights)

    def _draw_panorama(
        self, sky: PanoramaSky, view: PinholeView, framebuffer: LayeredFramebuffer, weights: Rgb
    ) -> None:
        """Draw a panorama behind all surfaces."""
        bind(PANORAMA_UNIT, self._panoramas[sky.index].id)
        program = self._program("background", "panorama", _framebuffer_defines(framebuffer))
        program.use(
            world_from_screen=view.world_from_screen,
            illuminance_lx=float(sky.illuminance_lx),
            lamp_share=sky.lamp_share,
            weights=np.array([*weights, 0.0]),
        )
        self._cover(framebuffer.layers)

    def _draw_standard_sky(
        self, sky: StandardSky, view: PinholeView, framebuffer: LayeredFramebuffer, weights: Rgb
    ) -> None:
        """Draw a standard sky behind all surfaces."""
        # The shader writes four channels. A framebuffer with one channel stores the first of them.
        luminance = sky.colour[:3] @ weights
        mono_colour = np.array([luminance, 0, 0, 0])
        program = self._program("background", "background")
        program.use(
            world_from_screen=view.world_from_screen,
            gradation=sky.gradation,
            scatter=sky.scatter,
            sun=sky.sun,
            colour=mono_colour if framebuffer.is_mono else sky.colour,
        )
        self._cover(framebuffer.layers)

    def add_mean(
        self,
        target: RenderTarget,
        total: Framebuffer,
        box: Box,
        share: float,
    ) -> None:
        """Add the mean of a target's samples, multiplied by `share`, to the pixels of `total` inside a box.

        If `total` has one channel and the samples are in colour, their luminance is added.
        """
        total.bind(box)
        framebuffer = target.framebuffer
        bind(LAYERS_UNIT, framebuffer.colour_texture, GL.GL_TEXTURE_2D_ARRAY)
        if total.channels == 1 and not framebuffer.is_mono:
            channel_weights = target.weights
            defines = MONO_DEFINES  # this shader then adds up the three weighted channels
        else:
            channel_weights = (1.0, 1.0, 1.0)
            defines = NO_DEFINES
        sample_weights = share / framebuffer.layers * np.array([*channel_weights, 0.0])
        program = self._program("fullscreen", "mean", defines)
        program.use(count=framebuffer.layers, weight=sample_weights)
        with blending(GL.GL_ONE, GL.GL_ONE), disabled(GL.GL_DEPTH_TEST):
            self._cover(layers=1)

    def _cover(self, layers: int) -> None:
        """Cover the whole picture in all layers with one triangle each, drawn by the current program."""
        with disabled(GL.GL_CULL_FACE):
            GL.glBindVertexArray(self._empty_vertex_array)
            GL.glDrawArraysInstanced(GL.GL_TRIANGLES, 0, 3, layers)

    def _draw_pane(
        self,
        runs: Sequence[tuple[int, int]],
        layers: int,
        *,
        is_grey: bool,
    ) -> None:
        """Draw both sides of a pane over the surfaces behind it.

        The transmittance is the alpha of the colour if the pane is grey, otherwise the second colour output.
        """
        transmittance = GL.GL_SRC_ALPHA if is_grey else GL.GL_SRC1_COLOR
        with disabled(GL.GL_CULL_FACE), without_depth_writes(), blending(GL.GL_ONE, transmittance):
            self._vertex_array.draw(runs, layers)

    def _draw_rim(self, runs: Sequence[tuple[int, int]], layers: int) -> None:
        """Blend the partly transparent rims of holes over the surfaces behind them.

        A rim is not drawn over the opaque part of its own surface, which has the same depth.
        """
        opacity_blending = blending(GL.GL_SRC_ALPHA, GL.GL_ONE_MINUS_SRC_ALPHA)
        with without_depth_writes(), strictly_nearer(), opacity_blending:
            self._vertex_array.draw(runs, layers)


def _framebuffer_defines(framebuffer: LayeredFramebuffer) -> Defines:
    """The preprocessor names for shaders that draw into a framebuffer."""
    return MONO_DEFINES if framebuffer.is_mono else NO_DEFINES


def _shader_defines(batch: Batch, textures: BatchTextures) -> Defines:
    """The preprocessor names that adapt the shader to a batch."""
    material = batch.material
    has_grey_colour = len({*material.colour}) == 1
    has_grey_texture = textures.body is None or textures.body.is_grey
    is_body = material.kind == "body"
    is_defined = {
        ShaderDefine.IS_PLANAR: batch.mirror is not None,
        ShaderDefine.IS_PANE: batch.is_pane,
        ShaderDefine.IS_MIRROR: material.kind == "mirror" and not batch.is_lamp,
        ShaderDefine.IS_LAMP: batch.is_lamp,
        ShaderDefine.IS_GREY: has_grey_colour and has_grey_texture,
        ShaderDefine.HAS_GLOSS: batch.has_gloss,
        ShaderDefine.HAS_METAL: material.metal > 0,
        ShaderDefine.HAS_TEXTURE: is_body and material.texture is not None and not batch.is_lamp,
        ShaderDefine.HAS_LIGHT: is_body or batch.is_lamp,
        ShaderDefine.HAS_CUTOUT: batch.has_holes,
        ShaderDefine.HAS_EMISSION: batch.is_lamp or max(material.emission_cd_m2) > 0,
        ShaderDefine.HAS_EMISSION_TEXTURE: material.emission_texture is not None,
    }
    return frozenset(name for name, is_set in is_defined.items() if is_set)
