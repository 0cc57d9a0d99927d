"""Any recording by its path: its layout sniffed, then read, or a sentence."""

import struct
from collections.abc import Callable
from dataclasses import fields
from difflib import get_close_matches
from functools import partial
from pathlib import Path

from vobench.dataset.bag import read_bag
from vobench.dataset.euroc import read_euroc
from vobench.dataset.kitti import read_kitti
from vobench.dataset.picture import listed, require_itself
from vobench.dataset.recording import ReadOptions, Recording
from vobench.dataset.tartanair import read_tartanair
from vobench.dataset.tum import read_tum
from vobench.errors import InputError
from vobench.sequence import Sequence, has_truth, read_truth
from vobench.sequence.bag import part_of
from vobench.sequence.recording import MAGICS, METADATA
from vobench.sequence.writer import SENSORS_FILE

# What each form is known by, in the order in which they are looked for.
FORMS = {
    "vobench": f"a sequence of vobench: {SENSORS_FILE}",
    "ros2": f"a ROS 2 bag: a folder with {METADATA}, or a .db3 file",
    "tumvi": "TUM-VI: mav0/ and dso/",
    "euroc": "EuRoC or ASL: mav0/, or cam0/ with data.csv",
    "kitti": "KITTI odometry: image_0/ or image_2/",
    "tum": "TUM RGB-D: rgb.txt",
    "tartanair": "TartanAir: image_left/ or image_lcam_front/",
    "ros1": "a ROS 1 bag: a .bag file",
    "mcap": "an .mcap file",
}
FILE_FORMS = {".mcap": "mcap", ".bag": "ros1", ".db3": "ros2"}
ARCHIVES = {b"PK\x03\x04": "zip", b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"7z\xbc\xaf": "7z", b"\xfd7zXZ": "xz"}
KITTI_FOLDERS, TARTANAIR_FOLDERS = ("image_0", "image_2"), ("image_left", "image_lcam_front")
HEAD_BYTES = 512
TAR = slice(257, 262), b"ustar"
MCAP_MAGIC, MCAP_HEADER = b"\x89MCAP0\r\n", 1  # the opcode of the record that every MCAP file begins with
MOST_PROFILE = 256
READ = "read are MCAP files in ROS 2 form (profile ros2, CDR messages)"
MOST_LOOKED_AT = 200  # folders below, for a hint on where the recordings are
LEVELS_ABOVE = 3  # mav0/cam0/data is in one


def sniff(path: Path) -> str:
    """The form, one of FORMS. Raises InputError saying what was looked for and found, and what there is below."""
    if not path.exists():
        raise InputError(f"no file or folder at {path}")
    form = _folder_form(path) if path.is_dir() else _file_form(path)
    if form is None:
        raise InputError(_sentence(path))
    return form


def require_ros2(path: Path) -> None:
    """Raise InputError where an MCAP file holds messages of another kind. Source: mcap.dev/spec, Header."""
    head, start = _head(path), len(MCAP_MAGIC) + 13
    if not head.startswith(MCAP_MAGIC) or len(head) < start or head[len(MCAP_MAGIC)] != MCAP_HEADER:
        raise InputError(f"an MCAP file should begin with its header, this one does not: {path}")
    (length,) = struct.unpack_from("<I", head, start - 4)
    profile = head[start : start + min(length, MOST_PROFILE)].decode("utf-8", "replace")
    if profile == "ros2":
        return
    if profile == "ros1":
        raise InputError(f"an MCAP file with ROS 1 messages; {READ}, so turn it into a ROS 1 .bag or ROS 2: {path}")
    said = f"of the profile {profile!r}" if profile else "that names no profile (Protobuf or JSON, as a rule)"
    raise InputError(f"an MCAP file {said}; {READ}, so turn its messages into sensor_msgs first: {path}")


def _folder_form(folder: Path) -> str | None:
    """The first of FORMS whose files a folder has."""
    sensors = folder / SENSORS_FILE
    if sensors.is_file() or part_of(sensors).is_file():  # a torn one is told by its reader
        return "vobench"
    if (folder / METADATA).is_file():
        return "ros2"
    if _is_asl(folder):
        return "tumvi" if _has_dso(folder) else "euroc"
    folders = {name for name in (*KITTI_FOLDERS, *TARTANAIR_FOLDERS) if (folder / name).is_dir()}
    if folders.intersection(KITTI_FOLDERS):
        return "kitti"
    if (folder / "rgb.txt").is_file():
        return "tum"
    return "tartanair" if folders else None


def _is_asl(folder: Path) -> bool:
    return (folder / "mav0").is_dir() or (folder / "cam0" / "data.csv").is_file() or (folder / "cam0" / "data").is_dir()


def _has_dso(folder: Path) -> bool:
    return (folder / "dso").is_dir() or (folder.name == "mav0" and (folder.parent / "dso").is_dir())


def _file_form(path: Path) -> str | None:
    head = _head(path)
    require_itself(head, str(path))
    if path.name == SENSORS_FILE:
        return "vobench"
    return next((FILE_FORMS[suffix] for magic, suffix in MAGICS.items() if head.startswith(magic)), None)


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(HEAD_BYTES)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None


