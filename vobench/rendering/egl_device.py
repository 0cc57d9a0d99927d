"""The devices that EGL can render with, and the order in which they are tried."""

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
    """A device that EGL can render with.

    `index` is its position in EGL's list of devices.
    `name` consists of the names of its renderer and its device file, as far as EGL reports them.
    `is_software` is whether it renders on the CPU.
    `handle` is EGL's handle of the device, or None for the default display.
    """

    index: int
    name: str
    is_software: bool
    handle: Any = field(default=None, compare=False, repr=False)

    def __str__(self) -> str:
        kind = "CPU" if self.is_software else "GPU"
        return f"{self.index}: {self.name} ({kind})"


def ordered(available: Sequence[EglDevice], wanted: str) -> list[EglDevice]:
    """The devices to try, in order. The environment variable VOBENCH_EGL_DEVICE restricts them.

    `available` are the devices that EGL lists.
    `wanted` is the value of the variable: "cpu", "gpu", the index of a device, or "" for all devices.

    If `wanted` is "", CPU renderers come first, because the CPU renderer of Mesa draws the same bytes on every machine.
    Pictures from GPUs differ from them in some pixels by one grey value.

    Raises MissingDependencyError if EGL lists no such device.
    """
    match wanted.strip().lower():
        case "":
            return sorted(available, key=lambda device: not device.is_software)
        case "cpu":
            selected = [device for device in available if device.is_software]
        case "gpu":
            selected = [device for device in available if not device.is_software]
        case index:
            selected = [device for device in available if str(device.index) == index]
    if not selected:
        raise MissingDependencyError(
            f"{DEVICE_VARIABLE} should be cpu, gpu or the number of a device, got {wanted!r}; "
            f"EGL lists {listed(available)}; run: unset {DEVICE_VARIABLE}"
        )
    return selected


def listed(available: Iterable[EglDevice]) -> str:
    """The devices in one line of text, or "none" if there are none."""
    return ", ".join(map(str, available)) or "none"


def devices() -> list[EglDevice]:
    """All devices that EGL lists, in its order. If EGL cannot list devices, the default display is the only one."""
    query = egl_function("eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    query_string = egl_function("eglQueryDeviceStringEXT", ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)
    if query is None or query_string is None:
        return [EglDevice(0, "default display", is_software=False)]

    count = ctypes.c_int()
    query(0, None, ctypes.byref(count))
    handles = (ctypes.c_void_p * count.value)()
    query(count.value, handles, ctypes.byref(count))
    listed_handles = handles[: count.value]
    return [_device(index, handle, query_string) for index, handle in enumerate(listed_handles)]


def _device(
    index: int,
    handle: int | None,
    query_string: Any,
) -> EglDevice:
    """The device of a handle. `query_string` is the function eglQueryDeviceStringEXT."""
    from OpenGL import EGL

    extension_bytes = query_string(handle, EGL.EGL_EXTENSIONS) or b""
    extensions = extension_bytes.decode("ascii", "replace").split()
    is_software = "EGL_MESA_device_software" in extensions
    name_bytes = []
    if "EGL_EXT_device_query_name" in extensions:
        name_bytes.append(query_string(handle, RENDERER_NAME))
    if "EGL_EXT_device_drm" in extensions:
        name_bytes.append(query_string(handle, DRM_DEVICE_FILE))
    known_names = [name.decode("utf-8", "replace") for name in name_bytes if name]
    default_name = "Mesa software driver" if is_software else "unnamed device"
    name = " ".join(known_names) or default_name
    return EglDevice(index, name, is_software, handle)


def display_of(device: EglDevice) -> Any:
    """The EGL display of a device. All contexts of the process share it."""
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
    """A function of an EGL extension, or None if EGL has no function of that name.

    `result` is the ctypes type of its result.
    `arguments` are the ctypes types of its arguments.
    """
    from OpenGL import EGL

    address = EGL.eglGetProcAddress(name.encode())
    if not address:
        return None
    pointer = ctypes.cast(address, ctypes.c_void_p).value
    return ctypes.CFUNCTYPE(result, *arguments)(pointer or 0)
