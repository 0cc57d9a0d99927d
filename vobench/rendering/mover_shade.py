"""The map of light as it is drawn: that of the stationary part, with the shade of movers and the light on them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Indices, Mask
from vobench.rendering.bake import BakedScene
from vobench.rendering.geometry import BoundingSphere
from vobench.rendering.mover_light import MoverLight, MoverLightAt, SampledEmitter, may_shade
from vobench.rendering.opengl import LightTexture, ShaderProgram, bind
from vobench.rendering.texel_owner import owners

TILE_PX = 32  # of the map of light, culled together
SHADOW_PX = 64  # along a side of one shadow map
COLUMNS = 32  # of shadow maps in their atlas
BITS = 24  # bodies that a mask tells apart, as in the shader
UNNOTICED = 1 / 300  # share of a light's largest, less than a step of 8 bits
FLOAT16_STEP = 2.0**-11  # so much too small at most, once it is rounded down

# Texture units; the shaders use the same numbers.
MAPS, TILES, ATLAS, SAMPLES, REACH, EMITTERS, BODIES, BASE, PLACES, NORMALS, DIRECT, MOVER_TEXEL, POINTS, CUBES, HARD = (
    GL.GL_TEXTURE0 + unit for unit in range(15)
)


class BufferTexture:
    """Rows (N, 4) or numbers (N,) float32 that shaders read by index."""

    def __init__(self) -> None:
        self._buffer = GL.glGenBuffers(1)
        self.id = GL.glGenTextures(1)

    def update(self, values: NDArray[Any]) -> None:
        """Replace all values."""
        data = np.ascontiguousarray(values, np.float32)
        if not data.size:
            data = np.zeros(4, np.float32)
        GL.glBindBuffer(GL.GL_TEXTURE_BUFFER, self._buffer)
        GL.glBufferData(GL.GL_TEXTURE_BUFFER, data.nbytes, data, GL.GL_STREAM_DRAW)
        internal = GL.GL_R32F if data.ndim == 1 else GL.GL_RGBA32F
        GL.glBindTexture(GL.GL_TEXTURE_BUFFER, self.id)
        GL.glTexBuffer(GL.GL_TEXTURE_BUFFER, internal, self._buffer)


class ShadedLight:
    """A light texture for scenes with movers: `update` sets the light without them, `shade` puts them in."""

    def __init__(self, baked: BakedScene, values: Floats) -> None:
        owner = owners(baked.atlas)
        self.movers = MoverLight(baked, owner)
        self._height, self._width = baked.direct.shape[1:]
        self._shown: object = None
        self._dirty = np.zeros(0, np.int64)
        self._program = {name: ShaderProgram("shade", "shade", name) for name in ("IS_BASE", "IS_SHADE", "IS_MOVER")}
        self._occluder = ShaderProgram("occluder", "occluder")
        units = (MAPS, TILES, SAMPLES, REACH, EMITTERS, BODIES, POINTS, CUBES, HARD)
        self._buffers = {unit: BufferTexture() for unit in units}
        self._textures: dict[Any, tuple[int, Any]] = {}

        faces = baked.faces
        is_static = (owner.face >= 0) & (faces.mover[owner.face] < 0)
        places_m = np.zeros((len(owner.face), 4), np.float32)
        normals = np.zeros((len(owner.face), 4), np.int8)
        texels = np.flatnonzero(is_static)
        weights = np.column_stack([1 - owner.uv[texels].sum(1), owner.uv[texels]])
        for part in np.array_split(np.arange(len(texels)), 1 + len(texels) // 100_000):
            face = owner.face[texels[part]]
            places_m[texels[part], :3] = np.einsum("ni,nij->nj", weights[part], faces.corners_m[face])
            normals[texels[part], :3] = np.rint(127 * faces.plane[face])
        self._texture_2d(PLACES, GL.GL_RGBA32F, GL.GL_RGBA, GL.GL_FLOAT, places_m)
        self._texture_2d(NORMALS, GL.GL_RGBA8_SNORM, GL.GL_RGBA, GL.GL_BYTE, normals)
        point = np.full(len(owner.face), -1, np.int32)
        point[self.movers.texels] = np.arange(len(self.movers.texels))
        self._texture_2d(MOVER_TEXEL, GL.GL_R32I, GL.GL_RED_INTEGER, GL.GL_INT, point)

        self._tiles_px = (-(-self._width // TILE_PX), -(-self._height // TILE_PX))
        rows, columns = np.divmod(np.arange(len(owner.face)), self._width)
        tile = rows // TILE_PX * self._tiles_px[0] + columns // TILE_PX
        self._mover_tiles = np.unique(tile[self.movers.texels])
        self._tile_balls = self._balls(places_m[texels, :3], tile[texels])
        self._largest = np.array([layer.max() for layer in baked.direct])
        self._lit_tiles = [self._lit(layer, tile) for layer in baked.direct]
        self._texture_direct(baked.direct)

        self._base = LightTexture(values)
        self.id = self._colour_target()
        self._atlas_rows = 0
        self._vertex_array = GL.glGenVertexArrays(1)
        self._vertices = GL.glGenBuffers(1)
        self._empty_vertex_array = GL.glGenVertexArrays(1)
        self._restore_all()

    def _balls(self, places_m: Floats, tile: Indices) -> BoundingSphere:
        """Spheres around the places (N, 3) in each tile (N,); those of tiles without any have a negative radius."""
        count = self._tiles_px[0] * self._tiles_px[1]
        low_m = np.full((count, 3), np.inf)
        high_m = np.full((count, 3), -np.inf)
        order = np.argsort(tile, kind="stable")
        starts = np.flatnonzero(np.diff(tile[order], prepend=-1))
        tiles = tile[order][starts]
        low_m[tiles] = np.minimum.reduceat(places_m[order], starts)
        high_m[tiles] = np.maximum.reduceat(places_m[order], starts)
        with np.errstate(invalid="ignore"):
            return BoundingSphere((low_m + high_m) / 2, np.linalg.norm(high_m - low_m, axis=1) / 2)

    def _lit(self, layer: Floats, tile: Indices) -> Indices:
        """The tiles in which a light's direct light (H, W) is noticed."""
        noticed = np.flatnonzero(layer.ravel() > UNNOTICED * layer.max(initial=0))
        tiles = np.unique(tile[noticed])
        return tiles[np.isfinite(self._tile_balls.radius_m[tiles])]

    def _texture_2d(self, unit: Any, internal: int, form: int, kind: int, values: NDArray[Any]) -> None:
        texture = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        data = np.ascontiguousarray(values)
        GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal, self._width, self._height, 0, form, kind, data)
        _nearest(GL.GL_TEXTURE_2D)
        self._textures[unit] = (GL.GL_TEXTURE_2D, texture)

    def _texture_direct(self, direct: Floats) -> None:
        """Each light's layer over its largest value, rounded down so that no more is taken than there is."""
        texture = GL.glGenTextures(1)
        kind = GL.GL_TEXTURE_2D_ARRAY
        GL.glBindTexture(kind, texture)
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        size = (self._width, self._height, len(direct))
        GL.glTexImage3D(kind, 0, GL.GL_R16F, *size, 0, GL.GL_RED, GL.GL_HALF_FLOAT, None)
        self._textures[DIRECT] = (kind, texture)
        for index in range(len(direct)):
            self.set_direct(index, direct[index])
        _nearest(kind)

    def set_direct(self, index: int, layer: Floats) -> None:
        """Replace a light's direct light (H, W)."""
        self._largest[index] = layer.max(initial=0)
        values = layer * np.float32((1 - FLOAT16_STEP) / max(self._largest[index], 1e-30))
        kind, texture = self._textures[DIRECT]
        GL.glBindTexture(kind, texture)
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        data = np.ascontiguousarray(values, np.float16)
        size = (self._width, self._height, 1)
        GL.glTexSubImage3D(kind, 0, 0, 0, index, *size, GL.GL_RED, GL.GL_HALF_FLOAT, data)

    def _colour_target(self) -> Any:
        texture = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
        size = (self._width, self._height)
        GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, GL.GL_RGBA32F, *size, 0, GL.GL_RGBA, GL.GL_FLOAT, None)
        for side in (GL.GL_TEXTURE_MIN_FILTER, GL.GL_TEXTURE_MAG_FILTER):
            GL.glTexParameteri(GL.GL_TEXTURE_2D, side, GL.GL_LINEAR)
        for axis in (GL.GL_TEXTURE_WRAP_S, GL.GL_TEXTURE_WRAP_T):
            GL.glTexParameteri(GL.GL_TEXTURE_2D, axis, GL.GL_CLAMP_TO_EDGE)
        self._framebuffer = GL.glGenFramebuffers(1)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._framebuffer)
        GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, texture, 0)
        return texture

    def update(self, values: Floats) -> None:
        """Show a map (H, W, 3) without movers; the very array that is there already costs nothing."""
        if values is self._base.values:
            return
        self._base.update(values)
        self._shown = None
        self._restore_all()

    def _restore_all(self) -> None:
        self._begin()
        self._tiles("IS_BASE", np.arange(self._tiles_px[0] * self._tiles_px[1]), None)
        self._end()
        self._dirty = np.zeros(0, np.int64)

    def shade(self, t_ns: float, suns_ns: Sequence[float], colours: Floats) -> None:
        """Put in the movers as they are at an instant, in lights of colours (L, 3) times their levels."""
        poses = [mover.path.pose(t_ns).tobytes() for mover in self.movers.scene_movers]
        key = (tuple(poses), tuple(suns_ns), colours.tobytes())
        if key == self._shown:
            return
        self._shown = key
        at = self.movers.at(t_ns, suns_ns)
        self._upload(at, colours)
        self._draw_atlas(at)
        self._begin()
        self._tiles("IS_BASE", self._dirty, None)
        dirty = [self._mover_tiles]
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendEquation(GL.GL_FUNC_REVERSE_SUBTRACT)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        for nth, emitter in enumerate(at.emitters):
            tiles, masks = self._shaded_tiles(at, nth, emitter, colours)
            if len(tiles):
                of_light = [i for i, other in enumerate(at.emitters) if other.light == emitter.light]
                self._program["IS_SHADE"].use(
                    emitter=nth,
                    largest=float(self._largest[emitter.light]),
                    first_sibling=of_light[0],
                    end_sibling=of_light[-1] + 1,
                )
                self._tiles("IS_SHADE", tiles, masks)
                dirty.append(tiles)
        GL.glBlendEquation(GL.GL_FUNC_ADD)
        GL.glDisable(GL.GL_BLEND)
        self._tiles("IS_MOVER", self._mover_tiles, None)
        self._end()
        self._dirty = np.unique(np.concatenate(dirty))

    def _shaded_tiles(
        self, at: MoverLightAt, nth: int, emitter: SampledEmitter, colours: Floats
    ) -> tuple[Indices, Indices]:
        """The tiles in which bodies may take light of an emitter, and which bodies, as masks."""
        first, count = at.sample_range(nth)
        reaches = at.reach[len(at.cubes) :, first : first + count].max(1)
        candidates = self._lit_tiles[emitter.light]
        masks = np.zeros(len(candidates), np.int64)
        if not colours[emitter.light].any():
            return candidates[:0], masks[:0]
        balls = self._tile_balls.take(candidates)
        for body, (sphere, most) in enumerate(zip(at.spheres.astype(float), reaches, strict=True)):
            if most > 0:
                ball = BoundingSphere(sphere[:3][None], sphere[3:])
                masks |= may_shade(ball, emitter.ball, balls).astype(np.int64) << body % BITS
        return candidates[masks > 0], masks[masks > 0]

    def _upload(self, at: MoverLightAt, colours: Floats) -> None:
        hard_row = 0
        rows = []
        for nth, emitter in enumerate(at.emitters):
            first, count = at.sample_range(nth)
            rows.append([first, count, emitter.light, hard_row if emitter.is_hard else -1])
            rows.append([*emitter.ball.centre_m, emitter.ball.radius_m])
            rows.append([*colours[emitter.light], 0])
            hard_row += emitter.is_hard
        probes = np.zeros((len(at.cubes), 6, 4), np.float32)
        probes[..., :3] = np.einsum("nslc,lc->nsc", at.cubes, colours)
        values = {
            MAPS: at.maps.reshape(-1, 4),
            SAMPLES: at.samples.reshape(-1, 4),
            REACH: at.reach.ravel(),
            EMITTERS: np.array(rows, np.float32).reshape(-1, 4),
            BODIES: at.spheres,
            POINTS: at.points.reshape(-1, 4),
            CUBES: probes.reshape(-1, 4),
            HARD: at.hard.ravel(),
        }
        for unit_of, table in values.items():
            self._buffers[unit_of].update(table)
        map_count = len(at.maps) * len(at.samples)
        self._require_atlas(-(-map_count // COLUMNS))
        for name in ("IS_SHADE", "IS_MOVER"):
            self._program[name].use(
                body_count=len(at.spheres),
                sample_count=len(at.samples),
                probe_count=len(at.cubes),
                point_count=len(at.points),
                emitter_count=len(at.emitters),
                atlas_size=np.array([COLUMNS, SHADOW_PX, COLUMNS * SHADOW_PX, self._atlas_rows * SHADOW_PX]),
            )

    def _require_atlas(self, rows: int) -> None:
        """Shadow maps in so many rows."""
        if rows == self._atlas_rows:
            return
        self._atlas_rows = rows
        texture = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
        size = (COLUMNS * SHADOW_PX, rows * SHADOW_PX)
        form = GL.GL_DEPTH_COMPONENT
        GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, GL.GL_DEPTH_COMPONENT32F, *size, 0, form, GL.GL_FLOAT, None)
        _nearest(GL.GL_TEXTURE_2D)
        self._textures[ATLAS] = (GL.GL_TEXTURE_2D, texture)
        self._atlas_framebuffer = GL.glGenFramebuffers(1)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._atlas_framebuffer)
        GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, texture, 0)
        GL.glDrawBuffer(GL.GL_NONE)

    def _draw_atlas(self, at: MoverLightAt) -> None:
        """Draw each body as every sample sees it."""
        width = COLUMNS * SHADOW_PX
        height = self._atlas_rows * SHADOW_PX
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._atlas_framebuffer)
        GL.glViewport(0, 0, width, height)
        GL.glScissor(0, 0, width, height)
        GL.glClear(GL.GL_DEPTH_BUFFER_BIT)
        GL.glDisable(GL.GL_CULL_FACE)
        for nth in range(4):
            GL.glEnable(GL.GL_CLIP_DISTANCE0 + nth)
        bind(MAPS, self._buffers[MAPS].id, GL.GL_TEXTURE_BUFFER)
        GL.glBindVertexArray(self._vertex_array)
        vertices = np.concatenate(at.occluders_m).astype(np.float32)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._vertices)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, vertices.nbytes, vertices, GL.GL_STREAM_DRAW)
        GL.glEnableVertexAttribArray(0)
        GL.glVertexAttribPointer(0, 3, GL.GL_FLOAT, GL.GL_FALSE, 0, None)
        first = 0
        sample_count = len(at.samples)
        for body, corners_m in enumerate(at.occluders_m):
            self._occluder.use(first_map=body * sample_count, columns=COLUMNS, rows=self._atlas_rows)
            count = 3 * len(corners_m)
            GL.glDrawArraysInstanced(GL.GL_TRIANGLES, first, count, sample_count)
            first += count
        for nth in range(4):
            GL.glDisable(GL.GL_CLIP_DISTANCE0 + nth)
        GL.glEnable(GL.GL_CULL_FACE)

    def _begin(self) -> None:
        """Draw onto the map of light from now on."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._framebuffer)
        GL.glViewport(0, 0, self._width, self._height)
        GL.glScissor(0, 0, self._width, self._height)
        GL.glDisable(GL.GL_DEPTH_TEST)
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glBindVertexArray(self._empty_vertex_array)
        for unit_of, buffer in self._buffers.items():
            bind(unit_of, buffer.id, GL.GL_TEXTURE_BUFFER)
        for unit_of, (kind, texture) in self._textures.items():
            bind(unit_of, texture, kind)
        bind(BASE, self._base.id)

    def _end(self) -> None:
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glEnable(GL.GL_CULL_FACE)

    def _tiles(self, name: str, tiles: Indices, masks: Indices | None) -> None:
        """Draw some tiles by a program."""
        if not len(tiles):
            return
        row, column = np.divmod(tiles, self._tiles_px[0])
        mask = np.zeros(len(tiles)) if masks is None else masks
        self._buffers[TILES].update(np.column_stack([column, row, mask, mask]))
        bind(TILES, self._buffers[TILES].id, GL.GL_TEXTURE_BUFFER)
        self._program[name].use(map_size=np.array([self._width, self._height, TILE_PX, 0]))
        GL.glDrawArraysInstanced(GL.GL_TRIANGLE_STRIP, 0, 4, len(tiles))


def _nearest(kind: int) -> None:
    """Read texels of the texture that is bound as they are."""
    for side in (GL.GL_TEXTURE_MIN_FILTER, GL.GL_TEXTURE_MAG_FILTER):
        GL.glTexParameteri(kind, side, GL.GL_NEAREST)
