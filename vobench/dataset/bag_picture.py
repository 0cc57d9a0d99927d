"""Converts ROS messages to pictures, from any known encoding or compressed format."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.dataset.picture import EncodedPicture
from vobench.errors import InputError

GREY_BYTES = {"mono8": 1, "8uc1": 1, "mono16": 2, "16uc1": 2}  # bytes per pixel of the encodings in grey
COLOUR_CHANNELS = {"bgr8": 3, "8uc3": 3, "rgb8": 3, "bgra8": 4, "rgba8": 4}  # the encodings in colour have 8 bits
# OpenCV's conversions from Bayer mosaics to grey.
MOSAICS = {
    "bayer_rggb8": cv2.COLOR_BayerRGGB2GRAY,
    "bayer_bggr8": cv2.COLOR_BayerBGGR2GRAY,
    "bayer_gbrg8": cv2.COLOR_BayerGBRG2GRAY,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2GRAY,
}


def picture(message: Any, name: str) -> EncodedPicture:
    """The picture of an Image or CompressedImage. Raises InputError for an unknown encoding."""
    is_compressed = not hasattr(message, "encoding")
    if is_compressed:
        return EncodedPicture(name, message.data.tobytes())
    encoding = message.encoding.lower()
    if encoding in GREY_BYTES:
        grey = _pixels(message, name, channels=1, channel_bytes=GREY_BYTES[encoding])
        return EncodedPicture(name, grey[..., 0])
    if encoding in COLOUR_CHANNELS:
        all_channels = _pixels(message, name, channels=COLOUR_CHANNELS[encoding], channel_bytes=1)
        colour = all_channels[..., :3]  # without the alpha channel
        blue_green_red = colour[..., ::-1] if encoding.startswith("rgb") else colour
        return EncodedPicture(name, np.ascontiguousarray(blue_green_red))
    if encoding in MOSAICS:
        mosaic = _pixels(message, name, channels=1, channel_bytes=1)[..., 0]
        grey = np.asarray(cv2.cvtColor(mosaic, MOSAICS[encoding]))
        return EncodedPicture(name, grey)
    known = ", ".join((*GREY_BYTES, *COLOUR_CHANNELS, *MOSAICS))
    raise InputError(f"the encoding {message.encoding!r} is not supported. Known: {known}: {name}")


def _pixels(
    message: Any,
    name: str,
    *,
    channels: int,
    channel_bytes: int,
) -> NDArray[Any]:
    """The pixels (H, W, channels) of an Image. Raises InputError if its size and its number of bytes do not agree."""
    height = int(message.height)
    width = int(message.width)
    step = int(message.step)  # the bytes of a row, which can have padding after its pixels
    pixel_bytes = width * channels * channel_bytes  # the bytes of the pixels of a row
    has_valid_size = height >= 1 and width >= 1 and step >= pixel_bytes
    if not has_valid_size or message.data.size < height * step:
        raise InputError(
            f"{message.data.size} bytes are not a {width} x {height} image in {message.encoding} "
            f"with {step} bytes a row: {name}"
        )
    data = message.data[: height * step]
    rows = np.asarray(data, np.uint8).reshape(height, step)[:, :pixel_bytes]
    if channel_bytes == 1:
        return rows.reshape(height, width, channels).copy()
    byte_order = ">u2" if message.is_bigendian else "<u2"
    values = np.ascontiguousarray(rows).view(byte_order)
    return values.reshape(height, width, channels).astype(np.uint16)
