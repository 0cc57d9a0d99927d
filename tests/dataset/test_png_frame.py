"""Pictures are exported as PNG files."""

from collections.abc import Callable
from typing import Any

from vobench.dataset.png_frame import png_frames
from vobench.dataset.rectified_view import Views
from vobench.dataset.source import open_source
from vobench.geometry.rig import Rig

Make = Callable[..., Any]


def test_png_pictures_pass_as_they_are_and_others_as_png(make_sequence: Make, rig_of: Callable[..., Rig]) -> None:
    for quality in (None, 80):
        made = make_sequence(rig_of(), jpeg_quality=quality)
        source = open_source(made.folder)
        recorded = list(source.sequence.encoded_frames())
        frames = list(png_frames(source.sequence, Views(source.rig)))
        assert [frame.t_ns for frame in frames] == made.t_ns.tolist()
        assert all(frame.pictures["right"].startswith(b"\x89PNG") for frame in frames)
        kept = [frame.pictures["left"] == old.left for frame, old in zip(frames, recorded, strict=True)]
        assert kept == [quality is None] * len(frames)
