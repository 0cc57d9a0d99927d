"""What plugins may import is frozen, and loads nothing that was not asked for."""

import ast
import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

from tests.surface import changes, surface
from vobench import plugin
from vobench.suite.catalog import builtin_root

FROZEN = Path(__file__).parent / "plugin_surface.txt"
MESSAGE = """the surface of vobench.plugin is not what tests/plugin_surface.txt froze. A name that left or changed
breaks plugins: add a deprecation to vobench/retired.py, so that the old name works for one release, and a line under
"Plugins: what changes for you" in CHANGELOG.md. Then run `python -m tests.test_plugin` to freeze it anew.
"""


def test_the_surface_of_the_plugin_module_is_the_frozen_one() -> None:
    difference = changes(FROZEN, plugin)
    assert not difference, f"{MESSAGE}\n{difference}"


def test_a_name_that_leaves_or_changes_is_in_the_difference(tmp_path: Path) -> None:
    text = FROZEN.read_text()
    frozen = tmp_path / "surface.txt"
    frozen.write_text("AAA: str\n" + text.replace("index: int", "number: int", 1))
    difference = changes(frozen, plugin).splitlines()
    assert "-AAA: str" in difference
    assert "-    number: int" in difference
    assert "+    index: int" in difference


def typed_imports() -> dict[str, tuple[str, str]]:
    """Module and name of each import that type checkers see in plugin.py, by the name it is imported as."""
    tree = ast.parse(Path(inspect.getsourcefile(plugin) or "").read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    found = {}
    for node in block.body:
        assert isinstance(node, ast.ImportFrom)
        assert node.module
        for alias in node.names:
            found[alias.asname or alias.name] = (node.module, alias.name)
    return found


def test_type_checkers_see_the_very_objects_that_are_imported() -> None:
    typed = typed_imports()
    assert sorted(typed) == sorted(plugin.HOMES) == sorted(plugin.__all__)
    for name, (module, original) in typed.items():
        home = importlib.import_module(module)
        expected = getattr(home, original, None) or importlib.import_module(f"{module}.{original}")
        assert getattr(plugin, name) is expected, name


def test_the_docstring_groups_every_name() -> None:
    words = set((plugin.__doc__ or "").replace(":", " ").split())
    assert set(plugin.__all__) <= words


def test_a_name_that_is_not_offered_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"module 'vobench\.plugin' has no attribute 'Reslt'"):
        plugin.__getattr__("Reslt")
    assert not hasattr(plugin, "nothing_of_that_name")


@pytest.mark.parametrize(
    ("imported", "heavy"),
    [
        ("Frame, Result, Rig, se3", "cv2 PIL trimesh vobench.asset vobench.dataset vobench.metric vobench.retired"),
        ("StereoTracker, stereo_pair", "PIL trimesh vobench.asset vobench.dataset vobench.metric vobench.runner"),
        ("GeneratedPlace, Sky, block", "cv2 PIL vobench.dataset vobench.estimator vobench.rendering vobench.runner"),
        ("make_mesh, block, lathe", "cv2 vobench.dataset vobench.estimator vobench.rendering vobench.runner"),
        ("MetricDefinition, POSES", "cv2 vobench.asset vobench.dataset vobench.estimator vobench.rendering"),
        ("Layout, ReadOptions, assemble", "vobench.asset vobench.metric vobench.rendering vobench.runner"),
    ],
)  # fmt: skip
def test_a_plugin_loads_nothing_that_it_does_not_ask_for(imported: str, heavy: str) -> None:
    code = f"import sys; from vobench.plugin import {imported}; print(*(set({heavy.split()!r}) & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


OWN = [*builtin_root().glob("estimators/*/*.py"), *builtin_root().glob("scenes/*/*.py")]


@pytest.mark.parametrize("path", OWN, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_built_in_plugins_import_from_the_plugin_module_alone(path: Path) -> None:
    imported = {node.module for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)}
    assert {module for module in imported if module and module.startswith("vobench")} <= {"vobench.plugin"}


def test_makers_and_generators_are_among_the_built_in_plugins() -> None:
    names = {path.name for path in OWN}
    assert {"maker.py", "generator.py", "estimator.py"} <= names


if __name__ == "__main__":
    FROZEN.write_text(surface(plugin), encoding="utf-8")
