"""Identifies theta of the Pioneer from recorded drives: of a run, a sequence, or a CSV file of `vobench drive`."""

import csv
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vobench.errors import InputError, VobenchError
from vobench.geometry.rig import PIONEER_WHEELS, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion.drive import Drive
from vobench.motion.identification import Fit, identify_odometry
from vobench.motion.pioneer import Theta
from vobench.runner.data_frame import data_frame
from vobench.runner.drive import REFERENCE_COLUMNS, RIM_COLUMNS
from vobench.runner.folder import SEQUENCE, open_run
from vobench.runner.motion import recorded_drive
from vobench.sequence import Sequence, read_truth
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps

if TYPE_CHECKING:
    from vobench.runner.data_frame import DataFrame

# The poses of a recorded drive and of the repeated drive differ only by rounding errors.
SAME_POSE = 1e-6  # the largest difference of equal poses, in m and elements of the rotation


@dataclass(frozen=True, slots=True)
class WheelLog:
    """The data from which theta is identified: the rim angles of the wheels, and the references of the controller.

    `rim_rad` (M, 2) are the angles of the left and right rim in rad at `rim_t_ns` (M,).
    `references` (N, 2) are in m/s and rad/s. Each one is valid from its stamp in `t_ns` (N,).
    `theta` is the theta of the simulation, None if it is unknown.
    """

    name: str
    wheels: WheelGeometry
    rim_t_ns: Stamps
    rim_rad: Array
    t_ns: Stamps
    references: Array
    theta: Theta | None = None

    def fit(self) -> Fit:
        """Identify theta. Raises MotionError if the drive does not determine it."""
        left_m = self.rim_rad[:, 0] * self.wheels.radius_m
        right_m = self.rim_rad[:, 1] * self.wheels.radius_m
        distance_m = (left_m + right_m) / 2
        heading_rad = (right_m - left_m) / self.wheels.track_m
        odometry = np.stack([distance_m, heading_rad], -1)
        return identify_odometry(self.rim_t_ns / NS_PER_S, odometry, self.t_ns / NS_PER_S, self.references)


@dataclass(frozen=True, slots=True)
class IdentifiedDrive:
    """The fitted theta of one drive, and the theta of the simulation, None if it is unknown."""

    name: str
    fit: Fit
    driven_theta: Theta | None

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        driven_theta = None if self.driven_theta is None else asdict(self.driven_theta)
        return {"name": self.name, **asdict(self.fit), "driven_theta": driven_theta}


@dataclass(frozen=True, slots=True)
class Identification:
    """The identified drives, and the reasons why theta could not be identified from the others, by name."""

    drives: tuple[IdentifiedDrive, ...]
    failures: Mapping[str, str]

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench identify --json` prints them."""
        return {"drives": [drive.as_dict() for drive in self.drives], "untold": dict(self.failures)}

    def to_frame(self) -> "DataFrame":
        """A pandas table with one row per drive: its name, the six parameters, the residuals and the condition."""
        rows = []
        for drive in self.drives:
            facts = asdict(drive.fit)
            theta = facts.pop("theta")
            rows.append({"name": drive.name, **theta, **facts})
        return data_frame(rows)


def identify_drives(path: Path, *, radius_m: float | None = None, track_m: float | None = None) -> Identification:
    """Identify theta from every drive of a run, from one sequence, or from a CSV file of `vobench drive`.

    `radius_m` and `track_m` are those of the wheels of a CSV file, by default those of the Pioneer. A sequence contains
    them. Raises InputError and MotionError if there is no drive from which theta can be identified.
    """
    if path.is_file():
        wheels = WheelGeometry(radius_m or PIONEER_WHEELS.radius_m, track_m or PIONEER_WHEELS.track_m, 1)
        log = read_csv_log(path, wheels)
        return Identification((IdentifiedDrive(log.name, log.fit(), log.theta),), {})
    if radius_m or track_m:
        raise InputError(f"--radius-m and --track-m are for a CSV file; a sequence holds its wheels: {path}")
    return _identify_sequences(_sequences(path))


def _identify_sequences(sequences: Mapping[str, Path]) -> Identification:
    """Identify theta from each sequence that allows it. Raises InputError if none does."""
    drives = []
    failures = {}
    for name, folder in sequences.items():
        try:
            log = read_sequence_log(name, folder)
            drives.append(IdentifiedDrive(name, log.fit(), log.theta))
        except VobenchError as error:
            failures[name] = str(error)
    if not drives:
        raise InputError("; ".join(f"{name}: {sentence}" for name, sentence in failures.items()))
    return Identification(tuple(drives), failures)


def _sequences(path: Path) -> dict[str, Path]:
    """The folders of sequences by name: those of all cases of a run, or the single sequence at the path."""
    if (path / "truth.mcap").exists():
        return {path.name: path}
    run = open_run(path)
    cases = sorted({file.parents[3] for file in run.score_files()})
    return {case.name: case / SEQUENCE for case in cases}


def read_sequence_log(name: str, folder: Path) -> WheelLog:
    """Read the encoders of a sequence. The references are computed by driving its case again.

    Raises InputError if the body is not a Pioneer with a controller, or if this version of vobench drives the case
    differently.
    """
    drive = recorded_drive(folder)
    _require_same_drive(drive, folder)
    sequence = Sequence.open(folder)
    wheels = sequence.rig.wheels
    assert wheels is not None  # a body with a controller has wheels
    t_ns, ticks = sequence.encoders()
    rad_per_tick = 2 * np.pi / wheels.ticks_per_revolution
    rim_rad = (ticks * rad_per_tick).astype(np.float64)
    return WheelLog(name, wheels, t_ns, rim_rad, drive.t_ns, drive.references, drive.theta)


def _require_same_drive(drive: Drive, folder: Path) -> None:
    """Raise InputError unless the recorded poses are those of the drive. Frames may be missing."""
    truth = read_truth(folder)
    T_world_body = drive.motion.at(truth.t_ns).T_world_body
    has_same_stamps = bool(np.isin(truth.t_ns, drive.t_ns).all())
    if not has_same_stamps or not np.allclose(T_world_body, truth.T_world_frame, atol=SAME_POSE):
        raise InputError(f"this version of vobench drives the case differently from the recording: {folder}")


def read_csv_log(path: Path, wheels: WheelGeometry) -> WheelLog:
    """Read the columns of a CSV file that `vobench drive --csv` writes. Raises InputError."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    names = ("t_ns", *RIM_COLUMNS, *REFERENCE_COLUMNS)
    listed = ", ".join(names)

    missing = [name for name in names if not rows or name not in rows[0]]
    if missing:
        raise InputError(f"a drive to identify has the columns {listed}; no {', '.join(missing)} in {path}")
    try:
        columns = []
        for name in names:
            column = [float(row[name]) for row in rows]
            columns.append(np.array(column))
        values = np.stack(columns, -1)  # (N, 5)
    except (TypeError, ValueError):
        raise InputError(f"the columns {listed} should hold a number in each row: {path}") from None
    is_rising = bool((np.diff(values[:, 0]) > 0).all())
    if not np.isfinite(values).all() or not is_rising:
        raise InputError(f"numbers should be finite and t_ns should increase: {path}")

    t_ns = values[:, 0].astype(np.int64)
    rim_rad = values[:, 1:3]
    references = values[:, 3:]
    return WheelLog(path.name, wheels, t_ns, rim_rad, t_ns, references)
