"""The one search order, and what is said of a name that nothing has."""

import importlib.metadata
import re
from types import SimpleNamespace

import pytest

from vobench.errors import UnknownNameError
from vobench.suite import catalog

OURS = "car_park, corridor, flat, hall, office, park, ramp, room, street, warehouse"


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working directory, and nothing on $VOBENCH_PATH."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.delenv("VOBENCH_PATH", raising=False)
    return folder


def put(root, kind, name):
    among = "suites/scenarios" if kind == "scenario" else f"{kind}s"
    path = root / among / (f"{name}/estimator.yaml" if kind == "estimator" else f"{name}.yaml")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"name: {name}\n")
    return path.parent if kind == "estimator" else path


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A distribution that brings the scene `room` along."""
    package = tmp_path / "site" / "lent_scenes"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "room.yaml").write_text("name: room\n")
    monkeypatch.syspath_prepend(str(package.parent))
    point = SimpleNamespace(name="room", value="lent_scenes", dist=SimpleNamespace(name="lent-scenes"))
    points = lambda *, group: [point] if group == "vobench.scenes" else []  # noqa: E731
    monkeypatch.setattr(importlib.metadata, "entry_points", points)
    monkeypatch.setattr(catalog, "entry_points", points)
    return package / "room.yaml"


def test_the_first_stop_of_the_search_order_wins_and_the_rest_are_still_listed(here, tmp_path, monkeypatch, installed):
    first, second = tmp_path / "first", tmp_path / "second"
    monkeypatch.setenv("VOBENCH_PATH", f"{first}:{second}")
    expected = [put(root, "scene", "room") for root in (here, first, second)]
    expected += [installed, catalog.builtin_root() / "scenes" / "room" / "scene.yaml"]
    found = [entry for entry in catalog.entries("scene") if entry.name == "room"]
    assert [entry.path for entry in found] == expected
    assert [entry.origin for entry in found] == [
        "./scenes", "$VOBENCH_PATH", "$VOBENCH_PATH", "installed: lent-scenes", "built in",
    ]  # fmt: skip
    assert catalog.find("scene", "room") == found[0]


@pytest.mark.parametrize("kind", catalog.KINDS)
def test_every_kind_is_found_in_the_working_directory(here, kind):
    path = put(here, kind, "mine")
    assert catalog.find(kind, "mine").path == path


@pytest.fixture
def suite(tmp_path):
    """The file of a suite in a folder where nobody stands."""
    path = tmp_path / "some" / "where" / "my.yaml"
    path.parent.mkdir(parents=True)
    path.write_text("name: my\nestimators: [mine]\n")
    return path


@pytest.mark.parametrize("kind", ["scene", "estimator"])
def test_beside_the_suite_comes_before_all_else_and_its_folder_of_the_kind_first(here, monkeypatch, suite, kind):
    monkeypatch.setenv("VOBENCH_PATH", str(here))
    elsewhere = put(here, kind, "mine")
    assert catalog.find(kind, "mine", suite=suite).path == elsewhere
    within = put(suite.parent, kind, "mine")
    flat = suite.parent / within.name
    if kind == "scene":
        flat.write_text("name: mine\n")
    else:
        flat.mkdir()
        (flat / "estimator.yaml").write_text("name: mine\n")
    found = catalog.find(kind, "mine", suite=suite)
    assert (found.path, found.origin) == (within, "beside the suite")
    within.rename(within.with_name("other"))
    assert catalog.find(kind, "mine", suite=suite).path == flat
    assert catalog.find(kind, "mine").path == elsewhere


def test_a_suite_may_be_called_as_its_scene_is(here, suite):
    namesake = suite.with_name("office.yaml")
    namesake.write_text("name: office\nscenes: [office]\nestimators: [stand_still]\n")
    for asking in (suite, namesake):
        assert catalog.find("scene", "office", suite=asking).origin == "built in"


def test_what_lies_beside_a_suite_is_among_the_known(here, suite):
    put(suite.parent, "scene", "barn")
    with pytest.raises(
        UnknownNameError,
        match=rf"Did you mean 'barn'\? Known: barn, {OURS}",
    ):
        catalog.find("scene", "barne", suite=suite)


@pytest.mark.parametrize("kind", catalog.KINDS)
@pytest.mark.parametrize("name", ["h*ll", "*", "", ".", ".."])
def test_a_name_is_no_pattern_and_no_other_folder(here, kind, name):
    put(here, kind, "hall")
    (here / "estimator.yaml").touch()
    with pytest.raises(UnknownNameError, match=f"no {kind} named '{re.escape(name)}'"):
        catalog.find(kind, name)


def test_a_folder_that_two_stops_share_is_listed_once(here, monkeypatch):
    put(here, "scene", "barn")
    monkeypatch.setenv("VOBENCH_PATH", str(here))
    assert [entry.origin for entry in catalog.entries("scene") if entry.name == "barn"] == ["./scenes"]


@pytest.mark.parametrize("kind", catalog.KINDS)
def test_names_come_sorted_and_those_of_the_house_are_there(here, kind):
    names = [entry.name for entry in catalog.entries(kind)]
    assert names
    assert names == sorted(names)


@pytest.mark.parametrize("written", ["./plug", "plug/", "../here/plug", "plug/estimator.yaml", "./plug/../plug"])
def test_whatever_has_a_slash_is_a_path(here, written):
    put(here, "estimator", "plug")
    (here / "estimators" / "plug").rename(here / "plug")
    entry = catalog.find("estimator", written)
    assert (entry.name, entry.path, entry.origin) == ("plug", here / "plug", "path")


def test_a_file_is_taken_by_its_ending(here):
    (here / "mine.yml").touch()
    assert catalog.find("suite", "mine.yml").path == here / "mine.yml"


def test_a_name_beats_nothing_that_merely_lies_in_the_working_directory(here):
    (here / "room").mkdir()
    assert catalog.find("scene", "room").origin == "built in"


def test_an_unknown_name_gets_the_nearest_and_all_there_are(here):
    with pytest.raises(UnknownNameError) as refused:
        catalog.find("suite", "quikstart")
    known = "daily, full, hand, paper, quickstart, regression, sensors, street, worlds"
    assert str(refused.value) == f"no suite named 'quikstart'. Did you mean 'quickstart'? Known: {known}"


def test_a_name_far_from_all_gets_no_guess(here):
    with pytest.raises(
        UnknownNameError,
        match=rf"^no scene named 'zzzz'\. Known: {OURS}$",
    ):
        catalog.find("scene", "zzzz")


def test_a_path_to_nothing_says_which_file_was_wanted(here):
    with pytest.raises(UnknownNameError, match=r"^no estimator file at plug/estimator\.yaml\. Known by name: "):
        catalog.find("estimator", "./plug")


@pytest.mark.parametrize("kind", ["scene", "estimator", "suite"])
@pytest.mark.parametrize(
    ("name", "file", "kind_inside"),
    [("vo", "estimator.yaml", "estimator"), ("barn", "scene.yaml", "scene"), ("empty", "notes.txt", None)],
)
def test_a_folder_is_offered_as_a_path_only_for_the_kind_that_it_holds(here, kind, name, file, kind_inside):
    (here / name).mkdir()
    (here / name / file).touch()
    with pytest.raises(UnknownNameError) as refused:
        catalog.find(kind, name)
    assert ("write ./" in str(refused.value)) is (kind == kind_inside)


@pytest.mark.parametrize(
    ("origin", "name", "is_said"),
    [("./estimators", "stand_still", True), ("path", "stand_still", False), ("./estimators", "mine", False)],
)
def test_an_estimator_that_hides_a_built_in_one_is_said(tmp_path, origin, name, is_said):
    sentences = catalog.hidden_builtins([catalog.CatalogEntry("estimator", name, tmp_path / name, origin)])
    said = f"{name} is {tmp_path / name}, not the estimator included with vobench"
    assert sentences == ([said] if is_said else [])


def test_a_built_in_estimator_hides_none():
    assert catalog.hidden_builtins([catalog.find("estimator", "lk_epipolar")]) == []
