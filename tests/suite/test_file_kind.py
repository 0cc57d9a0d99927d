"""Files of one kind where those of another belong: one sentence says so, and what to do with them."""

from dataclasses import fields
from pathlib import Path

import pytest

from vobench.errors import UnknownNameError, VobenchError
from vobench.estimator.manifest import Manifest
from vobench.suite import catalog, file_kind
from vobench.suite.manifest import read_manifest
from vobench.suite.scenario import ScenarioFile, read_scenario
from vobench.suite.scene_file import read_scene
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite import read_plan
from vobench.suite.suite_spec import Suite

MODELS = {"suite": Suite, "scenario": ScenarioFile, "scene": SceneFile, "estimator": Manifest}
SUITE = "name: mine\nscenes: [room]\nestimators: [stand_still]\n"
SCENE = """name: lab
white_cd_m2: 50
materials: {grain: {pattern: plain, albedo: 0.5}}
room: {size_m: [2, 2, 1.5], floor: grain, wall: grain, ceiling: grain}
lamps: [{name: lamp, center_m: [0, 0, 1.4], size_m: [0.4, 0.4], power_lm: 600}]
"""
SCENARIO = "name: dusk\nbase: {scene: room}\nseverity: [{}, {}, {}, {}, {}, {}]\n"
MANIFEST = "name: vo\nversion: '1'\nclass: vo:Vo\nneeds: [stereo]\npose_of: left_camera\nsummary: It looks\n"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a file of each kind."""
    monkeypatch.chdir(tmp_path)
    for path, text in {
        "my/mine.yaml": SUITE,
        "my/lab.yaml": SCENE,
        "my/dusk.yaml": SCENARIO,
        "my/vo/estimator.yaml": MANIFEST,
    }.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    return tmp_path


def said(read, path: Path) -> str:
    with pytest.raises(VobenchError) as refused:
        read(path)
    return str(refused.value)


@pytest.mark.parametrize("kind", catalog.KINDS)
def test_a_mark_is_a_key_of_its_own_kind_and_of_no_other(kind: file_kind.Kind) -> None:
    keys = {each: {"class" if f.name == "class_path" else f.name for f in fields(MODELS[each])} for each in MODELS}
    others = set().union(*(keys[each] for each in MODELS if each != kind))
    assert file_kind.DISTINCTIVE_KEYS[kind] <= keys[kind]
    assert not file_kind.DISTINCTIVE_KEYS[kind] & others


@pytest.mark.parametrize("kind", catalog.KINDS)
def test_all_that_vobench_brings_along_is_of_its_kind(kind: file_kind.Kind) -> None:
    for entry in catalog.entries(kind):
        path = entry.path / "estimator.yaml" if kind == "estimator" else entry.path
        assert file_kind.guessed_kind(path) == kind or "include:" in path.read_text()


def test_a_scene_where_a_suite_belongs(here: Path) -> None:
    assert said(lambda path: read_plan(str(path)), here / "my/lab.yaml") == (
        "my/lab.yaml: this is a scene, not a suite; render it with `vobench render my/lab.yaml`"
    )


def test_a_scenario_where_a_suite_belongs(here: Path) -> None:
    assert said(lambda path: read_plan(str(path)), here / "my/dusk.yaml") == (
        "my/dusk.yaml: this is a scenario, not a suite; add it to a suite, as in `scenarios: {dusk: [1, 3, 5]}`"
    )


def test_a_manifest_where_a_suite_belongs(here: Path) -> None:
    assert said(lambda path: read_plan(str(path)), here / "my/vo/estimator.yaml") == (
        "my/vo/estimator.yaml: this is an estimator's manifest, not a suite; "
        "run it with `vobench run quickstart -e my/vo`"
    )


def test_a_model_where_a_suite_belongs(here: Path) -> None:
    (here / "house.glb").write_bytes(b"glTF\x02\x00\x00\x00\xff\xfe")
    assert said(lambda path: read_plan(str(path)), here / "house.glb") == (
        "house.glb: this is a model, not a suite; inspect it with `vobench scene house.glb`"
    )


def test_a_suite_where_a_scene_belongs(here: Path) -> None:
    assert said(read_scene, here / "my/mine.yaml") == (
        "my/mine.yaml: this is a suite, not a scene; run it with `vobench run my/mine.yaml`"
    )


def test_a_suite_where_a_scenario_or_a_manifest_belongs(here: Path) -> None:
    assert said(read_scenario, here / "my/mine.yaml").startswith("my/mine.yaml: this is a suite, not a scenario;")
    (here / "my/vo/estimator.yaml").write_text(SUITE)
    assert "this is a suite, not an estimator's manifest;" in said(read_manifest, here / "my/vo")


def test_a_scene_that_a_suite_names_as_such_is_said_with_the_place_in_the_suite(here: Path) -> None:
    wrong = here / "my/other.yaml"
    wrong.write_text(SUITE.replace("[room]", "[mine.yaml]"))
    assert "scenes.0: my/mine.yaml: this is a suite, not a scene" in said(lambda path: read_plan(str(path)), wrong)


@pytest.mark.parametrize("text", [SUITE.replace("estimators", "estimatorz"), SUITE + "room: {}\n", "name: mine\n"])
def test_a_suite_with_a_wrong_key_is_still_a_suite(here: Path, text: str) -> None:
    wrong = here / "my/wrong.yaml"
    wrong.write_text(text)
    assert "this is a" not in said(lambda path: read_plan(str(path)), wrong)


@pytest.mark.parametrize("name", ["my", "my/", "./my"])
def test_a_folder_where_a_suite_belongs_says_what_is_in_it(here: Path, name: str) -> None:
    with pytest.raises(UnknownNameError) as refused:
        catalog.find("suite", name)
    assert str(refused.value) == (
        "my is a folder, and a suite is a YAML file with scenes and estimators; it contains my/mine.yaml"
    )


def test_a_folder_without_any_says_so(here: Path) -> None:
    (here / "empty").mkdir()
    with pytest.raises(UnknownNameError, match=r"^empty is a folder, and a suite is .*; it contains no suite$"):
        catalog.find("suite", "empty")


def test_a_folder_where_a_scene_belongs_says_what_is_in_it(here: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"^my is a folder, and a scene is .*; it contains my/lab.yaml$"):
        catalog.find("scene", "my")


def test_a_name_comes_before_a_folder_that_is_called_so(here: Path) -> None:
    (here / "quickstart").mkdir()
    assert catalog.find("suite", "quickstart").origin == "built in"


def test_a_folder_that_is_an_estimator_or_a_scene_is_one_by_its_path_alone(here: Path, monkeypatch) -> None:
    monkeypatch.chdir(here / "my")
    with pytest.raises(UnknownNameError, match=r"^no estimator named 'vo'; to use the folder, write \./vo$"):
        catalog.find("estimator", "vo")
    assert catalog.find("estimator", "./vo").path == here / "my/vo"
    (here / "my/barn").mkdir()
    (here / "my/barn/scene.yaml").write_text(SCENE)
    with pytest.raises(UnknownNameError, match=r"^no scene named 'barn'; to use the folder, write \./barn$"):
        catalog.find("scene", "barn")
    assert catalog.find("scene", "./barn").path == here / "my/barn/scene.yaml"
