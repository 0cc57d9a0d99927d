"""A path is placed in different places, and refused with the reason of each if it fits nowhere."""

import json
import re

import numpy as np
import pytest

from vobench.analysis import twin_places
from vobench.analysis.path_placement import Placement, WantedDisparities
from vobench.analysis.twin_places import PlacedPath, find_places
from vobench.errors import InputError, UnknownNameError

WANTED = WantedDisparities.of_cells(np.ones((1, 3, 3)))
PATH = np.eye(4)[None]


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch):
    """Lets the path fit where the test says, and lists the places that were tried."""

    def fits_in(*fitting: str) -> list[str]:
        names: list[str] = []

        def place_path(scene, *_):
            names.append(scene)
            if scene not in fitting:
                raise InputError("it is too small")
            return [Placement(np.eye(4), 1.1, 0.2, 1.0, 5)]

        monkeypatch.setattr(twin_places, "place_path", place_path)
        monkeypatch.setattr(twin_places, "build", lambda spec, _: spec.place_name)
        return names

    return fits_in


def found(place: str, most: int) -> list[str]:
    return [each.title for each in find_places(place, PATH, None, WANTED, most=most)]


def test_the_named_place_comes_first_and_then_those_of_its_generator(tried) -> None:
    names = tried("street", "street.2.day", "street.3.day")
    assert found("street", 3) == ["street", "street 2", "street 3"]
    assert names == ["street", "street.1.day", "street.2.day", "street.3.day"]
    names = tried("street", "street.1.day")
    assert found("street", 1) == ["street"]
    assert names == ["street"]


def test_other_generators_are_tried_only_if_nothing_has_fitted(tried) -> None:
    names = tried("street.2.day", "park.1.day")
    assert found("street", 3) == ["street 2"]
    assert not any(name.startswith("park") for name in names)
    names = tried("park.1.day", "park.2.day")
    assert found("corridor", 3) == ["park 1", "park 2"]
    assert names[0] == "corridor"


def test_a_path_that_fits_nowhere_is_refused_with_all_reasons(tried) -> None:
    names = tried()
    with pytest.raises(InputError) as refused:
        found("corridor", 3)
    assert str(refused.value).startswith("the path fits in no place at its own scale: corridor: it is too small; ")
    assert len(re.findall("it is too small", str(refused.value))) == len(names) == 13


def test_an_unknown_place_is_an_error(tried) -> None:
    tried()
    with pytest.raises(UnknownNameError):
        found("nowhere", 1)


def test_a_placed_path_is_read_as_it_was_written_and_its_scene_has_its_scale() -> None:
    placed = PlacedPath("street", 3, Placement(np.eye(4), 1.1, 0.2, 1.0, 5))
    read = PlacedPath.of_dict(json.loads(json.dumps(placed.as_dict())))
    assert read.as_dict() == placed.as_dict()
    spec = read.scene()
    assert (spec.place_name, spec.scale) == ("street.3.day", pytest.approx(1.1))
    assert PlacedPath("office", None, placed.placement).title == "office"
