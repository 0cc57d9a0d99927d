"""The command vobench verify, which checks whether the files and scores of a run are unchanged."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict

from vobench.cli import terminal
from vobench.cli.option import Json, RunPath
from vobench.report.verify import VerifiedItem, verify_run
from vobench.runner.folder import open_run


def verify_command(run: RunPath, *, json: Json = False) -> None:
    """Recompute all hashes and scores of a run from its files; exit code 1 if anything differs."""
    items = list(verify_run(open_run(run)))
    wrong = [item for item in items if item.wrong]
    if json:
        rows = [asdict(item) for item in items]
        terminal.print_json({"run": str(run), "checked": len(items), "wrong": len(wrong), "findings": rows})
    else:
        _print_items(items, wrong)
    raise SystemExit(1 if wrong else 0)


def _print_items(items: Sequence[VerifiedItem], wrong: Sequence[VerifiedItem]) -> None:
    """Print each item that is wrong, and the number of unchanged items of each kind."""
    console = terminal.console()
    for item in wrong:
        console.print(f"{item.kind}: {item.what}: {item.wrong}")

    total_by_kind = Counter(item.kind for item in items)
    wrong_by_kind = Counter(item.kind for item in wrong)
    for kind, total in total_by_kind.items():
        unchanged = total - wrong_by_kind[kind]
        console.print(f"{kind}: {unchanged} of {total} unchanged")
