"""Find theta in recorded drives: vobench identify."""

import math
from dataclasses import astuple
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.motion.pioneer import Theta
from vobench.runner.identify import Identification, IdentifiedDrive, identify_drives

PARAMETERS = tuple(f"θ{number}" for number in range(1, 7))
HEADINGS = ("name", *PARAMETERS, "u_ref rms m/s", "ω_ref rms °/s", "condition")


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
    found = identify_drives(path, radius_m=radius_m, track_m=track_m)
    if json:
        terminal.print_json(found.as_dict())
    else:
        _print(found)


def _print(found: Identification) -> None:
    rows = []
    for drive in found.drives:
        rows.append(_fitted_row(drive))
        if drive.driven_theta:
            rows.append(["  driven with", *_parameters(drive.driven_theta), "", "", ""])
    console = terminal.console()
    console.print(terminal.table("", HEADINGS, rows))
    for name, sentence in found.failures.items():
        console.print(f"{name}: {sentence}")


def _fitted_row(drive: IdentifiedDrive) -> list[str]:
    fit = drive.fit
    omega_ref_rms_degps = math.degrees(fit.omega_ref_rms_radps)
    residuals = [f"{fit.u_ref_rms_mps:.4f}", f"{omega_ref_rms_degps:.3f}", f"{fit.condition:.1f}"]
    return [drive.name, *_parameters(fit.theta), *residuals]


def _parameters(theta: Theta) -> list[str]:
    return [f"{value:.4f}" for value in astuple(theta)]
