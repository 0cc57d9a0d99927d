"""A recording made elsewhere: rig, truth, readings, pictures unread, and all that was assumed of it."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from os.path import isfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.dataset.picture import (
    Kind,
    Picture,
    as_file,
    conversions,
    grey,
    inside,
    kind_of,
    listed,
    read_bytes,
    read_text,
)
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.rig import SIDES, Rig, rectification
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.sequence import EncodedFrame, StereoFrame
from vobench.sequence.messages import END_OF_STAMPS_NS
from vobench.trajectory.associate import associate
from vobench.trajectory.formats import NUMBER, Table, Unit, content, parse_any, stamps_ns
from vobench.trajectory.trajectory import Stamps, Trajectory


@dataclass(frozen=True, slots=True)
class Topics:
    """Which topics of a bag are meant; None where its own names say so."""

    left: str | None = None
    right: str | None = None
    left_info: str | None = None
    right_info: str | None = None
    truth: str | None = None
    imu: str | None = None


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """Kalibr's camchain.yaml and imu.yaml, a trajectory file with the truth, and topics of a bag.

    `rate_hz` is for pictures without stamps. Pictures of both eyes are one pair up to `within_ns` apart.
    """

    calibration: Path | None = None
    imu: Path | None = None
    truth: Path | None = None
    rate_hz: float | None = None
    within_ns: int = 1_000_000
    topics: Topics = Topics()


@dataclass(frozen=True, slots=True)
class RecordedFrame:
    """The pictures of one instant: the left one, or left and right."""

    t_ns: int
    pictures: tuple[Picture, ...]


Shots = Callable[[], Iterator[RecordedFrame]]
Notes = tuple[str, ...]  # sentences on what was assumed, converted or dropped


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

    def _checked(self, shot: RecordedFrame) -> Iterator[tuple[Picture, Kind]]:
        for picture, first in zip(shot.pictures, self.kinds, strict=True):
            kind = kind_of(picture)
            if replace(kind, form=first.form) != first:
                raise InputError(f"the first picture has {first}, but this one has {kind}: {picture.name}")
            yield picture, kind


NO_TRUTH = "There is no ground truth."


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording of any form, all pictures unread: `frames` reads and checks them, `encoded_frames` keeps grey files.

    `t_ns` (N,) are the pictures' stamps; `truth` is the path of the body in its world. Exposures are their stamps (N,)
    and times in s and gains in dB (N, 2), encoders their stamps (M,) and counts (M, 2); None stands for what there is
    not. `notes` are sentences: everything assumed, converted or dropped.
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
        """How many pictures, or pairs of them, there are."""
        return len(self.t_ns)


EXACT = 1e-9  # a rotation this far off its transpose's inverse was written with all its digits


def read_truth_file(path: Path, frames_ns: Stamps) -> tuple[Trajectory, Notes]:
    """A trajectory in any form of text, and what was done to it; a row without a stamp has that of its picture.

    A row of 13 numbers is KITTI's behind the picture's number, from 0. Of rows with one stamp the first is kept.
    Raises TrajectoryError naming file and line for a pose that is none, InputError where rows and pictures differ.
    """
    parsed = parse_any(read_text(path), name=str(path))
    t_ns = parsed.stamped_by(frames_ns) if parsed.t_ns is None else parsed.t_ns
    if t_ns is None and parsed.frames is not None:
        raise InputError(
            f"the first of 13 columns should be a picture's number, from 0 to {len(frames_ns) - 1}, "
            f"but there is {parsed.frames[-1]}: {path}"
        )
    if t_ns is None:
        raise InputError(
            f"{len(parsed.T)} poses without stamps for {len(frames_ns)} pictures: give one pose a picture, or each "
            f"row its picture's number, from 0, as a first of 13 columns: {path}"
        )
    T = parsed.T
    notes = list(parsed.notes)
    off = np.abs(np.swapaxes(T[:, :3, :3], -1, -2) @ T[:, :3, :3] - np.eye(3)).max(initial=0.0)
    if parsed.frames is not None:
        notes.append(f"{path.name} has poses of {len(T)} of {len(frames_ns)} pictures, by their numbers.")
    if off > EXACT:
        T = se3.transform(se3.nearest_rotation(T[:, :3, :3]), T[:, :3, 3])
        notes.append(f"Rotations of {path.name} were made exact; they were up to {off:.1g} off.")
    return Trajectory(t_ns, T), tuple(notes)


def truth_file(
    options: ReadOptions, beside: Iterable[Path], frames_ns: Stamps, whose: str, turn: Array | None = None
) -> tuple[Trajectory | None, Notes]:
    """The truth that the options name, or the first one beside the pictures; `turn` (4, 4) turns its axes into ours."""
    path = options.truth or next((path for path in beside if path.exists()), None)
    if path is None:
        return None, ()
    truth, notes = read_truth_file(path, frames_ns)
    if turn is not None:
        truth = Trajectory(truth.t_ns, turn @ truth.T_world_frame @ turn.T)
    return truth, (f"The truth is {path.name}, {whose}", *notes)


def cut_to(truth: Trajectory, frames_ns: Stamps) -> tuple[Trajectory | None, Notes]:
    """The truth from the last pose before the first picture to the first after the last one, and what that dropped."""
    t_ns = truth.t_ns
    inside = around(truth.t_ns, frames_ns)
    if inside is None:
        return None, (apart("truth", t_ns, frames_ns),)
    kept = Trajectory(t_ns[inside], truth.T_world_frame[inside])
    notes = []
    if len(kept) < len(truth):
        notes.append(f"{len(truth) - len(kept)} of {len(truth)} true poses lie outside the pictures' time; dropped.")
    bare = int(np.sum((frames_ns < t_ns[0]) | (frames_ns > t_ns[-1])))
    if bare:
        notes.append(f"{bare} of {len(frames_ns)} pictures lie outside the truth's time; they have no true pose.")
    return kept, tuple(notes)


def around(t_ns: Stamps, frames_ns: Stamps) -> slice | None:
    """From the last stamp before the first picture to the first after the last one; None where they share no time."""
    first = frames_ns[0]
    last = frames_ns[-1]
    if not len(t_ns) or t_ns[-1] < first or t_ns[0] > last:
        return None
    begin = max(int(np.searchsorted(t_ns, first, side="right")) - 1, 0)
    return slice(begin, int(np.searchsorted(t_ns, last, side="left")) + 1)


def apart(what: str, t_ns: Stamps, frames_ns: Stamps) -> str:
    """The sentence on truth or readings whose time is not the pictures'."""
    when = f" ({t_ns[0]} to {t_ns[-1]} ns)" if len(t_ns) else ""
    return f"The {what}{when} was dropped: it shares no time with the pictures ({frames_ns[0]} to {frames_ns[-1]} ns)."


