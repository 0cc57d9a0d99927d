"""The light map as it is drawn: that of the stationary scene, with the shadows of movers and the light on them."""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from vobench.rendering.array_types import Floats, Mask, Rows
from vobench.rendering.bake import BakedScene
from vobench.rendering.batch import morton
from vobench.rendering.culling import bounds
from vobench.rendering.geometry import BoundingSphere
from vobench.rendering.gl_buffer import UniformBuffer
from vobench.rendering.gl_texture import bind
from vobench.rendering.mover_light import MoverLight, MoverLightAt, SampledEmitter, may_shade
from vobench.rendering.shader_program import ShaderProgram
from vobench.rendering.texel_owner import Owners, owners
from vobench.rendering.uniform_block import MOST_SPHERES, SHADE
from vobench.rendering.view import Box, PinholeView
from vobench.scene.light import Steady

Views = Sequence[tuple[PinholeView, Box]]
BLOCK = 64  # the number of nearby sites that are drawn or culled together
CLUSTER = 16  # the number of blocks that are culled together before they are culled one by one
WIDEST_M = 0.04  # the largest distance between texels that share a site for soft light
READ_M = 0.1  # the distance from the visible surfaces up to which a view reads the light map
SHADOW_PX = 64  # the side of one shadow map
COLUMNS = 32  # the number of shadow maps in a row of their atlas
UNNOTICED = 1 / 150  # the largest invisible share of the direct light at a site, about one step of 8 bits
FLOAT16_STEP = 2.0**-11  # the relative rounding error of float16
PLACED = 100_000  # the number of texels whose positions are computed at a time
FLOAT_BYTES = 4
STEPS_PER_OCTAVE = 6  # of the light at a site, in its eight bits; the shader has the same

# Texture units; the shaders use the same numbers.
ATLAS = GL.GL_TEXTURE0
MAPS = GL.GL_TEXTURE0 + 1

SITE = np.dtype([("place", np.float32, 3), ("normal", np.int8, 4), ("texel", np.uint16, 2), ("width", np.float32)])
# The floats of each vertex attribute: position, normal and eta, texel, hard light, probe coordinate, indirect light.
POINT_FLOATS = (3, 4, 2, 1, 1, 3)


@dataclass(frozen=True, slots=True)
class Sites:
    """P points of the stationary scene at which shadows are drawn. Nearby sites are in the same block.

    `texels` (P,) are the indices of the sites' texels in the light map.
    `places_m` and `normals` (P, 3) are their positions and normals.
    `width_px` (P,) is 1, or 2 for a site that represents 2 x 2 texels, of which its own has the smallest index.
    `blocks` and `clusters` are the bounding spheres of the blocks and of the clusters of blocks.
    """

    texels: Rows
    places_m: Floats
    normals: Floats
    width_px: Rows
    blocks: BoundingSphere
    clusters: BoundingSphere

    def of_site(self, values: Floats, map_width: int) -> Floats:
        """The smallest value (P,) of a map (H·W,) among the texels of each site."""
        least = values[self.texels]
        wide = np.flatnonzero(self.width_px == 2)
        for step in (1, map_width, map_width + 1):
            least[wide] = np.minimum(least[wide], values[self.texels[wide] + step])
        return least

    def shaded(self, movers: BoundingSphere, emitter: BoundingSphere, among: Mask) -> Rows:
        """The blocks in the mask `among` (N,) in which movers may block light of an emitter."""
        starts = np.arange(0, len(among), CLUSTER)
        clusters = np.flatnonzero(np.logical_or.reduceat(among, starts)) if len(starts) else starts
        clusters = clusters[may_shade(movers, emitter, self.clusters.take(clusters))]
        blocks = (clusters[:, None] * CLUSTER + np.arange(CLUSTER)).ravel()
        blocks = blocks[blocks < len(among)]
        blocks = blocks[among[blocks]]
        return np.asarray(blocks[may_shade(movers, emitter, self.blocks.take(blocks))])

    def seen(self, views: Views) -> Mask:
        """Which blocks (N,) are in one of the views, or so close that a view reads their light."""
        seen_clusters = _seen(self.clusters, views)
        blocks = np.flatnonzero(np.repeat(seen_clusters, CLUSTER)[: len(self.blocks.radius_m)])
        result = np.zeros(len(self.blocks.radius_m), bool)
        result[blocks] = _seen(self.blocks.take(blocks), views)
        return result


