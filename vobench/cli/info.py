"""vobench info."""

from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.cli import terminal
from vobench.cli.option import Json, with_option_groups
from vobench.cli.recording_option import FormCommand, ImuFile, RecordingOptions, RecordingPath
from vobench.dataset.layout import read
from vobench.dataset.recording import Recording
from vobench.errors import VobenchError
from vobench.geometry.rig import Rig
from vobench.sequence import has_truth, payload_hash, read_import_notes, read_provenance
from vobench.sequence.recording import is_recording, topic_facts
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from rich.console import Console

COMMAND_CLASS = FormCommand
SEQUENCE_FORM = "vobench"
TOPIC_HEADINGS = ("name", "kind", "messages", "Hz", "seconds")


@with_option_groups
def info_command(
    path: RecordingPath,
    *,
    recording_options: RecordingOptions,
    imu: ImuFile = None,
    json: Json = False,
) -> None:
    """Print the topics, rates, duration, calibration, ground truth and hash of a recording.

    The topics of a bag are also printed if it cannot be read, such as for want of a calibration: they are what the
    options name.
    """
    try:
        recording = read(path, form=recording_options.form, options=recording_options.read_options(imu))
    except VobenchError:
        if not json:
            _print_topics_of_bag(path)
        raise
    facts = _facts(path, recording)
    if json:
        terminal.print_json(facts)
    else:
        _print_facts(facts)


def _print_topics_of_bag(path: Path) -> None:
    """Print the topics of a bag; nothing for other paths, and for a bag that cannot be read at all."""
    if not path.exists() or not is_recording(path):
        return
    with suppress(VobenchError):
        _print_topics(path.name, _topics(path), terminal.console())


def _facts(path: Path, recording: Recording) -> dict[str, Any]:
    if recording.form == SEQUENCE_FORM:
        identity = _sequence_identity(path.parent if path.is_file() else path)
    else:
        identity = {"notes": list(recording.notes)}
    return {
        "path": str(path),
        "form": recording.form,
        "frames": recording.frame_count,
        "duration_s": float(recording.t_ns[-1] - recording.t_ns[0]) / NS_PER_S,
        "calibration": _calibration_facts(recording.rig),
        "ground_truth": _truth_facts(recording.truth),
        "imu_readings": len(recording.imu.t_ns) if recording.imu else 0,
        "encoder_readings": len(recording.encoders[0]) if recording.encoders else 0,
        "files": _topics_by_file(path, recording.form),
        **identity,
    }


def _sequence_identity(folder: Path) -> dict[str, Any]:
    """What the import of a sequence assumed, the hash of the recorded data, and what created the sequence."""
    if not has_truth(folder):
        return {"notes": []}
    import_notes = read_import_notes(folder)
    return {
        "notes": [text for key, text in import_notes.items() if key.startswith("note_")],
        "payload_sha256": payload_hash(folder),
        "provenance": read_provenance(folder),
    }


def _calibration_facts(rig: Rig) -> dict[str, Any]:
    cameras = dict[str, Any]()
    for side in rig.sides:
        camera: Any = rig.camera(side)
        cameras[side] = {"model": type(camera).__name__, **asdict(camera)}
    return {
        **cameras,
        "baseline_m": rig.baseline_m if rig.right else None,
        "imu_rate_hz": rig.imu.rate_hz if rig.imu else None,
        "wheels": asdict(rig.wheels) if rig.wheels else None,
    }


def _truth_facts(truth: Trajectory | None) -> dict[str, Any] | None:
    if truth is None:
        return None
    duration_s = (int(truth.t_ns[-1]) - int(truth.t_ns[0])) / NS_PER_S
    return {"poses": len(truth), "path_m": float(truth.distances_m()[-1]), "duration_s": duration_s}


def _topics_by_file(path: Path, form: str) -> dict[str, list[dict[str, Any]]]:
    """The topics in each file of a sequence or of a bag."""
    topics_by_file = dict[str, list[dict[str, Any]]]()
    for file in _recording_files(path, form):
        topics_by_file[file.name] = _topics(file)
    return topics_by_file


def _topics(file: Path) -> list[dict[str, Any]]:
    """The topics in a file or in the folder of a bag."""
    return [{**asdict(topic), "rate_hz": topic.rate_hz} for topic in topic_facts(file)]


def _recording_files(path: Path, form: str) -> list[Path]:
    """The files of a recording that have topics."""
    if form != SEQUENCE_FORM:
        return [path] if is_recording(path) else []
    return [path] if path.is_file() else sorted(path.glob("*.mcap"))


def _print_facts(facts: dict[str, Any]) -> None:
    console = terminal.console()
    console.print(f"{facts['path']}: form '{facts['form']}', {facts['frames']} frames in {facts['duration_s']:.3f} s")
    for name, topics in facts["files"].items():
        _print_topics(name, topics, console)
    _print_calibration(facts["calibration"], console)
    console.print(f"ground truth: {_format_truth(facts['ground_truth'])}")
    for note in facts["notes"]:
        console.print(f"- {note}")
    if "payload_sha256" in facts:
        versions = ", ".join(f"{name} {version}" for name, version in facts["provenance"].items())
        console.print(f"payload SHA-256: {facts['payload_sha256']}")
        console.print(versions or "no provenance")


def _print_topics(name: str, topics: list[dict[str, Any]], console: "Console") -> None:
    rows = [_topic_row(topic) for topic in topics]
    console.print(terminal.table(name, TOPIC_HEADINGS, rows))


def _print_calibration(calibration: dict[str, Any], console: "Console") -> None:
    for side in ("left", "right"):
        camera = calibration.get(side)
        if camera:
            console.print(f"{side} camera: {_format_entries(camera)}")
    others = [_format_entry(key, calibration[key]) for key in ("baseline_m", "imu_rate_hz", "wheels")]
    console.print("; ".join(others))


def _format_truth(truth: dict[str, Any] | None) -> str:
    if truth is None:
        return "none"
    return f"{truth['poses']} poses, {truth['path_m']:.3f} m, {truth['duration_s']:.3f} s"


def _topic_row(topic: dict[str, Any]) -> list[str]:
    rate_hz = topic["rate_hz"]
    start_ns = topic["start_ns"]
    rate = f"{rate_hz:.2f}" if rate_hz else ""
    duration = "" if start_ns is None else f"{(topic['end_ns'] - start_ns) / NS_PER_S:.3f}"
    return [topic["name"], topic["type_name"], str(topic["count"]), rate, duration]


def _format_entries(entries: dict[str, Any]) -> str:
    return ", ".join(_format_entry(key, value) for key, value in entries.items())


def _format_entry(key: str, value: Any) -> str:
    if isinstance(value, dict):
        return f"{key}: {_format_entries(value)}"
    if value is None:
        return f"{key} none"
    if isinstance(value, float):
        return f"{key} {value:.6g}"
    return f"{key} {value}"
