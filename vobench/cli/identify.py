"""The command vobench identify, which estimates the parameters θ of the Pioneer from recorded drives."""

import math
from collections.abc import Sequence
from dataclasses import astuple
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.cli.option import Json
from vobench.motion.pioneer import Theta
from vobench.runner.identify import Identification, IdentifiedDrive, identify_drives

PARAMETERS = tuple(f"θ{number}" for number in range(1, 7))
RESIDUALS = ("u_ref rms m/s", "ω_ref rms °/s", "condition")  # residuals of the fit, and its condition number
HEADINGS = ("name", *PARAMETERS, *RESIDUALS)


def identify_command(
    path: Annotated[
        Path,
        typer.Argument(metavar="PATH", help="The folder of a run or a sequence, or a CSV file of `vobench drive`."),
    ],
    *,
    radius_m: Annotated[
        float | None, typer.Option(help="The radius of the wheels, for a CSV file; the Pioneer's by default.")
    ] = None,
    track_m: Annotated[
        float | None, typer.Option(help="The track of the wheels, for a CSV file; the Pioneer's by default.")
    ] = None,
    json: Json = False,
) -> None:
    """Identify theta of the Pioneer from its wheels and speed commands in recorded drives, and print the residuals."""
    identification = identify_drives(path, radius_m=radius_m, track_m=track_m)
    if json:
        terminal.print_json(identification.as_dict())
    else:
        _print_identification(identification)


def _print_identification(identification: Identification) -> None:
    """Print a table of the identified parameters, and the reason for each drive that has none."""
    no_residuals = [""] * len(RESIDUALS)
    rows = list[Sequence[str]]()
    for drive in identification.drives:
        rows.append(_identified_row(drive))
        if drive.driven_theta:
            rows.append(["  true value", *_parameter_cells(drive.driven_theta), *no_residuals])
    console = terminal.console()
    console.print(terminal.table("", HEADINGS, rows))
    for name, reason in identification.failures.items():
        console.print(f"{name}: {reason}")


def _identified_row(drive: IdentifiedDrive) -> list[str]:
    """The identified parameters and residuals of a drive, in the columns HEADINGS."""
    fit = drive.fit
    omega_ref_rms_degps = math.degrees(fit.omega_ref_rms_radps)
    residuals = [f"{fit.u_ref_rms_mps:.4f}", f"{omega_ref_rms_degps:.3f}", f"{fit.condition:.1f}"]
    return [drive.name, *_parameter_cells(fit.theta), *residuals]


def _parameter_cells(theta: Theta) -> list[str]:
    """The six parameters in the columns PARAMETERS."""
    return [f"{value:.4f}" for value in astuple(theta)]
