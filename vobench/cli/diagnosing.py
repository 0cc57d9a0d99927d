"""vobench diagnose."""

import shlex
from pathlib import Path
from typing import Any

from vobench.cli import terminal
from vobench.metric.diagnose import Finding, diagnose
from vobench.pipeline.pair import Source, read_pair


def show(gt: Source, est: Source, *, times: Path | None, as_json: bool) -> None:
    """Print what is wrong between two trajectories, its evidence, and the command that scores without it."""
    pair = read_pair(gt, est, times=times, any_unit=True)
    findings = diagnose(pair.gt, pair.est)
    content = {
        "findings": [{**finding.as_dict(), "command": _command(gt, est, times, [finding])} for finding in findings],
        "command": _command(gt, est, times, findings) if findings else None,
        "warnings": list(pair.notes),
    }
    if as_json:
        terminal.print_json(content)
    else:
        _print(content)


def _command(gt: Source, est: Source, times: Path | None, findings: list[Finding] | tuple[Finding, ...]) -> str:
    """The score that all these findings mend."""
    files = [str(gt.path), str(est.path)]
    words = [part for side in (("gt", gt), ("est", est)) for part in _source_words(*side)]
    words += ["--times", str(times)] if times else []
    if any(finding.fault == "swapped_inputs" for finding in findings):
        files.reverse()
    for finding in findings:
        words += finding.options
    return shlex.join(["vobench", "score", *files, *words])


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
        out.print(f"  mend: {' '.join(finding['options']) or 'give the two files in the other order'}", soft_wrap=True)
    out.print(f"all of it: {content['command']}", soft_wrap=True)
