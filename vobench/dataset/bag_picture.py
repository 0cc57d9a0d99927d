"""Converts ROS messages to pictures, from any known encoding or compressed format."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.dataset.picture import EncodedPicture
from vobench.errors import InputError

# The bytes per pixel of each encoding of grey pictures, and the channels of each 8-bit encoding of colour pictures.
GREY = {"mono8": 1, "8uc1": 1, "mono16": 2, "16uc1": 2}
COLOURS = {"bgr8": 3, "8uc3": 3, "rgb8": 3, "bgra8": 4, "rgba8": 4}
# OpenCV's conversions from Bayer mosaics to grey.
MOSAICS = {
    "bayer_rggb8": cv2.COLOR_BayerRGGB2GRAY,
    "bayer_bggr8": cv2.COLOR_BayerBGGR2GRAY,
    "bayer_gbrg8": cv2.COLOR_BayerGBRG2GRAY,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2GRAY,
}


def picture(message: Any, name: str) -> EncodedPicture:
    """The picture of an Image or CompressedImage. Raises InputError for an unknown encoding."""
    if not hasattr(message, "encoding"):
        return EncodedPicture(name, message.data.tobytes())
    encoding = message.encoding.lower()
    if encoding in GREY:
        grey = _pixels(message, name, 1, GREY[encoding])
        return EncodedPicture(name, grey[..., 0])
    if encoding in COLOURS:
        colour = _pixels(message, name, COLOURS[encoding], 1)[..., :3]  # the alpha channel is dropped
        blue_green_red = colour[..., ::-1] if encoding.startswith("rgb") else colour
        return EncodedPicture(name, np.ascontiguousarray(blue_green_red))
    if encoding in MOSAICS:
        mosaic = _pixels(message, name, 1, 1)[..., 0]
        return EncodedPicture(name, np.asarray(cv2.cvtColor(mosaic, MOSAICS[encoding])))
    known = ", ".join((*GREY, *COLOURS, *MOSAICS))
    raise InputError(f"the encoding {message.encoding!r} is not supported. Known: {known}: {name}")


def _pixels(
    message: Any,
    name: str,
    channels: int,
    channel_bytes: int,
) -> NDArray[Any]:
    """The pixels (H, W, channels) of a message. Its rows may be longer than the pixels require."""
    height = int(message.height)
    width = int(message.width)
    step = int(message.step)  # bytes per row
    needed = width * channels * channel_bytes
    is_possible = height >= 1 and width >= 1 and step >= needed
    if not is_possible or message.data.size < height * step:
        raise InputError(
            f"{message.data.size} bytes are not a {width} x {height} picture in {message.encoding} "
            f"with {step} bytes a row: {name}"
        )
    data = message.data[: height * step]
    rows = np.asarray(data, np.uint8).reshape(height, step)[:, :needed]
    if channel_bytes == 1:
        return rows.reshape(height, width, channels).copy()
    byte_order = ">u2" if message.is_bigendian else "<u2"
    words = np.ascontiguousarray(rows).view(byte_order)
    return words.reshape(height, width, channels).astype(np.uint16)
