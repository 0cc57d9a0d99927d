"""Rays from points find the surroundings in the shares that geometry gives, and photons bring all their flux."""

import numpy as np
import pytest

from tests.rendering.gathered_room import gathered_room
from tests.rendering.rectangles import rectangle, room
from vobench.rendering.indirect_light import Photons, with_new_random_numbers
from vobench.scene.light import Sky

X, Y, Z = np.eye(3)
CLOSED = gathered_room(room((2, 2, 2), floor="grey", wall="grey", ceiling="grey"), spacing_m=0.1, step_m=0.5)


def test_in_a_closed_room_all_rays_of_a_point_end_at_surfels() -> None:
    gathered = CLOSED.gatherer.gather(CLOSED.middles, rays=64)
    np.testing.assert_allclose(gathered.table.sum(1), 1, rtol=1e-4)
    assert (gathered.escaped == 0).all()
    assert gathered.hits.sum() == 64 * len(CLOSED.middles)


def test_the_floor_sees_the_ceiling_by_the_view_factor_of_a_cube() -> None:
    sample = CLOSED.gatherer.sample(CLOSED.middles, side=16)
    table = (sample.near + sample.far).toarray()
    is_floor = CLOSED.thing_of_surfel == 0
    is_ceiling = CLOSED.thing_of_surfel == 1
    view_factor = table[np.ix_(is_floor, is_ceiling)].sum(1).mean()
    assert view_factor == pytest.approx(0.19982, abs=0.02)  # of opposite faces of a cube; surfels differ in area
    assert table[np.ix_(is_floor, is_floor)].max() == 0


def test_near_and_far_light_add_up_to_what_the_table_gives() -> None:
    radiosity = np.random.default_rng(0).random((len(CLOSED.groups), 2)).astype(np.float32)
    sample = CLOSED.gatherer.sample(CLOSED.middles, side=4, pass_index=3)
    near, far, _ = CLOSED.gatherer.light(CLOSED.middles, radiosity, side=4, pass_index=3)
    np.testing.assert_allclose(near, sample.near @ radiosity, rtol=1e-5)
    np.testing.assert_allclose(far, sample.far @ radiosity, rtol=1e-5)
    assert near.sum() > 0
    assert far.sum() > 0


def test_an_open_floor_sees_only_sky_and_a_mirror_shows_it_the_rest_of_it() -> None:
    floor = rectangle(0 * Z, X, Y, "grey", "floor")
    sky = Sky("sky", 1000.0, "uniform")
    alone = gathered_room([floor], spacing_m=0.1, step_m=0.5, skies=[sky])
    escaped = alone.gatherer.gather(alone.middles, rays=64)
    assert (escaped.escaped == 1).all()
    assert (escaped.sky == 0).all()  # straight light of the sky is direct light
    mirror = rectangle(2 * X + 20 * Z, 40 * Z, 200 * Y, "mirror", "mirror")
    beside = gathered_room([floor, mirror], spacing_m=0.1, step_m=0.5, skies=[sky])
    by_mirror = beside.gatherer.gather(beside.middles, rays=256)
    np.testing.assert_allclose(by_mirror.escaped, 0.5, atol=0.08)
    np.testing.assert_allclose(by_mirror.sky[0], 0.8 * (1 - by_mirror.escaped) * 1000, rtol=0.05)


def test_without_rays_everything_counts_as_open() -> None:
    sample = CLOSED.gatherer.sample(CLOSED.middles, side=0)
    assert (sample.escaped == 1).all()
    assert sample.near.nnz == sample.far.nnz == 0
    assert sample.near.shape == (len(CLOSED.middles), len(CLOSED.groups))


def photons(count: int, *, is_shown: bool) -> Photons:
    """Photons of 1 lm from the middle of a room towards all sides."""
    directions = np.random.default_rng(1).normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return Photons(
        origins_m=np.tile(Z, (count, 1)).astype(np.float32),
        directions=directions.astype(np.float32),
        flux_lm=np.ones(count, np.float32),
        is_shown=np.full(count, is_shown),
        dither=np.full((count, 2), 0.5, np.float32),
    )


def test_photons_bring_all_their_flux_unless_it_is_shown_already() -> None:
    flux_lm = CLOSED.gatherer.deposited(photons(500, is_shown=False))
    assert flux_lm.sum() == pytest.approx(500, rel=1e-5)
    by_side_lm = np.bincount(CLOSED.thing_of_surfel, flux_lm)
    np.testing.assert_allclose(by_side_lm, 500 / 6, rtol=0.3)
    assert CLOSED.gatherer.deposited(photons(500, is_shown=True)).sum() == 0


def test_each_pass_has_sample_offsets_of_its_own() -> None:
    first, second = (with_new_random_numbers(CLOSED.middles, index).dither for index in (0, 1))
    np.testing.assert_array_equal(first, CLOSED.middles.dither)
    assert (first != second).all()
    assert second.min() >= 0
    assert second.max() < 1
