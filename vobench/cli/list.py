"""vobench list."""

import re
from typing import Annotated, Any

import typer

from vobench.asset import MODEL_SUFFIXES
from vobench.cli import terminal
from vobench.errors import UnknownNameError, VobenchError, unknown
from vobench.suite import catalog
from vobench.suite.catalog import KINDS, Entry

# The values of a top-level key `summary` that say the same without a YAML parser: on one line, in quotes without
# escapes, or two words or more of plain text without a colon or a comment.
QUOTED = r"""(?:"(?P<double>[^"\\\x00-\x1f]*)"|'(?P<single>[^'\x00-\x1f]*)') *$"""
PLAIN = r"(?P<plain>[^\W\d_][^:#\x00-\x1f]* [^:#\x00-\x1f]*\w[.!?)]?) *$(?=\n+\S|\s*\Z)"
SUMMARY = re.compile(rf"^summary: +(?:{QUOTED}|{PLAIN})", re.MULTILINE)
SUMMARY_KEY = re.compile(r"^[\"']?summary\b", re.MULTILINE)


def list_command(
    kind: Annotated[
        str | None, typer.Argument(metavar="[suites|scenes|estimators]", help="All where left out.")
    ] = None,
    *,
    json: terminal.Json = False,
) -> None:
    """List the suites, scenes and estimators that can be found, and where."""
    kinds = [known for known in KINDS if kind in (None, known, f"{known}s")]
    if not kinds:
        raise UnknownNameError(unknown("kind", str(kind), [f"{known}s" for known in KINDS]))
    facts = list[dict[str, Any]]()
    seen = set[tuple[str, str]]()
    for entry in (entry for wanted in kinds for entry in catalog.entries(wanted)):
        fact = {"kind": entry.kind, "name": entry.name, "summary": _summary(entry), "origin": entry.origin}
        # Where a name is there twice, the second is hidden by the first.
        facts.append({**fact, "path": str(entry.path), "hidden": (entry.kind, entry.name) in seen})
        seen.add((entry.kind, entry.name))
    if json:
        terminal.print_json({"entries": facts})
        return
    columns = ["kind", "name", "summary", "origin", "path"]
    rows = [[f[name] + (" (hidden)" if name == "name" and f["hidden"] else "") for name in columns] for f in facts]
    terminal.console().print(terminal.table("", columns, rows))


def _summary(entry: Entry) -> str:
    """What the file says of itself; one that is read whole and cannot be says why."""
    if entry.path.suffix in MODEL_SUFFIXES:
        return "a model; vobench scene looks it over"
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
    from vobench.suite.scenario import ScenarioFile
    from vobench.suite.scene_file import read_scene
    from vobench.suite.suite import Suite

    if entry.kind == "estimator":
        return read_manifest(entry.path).described
    if entry.kind == "scene":
        return read_scene(entry.path).summary
    if entry.kind == "scenario":
        return yaml_file.read(entry.path, ScenarioFile).summary
    return yaml_file.read(entry.path, Suite).summary
