"""Paths are shown as somebody in this folder would type them."""

from pathlib import Path

import pytest

from vobench.suite.display_path import display_path


def test_a_path_below_the_working_folder_is_relative_and_names_the_same_file(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert display_path(tmp_path / "my" / "suite.yaml") == "my/suite.yaml"
    assert display_path(Path("my/../suite.yaml")) == "suite.yaml"


@pytest.mark.parametrize("outside", ["other.yaml", "work_too/suite.yaml"])
def test_a_path_outside_is_absolute(tmp_path: Path, monkeypatch, outside: str) -> None:
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    assert display_path(tmp_path / outside) == str(tmp_path / outside)
