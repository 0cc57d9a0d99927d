"""A lookup records what a suite's names refer to."""

import pytest

from vobench.errors import UnknownNameError
from vobench.suite.catalog import find
from vobench.suite.lookup import Lookup


def test_everything_that_was_found_is_recorded_in_order(tmp_path):
    lookup = Lookup(tmp_path / "suite.yaml")
    scene = lookup.find("scene", "room")
    estimator = lookup.find("estimator", "stand_still")
    assert (scene, estimator) == (find("scene", "room"), find("estimator", "stand_still"))
    assert lookup.entries == [scene, estimator]


def test_a_scene_that_several_scenarios_share_is_recorded_once(tmp_path):
    lookup = Lookup(tmp_path / "suite.yaml")
    for _ in range(2):
        lookup.find_for(tmp_path / "scenario.yaml", "room")
    assert [entry.name for entry in lookup.entries] == ["room"]


def test_a_name_is_looked_up_beside_the_suite_first(tmp_path):
    (tmp_path / "room.yaml").write_text("name: room\n")
    assert Lookup(tmp_path / "suite.yaml").find("scene", "room").path == tmp_path / "room.yaml"
    assert Lookup(tmp_path / "suite.yaml").find_for(tmp_path / "a.yaml", "room").path == tmp_path / "room.yaml"


def test_a_name_that_is_not_found_is_not_recorded(tmp_path):
    lookup = Lookup(tmp_path / "suite.yaml")
    with pytest.raises(UnknownNameError):
        lookup.find("scene", "no_such_scene")
    assert lookup.entries == []
