"""Pictures into CDR messages and out of them without a detour: laid out once, then stamped."""

import struct
from typing import Any

from vobench.sequence.messages import NS_PER_S, TYPES, split_stamp

# A serialised message begins with four bytes that tell its byte order, then the stamp of its header.
STAMP, STAMP_AT = struct.Struct("<iI"), 4
LENGTH = struct.Struct("<I")
LITTLE_ENDIAN = b"\x00\x01"


def serialise(message: Any) -> bytes:
    """The CDR bytes of a message."""
    return bytes(TYPES.serialize_cdr(message, message.__msgtype__, little_endian=True))


def stamped(template: bytes, t_ns: int) -> bytes:
    """A serialised message that begins with a header, at another stamp."""
    return b"".join((template[:STAMP_AT], STAMP.pack(*split_stamp(t_ns)), template[STAMP_AT + STAMP.size :]))


def pictured(template: bytes, t_ns: int, encoded: bytes) -> bytes:
    """A serialised CompressedImage without a picture, given a stamp and one: the picture is its last field."""
    head = template[:STAMP_AT], STAMP.pack(*split_stamp(t_ns)), template[STAMP_AT + STAMP.size : -LENGTH.size]
    return b"".join((*head, LENGTH.pack(len(encoded)), encoded))


def picture_in(data: memoryview) -> tuple[int, str, memoryview]:
    """Stamp in ns, form and picture of a serialised CompressedImage. Raises ValueError where it is none."""
    if data[: len(LITTLE_ENDIAN)] != LITTLE_ENDIAN:
        raise ValueError("a picture's message is not in little-endian CDR")
    sec, nanosec = STAMP.unpack_from(data, STAMP_AT)
    _, at = _string(data, STAMP_AT + STAMP.size)  # the frame
    form, at = _string(data, at)
    begin, end = _counted(data, at)
    return sec * NS_PER_S + nanosec, form, data[begin:end]


def _string(data: memoryview, at: int) -> tuple[str, int]:
    """A string, which ends with a zero, and where what follows it begins."""
    begin, end = _counted(data, at)
    return bytes(data[begin : max(begin, end - 1)]).decode(), end


def _counted(data: memoryview, at: int) -> tuple[int, int]:
    """Where the bytes begin and end whose number is stated at `at` or up to three bytes later, for it is aligned."""
    at += -at % LENGTH.size
    (length,) = LENGTH.unpack_from(data, at)
    begin = at + LENGTH.size
    if begin + length > len(data):
        raise ValueError(f"a message of {len(data)} bytes states {length} more at {at}")
    return begin, begin + length
