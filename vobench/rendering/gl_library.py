"""What drawing needs to be installed: the system libraries of OpenGL and EGL, and PyOpenGL."""

import ctypes
import ctypes.util
import sys
from importlib.metadata import PackageNotFoundError, version

from vobench.errors import MissingDependencyError
from vobench.rendering.egl_device import DEVICE_VARIABLE

EGL_PACKAGES = ("libegl1", "libgl1", "libopengl0", "libgl1-mesa-dri")
EGL_REMEDY = f"apt-get update && apt-get install -y {' '.join(EGL_PACKAGES)}"
PYOPENGL_REMEDY = f"{sys.executable} -m pip install 'PyOpenGL>=3.1.10'"
SOFTWARE_REMEDY = f"{EGL_REMEDY}, and set {DEVICE_VARIABLE}=cpu to draw with Mesa's software driver"

# The functions of OpenGL that drawing calls, and the features that they belong to, as people look them up.
FUNCTIONS = {
    "glClipControl": "depth from 0 to 1",
    "glViewportIndexedf": "several viewports",
    "glDrawElementsInstanced": "instanced drawing",
    "glDrawArraysInstanced": "instanced drawing",
    "glBindBufferRange": "uniform blocks",
    "glFramebufferTexture": "layered framebuffers",
    "glTexImage3D": "texture arrays",
}
LIBRARIES = ("EGL", "GL", "OpenGL")


def missing_libraries() -> list[str]:
    """The names of the system libraries that drawing needs and this machine lacks."""
    return [name for name in LIBRARIES if not _loads(name)]


def _loads(library: str) -> bool:
    """Whether a system library exists, and this process can load it."""
    file = ctypes.util.find_library(library)
    if file is None:
        return False
    try:
        ctypes.CDLL(file)
    except OSError:
        return False
    return True


def require_pyopengl() -> None:
    """Raise MissingDependencyError if PyOpenGL is missing, does not work, or lacks a function that drawing calls."""
    try:
        from OpenGL import GL
    except Exception as error:  # old releases break in many ways, and missing libraries look like it
        if missing_libraries():
            raise cannot_draw(error) from error
        cause = f"PyOpenGL {_pyopengl_version()} cannot be imported ({error_reason(error)})"
        raise MissingDependencyError(f"cannot draw: {cause}; run: {PYOPENGL_REMEDY}") from error
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


def cannot_draw(error: Exception, where: str = "") -> MissingDependencyError:
    """The error if drawing failed: it names the missing libraries if there are any, otherwise what EGL reports.

    where: the device, as in " on device 0".
    """
    missing = missing_libraries()
    cause = f"missing lib{', lib'.join(missing)}" if missing else f"EGL{where} reports {error_reason(error)}"
    return MissingDependencyError(f"cannot draw without a display ({cause}); run: {EGL_REMEDY}")


def error_reason(error: Exception) -> str:
    """An error in one line: of PyOpenGL's, which print their arguments, the function that failed and its code."""
    function = getattr(getattr(error, "baseOperation", None), "__name__", None)
    code = getattr(error, "err", None)
    if function and code is not None:
        return f"{function} failed with {getattr(code, 'name', code)}"
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
