"""Memory that vobench writes frames to and an estimator's worker reads them from, so that images need no pipe."""

import ctypes
import fcntl
import mmap
import os
import sys
from collections.abc import Sequence

import numpy as np

from vobench.estimator.protocol import Image
from vobench.geometry.rig import Rig

# linux/fcntl.h; Python has no name for it before 3.13. Mappings that exist remain writable; nothing else can write.
F_SEAL_FUTURE_WRITE = 0x10
MAP_FAILED = ctypes.c_void_p(-1).value
NAME = "vobench-frame"
MOST_CHANNELS = 3
READINGS_BYTES = 1 << 20  # of the IMU and the encoders between two frames


class FrameMemory:
    """Sealed memory of a fixed size. It has no name in any file system, so nothing of it outlives its processes.

    `descriptor` is the one that the worker inherits. It is read-only, and the seals prevent that the memory is resized
    or written through another descriptor. A page takes memory once it is written.
    """

    def __init__(self, size: int) -> None:
        """Allocate the memory. Raises OSError if the kernel lacks it or one of its seals."""
        if sys.platform != "linux":
            raise OSError("only Linux has memory that can be sealed")
        writable = os.memfd_create(NAME, os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        try:
            os.ftruncate(writable, size)
            self._memory = mmap.mmap(writable, size)
            seals = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | F_SEAL_FUTURE_WRITE | fcntl.F_SEAL_SEAL
            fcntl.fcntl(writable, fcntl.F_ADD_SEALS, seals)
            self.descriptor = os.open(f"/proc/self/fd/{writable}", os.O_RDONLY | os.O_CLOEXEC)
        finally:
            os.close(writable)

    def write(self, contents: Sequence[memoryview]) -> bool:
        """Write contents one after the other. False, and nothing is written, if they are too long."""
        if sum(map(len, contents)) > len(self._memory):
            return False
        start = 0
        for content in contents:
            end = start + len(content)
            self._memory[start:end] = content
            start = end
        return True

    def close(self) -> None:
        """Free the memory, which the worker keeps as long as it runs."""
        os.close(self.descriptor)
        self._memory.close()


def frame_memory(rig: Rig) -> FrameMemory | None:
    """Memory for a frame of a rig, whose images may have colour; None if this machine has no such memory."""
    images_bytes = 0
    for side in rig.sides:
        camera = rig.camera(side)
        images_bytes += camera.width_px * camera.height_px * MOST_CHANNELS
    try:
        return FrameMemory(images_bytes + READINGS_BYTES)
    except (OSError, AttributeError):
        return None


def opened_memory(descriptor: int) -> Image | None:
    """The bytes (N,) of the memory behind a descriptor, for reading. The descriptor is closed. None for -1.

    Python's mmap would keep a descriptor, which the estimator could pass on.
    """
    if descriptor < 0:
        return None
    size = os.fstat(descriptor).st_size
    map_memory = ctypes.CDLL(None, use_errno=True).mmap
    map_memory.restype = ctypes.c_void_p
    map_memory.argtypes = (ctypes.c_void_p, ctypes.c_size_t, *3 * [ctypes.c_int], ctypes.c_long)
    address = map_memory(None, size, mmap.PROT_READ, mmap.MAP_SHARED, descriptor, 0)
    if address == MAP_FAILED:
        raise OSError(ctypes.get_errno(), "the memory for frames cannot be mapped")
    os.close(descriptor)
    memory: Image = np.frombuffer(memoryview((ctypes.c_uint8 * size).from_address(address)), np.uint8)
    memory.flags.writeable = False
    return memory


def copied(memory: Image, length: int) -> memoryview:
    """A writable copy of the first bytes of a memory, which does not change with the next frame."""
    return memory[:length].copy().data
