"""An OpenGL context without a display: which device draws, and whether its driver has what drawing needs."""

import ctypes
import ctypes.util
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from vobench.errors import MissingDependencyError

DEVICE_VARIABLE = "VOBENCH_EGL_DEVICE"
EGL_PACKAGES = ("libegl1", "libgl1", "libopengl0", "libgl1-mesa-dri")
EGL_REMEDY = f"apt-get update && apt-get install -y {' '.join(EGL_PACKAGES)}"
PYOPENGL_REMEDY = f"{sys.executable} -m pip install 'PyOpenGL>=3.1.10'"
SOFTWARE_REMEDY = f"{EGL_REMEDY}, and set {DEVICE_VARIABLE}=cpu to draw with Mesa's software driver"

# Of the extensions EGL_EXT_platform_device, EGL_EXT_device_drm and EGL_EXT_device_query_name, which PyOpenGL lacks.
PLATFORM_DEVICE = 0x313F
DRM_DEVICE_FILE = 0x3233
RENDERER_NAME = 0x335F

# What each OpenGL function that drawing calls belongs to, as people look it up.
FUNCTIONS = {
    "glClipControl": "depth from 0 to 1",
    "glViewportIndexedf": "several viewports",
    "glDrawElementsInstanced": "instanced drawing",
    "glDrawArraysInstanced": "instanced drawing",
    "glBindBufferRange": "uniform blocks",
    "glFramebufferTexture": "layered framebuffers",
    "glTexImage3D": "texture arrays",
}
SHADER_EXTENSIONS = ("GL_ARB_shading_language_420pack", "GL_ARB_shader_viewport_layer_array")
OLDEST_GLSL = 4.1
COLOUR_FORMATS = ("GL_R32F", "GL_RGBA32F")


@dataclass(frozen=True, slots=True)
class EglDevice:
    """A device that EGL can draw with; its handle is None for the default display."""

    index: int
    name: str
    is_software: bool
    handle: Any = field(default=None, compare=False, repr=False)

    def __str__(self) -> str:
        kind = "CPU" if self.is_software else "GPU"
        return f"{self.index}: {self.name} ({kind})"


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
        self._display = _display(device)
        EGL.eglInitialize(self._display, EGL.EGLint(), EGL.EGLint())
        EGL.eglBindAPI(EGL.EGL_OPENGL_API)
        config = _config(self._display)
        try:
            self._context = EGL.eglCreateContext(self._display, config, EGL.EGL_NO_CONTEXT, _attributes())
        except EGL.EGLError as error:
            cause = f"device {device} has no OpenGL 4.1 core context ({_reason(error)})"
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
    _require_pyopengl()
    try:
        candidates = ordered(devices(), os.environ.get(DEVICE_VARIABLE, ""))
    except MissingDependencyError:
        raise
    except Exception as error:  # PyOpenGL fails with whatever it trips over first
        raise _cannot_draw(error) from error

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
    return _cannot_draw(error, f" on device {device}")


def _cannot_draw(error: Exception, where: str = "") -> MissingDependencyError:
    missing = missing_libraries()
    cause = f"missing lib{', lib'.join(missing)}" if missing else f"EGL{where} reports {_reason(error)}"
    return MissingDependencyError(f"cannot draw without a display ({cause}); run: {EGL_REMEDY}")


def _reason(error: Exception) -> str:
    """An error in one line: of PyOpenGL's, which print their arguments, the function that failed and its code."""
    function = getattr(getattr(error, "baseOperation", None), "__name__", None)
    code = getattr(error, "err", None)
    if function and code is not None:
        return f"{function} failed with {getattr(code, 'name', code)}"
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def missing_libraries() -> list[str]:
    """Names of the system libraries that drawing needs and this machine lacks."""
    return [name for name in ("EGL", "GL", "OpenGL") if not _loads(name)]


def _loads(library: str) -> bool:
    """Whether a system library is there, and one that this process can load."""
    file = ctypes.util.find_library(library)
    if file is None:
        return False
    try:
        ctypes.CDLL(file)
    except OSError:
        return False
    return True


def _require_pyopengl() -> None:
    """Raise MissingDependencyError where PyOpenGL is missing, broken on this Python, or without what drawing calls."""
    try:
        from OpenGL import GL
    except Exception as error:  # old releases break in many ways, and missing libraries look like it
        if missing_libraries():
            raise _cannot_draw(error) from error
        raise MissingDependencyError(
            f"cannot draw: PyOpenGL {_pyopengl_version()} cannot be imported ({_reason(error)}); run: {PYOPENGL_REMEDY}"
        ) from error
    absent = [name for name in FUNCTIONS if not hasattr(GL, name)]
    if absent:
        raise MissingDependencyError(
            f"cannot draw: PyOpenGL {_pyopengl_version()} has no {', '.join(absent)}; run: {PYOPENGL_REMEDY}"
        )


def _pyopengl_version() -> str:
    try:
        return version("PyOpenGL")
    except PackageNotFoundError:
        return "(not installed)"


