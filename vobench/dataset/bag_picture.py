"""Pictures out of ROS messages, raw and compressed."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.dataset.picture import Picture
from vobench.errors import InputError

# Channels and bytes of each; where the colours come the wrong way round; what makes mosaics grey.
GREY = {"mono8": 1, "8uc1": 1, "mono16": 2, "16uc1": 2}
COLOURS = {"bgr8": 3, "8uc3": 3, "rgb8": 3, "bgra8": 4, "rgba8": 4}
MOSAICS = {
    "bayer_rggb8": cv2.COLOR_BayerRGGB2GRAY,
    "bayer_bggr8": cv2.COLOR_BayerBGGR2GRAY,
    "bayer_gbrg8": cv2.COLOR_BayerGBRG2GRAY,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2GRAY,
}


def picture(message: Any, name: str) -> Picture:
    """The picture of an Image or CompressedImage. Raises InputError for an encoding that is not read."""
    if not hasattr(message, "encoding"):
        return Picture(name, message.data.tobytes())
    encoding = message.encoding.lower()
    if encoding in GREY:
        return Picture(name, _pixels(message, name, 1, GREY[encoding])[..., 0])
    if encoding in COLOURS:
        pixels = _pixels(message, name, COLOURS[encoding], 1)[..., :3]
        return Picture(name, np.ascontiguousarray(pixels[..., ::-1] if encoding.startswith("rgb") else pixels))
    if encoding in MOSAICS:
        return Picture(name, np.asarray(cv2.cvtColor(_pixels(message, name, 1, 1)[..., 0], MOSAICS[encoding])))
    known = ", ".join((*GREY, *COLOURS, *MOSAICS))
    raise InputError(f"the encoding {message.encoding!r} is not read. Known: {known}: {name}")


def encoding_note(message: Any) -> tuple[str, ...]:
    """What `picture` makes of a message, beyond what its kind says."""
    if getattr(message, "encoding", "").lower() in MOSAICS:
        return (f"The colour mosaic ({message.encoding}) was turned grey by OpenCV's bilinear interpolation.",)
    return ()


def _pixels(message: Any, name: str, channels: int, size: int) -> NDArray[Any]:
    """Pixels (H, W, channels) of `size` bytes each; rows may be longer than their pixels need."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    needed = width * channels * size
    if height < 1 or width < 1 or step < needed or message.data.size < height * step:
        raise InputError(
            f"{message.data.size} bytes are no {width} x {height} picture in {message.encoding} "
            f"with {step} bytes a row: {name}"
        )
    rows = np.asarray(message.data[: height * step], np.uint8).reshape(height, step)[:, :needed]
    if size == 1:
        return rows.reshape(height, width, channels).copy()
    order = ">u2" if message.is_bigendian else "<u2"
    words = np.ascontiguousarray(rows).view(order).reshape(height, width, channels)
    return words.astype(np.uint16)
