"""The code of a maker or generator is all Python in its folder: what any of it changes, changes the scene's content."""

from pathlib import Path

import pytest

from vobench.suite.scene_code import code_files, code_identity, sources
from vobench.suite.scene_file import read_place, scene_content


@pytest.fixture
def generator(tmp_path: Path) -> Path:
    folder = tmp_path / "mine"
    (folder / "parts").mkdir(parents=True)
    (folder / "generator.py").write_text("import parts.wall\n", encoding="utf-8")
    (folder / "parts" / "wall.py").write_text("HIGH_M = 2\n", encoding="utf-8")
    (folder / "scene.yaml").write_text("name: mine\ngenerator: generator.py\n", encoding="utf-8")
    return folder / "generator.py"


def test_the_file_comes_first_and_the_others_in_order(generator: Path) -> None:
    (generator.parent / "a.py").write_text("", encoding="utf-8")
    names = [str(path.relative_to(generator.parent)) for path in code_files(generator)]
    assert names == ["generator.py", "a.py", "parts/wall.py"]
    assert len(list(sources(generator))) == 2 * len(names)


def test_what_a_generator_imports_from_its_folder_changes_the_content_of_its_places(generator: Path) -> None:
    scene = str(generator.parent / "scene.yaml")
    before = scene_content(read_place(scene, seed=3))["generator"]
    assert scene_content(read_place(scene, seed=3))["generator"] == before
    (generator.parent / "parts" / "wall.py").write_text("HIGH_M = 3\n", encoding="utf-8")
    assert scene_content(read_place(scene, seed=3))["generator"] != before


def test_the_identity_depends_on_names_and_contents_and_not_on_the_folder(generator: Path, tmp_path: Path) -> None:
    before = code_identity(generator)
    other = tmp_path / "other"
    generator.parent.rename(other)
    assert code_identity(other / "generator.py") == before
    (other / "notes.txt").write_text("no code", encoding="utf-8")
    assert code_identity(other / "generator.py") == before
    (other / "parts" / "wall.py").rename(other / "parts" / "walls.py")
    assert code_identity(other / "generator.py") != before


def test_bytes_that_move_from_one_file_to_the_next_change_the_identity(tmp_path: Path) -> None:
    (tmp_path / "generator.py").write_text("ab", encoding="utf-8")
    first = code_identity(tmp_path / "generator.py")
    (tmp_path / "generator.py").write_text("a", encoding="utf-8")
    (tmp_path / "b.py").write_text("", encoding="utf-8")
    assert code_identity(tmp_path / "generator.py") != first
