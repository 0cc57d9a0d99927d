"""The devices that EGL can draw with, and which of them are tried first."""

import ctypes
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from vobench.errors import MissingDependencyError

DEVICE_VARIABLE = "VOBENCH_EGL_DEVICE"

# Constants that PyOpenGL lacks, of the extensions EGL_EXT_platform_device, EGL_EXT_device_drm and
# EGL_EXT_device_query_name.
PLATFORM_DEVICE = 0x313F
DRM_DEVICE_FILE = 0x3233
RENDERER_NAME = 0x335F


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
    query = egl_function("eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    query_string = egl_function("eglQueryDeviceStringEXT", ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)
    if query is None or query_string is None:
        return [EglDevice(0, "default display", is_software=False)]

    count = ctypes.c_int()
    query(0, None, ctypes.byref(count))
    handles = (ctypes.c_void_p * count.value)()
    query(count.value, handles, ctypes.byref(count))
    return [_device(index, handle, query_string) for index, handle in enumerate(handles[: count.value])]


def _device(
    index: int,
    handle: int | None,
    query_string: Any,
) -> EglDevice:
    """The device of a handle. `query_string` is eglQueryDeviceStringEXT."""
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


def display_of(device: EglDevice) -> Any:
    """The EGL display of a device, the same for every context of the process."""
    from OpenGL import EGL

    if device.handle is None:
        return EGL.eglGetDisplay(EGL.EGL_DEFAULT_DISPLAY)
    get_display = egl_function(
        "eglGetPlatformDisplayEXT", EGL.EGLDisplay, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p
    )
    if get_display is None:
        raise RuntimeError("EGL has no eglGetPlatformDisplayEXT")
    return get_display(PLATFORM_DEVICE, device.handle, None)


def egl_function(name: str, result: Any, *arguments: Any) -> Any:
    """A function of an EGL extension with types of ctypes, None if EGL has no function of that name."""
    from OpenGL import EGL

    address = EGL.eglGetProcAddress(name.encode())
    if not address:
        return None
    pointer = ctypes.cast(address, ctypes.c_void_p).value
    return ctypes.CFUNCTYPE(result, *arguments)(pointer or 0)
