"""Places on the light map: texels by row and column, and what interpolation reads between them."""

import numpy as np
import pytest

from vobench.rendering.atlas import Atlas, doubled_areas_px2

PLACES = np.array([[[1.0, 1.0], [6.0, 1.0], [1.0, 4.0]]], np.float32)
ATLAS = Atlas(PLACES, np.zeros(1, np.int32), height=6, width=8)
WEIGHTS = np.random.default_rng(0).dirichlet(np.ones(3), 200)[:, 1:]
FACE = np.zeros(200, np.int32)


def at(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    a, b, c = PLACES[0].astype(float)
    return a + u[:, None] * (b - a) + v[:, None] * (c - a)


def test_a_map_that_is_linear_in_place_reads_linear() -> None:
    row, column = np.indices((6, 8)) + 0.5
    u, v = WEIGHTS.T
    x, y = at(u, v).T
    np.testing.assert_allclose(ATLAS.read(2 * column - 3 * row, FACE, u, v), 2 * x - 3 * y, atol=1e-6)


def test_channels_are_read_as_if_each_were_a_map() -> None:
    light = np.random.default_rng(1).random((6, 8, 3))
    u, v = WEIGHTS.T
    channels = [ATLAS.read(light[..., channel], FACE, u, v) for channel in range(3)]
    np.testing.assert_allclose(ATLAS.read(light, FACE, u, v), np.stack(channels, -1), rtol=1e-12)


def test_texels_are_counted_row_by_row_and_places_outside_are_at_the_rim() -> None:
    places = np.array([[0.5, 0.5], [7.9, 0.0], [0.0, 1.0], [-3.0, 2.5], [9.0, 9.0]])
    assert ATLAS.index(places).tolist() == [0, 7, 8, 16, 47]


def test_coordinates_are_shares_of_the_maps_width_and_height() -> None:
    assert ATLAS.light_uv.dtype == np.float32
    np.testing.assert_allclose(ATLAS.light_uv * [8, 6], PLACES, rtol=1e-6)


def test_the_area_of_a_triangle_changes_its_sign_with_its_sense() -> None:
    assert doubled_areas_px2(PLACES.astype(float))[0] == pytest.approx(15.0)
    assert doubled_areas_px2(PLACES[:, ::-1].astype(float))[0] == pytest.approx(-15.0)


def test_a_lamps_block_is_the_nine_texels_around_its_place() -> None:
    atlas = Atlas(np.full((1, 3, 2), 4.5, np.float32), np.full(1, -1, np.int32), 6, 8)
    covered = np.zeros((6, 8), bool)
    covered[atlas.block(0)] = True
    assert np.argwhere(covered).tolist() == [[r, c] for r in (3, 4, 5) for c in (3, 4, 5)]
