"""A uniform block lies in memory as numpy writes it and as the driver reads it."""

import ctypes

import numpy as np
import pytest
from OpenGL import GL
from OpenGL.GL import shaders

from vobench.rendering.context import create_context
from vobench.rendering.shader_program import shader_source
from vobench.rendering.uniform_block import BATCH, BLOCKS, PASS, Field, UniformBlock

MIXED = UniformBlock(
    "Mixed",
    "mixed",
    0,
    (
        Field("float", "first", "alone"),
        Field("vec3", "second", "aligned to 16 bytes"),
        Field("float", "third", "in the vector's last four bytes"),
        Field("vec4", "fourth", "an array", count=2),
        Field("mat4", "fifth", "four vectors"),
        Field("float", "sixth", "at the end"),
    ),
)


def test_std140_aligns_vectors_to_16_bytes_and_puts_a_float_behind_three() -> None:
    offsets = {name: MIXED.dtype.fields[name][1] for name in MIXED.dtype.names}
    assert offsets == {"first": 0, "second": 16, "third": 28, "fourth": 32, "fifth": 64, "sixth": 128}
    assert MIXED.dtype.itemsize == 144


def test_the_layout_of_a_block_is_computed_once() -> None:
    assert MIXED.dtype is MIXED.dtype


def test_the_declaration_names_every_field_once_in_order_with_its_length() -> None:
    lines = MIXED.declaration.split("\n")
    assert lines[0] == "layout(std140, binding = 0) uniform Mixed {"
    assert [line.split("//")[0].strip() for line in lines[1:-1]] == [
        "float first;",
        "vec3 second;",
        "float third;",
        "vec4 fourth[2];",
        "mat4 fifth;",
        "float sixth;",
    ]
    assert lines[-1] == "} mixed;"


@pytest.fixture(scope="module")
def program():
    """The surface shaders with all that reads their blocks, in a context of its own."""
    context = create_context()
    defines = ("HAS_GLOSS", "HAS_LIGHT", "HAS_METAL", "HAS_PROBE", "HAS_TEXTURE", "HAS_EMISSION", "IS_MIRRORED")
    GL.glBindVertexArray(GL.glGenVertexArrays(1))
    vertex = shaders.compileShader(shader_source("surface.vert", defines), GL.GL_VERTEX_SHADER)
    fragment = shaders.compileShader(shader_source("surface.frag", defines), GL.GL_FRAGMENT_SHADER)
    yield int(shaders.compileProgram(vertex, fragment))
    context.release()


@pytest.mark.parametrize("block", [PASS, BATCH], ids=["Pass", "Batch"])
def test_the_driver_reads_every_field_where_numpy_writes_it(program, block) -> None:
    for field in block.fields:
        name = f"{block.name}.{field.name}{'[0]' if field.count else ''}".encode()
        index = np.zeros(1, np.uint32)
        names = ctypes.cast((ctypes.c_char_p * 1)(name), ctypes.POINTER(ctypes.POINTER(ctypes.c_char)))
        GL.glGetUniformIndices(program, 1, names, index)
        assert index[0] != GL.GL_INVALID_INDEX, field.name
        offset = np.zeros(1, np.int32)
        GL.glGetActiveUniformsiv(program, 1, index, GL.GL_UNIFORM_OFFSET, offset)
        assert offset[0] == block.dtype.fields[field.name][1], field.name


def test_no_two_blocks_share_a_binding_or_an_instance() -> None:
    assert len({block.binding for block in BLOCKS.values()}) == len(BLOCKS)
    assert len({block.instance for block in BLOCKS.values()}) == len(BLOCKS)


def test_a_shader_has_its_defines_behind_the_version_and_its_blocks_declared() -> None:
    lines = shader_source("surface.vert", ("IS_PANE", "HAS_LIGHT")).split("\n")
    assert lines[0].startswith("#version")
    assert lines[1:3] == ["#define HAS_LIGHT 1", "#define IS_PANE 1"]
    assert "layout(std140, binding = 1) uniform Batch {" in lines
    assert not any(line.startswith("#include") for line in lines)
