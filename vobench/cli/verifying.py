"""vobench verify."""

from pathlib import Path

from vobench.cli import terminal
from vobench.pipeline.verify import Finding, verify_run
from vobench.results.run_folder import open_run


def show(run: Path, *, as_json: bool) -> None:
    """Print what of a run is no longer what it was; exit code 1 where anything is."""
    findings = list(verify_run(open_run(run)))
    wrong = [finding for finding in findings if finding.wrong]
    if as_json:
        rows = [{"kind": f.kind, "what": f.what, "wrong": f.wrong} for f in findings]
        terminal.print_json({"run": str(run), "checked": len(findings), "wrong": len(wrong), "findings": rows})
    else:
        _print(findings, wrong)
    if wrong:
        raise SystemExit(1)


def _print(findings: list[Finding], wrong: list[Finding]) -> None:
    out = terminal.console()
    for f in wrong:
        out.print(f"{f.kind}: {f.what}: {f.wrong}")
    for kind in dict.fromkeys(f.kind for f in findings):
        of_kind = [f for f in findings if f.kind == kind]
        out.print(f"{kind}: {sum(not f.wrong for f in of_kind)} of {len(of_kind)} as they were")
