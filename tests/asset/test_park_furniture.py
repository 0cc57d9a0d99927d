"""What is built in parks stands on the ground or has a foundation, and keeps to its size."""

import numpy as np
import pytest

from vobench.asset import park_furniture
from vobench.asset.furniture import Part
from vobench.geometry.se3 import Array


def vertices_m(parts: list[Part]) -> Array:
    return np.concatenate([part.arrays.vertices_m for part in parts])


def test_the_map_stands_on_its_posts_and_is_read_from_x() -> None:
    parts = park_furniture.map_board(41)
    points_m = vertices_m(parts)
    assert points_m[:, 2].min() == pytest.approx(0)
    assert points_m[:, 2].max() == pytest.approx(1.95)
    sheet = parts[2].arrays
    assert sheet.normals[:, 0].min() > 0.99


def test_every_kind_of_monument_is_drawn_and_has_a_foundation() -> None:
    heights_m = set()
    for seed in range(20):
        points_m = vertices_m(park_furniture.monument(np.random.default_rng(seed)))
        assert points_m[:, 2].min() == pytest.approx(-park_furniture.FOUNDATION_M)
        assert np.abs(points_m[:, :2]).max() < 1.5
        heights_m.add(round(float(points_m[:, 2].max()), 3))
    assert len(heights_m) == 20


def test_a_pavilion_has_rails_on_all_sides_but_one() -> None:
    radius_m = 2.0
    rails_m = park_furniture._rails(radius_m).vertices_m
    middles = [
        park_furniture._corner_m(radius_m, side) + park_furniture._corner_m(radius_m, side + 1) for side in range(6)
    ]
    shares = []
    for middle_m in middles:
        outward = middle_m / np.linalg.norm(middle_m)
        is_on_side = rails_m[:, :2] @ outward > 0.86 * radius_m
        shares.append(int(is_on_side.sum()))
    assert shares[0] < min(shares[1:])


def test_a_person_passes_below_the_roof_of_a_pavilion() -> None:
    _, roof, _, _ = park_furniture.pavilion(np.random.default_rng(0))
    assert roof.arrays.vertices_m[:, 2].min() == pytest.approx(park_furniture.EAVES_M)
    assert park_furniture.EAVES_M > 2.0
