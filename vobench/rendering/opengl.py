"""Objects of OpenGL: shader programs, textures, buffers, framebuffers."""

import ctypes
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from OpenGL import GL
from OpenGL.GL import shaders

from vobench.errors import MissingDependencyError, RenderError
from vobench.geometry.se3 import Array
from vobench.rendering.context import SOFTWARE_REMEDY
from vobench.rendering.renderer import Radiance
from vobench.rendering.uniform_block import BLOCKS
from vobench.rendering.view import Box
from vobench.scene.material import linear
from vobench.scene.panorama import PanoramaMap

Floats = NDArray[np.float32]


class LightTexture:
    """A map (H, W, 3) float32 of linear colours, or (H, W) of grey, without mipmaps, row 0 at v = 0.

    It takes one channel where all are equal.
    """

    def __init__(self, values: Floats) -> None:
        self._values: Floats | None = None
        self.id = GL.glGenTextures(1)
        self.update(values)

    def update(self, values: Floats) -> None:
        """Replace the map by another; the very array that is there already costs nothing."""
        if values is self._values:
            return
        self._values = values
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        is_grey = values.ndim == 2 or bool((values[..., :1] == values[..., 1:]).all())
        if is_grey:
            channel = values if values.ndim == 2 else values[..., 0]
            _upload(GL.GL_R32F, GL.GL_RED, channel, GL.GL_FLOAT)
        else:
            _upload(GL.GL_RGBA32F, GL.GL_RGB, values, GL.GL_FLOAT)
        _swizzle(is_grey)
        _texture_parameters(GL.GL_LINEAR, GL.GL_LINEAR, GL.GL_CLAMP_TO_EDGE)


# Linear values of sRGB in 16 bits: eight make steps of 2 % where a surface reflects 20 %, and drivers make sRGB
# linear with errors of up to 1 %.
COUNTS = np.rint(65535 * linear(np.arange(256, dtype=np.uint8))).astype(np.uint16)


class SurfaceTexture:
    """A tile that repeats, with mipmaps, row 0 at v = 0: linear, 16 bits of `scale`.

    values: (H, W) float32, or (H, W, 3 or 4) uint8 in sRGB; shrink: how often the sides in pixels are halved.
    """

    def __init__(
        self,
        values: NDArray[Any],
        *,
        shrink: int = 0,
    ) -> None:
        self.scale = 1.0
        self.is_grey = values.ndim == 2
        self.id = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        if values.ndim == 3:
            counts = COUNTS[values]
            counts[..., 3:] = np.uint16(257) * values[..., 3:]
        else:
            self.scale = max(1.0, float(values.max()))
            counts = np.rint(values * (65535 / self.scale)).astype(np.uint16)
        channels = values.shape[2] if values.ndim == 3 else 1
        internal, form = COLOURS[channels]
        _upload(internal, form, _halved(counts, shrink), GL.GL_UNSIGNED_SHORT)
        _swizzle(self.is_grey)
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
        _texture_parameters(GL.GL_LINEAR_MIPMAP_NEAREST, GL.GL_LINEAR, GL.GL_REPEAT)


COLOURS = {1: (GL.GL_R16, GL.GL_RED), 3: (GL.GL_RGBA16, GL.GL_RGB), 4: (GL.GL_RGBA16, GL.GL_RGBA)}


def _halved(
    values: NDArray[np.uint16],
    times: int,
) -> NDArray[np.uint16]:
    """A picture (H, W, ...) whose sides in pixels are halved a number of times."""
    if not times:
        return values
    width = max(1, values.shape[1] >> times)
    height = max(1, values.shape[0] >> times)
    return np.asarray(cv2.resize(values, [width, height], interpolation=cv2.INTER_AREA))