LEAST_BASELINE_M = 1e-6
UNRECTIFIABLE = "The right camera is not to the right of the left one and looking the same way: nothing rectifies them."


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
    """A recording at stamps t_ns (N,) by the rig of the file `calibration`. Raises InputError where they do not fit."""
    stream.require(rig, calibration)
    converted = [sentence for kind in stream.kinds for sentence in conversions(kind)]
    said = [*notes, *_pair_notes(rig, calibration), *converted]
    if truth is None:
        said.append(NO_TRUTH)
    else:
        truth, cut = cut_to(truth, t_ns)
        said += cut
    if imu is not None and len(imu.t_ns):
        imu, cut = _imu_within(imu, t_ns)
        said += cut
    if imu is None:
        rig = replace(rig, imu=None)
    streams = [(t_ns, "picture"), *([(truth.t_ns, "true pose")] if truth else [])]
    streams += [(imu.t_ns, "IMU reading")] if imu and len(imu.t_ns) else []
    return Recording(
        form=form,
        rig=rig,
        frames=stream.frames,
        encoded_frames=stream.encoded_frames,
        t_ns=t_ns,
        start_ns=min(_span(*stamps) for stamps in streams),
        truth=truth,
        imu=imu,
        notes=tuple(dict.fromkeys(said)),
    )


def _pair_notes(rig: Rig, calibration: str) -> Notes:
    if rig.right is None:
        return ()
    if not rig.baseline_m > LEAST_BASELINE_M:
        raise InputError(f"left and right camera are in one place, {LEAST_BASELINE_M:g} m or less apart: {calibration}")
    return () if rectification(rig) else (UNRECTIFIABLE,)