def missing_features() -> list[str]:
    """The features that drawing needs and the driver of the current context lacks, each in words."""
    from OpenGL import GL

    lacking = [f"{name} ({purpose})" for name, purpose in FUNCTIONS.items() if not bool(getattr(GL, name))]
    language = GL.glGetString(GL.GL_SHADING_LANGUAGE_VERSION).decode("ascii", "replace")
    if float(language.split()[0]) < OLDEST_GLSL:
        lacking.append(f"GLSL {OLDEST_GLSL} (it has {language})")
    count = int(GL.glGetIntegerv(GL.GL_NUM_EXTENSIONS))
    extensions = {GL.glGetStringi(GL.GL_EXTENSIONS, index).decode("ascii", "replace") for index in range(count)}
    lacking += [name for name in SHADER_EXTENSIONS if name not in extensions]
    if lacking:
        return lacking
    return [f"a float framebuffer ({name})" for name in COLOUR_FORMATS if not _completes(getattr(GL, name))]


def _completes(colour_format: int) -> bool:
    """Whether a framebuffer of two layers with a colour format and float depth can be drawn into."""
    from OpenGL import GL

    framebuffer = GL.glGenFramebuffers(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    attachments = (
        (GL.GL_COLOR_ATTACHMENT0, colour_format, GL.GL_RED),
        (GL.GL_DEPTH_ATTACHMENT, GL.GL_DEPTH_COMPONENT32F, GL.GL_DEPTH_COMPONENT),
    )
    textures = []
    for attachment, internal, form in attachments:
        texture = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, texture)
        GL.glTexImage3D(GL.GL_TEXTURE_2D_ARRAY, 0, internal, 4, 4, 2, 0, form, GL.GL_FLOAT, None)
        GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, attachment, texture, 0)
        textures.append(texture)
    status = GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, 0)
    GL.glDeleteFramebuffers(1, [framebuffer])
    GL.glDeleteTextures(textures)
    return bool(status == GL.GL_FRAMEBUFFER_COMPLETE)


def _forget_driver() -> None:
    """Let PyOpenGL ask the next driver what it can do: it asks once per process by itself."""
    from OpenGL.extensions import GLQuerier

    GLQuerier.version = None
    GLQuerier.extensions = None


def ordered(found: Sequence[EglDevice], wanted: str) -> list[EglDevice]:
    """The devices to try, in order: what VOBENCH_EGL_DEVICE asks for, or the CPU before GPUs.

    Mesa draws the same bytes on every machine. A GPU's pictures differ from them by a grey value here and there.

    wanted: "" for all, "cpu", "gpu", or a device's index.

    Raises MissingDependencyError where no such device is listed.
    """
    match wanted.strip().lower():
        case "":
            return sorted(found, key=lambda device: not device.is_software)
        case "cpu":
            chosen = [device for device in found if device.is_software]
        case "gpu":
            chosen = [device for device in found if not device.is_software]
        case index:
            chosen = [device for device in found if str(device.index) == index]
    if not chosen:
        raise MissingDependencyError(
            f"{DEVICE_VARIABLE} should be cpu, gpu or the number of a device, got {wanted!r}; "
            f"EGL lists {listed(found)}; run: unset {DEVICE_VARIABLE}"
        )
    return chosen


def listed(found: Iterable[EglDevice]) -> str:
    """Devices in one line."""
    return ", ".join(map(str, found)) or "none"


def devices() -> list[EglDevice]:
    """All devices that EGL lists, in its order; the default display where it cannot list them."""
    query = _egl_function("eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    query_string = _egl_function("eglQueryDeviceStringEXT", ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)
    if query is None or query_string is None:
        return [EglDevice(0, "default display", is_software=False)]

    count = ctypes.c_int()
    query(0, None, ctypes.byref(count))
    handles = (ctypes.c_void_p * count.value)()
    query(count.value, handles, ctypes.byref(count))
    return [_described(index, handle, query_string) for index, handle in enumerate(handles[: count.value])]


def _described(
    index: int,
    handle: int | None,
    query_string: Any,
) -> EglDevice:
    from OpenGL import EGL

    words = (query_string(handle, EGL.EGL_EXTENSIONS) or b"").decode("ascii", "replace").split()
    is_software = "EGL_MESA_device_software" in words
    names = []
    if "EGL_EXT_device_query_name" in words:
        names.append(query_string(handle, RENDERER_NAME))
    if "EGL_EXT_device_drm" in words:
        names.append(query_string(handle, DRM_DEVICE_FILE))
    known = [name.decode("utf-8", "replace") for name in names if name]
    unnamed = "Mesa software driver" if is_software else "unnamed device"
    return EglDevice(index, " ".join(known) or unnamed, is_software, handle)


def _display(device: EglDevice) -> Any:
    """The EGL display of a device, the same for every context of the process."""
    from OpenGL import EGL

    if device.handle is None:
        return EGL.eglGetDisplay(EGL.EGL_DEFAULT_DISPLAY)
    get_display = _egl_function(
        "eglGetPlatformDisplayEXT", EGL.EGLDisplay, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p
    )
    if get_display is None:
        raise RuntimeError("EGL has no eglGetPlatformDisplayEXT")
    return get_display(PLATFORM_DEVICE, device.handle, None)


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


def _egl_function(name: str, result: Any, *arguments: Any) -> Any:
    """A function of an EGL extension, None where EGL has none of that name."""
    from OpenGL import EGL

    address = EGL.eglGetProcAddress(name.encode())
    if not address:
        return None
    pointer = ctypes.cast(address, ctypes.c_void_p).value
    return ctypes.CFUNCTYPE(result, *arguments)(pointer or 0)


@cache
def driver_facts() -> DriverFacts:
    """The driver that draws in this process, as plain data; a context lives as long as the call.

    Raises MissingDependencyError where this machine cannot draw.
    """
    context = create_context()
    facts = context.facts()
    context.release()
    return facts
