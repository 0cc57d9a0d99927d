"""Any recording by its path: sniffed, read by the reader of its form, told in sentences where that can't be."""

from collections.abc import Callable
from dataclasses import fields
from difflib import get_close_matches
from functools import partial
from pathlib import Path

from vobench.dataset.bag import read_bag
from vobench.dataset.euroc import read_euroc
from vobench.dataset.kitti import read_kitti
from vobench.dataset.options import Options
from vobench.dataset.recording import Recording
from vobench.dataset.sniff import FORMS, require_ros2, sniff
from vobench.dataset.tartanair import read_tartanair
from vobench.dataset.tum import read_tum
from vobench.errors import InputError
from vobench.sequence import Sequence, has_truth, read_truth

Reader = Callable[[Path, Options], Recording]


def read_own(folder: Path, _options: Options) -> Recording:
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


def read(path: Path, *, form: str | None = None, options: Options | None = None) -> Recording:
    """The recording at a path, its pictures not yet read; `form` overrides what `sniff` would say.

    Raises VobenchError, one sentence naming the file, where it is no recording, or one that is wrong.
    """
    try:
        return _read(path, form, options or Options())
    except OSError as error:  # a folder that may not be looked into
        raise InputError(f"cannot read {error.filename or path}: {error.strerror or error}") from None


def _read(path: Path, form: str | None, options: Options) -> Recording:
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


def _require_heeded(options: Options, heeded: frozenset[str], form: str) -> None:
    """Raise InputError for an option that would make no difference."""
    plain = Options()
    said = [field.name for field in fields(Options) if getattr(options, field.name) != getattr(plain, field.name)]
    idle = [name for name in said if name not in heeded]
    if idle:
        knows = ", ".join(sorted(heeded)) or "none"
        raise InputError(f"the option {idle[0]} means nothing to a recording of the form {form}; it heeds: {knows}")
