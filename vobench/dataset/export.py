"""Exports sequences in the layouts of datasets, and verifies each export by reading it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from vobench import stop
from vobench.dataset import kalibr
from vobench.dataset.layout import Writing, read, writable
from vobench.dataset.overlap import overlapping_truth
from vobench.dataset.photometric import write_photometric
from vobench.dataset.picture import require_free
from vobench.dataset.png_frame import PNG
from vobench.dataset.read_back import check_path, check_rig
from vobench.dataset.rectified_view import Views
from vobench.dataset.source import ExportSource, open_source
from vobench.errors import InputError, SequenceError, unknown_name_sentence
from vobench.geometry.rig import Rig
from vobench.sequence.topic import SENSORS_FILE
from vobench.trajectory.euroc import format_euroc
from vobench.trajectory.kitti import format_kitti, format_times
from vobench.trajectory.tartanair import format_tartanair
from vobench.trajectory.trajectory import Stamps, Trajectory
from vobench.trajectory.tum import format_tum


def _kitti_text(trajectory: Trajectory) -> str:
    return format_kitti(trajectory.T_world_frame)


def _tartanair_text(trajectory: Trajectory) -> str:
    return format_tartanair(trajectory.T_world_frame)


TRAJECTORY_TEXTS: dict[str, Callable[[Trajectory], str]] = {
    "tum": format_tum,
    "kitti": _kitti_text,
    "euroc": format_euroc,
    "tartanair": _tartanair_text,
}
TRAJECTORY_FORMS = tuple(TRAJECTORY_TEXTS)
FORMS_WITHOUT_STAMPS = ("kitti", "tartanair")
TIMES_SUFFIX = ".times.txt"


def export_trajectory(
    trajectory: Trajectory,
    path: Path,
    form: str,
    *,
    has_stamps: bool = True,
) -> tuple[Path, ...]:
    """Write a trajectory without loss as one file, and return its path.

    The forms of KITTI and TartanAir have no stamps, so a second file has these, if the trajectory has any.

    Raises InputError for an unknown form, or if a file exists.
    """
    if form not in TRAJECTORY_TEXTS:
        raise InputError(f"no form of trajectory '{form}'. Known: {', '.join(TRAJECTORY_FORMS)}")
    texts = {path: TRAJECTORY_TEXTS[form](trajectory)}
    if form in FORMS_WITHOUT_STAMPS and has_stamps:
        times = path.with_name(path.stem + TIMES_SUFFIX)
        texts[times] = format_times(trajectory.t_ns)
    for file in texts:
        if file.exists():
            raise InputError(f"the file exists already; choose another name or remove it: {file}")
    for file, text in texts.items():
        part = file.with_name(file.name + ".part")
        part.write_text(text, encoding="utf-8")
        part.replace(file)
    return tuple(texts)


NOTES = "NOTES.txt"
PHOTOMETRIC = "photometric"
CHAIN = "camchain.yaml"
IMU_FILE = "imu.yaml"
NOMINAL = (
    "The calibration is the nominal one, which estimators are given; the images were simulated with another one, "
    "as the case asks, and that one was left out."
)


@dataclass(frozen=True, slots=True)
class Exported:
    """An export: its files, relative to `folder`, and notes on everything that was converted or omitted."""

    folder: Path
    form: str
    notes: tuple[str, ...]
    files: tuple[str, ...]


def export(sequence: Path, out: Path, form: str) -> Exported:
    """Export a sequence in another form to a new folder, and verify it by reading it.

    `sequence` is the folder of a sequence, or its file of sensors.
    Raises InputError for an invalid folder or form, and SequenceError if the export differs from the sequence.
    """
    layout = writable().get(form)
    if layout is None:
        raise InputError(unknown_name_sentence("form to export to", form, list(writable())))
    out = out.resolve()
    require_free(out)
    source = open_source(_folder_of(sequence))
    views = layout.views(source.rig)
    stamps = layout.stamps(source)
    expected_path = _expected_path(source, views.rig, stamps, layout)

    with _building(out) as folder:
        notes = layout.write(source, views, folder)
        notes += write_calibration(views.rig, layout, folder)
        notes += write_photometric(source, views, stamps, folder / PHOTOMETRIC)
        notes += _left_out(source, layout)
        text = "".join(f"{note}\n" for note in notes)
        (folder / NOTES).write_text(text, encoding="utf-8")
        _check_read_back(views, expected_path, form, folder)
        files = [str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()]
    return Exported(out, form, tuple(notes), tuple(sorted(files)))


@contextmanager
def _building(out: Path) -> Iterator[Path]:
    """A folder to fill. At the end of the block it is renamed to `out`, or removed if there is an error."""
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        part = Path(mkdtemp(dir=out.parent, prefix=f".{out.name}.", suffix=".part"))
        with stop.cleanup_after(lambda: stop.remove(part)):
            folder = part / out.name
            folder.mkdir()
            yield folder
            if out.exists():
                out.rmdir()  # an empty one
            folder.replace(out)
    except OSError as error:
        raise SequenceError(f"cannot write the export ({error.strerror or error}): {out}") from error


def _folder_of(sequence: Path) -> Path:
    """The folder of a sequence, given that folder or its file of sensors. Raises InputError for anything else."""
    folder = sequence.parent if sequence.name == SENSORS_FILE else sequence
    if folder.is_file():
        raise InputError(f"not the folder of a sequence; vobench convert converts trajectory files: {folder}")
    if folder.is_dir() and not (folder / SENSORS_FILE).is_file():
        raise InputError(f"not a vobench sequence (it has no {SENSORS_FILE}); vobench import creates one: {folder}")
    return folder


def write_calibration(rig: Rig, layout: Writing, folder: Path) -> list[str]:
    """Write the Kalibr files of a rig to a folder, and return notes on what they cannot represent."""
    *image_topics, imu_topic = layout.topics
    notes = kalibr.remarks(rig)
    try:
        (folder / CHAIN).write_text(kalibr.camchain(rig, tuple(image_topics)), encoding="utf-8")
    except SequenceError as error:
        return [f"There is no {CHAIN}: {error}."]
    if rig.imu:
        try:
            (folder / IMU_FILE).write_text(kalibr.imu_yaml(rig.imu, topic=imu_topic), encoding="utf-8")
        except InputError as error:
            notes.append(f"There is no {IMU_FILE}: {error}.")
    return notes


def _left_out(source: ExportSource, layout: Writing) -> list[str]:
    """Notes on the parts of the sequence that the layout cannot represent."""
    if layout.keeps is None:
        return []
    notes = []
    first = next(source.sequence.encoded_frames())
    if first.form != PNG:
        notes.append("The images were recorded as JPEG; here they are PNG files of the decoded images.")
    if source.imu is not None and "imu" not in layout.keeps:
        notes.append("The IMU's readings were left out.")
    if source.rig.wheels is not None:
        notes.append("Wheels and encoder readings were left out.")
    channels = [name for name in source.channels if name not in layout.keeps]
    if channels:
        notes.append(f"The per-pixel ground truth was left out: {', '.join(channels)}.")
    if source.case is not None:
        notes.append("The case that it was simulated from was left out.")
    if not _has_true_calibration(source):
        notes.append(NOMINAL)
    return notes


def _has_true_calibration(source: ExportSource) -> bool:
    """Whether the nominal calibration of the cameras is the true one."""
    nominal = source.rig
    true = source.true_rig
    for side in nominal.sides:
        same_lens = nominal.camera(side) == true.camera(side)
        same_mount = (nominal.T_body_camera(side) == true.T_body_camera(side)).all()
        if not (same_lens and same_mount):
            return False
    return True


def _check_read_back(
    views: Views,
    expected_path: Trajectory | None,
    form: str,
    folder: Path,
) -> None:
    """Read the export, and compare its rig, Kalibr files and trajectory with the sequence. Raises SequenceError."""
    recording = read(folder, form=form)
    what = f"the {form} folder, read back,"
    check_rig(what, views.rig, recording.rig)
    if (folder / CHAIN).is_file():
        chain_rig = kalibr.read_camchain(folder / CHAIN)
        imu = views.rig.imu
        if imu is not None:  # the body of the chain is the IMU
            chain_rig = replace(chain_rig, imu=replace(imu, T_body_imu=np.eye(4)))
        check_rig(f"{CHAIN}, read back,", views.rig, chain_rig)

    truth = recording.truth
    if (expected_path is None) != (truth is None):
        problem = "has a truth" if expected_path is None else "has no truth any more"
        raise SequenceError(f"{what} {problem}")
    if expected_path is not None and truth is not None:
        check_path(what, expected_path, truth.of_mounted(recording.rig.T_body_left))


def _expected_path(
    source: ExportSource,
    rig: Rig,
    stamps: Stamps,
    layout: Writing,
) -> Trajectory | None:
    """The trajectory of the left camera that reading the export should give, cut to the time of the pictures."""
    if source.truth is None:
        return None
    if layout.path:
        return layout.path(source, rig, stamps)
    path, _ = overlapping_truth(source.truth.of_mounted(rig.T_body_left), stamps)
    return path
