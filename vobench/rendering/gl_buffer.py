"""OpenGL buffers: vertex arrays and uniform buffers."""

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from OpenGL import GL

# The components of each vertex attribute, by its location in the vertex shader: position, normal, texture coordinates,
# coordinates on the light map.
ATTRIBUTE_COMPONENTS = (3, 3, 2, 2)
FLOAT_BYTES = 4
INDEX_BYTES = 4


class VertexArray:
    """A vertex array object with a vertex buffer and an index buffer.

    vertices: (V, 10), the attributes of each vertex one after the other. indices: (N,), three for each triangle.
    """

    def __init__(
        self,
        vertices: NDArray[np.float32],
        indices: NDArray[np.uint32],
    ) -> None:
        self._id = GL.glGenVertexArrays(1)
        GL.glBindVertexArray(self._id)
        _create_buffer(GL.GL_ARRAY_BUFFER, vertices)
        _create_buffer(GL.GL_ELEMENT_ARRAY_BUFFER, indices)
        vertex_bytes = vertices.strides[0]
        components_before = 0
        for location, components in enumerate(ATTRIBUTE_COMPONENTS):
            offset = ctypes.c_void_p(FLOAT_BYTES * components_before)
            GL.glEnableVertexAttribArray(location)
            GL.glVertexAttribPointer(location, components, GL.GL_FLOAT, GL.GL_FALSE, vertex_bytes, offset)
            components_before += components

    def draw(self, runs: Sequence[tuple[int, int]], instances: int) -> None:
        """Draw triangles with the current program: runs (first, count) of indices, each in a number of instances."""
        GL.glBindVertexArray(self._id)
        for first, count in runs:
            offset = ctypes.c_void_p(INDEX_BYTES * first)
            GL.glDrawElementsInstanced(GL.GL_TRIANGLES, count, GL.GL_UNSIGNED_INT, offset, instances)


def _create_buffer(
    target: int,
    values: NDArray[np.float32] | NDArray[np.uint32],
) -> None:
    """Create a buffer that never changes, and leave it bound."""
    GL.glBindBuffer(target, GL.glGenBuffers(1))
    GL.glBufferData(target, values.nbytes, values, GL.GL_STATIC_DRAW)


class UniformBuffer:
    """A buffer with several values (B,) of a uniform block. Shaders read the value that was bound last."""

    def __init__(self, binding: int, values: NDArray[np.void]) -> None:
        self._binding = binding
        self._size = values.dtype.itemsize
        alignment = int(GL.glGetIntegerv(GL.GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT))
        aligned_units = -(-self._size // alignment)  # rounded up
        self._stride = aligned_units * alignment
        self._id = GL.glGenBuffers(1)
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._id)
        GL.glBufferData(GL.GL_UNIFORM_BUFFER, self._stride * len(values), None, GL.GL_DYNAMIC_DRAW)
        for index, value in enumerate(values):
            self.update(index, value)

    def update(
        self,
        index: int,
        value: np.void | NDArray[np.void],
    ) -> None:
        """Upload the value at an index."""
        GL.glBindBuffer(GL.GL_UNIFORM_BUFFER, self._id)
        GL.glBufferSubData(GL.GL_UNIFORM_BUFFER, index * self._stride, self._size, value.tobytes())

    def use(self, index: int) -> None:
        """Bind the value at an index to the uniform block."""
        offset = index * self._stride
        GL.glBindBufferRange(GL.GL_UNIFORM_BUFFER, self._binding, self._id, offset, self._size)
