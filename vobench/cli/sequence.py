"""vobench import, export and info."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperOption

from vobench.cli import terminal
from vobench.dataset.export import TRAJECTORY_FORMS, export, export_trajectory
from vobench.dataset.layout import layouts, read, writable
from vobench.dataset.picture import read_text, require_free
from vobench.dataset.recording import ReadOptions, Topics
from vobench.errors import InputError, UnknownNameError, unknown
from vobench.geometry.rig import Rig
from vobench.runner.import_recording import import_recording
from vobench.runner.store import sweep, unfinished
from vobench.sequence import Sequence, has_truth, payload_hash, read_import_notes, read_provenance
from vobench.sequence.recording import is_recording, read_poses, topic_facts
from vobench.trajectory.formats import parse_any
from vobench.trajectory.trajectory import Trajectory

SENSORS_FILE = "sensors.mcap"


def _sequence(folder: Path, out: Path, form: str) -> tuple[tuple[str, ...], int]:
    if form in writable() and folder.is_dir() and not (folder / SENSORS_FILE).is_file():
        raise InputError(f"no sequence of ours (it has no {SENSORS_FILE}); vobench import makes one: {folder}")
    exported = export(folder, out, form)
    return exported.notes, len(exported.files)


def _trajectory(path: Path, out: Path, form: str) -> tuple[tuple[str, ...], int]:
    files = export_trajectory(_read(path), out, form)
    return tuple(f"KITTI's poses have no stamps: those are in {file.name}." for file in files[1:]), len(files)


def _read(path: Path) -> Trajectory:
    """The poses of a text in any form, or the only ones of a recording."""
    if is_recording(path):
        return read_poses(path, None)
    parsed = parse_any(read_text(path), name=str(path))
    if parsed.t_ns is None:
        raise InputError(f"poses without stamps, which the other forms need: {path}")
    return Trajectory(parsed.t_ns, parsed.T)


TOPICS = tuple(Topics.__dataclass_fields__)


def topics_of(given: list[str] | None) -> Topics:
    """The topics of `--topic`. Raises UnknownNameError."""
    chosen = {}
    for entry in given or ():
        role, _, name = entry.partition("=")
        if role not in TOPICS or not name:
            raise UnknownNameError(f"--topic {entry}: {unknown('topic', role, list(TOPICS))}; as in --topic left=/cam0")
        chosen[role] = name
    return Topics(**chosen)


def _files(path: Path, form: str) -> dict[str, list[dict[str, Any]]]:
    """The topics in each file of a sequence of ours, or in somebody's bag."""
    files = [path] if form != "vobench" or path.is_file() else sorted(path.glob("*.mcap"))
    read = [file for file in files if form == "vobench" or is_recording(file)]
    return {file.name: [{**asdict(topic), "rate_hz": topic.rate_hz} for topic in topic_facts(file)] for file in read}


def _calibration(rig: Rig) -> dict[str, Any]:
    cameras: dict[str, Any] = {side: rig.camera(side) for side in rig.sides}
    return {
        **{side: {"model": type(camera).__name__, **asdict(camera)} for side, camera in cameras.items()},
        "baseline_m": rig.baseline_m if rig.right else None,
        "imu_rate_hz": rig.imu.rate_hz if rig.imu else None,
        "wheels": asdict(rig.wheels) if rig.wheels else None,
    }


def _truth(truth: Trajectory | None) -> dict[str, Any] | None:
    if truth is None:
        return None
    duration_s = (int(truth.t_ns[-1]) - int(truth.t_ns[0])) / 1e9
    return {"poses": len(truth), "path_m": float(truth.distances_m()[-1]), "duration_s": duration_s}


def _identity(folder: Path) -> dict[str, Any]:
    """Of a sequence of ours: what its import assumed, the hash of all that was recorded, and what made it."""
    if not has_truth(folder):
        return {"notes": []}
    return {
        "notes": [text for key, text in read_import_notes(folder).items() if key.startswith("note_")],
        "payload_sha256": payload_hash(folder),
        "provenance": read_provenance(folder),
    }


def _print_info(facts: dict[str, Any]) -> None:
    out = terminal.console()
    out.print(f"{facts['path']}: form '{facts['form']}', {facts['frames']} frames in {facts['duration_s']:.3f} s")
    for name, topics in facts["files"].items():
        rows = [_row(topic) for topic in topics]
        out.print(terminal.table(name, ["name", "kind", "messages", "Hz", "seconds"], rows))
    for side in ("left", "right"):
        if camera := facts["calibration"].get(side):
            out.print(f"{side} camera: " + ", ".join(_entry(*item) for item in camera.items()))
    rest = {key: facts["calibration"][key] for key in ("baseline_m", "imu_rate_hz", "wheels")}
    out.print("; ".join(_entry(key, value) for key, value in rest.items()))
    truth = facts["ground_truth"]
    said = f"{truth['poses']} poses, {truth['path_m']:.3f} m, {truth['duration_s']:.3f} s" if truth else "none"
    out.print(f"ground truth: {said}")
    for note in facts["notes"]:
        out.print(f"- {note}")
    if "payload_sha256" in facts:
        out.print(f"payload SHA-256: {facts['payload_sha256']}")
        out.print(", ".join(f"{name} {version}" for name, version in facts["provenance"].items()) or "no provenance")


