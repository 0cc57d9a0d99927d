"""The house keeps to its plan: no import circle, and one idea a line."""

import ast
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ("vobench", "estimators", "scenes", "benchmarks", "examples", "docs")
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
KINDS = (ast.Assign, ast.ClassDef, ast.IfExp, *COMPREHENSIONS)


def test_no_import_leads_back_to_where_it_began() -> None:
    grimp = pytest.importorskip("grimp")
    graph = grimp.build_graph("vobench", cache_dir=None, exclude_type_checking_imports=True)
    # The package's own names are looked up when they are asked for.
    modules = {m: graph.find_modules_directly_imported_by(m) - {"vobench"} for m in graph.modules if m != "vobench"}
    TopologicalSorter(modules).prepare()


def _sources(folder: Path) -> list[Path]:
    """The Python files below a folder, without those in hidden folders such as an environment `.venv`."""
    found = []
    for path in sorted(folder.rglob("*.py")):
        is_hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if not is_hidden:
            found.append(path)
    return found


@cache
def _nodes() -> list[tuple[Path, ast.AST]]:
    """The nodes of all sources that these tests look at, with their files."""
    nodes = []
    for folder in SOURCES:
        for path in _sources(ROOT / folder):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            nodes += [(path, node) for node in ast.walk(tree) if isinstance(node, KINDS)]
    return nodes


def test_an_environment_in_a_folder_is_not_read(tmp_path: Path) -> None:
    for name in ("own.py", ".venv/lib/other.py", "sub/own.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert [path.name for path in _sources(tmp_path)] == ["own.py", "own.py"]


def _is_packed(node: ast.AST) -> bool:
    """Whether a statement assigns several values that stand beside each other, as `a, b = x, y`; a swap does not."""
    if not isinstance(node, ast.Assign) or not isinstance(node.value, ast.Tuple):
        return False
    if not isinstance(node.targets[0], ast.Tuple):
        return False
    targets = {ast.unparse(target) for target in node.targets[0].elts}
    used = {ast.unparse(name) for value in node.value.elts for name in ast.walk(value) if isinstance(name, ast.expr)}
    is_starred = any(isinstance(target, ast.Starred) for target in node.targets[0].elts)
    return not (targets & used) and not is_starred


def test_a_statement_assigns_one_value_where_values_are_unlike() -> None:
    packed = [f"{path.relative_to(ROOT)}:{node.lineno}" for path, node in _nodes() if _is_packed(node)]
    assert packed == []


def _holds_itself(node: ast.AST, kinds: type | tuple[type, ...]) -> bool:
    """Whether an expression of one of these kinds has another one of them in it."""
    return isinstance(node, kinds) and any(isinstance(inner, kinds) for inner in ast.walk(node) if inner is not node)


def test_no_conditional_expression_stands_in_another() -> None:
    nested = [f"{path.relative_to(ROOT)}:{node.lineno}" for path, node in _nodes() if _holds_itself(node, ast.IfExp)]
    assert nested == []


def _has_inner_comprehension(node: ast.AST) -> bool:
    """Whether a comprehension builds another collection inside; a generator in any() or join() does not."""
    if not isinstance(node, COMPREHENSIONS):
        return False
    inner = [each for each in ast.walk(node) if each is not node]
    return any(isinstance(each, ast.ListComp | ast.SetComp | ast.DictComp) for each in inner)


def test_no_comprehension_builds_a_collection_in_another() -> None:
    nested = [f"{path.relative_to(ROOT)}:{node.lineno}" for path, node in _nodes() if _has_inner_comprehension(node)]
    assert nested == []


def test_no_class_name_of_vobench_has_two_meanings() -> None:
    places: dict[str, list[str]] = {}
    for path, node in _nodes():
        is_at_top = isinstance(node, ast.ClassDef) and node.col_offset == 0
        if is_at_top and path.is_relative_to(ROOT / "vobench") and not node.name.startswith("_"):
            places.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert {name: where for name, where in places.items() if len(where) > 1} == {}
