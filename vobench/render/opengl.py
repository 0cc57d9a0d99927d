"""What OpenGL holds: shader programs, textures, framebuffers; pyrender's private parts are used here and in raster."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL
from pyrender.shader_program import ShaderProgram

from vobench.errors import RenderError
from vobench.geometry.se3 import Array
from vobench.render.renderer import Radiance
from vobench.render.view import Box

Floats = NDArray[np.float32]


class FloatTexture:
    """A (H, W) float32 map without mipmaps, row 0 at v = 0."""

    def __init__(self, values: Floats) -> None:
        self._values, self.id = values, _texture(GL.GL_R32F, values, GL.GL_FLOAT)
        _texture_parameters(GL.GL_LINEAR, GL.GL_LINEAR, GL.GL_CLAMP_TO_EDGE)

    def update(self, values: Floats) -> None:
        """Replace the map by another (H, W); the very array that is there already costs nothing."""
        if values is self._values:
            return
        self._values = values
        rows, columns = values.shape
        GL.glBindTexture(GL.GL_TEXTURE_2D, self.id)
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
        data = np.ascontiguousarray(values, np.float32)
        GL.glTexSubImage2D(GL.GL_TEXTURE_2D, 0, 0, 0, columns, rows, GL.GL_RED, GL.GL_FLOAT, data)


class ReflectanceTexture:
    """A (N, N) float32 tile that repeats, with mipmaps; 16 bits of `scale`, linear, row 0 at v = 0."""

    def __init__(self, values: Floats) -> None:
        # Under a coat a bright texture may give back more than 1.
        self.scale = max(1.0, float(values.max()))
        # Eight bits would make steps of 2 % where a surface reflects 20 %.
        counts = np.rint(values * (65535 / self.scale)).astype(np.uint16)
        self.id = _texture(GL.GL_R16, counts, GL.GL_UNSIGNED_SHORT)
        GL.glGenerateMipmap(GL.GL_TEXTURE_2D)
        _texture_parameters(GL.GL_LINEAR_MIPMAP_NEAREST, GL.GL_LINEAR, GL.GL_REPEAT)


def bind(unit: int, texture: Any, kind: int = GL.GL_TEXTURE_2D) -> None:
    """Let shaders sample a texture by a unit."""
    GL.glActiveTexture(unit)
    GL.glBindTexture(kind, texture)


def _texture(internal: int, values: NDArray[Any], kind: int) -> Any:
    texture = GL.glGenTextures(1)
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    rows, columns = values.shape
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal, columns, rows, 0, GL.GL_RED, kind, np.ascontiguousarray(values))
    return texture


def _texture_parameters(minify: int, magnify: int, wrap: int) -> None:
    for key, value in (
        (GL.GL_TEXTURE_MIN_FILTER, minify),
        (GL.GL_TEXTURE_MAG_FILTER, magnify),
        (GL.GL_TEXTURE_WRAP_S, wrap),
        (GL.GL_TEXTURE_WRAP_T, wrap),
    ):
        GL.glTexParameteri(GL.GL_TEXTURE_2D, key, value)


SHADERS = Path(__file__).parent / "shaders"
PASS_BINDING = 0  # as the shaders say


class Program:
    """Two linked shaders with some of their abilities.

    pyrender's own `set_uniform` asks for the location each time and hides every error.
    """

    def __init__(self, vertex: str, fragment: str, *defines: str) -> None:
        files = {"vertex_shader": str(SHADERS / f"{vertex}.vert"), "fragment_shader": str(SHADERS / f"{fragment}.frag")}
        shader = ShaderProgram(**files, defines=dict.fromkeys(sorted(defines), 1))
        try:
            shader._add_to_context()
        except Exception as error:  # PyOpenGL's, whichever stage fails
            reason = " ".join(str(error).split())[:200]
            raise RenderError(
                f"this OpenGL driver cannot run {fragment}.frag, which needs OpenGL 4.2 ({reason})"
            ) from error
        self._id = shader._program_id
        self._locations: dict[str, Any] = {}
        self._values: dict[str, float | bytes] = {}

    def use(self, **uniforms: float | Array) -> None:
        """Draw with this program from now on, with some of its uniforms: numbers, vectors (4,), matrices."""
        GL.glUseProgram(self._id)
        for name, value in uniforms.items():
            data = value if isinstance(value, int | float) else np.ascontiguousarray(value, np.float32)
            key = data.tobytes() if isinstance(data, np.ndarray) else data
            if self._values.get(name) != key:
                self._values[name] = key
                self._upload(name, data)

    def _upload(self, name: str, value: float | NDArray[np.float32]) -> None:
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


@dataclass(frozen=True, slots=True)
class Grid:
    """Where in a pixel samples lie, one a layer, and how many mipmap levels finer than OpenGL's each takes."""

    points: tuple[tuple[float, float], ...]
    lod_bias: tuple[float, ...]


