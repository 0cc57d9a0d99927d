"""vobench try."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from vobench.cli import terminal
from vobench.cli.option import Json

if TYPE_CHECKING:
    from vobench.report.contract import Clause

VERDICT_WIDTH = 10  # columns


def try_command(
    estimator: Annotated[
        str, typer.Argument(metavar="ESTIMATOR", help="The name of an estimator, or the path of its folder.")
    ],
    *,
    json: Json = False,
) -> None:
    """Test within seconds whether an estimator satisfies the contract; exit code 1 if it does not."""
    from vobench.report.contract import Verdict, contract
    from vobench.suite import catalog

    folder = catalog.find("estimator", estimator).path
    clauses = list["Clause"]()
    for clause in contract(folder):
        clauses.append(clause)
        if not json:
            _print_clause(clause)

    is_fulfilled = all(clause.verdict is not Verdict.BROKEN for clause in clauses)
    if json:
        rows = [asdict(clause) for clause in clauses]
        terminal.print_json({"path": str(folder), "kept": is_fulfilled, "clauses": rows})
    raise SystemExit(0 if is_fulfilled else 1)


def _print_clause(clause: "Clause") -> None:
    """Print the result of one check as soon as it is known; a broken clause is in capital letters."""
    from vobench.report.contract import Verdict

    verdict = clause.verdict.value
    if clause.verdict is Verdict.BROKEN:
        verdict = verdict.upper()
    print(f"{verdict:{VERDICT_WIDTH}} {clause.name}: {clause.seen}", flush=True)