def _imu_within(imu: ImuReadings, frames_ns: Stamps) -> tuple[ImuReadings | None, Notes]:
    """The readings of the pictures' time, with one before and one after as the truth has, and what that dropped."""
    inside = around(imu.t_ns, frames_ns)
    count = len(imu.t_ns)
    if inside is None:
        return None, (apart("IMU", imu.t_ns, frames_ns),)
    kept = ImuReadings(imu.t_ns[inside], imu.gyro_radps[inside], imu.accel_mps2[inside])
    if len(kept.t_ns) == count:
        return kept, ()
    lasts_s = [(t_ns[-1] - t_ns[0]) / 1e9 for t_ns in (imu.t_ns, frames_ns)]
    return kept, (
        f"{count - len(kept.t_ns)} of {count} IMU readings lie outside the pictures' time "
        f"({lasts_s[0]:.1f} s beside {lasts_s[1]:.1f} s); dropped.",
    )


def _span(t_ns: Stamps, what: str) -> int:
    """The first stamp. Raises InputError where one is no ROS time."""
    first = int(t_ns[0])
    last = int(t_ns[-1])
    if first < 0 or last >= END_OF_STAMPS_NS:
        raise InputError(
            f"stamps should be within 0 and {END_OF_STAMPS_NS - 1} ns, but a {what} has {first if first < 0 else last}"
        )
    return first


