"""Recordings made elsewhere, read before anything is run, and kept in the store as sequences."""

import hashlib
from pathlib import Path
from typing import Any

from vobench import stop
from vobench.dataset.recording import NO_TRUTH, ReadOptions, Recording, Topics
from vobench.errors import SuiteError
from vobench.run.score import is_known
from vobench.run.store import Context, Store, code_digest, library_versions, versions
from vobench.suite.source import RecordedCase
from vobench.suite.suite import Plan
from vobench.suite.yaml_file import plain

LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "mcap", "rosbags")


def read_all(plan: Plan) -> dict[str, Recording]:
    """The recording of each recorded case by its name: said before hours of work.

    Raises SuiteError, with the places in the suite's file, where some cannot be read or have no ground truth.
    """
    recordings, wrong = dict[str, Recording](), plan.mistakes()
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
    from vobench.dataset.read import read

    source = case.source
    options = ReadOptions(
        calibration=_path(source.calibration),
        imu=_path(source.imu),
        truth=_path(source.truth),
        rate_hz=source.rate_hz,
        topics=Topics(**source.topics),
    )
    return read(Path(source.path), form=source.form, options=options)


def _path(file: str | None) -> Path | None:
    return None if file is None else Path(file)


def import_case(case: RecordedCase, shop: Context) -> Path:
    """The folder of the case's sequence; made where the store has none of these files as they are now."""
    recording = read_case(case)

    def build(folder: Path) -> None:
        with shop.progress.step(f"import {case.name}"):
            import_recording(recording, folder)

    return shop.store.get("sequences", _inputs(case, recording), build)


def is_imported(case: RecordedCase, recording: Recording, store: Store) -> bool:
    """Whether the store has the case's sequence already; `recording` is what `read_all` has of it."""
    return store.path("sequences", _inputs(case, recording)).is_dir()


def import_recording(recording: Recording, folder: Path) -> None:
    """Write a recording as a sequence, and with which versions. Raises VobenchError where a picture is wrong."""
    from vobench.dataset.convert import convert

    convert(recording, folder, provenance=versions(*LIBRARIES))


def _inputs(case: RecordedCase, recording: Recording) -> dict[str, Any]:
    """All that an imported sequence depends on; files by size and time of change, for reading gigabytes is slow."""
    source, truth = case.source, recording.truth
    files = [Path(file) for file in (source.path, source.calibration, source.imu) if file]
    return {
        "source": plain(source, exclude={"name"}),
        "files": [line for path in files for line in _listing(path)],
        # KITTI's lies outside the folder.
        "truth": hashlib.sha256(truth.t_ns.tobytes() + truth.T_world_frame.tobytes()).hexdigest() if truth else "",
        "code": code_digest("geometry", "trajectory", "sensor", "sequence", "dataset"),
        "libraries": library_versions(*LIBRARIES),
    }


def _listing(path: Path) -> list[str]:
    """A line for each file: its path, size and time of change."""
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    return [f"{file.relative_to(path)} {(stat := file.stat()).st_size} {stat.st_mtime_ns}" for file in files]
