"""vobench new and try."""

import re
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.errors import InputError

SCAFFOLD = Path(__file__).parent / "scaffold"


def new_command(
    kind: Annotated[str, typer.Argument(metavar="estimator", help="What to make: an estimator.")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Lower-case letters, digits and _.")],
    *,
    command: Annotated[bool, typer.Option("--command", help="A program that reads files, in any language.")] = False,
    out: Annotated[Path, typer.Option(help="The folder in which NAME/ is made.")] = Path("estimators"),
    json: terminal.Json = False,
) -> None:
    """Make the folder of a new estimator, which runs as it is."""
    terminal.known("kind of thing to make", kind, ("estimator",))
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(f"a name should be lower-case letters, digits and _, a letter first (got {name!r})")
    folder = out / name
    if folder.exists():
        raise InputError(f"there is one already; choose another name or take it away: {folder}")
    folder.mkdir(parents=True)
    for source in sorted((SCAFFOLD / ("command" if command else "class")).iterdir()):
        text = source.read_text(encoding="utf-8").replace("NAME", name)
        (folder / source.name.replace(".txt", ".py")).write_text(text, encoding="utf-8")
    if json:
        terminal.print_json({"path": str(folder), "files": sorted(path.name for path in folder.iterdir())})
        return
    found = name if out == Path("estimators") else folder
    print(f"Made {folder}. Try it: vobench try {found}\nRun it: vobench run quickstart -e {found} -e lk_epipolar")


def try_command(
    estimator: Annotated[
        str, typer.Argument(metavar="ESTIMATOR", help="An estimator's name, or a path to its folder.")
    ],
    *,
    json: terminal.Json = False,
) -> None:
    """See in seconds whether an estimator keeps the contract; exit code 1 where it does not."""
    from vobench.report.contract import Verdict, contract
    from vobench.suite import catalog

    folder = catalog.find("estimator", estimator).path
    clauses = []
    for clause in contract(folder):
        clauses.append(clause)
        if not json:
            word = clause.verdict.upper() if clause.verdict is Verdict.BROKEN else clause.verdict
            print(f"{word:9} {clause.name}: {clause.seen}", flush=True)
    is_kept = all(clause.verdict is not Verdict.BROKEN for clause in clauses)
    if json:
        terminal.print_json({"path": str(folder), "kept": is_kept, "clauses": [asdict(clause) for clause in clauses]})
    raise SystemExit(0 if is_kept else 1)
