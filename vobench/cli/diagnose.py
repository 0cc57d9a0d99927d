"""vobench diagnose."""

import sys
from typing import TYPE_CHECKING, Any

from vobench.cli import terminal
from vobench.cli.option import Json, with_option_groups
from vobench.cli.trajectory_option import EstimatePath, TrajectoryOptions, TruthPath

if TYPE_CHECKING:
    from rich.console import Console

# Remedies of faults that no option corrects.
REMEDY_WITHOUT_OPTION = {
    "swapped_inputs": "give the two files in the other order",
    "unrelated": "none; check that both files are of the same recording",
}


@with_option_groups
def diagnose_command(
    gt: TruthPath,
    est: EstimatePath,
    *,
    trajectories: TrajectoryOptions,
    json: Json = False,
) -> None:
    """Find faults between two trajectories (frames, axes, scale, clocks, quaternions), and what corrects them."""
    from vobench.analysis.diagnose_files import diagnose_files

    truth = trajectories.truth(gt)
    estimate = trajectories.estimate(est)
    diagnosis = diagnose_files(truth, estimate, times=trajectories.time_files)
    if json:
        terminal.print_json(diagnosis.as_dict())
        return
    for note in diagnosis.notes:
        print(f"note: {note}", file=sys.stderr)
    _print_diagnosis(diagnosis.as_dict())


def _print_diagnosis(diagnosis: dict[str, Any]) -> None:
    console = terminal.console()
    for warning in diagnosis["warnings"]:
        console.print(f"warning: {warning}", style="yellow", soft_wrap=True)
    if not diagnosis["findings"]:
        console.print("no fault was found: the differences are errors of the estimate")
        return
    for finding in diagnosis["findings"]:
        _print_finding(finding, console)
    if diagnosis["command"]:
        console.print(f"all corrections: {diagnosis['command']}", soft_wrap=True)


def _print_finding(finding: dict[str, Any], console: "Console") -> None:
    console.print(f"{finding['fault']}: {finding['sentence']}", style="bold", soft_wrap=True)
    for figure in finding["evidence"]:
        unit = "" if figure["unit"] == "1" else f" {figure['unit']}"
        before = "none" if figure["before"] is None else f"{figure['before']:.4g}{unit}"
        after = f"{figure['after']:.4g}{unit}"
        console.print(f"  {figure['name']}: {before}, corrected {after}", soft_wrap=True)
    remedy = " ".join(finding["options"]) or REMEDY_WITHOUT_OPTION[finding["fault"]]
    console.print(f"  correction: {remedy}", soft_wrap=True)
