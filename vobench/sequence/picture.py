"""Pictures as PNG and JPEG bytes, whose headers are checked before they are decoded."""

import struct
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.errors import SequenceError
from vobench.geometry.camera import Camera

Image = NDArray[np.uint8]
Encoded = bytes | memoryview | Image

PNG_START = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"
JPEG_START = b"\xff\xd8\xff"
PNG_HEADER = struct.Struct(">IIBB")  # width, height, bits, colour type
PNG_CHANNELS = {0: 1, 2: 3, 3: 3, 4: 2, 6: 4}  # by colour type; a palette counts as red, green and blue
PALETTE = 3
JPEG_SEGMENT = struct.Struct(">BBH")  # 0xFF, marker, length
JPEG_FRAME = struct.Struct(">BHHB")  # bits, height, width, components
JPEG_START_BYTES = 2  # the size of the marker at the start of a file, which has no length field
FIRST_FRAME_MARKER = 0xC0
LAST_FRAME_MARKER = 0xCF
# The markers in this range that do not begin a frame: Huffman tables, extensions and arithmetic coding.
NON_FRAME_MARKERS = (0xC4, 0xC8, 0xCC)
MAX_PX = 1 << 28  # the largest number of pixels; a header with more is damaged or malicious


def write_png(path: Path, picture: NDArray[np.unsignedinteger[Any]]) -> None:
    """Write a picture with 8 or 16 bits per channel as a PNG.

    `picture` is grey (H, W) or red, green and blue (H, W, 3).
    Raises OSError if the file cannot be written.
    """
    in_cv_order = picture[..., ::-1] if picture.ndim == 3 else picture
    _, encoded = cv2.imencode(".png", np.ascontiguousarray(in_cv_order))
    path.write_bytes(encoded.tobytes())


# The ROS names of the encodings of pictures, and the number of channels of each.
MONO = "mono8"
RGB = "rgb8"
BAYER = "bayer_rggb8"
CHANNELS = {MONO: 1, RGB: 3, BAYER: 1}


def _shape(height: int, width: int, colour: str) -> tuple[int, ...]:
    """The shape of the array of a picture: (H, W, 3) for RGB, otherwise (H, W)."""
    return (height, width, 3) if colour == RGB else (height, width)


def grey(image: Image, colour: str) -> Image:
    """The picture as grey (H, W): 0.299 red + 0.587 green + 0.114 blue (ITU-R BT.601)."""
    if colour == MONO:
        return image
    conversion = cv2.COLOR_RGB2GRAY if colour == RGB else cv2.COLOR_BayerRGGB2GRAY
    return cv2.cvtColor(image, conversion).astype(np.uint8)


def rgb(image: Image, colour: str) -> Image:
    """The picture as red, green and blue (H, W, 3). A Bayer mosaic is interpolated."""
    if colour == RGB:
        return image
    conversions = {MONO: cv2.COLOR_GRAY2RGB, BAYER: cv2.COLOR_BayerRGGB2RGB}
    return cv2.cvtColor(image, conversions[colour]).astype(np.uint8)


def encode(
    image: Image,
    camera: Camera | None,
    name: str,
    *,
    jpeg_quality: int | None = None,
    colour: str = MONO,
) -> bytes:
    """A grey or RGB picture encoded as PNG or JPEG.

    `image` is (H, W), or (H, W, 3) for RGB.
    `camera` is the camera whose size the picture must have; None accepts any size.
    `name` is the name of the picture or topic, for messages.
    `jpeg_quality` is the quality of a JPEG from 0 to 100; None encodes as PNG.
    `colour` is one of MONO, RGB and BAYER.
    Raises SequenceError if the picture does not have the expected shape and 8 bits per channel.
    """
    height, width = (camera.height_px, camera.width_px) if camera else image.shape[:2]
    expected = _shape(height, width, colour)
    if image.shape != expected or image.dtype != np.uint8:
        raise SequenceError(f"{name} takes {expected} uint8 images, got {image.shape} {image.dtype}")
    in_cv_order = np.ascontiguousarray(image[..., ::-1]) if image.ndim == 3 else image
    if jpeg_quality is None:
        # Without a compression level, OpenCV's strategy is both faster and smaller than with any level.
        _, encoded = cv2.imencode(".png", in_cv_order)
    else:
        _, encoded = cv2.imencode(".jpg", in_cv_order, [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])
    return encoded.tobytes()