NUMBERED = re.compile(r"([0-9]{1,12})[A-Za-z_]*\.(?:png|jpg|jpeg)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class PictureList:
    """One eye's pictures, in order of time: stamps (N,) and files, which may be absent."""

    name: str
    t_ns: Stamps
    paths: tuple[Path, ...]

    def at(self, index: Stamps) -> "PictureList":
        """Those of some indices (K,)."""
        return PictureList(self.name, self.t_ns[index], tuple(self.paths[i] for i in index.tolist()))


def read_list(path: Path, folder: Path, *, separator: str | None, unit: Unit) -> PictureList:
    """A list of stamps and names of pictures below `folder`. Raises InputError naming file and line."""
    rows = content(read_text(path))
    if not rows:
        raise InputError(f"the list has no picture: {path}")
    fields = [[field.strip() for field in body.split(separator, 1)] for _, body in rows]
    if separator == "," and not NUMBER.fullmatch(fields[0][0]):
        # a header without its #
        rows = rows[1:]
        fields = fields[1:]
    for (line, body), row in zip(rows, fields, strict=True):
        if len(row) != 2 or not NUMBER.fullmatch(row[0]):
            raise InputError(f"{path}:{line}: a row should be a stamp and a picture's name, but is {body[:80]!r}")
    stamps = [row[0] for row in fields]
    table = Table(str(path), [line for line, _ in rows], stamps, np.empty((len(rows), 0)))
    t_ns = stamps_ns(table, unit)
    paths = tuple(inside(folder, row[1], table.place(index)) for index, row in enumerate(fields))
    return PictureList(str(path), t_ns, paths)


def listed_pictures(
    *lists: tuple[Path, Path], separator: str | None, unit: Unit, within_ns: int = 0
) -> tuple[list[PictureList], Notes]:
    """The pictures of one or two eyes, each by its list and the folder that its names start from, and what to note.

    Pictures up to `within_ns` apart are a pair. Raises InputError as `read_list` does, and where no pair is there.
    """
    eyes = [read_list(path, folder, separator=separator, unit=unit) for path, folder in lists]
    notes = Notes()
    if len(eyes) > 1:
        left, right = eyes
        at_left, at_right, notes = partners(left.t_ns, right.t_ns, within_ns, f"{left.name} and {right.name}")
        eyes = [left.at(at_left), right.at(at_right)]
    found, missing = _present(*eyes)
    return found, (*notes, *missing)


def _present(*eyes: PictureList) -> tuple[list[PictureList], Notes]:
    # pathlib's own is_file raises for a name that is too long.
    is_there = np.array([all(map(isfile, paths)) for paths in zip(*(eye.paths for eye in eyes), strict=True)])
    if is_there.all():
        return list(eyes), ()
    absent = [path for at in np.flatnonzero(~is_there) for eye in eyes if not isfile(path := eye.paths[at])]
    what = "pairs" if len(eyes) > 1 else "pictures"
    if not is_there.any():
        named = " and ".join(eye.name for eye in eyes)
        raise InputError(f"of none of the {len(is_there)} {what} in {named} the files are there; missing: {absent[0]}")
    found = np.flatnonzero(is_there)
    first = "/".join(absent[0].parts[-3:])
    return [eye.at(found) for eye in eyes], (f"{_dropped(is_there, eyes[0].t_ns, what)} The first is {first}.",)


def _dropped(is_there: NDArray[np.bool_], t_ns: Stamps, what: str) -> str:
    """How many pictures are missing, and where: those amid the others leave gaps."""
    found = np.flatnonzero(is_there)
    ends = int(found[0]), len(is_there) - 1 - int(found[-1])
    amid = len(is_there) - len(found) - sum(ends)
    longest_s = np.diff(t_ns[found]).max(initial=0) / 1e9
    counts = {
        "at the start": ends[0],
        f"amid the others (a gap of up to {longest_s:.3g} s)": amid,
        "at the end": ends[1],
    }
    where = ", ".join(f"{count} {place}" for place, count in counts.items() if count)
    return f"{len(is_there) - len(found)} of {len(is_there)} {what} were dropped, for files are missing: {where}."


def numbered(*folders: Path) -> list[tuple[Path, ...]]:
    """The pictures of one or two eyes, of the same numbers without a gap. Raises InputError naming one that is not."""
    eyes = [_numbered(folder) for folder in folders]
    left, right = (tuple(eye.values()) for eye in (eyes[0], eyes[-1]))
    if len(left) != len(right):
        raise InputError(
            f"{len(left)} left and {len(right)} right pictures; there should be as many: {folders[0]} and {folders[-1]}"
        )
    if min(eyes[0]) != min(eyes[-1]):
        raise InputError(f"the first left and right pictures have other numbers: {left[0]} and {right[0]}")
    return [left, right][: len(folders)]


def _numbered(folder: Path) -> dict[int, Path]:
    found = sorted((int(match[1]), name) for name in listed(folder) if (match := NUMBERED.fullmatch(name)))
    if not found:
        raise InputError(f"no numbered PNG or JPEG picture in {folder}")
    first, pattern = found[0]
    for expected, (number, name) in enumerate(found, first):
        if number < expected:
            raise InputError(f"two pictures have the number {number}: {folder / name}")
        if number > expected:
            width = sum(character.isdigit() for character in pattern.partition(".")[0])
            raise InputError(f"a picture is missing: {folder / (f'{expected:0{width}d}' + pattern[width:])}")
    return {number: folder / name for number, name in found}


def partners(left_ns: Stamps, right_ns: Stamps, within_ns: int, name: str) -> tuple[Stamps, Stamps, Notes]:
    """Indices (K,) of the left and right stamps that make pairs, and notes. Raises InputError where none do."""
    pairs = associate(left_ns, right_ns, max_diff_ns=within_ns)
    if not len(pairs):
        raise InputError(f"no left and right picture have stamps within {within_ns} ns of each other in {name}")
    notes = []
    lonely = len(left_ns) - len(pairs), len(right_ns) - len(pairs)
    if any(lonely):
        notes.append(f"{lonely[0]} left and {lonely[1]} right pictures without a partner were dropped.")
    apart_ns = int(np.abs(left_ns[pairs.gt] - right_ns[pairs.est]).max())
    if apart_ns:
        notes.append(f"Stamps of the two eyes are up to {apart_ns} ns apart; the left one's stands for both.")
    return pairs.gt, pairs.est, tuple(notes)


def picture_files(t_ns: Stamps, *eyes: Sequence[Path]) -> PictureStream:
    """The pictures of one or two eyes, read from their files as one goes. Raises InputError as `open` does."""

    def shots() -> Iterator[RecordedFrame]:
        for t, paths in zip(t_ns.tolist(), zip(*eyes, strict=True), strict=True):
            yield RecordedFrame(t, tuple(Picture(str(path), read_bytes(path)) for path in paths))

    return PictureStream.open(shots)
