"""Entries of a suite's scenes: the places that they stand for, and what each of them is called."""

import pytest

from tests.generated import write_cell
from vobench.errors import SettingError, SuiteError
from vobench.suite.scene_entry import SceneEntry, described_scene, drawn_lighting, generated_scene, places
from vobench.suite.scene_file import read_place, read_scene
from vobench.suite.scene_spec import LIGHTINGS


@pytest.fixture
def cell(tmp_path):
    return read_scene(write_cell(tmp_path / "cell"))


def test_seeds_are_counted_from_one_and_shifted_by_the_base_seed():
    assert list(SceneEntry(name="cell", seeds=3).place_seeds()) == [1, 2, 3]
    assert list(SceneEntry(name="cell", seeds=3).place_seeds(base_seed=500)) == [501, 502, 503]


def test_a_seed_that_is_named_is_not_shifted():
    assert list(SceneEntry(name="cell", seed=7).place_seeds(base_seed=500)) == [7]


def test_an_entry_without_a_seed_is_the_scene_that_the_file_describes():
    entry = SceneEntry(name="room")
    assert not entry.has_seeds
    assert list(entry.place_seeds(base_seed=5)) == []


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"seed": 1, "seeds": 2}, "seeds: is the number of places, and seed names one"),
        ({"lighting": "night"}, "lighting: is for the places of a generator"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(settings, sentence):
    with pytest.raises(SettingError) as raised:
        SceneEntry(name="cell", **settings)
    assert str(raised.value).startswith(sentence)


def test_places_are_named_by_scene_and_seed_and_by_a_lighting_that_is_not_drawn(cell):
    drawn = list(places(SceneEntry(name="cell", seeds=2), "cell", cell))
    nightly = list(places(SceneEntry(name="cell", seed=2, lighting="night"), "cell", cell))
    assert [place.name for place in drawn] == ["cell.1", "cell.2"]
    assert [place.scene.generated.seed for place in drawn] == [1, 2]
    assert [place.scene.generated.lighting for place in drawn] == [drawn_lighting(1), drawn_lighting(2)]
    assert [place.name for place in nightly] == ["cell.2.night"]
    assert nightly[0].scene.generated.lighting == "night"


def test_a_drawn_lighting_is_one_of_the_four_and_the_same_for_the_same_seed():
    assert {drawn_lighting(seed) for seed in range(200)} == set(LIGHTINGS)
    assert [drawn_lighting(seed) for seed in range(40)] == [drawn_lighting(seed) for seed in range(40)]


def test_the_order_of_lightings_differs_from_four_seeds_to_the_next():
    orders = {tuple(drawn_lighting(4 * block + position) for position in (1, 2, 3, 4)) for block in range(40)}
    assert len(orders) > 10


def test_a_place_keeps_name_summary_and_scale_of_its_file_alone(tmp_path):
    path = write_cell(tmp_path / "cell")
    path.write_text(f"{path.read_text()}scale: 2\nwhite_cd_m2: 70\nsky: {{illuminance_lx: 100}}\n", encoding="utf-8")
    place = generated_scene(read_scene(path), 3)
    assert (place.name, place.summary, place.scale) == ("cell", "A cell of a generator", 2)
    assert (place.white_cd_m2, place.sky) == (None, None)


def test_a_file_that_only_names_its_generator_needs_a_seed(cell):
    with pytest.raises(SuiteError, match=r"'cell' has only a generator; give it a seed, as in \{name: cell, seed: 1\}"):
        described_scene(cell)
    assert list(places(SceneEntry(name="cell", seed=1), "cell", cell))


def test_a_scene_without_a_generator_has_no_seeds():
    with pytest.raises(SuiteError, match="'room' has no generator, so it has no seeds"):
        generated_scene(read_place("room"), 1)
