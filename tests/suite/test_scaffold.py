"""New suites and scenes are valid as they are, copies too."""

from pathlib import Path

import pytest

from vobench.errors import InputError
from vobench.suite import catalog
from vobench.suite.file_kind import Kind
from vobench.suite.scaffold import new_scene, new_suite
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene
from vobench.suite.suite import read_plan


def names_of_the_house(kind: Kind) -> list[str]:
    root = catalog.builtin_root()
    return [entry.name for entry in catalog.entries(kind) if entry.path.is_relative_to(root)]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("VOBENCH_PATH", raising=False)
    return tmp_path


def test_a_new_suite_is_valid_and_found_by_its_name() -> None:
    path = new_suite("mine")
    plan = read_plan("mine")
    assert path == Path("suites/mine.yaml")
    assert plan.source.path == path.resolve()
    assert plan.suite.name == "mine"
    assert len(plan.cases) == 4
    assert len(plan.estimator_entries) == 3


def test_a_new_scene_is_valid_and_found_by_its_name() -> None:
    path = new_scene("lab")
    spec = read_scene(catalog.find("scene", "lab").path)
    assert path == Path("scenes/lab.yaml")
    assert spec.name == "lab"
    assert {light.name for light in build(spec, {}).lights} == {"lamp", "sky"}


@pytest.mark.parametrize("name", [entry.name for entry in catalog.examples()])
def test_an_example_is_copied_under_another_name(name: str) -> None:
    original = next(entry.path for entry in catalog.examples() if entry.name == name)
    path = new_suite("mine", source=name)
    assert "examples/" not in path.read_text()
    copy = read_plan("mine")
    first = read_plan(str(original))
    assert copy.suite.name == "mine"
    assert [case.name for case in copy.cases] == [case.name for case in first.cases]


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow if name == "full" else ()) for name in names_of_the_house("suite")],
)
def test_a_suite_of_the_house_is_copied_under_another_name(name: str) -> None:
    new_suite("mine", source=name)
    copy = read_plan("mine")
    assert copy.suite.name == "mine"
    assert [case.name for case in copy.cases] == [case.name for case in read_plan(name).cases]


@pytest.mark.parametrize("name", names_of_the_house("scene"))
def test_a_scene_of_the_house_is_copied_with_its_maker(name: str) -> None:
    path = new_scene("mine", source=name)
    assert path == Path("scenes/mine/scene.yaml")
    spec = read_scene(catalog.find("scene", "mine").path)
    original = read_scene(catalog.find("scene", name).path)
    assert spec.name == "mine"
    if original.maker:
        assert spec.maker == str(Path("scenes/mine/maker.py").resolve())


def test_a_scene_in_one_file_is_copied_as_one_file() -> None:
    new_scene("lab")
    path = new_scene("lab_b", source="lab")
    assert path == Path("scenes/lab_b.yaml")
    assert read_scene(path).name == "lab_b"


@pytest.mark.parametrize("make", [new_suite, new_scene])
def test_a_second_one_goes_into_the_folder_of_the_first(make) -> None:
    first = make("mine")
    second = make("other")
    assert first.parent == second.parent
    assert sorted(first.parent.iterdir()) == [first, second]


@pytest.mark.parametrize("make", [new_suite, new_scene])
def test_what_is_there_is_not_written_over(make) -> None:
    path = make("mine")
    before = path.read_bytes()
    with pytest.raises(InputError, match=rf"^already exists; .*: {path}$"):
        make("mine", source="quickstart" if make is new_suite else "room")
    assert path.read_bytes() == before


def test_a_model_is_not_copied() -> None:
    Path("house.glb").write_bytes(b"glTF")
    with pytest.raises(InputError, match=r"^a model has no YAML to copy; run `vobench new scene mine` and add"):
        new_scene("mine", source="house.glb")
    assert not Path("scenes").exists()


def test_a_name_that_makes_a_path_is_refused() -> None:
    with pytest.raises(InputError, match=r"^a name should consist of lower-case letters"):
        new_suite("../mine")
