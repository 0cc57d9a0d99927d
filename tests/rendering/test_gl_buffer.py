"""Vertex arrays draw the triangles that they are asked for, and uniform buffers give shaders one of their values."""

import numpy as np
import pytest

pytest.importorskip("OpenGL.GL")

from OpenGL import GL
from OpenGL.GL import shaders

from vobench.rendering.framebuffer import Framebuffer, framebuffer
from vobench.rendering.gl_buffer import UniformBuffer, VertexArray

BINDING = 3
VERTEX_SHADER = """#version 410 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec2 uv_light;
out float value;
void main() {
    gl_Position = vec4(position, 1.0);
    value = normal.z + uv.y + uv_light.y + 100.0 * float(gl_InstanceID);
}"""
FRAGMENT_SHADER = f"""#version 410 core
#extension GL_ARB_shading_language_420pack : require
layout(std140, binding = {BINDING}) uniform Offset {{ float offset; }};
in float value;
out vec4 colour;
void main() {{ colour = vec4(value + offset); }}"""

# Two triangles over the left and the right half of the picture, with 10 attributes in each vertex.
LEFT = [[-3, -3], [0, -3], [0, 3]]
RIGHT = [[0, -3], [3, -3], [0, 3]]
NORMAL_Z = 1.0
UV_Y = 2.0
LIGHT_V = 4.0
ALL = NORMAL_Z + UV_Y + LIGHT_V
OFFSETS = np.array([10.0, 20.0], np.float32).view([("offset", np.float32)])


@pytest.fixture(autouse=True, scope="module")
def program(gl_context: None) -> None:
    GL.glBindVertexArray(GL.glGenVertexArrays(1))
    vertex = shaders.compileShader(VERTEX_SHADER, GL.GL_VERTEX_SHADER)
    fragment = shaders.compileShader(FRAGMENT_SHADER, GL.GL_FRAGMENT_SHADER)
    GL.glUseProgram(shaders.compileProgram(vertex, fragment))


@pytest.fixture
def picture() -> Framebuffer:
    picture = framebuffer(2, 1, channels=1)
    picture.clear(picture.whole)
    return picture


@pytest.fixture
def triangles() -> VertexArray:
    corners = np.array([*LEFT, *RIGHT], np.float32)
    vertices = np.zeros((6, 10), np.float32)
    vertices[:, :2] = corners
    vertices[:, 5] = NORMAL_Z
    vertices[:, 7] = UV_Y
    vertices[:, 9] = LIGHT_V
    return VertexArray(vertices, np.arange(6, dtype=np.uint32))


def values(picture: Framebuffer) -> list[float]:
    return picture.read(picture.whole).ravel().tolist()


def test_each_attribute_arrives_at_its_location(picture: Framebuffer, triangles: VertexArray) -> None:
    UniformBuffer(BINDING, OFFSETS).use(0)
    triangles.draw([(0, 6)], instances=1)
    assert values(picture) == [ALL + 10, ALL + 10]


def test_only_the_runs_are_drawn(picture: Framebuffer, triangles: VertexArray) -> None:
    UniformBuffer(BINDING, OFFSETS).use(0)
    triangles.draw([(3, 3)], instances=1)
    assert values(picture) == [0, ALL + 10]


def test_instances_are_numbered(picture: Framebuffer, triangles: VertexArray) -> None:
    UniformBuffer(BINDING, OFFSETS).use(0)
    triangles.draw([(0, 3)], instances=3)
    assert values(picture) == [ALL + 200 + 10, 0]


def test_shaders_read_the_value_in_use_and_its_last_update(picture: Framebuffer, triangles: VertexArray) -> None:
    buffer = UniformBuffer(BINDING, OFFSETS)
    buffer.update(0, np.array(30.0, np.float32).view([("offset", np.float32)]))
    buffer.use(1)
    triangles.draw([(0, 3)], instances=1)
    buffer.use(0)
    triangles.draw([(3, 3)], instances=1)
    assert values(picture) == [ALL + 20, ALL + 30]
