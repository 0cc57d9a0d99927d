"""JSON files that may be missing or damaged."""

import pytest

from vobench.report.json_file import read_object


@pytest.mark.parametrize("text", ["", "{", "[1]", "3", "null"])
def test_a_file_without_an_object_is_empty(tmp_path, text):
    (tmp_path / "file.json").write_text(text)
    assert read_object(tmp_path / "file.json") == {}
    assert read_object(tmp_path / "missing.json") == {}


def test_an_object_is_read(tmp_path):
    (tmp_path / "file.json").write_text('{"a": "ü"}', encoding="utf-8")
    assert read_object(tmp_path / "file.json") == {"a": "ü"}
