"""The pictures of an exported sequence as PNG files."""

from collections.abc import Iterator
from dataclasses import dataclass

from vobench.dataset.rectified_view import Views
from vobench.errors import SequenceError
from vobench.geometry.rig import Side
from vobench.sequence import Sequence
from vobench.sequence.picture import decode, encode

PNG = "png"


@dataclass(frozen=True, slots=True)
class PngFrame:
    """The pictures of one frame as PNG files, one per camera."""

    index: int
    t_ns: int
    pictures: dict[Side, bytes]


def png_frames(sequence: Sequence, views: Views) -> Iterator[PngFrame]:
    """The pictures of a sequence in these views, as PNG files. PNG files that are not resampled are not decoded."""
    for frame in sequence.encoded_frames():
        encoded: dict[Side, bytes | None] = {"left": frame.left, "right": frame.right}
        pictures = {}
        for side in views.rig.sides:
            recorded = encoded[side]
            if recorded is None:
                raise SequenceError(f"a frame has no {side} image, but the rig has a {side} camera")
            is_unchanged = views.source_px is None and frame.form == PNG
            pictures[side] = bytes(recorded) if is_unchanged else _resampled_png(sequence, views, side, recorded)
        yield PngFrame(frame.index, frame.t_ns, pictures)


def _resampled_png(sequence: Sequence, views: Views, side: Side, recorded: bytes) -> bytes:
    """A recorded picture, decoded, resampled to its view and encoded as PNG."""
    picture = decode(recorded, sequence.rig.camera(side), f"a {side} image")
    return encode(views.show(side, picture), views.rig.camera(side), side)
