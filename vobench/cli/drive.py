"""vobench drive."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from vobench.cli import terminal
from vobench.cli.option import Json, SuiteName, Trust
from vobench.errors import InputError
from vobench.report.drive_plot import drive_log, save_drive_plot
from vobench.report.figure_style import ENDINGS
from vobench.runner.drive import SuiteDrive, chosen_trajectories, drive_plan
from vobench.suite.suite import read_plan

HEADINGS = (
    "trajectory",
    "kind",
    "frames",
    "seconds",
    "path m",
    "max m/s",
    "max °/s",
    "°/frame",
    "wheel error m",
    "max V",
    "targets reached at s",
)


def drive_command(
    suite: SuiteName,
    *,
    trajectory: Annotated[
        str | None, typer.Option("--trajectory", "-t", help="Simulate only this trajectory of the suite.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Plot the paths on the floor plan, and the speeds over time, to this .svg, .png or .pdf."),
    ] = None,
    tum: Annotated[
        Path | None,
        typer.Option(help="Write the true poses of the body on one trajectory to this file, in TUM format."),
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option(
            help="Write the path, speeds, wheel angles, references and voltages of one trajectory to this CSV."
        ),
    ] = None,
    trust: Trust = False,
    json: Json = False,
) -> None:
    """Simulate the trajectories of a suite without rendering, and print a summary or plot them."""
    del trust  # the callback of the option has done its work
    plan = read_plan(suite)
    names = chosen_trajectories(plan, trajectory=trajectory)
    exports = [path for path in (tum, csv) if path]
    _check_files(out, exports, names)

    driven = drive_plan(plan, trajectory=trajectory)
    if out:
        logs = [drive_log(drive, has_plan=True) for drive in driven.drives]
        save_drive_plot(out, logs)
    if tum:
        tum.write_text(driven.drives[0].tum(), encoding="utf-8")
    if csv:
        csv.write_text(driven.drives[0].csv(), encoding="utf-8")

    files = [str(path) for path in (out, tum, csv) if path]
    if json:
        terminal.print_json({**driven.as_dict(), "files": files})
    else:
        _print_drives(driven, files)


def _check_files(out: Path | None, exports: Sequence[Path], names: Sequence[str]) -> None:
    """Raise InputError for files that cannot be written. It is called before the simulation, which takes time."""
    if out and out.suffix not in ENDINGS:
        raise InputError(f"--out should end in {', '.join(ENDINGS)}, got {out}")
    if exports and len(names) > 1:
        raise InputError(f"--tum and --csv need one trajectory; choose one with --trajectory: {', '.join(names)}")
    for path in [out, *exports]:
        if path is None:
            continue
        can_be_file = path.parent.is_dir() and not path.is_dir()
        if not can_be_file:
            raise InputError(f"should be a file in an existing folder: {path}")


def _print_drives(driven: SuiteDrive, files: Sequence[str]) -> None:
    """Print a table of the drives, the reasons why `vobench run` would refuse the suite, and the written files."""
    console = terminal.console()
    rows = [_row(facts) for facts in driven.as_dict()["trajectories"]]
    console.print(terminal.table("", HEADINGS, rows))
    for sentence in driven.refusals:
        console.print(f"vobench run will refuse this: {sentence}")
    for file in files:
        console.print(file)


def _row(facts: dict[str, Any]) -> list[str]:
    """The cells of a drive in the table, in the order of HEADINGS."""
    wheel_error_m = facts["wheel_error_m"]
    peak_V = facts["peak_V"]
    reached_s = facts["reached_s"] or []
    return [
        facts["trajectory"],
        facts["kind"],
        str(facts["frames"]),
        f"{facts['duration_s']:.1f}",
        f"{facts['path_m']:.2f}",
        f"{facts['max_speed_mps']:.2f}",
        f"{facts['max_turn_degps']:.0f}",
        f"{facts['max_turn_per_frame_deg']:.1f}",
        "" if wheel_error_m is None else f"{wheel_error_m:.3f}",
        "" if peak_V is None else f"{peak_V:.1f}",
        " ".join(f"{time_s:.2f}" for time_s in reached_s),
    ]
