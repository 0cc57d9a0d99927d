"""A city has streets around the scene's block, and no building in them."""

from itertools import pairwise

import numpy as np

from tests.asset.canvases import NEAREST_M, canvas
from vobench.asset.panorama_city import (
    NARROWEST_M,
    STREET_M,
    _block_spans,
    _blocks,
    _row_of_buildings,
    _street_albedo,
    _street_items,
)
from vobench.asset.panorama_ground import ground_places


def test_blocks_are_a_street_apart_and_the_scene_is_in_the_middle_one() -> None:
    spans = _block_spans(NEAREST_M)
    for left, right in pairwise(spans):
        gap_m = right.middle_m - right.half_m - (left.middle_m + left.half_m)
        assert abs(gap_m - STREET_M) < 1e-9
    assert spans[2].middle_m == 0


def test_no_building_is_nearer_than_the_fronts_across_the_street() -> None:
    for building in _blocks(canvas()):
        assert np.abs(building.corners_m()).max(axis=1).min() > NEAREST_M - 1e-6


def test_buildings_of_a_row_fill_it_without_gaps_or_narrow_ones() -> None:
    row = _row_of_buildings(canvas(), np.array([0.0, 100.0]), np.array([1.0, 0.0]), 76.0, 18.0)
    middles_m = np.array([building.middle_m[0] for building in row])
    halves_m = np.array([building.half_m[0] for building in row])
    starts_m = middles_m - halves_m
    ends_m = middles_m + halves_m
    np.testing.assert_allclose(starts_m, [0.0, *ends_m[:-1]], atol=1e-9)
    assert abs(ends_m[-1] - 76.0) < 1e-9
    assert (2 * halves_m).min() >= NARROWEST_M


def test_streets_are_darker_than_pavements_but_for_the_dashes() -> None:
    empty = canvas()
    x_m, y_m, _ = ground_places(empty)
    across_m = np.maximum(np.abs(x_m), np.abs(y_m))
    albedo = _street_albedo(empty).mean(axis=-1)
    assert np.median(albedo[np.abs(across_m - 20) < 1]) < 0.5 * np.median(albedo[across_m > NEAREST_M])


def test_cars_and_trees_stand_in_the_street_around_the_block() -> None:
    items = _street_items(canvas())
    assert {item.kind for item in items} == {"car", "tree"}
    for item in items:
        across_m = np.abs(item.place_m).max()
        assert across_m > NEAREST_M - STREET_M
