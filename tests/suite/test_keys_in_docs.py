"""The tables of keys in the docs are what the settings are."""

import runpy
from pathlib import Path

import pytest

from vobench.cli.schema import SETTINGS_CLASSES
from vobench.setting import unit_of
from vobench.suite.yaml_file import json_schema

DOCS = Path(__file__).parents[2] / "docs"
keys = runpy.run_path(str(DOCS / "keys.py"))
PAGES = [path for path in sorted(DOCS.glob("*.md")) if "<!-- keys of " in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_key_has_a_row_with_its_unit_values_and_default(page):
    text = page.read_text(encoding="utf-8")
    assert keys["refreshed"](text) == text, "a table has fallen behind: python docs/keys.py"
    assert all(said for _, table in keys["TABLE"].findall(text) for said in keys["_rows"](table).values())


def test_a_table_that_has_fallen_behind_is_found():
    text = (DOCS / "rigs.md").read_text(encoding="utf-8")
    for old, new in (("| 0.25 |", "| 0.3 |"), ("-90 to 90 deg", "0 to 90 deg"), ("| `height_m` |", "| `h` |")):
        assert old in text
        assert keys["refreshed"](text.replace(old, new)) != text.replace(old, new)
        assert old in keys["refreshed"](text.replace(old, new))


@pytest.mark.parametrize("kind", SETTINGS_CLASSES)
def test_a_schema_allows_no_other_keys_and_says_every_unit(kind):
    whole = json_schema(SETTINGS_CLASSES[kind])
    for section in [whole, *whole["$defs"].values()] if "$defs" in whole else [whole]:
        assert section["additionalProperties"] is False
        assert {key: part.get("unit", "") for key, part in section["properties"].items()} == {
            key: unit_of(key) for key in section["properties"]
        }


def test_the_schema_of_a_suite_says_bounds_and_names():
    rig = keys["sections"]()["RigSettings"]["properties"]
    assert rig["pitch_deg"] == {"minimum": -90, "maximum": 90, "type": "number", "unit": "deg"}
    assert "euroc" in rig["lens"]["enum"]