def decode(
    encoded: Encoded,
    camera: Camera | None,
    name: str,
    *,
    colour: str = MONO,
) -> Image:
    """The decoded picture: (H, W), or (H, W, 3) for RGB. Its header is checked before it is decoded.

    The arguments are those of `require_picture`.
    Raises SequenceError if the picture is damaged, or if its size or number of channels is not the expected one.
    """
    _, height, width = require_picture(encoded, camera, name, colour=colour)
    image = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_UNCHANGED)
    expected = _shape(height, width, colour)
    if image is None or image.shape != expected or image.dtype != np.uint8:
        raise SequenceError(f"not a whole 8-bit {_colour_word(colour)} PNG or JPEG: {name}")
    in_rgb_order = np.ascontiguousarray(image[..., ::-1]) if colour == RGB else image
    return in_rgb_order.astype(np.uint8, copy=False)


def require_picture(
    encoded: Encoded,
    camera: Camera | None,
    name: str,
    *,
    colour: str = MONO,
) -> tuple[str, int, int]:
    """The format, height and width in the header of a picture.

    `encoded` are the bytes of a PNG or JPEG.
    `camera` is the camera whose size the picture must have; None accepts any size.
    `name` is the name of the picture, for messages.
    `colour` is one of MONO, RGB and BAYER.
    Raises SequenceError if the picture does not have 8 bits per channel, the channels of the colour, or the size of
    the camera.
    """
    data = encoded.data if isinstance(encoded, np.ndarray) else memoryview(encoded)
    try:
        form, height, width, bits, channels = header(data)
    except struct.error:
        raise SequenceError(f"the image ends within its header: {name}") from None
    has_wrong_kind = bits != 8 or channels != CHANNELS[colour]
    if has_wrong_kind or not 0 < height * width <= MAX_PX:
        raise SequenceError(f"not an 8-bit {_colour_word(colour)} PNG or JPEG: {name}")
    if camera is None:
        return form, height, width

    camera_size = (camera.height_px, camera.width_px)
    if (height, width) != camera_size:
        raise SequenceError(f"{(height, width)} pixels, but the camera has {camera_size}: {name}")
    return form, height, width


def _colour_word(colour: str) -> str:
    return "RGB" if colour == RGB else "grey"


class Header(NamedTuple):
    """The contents of the header of a picture.

    `form` is "png" or "jpeg"; it is empty for data in another format, and the numbers are then 0.
    `height` and `width` are the size in pixels.
    `bits` is the number of bits per channel.
    `channels` is the number of channels.
    """

    form: str
    height: int
    width: int
    bits: int
    channels: int


def header(encoded: memoryview) -> Header:
    """The header of a PNG or JPEG. Raises struct.error if the data ends within the header."""
    if encoded[: len(PNG_START)] == PNG_START:
        width, height, bits, colour = PNG_HEADER.unpack_from(encoded, len(PNG_START))
        if colour == PALETTE:
            bits = 8  # the colours of a palette always have 8 bits; the header has the bits of the indices
        return Header("png", height, width, bits, PNG_CHANNELS.get(colour, 0))
    if encoded[: len(JPEG_START)] == JPEG_START:
        return _jpeg_header(encoded)
    return Header("", 0, 0, 0, 0)


def _jpeg_header(encoded: memoryview) -> Header:
    """The header of the first frame, which follows any number of other segments."""
    offset = JPEG_START_BYTES
    while True:
        start, marker, length = JPEG_SEGMENT.unpack_from(encoded, offset)
        if start != 0xFF:
            return Header("", 0, 0, 0, 0)
        if FIRST_FRAME_MARKER <= marker <= LAST_FRAME_MARKER and marker not in NON_FRAME_MARKERS:
            bits, height, width, channels = JPEG_FRAME.unpack_from(encoded, offset + JPEG_SEGMENT.size)
            return Header("jpeg", height, width, bits, channels)
        offset += 2 + length  # the length does not include the two bytes 0xFF and marker