# Four rows and four columns: an edge along either is placed to an eighth of a pixel.
# Each sample takes the one nearest mipmap level: by different choices, levels blend from one into the next.
TURNED = Grid(((0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)), (-2.875, -2.375, -2.625, -2.125))
# The same in two halves, each even about the centre, for sub-frames by turns.
HALVES = tuple(
    Grid((TURNED.points[a], TURNED.points[b]), (TURNED.lod_bias[a], TURNED.lod_bias[b])) for a, b in ((0, 3), (1, 2))
)
# For pictures of twice as many pixels each way.
CENTRE = Grid(((0.5, 0.5),), (-1.5,))


@dataclass(frozen=True, slots=True)
class Canvas:
    """A framebuffer with one layer a sample: one float channel and depth, as textures."""

    width_px: int
    height_px: int
    grid: Grid
    framebuffer: Any
    colour: Any
    depth: Any

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


def canvas(width_px: int, height_px: int, grid: Grid) -> Canvas:
    """A canvas of some size. Raises RenderError where the driver has no room or form for it."""
    framebuffer = GL.glGenFramebuffers(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    names = []
    for attachment, internal, form in (
        (GL.GL_COLOR_ATTACHMENT0, GL.GL_R32F, GL.GL_RED),
        (GL.GL_DEPTH_ATTACHMENT, GL.GL_DEPTH_COMPONENT32F, GL.GL_DEPTH_COMPONENT),
    ):
        names.append(GL.glGenTextures(1))
        GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, names[-1])
        size = (width_px, height_px, len(grid.points))
        GL.glTexImage3D(GL.GL_TEXTURE_2D_ARRAY, 0, internal, *size, 0, form, GL.GL_FLOAT, None)
        for filtering in (GL.GL_TEXTURE_MIN_FILTER, GL.GL_TEXTURE_MAG_FILTER):
            GL.glTexParameteri(GL.GL_TEXTURE_2D_ARRAY, filtering, GL.GL_NEAREST)
        GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, attachment, names[-1], 0)
    _require_complete(width_px, height_px)
    return Canvas(width_px, height_px, grid, framebuffer, *names)


@dataclass(frozen=True, slots=True)
class FlatTarget:
    """A framebuffer of one float sample a pixel, without depth: its texture can be sampled."""

    width_px: int
    height_px: int
    framebuffer: Any
    texture: Any

    @property
    def whole(self) -> Box:
        """The box of the whole picture."""
        return 0, self.width_px, 0, self.height_px

    def begin(self, box: Box) -> None:
        """Draw here from now on, within a box of the picture."""
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self.framebuffer)
        GL.glViewport(0, 0, self.width_px, self.height_px)
        _scissor(box, self.height_px)

    def clear(self, box: Box, value: float = 0.0) -> None:
        """One value all over a box, in which to draw from now on."""
        self.begin(box)
        GL.glClearBufferfv(GL.GL_COLOR, 0, [value, 0.0, 0.0, 0.0])

    def read(self, box: Box) -> Radiance:
        """A box of the picture (rows, columns) float32, top row first; an array of its own."""
        u0, u1, v0, v1 = box
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self.framebuffer)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        buffer = GL.glReadPixels(u0, self.height_px - v1, u1 - u0, v1 - v0, GL.GL_RED, GL.GL_FLOAT)
        # OpenGL's first row is the lowest; a copy, as OpenCV takes no array that runs backwards.
        return np.ascontiguousarray(np.frombuffer(buffer, np.float32).reshape(v1 - v0, u1 - u0)[::-1])


def flat_target(width_px: int, height_px: int, *, mipmaps: bool = False) -> FlatTarget:
    """A target of one channel, or of four with mipmaps. Raises RenderError where the driver has no such size."""
    internal, form = (GL.GL_RGBA32F, GL.GL_RGBA) if mipmaps else (GL.GL_R32F, GL.GL_RED)
    framebuffer, texture = GL.glGenFramebuffers(1), GL.glGenTextures(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, internal, width_px, height_px, 0, form, GL.GL_FLOAT, None)
    filters = (GL.GL_LINEAR_MIPMAP_LINEAR, GL.GL_LINEAR) if mipmaps else (GL.GL_NEAREST, GL.GL_NEAREST)
    _texture_parameters(*filters, GL.GL_CLAMP_TO_EDGE)
    GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, GL.GL_COLOR_ATTACHMENT0, texture, 0)
    _require_complete(width_px, height_px)
    return FlatTarget(width_px, height_px, framebuffer, texture)


def _scissor(box: Box, height_px: int) -> None:
    u0, u1, v0, v1 = box
    GL.glScissor(u0, height_px - v1, u1 - u0, v1 - v0)


def _require_complete(width_px: int, height_px: int) -> None:
    status = GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER)
    if status != GL.GL_FRAMEBUFFER_COMPLETE:
        raise RenderError(f"OpenGL has no float framebuffer of {width_px} x {height_px} pixels (status {status:#x})")