def _seen(balls: BoundingSphere, views: Views) -> Mask:
    """Which spheres (N,) are in one of the views, or so close that a view reads their light."""
    result = np.zeros(len(balls.radius_m), bool)
    for view, box in views:
        planes = bounds(view, box)
        planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
        heights_m = np.einsum("pj,nj->pn", planes[:, :3], balls.centre_m) + planes[:, 3:]
        result |= heights_m.min(0) > -balls.radius_m - READ_M
    return result


def _sites(baked: BakedScene, owner: Owners, *, widest_m: float) -> Sites:
    """The sites of all stationary faces. Blocks of 2 x 2 texels up to `widest_m` apart in one plane share a site."""
    faces = baked.faces
    width = baked.atlas.width
    texels = np.flatnonzero((owner.face >= 0) & (faces.mover[owner.face] < 0))
    places_m = np.zeros((len(owner.face), 3), np.float32)
    for start in range(0, len(texels), PLACED):
        part = texels[start : start + PLACED]
        weights = np.column_stack([1 - owner.uv[part].sum(1), owner.uv[part]])
        places_m[part] = np.einsum("ni,nij->nj", weights, faces.corners_m[owner.face[part]])
    width_px = np.ones(len(texels), np.int64)
    if widest_m:
        row, column = np.divmod(texels, width)
        is_first = (row % 2 == 0) & (column % 2 == 0) & (row + 1 < baked.atlas.height) & (column + 1 < width)
        first = texels[is_first]
        is_whole = np.ones(len(first), bool)
        thing = np.where(owner.face >= 0, faces.thing[owner.face], -1)
        for step in (1, width, width + 1):
            other = first + step
            is_whole &= thing[other] == thing[first]
            is_whole &= (faces.plane[owner.face[other]] == faces.plane[owner.face[first]]).all(1)
            apart_m = np.linalg.norm(places_m[other] - places_m[first], axis=1)
            is_whole &= apart_m <= widest_m
        first = first[is_whole]
        is_covered = np.zeros(len(owner.face), bool)
        for step in (1, width, width + 1):
            is_covered[first + step] = True
        is_wide = np.zeros(len(owner.face), bool)
        is_wide[first] = True
        texels = texels[~is_covered[texels]]
        width_px = np.where(is_wide[texels], 2, 1)
        places_m[first] = (places_m[first] + places_m[first + width + 1]) / 2
    places_m = places_m[texels]
    if len(texels):
        order = np.argsort(morton(places_m.astype(float)), kind="stable")
        texels = texels[order]
        places_m = places_m[order]
        width_px = width_px[order]
    low_m, high_m = _boxes(places_m, places_m, BLOCK)
    cluster_low_m, cluster_high_m = _boxes(low_m, high_m, CLUSTER)
    return Sites(
        texels=texels,
        places_m=places_m,
        normals=faces.plane[owner.face[texels]].astype(np.float32),
        width_px=width_px,
        blocks=_around(low_m, high_m),
        clusters=_around(cluster_low_m, cluster_high_m),
    )


def _boxes(low_m: Floats, high_m: Floats, count: int) -> tuple[Floats, Floats]:
    """The bounding boxes of each group of `count` consecutive boxes (N, 3)."""
    if not len(low_m):
        return low_m, high_m
    starts = np.arange(0, len(low_m), count)
    return np.minimum.reduceat(low_m, starts), np.maximum.reduceat(high_m, starts)


def _around(low_m: Floats, high_m: Floats) -> BoundingSphere:
    centre_m = (low_m + high_m).astype(float) / 2
    return BoundingSphere(centre_m, np.linalg.norm(high_m - low_m, axis=1) / 2)


