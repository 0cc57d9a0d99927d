"""Context managers that change the state of OpenGL and restore the state that all draw calls start from."""

from collections.abc import Iterator
from contextlib import contextmanager

from OpenGL import GL


def set_initial_state() -> None:
    """Set the state that all draw calls start from: reversed depth test, back faces culled, no blending."""
    for capability in (GL.GL_SCISSOR_TEST, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
        GL.glEnable(capability)
    # The depth buffer is reversed: it is 0 at infinity, and nearer surfaces have larger values; see `view`.
    GL.glClipControl(GL.GL_LOWER_LEFT, GL.GL_ZERO_TO_ONE)
    GL.glDepthFunc(GL.GL_GEQUAL)
    GL.glClearDepth(0.0)


@contextmanager
def blending(source_factor: int, destination_factor: int) -> Iterator[None]:
    """Add the drawn colours and the colours of the framebuffer, each multiplied by a factor of OpenGL."""
    GL.glEnable(GL.GL_BLEND)
    GL.glBlendFunc(source_factor, destination_factor)
    try:
        yield
    finally:
        GL.glDisable(GL.GL_BLEND)


@contextmanager
def disabled(capability: int) -> Iterator[None]:
    """Disable a capability that is enabled in the initial state."""
    GL.glDisable(capability)
    try:
        yield
    finally:
        GL.glEnable(capability)


@contextmanager
def without_depth_writes() -> Iterator[None]:
    """Leave the depth buffer as it is."""
    GL.glDepthMask(GL.GL_FALSE)
    try:
        yield
    finally:
        GL.glDepthMask(GL.GL_TRUE)


@contextmanager
def strictly_nearer() -> Iterator[None]:
    """Draw only fragments that are nearer than the depth buffer; those at the same depth are not drawn."""
    GL.glDepthFunc(GL.GL_GREATER)
    try:
        yield
    finally:
        GL.glDepthFunc(GL.GL_GEQUAL)
