"""OpenGL shader programs: they are compiled from the files in `shaders`, and take uniforms."""

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL
from OpenGL.GL import shaders

from vobench.errors import MissingDependencyError
from vobench.geometry.se3 import Array
from vobench.rendering.gl_library import SOFTWARE_REMEDY
from vobench.rendering.uniform_block import BLOCKS

SHADERS = Path(__file__).parent / "shaders"
MOST_REASON_CHARACTERS = 200  # of the driver's log in an error message


class ShaderProgram:
    """A vertex and a fragment shader, compiled with some preprocessor names defined, and linked.

    Raises MissingDependencyError if the driver cannot compile or link them.
    """

    def __init__(
        self,
        vertex: str,
        fragment: str,
        defines: Collection[str] = (),
    ) -> None:
        # Core contexts validate a program against the bound vertex array, so there must be one.
        GL.glBindVertexArray(GL.glGenVertexArrays(1))
        try:
            vertex_shader = shaders.compileShader(shader_source(f"{vertex}.vert", defines), GL.GL_VERTEX_SHADER)
            fragment_shader = shaders.compileShader(shader_source(f"{fragment}.frag", defines), GL.GL_FRAGMENT_SHADER)
            self._id = shaders.compileProgram(vertex_shader, fragment_shader)
        except Exception as error:  # PyOpenGL's, whichever stage fails
            reason = " ".join(str(error).split())[:MOST_REASON_CHARACTERS]
            raise MissingDependencyError(
                f"cannot draw: this OpenGL driver cannot run {fragment}.frag ({reason}); run: {SOFTWARE_REMEDY}"
            ) from error
        self._locations: dict[str, Any] = {}
        self._uploaded: dict[str, float | bytes] = {}

    def use(self, **uniforms: float | Array) -> None:
        """Make this the current program, and set uniforms: numbers, vectors (4,), matrices (3, 3) or (4, 4)."""
        GL.glUseProgram(self._id)
        for name, value in uniforms.items():
            data = value if isinstance(value, int | float) else np.ascontiguousarray(value, np.float32)
            key = data.tobytes() if isinstance(data, np.ndarray) else data
            if self._uploaded.get(name) != key:
                self._uploaded[name] = key
                self._upload(name, data)

    def _upload(
        self,
        name: str,
        value: float | NDArray[np.float32],
    ) -> None:
        """Set a uniform of the current program."""
        if name not in self._locations:
            self._locations[name] = GL.glGetUniformLocation(self._id, name)
        location = self._locations[name]
        if isinstance(value, int):
            GL.glUniform1i(location, value)
        elif isinstance(value, float):
            GL.glUniform1f(location, value)
        elif value.ndim == 1:
            GL.glUniform4fv(location, 1, value)
        elif len(value) == 4:
            GL.glUniformMatrix4fv(location, 1, GL.GL_TRUE, value)
        else:
            GL.glUniformMatrix3fv(location, 1, GL.GL_TRUE, value)


def shader_source(file_name: str, defines: Collection[str]) -> str:
    """The text of a shader file with preprocessor names defined and uniform blocks declared.

    The names follow the first line, which is that of the version. A line `#include <Pass>` is replaced by the
    declaration of the uniform block of that name.
    """
    version, body = (SHADERS / file_name).read_text(encoding="utf-8").split("\n", 1)
    for block in BLOCKS.values():
        body = body.replace(f"#include <{block.name}>", block.declaration)
    lines = [f"#define {define} 1" for define in sorted(defines)]
    return "\n".join([version, *lines, body])
