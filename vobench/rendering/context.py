"""OpenGL contexts without a display, on the first device whose driver has what drawing needs."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from vobench.errors import MissingDependencyError
from vobench.rendering.egl_device import DEVICE_VARIABLE, EglDevice, devices, display_of, ordered
from vobench.rendering.gl_feature import missing_features
from vobench.rendering.gl_library import (
    SOFTWARE_REMEDY,
    cannot_draw,
    error_reason,
    require_pyopengl,
)


@dataclass(frozen=True, slots=True)
class DriverFacts:
    """The driver that draws pictures in this process: OpenGL's renderer, version and vendor, and EGL's device."""

    renderer: str
    version: str
    vendor: str
    device: str

    @property
    def name(self) -> str:
        """Renderer and driver in one line, such as `llvmpipe (LLVM 19.1.7, 256 bits), Mesa 25.0.7`.

        A version as in `4.5 (Core Profile) Mesa 25.0.7-2` or `4.6.0 NVIDIA 550.54` ends with the driver's own.
        """
        words = self.version.split()[1:]
        driver = " ".join(word for word in words if not word.startswith("(") and not word.endswith(")"))
        return f"{self.renderer}, {driver}" if driver else self.renderer


class Context:
    """An OpenGL context on a device, current in the thread that creates it.

    It owns the context alone. The display belongs to all contexts of the process and is never ended.
    """

    def __init__(self, device: EglDevice) -> None:
        from OpenGL import EGL

        self.device = device
        self._display = display_of(device)
        EGL.eglInitialize(self._display, EGL.EGLint(), EGL.EGLint())
        EGL.eglBindAPI(EGL.EGL_OPENGL_API)
        config = _config(self._display)
        try:
            self._context = EGL.eglCreateContext(self._display, config, EGL.EGL_NO_CONTEXT, _attributes())
        except EGL.EGLError as error:
            cause = f"device {device} has no OpenGL 4.1 core context ({error_reason(error)})"
            raise MissingDependencyError(f"cannot draw: {cause}; run: {SOFTWARE_REMEDY}") from error
        self.make_current()

    def make_current(self) -> None:
        """Let OpenGL calls of this thread draw here."""
        from OpenGL import EGL

        EGL.eglMakeCurrent(self._display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, self._context)

    def release(self) -> None:
        """Free the context and all that was created in it."""
        from OpenGL import EGL

        EGL.eglMakeCurrent(self._display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, EGL.EGL_NO_CONTEXT)
        EGL.eglDestroyContext(self._display, self._context)

    def facts(self) -> DriverFacts:
        """The driver of the context, which must be current."""
        from OpenGL import GL

        renderer, gl_version, vendor = (
            GL.glGetString(name).decode("utf-8", "replace") for name in (GL.GL_RENDERER, GL.GL_VERSION, GL.GL_VENDOR)
        )
        return DriverFacts(renderer, gl_version, vendor, str(self.device))


def create_context() -> Context:
    """A current context on the first device that can draw, in the order of `ordered`.

    Raises MissingDependencyError, with the cause and its remedy in one line, where there is none.
    """
    require_pyopengl()
    try:
        candidates = ordered(devices(), os.environ.get(DEVICE_VARIABLE, ""))
    except MissingDependencyError:
        raise
    except Exception as error:  # PyOpenGL fails with whatever it trips over first
        raise cannot_draw(error) from error

    failures = list[tuple[EglDevice, Exception]]()
    for device in candidates:
        try:
            return _capable_context(device)
        except Exception as error:  # a driver may fail with anything; the next device may work
            failures.append((device, error))
    raise _no_device(failures) from failures[-1][1]


def _capable_context(device: EglDevice) -> Context:
    """A context on a device. Raises MissingDependencyError where its driver lacks something that drawing needs."""
    context = Context(device)
    missing = missing_features()
    if missing:
        facts = context.facts()
        context.release()
        _forget_driver()
        driver = f"{facts.renderer}, OpenGL {facts.version}"
        raise MissingDependencyError(f"cannot draw: {driver}, lacks {', '.join(missing)}; run: {SOFTWARE_REMEDY}")
    return context


def _no_device(failures: Sequence[tuple[EglDevice, Exception]]) -> MissingDependencyError:
    """The error where every device failed: the last one's, which is the software device where there is one."""
    device, error = failures[-1]
    if isinstance(error, MissingDependencyError):
        return error
    return cannot_draw(error, f" on device {device}")


def _forget_driver() -> None:
    """Let PyOpenGL ask the next driver what it can do: it asks once per process by itself."""
    from OpenGL.extensions import GLQuerier

    GLQuerier.version = None
    GLQuerier.extensions = None


def _config(display: Any) -> Any:
    """A configuration of 8 bits a colour and 24 of depth, of which only the API matters: pictures are textures."""
    from OpenGL import EGL

    wanted = (EGL.EGLint * 13)(
        *(EGL.EGL_SURFACE_TYPE, EGL.EGL_PBUFFER_BIT),
        *(EGL.EGL_RED_SIZE, 8, EGL.EGL_GREEN_SIZE, 8, EGL.EGL_BLUE_SIZE, 8),
        *(EGL.EGL_DEPTH_SIZE, 24),
        *(EGL.EGL_RENDERABLE_TYPE, EGL.EGL_OPENGL_BIT),
        EGL.EGL_NONE,
    )
    configs = (EGL.EGLConfig * 1)()
    count = EGL.EGLint()
    EGL.eglChooseConfig(display, wanted, configs, 1, count)
    if not count.value:
        raise RuntimeError("eglChooseConfig found no configuration for OpenGL")
    return configs[0]


def _attributes() -> Any:
    """OpenGL 4.1, core profile; drivers give the newest version that has it."""
    from OpenGL import EGL

    return (EGL.EGLint * 7)(
        *(EGL.EGL_CONTEXT_MAJOR_VERSION, 4),
        *(EGL.EGL_CONTEXT_MINOR_VERSION, 1),
        *(EGL.EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL.EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT),
        EGL.EGL_NONE,
    )


@cache
def driver_facts() -> DriverFacts:
    """The driver that draws in this process, as plain data; a context lives as long as the call.

    Raises MissingDependencyError where this machine cannot draw.
    """
    context = create_context()
    facts = context.facts()
    context.release()
    return facts
