"""Conifers: boughs above the height of a body, and pictures of boughs with holes."""

import numpy as np

from vobench.asset import conifer


def test_a_picture_of_a_bough_is_partly_transparent() -> None:
    alpha = np.asarray(conifer.needles(0, px=128).pixels())[..., 3]
    assert 0.1 < (alpha > 0).mean() < 0.9


def test_a_conifer_has_its_height_and_leaves_room_for_a_body() -> None:
    for seed in range(6):
        trunk, boughs = conifer.conifer(np.random.default_rng(seed), height_m=8.0)
        top_m = max(part.arrays.vertices_m[:, 2].max() for part in (trunk, boughs))
        assert 7.5 < top_m < 8.6
        assert boughs.arrays.vertices_m[:, 2].min() > 2.0
        assert np.hypot(*trunk.arrays.vertices_m[:, :2].T).max() < 0.2


def test_a_wider_spread_makes_longer_boughs() -> None:
    radii_m = []
    for spread in (0.15, 0.3):
        _, boughs = conifer.conifer(np.random.default_rng(0), height_m=8.0, spread=spread)
        radii_m.append(np.hypot(*boughs.arrays.vertices_m[:, :2].T).max())
    assert radii_m[1] > 1.5 * radii_m[0]