def _row(topic: dict[str, Any]) -> list[str]:
    rate_hz = topic["rate_hz"]
    start_ns = topic["start_ns"]
    span_s = "" if start_ns is None else f"{(topic['end_ns'] - start_ns) / 1e9:.3f}"
    return [topic["name"], topic["type_name"], str(topic["count"]), f"{rate_hz:.2f}" if rate_hz else "", span_s]


def _entry(key: str, value: Any) -> str:
    if isinstance(value, dict):
        return f"{key}: " + ", ".join(_entry(*item) for item in value.items())
    if isinstance(value, float):
        return f"{key} {value:.6g}"
    return f"{key} {'none' if value is None else value}"


Recorded = Annotated[
    Path, typer.Argument(metavar="PATH", help="A dataset's folder, a bag, or a sequence; its form is told by content.")
]
Imu = Annotated[Path | None, typer.Option(help="Kalibr's imu.yaml.")]
Truth = Annotated[Path | None, typer.Option(help="A trajectory file with the ground truth.")]
Rate = Annotated[float | None, typer.Option(help="Pictures a second, for layouts without stamps.")]
Form = Annotated[str | None, typer.Option(help="The form, where its content should not tell")]
Calibration = Annotated[Path | None, typer.Option(help="Kalibr's camchain.yaml, where the layout has none of its own.")]
TopicOf = Annotated[
    list[str] | None,
    typer.Option("--topic", help="left=, right=, left_info=, right_info=, truth= or imu=NAME of a bag; repeatable."),
]


def import_command(
    path: Recorded,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder of the new sequence.")],
    *,
    form: Form = None,
    calibration: Calibration = None,
    imu: Imu = None,
    truth: Truth = None,
    rate: Rate = None,
    topic: TopicOf = None,
    json: terminal.Json = False,
) -> None:
    """Make a sequence from a dataset's folder or a bag, and say all that was assumed or dropped."""
    require_free(out)
    options = ReadOptions(calibration, imu, truth, rate, topics=topics_of(topic))
    recording = read(path, form=form, options=options)
    sweep(out.resolve().parent)
    with unfinished(out.resolve().parent) as folder:
        import_recording(recording, folder)
        if out.is_dir():
            out.rmdir()
        folder.rename(out)
    frames = len(Sequence.open(out))
    if json:
        terminal.print_json({"form": recording.form, "path": str(out), "frames": frames, "notes": recording.notes})
        return
    for note in recording.notes:
        print(f"- {note}")
    print(f"{frames} frames of a recording in the form '{recording.form}': {out}")


def export_command(
    source: Annotated[
        Path, typer.Argument(metavar="SOURCE", help="The folder of a sequence, or the file of a trajectory.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder or file to write, which should be new.")],
    *,
    form: Annotated[str, typer.Option(help="The form to write")],
    json: terminal.Json = False,
) -> None:
    """Write a sequence in another layout, or a trajectory as another text; say all that is lost."""
    path = source.parent if source.name == SENSORS_FILE else source
    notes, files = _trajectory(path, out, form) if path.is_file() else _sequence(path, out, form)
    if json:
        terminal.print_json({"form": form, "path": str(out), "files": files, "notes": notes})
        return
    for note in notes:
        print(f"- {note}")
    print(f"{files} {'file' if files == 1 else 'files'} in the form '{form}': {out}")


def info_command(
    path: Recorded,
    *,
    form: Form = None,
    calibration: Calibration = None,
    imu: Imu = None,
    truth: Truth = None,
    rate: Rate = None,
    topic: TopicOf = None,
    json: terminal.Json = False,
) -> None:
    """Say what is in a recording: topics, rates, duration, calibration, ground truth, hash."""
    recording = read(path, form=form, options=ReadOptions(calibration, imu, truth, rate, topics=topics_of(topic)))
    folder = path.parent if path.is_file() else path
    facts = {
        "path": str(path),
        "form": recording.form,
        "frames": recording.frame_count,
        "duration_s": float(recording.t_ns[-1] - recording.t_ns[0]) / 1e9,
        "calibration": _calibration(recording.rig),
        "ground_truth": _truth(recording.truth),
        "imu_readings": len(recording.imu.t_ns) if recording.imu else 0,
        "encoder_readings": len(recording.encoders[0]) if recording.encoders else 0,
        "files": _files(path, recording.form),
        **(_identity(folder) if recording.form == "vobench" else {"notes": list(recording.notes)}),
    }
    if json:
        terminal.print_json(facts)
    else:
        _print_info(facts)


class FormCommand(TyperCommand):
    """A command with --form, whose help names the layouts that are found, looked for when somebody asks for it."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, with the names of the layouts."""
        known = ", ".join(layouts())
        if self.name == "export":
            known = f"{', '.join(writable())}; of a trajectory, {', '.join(TRAJECTORY_FORMS)}"
        for option in self.params:
            if option.name == "form" and isinstance(option, TyperOption):
                option.help = f"{option.help}: {known}."
        super().format_help(ctx, formatter)


COMMAND_CLASS = FormCommand
