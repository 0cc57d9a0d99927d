"""Reads files whose names may come from somebody else, such as a link in a folder that was downloaded."""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading. Raises OSError for anything else.

    Opening a named pipe and reading a device or a file of the kernel, such as /proc/kmsg, could wait forever.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    file = os.fdopen(descriptor, "rb")
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        file.close()
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    return file


def read_regular(path: Path, *, most_bytes: int) -> bytes:
    """The first `most_bytes` bytes of a regular file. Raises OSError for anything else."""
    with open_regular(path) as file:
        content = file.read(most_bytes)
    if content is None:  # a file of the kernel has no content yet
        raise OSError(errno.EAGAIN, "not a regular file", str(path))
    return content
