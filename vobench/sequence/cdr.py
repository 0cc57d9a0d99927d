"""The serialisation of ROS 2 messages as CDR, and changes to serialised messages without parsing them."""

import struct
from typing import Any, NamedTuple

from vobench.sequence.message import split_stamp
from vobench.sequence.message_type import TYPES
from vobench.sequence.picture import CHANNELS, MONO
from vobench.trajectory.nanoseconds import NS_PER_S

# A serialised message starts with four bytes for its byte order. If it has a header, the stamp follows.
STAMP = struct.Struct("<iI")
STAMP_START = 4
STAMP_END = STAMP_START + STAMP.size
LENGTH = struct.Struct("<I")
LITTLE_ENDIAN = b"\x00\x01"


def serialise(message: Any) -> bytes:
    """A message as CDR bytes in little-endian order."""
    return bytes(TYPES.serialize_cdr(message, message.__msgtype__, little_endian=True))


def with_stamp(template: bytes, t_ns: int) -> bytes:
    """A copy of a serialised message with another stamp.

    `template` is the message. It must begin with a header.
    `t_ns` is the new stamp.
    """
    stamp = STAMP.pack(*split_stamp(t_ns))
    return b"".join((template[:STAMP_START], stamp, template[STAMP_END:]))


def with_picture(template: bytes, t_ns: int, encoded: bytes) -> bytes:
    """A copy of a serialised CompressedImage with another stamp and another picture.

    `template` is the message. Its picture, which is the last field, must be empty.
    `t_ns` is the new stamp.
    `encoded` is the picture, encoded as PNG or in another format.
    """
    stamp = STAMP.pack(*split_stamp(t_ns))
    frame_and_format = template[STAMP_END : -LENGTH.size]
    length = LENGTH.pack(len(encoded))
    return b"".join((template[:STAMP_START], stamp, frame_and_format, length, encoded))


class StampedPicture(NamedTuple):
    """The content of a serialised CompressedImage.

    `t_ns` is the stamp in ns.
    `codec` is the name of the format in which the picture is encoded, such as "png".
    `colour` is the encoding of its pixels, a key of `CHANNELS`.
    `encoded` is the encoded picture.
    """

    t_ns: int
    codec: str
    colour: str
    encoded: memoryview


def parse_picture(data: memoryview) -> StampedPicture:
    """The content of a serialised CompressedImage. Raises ValueError or struct.error if the data is damaged."""
    if data[: len(LITTLE_ENDIAN)] != LITTLE_ENDIAN:
        raise ValueError("an image's message is not in little-endian CDR")
    sec, nanosec = STAMP.unpack_from(data, STAMP_START)
    _, offset = _read_string(data, STAMP_END)  # the name of the frame
    format_name, offset = _read_string(data, offset)

    # The format is "png", or for instance "rgb8; png compressed bgr8".
    named_colour, _, codec_and_more = format_name.rpartition("; ")
    colour = named_colour or MONO
    codec, _, _ = codec_and_more.partition(" ")
    if colour not in CHANNELS:
        raise ValueError(f"an image has the unknown format {format_name!r}")
    start, end = _sequence_bounds(data, offset)
    t_ns = sec * NS_PER_S + nanosec
    return StampedPicture(t_ns, codec, colour, data[start:end])


def _read_string(data: memoryview, offset: int) -> tuple[str, int]:
    """The string at an offset, and the offset of the byte that follows the zero byte at its end."""
    start, end = _sequence_bounds(data, offset)
    text_end = max(start, end - 1)
    return bytes(data[start:text_end]).decode(), end


def _sequence_bounds(data: memoryview, offset: int) -> tuple[int, int]:
    """The offsets of the start and end of a sequence of bytes.

    Its length is stored before it, at the first multiple of four that is not less than `offset`.
    Raises ValueError if the data ends before the sequence.
    """
    padding = -offset % LENGTH.size
    length_offset = offset + padding
    (length,) = LENGTH.unpack_from(data, length_offset)
    start = length_offset + LENGTH.size
    end: int = start + length
    if end > len(data):
        raise ValueError(
            f"the message has {len(data)} bytes, but the length field at offset {length_offset} announces {length} more"
        )
    return start, end
