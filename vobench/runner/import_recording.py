"""Reads the recordings of a plan before it is run, and imports them to the store as sequences."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vobench import stop
from vobench.dataset.recording import NO_TRUTH, ReadOptions, Recording, Topics
from vobench.errors import SuiteError
from vobench.runner.ground_truth import is_known
from vobench.runner.key import versions
from vobench.runner.store import sweep, unfinished
from vobench.suite.plan import Plan
from vobench.suite.source import FILE_KEYS, RecordedCase
from vobench.suite.yaml_file import plain

# The libraries whose versions are recorded with an imported sequence.
LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "mcap", "rosbags")


def read_all(plan: Plan) -> dict[str, Recording]:
    """The recording of each recorded case by name. They are read first, so that errors are found before the run.

    Raises SuiteError, with the places in the suite, if recordings cannot be read or have no ground truth.
    """
    recordings = dict[str, Recording]()
    mistakes = plan.mistakes()
    for case in plan.recorded:
        stop.check()
        with mistakes.at("source", case.entry):
            recording = read_case(case)
            recordings[case.name] = recording
            obstacle = _scoring_obstacle(recording)
            if obstacle:
                raise SuiteError(f"{obstacle}, so nothing could be scored: {case.source.path}")
    mistakes.require_none()
    return recordings


def _scoring_obstacle(recording: Recording) -> str:
    """The reason why a recording cannot be scored, with the note on its truth; empty if it can be scored."""
    if recording.truth is None:
        truth_notes = [note for note in recording.notes if "truth" in note and note != NO_TRUTH]
        if not truth_notes:
            return "no ground truth"
        last_note = truth_notes[-1].rstrip(".")
        return f"no ground truth ({last_note})"

    # At least two frames need a true pose, because a single pose has no motion.
    known_count = int(is_known(recording.truth.t_ns, recording.t_ns).sum())
    if known_count > 1:
        return ""
    return f"the ground truth covers {known_count} of {recording.frame_count} images in time"


def read_case(case: RecordedCase) -> Recording:
    """The recording of a case. Raises VobenchError with the file if it cannot be read."""
    from vobench.dataset.layout import read

    source = case.source
    files: dict[str, Any] = {}
    for key in FILE_KEYS:
        file = getattr(source, key)
        if file:
            files[key] = Path(file)
    topics = Topics(**source.topics)
    options = ReadOptions(**files, rate_hz=source.rate_hz, topics=topics, frames=source.frames)
    return read(Path(source.path), form=source.form, options=options)


@dataclass(frozen=True, slots=True)
class ImportedSequence:
    """The form of a dataset that was imported, its number of frames, and notes on what was assumed or left out."""

    form: str
    frame_count: int
    notes: tuple[str, ...]


def import_dataset(path: Path, out: Path, *, form: str | None, options: ReadOptions) -> ImportedSequence:
    """Convert a dataset's folder or a bag to a sequence in a new folder.

    Without a form, it is recognized. Raises VobenchError if the dataset cannot be read, or `out` is not free.
    """
    from vobench.dataset.layout import read
    from vobench.dataset.picture import require_free
    from vobench.sequence import Sequence

    require_free(out)
    recording = read(path, form=form, options=options)
    parent = out.resolve().parent
    sweep(parent)  # remove what interrupted imports have left
    with unfinished(parent) as folder:
        import_recording(recording, folder)
        if out.is_dir():
            out.rmdir()  # `out` may be an empty folder
        folder.rename(out)
    frame_count = len(Sequence.open(out))
    return ImportedSequence(recording.form, frame_count, tuple(recording.notes))


def import_recording(recording: Recording, folder: Path) -> None:
    """Write a recording as a sequence, with the versions of libraries. Raises VobenchError for an invalid picture."""
    from vobench.dataset.sequence import convert

    convert(recording, folder, provenance=versions(*LIBRARIES))


def content(case: RecordedCase, recording: Recording) -> dict[str, Any]:
    """The identity of a recording, from which the key of its sequence in the store is computed.

    Files are identified by their size and modification time, because hashing them would be slow.
    """
    source = case.source
    listing = []
    for file in (source.path, source.calibration, source.imu):
        if file:
            listing += _listing(Path(file))
    return {
        "source": plain(source, exclude={"name"}),
        "files": listing,
        "truth": _truth_hash(recording),
    }


def _truth_hash(recording: Recording) -> str:
    """A hash of the ground truth, which can be outside of the folder, as in KITTI."""
    truth = recording.truth
    if not truth:
        return ""
    content = truth.t_ns.tobytes() + truth.T_world_frame.tobytes()
    return hashlib.sha256(content).hexdigest()


def _listing(path: Path) -> list[str]:
    """One line per file: its path, size and modification time."""
    files = [path]
    if path.is_dir():
        files = sorted(file for file in path.rglob("*") if file.is_file())
    lines = []
    for file in files:
        status = file.stat()
        lines.append(f"{file.relative_to(path)} {status.st_size} {status.st_mtime_ns}")
    return lines
