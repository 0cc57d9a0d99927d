"""Keeps the tables of keys in these pages as the settings are: values, unit and default are read off the fields.

A table below `<!-- keys of CLASS -->` has a row for each key of that class of settings; only what a key says is written
by hand. `python docs/keys.py` rewrites the pages beside it.
"""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from vobench.cli.schema import SETTINGS_CLASSES
from vobench.setting import unit_of
from vobench.suite.yaml_file import json_schema

TABLE = re.compile(r"<!-- keys of (\w+) -->\n\n((?:\|.*\n)+)")
ZEROS = re.compile(r"\.0(?![0-9])")
HEAD = "| key | values | default | meaning |\n|---|---|---|---|\n"
BOUNDS = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}


def sections() -> dict[str, dict[str, Any]]:
    """The schema of every class of settings that YAML files hold, by its name."""
    found = dict[str, dict[str, Any]]()
    for kind in SETTINGS_CLASSES.values():
        for part in _parts(json_schema(kind)):
            if "properties" in part and len(part["properties"]) > len(
                found.get(part["title"], {}).get("properties", ())
            ):
                found[part["title"]] = part
    return found


def _parts(tree: Any) -> Iterator[dict[str, Any]]:
    parts: Iterable[Any] = ()
    if isinstance(tree, dict):
        yield tree
        parts = tree.values()
    elif isinstance(tree, list):
        parts = tree
    for part in parts:
        yield from _parts(part)


def refreshed(page: str) -> str:
    """A page with its marked tables as the settings are; a key that no row was written for says nothing yet."""
    known = sections()
    tables = TABLE.findall(page)
    said = {name: {} for name, _ in tables}
    for name, table in tables:
        said[name].update(_rows(table))
    last = dict(tables)

    def table(match: re.Match[str]) -> str:
        name = match[1]
        properties = known[match[1]]["properties"]
        keys = [key for key in _rows(match[2]) if key in properties]
        if match[2] == last[name]:
            keys += [key for key in properties if key not in said[name]]
        rows = [_row(key, known[name], said[name].get(key, "")) for key in keys]
        return f"<!-- keys of {name} -->\n\n{HEAD}{''.join(rows)}"

    return TABLE.sub(table, page)


def _rows(table: str) -> dict[str, str]:
    """What each row says, by its key."""
    cells = [line.strip("|").split("|") for line in table.splitlines()[2:]]
    return {row[0].strip().strip("`"): row[-1].strip() for row in cells}


def _row(key: str, section: dict[str, Any], said: str) -> str:
    part = section["properties"][key]
    default = _value(part["default"]) if "default" in part else "described"
    if key in section.get("required", ()):
        default = ""
    unit = unit_of(key)
    values = takes(part)
    if unit:
        values += f", {unit}" if values == "number" else f" {unit}"
    cells = (f"`{key}`", values, default, said)
    return f"|{'|'.join(f' {cell} ' if cell else ' ' for cell in cells)}|\n"


def takes(part: dict[str, Any]) -> str:
    """The values that a key takes, in words."""
    if choices := part.get("anyOf"):
        return " or ".join(dict.fromkeys(takes(choice) for choice in choices if choice.get("type") != "null"))
    if "enum" in part or "const" in part:
        return ", ".join(f"`{value}`" for value in part.get("enum", [part.get("const")]))
    if part.get("type") in {"number", "integer"}:
        return _number(part)
    if items := part.get("prefixItems"):
        kinds = list(dict.fromkeys(takes(item) for item in items))
        return f"[{len(items)} × {kinds[0]}]" if len(kinds) == 1 else f"[{', '.join(kinds)}]"
    words = {"string": "text", "boolean": "`true`, `false`", "array": "list", "object": "keys"}
    return words.get(str(part.get("type")), "any value" if not part else "keys")


def _number(part: dict[str, Any]) -> str:
    """The range of a number: `0 to 4`, `> 0`, `integer ≥ 1`."""
    if "minimum" in part and "maximum" in part:
        range_of_values = f"{part['minimum']:g} to {part['maximum']:g}"
    else:
        range_of_values = ", ".join(f"{sign} {part[name]:g}" for name, sign in BOUNDS.items() if name in part)
    if part["type"] == "integer":
        return f"integer {range_of_values}".rstrip()
    return range_of_values or "number"


def _value(default: Any) -> str:
    if default is None or default == "":
        return "none"
    if isinstance(default, dict):
        return "`{}`"
    if isinstance(default, list):
        return f"`{ZEROS.sub('', str(default))}`"
    text = f"{default:g}" if isinstance(default, float) else str(default)
    return text if isinstance(default, int | float) and not isinstance(default, bool) else f"`{text.lower()}`"


if __name__ == "__main__":
    for path in sorted(Path(__file__).parent.glob("*.md")):
        path.write_text(refreshed(path.read_text(encoding="utf-8")), encoding="utf-8")
