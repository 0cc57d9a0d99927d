"""Recordings made elsewhere, read before anything is run, and kept in the store as sequences."""

import hashlib
from pathlib import Path
from typing import Any

from vobench import stop
from vobench.dataset.recording import NO_TRUTH, ReadOptions, Recording, Topics
from vobench.errors import SuiteError
from vobench.runner.ground_truth import is_known
from vobench.runner.key import versions
from vobench.suite.plan import Plan
from vobench.suite.source import FILE_KEYS, RecordedCase
from vobench.suite.yaml_file import plain

LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "mcap", "rosbags")


def read_all(plan: Plan) -> dict[str, Recording]:
    """The recording of each recorded case by its name: said before hours of work.

    Raises SuiteError, with the places in the suite's file, where some cannot be read or have no ground truth.
    """
    recordings = dict[str, Recording]()
    wrong = plan.mistakes()
    for case in plan.recorded:
        stop.check()
        with wrong.at("source", case.entry):
            recordings[case.name] = recording = read_case(case)
            if cause := _why_not_scored(recording):
                raise SuiteError(f"{cause}, so nothing could be scored: {case.source.path}")
    wrong.require_none()
    return recordings


def _why_not_scored(recording: Recording) -> str:
    """Why a recording cannot be scored, with its reader's note on the truth; empty if it can."""
    if recording.truth is None:
        notes = [note.rstrip(".") for note in recording.notes if "truth" in note and note != NO_TRUTH]
        return f"no ground truth ({notes[-1]})" if notes else "no ground truth"
    known = int(is_known(recording.truth.t_ns, recording.t_ns).sum())
    return "" if known > 1 else f"the ground truth covers {known} of {recording.frame_count} pictures in time"


def read_case(case: RecordedCase) -> Recording:
    """The recording of a case. Raises VobenchError, naming the file, for whatever is wrong with it."""
    from vobench.dataset.layout import read

    source = case.source
    files: dict[str, Any] = {}
    for key in FILE_KEYS:
        file = getattr(source, key)
        if file:
            files[key] = Path(file)
    topics = Topics(**source.topics)
    options = ReadOptions(**files, rate_hz=source.rate_hz, topics=topics)
    return read(Path(source.path), form=source.form, options=options)


def import_recording(recording: Recording, folder: Path) -> None:
    """Write a recording as a sequence, and with which versions. Raises VobenchError where a picture is wrong."""
    from vobench.dataset.sequence import convert

    convert(recording, folder, provenance=versions(*LIBRARIES))


def content(case: RecordedCase, recording: Recording) -> dict[str, Any]:
    """The recording that is imported: its files by size and time of change, since reading gigabytes is slow."""
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
    """A hash of the ground truth, which may lie outside of the folder, as KITTI's does."""
    truth = recording.truth
    if not truth:
        return ""
    content = truth.t_ns.tobytes() + truth.T_world_frame.tobytes()
    return hashlib.sha256(content).hexdigest()


def _listing(path: Path) -> list[str]:
    """A line for each file: its path, size and time of change."""
    files = [path]
    if path.is_dir():
        files = sorted(file for file in path.rglob("*") if file.is_file())
    lines = []
    for file in files:
        facts = file.stat()
        lines.append(f"{file.relative_to(path)} {facts.st_size} {facts.st_mtime_ns}")
    return lines
