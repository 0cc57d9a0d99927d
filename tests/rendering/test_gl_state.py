"""Every change of OpenGL's state is undone, also after an error."""

from collections.abc import Callable
from contextlib import AbstractContextManager

import pytest

pytest.importorskip("OpenGL.GL")

from OpenGL import GL

from vobench.rendering.gl_state import blending, disabled, set_initial_state, strictly_nearer, without_depth_writes

CAPABILITIES = (GL.GL_BLEND, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE, GL.GL_SCISSOR_TEST)
CHANGES: dict[str, Callable[[], AbstractContextManager[None]]] = {
    "blending": lambda: blending(GL.GL_ONE, GL.GL_ONE),
    "without a depth test": lambda: disabled(GL.GL_DEPTH_TEST),
    "both sides": lambda: disabled(GL.GL_CULL_FACE),
    "no depth writes": without_depth_writes,
    "strictly nearer": strictly_nearer,
}


@pytest.fixture(autouse=True, scope="module")
def initial_state(gl_context: None) -> None:
    set_initial_state()


def state() -> dict[str, object]:
    capabilities = {str(capability): bool(GL.glIsEnabled(capability)) for capability in CAPABILITIES}
    depth_mask = bool(GL.glGetBooleanv(GL.GL_DEPTH_WRITEMASK))
    return {**capabilities, "depth mask": depth_mask, "depth function": int(GL.glGetIntegerv(GL.GL_DEPTH_FUNC))}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_a_change_lasts_as_long_as_its_block(change: Callable[[], AbstractContextManager[None]]) -> None:
    before = state()
    with change():
        assert state() != before
    assert state() == before


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_an_error_restores_the_state_too(change: Callable[[], AbstractContextManager[None]]) -> None:
    before = state()
    with pytest.raises(ZeroDivisionError), change():
        raise ZeroDivisionError
    assert state() == before