class PanoramaTexture:
    """A panorama: daylight in its colours, the luminance of lamps in the fourth channel, with mipmaps."""

    def __init__(self, panorama: PanoramaMap) -> None:
        lamps = panorama.lamps[..., None]
        values = np.concatenate([panorama.daylight, lamps], axis=2)
        self.id = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        _upload(GL.GL_RGBA16F, GL.GL_RGBA, values, GL.GL_HALF_FLOAT)
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
        _texture_parameters(GL.GL_LINEAR_MIPMAP_LINEAR, GL.GL_LINEAR, GL.GL_REPEAT)
        GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_WRAP_T, GL.GL_CLAMP_TO_EDGE)


# Position, normal, place on the texture, place on the map of light: by their locations in the vertex shader.
ATTRIBUTE_FLOATS = (3, 3, 2, 2)
FLOAT_BYTES = 4
INDEX_BYTES = 4


class IndexedMesh:
    """Vertices (V, 10) and indices (N,) of a `Geometry` in OpenGL's memory."""

    def __init__(self, vertices: Floats, indices: NDArray[np.uint32]) -> None:
        self._array = GL.glGenVertexArrays(1)
        GL.glBindVertexArray(self._array)
        for kind, values in ((GL.GL_ARRAY_BUFFER, vertices), (GL.GL_ELEMENT_ARRAY_BUFFER, indices)):
            GL.glBindBuffer(kind, GL.glGenBuffers(1))
            GL.glBufferData(kind, values.nbytes, values, GL.GL_STATIC_DRAW)
        first = 0
        for location, count in enumerate(ATTRIBUTE_FLOATS):
            offset = ctypes.c_void_p(FLOAT_BYTES * first)
            GL.glEnableVertexAttribArray(location)
            GL.glVertexAttribPointer(location, count, GL.GL_FLOAT, GL.GL_FALSE, vertices.strides[0], offset)
            first += count

    def draw(self, runs: Sequence[tuple[int, int]], copies: int) -> None:
        """Draw runs (first, count) of indices, once for each sample, in the program in use."""
        GL.glBindVertexArray(self._array)
        for first, count in runs:
            start = ctypes.c_void_p(INDEX_BYTES * first)
            GL.glDrawElementsInstanced(GL.GL_TRIANGLES, count, GL.GL_UNSIGNED_INT, start, copies)


class UniformBuffer:
    """A buffer with several values (B,) of a uniform block. Shaders read the one that is in use."""

    def __init__(self, binding: int, values: NDArray[np.void]) -> None:
        self._binding = binding
        self._size = values.dtype.itemsize
        alignment = int(GL.glGetIntegerv(GL.GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT))
        units = -(-self._size // alignment)  # rounded up
        self._stride = units * alignment
        self._buffer = GL.glGenBuffers(1)
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._buffer)
        GL.glBufferData(GL.GL_UNIFORM_BUFFER, self._stride * len(values), None, GL.GL_DYNAMIC_DRAW)
        for index, value in enumerate(values):
            self.update(index, value)

    def update(
        self,
        index: int,
        value: np.void | NDArray[np.void],
    ) -> None:
        """Replace a value."""
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._buffer)
        GL.glBufferSubData(GL.GL_UNIFORM_BUFFER, index * self._stride, self._size, value.tobytes())

    def use(self, index: int) -> None:
        """Let shaders read a value."""
        offset = index * self._stride
        GL.glBindBufferRange(GL.GL_UNIFORM_BUFFER, self._binding, self._buffer, offset, self._size)


def bind(
    unit: int,
    texture: Any,
    kind: int = GL.GL_TEXTURE_2D,
) -> None:
    """Let shaders sample a texture by a unit."""
    GL.glActiveTexture(unit)
    GL.glBindTexture(kind, texture)


def _upload(
    internal: int,
    form: int,
    values: NDArray[Any],
    kind: int,
) -> None:
    """Fill the texture that is bound."""
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    rows, columns = values.shape[:2]
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal, columns, rows, 0, form, kind, np.ascontiguousarray(values))


def _swizzle(is_grey: bool) -> None:
    """Let shaders read the only channel of the texture that is bound as all three colours, if it is grey."""
    colours = [GL.GL_RED] * 3 if is_grey else [GL.GL_RED, GL.GL_GREEN, GL.GL_BLUE]
    last = GL.GL_ONE if is_grey else GL.GL_ALPHA
    GL.glTexParameteriv(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_SWIZZLE_RGBA, np.array([*colours, last], np.int32))


