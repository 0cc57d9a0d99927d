"""vobench new and try."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vobench.cli import terminal
from vobench.errors import InputError
from vobench.suite.scaffold import new_scene, new_suite, require_free, require_name

SCAFFOLD = Path(__file__).parent / "scaffold"


def new_command(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="What to make: an estimator, a suite or a scene.")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Lower-case letters, digits and _.")],
    *,
    source: Annotated[
        str | None, typer.Option("--from", help="Copy this suite, example or scene: lighting, quickstart, room.")
    ] = None,
    command: Annotated[bool, typer.Option("--command", help="An estimator that reads files, in any language.")] = False,
    out: Annotated[
        Path | None, typer.Option(help="The folder in which it is made; else estimators, suites or scenes.")
    ] = None,
    json: terminal.Json = False,
) -> None:
    """Make a new estimator, suite or scene, which runs as it is."""
    terminal.known("kind of thing to make", kind, tuple(MADE))
    if command and kind != "estimator":
        raise InputError(f"--command is for an estimator, not for a {kind}")
    if source and kind == "estimator":
        raise InputError("--from is for a suite or a scene, not for an estimator; copy the folder of one instead")
    usual_folder = Path(f"{kind}s")
    folder = out or usual_folder
    made = MADE[kind](name, folder, source, command)
    if json:
        files = sorted(path.name for path in made.iterdir()) if made.is_dir() else [made.name]
        terminal.print_json({"path": str(made), "files": files})
        return
    print(f"Made {made}. {NEXT[kind].format(name if folder == usual_folder else made)}")


def _new_estimator(name: str, out: Path, _: str | None, is_command: bool) -> Path:
    require_name(name)
    folder = out / name
    require_free(folder)
    folder.mkdir(parents=True)
    for source in sorted((SCAFFOLD / ("command" if is_command else "class")).iterdir()):
        text = source.read_text(encoding="utf-8").replace("NAME", name)
        (folder / source.name.replace(".txt", ".py")).write_text(text, encoding="utf-8")
    return folder


def _new_suite(name: str, out: Path, source: str | None, _: bool) -> Path:
    return new_suite(name, out=out, source=source)


def _new_scene(name: str, out: Path, source: str | None, _: bool) -> Path:
    return new_scene(name, out=out, source=source)


Maker = Callable[[str, Path, str | None, bool], Path]
MADE: dict[str, Maker] = {"estimator": _new_estimator, "suite": _new_suite, "scene": _new_scene}
# What to do with it next; {0} is its name, or its path where a name would not find it.
NEXT = {
    "estimator": "Try it: vobench try {0}\nRun it: vobench run quickstart -e {0} -e lk_epipolar",
    "suite": "Check it: vobench check {0}\nRun it: vobench run {0}",
    "scene": "Look it over: vobench scene {0}\nDraw it: vobench render {0}\nDrive in it: name it in a suite, "
    "scenes: [{0}]",
}


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
