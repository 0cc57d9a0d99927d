"""Find theta in recorded drives: vobench identify."""

import csv
from collections.abc import Iterator
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from vobench.cli import terminal
from vobench.errors import InputError, VobenchError
from vobench.geometry.rig import PIONEER_WHEELS, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion.identification import Fit, identify_odometry
from vobench.motion.pioneer import Theta
from vobench.runner.folder import SEQUENCE, open_run
from vobench.runner.motion import recorded_drive
from vobench.sequence import Sequence, read_truth
from vobench.trajectory.trajectory import Stamps

RIMS, REFERENCES = ("left_rim_rad", "right_rim_rad"), ("u_ref_mps", "omega_ref_radps")
HEADINGS = ("name", *(f"θ{n}" for n in range(1, 7)), "u_ref rms m/s", "ω_ref rms °/s", "condition")


@dataclass(frozen=True, slots=True)
class DriveLog:
    """Rims (M, 2) in rad at rim_t_ns, references (N, 2) that hold from t_ns on, and theta where it is known."""

    name: str
    wheels: WheelGeometry
    rim_t_ns: Stamps
    rim_rad: Array
    t_ns: Stamps
    references: Array
    theta: Theta | None = None

    def identified(self) -> Fit:
        """Theta as wheels and references tell it. Raises MotionError."""
        left_m, right_m = self.rim_rad.T * self.wheels.radius_m
        odometry = np.stack([(left_m + right_m) / 2, (right_m - left_m) / self.wheels.track_m], -1)
        return identify_odometry(self.rim_t_ns / 1e9, odometry, self.t_ns / 1e9, self.references)


def _of_sequences(path: Path) -> tuple[list[tuple[DriveLog, Fit]], dict[str, str]]:
    """What each sequence tells, and why others tell nothing. Raises VobenchError where none does."""
    found, untold = list[tuple[DriveLog, Fit]](), dict[str, str]()
    for name, folder in _sequences(path):
        try:
            log = _of_sequence(name, folder)
            found.append((log, log.identified()))
        except VobenchError as error:
            untold[name] = str(error)
    if not found:
        raise InputError("; ".join(f"{name}: {sentence}" for name, sentence in untold.items()))
    return found, untold


def _sequences(path: Path) -> Iterator[tuple[str, Path]]:
    if (path / "truth.mcap").exists():
        yield path.name, path
        return
    run = open_run(path)
    for case in sorted({file.parents[3] for file in run.score_files()}):
        yield case.name, case / SEQUENCE


def _of_sequence(name: str, folder: Path) -> DriveLog:
    """The encoders of a sequence, and the references of its case, which is driven again.

    Raises InputError where no controller drove it, or where it is now driven otherwise.
    """
    drive = recorded_drive(folder)
    sequence, truth = Sequence.open(folder), read_truth(folder)
    again = drive.motion.at(truth.t_ns).T_world_body  # of some frames where others were left out or lost
    if not np.isin(truth.t_ns, drive.t_ns).all() or not np.allclose(again, truth.T_world_frame, atol=1e-6):
        raise InputError(f"this version of vobench drives the case otherwise than it was recorded: {folder}")
    wheels, (t_ns, ticks) = sequence.rig.wheels, sequence.encoders()
    assert wheels is not None  # a controller drove them
    rim_rad = (ticks * (2 * np.pi / wheels.ticks_per_revolution)).astype(np.float64)
    return DriveLog(name, wheels, t_ns, rim_rad, drive.t_ns, drive.references, drive.theta)


def _of_csv(path: Path, wheels: WheelGeometry) -> DriveLog:
    """The columns that `vobench drive --csv` writes. Raises InputError."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    names = ("t_ns", *RIMS, *REFERENCES)
    if missing := [name for name in names if not rows or name not in rows[0]]:
        raise InputError(f"a drive to identify has the columns {', '.join(names)}; no {', '.join(missing)} in {path}")
    try:
        values = np.array([[float(row[name]) for name in names] for row in rows])
    except (TypeError, ValueError):
        raise InputError(f"the columns {', '.join(names)} should hold a number in each row: {path}") from None
    if not np.isfinite(values).all() or (np.diff(values[:, 0]) <= 0).any():
        raise InputError(f"numbers should be finite and t_ns should rise: {path}")
    t_ns = values[:, 0].astype(np.int64)
    return DriveLog(path.name, wheels, t_ns, values[:, 1:3], t_ns, values[:, 3:])


def _facts(log: DriveLog, fit: Fit) -> dict[str, Any]:
    return {"name": log.name, **asdict(fit), "driven_theta": asdict(log.theta) if log.theta else None}


def _rows(log: DriveLog, fit: Fit) -> Iterator[list[str]]:
    residuals = [f"{fit.u_ref_rms_mps:.4f}", f"{np.rad2deg(fit.omega_ref_rms_radps):.3f}", f"{fit.condition:.1f}"]
    yield [log.name, *(f"{value:.4f}" for value in astuple(fit.theta)), *residuals]
    if log.theta:
        yield ["  driven with", *(f"{value:.4f}" for value in astuple(log.theta)), "", "", ""]


def identify_command(
    path: Annotated[
        Path, typer.Argument(metavar="PATH", help="A run's or a sequence's folder, or a CSV file of `vobench drive`.")
    ],
    *,
    radius_m: Annotated[float | None, typer.Option(help="The wheels' radius, for a CSV; the Pioneer's.")] = None,
    track_m: Annotated[float | None, typer.Option(help="The wheels' track, for a CSV; the Pioneer's.")] = None,
    json: terminal.Json = False,
) -> None:
    """Find theta in recorded drives of the Pioneer, from its wheels and what it was asked for; say what is left."""
    if path.is_file():
        wheels = WheelGeometry(radius_m or PIONEER_WHEELS.radius_m, track_m or PIONEER_WHEELS.track_m, 1)
        found, untold = [(log := _of_csv(path, wheels), log.identified())], dict[str, str]()
    elif radius_m or track_m:
        raise InputError(f"--radius-m and --track-m are for a CSV file; a sequence holds its wheels: {path}")
    else:
        found, untold = _of_sequences(path)
    if json:
        terminal.print_json({"drives": [_facts(log, fit) for log, fit in found], "untold": untold})
        return
    out = terminal.console()
    out.print(terminal.table("", HEADINGS, [row for log, fit in found for row in _rows(log, fit)]))
    for name, sentence in untold.items():
        out.print(f"{name}: {sentence}")