def _texture_parameters(minify: int, magnify: int, wrap: int) -> None:
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MIN_FILTER, minify)
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MAG_FILTER, magnify)
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_WRAP_S, wrap)
    GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_WRAP_T, wrap)


SHADERS = Path(__file__).parent / "shaders"


class ShaderProgram:
    """A vertex and a fragment shader of this package, compiled with some preprocessor names defined, and linked."""

    def __init__(
        self,
        vertex: str,
        fragment: str,
        defines: Collection[str] = (),
    ) -> None:
        # Core contexts check a program against a vertex array, whichever it is.
        GL.glBindVertexArray(GL.glGenVertexArrays(1))
        try:
            vertex_shader = shaders.compileShader(_source(f"{vertex}.vert", defines), GL.GL_VERTEX_SHADER)
            fragment_shader = shaders.compileShader(_source(f"{fragment}.frag", defines), GL.GL_FRAGMENT_SHADER)
            self._id = shaders.compileProgram(vertex_shader, fragment_shader)
        except Exception as error:  # PyOpenGL's, whichever stage fails
            reason = " ".join(str(error).split())[:200]
            raise MissingDependencyError(
                f"cannot draw: this OpenGL driver cannot run {fragment}.frag ({reason}); run: {SOFTWARE_REMEDY}"
            ) from error
        self._locations: dict[str, Any] = {}
        self._values: dict[str, float | bytes] = {}

    def use(self, **uniforms: float | Array) -> None:
        """Draw with this program from now on, with these of its uniforms: numbers, vectors (4,), matrices."""
        GL.glUseProgram(self._id)
        for name, value in uniforms.items():
            data = value if isinstance(value, int | float) else np.ascontiguousarray(value, np.float32)
            key = data.tobytes() if isinstance(data, np.ndarray) else data
            if self._values.get(name) != key:
                self._values[name] = key
                self._upload(name, data)

    def _upload(
        self,
        name: str,
        value: float | NDArray[np.float32],
    ) -> None:
        if name not in self._locations:
            self._locations[name] = GL.glGetUniformLocation(self._id, name)
        location = self._locations[name]
        if isinstance(value, int):
            GL.glUniform1i(location, value)
        elif isinstance(value, float):
            GL.glUniform1f(location, value)
        elif value.ndim == 1:
            GL.glUniform4fv(location, 1, value)
        else:
            upload = GL.glUniformMatrix4fv if len(value) == 4 else GL.glUniformMatrix3fv
            upload(location, 1, GL.GL_TRUE, value)


def _source(name: str, defines: Collection[str]) -> str:
    """The text of a shader's file, with its uniform blocks declared and names defined.

    The names follow the first line, that of the version; a line `#include <Pass>` becomes the block of that name.
    """
    version, body = (SHADERS / name).read_text(encoding="utf-8").split("\n", 1)
    for block in BLOCKS.values():
        body = body.replace(f"#include <{block.name}>", block.declaration)
    lines = [f"#define {define} 1" for define in sorted(defines)]
    return "\n".join([version, *lines, body])


