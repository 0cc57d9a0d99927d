"""Pictures as PNG files."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray


def write_png(path: Path, picture: NDArray[np.unsignedinteger[Any]]) -> None:
    """Write (H, W) grey or (H, W, 3) red, green, blue, 8 or 16 bits. Raises OSError where the file can't be written."""
    in_cv_order = picture[..., ::-1] if picture.ndim == 3 else picture
    path.write_bytes(cv2.imencode(".png", np.ascontiguousarray(in_cv_order))[1].tobytes())
