"""A trajectory as the text that other people's tools read: TUM, KITTI or EuRoC, without loss."""

from pathlib import Path

from vobench.errors import InputError
from vobench.trajectory.euroc import format_euroc
from vobench.trajectory.text import format_tum
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.unstamped import format_kitti, format_times

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
