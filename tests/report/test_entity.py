"""Entities of estimators have paths of their own, and ground truth of pixels stays out of the 3-D view."""

from dataclasses import FrozenInstanceError

import pytest

from vobench.report.entity import ERROR, TRACKS, WORLD, EstimatorEntities, truth_entity

NAMES = [name for name, value in vars(EstimatorEntities).items() if isinstance(value, property)]


def test_no_two_entities_share_a_path():
    paths = [getattr(EstimatorEntities(label), name) for label in ("one", "two") for name in NAMES]
    assert len(set(paths)) == 2 * len(NAMES)
    with pytest.raises(FrozenInstanceError):
        EstimatorEntities("one").label = "two"


def test_what_is_seen_in_space_is_below_the_world():
    entities = EstimatorEntities("one")
    assert entities.path == f"{WORLD}/one/path"
    assert entities.error_line.startswith(f"{ERROR}/")
    assert entities.tails.startswith(f"{entities.tracks}/")
    assert entities.tracks.startswith(f"{TRACKS}/")
    assert not truth_entity("left", "depth").startswith(WORLD)
