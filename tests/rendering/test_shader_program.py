"""Shader programs have their names defined, take uniforms, and are refused in one line."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("OpenGL.GL")

from OpenGL import GL

from vobench.errors import MissingDependencyError
from vobench.rendering import shader_program
from vobench.rendering.context import create_context
from vobench.rendering.framebuffer import framebuffer
from vobench.rendering.gl_library import SOFTWARE_REMEDY
from vobench.rendering.shader_program import ShaderProgram, shader_source

VERTEX_SHADER = """#version 410 core
void main() { gl_Position = vec4(vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) * 2.0 - 1.0, 0.0, 1.0); }"""
FRAGMENT_SHADER = """#version 410 core
uniform int count;
uniform float number;
uniform vec4 vector;
uniform mat3 small;
uniform mat4 large;
out vec4 colour;
void main() {
#ifdef IS_MATRIX
    colour = vec4((small * vec3(1.0, 0.0, 0.0)).xy, (large * vec4(1.0, 0.0, 0.0, 0.0)).xy);
#else
    colour = float(count) * number * vector;
#endif
}"""
MATRIX = np.array([[1.0, 0, 0, 0], [2.0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]])
SMALL = np.array([[3.0, 0, 0], [4.0, 0, 0], [0, 0, 0]])


@pytest.fixture(autouse=True)
def own_shaders(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    (tmp_path / "cover.vert").write_text(VERTEX_SHADER)
    (tmp_path / "uniforms.frag").write_text(FRAGMENT_SHADER)
    (tmp_path / "broken.frag").write_text("#version 410 core\nvoid main() { nonsense; }")
    monkeypatch.setattr(shader_program, "SHADERS", tmp_path)
    context = create_context()
    yield
    context.release()


def colour_by(program: ShaderProgram, **uniforms: Any) -> list[float]:
    """The three channels of a pixel that the program draws."""
    pixel = framebuffer(1, 1, channels=3)
    pixel.clear(pixel.whole)
    program.use(**uniforms)
    GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3)
    return pixel.read(pixel.whole).ravel().tolist()


def test_uniforms_have_the_values_that_they_were_set_to_last() -> None:
    program = ShaderProgram("cover", "uniforms")
    vector = np.array([1.0, 2.0, 3.0, 4.0])
    assert colour_by(program, count=2, number=0.5, vector=vector) == [1, 2, 3]
    assert colour_by(program, count=4) == [2, 4, 6]
    assert colour_by(program, count=4, number=2.0) == [8, 16, 24]


def test_matrices_are_given_by_rows_and_names_are_defined() -> None:
    program = ShaderProgram("cover", "uniforms", ["IS_MATRIX"])
    assert colour_by(program, small=SMALL, large=MATRIX) == [3, 4, 1]


def test_a_shader_that_does_not_compile_is_named_with_the_remedy() -> None:
    with pytest.raises(MissingDependencyError, match=r"cannot run broken\.frag") as caught:
        ShaderProgram("cover", "broken")
    assert str(caught.value).endswith(SOFTWARE_REMEDY)
    assert "\n" not in str(caught.value)


def test_a_source_has_its_names_behind_the_version_in_alphabetical_order() -> None:
    lines = shader_source("uniforms.frag", {"IS_TWO", "HAS_ONE"}).split("\n")
    assert lines[:3] == ["#version 410 core", "#define HAS_ONE 1", "#define IS_TWO 1"]
    assert "\n".join([lines[0], *lines[3:]]) == FRAGMENT_SHADER