def sky_shares(movers: MoverLight, sampled: Sequence[SampledEmitter], sites: Sites) -> Floats:
    """The share (E, P) of a light's illuminance at each site that comes from each emitter; equal within a block."""
    middles = np.minimum(np.arange(len(sites.blocks.radius_m)) * BLOCK + BLOCK // 2, len(sites.texels) - 1)
    shares = movers.sky_shares(sampled, sites.places_m[middles], sites.normals[middles])
    return np.repeat(shares.T, BLOCK, axis=1)[:, : len(sites.texels)]


class _ShadowAtlas:
    """The shadow maps of all bodies in one depth texture, with a tile for each map."""

    def __init__(self) -> None:
        self.rows = 0
        self._program = ShaderProgram("occluder", "occluder")
        self._maps = _BufferTexture()
        self._vertex_array = GL.glGenVertexArrays(1)
        self._vertices = GL.glGenBuffers(1)
        self._framebuffer = GL.glGenFramebuffers(1)
        self.id = GL.glGenTextures(1)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        return COLUMNS * SHADOW_PX, self.rows * SHADOW_PX

    def draw(self, at: MoverLightAt) -> None:
        """Draw the shadow map of each body for every sample whose light reaches it."""
        self._require_rows(max(-(-at.map_of.size // COLUMNS), 1))
        is_near = np.zeros((len(at.maps), 1, 4), np.float32)
        samples = np.broadcast_to(at.samples[:, 0, 3], at.map_of.shape)
        is_near[:, 0, 0] = samples[at.map_of >= 0]
        self._maps.update(np.concatenate([at.maps, is_near], 1).reshape(-1, 4))
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._framebuffer)
        GL.glViewport(0, 0, *self.size_px)
        GL.glScissor(0, 0, *self.size_px)
        GL.glClear(GL.GL_DEPTH_BUFFER_BIT)
        GL.glDisable(GL.GL_CULL_FACE)
        for nth in range(4):
            GL.glEnable(GL.GL_CLIP_DISTANCE0 + nth)
        bind(MAPS, self._maps.id, GL.GL_TEXTURE_BUFFER)
        GL.glBindVertexArray(self._vertex_array)
        vertices = np.concatenate(at.occluders_m).astype(np.float32)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._vertices)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, vertices.nbytes, vertices, GL.GL_STREAM_DRAW)
        GL.glEnableVertexAttribArray(0)
        GL.glVertexAttribPointer(0, 3, GL.GL_FLOAT, GL.GL_FALSE, 0, None)
        first = 0
        first_map = 0
        for corners_m, numbers in zip(at.occluders_m, at.map_of, strict=True):
            map_count = int((numbers >= 0).sum())
            count = 3 * len(corners_m)
            self._program.use(first_map=first_map, columns=COLUMNS, rows=self.rows)
            GL.glDrawArraysInstanced(GL.GL_TRIANGLES, first, count, map_count)
            first += count
            first_map += map_count
        for nth in range(4):
            GL.glDisable(GL.GL_CLIP_DISTANCE0 + nth)
        GL.glEnable(GL.GL_CULL_FACE)

    def _require_rows(self, rows: int) -> None:
        if rows == self.rows:
            return
        self.rows = rows
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        form = GL.GL_DEPTH_COMPONENT
        internal = GL.GL_DEPTH_COMPONENT32F
        GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal, *self.size_px, 0, form, GL.GL_FLOAT, None)
        for side in (GL.GL_TEXTURE_MIN_FILTER, GL.GL_TEXTURE_MAG_FILTER):
            GL.glTexParameteri(GL.GL_TEXTURE_2D, side, GL.GL_NEAREST)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._framebuffer)
        GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, self.id, 0)
        GL.glDrawBuffer(GL.GL_NONE)


