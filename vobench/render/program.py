"""Shader programs of pyrender's cache, with their uniforms looked up once."""

from pathlib import Path
from typing import Any

import numpy as np
from OpenGL import GL
from pyrender.shader_program import ShaderProgramCache

from vobench.errors import RenderError
from vobench.geometry.se3 import Array

SHADERS = Path(__file__).parent / "shaders"
PASS_BINDING = 0  # as the shaders say


class Program:
    """One linked program. pyrender's own `set_uniform` asks for the location each time and hides every error."""

    def __init__(self, cache: ShaderProgramCache, vertex: str, fragment: str, defines: frozenset[str]) -> None:
        shader = cache.get_program(vertex, fragment, defines=dict.fromkeys(sorted(defines), 1))
        try:
            shader._add_to_context()
        except Exception as error:  # PyOpenGL's, whichever stage fails
            reason = " ".join(str(error).split())[:200]
            raise RenderError(f"this OpenGL driver cannot run {fragment}, which needs OpenGL 4.2 ({reason})") from error
        self._id = shader._program_id
        self._locations: dict[str, Any] = {}
        self._numbers: dict[str, float] = {}
        self._vectors: dict[str, bytes] = {}
        self._matrices: dict[str, Array] = {}

    def use(self) -> None:
        """Draw with this program from now on."""
        GL.glUseProgram(self._id)

    def number(self, name: str, value: float) -> None:
        """Set a float of the program in use, where it has another one; it may be none that its shaders need."""
        if self._numbers.get(name) != value:
            self._numbers[name] = value
            GL.glUniform1f(self._location(name), value)

    def count(self, name: str, value: int) -> None:
        """Set an integer of the program in use."""
        GL.glUniform1i(self._location(name), value)

    def vector(self, name: str, value: Array) -> None:
        """Set a vector (4,) of the program in use, where it has another one."""
        data = np.ascontiguousarray(value, np.float32)
        if self._vectors.get(name) != (key := data.tobytes()):
            self._vectors[name] = key
            GL.glUniform4fv(self._location(name), 1, data)

    def matrix(self, name: str, value: Array) -> None:
        """Set a matrix (3, 3) or (4, 4) of the program in use; the very array that is there already costs nothing."""
        if self._matrices.get(name) is value:
            return
        self._matrices[name] = value
        upload = GL.glUniformMatrix4fv if len(value) == 4 else GL.glUniformMatrix3fv
        upload(self._location(name), 1, GL.GL_TRUE, np.ascontiguousarray(value, np.float32))

    def _location(self, name: str) -> Any:
        if name not in self._locations:
            self._locations[name] = GL.glGetUniformLocation(self._id, name)
        return self._locations[name]


class Programs:
    """All programs of one context, each linked when it is first needed."""

    def __init__(self) -> None:
        self._cache = ShaderProgramCache(shader_dir=str(SHADERS))
        self._known: dict[tuple[str, str, frozenset[str]], Program] = {}

    def surface(self, *abilities: str) -> Program:
        """What draws surfaces, with some of its abilities."""
        return self._get("surface", "surface", *abilities)

    def haze(self, *abilities: str) -> Program:
        """What spreads a mirror's picture."""
        return self._get("surface", "haze", *abilities)

    def background(self) -> Program:
        """What draws the skies."""
        return self._get("background", "background")

    def mean(self) -> Program:
        """What averages samples."""
        return self._get("whole", "mean")

    def settle(self) -> Program:
        """What makes a smooth picture of a mirror's samples."""
        return self._get("surface", "settle")

    def delete(self) -> None:
        """Free them on the graphics side."""
        self._cache.clear()
        self._known.clear()

    def _get(self, vertex: str, fragment: str, *abilities: str) -> Program:
        key = vertex, fragment, frozenset(abilities)
        if key not in self._known:
            self._known[key] = Program(self._cache, f"{vertex}.vert", f"{fragment}.frag", key[2])
        return self._known[key]
