"""A machine that cannot draw says so in one line, with the command that mends it."""

import ctypes.util
import os
import pkgutil
import subprocess
import sys

import pytest

import vobench.render
from vobench.errors import MissingDependencyError
from vobench.render import egl

# Hides X11's libraries, by name as ctypes finds them and by file as it loads them, then imports modules.
WITHOUT_X11 = """
import ctypes, ctypes.util, importlib, sys

def hidden(name):
    return "libX" in str(name) or str(name).startswith("X")

def refuse(self, name, *rest, load=ctypes.CDLL.__init__, **options):
    if hidden(name):
        raise OSError(f"{name}: cannot open shared object file")
    load(self, name, *rest, **options)

find = ctypes.util.find_library
ctypes.util.find_library = lambda name: None if hidden(name) else find(name)
ctypes.CDLL.__init__ = refuse
for module in sys.argv[1:]:
    importlib.import_module(module)
"""
MODULES = [module.name for module in pkgutil.iter_modules(vobench.render.__path__, "vobench.render.")]


def run_without_x11(*modules: str) -> subprocess.CompletedProcess[str]:
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYGLET", "PYOPENGL"))}
    command = [sys.executable, "-c", WITHOUT_X11, *modules]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_every_module_of_the_room_is_imported_without_a_library_of_x11() -> None:
    finished = run_without_x11(*MODULES)
    assert finished.returncode == 0, finished.stderr[-400:]


def test_a_machine_without_x11_is_told_from_one_with_it() -> None:
    finished = run_without_x11("pyglet.libs.x11.xlib")
    assert finished.returncode == 1
    assert "X11" in finished.stderr


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
