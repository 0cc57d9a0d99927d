"""Light that enters follows the cosine and Fresnel's law, blurs keep sums, and segments meet boxes as geometry says."""

import numpy as np
import pytest

from vobench.rendering.shadow_kernels import (
    aim_at_triangles,
    along_curve_of,
    blur_along,
    dilate,
    entering_light,
    lit_rays,
    meet_boxes,
    places_in_cell,
)
from vobench.scene.material import fresnel

RNG = np.random.default_rng(0)
UP = np.array([[0, 0, 1]], np.float32)


def entering(vector: tuple[float, float, float], eta: float = 0.0) -> float:
    light = np.empty(1, np.float32)
    vectors_m = np.array([vector], np.float32)
    entering_light(vectors_m, np.ones(1, np.float32), UP, UP, np.full(1, eta, np.float32), light)
    return float(light[0])


def test_light_enters_by_the_cosine_and_fresnels_law_and_not_from_behind() -> None:
    assert entering((0, 3, 4)) == pytest.approx(0.8)
    assert entering((0, 3, 4), 1.5) == pytest.approx(0.8 * (1 - float(fresnel(np.array(0.8), 1.5))))
    assert entering((0, 3, -4)) == 0


def test_every_cell_of_the_unit_square_has_one_place() -> None:
    dither = RNG.random((20, 2), dtype=np.float32)
    side = 3
    seen = np.zeros((20, side, side), int)
    for cell in range(side**2):
        a = np.empty(20, np.float32)
        b = np.empty(20, np.float32)
        places_in_cell(dither, cell, side, a, b)
        np.add.at(seen, (np.arange(20), (a * side).astype(int), (b * side).astype(int)), 1)
    assert (seen == 1).all()


def test_rays_are_those_of_lit_points() -> None:
    light = np.array([0, 2, 0, 1], np.float32)
    points_m = RNG.random((4, 3)).astype(np.float32)
    rows = np.empty(4, np.int32)
    origins_m = np.empty((4, 3), np.float32)
    segments_m = np.empty((4, 3), np.float32)
    assert lit_rays(points_m, 2 * points_m, light, rows, origins_m, segments_m) == 2
    assert rows[:2].tolist() == [1, 3]
    np.testing.assert_array_equal(origins_m[:2], points_m[[1, 3]])
    np.testing.assert_array_equal(segments_m[:2], 2 * points_m[[1, 3]])


def test_on_a_ring_a_blur_keeps_the_sum_and_a_mark_reaches_the_points_beside_it() -> None:
    nth = np.arange(12, dtype=np.int32)
    before = np.roll(nth, 1)
    after = np.roll(nth, -1)
    values = RNG.random(12).astype(np.float32)
    blurred = np.empty(12, np.float32)
    blur_along(values, before, after, blurred)
    assert blurred.sum() == pytest.approx(values.sum(), rel=1e-5)
    assert blurred.std() < values.std()
    marked = nth == 5
    result = np.empty(12, bool)
    dilate(marked, np.stack([before, after, nth, nth]), result)
    assert np.flatnonzero(result).tolist() == [4, 5, 6]


@pytest.mark.parametrize(
    ("origin_m", "segment_m", "is_met"),
    [
        ((-1, 0.5, 0.5), (1.5, 0, 0), True),  # ends inside
        ((-1, 0.5, 0.5), (0.5, 0, 0), False),  # ends before
        ((-1, 0.5, 0.5), (-9, 0, 0), False),  # leads away
        ((0.5, 0.5, 0.5), (0.1, 0, 0), True),  # starts inside
        ((-1, 2, 0.5), (3, 0, 0), False),  # passes beside, parallel to a side
        ((-0.5, 0.5, 0.5), (2, 4, 0), False),  # passes a corner outside
        ((-0.2, 0.5, 0.5), (1, 1, 0), True),
    ],
)
def test_segments_meet_a_box_as_geometry_says(
    origin_m: tuple[float, ...], segment_m: tuple[float, ...], is_met: bool
) -> None:
    boxes_m = np.array([[[8, 8, 8], [9, 9, 9]], [[0, 0, 0], [1, 1, 1]]], np.float32)
    result = np.empty(1, bool)
    around_m = np.stack([boxes_m[:, 0].min(0), boxes_m[:, 1].max(0)])
    meet_boxes(np.array([origin_m], np.float32), np.array([segment_m], np.float32), around_m, boxes_m, result)
    assert result[0] == is_met


def test_a_place_along_the_curve_has_the_bits_of_both_numbers_by_turns() -> None:
    assert along_curve_of(0.0, 0.0) == 0
    assert along_curve_of(0.5, 0.0) == 0.5
    assert along_curve_of(0.0, 0.5) == 0.25
    assert along_curve_of(0.25, 0.75) == 0.25 + 0.125 + 0.0625


def test_rays_to_triangles_end_on_them_in_proportion_to_their_areas_with_lamberts_strength() -> None:
    rng = np.random.default_rng(0)
    count = 4000
    corners_m = np.array([[[0, 0, 2.0], [0, 1, 2], [1, 0, 2]], [[3, 0, 2.0], [3, 2, 2], [6, 0, 2]]])  # 0.5 and 3 m²
    normals = np.array([[0, 0, -1.0], [0, 0, -1.0]])
    points_m = rng.uniform(-1, 1, (count, 3)).astype(np.float32)
    a, b = rng.random((2, count), dtype=np.float32)
    vectors_m = np.empty((count, 3), np.float32)
    strength = np.empty(count, np.float32)
    aim_at_triangles(points_m, corners_m, normals, np.array([0.5, 3.5]), 100.0, a, b, vectors_m, strength)

    x, y, z = (points_m + vectors_m).T
    np.testing.assert_allclose(z, 2, atol=1e-5)
    is_first = x < 2
    assert (y >= -1e-5).all()
    assert (x + y)[is_first].max() <= 1 + 1e-5
    assert ((x - 3) / 3 + y / 2)[~is_first].max() <= 1 + 1e-5
    assert is_first.mean() == pytest.approx(0.5 / 3.5, abs=0.02)
    distance_m = np.linalg.norm(vectors_m, axis=1)
    expected = 100.0 * 3.5 * (vectors_m[:, 2] / distance_m) / distance_m**2
    np.testing.assert_allclose(strength, expected, rtol=1e-4)
