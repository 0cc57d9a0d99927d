"""The house keeps to its plan: lines per room, no import circle, files of a readable size."""

import tomllib
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import vobench

PACKAGE = Path(vobench.__file__).parent
PROJECT = PACKAGE.parent / "pyproject.toml"
BUDGETS: dict[str, int] = tomllib.loads(PROJECT.read_text())["tool"]["vobench"]["lines"]


def _lines(path: Path) -> int:
    files = path.rglob("*.py") if path.is_dir() else [path]
    return sum(len(file.read_text().splitlines()) for file in files)


def _rooms() -> list[str]:
    folders = [path.parent.name for path in PACKAGE.glob("*/__init__.py")]
    return sorted([*folders, *(path.stem for path in PACKAGE.glob("*.py") if not path.stem.startswith("__"))])


def test_every_room_has_a_budget_and_no_budget_is_for_a_room_that_is_gone() -> None:
    assert sorted(BUDGETS) == sorted([*_rooms(), "whole"])


@pytest.mark.parametrize("room", _rooms())
def test_a_room_keeps_to_its_budget_of_lines(room: str) -> None:
    path = PACKAGE / room
    assert _lines(path if path.is_dir() else path.with_suffix(".py")) <= BUDGETS[room]


def test_the_whole_house_keeps_to_its_budget_of_lines() -> None:
    assert _lines(PACKAGE) <= BUDGETS["whole"]


def test_no_import_leads_back_to_where_it_began() -> None:
    grimp = pytest.importorskip("grimp")
    graph = grimp.build_graph("vobench", cache_dir=None, exclude_type_checking_imports=True)
    # The package's own names are looked up when they are asked for.
    modules = {m: graph.find_modules_directly_imported_by(m) - {"vobench"} for m in graph.modules if m != "vobench"}
    TopologicalSorter(modules).prepare()
