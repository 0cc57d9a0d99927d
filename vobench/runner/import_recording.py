"""Recordings made elsewhere, read before anything is run, and kept in the store as sequences."""

import hashlib
from pathlib import Path
from typing import Any

from vobench import stop
from vobench.dataset.recording import NO_TRUTH, ReadOptions, Recording, Topics
from vobench.errors import SuiteError
from vobench.runner.ground_truth import is_known
from vobench.runner.key import versions
from vobench.suite.source import FILE_KEYS, RecordedCase
from vobench.suite.suite import Plan
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
    """Why a recording cannot be scored, and what its reader says of the truth; empty where it can."""
    if recording.truth is None:
        said = [note.rstrip(".") for note in recording.notes if "truth" in note and note != NO_TRUTH]
        return f"no ground truth ({said[-1]})" if said else "no ground truth"
    known = int(is_known(recording.truth.t_ns, recording.t_ns).sum())
    return "" if known > 1 else f"the ground truth covers {known} of {recording.frame_count} pictures in time"


def read_case(case: RecordedCase) -> Recording:
    """The recording of a case. Raises VobenchError, naming the file, for whatever is wrong with it."""
    from vobench.dataset.layout import read

    source = case.source
    files: dict[str, Any] = {key: Path(file) for key in FILE_KEYS if (file := getattr(source, key))}
    options = ReadOptions(**files, rate_hz=source.rate_hz, topics=Topics(**source.topics))
    return read(Path(source.path), form=source.form, options=options)


def import_recording(recording: Recording, folder: Path) -> None:
    """Write a recording as a sequence, and with which versions. Raises VobenchError where a picture is wrong."""
    from vobench.dataset.sequence import convert

    convert(recording, folder, provenance=versions(*LIBRARIES))


def content(case: RecordedCase, recording: Recording) -> dict[str, Any]:
    """What is imported: the recording as read; files by size and time of change, for reading gigabytes is slow."""
    source = case.source
    truth = recording.truth
    files = [Path(file) for file in (source.path, source.calibration, source.imu) if file]
    return {
        "source": plain(source, exclude={"name"}),
        "files": [line for path in files for line in _listing(path)],
        # KITTI's lies outside the folder.
        "truth": hashlib.sha256(truth.t_ns.tobytes() + truth.T_world_frame.tobytes()).hexdigest() if truth else "",
    }


def _listing(path: Path) -> list[str]:
    """A line for each file: its path, size and time of change."""
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    return [f"{file.relative_to(path)} {(stat := file.stat()).st_size} {stat.st_mtime_ns}" for file in files]
