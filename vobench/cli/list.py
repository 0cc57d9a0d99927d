"""vobench list."""

import re
from typing import Annotated, Any

import typer

from vobench.cli import terminal
from vobench.errors import UnknownNameError, VobenchError, unknown
from vobench.suite import catalog
from vobench.suite.catalog import KINDS, Entry, Kind

# The values of a top-level key `summary` that say the same without a YAML parser: on one line, in quotes without
# escapes, or two words or more of plain text without a colon or a comment.
QUOTED = r"""(?:"(?P<double>[^"\\\x00-\x1f]*)"|'(?P<single>[^'\x00-\x1f]*)') *$"""
PLAIN = r"(?P<plain>[^\W\d_][^:#\x00-\x1f]* [^:#\x00-\x1f]*\w[.!?)]?) *$(?=\n+\S|\s*\Z)"
SUMMARY = re.compile(rf"^summary: +(?:{QUOTED}|{PLAIN})", re.MULTILINE)
SUMMARY_KEY = re.compile(r"^[\"']?summary\b", re.MULTILINE)


def show(kind: str | None, *, as_json: bool) -> None:
    """Print all entries of one kind or of all; where a name is there twice, the second is hidden by the first."""
    facts = [_facts(entry) for wanted in _kinds(kind) for entry in catalog.entries(wanted)]
    seen: set[tuple[str, str]] = set()
    for fact in facts:
        fact["hidden"] = (fact["kind"], fact["name"]) in seen
        seen.add((fact["kind"], fact["name"]))
    if as_json:
        terminal.print_json({"entries": facts})
        return
    columns = ["kind", "name", "summary", "origin", "path"]
    rows = [
        [f[column] + (" (hidden)" if column == "name" and f["hidden"] else "") for column in columns] for f in facts
    ]
    terminal.console().print(terminal.table("", columns, rows))


def _kinds(kind: str | None) -> tuple[Kind, ...]:
    if kind is None:
        return KINDS
    for known in KINDS:
        if kind in (known, f"{known}s"):
            return (known,)
    raise UnknownNameError(unknown("kind", kind, [f"{known}s" for known in KINDS]))


def _facts(entry: Entry) -> dict[str, Any]:
    return {
        "kind": entry.kind,
        "name": entry.name,
        "summary": _summary(entry),
        "origin": entry.origin,
        "path": str(entry.path),
    }


def _summary(entry: Entry) -> str:
    """What the file says of itself; one that is read whole and cannot be says why."""
    try:
        path = entry.path / "estimator.yaml" if entry.kind == "estimator" else entry.path
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        text = ""
    found = SUMMARY.search(text)
    if found and len(SUMMARY_KEY.findall(text)) == 1:
        return next(value for value in found.groups() if value is not None)
    try:
        return _checked_summary(entry)
    except VobenchError as error:
        more = len(error.mistakes) - 1
        return f"unreadable: {error.mistakes[0]}{f' (and {more} more)' if more else ''}"


def _checked_summary(entry: Entry) -> str:
    """The same by the checked models. Raises VobenchError."""
    from vobench.suite import yaml_file
    from vobench.suite.manifest import read_manifest
    from vobench.suite.scene_file import read_scene
    from vobench.suite.suite import Suite

    if entry.kind == "estimator":
        return read_manifest(entry.path).summary
    if entry.kind == "scene":
        return read_scene(entry.path).summary
    return yaml_file.read(entry.path, Suite).summary


def list_command(
    kind: Annotated[
        str | None, typer.Argument(metavar="[suites|scenes|estimators]", help="All where left out.")
    ] = None,
    *,
    json: terminal.Json = False,
) -> None:
    """List the suites, scenes and estimators that can be found, and where."""
    show(kind, as_json=json)