class _BufferTexture:
    """A float32 array (N, 4) whose rows shaders read by index."""

    def __init__(self) -> None:
        self._buffer = GL.glGenBuffers(1)
        self.id = GL.glGenTextures(1)

    def update(self, values: Floats) -> None:
        data = np.ascontiguousarray(values if len(values) else np.zeros((1, 4)), np.float32)
        GL.glBindBuffer(GL.GL_TEXTURE_BUFFER, self._buffer)
        GL.glBufferData(GL.GL_TEXTURE_BUFFER, data.nbytes, data, GL.GL_STREAM_DRAW)
        GL.glBindTexture(GL.GL_TEXTURE_BUFFER, self.id)
        GL.glTexBuffer(GL.GL_TEXTURE_BUFFER, GL.GL_RGBA32F, self._buffer)


class _Map:
    """A light map in colour that can be drawn to."""

    def __init__(self, width: int, height: int) -> None:
        self.id = GL.glGenTextures(1)
        self.framebuffer = GL.glGenFramebuffers(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, GL.GL_RGBA32F, width, height, 0, GL.GL_RGBA, GL.GL_FLOAT, None)
        for side in (GL.GL_TEXTURE_MIN_FILTER, GL.GL_TEXTURE_MAG_FILTER):
            GL.glTexParameteri(GL.GL_TEXTURE_2D, side, GL.GL_LINEAR)
        for axis in (GL.GL_TEXTURE_WRAP_S, GL.GL_TEXTURE_WRAP_T):
            GL.glTexParameteri(GL.GL_TEXTURE_2D, axis, GL.GL_CLAMP_TO_EDGE)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self.framebuffer)
        GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, self.id, 0)


