"""A sequence exported in the layouts of others, with its calibration, tested before it gets its name."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from vobench import stop
from vobench.dataset import kalibr
from vobench.dataset.layout import Writing, read, writable
from vobench.dataset.photometric import write_photometric
from vobench.dataset.picture import require_free
from vobench.dataset.recording import cut_to
from vobench.dataset.source import PNG, ExportSource, Views, check_path, check_rig, open_source
from vobench.errors import InputError, SequenceError, unknown
from vobench.geometry.rig import Rig
from vobench.trajectory.formats import format_euroc, format_kitti, format_times, format_tum
from vobench.trajectory.trajectory import Stamps, Trajectory

TRAJECTORY_TEXTS: dict[str, Callable[[Trajectory], str]] = {
    "tum": format_tum,
    "kitti": lambda trajectory: format_kitti(trajectory.T_world_frame),
    "euroc": format_euroc,
}
TRAJECTORY_FORMS = tuple(TRAJECTORY_TEXTS)
TIMES_SUFFIX = ".times.txt"


def export_trajectory(trajectory: Trajectory, path: Path, form: str) -> tuple[Path, ...]:
    """Write a trajectory, exactly, as one file, or two in KITTI's form. Raises InputError, also for a file there."""
    if form not in TRAJECTORY_TEXTS:
        raise InputError(f"no form of trajectory '{form}'. Known: {', '.join(TRAJECTORY_FORMS)}")
    texts = {path: TRAJECTORY_TEXTS[form](trajectory)}
    if form == "kitti":
        texts[path.with_name(path.stem + TIMES_SUFFIX)] = format_times(trajectory.t_ns)
    for file in texts:
        if file.exists():
            raise InputError(f"there is a file already; choose another name or take it away: {file}")
    for file, text in texts.items():
        part = file.with_name(file.name + ".part")
        part.write_text(text, encoding="utf-8")
        part.replace(file)
    return tuple(texts)


NOTES = "NOTES.txt"
PHOTOMETRIC = "photometric"
CHAIN = "camchain.yaml"
IMU_FILE = "imu.yaml"
TOLD = (
    "The calibration is the one that estimators are told; the pictures were made with another one, as the case asks, "
    "and that one was left out."
)


@dataclass(frozen=True, slots=True)
class Exported:
    """What was made: sentences on everything that was converted or left out, and the files, relative to `folder`."""

    folder: Path
    form: str
    notes: tuple[str, ...]
    files: tuple[str, ...]


def export(sequence: Path, out: Path, form: str) -> Exported:
    """Write a sequence in another form into a new folder and test it, read back. Raises InputError, SequenceError."""
    layout = writable().get(form)
    if layout is None:
        raise InputError(unknown("form to export to", form, list(writable())))
    out = out.resolve()
    require_free(out)
    source = open_source(sequence)
    views = layout.views(source.rig)
    stamps = layout.stamps(source)
    with _building(out) as folder:
        notes = layout.write(source, views, folder)
        notes += write_calibration(views.rig, layout, folder)
        notes += write_photometric(source, views, stamps, folder / PHOTOMETRIC)
        notes += _left_out(source, layout)
        (folder / NOTES).write_text("".join(f"{note}\n" for note in notes), encoding="utf-8")
        _test(views, _expected_path(source, views.rig, stamps, layout), form, folder)
        files = tuple(sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()))
    return Exported(out, form, tuple(notes), files)


@contextmanager
def _building(out: Path) -> Iterator[Path]:
    """A folder to fill, which gets its name when the context ends without an error, and is gone after one."""
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        part = Path(mkdtemp(dir=out.parent, prefix=f".{out.name}.", suffix=".part"))
        with stop.undone(lambda: stop.remove(part)):
            folder = part / out.name
            folder.mkdir()
            yield folder
            if out.exists():
                out.rmdir()  # an empty one
            folder.replace(out)
    except OSError as error:
        raise SequenceError(f"cannot write the export ({error.strerror or error}): {out}") from error


def write_calibration(rig: Rig, layout: Writing, folder: Path) -> list[str]:
    """Kalibr's files of a rig, and what they cannot say."""
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
    if layout.keeps is None:
        return []
    channels = [name for name in source.channels if name not in layout.keeps]
    is_jpeg = next(source.sequence.encoded_frames()).form != PNG
    found = [
        (is_jpeg, "The pictures were recorded as JPEG; here they are PNG of what that decodes to."),
        (source.imu is not None and "imu" not in layout.keeps, "The IMU's readings were left out."),
        (source.rig.wheels is not None, "Wheels and encoder readings were left out."),
        (bool(channels), f"The truth of every pixel was left out: {', '.join(channels)}."),
        (source.case is not None, "The case that it was simulated from was left out."),
        (not _told_truly(source), TOLD),
    ]
    return [sentence for is_there, sentence in found if is_there]


def _told_truly(source: ExportSource) -> bool:
    told = source.rig
    true = source.true_rig
    cameras = all(told.camera(side) == true.camera(side) for side in told.sides)
    return cameras and all((told.T_body_camera(side) == true.T_body_camera(side)).all() for side in told.sides)


def _test(views: Views, expected: Trajectory | None, form: str, folder: Path) -> None:
    """Read the export back and send known points and the true path through it. Raises SequenceError."""
    found = read(folder, form=form)
    check_rig(f"the {form} folder, read back,", views.rig, found.rig)
    if (folder / CHAIN).is_file():
        imu = views.rig.imu and replace(views.rig.imu, T_body_imu=np.eye(4))  # where there is one, the chain's body
        check_rig(f"{CHAIN}, read back,", views.rig, replace(kalibr.read_camchain(folder / CHAIN), imu=imu))
    path = found.truth
    if expected is not None and path is not None:
        check_path(f"the {form} folder, read back,", expected, path.of_mounted(found.rig.T_body_left))
    elif expected is not None or path is not None:
        raise SequenceError(f"the {form} folder, read back, {'has no truth any more' if expected else 'has a truth'}")


def _expected_path(source: ExportSource, rig: Rig, stamps: Stamps, layout: Writing) -> Trajectory | None:
    """The left camera's path as the form should give it, cut to the pictures as every reader cuts it."""
    if source.truth is None:
        return None
    if layout.path:
        return layout.path(source, rig, stamps)
    return cut_to(source.truth.of_mounted(rig.T_body_left), stamps)[0]
