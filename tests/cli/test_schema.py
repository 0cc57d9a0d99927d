"""vobench schema prints the JSON Schema of each kind of file."""

import pytest

from vobench.cli.schema import SETTINGS_CLASSES


@pytest.mark.parametrize("kind", SETTINGS_CLASSES)
def test_a_schema_has_its_dialect_and_the_keys_of_its_kind(vobench, kind):
    schema = vobench("schema", kind).json
    assert schema["$schema"].endswith("2020-12/schema")
    assert "name" in schema["properties"]
    assert schema["title"] == SETTINGS_CLASSES[kind].__name__


def test_without_a_kind_it_is_that_of_a_suite_and_json_changes_nothing(vobench):
    assert vobench("schema").out == vobench("schema", "suite").out == vobench("schema", "--json").out
