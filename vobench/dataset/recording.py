"""A recording from another source: rig, truth, sensor readings, unread pictures, and notes on assumptions."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.dataset.overlap import overlapping_imu, overlapping_truth
from vobench.dataset.picture import EncodedPicture, Kind, as_file, conversions, grey, kind_of
from vobench.errors import InputError
from vobench.geometry.rig import SIDES, ImuCalibration, Rig, rectification
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.sequence import EncodedFrame, StereoFrame
from vobench.sequence.message import END_OF_STAMPS_NS
from vobench.trajectory.trajectory import Stamps, Trajectory


@dataclass(frozen=True, slots=True)
class Topics:
    """The topics of a bag by their content. A topic that is None is chosen by the names in the bag."""

    left: str | None = None
    right: str | None = None
    left_info: str | None = None
    right_info: str | None = None
    truth: str | None = None
    imu: str | None = None


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """Information that a dataset does not contain, or that replaces the information in it.

    `calibration` is a camchain.yaml of Kalibr, `imu` an imu.yaml of Kalibr, and `truth` a trajectory file.
    `topics` are the topics of a bag.
    `rate_hz` is the frame rate of pictures without stamps.
    `within_ns` is the largest difference between the stamps of the two pictures of a pair.
    `frames` are the frames to take, as A:B, from A to B - 1; None for all.
    """

    calibration: Path | None = None
    imu: Path | None = None
    truth: Path | None = None
    rate_hz: float | None = None
    within_ns: int = 1_000_000
    topics: Topics = Topics()
    frames: str | None = None


@dataclass(frozen=True, slots=True)
class RecordedFrame:
    """The pictures of one instant: the left one, or left and right."""

    t_ns: int
    pictures: tuple[EncodedPicture, ...]


Shots = Callable[[], Iterator[RecordedFrame]]
Notes = tuple[str, ...]  # sentences about what was assumed, converted or dropped


@dataclass(frozen=True, slots=True)
class PictureStream:
    """Frames that can be iterated several times, with one frame in memory at a time.

    `kinds` are the kinds of the pictures in the first frame.
    """

    shots: Shots
    kinds: tuple[Kind, ...]

    @classmethod
    def open(cls, shots: Shots) -> "PictureStream":
        """The stream of `shots`. The first frame is read. Raises InputError if its pictures cannot be read."""
        first = next(shots(), None)
        if first is None:
            raise InputError("a recording should have one image or more, but has none")
        kinds = tuple(kind_of(picture) for picture in first.pictures)
        return cls(shots, kinds)

    @property
    def size_px(self) -> tuple[int, int]:
        """The width and height of the first left picture."""
        return self.kinds[0].width_px, self.kinds[0].height_px

    def require(self, rig: Rig, calibration: str) -> None:
        """Raise InputError unless the pictures have the size of the rig's. `calibration` is the file of the rig."""
        for side, kind in zip(SIDES, self.kinds, strict=False):
            camera = rig.camera(side)
            picture_px = (kind.width_px, kind.height_px)
            if picture_px != (camera.width_px, camera.height_px):
                raise InputError(
                    f"the first {side} image has {kind.width_px} x {kind.height_px} pixels, "
                    f"but the calibration is for {camera.width_px} x {camera.height_px}: {calibration}"
                )

    def frames(self) -> Iterator[StereoFrame]:
        """The pictures in 8-bit grey. Raises InputError with the file for a picture that differs from the first."""
        for index, shot in enumerate(self.shots()):
            pictures = [grey(picture, kind) for picture, kind in self._checked(shot)]
            right = pictures[1] if len(pictures) > 1 else None
            yield StereoFrame(index, shot.t_ns, pictures[0], right)

    def encoded_frames(self) -> Iterator[EncodedFrame]:
        """The pictures as PNG or JPEG files. 8-bit grey files are not decoded. Raises InputError as in `frames`."""
        for index, shot in enumerate(self.shots()):
            checked = list(self._checked(shot))
            files = [as_file(picture, kind) for picture, kind in checked]
            forms = {form for _, form in files}
            if len(forms) > 1:  # both pictures of a pair must have the same form
                files = [_as_png(picture, kind) for picture, kind in checked]
            left, form = files[0]
            right = files[1][0] if len(files) > 1 else None
            yield EncodedFrame(index, shot.t_ns, form, left, right)

    def _checked(self, shot: RecordedFrame) -> Iterator[tuple[EncodedPicture, Kind]]:
        for picture, first in zip(shot.pictures, self.kinds, strict=True):
            kind = kind_of(picture)
            if replace(kind, form=first.form) != first:
                raise InputError(f"the first image has {first}, but this one has {kind}: {picture.name}")
            yield picture, kind


