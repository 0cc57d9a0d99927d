"""Rays are spread by their cosine, few faint rays stand for all of them, and entries are sorted by point."""

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.rendering.ray_kernels import (
    FAINT,
    ROULETTE,
    chosen_rays,
    cosine_rays,
    facet_normals,
    sorted_by_point,
)

RNG = np.random.default_rng(0)


def rays(normal: Array, eta: float = 0.0, side: int = 32) -> tuple[Array, Array]:
    count = side * side
    origins_m = np.empty((count, 3), np.float32)
    directions = np.empty((count, 3), np.float32)
    weight = np.empty(count, np.float32)
    normals = normal[None].astype(np.float32)
    point = np.zeros((1, 3), np.float32)
    dither = np.full((1, 2), 0.3, np.float32)
    etas = np.full(1, eta, np.float32)
    cosine_rays(point, normals, normals, etas, dither, side, origins_m, directions, weight)
    return directions, weight


@pytest.mark.parametrize("normal", [np.array([0.0, 0.0, -1.0]), np.array([0.6, -0.64, 0.48])])
def test_rays_are_unit_vectors_spread_evenly_by_their_cosine(normal: Array) -> None:
    directions, weight = rays(normal)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-5)
    cosine = directions @ normal
    assert cosine.min() >= 0
    assert (weight == 1).all()
    assert cosine.mean() == pytest.approx(2 / 3, abs=2e-3)
    np.testing.assert_allclose(directions.mean(0), 2 / 3 * normal, atol=5e-3)


def test_weights_under_a_coat_average_to_the_share_that_enters() -> None:
    eta = 1.5
    _, weight = rays(np.array([0.0, 0.0, 1.0]), eta)
    # Diffuse light from outside: 1 - F, averaged with the cosine, is 0.908 for 1.5 (Duntley, 1942).
    assert weight.mean() == pytest.approx(0.908, abs=2e-3)


def test_facets_of_a_smooth_face_are_its_normal_and_those_of_a_rough_one_spread_with_roughness() -> None:
    spread = []
    for roughness in (0.0, 0.05, 0.2):
        normals = np.tile(np.array([0, 0, 1], np.float32), (4000, 1))
        dither = RNG.random((4000, 2), dtype=np.float32)
        facet_normals(normals, np.full(4000, roughness, np.float32), dither)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
        slope = np.hypot(normals[:, 0], normals[:, 1]) / normals[:, 2]
        spread.append(np.median(slope))
    # The median slope of GGX is its roughness.
    np.testing.assert_allclose(spread, [0, 0.05, 0.2], rtol=0.06, atol=1e-7)


def test_selected_entries_are_sorted_by_point_and_none_is_lost() -> None:
    point = RNG.integers(0, 7, 50).astype(np.int32)
    column = RNG.integers(0, 9, 50).astype(np.int32)
    share = RNG.random(50).astype(np.float32)
    selected = RNG.random(50) < 0.6
    starts = np.empty(8, np.int32)
    columns = np.empty(selected.sum(), np.int32)
    shares = np.empty(selected.sum(), np.float32)
    sorted_by_point(point, column, share, selected, starts, columns, shares)
    for row in range(7):
        expected = selected & (point == row)
        part = slice(starts[row], starts[row + 1])
        assert columns[part].tolist() == column[expected].tolist()
        assert shares[part].tolist() == share[expected].tolist()


@pytest.mark.parametrize("share", [0.04, 0.3, 0.9])
def test_few_of_the_faint_rays_stand_for_all_of_them(share: float) -> None:
    count = 36 * 200
    point = np.repeat(np.arange(200, dtype=np.int32), 36)
    weight = np.full(count, share * ROULETTE, np.float32)
    dither = RNG.random((200, 2), dtype=np.float32)
    selected = np.empty(count, np.int64)
    selected = selected[: chosen_rays(weight, point, dither, selected)]
    assert len(selected) == pytest.approx(share * count, rel=0.03)
    np.testing.assert_array_equal(weight[selected], ROULETTE)
    of_points = np.bincount(point[selected], minlength=200)
    assert np.abs(of_points - share * 36).max() < 4


def test_strong_rays_all_go_on_as_they_are_and_the_faintest_end() -> None:
    weight = np.array([0.5, FAINT / 2, ROULETTE], np.float32)
    selected = np.empty(3, np.int64)
    count = chosen_rays(weight, np.zeros(3, np.int32), np.zeros((1, 2), np.float32), selected)
    assert selected[:count].tolist() == [0, 2]
    assert weight[[0, 2]].tolist() == [0.5, ROULETTE]
