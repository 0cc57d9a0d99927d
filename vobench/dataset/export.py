"""A sequence exported in the layouts of others, with its calibration, tested before it gets its name."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from vobench import stop
from vobench.dataset import kalibr
from vobench.dataset.bag import write_ros2
from vobench.dataset.euroc import write_euroc
from vobench.dataset.kitti import T_BODY_GREY, covered, kitti_path, write_kitti
from vobench.dataset.photometric import write_photometric
from vobench.dataset.picture import require_free
from vobench.dataset.read import read
from vobench.dataset.recording import cut_to
from vobench.dataset.reproject import check_path, check_rig
from vobench.dataset.source import PNG, ExportSource, Views, open_source, rectified
from vobench.dataset.tum import left_alone, write_tum
from vobench.errors import InputError, SequenceError
from vobench.geometry.rig import ImuCalibration, Rig
from vobench.sequence.messages import IMU, LEFT_IMAGE, RIGHT_IMAGE
from vobench.trajectory.formats import format_euroc, format_kitti, format_times, format_tum
from vobench.trajectory.trajectory import Stamps, Trajectory

TRAJECTORY_FORMS = ("tum", "kitti", "euroc")
TIMES_SUFFIX = ".times.txt"


def export_trajectory(trajectory: Trajectory, path: Path, form: str) -> tuple[Path, ...]:
    """Write a trajectory and say which files it became; KITTI's has no stamps, so its times go beside it.

    Stamps come back exactly and poses to 1e-15. Raises InputError for another form, or a file that is there already.
    """
    texts = {path: _text(trajectory, form)}
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


def _text(trajectory: Trajectory, form: str) -> str:
    if form == "tum":
        return format_tum(trajectory)
    if form == "euroc":
        return format_euroc(trajectory)
    if form == "kitti":
        return format_kitti(trajectory.T_world_frame)
    raise InputError(f"no form of trajectory '{form}'. Known: {', '.join(TRAJECTORY_FORMS)}")


NOTES, PHOTOMETRIC, CHAIN, IMU_FILE = "NOTES.txt", "photometric", "camchain.yaml", "imu.yaml"
TOLD = (
    "The calibration is the one that estimators are told; the pictures were made with another one, as the case asks, "
    "and that one was left out."
)
KALIBR_TOPICS = ("/cam0/image_raw", "/cam1/image_raw", "/imu0")


def _as_recorded(rig: Rig) -> Views:
    return Views(rig)


@dataclass(frozen=True, slots=True)
class WritableLayout:
    """How a form is written: its pictures, its files, the topics it has; what it keeps besides pictures and truth."""

    views: Callable[[Rig], Views]
    write: Callable[[ExportSource, Views, Path], list[str]]
    topics: tuple[str, str, str] = KALIBR_TOPICS
    keeps: tuple[str, ...] = ()
    keeps_all: bool = False
    needs_truth: bool = False


@dataclass(frozen=True, slots=True)
class Exported:
    """What was made: sentences on everything that was converted or left out, and the files, relative to `folder`."""

    folder: Path
    form: str
    notes: tuple[str, ...]
    files: tuple[str, ...]


LAYOUTS = {
    "euroc": WritableLayout(_as_recorded, write_euroc, keeps=("imu",)),
    "kitti": WritableLayout(rectified, write_kitti, needs_truth=True),
    "tum": WritableLayout(left_alone, write_tum, keeps=("imu", "depth")),
    "ros2": WritableLayout(
        _as_recorded,
        write_ros2,
        (LEFT_IMAGE.name, RIGHT_IMAGE.name, IMU.name),
        keeps_all=True,
    ),
}
FORMS = tuple(LAYOUTS)


def export(sequence: Path, out: Path, form: str) -> Exported:
    """Write a sequence's folder in another form into a new folder, and read it back: points and poses must agree.

    Raises InputError for an unknown form or a folder in use, SequenceError for what the form cannot hold or a
    sequence that is not whole.
    """
    if form not in LAYOUTS:
        raise InputError(f"no form '{form}' to export to. Known: {', '.join(FORMS)}")
    out = out.resolve()
    require_free(out)
    source, layout = open_source(sequence), LAYOUTS[form]
    views = layout.views(source.rig)
    stamps = _stamps(source, layout)
    with _building(out) as folder:
        notes = layout.write(source, views, folder)
        notes += _write_calibration(views.rig, layout, folder)
        notes += write_photometric(source, views, stamps, folder / PHOTOMETRIC)
        notes += _left_out(source, layout)
        (folder / NOTES).write_text("".join(f"{note}\n" for note in notes), encoding="utf-8")
        _test(source, views, stamps, form, folder)
        files = tuple(sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()))
    return Exported(out, form, tuple(notes), files)


@contextmanager
def _building(out: Path) -> Iterator[Path]:
    """A folder to fill, which gets its name when the context ends without an error, and is gone after one.

    Raises SequenceError where the disk does not take it.
    """
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


def _stamps(source: ExportSource, layout: WritableLayout) -> Stamps:
    """The stamps (N,) of the frames that are exported."""
    stamps = source.sequence.frame_stamps()
    return stamps[covered(source.truth, stamps)] if layout.needs_truth else stamps


def _write_calibration(rig: Rig, layout: WritableLayout, folder: Path) -> list[str]:
    """Kalibr's two files, and what to say of them."""
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


def _left_out(source: ExportSource, layout: WritableLayout) -> list[str]:
    """Sentences on what a form has no place for."""
    if layout.keeps_all:
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
    told, true = source.rig, source.true_rig
    cameras = all(told.camera(side) == true.camera(side) for side in told.sides)
    return cameras and all((told.T_body_camera(side) == true.T_body_camera(side)).all() for side in told.sides)


def _test(source: ExportSource, views: Views, stamps: Stamps, form: str, folder: Path) -> None:
    """Read the export back and send known points and the true path through it. Raises SequenceError."""
    found = read(folder, form=form)
    check_rig(f"the {form} folder, read back,", views.rig, found.rig)
    if (folder / CHAIN).is_file():
        check_rig(f"{CHAIN}, read back,", views.rig, _chain_rig(folder / CHAIN, views.rig.imu))
    expected, path = _expected_path(source, views.rig, stamps, form), found.truth
    if expected is not None and path is not None:
        check_path(f"the {form} folder, read back,", expected, path.of_mounted(found.rig.T_body_left))
    elif expected is not None or path is not None:
        raise SequenceError(f"the {form} folder, read back, {'has no truth any more' if expected else 'has a truth'}")


def _chain_rig(path: Path, imu: ImuCalibration | None) -> Rig:
    """The rig of a camchain.yaml; where there is an IMU the chain's body is that."""
    rig = kalibr.read_camchain(path)
    return replace(rig, imu=replace(imu, T_body_imu=np.eye(4))) if imu else rig


def _expected_path(source: ExportSource, rig: Rig, stamps: Stamps, form: str) -> Trajectory | None:
    """The left camera's path as the form should give it, cut to the pictures as every reader cuts it."""
    if source.truth is None:
        return None
    if form == "kitti":
        path = kitti_path(source.truth, rig, stamps)
        return path and Trajectory(path.t_ns, T_BODY_GREY @ path.T_world_frame)
    return cut_to(source.truth.of_mounted(rig.T_body_left), stamps)[0]