def _as_png(picture: EncodedPicture, kind: Kind) -> tuple[bytes, str]:
    pixels = EncodedPicture(picture.name, grey(picture, kind))
    return as_file(pixels, kind_of(pixels))


@dataclass(frozen=True, slots=True)
class CalibratedRig:
    """A rig, the source of its calibration for messages, and notes on it."""

    rig: Rig
    source: str
    notes: Notes


@dataclass(frozen=True, slots=True)
class CalibratedImu:
    """The readings and the calibration of an IMU, and notes on them. Both are None if one of them is missing."""

    readings: ImuReadings | None
    calibration: ImuCalibration | None
    notes: Notes


NO_TRUTH = "There is no ground truth."


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording of any form. Its pictures are read and checked when they are iterated.

    `frames` iterates over decoded pictures, and `encoded_frames` over picture files.
    `t_ns` (N,) are the stamps of the pictures.
    `truth` is the trajectory of the body in its world.
    Exposures consist of stamps (N,), and of times in s and gains in dB (N, 2).
    Encoder readings consist of stamps (M,) and counts (M, 2).
    `notes` are sentences about everything that was assumed, converted or dropped.
    What was not recorded is None.
    """

    form: str
    rig: Rig
    frames: Callable[[], Iterator[StereoFrame]]
    encoded_frames: Callable[[], Iterator[EncodedFrame]]
    t_ns: Stamps
    start_ns: int
    truth: Trajectory | None = None
    imu: ImuReadings | None = None
    encoders: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None
    exposures: tuple[NDArray[np.int64], Array] | None = None
    notes: Notes = ()

    @property
    def frame_count(self) -> int:
        """The number of pictures, or of pairs of pictures."""
        return len(self.t_ns)


LEAST_BASELINE_M = 1e-6
NM_DIGITS = 9  # of a distance in metres
UNRECTIFIABLE = (
    "The pair cannot be rectified: the right camera is not to the right of the left one, or looks another way."
)


def assemble(
    form: str,
    rig: Rig,
    stream: PictureStream,
    t_ns: Stamps,
    *,
    truth: Trajectory | None,
    imu: ImuReadings | None = None,
    notes: Iterable[str] = (),
    calibration: str,
) -> Recording:
    """The recording with pictures at stamps t_ns (N,) and a rig. Raises InputError if its parts do not fit together.

    `calibration` is the file of the rig, for messages.
    """
    stream.require(rig, calibration)
    all_notes = [*notes, *_pair_notes(rig, calibration)]
    for kind in stream.kinds:
        all_notes += conversions(kind)

    if truth is None:
        all_notes.append(NO_TRUTH)
    else:
        truth, truth_notes = overlapping_truth(truth, t_ns)
        all_notes += truth_notes
    if imu is not None and len(imu.t_ns):
        imu, imu_notes = overlapping_imu(imu, t_ns)
        all_notes += imu_notes
    if imu is None:
        rig = replace(rig, imu=None)

    starts_ns = [_checked_start_ns(t_ns, "an image")]
    if truth is not None and len(truth):
        starts_ns.append(_checked_start_ns(truth.t_ns, "a true pose"))
    if imu is not None and len(imu.t_ns):
        starts_ns.append(_checked_start_ns(imu.t_ns, "an IMU reading"))
    return Recording(
        form=form,
        rig=rig,
        frames=stream.frames,
        encoded_frames=stream.encoded_frames,
        t_ns=t_ns,
        start_ns=min(starts_ns),
        truth=truth,
        imu=imu,
        notes=tuple(dict.fromkeys(all_notes)),  # without duplicates
    )


def _pair_notes(rig: Rig, calibration: str) -> Notes:
    if rig.right is None:
        return ()
    if not rig.baseline_m > LEAST_BASELINE_M:
        raise InputError(
            f"the left and the right camera should be more than {LEAST_BASELINE_M:g} m apart, "
            f"but are {round(rig.baseline_m, NM_DIGITS):g} m apart: {calibration}"
        )
    is_rectifiable = rectification(rig) is not None
    return () if is_rectifiable else (UNRECTIFIABLE,)


def _checked_start_ns(t_ns: Stamps, what: str) -> int:
    """The first stamp. Raises InputError if a stamp is outside of the range of ROS stamps."""
    first_ns = int(t_ns[0])
    last_ns = int(t_ns[-1])
    if first_ns < 0 or last_ns >= END_OF_STAMPS_NS:
        wrong_ns = first_ns if first_ns < 0 else last_ns
        raise InputError(f"stamps should be within 0 and {END_OF_STAMPS_NS - 1} ns, but {what} has {wrong_ns}")
    return first_ns
