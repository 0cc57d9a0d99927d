"""vobench diagnose."""

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vobench.cli import terminal
from vobench.metric.diagnose import Finding, diagnose
from vobench.pipeline.pair import Source, read_pair

WITHOUT_OPTION = {
    "swapped_inputs": "give the two files in the other order",
    "unrelated": "none; see whether both files are of the same recording",
}


def show(gt: Source, est: Source, *, times: Sequence[Path], as_json: bool) -> None:
    """Print what is wrong between two trajectories, its evidence, and the command that scores without it."""
    pair = read_pair(gt, est, times=times, any_unit=True)
    findings = diagnose(pair.gt, pair.est)
    is_unrelated = any(finding.fault == "unrelated" for finding in findings)
    content = {
        "findings": [
            {**finding.as_dict(), "command": None if is_unrelated else _command(gt, est, times, [finding])}
            for finding in findings
        ],
        "command": _command(gt, est, times, findings) if findings and not is_unrelated else None,
        "warnings": [pair.by_frame] if pair.by_frame else [],
        "notes": list(pair.notes),
    }
    if as_json:
        terminal.print_json(content)
        return
    for note in pair.notes:
        print(f"note: {note}", file=sys.stderr)
    _print(content)


def _command(gt: Source, est: Source, times: Sequence[Path], findings: Sequence[Finding]) -> str:
    """The score that all these findings mend: of swapped files each is named for what it is."""
    is_swapped = any(finding.fault == "swapped_inputs" for finding in findings)
    files = [str(gt.path), str(est.path)]
    words = [part for side in (("gt", gt), ("est", est)) for part in _source_words(*side)]
    words += [option for finding in findings for option in finding.options]
    if is_swapped:
        files.reverse()
        words = [_exchanged(word) for word in words]
    words += [part for path in times for part in ("--times", str(path))]
    return shlex.join(["vobench", "score", *files, *words])


def _exchanged(word: str) -> str:
    """An option as it reads once truth and estimate have changed places."""
    for side, other in (("gt", "est"), ("est", "gt")):
        if word.startswith(f"--{side}-"):
            return f"--{other}-{word.removeprefix(f'--{side}-')}"
    if word.startswith("--t-offset="):
        offset = word.removeprefix("--t-offset=")
        return f"--t-offset={offset[1:] if offset.startswith('-') else f'-{offset}'}"
    return word


def _source_words(side: str, source: Source) -> list[str]:
    topic = [f"--{side}-topic", source.topic] if source.topic else []
    return topic + [part for word in source.words for part in (f"--{side}-as", word)]


def _print(content: dict[str, Any]) -> None:
    out = terminal.console()
    for warning in content["warnings"]:
        out.print(f"warning: {warning}", style="yellow", soft_wrap=True)
    if not content["findings"]:
        out.print("nothing wrong was found: what differs are errors of the estimate")
        return
    for finding in content["findings"]:
        out.print(f"{finding['fault']}: {finding['sentence']}", style="bold", soft_wrap=True)
        for figure in finding["evidence"]:
            unit = "" if figure["unit"] == "1" else f" {figure['unit']}"
            before = "none" if figure["before"] is None else f"{figure['before']:.4g}{unit}"
            out.print(f"  {figure['name']}: {before}, mended {figure['after']:.4g}{unit}", soft_wrap=True)
        out.print(f"  mend: {' '.join(finding['options']) or WITHOUT_OPTION[finding['fault']]}", soft_wrap=True)
    if content["command"]:
        out.print(f"all of it: {content['command']}", soft_wrap=True)
