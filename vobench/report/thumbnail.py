"""Small pictures of frames for a page."""

import base64
from typing import Any

from vobench.errors import VobenchError
from vobench.runner.folder import SEQUENCE, RunFolder

JPEG_QUALITY = 55
MOST_BYTES = 2_200_000  # of all pictures of a page, before they are encoded as text


class Thumbnails:
    """Small JPEG pictures of frames of a run's sequences, until they reach MOST_BYTES."""

    def __init__(self, folder: RunFolder) -> None:
        self._folder = folder
        self._bytes = 0
        self._uris = dict[tuple[str, int, int], str]()
        self._open_case = ""
        self._open_sequence: Any = None

    def get(self, case: str, frame: int, width_px: int) -> str | None:
        """A frame of a case as a data URI; None if there is no such frame or the limit is reached."""
        key = case, frame, width_px
        if key not in self._uris and self._bytes < MOST_BYTES:
            try:
                sequence = self._sequence(case)
                picture = sequence.frame(frame).left
                jpeg = _jpeg(picture, width_px)
            except (VobenchError, OSError):
                return None  # a page without a picture is better than no page
            self._bytes += len(jpeg)
            self._uris[key] = _data_uri(jpeg)
        return self._uris.get(key)

    def _sequence(self, case: str) -> Any:
        """The sequence of a case. The last one stays open for other frames of its case."""
        from vobench.sequence import Sequence

        if case != self._open_case:
            self._open_sequence = Sequence.open(self._folder.case(case) / SEQUENCE)
            self._open_case = case
        return self._open_sequence


def _data_uri(jpeg: bytes) -> str:
    """A JPEG file as a URI that a page can contain."""
    text = base64.b64encode(jpeg).decode()
    return f"data:image/jpeg;base64,{text}"


def _jpeg(picture: Any, width_px: int) -> bytes:
    """A picture (H, W) or (H, W, 3) in RGB as a JPEG file, scaled to a width."""
    import cv2

    height, width = picture.shape[:2]
    height_px = max(1, round(height * width_px / width))
    scaled = cv2.resize(picture, (width_px, height_px), interpolation=cv2.INTER_AREA)
    if scaled.ndim == 3:
        scaled = scaled[..., ::-1]  # OpenCV encodes blue, green, red
    _, encoded = cv2.imencode(".jpg", scaled, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    content: bytes = encoded.tobytes()
    return content