def _sentence(path: Path) -> str:
    """Why a path is none of the forms, and what might have been meant."""
    if not path.is_dir():
        head = _head(path)
        if packed := _packed(head):
            return f"a {packed} archive; unpack it and name the folder: {path}"
        begins = "it is empty" if not head else f"it begins with {head[:8]!r}"
        return f"no recording (MCAP, ROS bag or SQLite), for {begins}: {path}"
    above = next((folder for folder in (*path.resolve().parents,)[:LEVELS_ABOVE] if _folder_form(folder)), None)
    if above:
        return f"a part of a recording ({_folder_form(above)}), which is {above}; name that instead of {path}"
    names = listed(path)
    if not names:
        return f"an empty folder: {path}"
    below = _below(path)
    if below:
        return f"no recording itself, but there are some below; name one of {', '.join(below)}: {path}"
    some = ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
    return f"none of the forms that are read ({'; '.join(FORMS.values())}). It has {some}: {path}"


def _packed(head: bytes) -> str | None:
    """Which kind of archive a file is by its first bytes; tar says so late."""
    place, magic = TAR
    return "tar" if head[place] == magic else next((ARCHIVES[m] for m in ARCHIVES if head.startswith(m)), None)


def _below(folder: Path) -> list[str]:
    """Recordings one or two levels down, a few of them, as `name (form)`."""
    looked = [folder / name for name in listed(folder)[:MOST_LOOKED_AT]]
    looked += [inner / name for inner in looked if inner.is_dir() for name in listed(inner)[:MOST_LOOKED_AT]]
    found: list[str] = []
    for path in looked[:MOST_LOOKED_AT]:
        form = _folder_form(path) if path.is_dir() else FILE_FORMS.get(path.suffix)
        if form and not any(path.is_relative_to(folder / one.rpartition(" (")[0]) for one in found):
            found.append(f"{path.relative_to(folder)} ({form})")
    return found[:5] + ([f"{len(found) - 5} more"] if len(found) > 5 else [])


Reader = Callable[[Path, ReadOptions], Recording]


def read_own(folder: Path, _options: ReadOptions) -> Recording:
    """All that the sensors of a sequence of our own say, and its true path. Raises SequenceError."""
    sequence = Sequence.open(folder)
    stamps, imu = sequence.frame_stamps(), sequence.imu()
    encoders, exposures = sequence.encoders(), sequence.exposures()
    truth = read_truth(folder) if has_truth(folder) else None
    streams = [stamps, imu.t_ns, encoders[0], *([] if truth is None else [truth.t_ns])]
    return Recording(
        form="vobench",
        rig=sequence.rig,
        frames=sequence.frames,
        encoded_frames=sequence.encoded_frames,
        t_ns=stamps,
        start_ns=min(int(t_ns[0]) for t_ns in streams if len(t_ns)),
        truth=truth,
        imu=imu if len(imu.t_ns) else None,
        encoders=encoders if len(encoders[0]) else None,
        exposures=exposures if len(exposures[0]) else None,
        notes=("The sequence's case, true rig, true velocities and what is true of pixels were not carried over.",),
    )


ASL = frozenset({"calibration", "imu", "truth", "within_ns"})
BAG = frozenset({"calibration", "imu", "within_ns", "topics"})
# Each form's reader, and the options that it heeds.
READERS: dict[str, tuple[Reader, frozenset[str]]] = {
    "vobench": (read_own, frozenset()),
    "euroc": (read_euroc, ASL),
    "tumvi": (partial(read_euroc, form="tumvi"), ASL),
    "kitti": (read_kitti, frozenset({"calibration", "truth"})),
    "tum": (read_tum, frozenset({"calibration", "truth"})),
    "tartanair": (read_tartanair, frozenset({"calibration", "truth", "rate_hz"})),
    "ros1": (partial(read_bag, form="ros1"), BAG),
    "ros2": (partial(read_bag, form="ros2"), BAG),
    "mcap": (partial(read_bag, form="mcap"), BAG),
}


def read(path: Path, *, form: str | None = None, options: ReadOptions | None = None) -> Recording:
    """The recording at a path, its pictures not yet read; `form` overrides what `sniff` would say.

    Raises VobenchError, one sentence naming the file, where it is no recording, or one that is wrong.
    """
    try:
        return _read(path, form, options or ReadOptions())
    except OSError as error:  # a folder that may not be looked into
        raise InputError(f"cannot read {error.filename or path}: {error.strerror or error}") from None


def _read(path: Path, form: str | None, options: ReadOptions) -> Recording:
    kind = _known(form) if form is not None else sniff(path)
    reader, heeded = READERS[kind]
    _require_heeded(options, heeded, kind)
    if kind == "mcap":
        require_ros2(path)
    if kind == "vobench" and path.is_file():
        path = path.parent
    return reader(path, options)


def _known(form: str) -> str:
    if form not in FORMS:
        near = get_close_matches(form, FORMS, n=1)
        raise InputError(f"no form {form!r}.{f' Did you mean {near[0]!r}?' if near else ''} Known: {', '.join(FORMS)}")
    return form


def _require_heeded(options: ReadOptions, heeded: frozenset[str], form: str) -> None:
    """Raise InputError for an option that would make no difference."""
    plain = ReadOptions()
    said = [field.name for field in fields(ReadOptions) if getattr(options, field.name) != getattr(plain, field.name)]
    idle = [name for name in said if name not in heeded]
    if idle:
        knows = ", ".join(sorted(heeded)) or "none"
        raise InputError(f"the option {idle[0]} means nothing to a recording of the form {form}; it heeds: {knows}")
