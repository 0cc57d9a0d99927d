"""Finds faults between two trajectory files, and the command that scores them with the faults corrected."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.analysis.diagnose import Finding, diagnose
from vobench.metric.settings import Side
from vobench.runner.data_frame import data_frame
from vobench.runner.trajectory_pair import TrajectorySource, read_pair

if TYPE_CHECKING:
    from vobench.runner.data_frame import DataFrame

OTHER_SIDE: dict[Side, Side] = {"gt": "est", "est": "gt"}
OFFSET_OPTION = "--t-offset="


@dataclass(frozen=True, slots=True)
class FileDiagnosis:
    """The faults that were found between two files. There are none if the files differ only by errors of the estimate.

    `times` are the files of time stamps that the two were read with. `by_frame` describes how poses were paired if
    neither file has stamps. `notes` describe what was done to read the files.
    """

    gt: TrajectorySource
    est: TrajectorySource
    findings: tuple[Finding, ...]
    times: tuple[Path, ...] = ()
    by_frame: str | None = None
    notes: tuple[str, ...] = ()

    @property
    def command(self) -> str | None:
        """The `vobench score` command that corrects all findings; None without findings or for unrelated files."""
        return self._command_for(self.findings)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench diagnose --json` prints them."""
        findings = [{**finding.as_dict(), "command": self._command_for([finding])} for finding in self.findings]
        return {
            "findings": findings,
            "command": self.command,
            "warnings": [self.by_frame] if self.by_frame else [],
            "notes": list(self.notes),
        }

    def to_frame(self) -> "DataFrame":
        """A pandas table with one row per finding: its fault, its sentence and the options that correct it."""
        return data_frame(
            {"fault": finding.fault, "sentence": finding.sentence, "options": " ".join(finding.options)}
            for finding in self.findings
        )

    def _command_for(self, findings: Sequence[Finding]) -> str | None:
        """The command that corrects these findings; it exchanges swapped files."""
        faults_of_all = [finding.fault for finding in self.findings]
        if not findings or "unrelated" in faults_of_all:
            return None
        files = [str(self.gt.path), str(self.est.path)]
        options = [*_source_options("gt", self.gt), *_source_options("est", self.est)]
        for finding in findings:
            options += finding.options
        if any(finding.fault == "swapped_inputs" for finding in findings):
            files.reverse()
            options = [_exchanged(option) for option in options]
        for path in self.times:
            options += ["--times", str(path)]
        return shlex.join(["vobench", "score", *files, *options])


def diagnose_files(gt: TrajectorySource, est: TrajectorySource, *, times: Sequence[Path] = ()) -> FileDiagnosis:
    """Find the faults between two files: units, clocks, quaternions, frames, axes, scale, or swapped files.

    `times` are files of time stamps for trajectories without them (KITTI).

    Raises:
        InputError: a file cannot be read, or the two do not fit together.
        AlignmentError: too few of their poses match for a diagnosis.
    """
    pair = read_pair(gt, est, times=times, any_unit=True)
    findings = diagnose(pair.gt, pair.est)
    return FileDiagnosis(gt, est, findings, tuple(times), pair.by_frame, pair.notes)


def _source_options(side: Side, source: TrajectorySource) -> list[str]:
    """The options of `vobench score` that make it read a file in the same way."""
    options = []
    if source.topic:
        options += [f"--{side}-topic", source.topic]
    for word in source.words:
        options += [f"--{side}-as", word]
    return options


def _exchanged(option: str) -> str:
    """The same option once ground truth and estimate are exchanged."""
    for side, other in OTHER_SIDE.items():
        if option.startswith(f"--{side}-"):
            return f"--{other}-{option.removeprefix(f'--{side}-')}"
    if option.startswith(OFFSET_OPTION):
        offset = option.removeprefix(OFFSET_OPTION)
        negated = offset[1:] if offset.startswith("-") else f"-{offset}"
        return f"{OFFSET_OPTION}{negated}"
    return option
