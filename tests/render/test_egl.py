"""A machine that cannot draw says so in one line, with the command that mends it."""

import ctypes.util
import sys

import pytest

from vobench.errors import MissingDependencyError
from vobench.render import egl


def test_missing_libraries_are_named_with_the_line_that_installs_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None)
    monkeypatch.setitem(sys.modules, "pyrender.platforms.egl", None)
    with pytest.raises(MissingDependencyError) as caught:
        egl.context()
    message = str(caught.value)
    assert "missing libEGL, libGL, libOpenGL" in message
    assert message.endswith(egl.EGL_REMEDY)
    assert "\n" not in message


def test_only_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None if name == "EGL" else f"lib{name}.so.1")
    assert egl.missing_libraries() == ["EGL"]


def test_a_driver_that_fails_is_one_line_too(monkeypatch: pytest.MonkeyPatch) -> None:
    from pyrender.platforms.egl import EGLPlatform

    def fail(self: object) -> None:
        raise AssertionError("eglInitialize\n\treturned 0")

    monkeypatch.setattr(EGLPlatform, "init_context", fail)
    with pytest.raises(
        MissingDependencyError, match=r"EGL says AssertionError: eglInitialize returned 0\); run: apt-get"
    ):
        egl.context()


def test_a_machine_that_can_draw_lacks_nothing() -> None:
    assert egl.missing_libraries() == []
    egl.release(egl.context())
