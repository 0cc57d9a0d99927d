"""vobench verify."""

from collections.abc import Sequence
from dataclasses import asdict

from vobench.cli import terminal
from vobench.cli.option import Json, RunPath
from vobench.report.verify import VerifiedItem, verify_run
from vobench.runner.folder import open_run


def verify_command(run: RunPath, *, json: Json = False) -> None:
    """Recompute all hashes and scores of a run from its files; exit code 1 if anything differs."""
    findings = list(verify_run(open_run(run)))
    wrong = [finding for finding in findings if finding.wrong]
    if json:
        rows = [asdict(finding) for finding in findings]
        terminal.print_json({"run": str(run), "checked": len(findings), "wrong": len(wrong), "findings": rows})
    else:
        _print_findings(findings)
    raise SystemExit(1 if wrong else 0)


def _print_findings(findings: Sequence[VerifiedItem]) -> None:
    """Print what is wrong, and how much of each kind is unchanged."""
    console = terminal.console()
    for finding in findings:
        if finding.wrong:
            console.print(f"{finding.kind}: {finding.what}: {finding.wrong}")
    kinds = dict.fromkeys(finding.kind for finding in findings)
    for kind in kinds:
        is_right = [not finding.wrong for finding in findings if finding.kind == kind]
        console.print(f"{kind}: {sum(is_right)} of {len(is_right)} unchanged")