class ShadedLight:
    """The texture of the light map of a scene with movers.

    `update` uploads the light without movers. `shade` adds their shadows and the light on them.
    Shadows are drawn only where a view shows them. The value of a drawn texel depends on the time, not on the views.
    """

    def __init__(self, baked: BakedScene, values: Floats) -> None:
        owner = owners(baked.atlas)
        self._movers = MoverLight(baked, owner)
        self._height, self._width = baked.direct.shape[1:]
        lights = baked.scene.lights
        sampled = self._movers.emitters(tuple(0.0 for _ in lights))
        soft_sites = _sites(baked, owner, widest_m=WIDEST_M)
        is_any_hard = any(emitter.is_hard for emitter in sampled)
        hard_sites = _sites(baked, owner, widest_m=0) if is_any_hard else soft_sites
        self._site_sets = (soft_sites, hard_sites)
        self._is_hard = [int(emitter.is_hard) for emitter in sampled]
        shares = sky_shares(self._movers, sampled, soft_sites)
        direct = baked.direct.reshape(len(lights), -1)
        self._steady_lx = np.zeros(direct.shape[1], np.float32)
        for light, layer in zip(lights, direct, strict=True):
            if isinstance(light.level, Steady) and not light.moves:
                self._steady_lx += np.float32(light.level.mean(0, 0)) * layer

        self._shade = ShaderProgram("shade", "shade", ["IS_SHADE"])
        self._show = ShaderProgram("shade", "shade", ["IS_MOVER"])
        self._give = ShaderProgram("shade", "shade", ["IS_GIVEN"])
        self._atlas = _ShadowAtlas()
        self._block = UniformBuffer(SHADE.binding, np.zeros(max(len(sampled), 1), SHADE.dtype))
        self._site_buffers = [self._site_vertices(sites) for sites in self._site_sets]
        self._site_arrays = [GL.glGenVertexArrays(1) for _ in sampled]
        self._layers = [GL.glGenBuffers(1) for _ in sampled]
        self._unit_lx = np.ones(len(sampled))
        self._is_lit = [np.zeros(0, bool)] * len(sampled)
        for nth, emitter in enumerate(sampled):
            share = 1.0 if emitter.is_hard else shares[nth]
            self._set_layer(nth, direct[emitter.light], share)
            self._bind_sites(nth)
        self._point_array = GL.glGenVertexArrays(1)
        self._points = GL.glGenBuffers(1)

        self._base_values: Floats | None = None
        self._base = _Map(self._width, self._height)
        self._drawn = _Map(self._width, self._height)
        self.id = self._drawn.id
        self._at: MoverLightAt | None = None
        self._key: object = None
        self._colours = np.zeros((len(lights), 3), np.float32)
        self._is_drawn = [np.zeros(0, bool)] * 2
        self.update(values)

    def _site_vertices(self, sites: Sites) -> Any:
        vertices = np.zeros(len(sites.texels), SITE)
        vertices["place"] = sites.places_m
        vertices["normal"][:, :3] = np.rint(127 * sites.normals)
        row, column = np.divmod(sites.texels, self._width)
        vertices["texel"] = np.column_stack([column, row])
        vertices["width"] = sites.width_px
        total_lx = sites.of_site(self._steady_lx, self._width)
        vertices["normal"][:, 3] = np.clip(STEPS_PER_OCTAVE * np.log2(1 + total_lx), 0, 127)
        buffer = GL.glGenBuffers(1)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, buffer)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, vertices.nbytes, vertices, GL.GL_STATIC_DRAW)
        return buffer

    def _bind_sites(self, nth: int) -> None:
        """Define the vertex attributes of an emitter: its sites, and its direct light at each site."""
        GL.glBindVertexArray(self._site_arrays[nth])
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._site_buffers[self._is_hard[nth]])
        columns = (
            ("place", 3, GL.GL_FLOAT, GL.GL_FALSE),
            ("normal", 4, GL.GL_BYTE, GL.GL_TRUE),
            ("texel", 2, GL.GL_UNSIGNED_SHORT, GL.GL_FALSE),
            ("width", 1, GL.GL_FLOAT, GL.GL_FALSE),
        )
        offsets: Mapping[str, Any] = SITE.fields or {}
        for location, (name, count, kind, is_normalized) in zip((0, 1, 2, 4), columns, strict=True):
            offset = ctypes.c_void_p(offsets[name][1])
            GL.glEnableVertexAttribArray(location)
            GL.glVertexAttribPointer(location, count, kind, is_normalized, SITE.itemsize, offset)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._layers[nth])
        GL.glEnableVertexAttribArray(3)
        GL.glVertexAttribPointer(3, 1, GL.GL_HALF_FLOAT, GL.GL_FALSE, 0, None)

    def _set_layer(self, nth: int, light_lx: Floats, share: Floats | float) -> None:
        """Upload the direct light of an emitter at its sites; it is 0 where it is too weak to be visible.

        `light_lx` (H·W,) is the direct light of the emitter's light at level 1. `share` (P,) is the emitter's share.
        Values are relative to the largest one, and reduced so that a shadow never removes more light than there is.
        """
        sites = self._site_sets[self._is_hard[nth]]
        site_lx = share * sites.of_site(light_lx, self._width)
        is_noticed = site_lx > UNNOTICED * (sites.of_site(self._steady_lx, self._width) + site_lx)
        starts = np.arange(0, len(site_lx), BLOCK)
        self._is_lit[nth] = np.logical_or.reduceat(is_noticed, starts) if len(starts) else np.zeros(0, bool)
        self._unit_lx[nth] = max(site_lx.max(initial=0), 1e-30)
        layer = np.where(is_noticed, site_lx * ((1 - FLOAT16_STEP) / self._unit_lx[nth]), 0).astype(np.float16)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._layers[nth])
        GL.glBufferData(GL.GL_ARRAY_BUFFER, layer.nbytes, layer, GL.GL_DYNAMIC_DRAW)

    def update(self, values: Floats) -> None:
        """Show a light map (H, W, 3) without movers. An array that is already shown is not uploaded again."""
        if values is self._base_values and self._key is None:
            return
        if values is not self._base_values:
            self._base_values = values
            GL.glBindTexture(GL.GL_TEXTURE_2D, self._base.id)
            GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
            size = (self._width, self._height)
            data = np.ascontiguousarray(values, np.float32)
            GL.glTexSubImage2D(GL.GL_TEXTURE_2D, 0, 0, 0, *size, GL.GL_RGB, GL.GL_FLOAT, data)
        self._key = None
        self._restore()

    def _restore(self) -> None:
        """Show the uploaded light map without movers."""
        size = (self._width, self._height)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._base.framebuffer)
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._drawn.framebuffer)
        GL.glScissor(0, 0, *size)
        GL.glBlitFramebuffer(0, 0, *size, 0, 0, *size, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)

    def shade(
        self,
        values: Floats,
        t_ns: float,
        suns_ns: Sequence[float],
        colours: Floats,
        views: Views,
    ) -> None:
        """Show a light map (H, W, 3) with the movers at a time, for lights with colours (L, 3) times their levels.

        Shadows may be missing where no view shows them.
        """
        if not self._movers.bodies:
            self.update(values)
            return
        key = (self._movers.poses(t_ns).tobytes(), tuple(suns_ns), colours.tobytes(), id(values))
        if key != self._key:
            self.update(values)
            self._key = key
            self._begin_moment(self._movers.at(t_ns, suns_ns), colours)
        if self._at is None:
            return
        self._begin()
        GL.glEnable(GL.GL_PROGRAM_POINT_SIZE)
        GL.glBlendEquation(GL.GL_FUNC_REVERSE_SUBTRACT)
        for kind, sites in enumerate(self._site_sets):
            new = sites.seen(views) & ~self._is_drawn[kind]
            self._is_drawn[kind] |= new
            for nth in range(len(self._is_hard)):
                if self._is_hard[nth] == kind and new.any():
                    self._draw_shade(nth, sites, new)
        GL.glDisable(GL.GL_PROGRAM_POINT_SIZE)
        self._end()

    def _draw_shade(self, nth: int, sites: Sites, among: Mask) -> None:
        """Subtract the light of an emitter that movers block, in the blocks of the mask `among` (N,)."""
        at = self._at
        if at is None:
            return
        emitter = at.emitters[nth]
        first, count = at.sample_range(nth)
        reaches = at.reach[-len(at.map_of) :, first : first + count]
        if not self._colours[emitter.light].any() or not reaches.any():
            return
        blocks = sites.shaded(at.spheres, emitter.ball, among & self._is_lit[nth])
        if not len(blocks):
            return
        self._use(self._shade, nth)
        GL.glBindVertexArray(self._site_arrays[nth])
        firsts, counts = _runs(blocks, len(sites.texels))
        GL.glMultiDrawArrays(GL.GL_POINTS, firsts, counts, len(firsts))

    def _begin_moment(self, at: MoverLightAt, colours: Floats) -> None:
        """Draw the shadow maps and the light on movers for a new instant."""
        self._at = at
        self._colours = colours
        self._is_drawn = [np.zeros(len(sites.blocks.radius_m), bool) for sites in self._site_sets]
        self._atlas.draw(at)
        for nth, emitter in enumerate(at.emitters):
            self._block.update(nth, self._uniforms(nth, colours[emitter.light]))
        self._show_movers(colours)

    def _show_movers(self, colours: Floats) -> None:
        """Draw the light on movers."""
        at = self._at
        if at is None or not len(at.points):
            return
        count = len(at.points)
        columns = np.zeros((count, sum(POINT_FLOATS)), np.float32)
        row, column = np.divmod(self._movers.texels, self._width)
        columns[:, :3] = at.points[:, 0, :3]
        columns[:, 3:7] = at.points[:, 1]
        columns[:, 7:9] = np.column_stack([column, row])
        columns[:, 10] = at.points[:, 0, 3]
        columns[:, 11:] = at.gathered(colours)
        GL.glBindVertexArray(self._point_array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._points)
        offset = 0
        for location, width in enumerate(POINT_FLOATS):
            GL.glEnableVertexAttribArray(location)
            stride = columns.strides[0]
            GL.glVertexAttribPointer(location, width, GL.GL_FLOAT, GL.GL_FALSE, stride, ctypes.c_void_p(offset))
            offset += FLOAT_BYTES * width
        GL.glBufferData(GL.GL_ARRAY_BUFFER, columns.nbytes, columns, GL.GL_STREAM_DRAW)
        self._begin()
        GL.glBindVertexArray(self._point_array)
        self._use(self._give, 0)
        GL.glDrawArrays(GL.GL_POINTS, 0, count)
        hard_row = 0
        for nth, emitter in enumerate(at.emitters):
            first, sample_count = at.sample_range(nth)
            if emitter.is_hard:
                columns[:, 9] = at.hard[hard_row]
                hard_row += 1
                GL.glBufferData(GL.GL_ARRAY_BUFFER, columns.nbytes, columns, GL.GL_STREAM_DRAW)
            if colours[emitter.light].any() and at.reach[:, first : first + sample_count].any():
                self._use(self._show, nth)
                GL.glDrawArrays(GL.GL_POINTS, 0, count)
        self._end()

    def _uniforms(self, nth: int, colour: Floats) -> NDArray[np.void]:
        """The values of the uniform block of an emitter."""
        at = self._at
        values = np.zeros((), SHADE.dtype)
        if at is None:
            return values
        emitter = at.emitters[nth]
        first, count = at.sample_range(nth)
        samples = slice(first, first + count)
        body_count = len(at.map_of)
        numbers = at.map_of[:, samples].ravel()
        spheres = np.column_stack([at.spheres.centre_m, at.spheres.radius_m])
        sphere_body = at.sphere_body
        if len(spheres) > MOST_SPHERES:
            # The shader supports fewer spheres: one sphere around all of them stands for every body.
            sphere_body = np.full(1, -1)
            centre_m = spheres[:, :3].mean(0)
            reach_m = np.linalg.norm(spheres[:, :3] - centre_m, axis=1) + spheres[:, 3]
            spheres = np.array([[*centre_m, reach_m.max()]])
        values["colour"] = colour
        values["unit_lx"] = self._unit_lx[nth]
        values["is_hard"] = emitter.is_hard
        values["ball"][:3] = emitter.ball.centre_m
        values["ball"][3] = emitter.ball.radius_m if np.isfinite(emitter.ball.radius_m) else -1
        values["size_px"] = (*self._atlas.size_px, self._width, self._height)
        values["tile_px"] = SHADOW_PX
        values["sample_count"] = count
        values["body_count"] = body_count
        values["probe_count"] = len(at.cubes)
        values["sphere_count"] = len(spheres)
        values["places"][:count] = at.samples[samples, 0]
        values["axes"][:count] = at.samples[samples, 1]
        values["strengths"][:count, 0] = at.reach[-body_count:, samples].mean(0)
        if len(at.maps):
            values["maps"].reshape(-1, 3, 4)[: len(numbers)] = at.maps[numbers]
        values["tiles"][: len(numbers), 0] = SHADOW_PX * (numbers % COLUMNS)
        values["tiles"][: len(numbers), 1] = SHADOW_PX * (numbers // COLUMNS)
        values["tiles"][: len(numbers), 2] = numbers >= 0
        values["spheres"][: len(spheres)] = spheres
        values["sphere_bodies"][: len(spheres), 0] = sphere_body
        reach = at.reach[:-body_count, samples].ravel()
        values["reach"].reshape(-1)[: len(reach)] = reach
        return values

    def _use(self, program: ShaderProgram, nth: int) -> None:
        program.use()
        self._block.use(nth)

    def _begin(self) -> None:
        """Set the OpenGL state for additive drawing to the light map."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._drawn.framebuffer)
        GL.glViewport(0, 0, self._width, self._height)
        GL.glScissor(0, 0, self._width, self._height)
        GL.glDisable(GL.GL_DEPTH_TEST)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        bind(ATLAS, self._atlas.id)

    def _end(self) -> None:
        GL.glBlendEquation(GL.GL_FUNC_ADD)
        GL.glDisable(GL.GL_BLEND)
        GL.glEnable(GL.GL_DEPTH_TEST)


def _runs(blocks: Rows, count: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The first site and the number of sites of each run (K,) of consecutive blocks (N,), among `count` sites."""
    begins = np.flatnonzero(np.diff(blocks, prepend=-2) != 1)
    ends = np.append(begins[1:], len(blocks)) - 1
    firsts = blocks[begins] * BLOCK
    lasts = np.minimum((blocks[ends] + 1) * BLOCK, count)
    return firsts.astype(np.int32), (lasts - firsts).astype(np.int32)
