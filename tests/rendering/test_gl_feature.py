"""A feature that the driver lacks is named in words."""

import pytest

pytest.importorskip("OpenGL.GL")

from OpenGL import GL

from vobench.rendering import gl_feature
from vobench.rendering.gl_feature import missing_features

pytestmark = pytest.mark.usefixtures("gl_context")


def test_the_driver_of_this_machine_lacks_nothing() -> None:
    assert missing_features() == []


def test_a_language_that_is_too_old_is_named_with_its_version(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl_feature, "OLDEST_GLSL", 99.0)
    (missing,) = missing_features()
    assert missing.startswith("GLSL 99.0 (it has 4.")


def test_extensions_that_are_missing_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl_feature, "SHADER_EXTENSIONS", ("GL_VOBENCH_a", "GL_VOBENCH_b"))
    assert missing_features() == ["GL_VOBENCH_a", "GL_VOBENCH_b"]


def test_framebuffers_are_tried_and_removed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl_feature, "COLOUR_FORMATS", ("GL_R32F",))
    monkeypatch.setattr(GL, "glCheckFramebufferStatus", lambda target: GL.GL_FRAMEBUFFER_UNSUPPORTED)
    assert missing_features() == ["a float framebuffer (GL_R32F)"]
    assert int(GL.glGetIntegerv(GL.GL_FRAMEBUFFER_BINDING)) == 0