class CubeTexture:
    """A cube map of six pictures (N, N, 3) whose right, down and ahead axes are rows (6, 3, 3).

    Each level is blurred by another roughness (L,), the first by none.
    """

    def __init__(
        self,
        pictures: Sequence[Radiance],
        axes: Array,
        roughness: Sequence[float],
    ) -> None:
        around = _cube(pictures)
        self.id = _cube(pictures)
        program = ShaderProgram("fullscreen", "probe")
        framebuffer = GL.glGenFramebuffers(1)
        GL.glBindVertexArray(GL.glGenVertexArrays(1))
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
        for ability in (GL.GL_SCISSOR_TEST, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
            GL.glDisable(ability)
        bind(GL.GL_TEXTURE0, around, GL.GL_TEXTURE_CUBE_MAP)
        side = len(pictures[0])
        for level, alpha in list(enumerate(roughness))[1:]:
            size = side >> level
            GL.glViewport(0, 0, size, size)
            for nth, face in enumerate(axes):
                target = GL.GL_TEXTURE_CUBE_MAP_POSITIVE_X + nth
                GL.glFramebufferTexture2D(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, target, self.id, level)
                program.use(axes=face.T, roughness=alpha, size_px=float(size), around_px=float(side))
                GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3)
        for ability in (GL.GL_SCISSOR_TEST, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
            GL.glEnable(ability)
        GL.glDeleteFramebuffers(1, [framebuffer])
        GL.glDeleteTextures([around])


def _cube(pictures: Sequence[Radiance]) -> Any:
    """A cube map with mipmaps."""
    texture = GL.glGenTextures(1)
    GL.glBindTexture(GL.GL_TEXTURE_CUBE_MAP, texture)
    for nth, picture in enumerate(pictures):
        target = GL.GL_TEXTURE_CUBE_MAP_POSITIVE_X + nth
        size = len(picture)
        data = np.ascontiguousarray(picture)
        GL.glTexImage2D(target, 0, GL.GL_RGBA32F, size, size, 0, GL.GL_RGB, GL.GL_FLOAT, data)
    GL.glGenerateMipmap(GL.GL_TEXTURE_CUBE_MAP)
    GL.glTexParameteri(GL.GL_TEXTURE_CUBE_MAP, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR_MIPMAP_LINEAR)
    GL.glEnable(GL.GL_TEXTURE_CUBE_MAP_SEAMLESS)
    return texture


@dataclass(frozen=True, slots=True)
class Grid:
    """The position of each sample in a pixel, one per layer, and the number of mipmap levels by which it is finer."""

    points: tuple[tuple[float, float], ...]
    lod_bias: tuple[float, ...]


# Four rows and four columns: an edge along either is placed to an eighth of a pixel.
# Each sample takes the one nearest mipmap level: by different choices, levels blend from one into the next.
TURNED = Grid(((0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)), (-2.875, -2.375, -2.625, -2.125))
# The same in two halves, each even about the centre, for sub-frames by turns.
OUTER_HALF = Grid((TURNED.points[0], TURNED.points[3]), (TURNED.lod_bias[0], TURNED.lod_bias[3]))
INNER_HALF = Grid((TURNED.points[1], TURNED.points[2]), (TURNED.lod_bias[1], TURNED.lod_bias[2]))
HALVES = (OUTER_HALF, INNER_HALF)
# For pictures of twice as many pixels each way.
CENTRE = Grid(((0.5, 0.5),), (-1.5,))


@dataclass(frozen=True, slots=True)
class Canvas:
    """A framebuffer with one layer a sample: one float channel or four, and depth, as textures."""

    width_px: int
    height_px: int
    channels: int
    grid: Grid
    framebuffer: Any
    colour: Any
    depth: Any

    @property
    def is_mono(self) -> bool:
        """Whether it has one channel."""
        return self.channels == 1

    @property
    def layers(self) -> int:
        """How many samples a pixel has."""
        return len(self.grid.points)

    def begin(self, box: Box) -> None:
        """Draw here from now on, within a box of the picture."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self.framebuffer)
        for index, (x, y) in enumerate(self.grid.points):
            GL.glViewportIndexedf(index, 0.5 - x, 0.5 - y, self.width_px, self.height_px)
        _scissor(box, self.height_px)

    def clear(self, box: Box) -> None:
        """Black and nothing near, within a box, in which to draw from now on."""
        self.begin(box)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT | GL.GL_DEPTH_BUFFER_BIT)

    def nearness(self) -> Radiance:
        """Nearness (rows, columns) of the first sample of each pixel, top row first."""
        GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, self.depth)
        buffer = GL.glGetTexImage(GL.GL_TEXTURE_2D_ARRAY, 0, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT)
        layers = np.frombuffer(buffer, np.float32).reshape(self.layers, self.height_px, self.width_px)
        return layers[0, ::-1]


# By how many channels a picture has; drivers need not draw into three.
FORMATS = {1: (GL.GL_R32F, GL.GL_RED), 3: (GL.GL_RGBA32F, GL.GL_RGBA)}


def canvas(
    width_px: int,
    height_px: int,
    grid: Grid,
    channels: int,
) -> Canvas:
    """A canvas of a size in pixels. Raises RenderError where the driver has no room or form for it."""
    framebuffer = GL.glGenFramebuffers(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    size = (width_px, height_px, len(grid.points))
    internal, form = FORMATS[channels]
    colour = _layers(size, internal, form)
    GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, colour, 0)
    depth = _layers(size, GL.GL_DEPTH_COMPONENT32F, GL.GL_DEPTH_COMPONENT)
    GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, depth, 0)
    _require_complete(width_px, height_px)
    return Canvas(width_px, height_px, channels, grid, framebuffer, colour, depth)


def _layers(
    size: tuple[int, int, int],
    internal: int,
    form: int,
) -> Any:
    """An empty texture with a width and height in pixels and a number of layers."""
    texture = GL.glGenTextures(1)
    GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, texture)
    GL.glTexImage3D(GL.GL_TEXTURE_2D_ARRAY, 0, internal, *size, 0, form, GL.GL_FLOAT, None)
    GL.glTexParameteri(GL.GL_TEXTURE_2D_ARRAY, GL.GL_TEXTURE_MIN_FILTER, GL.GL_NEAREST)
    GL.glTexParameteri(GL.GL_TEXTURE_2D_ARRAY, GL.GL_TEXTURE_MAG_FILTER, GL.GL_NEAREST)
    return texture


@dataclass(frozen=True, slots=True)
class FlatTarget:
    """A framebuffer of one sample a pixel without depth: one float channel, or colours."""

    width_px: int
    height_px: int
    channels: int
    framebuffer: Any

    @property
    def whole(self) -> Box:
        """The box of the whole picture."""
        return 0, self.width_px, 0, self.height_px

    def begin(self, box: Box) -> None:
        """Draw here from now on, within a box of the picture."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self.framebuffer)
        GL.glViewport(0, 0, self.width_px, self.height_px)
        _scissor(box, self.height_px)

    def clear(self, box: Box) -> None:
        """Black all over a box, in which to draw from now on."""
        self.begin(box)
        GL.glClear(GL.GL_COLOR_BUFFER_BIT)

    def read(self, box: Box) -> Radiance:
        """A box of the picture (rows, columns) or (rows, columns, 3) float32, top row first; a new array."""
        u0, u1, v0, v1 = box
        width = u1 - u0
        height = v1 - v0
        _, form = FORMATS[self.channels]
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self.framebuffer)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        buffer = GL.glReadPixels(u0, self.height_px - v1, width, height, form, GL.GL_FLOAT)
        pixels = np.frombuffer(buffer, np.float32).reshape(height, width, -1)
        colours = cv2.cvtColor(pixels, cv2.COLOR_RGBA2RGB) if self.channels == 3 else pixels
        # OpenGL's first row is the lowest.
        return np.asarray(cv2.flip(colours, 0), np.float32)


def flat_target(width_px: int, height_px: int, channels: int) -> FlatTarget:
    """A target of a size in pixels. Raises RenderError where the driver has no room or form for it."""
    internal, form = FORMATS[channels]
    framebuffer = GL.glGenFramebuffers(1)
    texture = GL.glGenTextures(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal, width_px, height_px, 0, form, GL.GL_FLOAT, None)
    GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, texture, 0)
    _require_complete(width_px, height_px)
    return FlatTarget(width_px, height_px, channels, framebuffer)


def _scissor(box: Box, height_px: int) -> None:
    u0, u1, v0, v1 = box
    GL.glScissor(u0, height_px - v1, u1 - u0, v1 - v0)


def _require_complete(width_px: int, height_px: int) -> None:
    status = GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER)
    if status != GL.GL_FRAMEBUFFER_COMPLETE:
        raise RenderError(f"OpenGL has no float framebuffer of {width_px} x {height_px} pixels (status {status:#x})")
