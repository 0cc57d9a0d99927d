"""Scenery is painted from far to near, and placed by seed."""

import numpy as np

from tests.asset.canvases import canvas
from vobench.asset.panorama_scenery import BUSH_SPACING_M, HOUSE_WALLS, Scenery, one_albedo, random_place


def test_things_are_painted_from_far_to_near() -> None:
    scenery = Scenery(canvas())
    painted: list[float] = []
    for distance_m in (20.0, 90.0, 50.0):
        scenery._painters.append((distance_m, lambda distance_m=distance_m: painted.append(distance_m)))
    scenery.paint()
    assert painted == [90.0, 50.0, 20.0]


def test_a_hedge_has_bushes_at_equal_distances() -> None:
    scenery = Scenery(canvas())
    scenery.add_hedge(np.array([30.0, 0.0]), np.array([0.0, 1.0]), 5 * BUSH_SPACING_M - 0.1)
    distances_m = [distance_m for distance_m, _ in scenery._painters]
    np.testing.assert_allclose(distances_m, np.hypot(30, BUSH_SPACING_M * np.arange(5)))


def test_a_house_changes_what_is_seen_in_its_direction_alone() -> None:
    painted = canvas()
    scenery = Scenery(painted)
    before = painted.colour.copy()
    scenery.add_house(np.array([40.0, 0.0]), 0.0)
    scenery.paint()
    columns = np.flatnonzero((painted.colour != before).any(axis=(0, 2)))
    assert len(columns) > 0
    assert np.abs(painted.azimuth[columns]).max() < 0.25


def test_random_places_are_within_their_distances_and_repeat_by_seed() -> None:
    places_m = [random_place(np.random.default_rng(seed), 20, 60) for seed in range(30)]
    distances_m = np.linalg.norm(places_m, axis=1)
    assert distances_m.min() >= 20
    assert distances_m.max() <= 60
    np.testing.assert_array_equal(places_m[3], random_place(np.random.default_rng(3), 20, 60))


def test_albedos_are_between_black_and_white() -> None:
    albedo = one_albedo(np.random.default_rng(0), HOUSE_WALLS)
    assert all(0 < channel < 1 for channel in albedo)
