"""Libraries that drawing needs are found, and those that are missing are named."""

import ctypes.util

import pytest

from vobench.errors import MissingDependencyError
from vobench.rendering import gl_library


def test_only_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    find = ctypes.util.find_library
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None if name == "EGL" else find(name))
    assert gl_library.missing_libraries() == ["EGL"]


def test_a_library_that_is_no_library_is_missing_too(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    torn = tmp_path / "libEGL.so.1"
    torn.write_bytes(b"")
    find = ctypes.util.find_library
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: str(torn) if name == "EGL" else find(name))
    assert gl_library.missing_libraries() == ["EGL"]


def test_pyopengl_of_this_machine_has_what_drawing_calls() -> None:
    gl_library.require_pyopengl()


def test_a_function_that_pyopengl_lacks_is_named_with_its_version(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(gl_library.FUNCTIONS, "glTelepathy", "telepathy")
    with pytest.raises(MissingDependencyError, match=r"PyOpenGL [0-9.]+ has no glTelepathy; run: "):
        gl_library.require_pyopengl()


def test_an_error_of_pyopengl_is_its_function_and_code_and_any_other_is_its_text_in_one_line() -> None:
    def eglInitialize() -> None:
        """A function of EGL."""

    failed = RuntimeError("many arguments")
    failed.baseOperation = eglInitialize
    failed.err = 12289
    assert gl_library.error_reason(failed) == "eglInitialize failed with 12289"
    assert gl_library.error_reason(ValueError("two\n  lines")) == "ValueError: two lines"


def test_what_egl_reports_is_told_if_no_library_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    sentence = str(gl_library.cannot_draw(ValueError("broken"), " on device 3"))
    assert "EGL on device 3 reports ValueError: broken" in sentence
    monkeypatch.setattr(gl_library, "missing_libraries", lambda: ["EGL", "GL"])
    assert "missing libEGL, libGL" in str(gl_library.cannot_draw(ValueError("broken")))
