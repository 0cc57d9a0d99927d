"""Pictures as PNG and JPEG bytes, looked at before they are decoded."""

import struct
from pathlib import Path
from typing import Any

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
# by colour type; of a palette the colours count
PNG_CHANNELS = {0: 1, 2: 3, 3: 3, 4: 2, 6: 4}
PALETTE = 3
# bits, height, width, components
JPEG_SEGMENT = struct.Struct(">BBH")
JPEG_FRAME = struct.Struct(">BHHB")
# Those of the markers C0 to CF that begin no frame: Huffman tables, extensions, arithmetic coding.
NO_FRAME = (0xC4, 0xC8, 0xCC)
MAX_PX = 1 << 28  # a larger one is a damaged or a hostile header


def write_png(path: Path, picture: NDArray[np.unsignedinteger[Any]]) -> None:
    """Write (H, W) grey or (H, W, 3) red, green, blue, 8 or 16 bits. Raises OSError where the file can't be written."""
    in_cv_order = picture[..., ::-1] if picture.ndim == 3 else picture
    path.write_bytes(cv2.imencode(".png", np.ascontiguousarray(in_cv_order))[1].tobytes())


# What pictures can be, by the names that ROS has for them, and their channels.
MONO = "mono8"
RGB = "rgb8"
BAYER = "bayer_rggb8"
CHANNELS = {MONO: 1, RGB: 3, BAYER: 1}
RGB_SHAPE: tuple[tuple[int, ...], ...] = ((), (3,))


def grey(image: Image, colour: str) -> Image:
    """The picture (H, W) as grey as a television makes it: 0.299 red + 0.587 green + 0.114 blue (ITU-R BT.601)."""
    if colour == MONO:
        return image
    return cv2.cvtColor(image, cv2.COLOR_RGB2GRAY if colour == RGB else cv2.COLOR_BayerRGGB2GRAY).astype(np.uint8)


def rgb(image: Image, colour: str) -> Image:
    """The picture as red, green and blue (H, W, 3); a mosaic is interpolated."""
    ways = {MONO: cv2.COLOR_GRAY2RGB, BAYER: cv2.COLOR_BayerRGGB2RGB}
    return image if colour == RGB else cv2.cvtColor(image, ways[colour]).astype(np.uint8)


def encode(
    image: Image, camera: Camera | None, name: str, *, jpeg_quality: int | None = None, colour: str = MONO
) -> bytes:
    """A grey or RGB picture as PNG or as JPEG of a quality. Raises SequenceError where it is not the camera's.

    PNG gets no compression level: OpenCV's default strategy is both faster and smaller than any level.
    """
    takes = ((camera.height_px, camera.width_px) if camera else image.shape[:2]) + RGB_SHAPE[colour == RGB]
    if image.shape != takes or image.dtype != np.uint8:
        raise SequenceError(f"{name} takes {takes} uint8 pictures, got {image.shape} {image.dtype}")
    image = np.ascontiguousarray(image[..., ::-1]) if image.ndim == 3 else image  # OpenCV begins with blue
    if jpeg_quality is None:
        return cv2.imencode(".png", image)[1].tobytes()
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])[1].tobytes()


def decode(encoded: Encoded, camera: Camera | None, name: str, *, colour: str = MONO) -> Image:
    """A picture (H, W), or (H, W, 3) of rgb8, by its header first. Raises SequenceError, also for another size."""
    size = require_picture(encoded, camera, name, colour=colour)[1:]
    image = cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.shape != size + RGB_SHAPE[colour == RGB] or image.dtype != np.uint8:
        raise SequenceError(f"not a whole 8-bit {_looks(colour)} PNG or JPEG: {name}")
    return (np.ascontiguousarray(image[..., ::-1]) if colour == RGB else image).astype(np.uint8, copy=False)


def require_picture(encoded: Encoded, camera: Camera | None, name: str, *, colour: str = MONO) -> tuple[str, int, int]:
    """Form, height and width by a header. Raises SequenceError where it is not 8-bit, the colour's or the camera's."""
    try:
        found = header(encoded.data if isinstance(encoded, np.ndarray) else memoryview(encoded))
        form, height, width, bits, components = found
    except struct.error:
        raise SequenceError(f"the picture ends within its header: {name}") from None
    if bits != 8 or components != CHANNELS[colour] or not 0 < height * width <= MAX_PX:
        raise SequenceError(f"not an 8-bit {_looks(colour)} PNG or JPEG: {name}")
    if camera and (height, width) != (camera.height_px, camera.width_px):
        raise SequenceError(f"{(height, width)} pixels, but the camera has {camera.height_px, camera.width_px}: {name}")
    return form, height, width


def _looks(colour: str) -> str:
    return "RGB" if colour == RGB else "grey"


def header(encoded: memoryview) -> tuple[str, int, int, int, int]:
    """Form, height, width, bits and channels, no channel where it makes no sense. Raises struct.error where it ends."""
    if encoded[: len(PNG_START)] == PNG_START:
        width, height, bits, colour = PNG_HEADER.unpack_from(encoded, len(PNG_START))
        return "png", height, width, 8 if colour == PALETTE else bits, PNG_CHANNELS.get(colour, 0)
    if encoded[: len(JPEG_START)] == JPEG_START:
        at = 2
        while True:
            start, marker, length = JPEG_SEGMENT.unpack_from(encoded, at)
            if start != 0xFF:
                break
            if 0xC0 <= marker <= 0xCF and marker not in NO_FRAME:
                bits, height, width, components = JPEG_FRAME.unpack_from(encoded, at + JPEG_SEGMENT.size)
                return "jpeg", height, width, bits, components
            at += 2 + length
    return "", 0, 0, 0, 0
