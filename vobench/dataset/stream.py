"""The pictures of a recording as they come, each held against the first one and the calibration."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from vobench.dataset.picture import Kind, Picture, as_file, conversions, grey, kind_of
from vobench.errors import InputError
from vobench.geometry.rig import SIDES, Rig
from vobench.sequence import EncodedFrame, StereoFrame


@dataclass(frozen=True, slots=True)
class Shot:
    """The pictures of one instant: the left one, or left and right."""

    t_ns: int
    pictures: tuple[Picture, ...]


Shots = Callable[[], Iterator[Shot]]


@dataclass(frozen=True, slots=True)
class PictureStream:
    """Shots that can be gone through again and again, one in memory at a time; `kinds` are those of the first."""

    shots: Shots
    kinds: tuple[Kind, ...]

    @classmethod
    def open(cls, shots: Shots) -> "PictureStream":
        """Look at the first shot. Raises InputError where its pictures can't be read."""
        first = next(shots(), None)
        if first is None:
            raise InputError("a recording should have one picture or more, but has none")
        return cls(shots, tuple(kind_of(picture) for picture in first.pictures))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the first left picture."""
        return self.kinds[0].width_px, self.kinds[0].height_px

    def require(self, rig: Rig, calibration: str) -> None:
        """Raise InputError unless the pictures are of the rig's sizes; `calibration` is the file that has those."""
        for side, kind in zip(SIDES, self.kinds, strict=False):
            camera = rig.camera(side)
            if (kind.width_px, kind.height_px) != (camera.width_px, camera.height_px):
                raise InputError(
                    f"the first {side} picture has {kind.width_px} x {kind.height_px} pixels, "
                    f"but the calibration is for {camera.width_px} x {camera.height_px}: {calibration}"
                )

    def notes(self) -> tuple[str, ...]:
        """What is done to make the pictures 8-bit grey."""
        return tuple(dict.fromkeys(sentence for kind in self.kinds for sentence in conversions(kind)))

    def frames(self) -> Iterator[StereoFrame]:
        """The pictures, 8-bit grey. Raises InputError, naming the file, for one that is not as the first."""
        for index, shot in enumerate(self.shots()):
            eyes = [grey(picture, kind) for picture, kind in self._checked(shot)]
            yield StereoFrame(index, shot.t_ns, eyes[0], eyes[1] if len(eyes) > 1 else None)

    def encoded_frames(self) -> Iterator[EncodedFrame]:
        """The same as PNG or JPEG files, those found where they are 8-bit grey. Raises InputError as `frames`."""
        for index, shot in enumerate(self.shots()):
            checked = list(self._checked(shot))
            files = [as_file(picture, kind) for picture, kind in checked]
            if len({form for _, form in files}) > 1:  # a pair has one form
                pixels = [Picture(picture.name, grey(picture, kind)) for picture, kind in checked]
                files = [as_file(picture, kind_of(picture)) for picture in pixels]
            yield EncodedFrame(index, shot.t_ns, files[0][1], files[0][0], files[1][0] if len(files) > 1 else None)

    def _checked(self, shot: Shot) -> Iterator[tuple[Picture, Kind]]:
        for picture, first in zip(shot.pictures, self.kinds, strict=True):
            kind = kind_of(picture)
            if (kind.width_px, kind.height_px, kind.channels, kind.bits) != (
                first.width_px,
                first.height_px,
                first.channels,
                first.bits,
            ):
                raise InputError(f"the first picture has {first}, but this one has {kind}: {picture.name}")
            yield picture, kind
