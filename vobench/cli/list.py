"""vobench list."""

import re
from typing import Annotated, Any

import typer

from vobench.asset import MODEL_SUFFIXES
from vobench.cli import terminal
from vobench.cli.option import Json
from vobench.errors import UnknownNameError, VobenchError, unknown_name_sentence
from vobench.suite import catalog
from vobench.suite.catalog import KINDS, CatalogEntry
from vobench.suite.file_kind import Kind

COLUMNS = ("kind", "name", "seeds", "summary", "origin", "path")

# The top-level key `summary`, if its value needs no YAML parser. It is faster to search for most summaries with this
# pattern than to parse and check all files, which takes seconds.
SUMMARY = re.compile(
    r"""
    ^summary:[ ]+
    (?:
        "(?P<double>[^"\\\x00-\x1f]*)"[ ]*$           # in double quotes, without escapes
    |   '(?P<single>[^'\x00-\x1f]*)'[ ]*$              # in single quotes, without escaped quotes
    |   (?P<plain>
            [^\W\d_]                                  # a letter first
            [^:\#\x00-\x1f]*[ ][^:\#\x00-\x1f]*        # two words or more, without a colon or a comment
            \w[.!?)]?                                 # a word last, with at most one mark after it
        )[ ]*$(?=\n+\S|\s*\Z)                         # no continuation on the next line
    )
    """,
    re.MULTILINE | re.VERBOSE,
)
GENERATOR_KEY = re.compile(r"^generator *:", re.MULTILINE)
SUMMARY_KEY = re.compile(r"^[\"']?summary\b", re.MULTILINE)


def list_command(
    kind: Annotated[
        str | None, typer.Argument(metavar="[suites|scenes|estimators]", help="The kind; all kinds if omitted.")
    ] = None,
    *,
    json: Json = False,
) -> None:
    """List the suites, scenes and estimators that can be found, where they are, and which scenes have seeds."""
    kinds = [known_kind for known_kind in KINDS if kind in (None, known_kind, f"{known_kind}s")]
    if not kinds:
        known_kinds = [f"{known_kind}s" for known_kind in KINDS]
        raise UnknownNameError(unknown_name_sentence("kind", str(kind), known_kinds))
    rows = list[dict[str, Any]]()
    for listed_kind in kinds:
        rows += _entry_rows(listed_kind)
    if json:
        terminal.print_json({"entries": rows})
        return
    cells = [_cells(row) for row in rows]
    terminal.console().print(terminal.table("", COLUMNS, cells))


def _entry_rows(kind: Kind) -> list[dict[str, Any]]:
    """A row for each entry of a kind. If several entries have the same name, the first one hides the others."""
    rows = list[dict[str, Any]]()
    names = set[str]()
    for entry in catalog.entries(kind):
        rows.append(
            {
                "kind": entry.kind,
                "name": entry.name,
                "seeds": _has_seeds(entry),
                "summary": _summary(entry),
                "origin": entry.origin,
                "path": str(entry.path),
                "hidden": entry.name in names,
            }
        )
        names.add(entry.name)
    return rows


def _cells(row: dict[str, Any]) -> list[str]:
    """The cells of a row in the printed table."""
    name = f"{row['name']} (hidden)" if row["hidden"] else row["name"]
    cells = {**row, "name": name, "seeds": "yes" if row["seeds"] else ""}
    return [cells[column] for column in COLUMNS]


def _has_seeds(entry: CatalogEntry) -> bool:
    """Whether an entry is a scene with a generator, which creates a different place for each seed."""
    is_file = entry.kind == "scene" and entry.path.suffix not in MODEL_SUFFIXES
    return is_file and GENERATOR_KEY.search(_text(entry)) is not None


def _summary(entry: CatalogEntry) -> str:
    """The summary in an entry's file, or why the file cannot be read."""
    if entry.path.suffix in MODEL_SUFFIXES:
        return "a model; inspect it with vobench scene"
    match = SUMMARY.search(_text(entry))
    if match:
        is_only_summary = len(SUMMARY_KEY.findall(match.string)) == 1
        if is_only_summary:
            return next(value for value in match.groups() if value is not None)
    try:
        return _parsed_summary(entry)
    except VobenchError as error:
        more_count = len(error.mistakes) - 1
        more = f" (and {more_count} more)" if more_count else ""
        return f"unreadable: {error.mistakes[0]}{more}"


def _text(entry: CatalogEntry) -> str:
    """The text of an entry's file; empty if it cannot be read."""
    path = entry.path / "estimator.yaml" if entry.kind == "estimator" else entry.path
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _parsed_summary(entry: CatalogEntry) -> str:
    """The summary in an entry's file, which is parsed and checked. Raises VobenchError if the file is not valid."""
    from vobench.suite import yaml_file
    from vobench.suite.manifest import read_manifest
    from vobench.suite.scenario import ScenarioFile
    from vobench.suite.scene_file import read_scene
    from vobench.suite.suite_spec import Suite

    if entry.kind == "estimator":
        return read_manifest(entry.path).described
    if entry.kind == "scene":
        return read_scene(entry.path).summary
    if entry.kind == "scenario":
        return yaml_file.read(entry.path, ScenarioFile).summary
    return yaml_file.read(entry.path, Suite).summary
