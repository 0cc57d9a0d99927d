"""Trees have a clear trunk on the ground, and small leaves in a crown of their height."""

import numpy as np
import pytest

from vobench.asset.branching_tree import CLEAR_M, branching_tree, spray, tub_plant


@pytest.mark.parametrize("height_m", [5.5, 8.0])
def test_a_tree_is_about_as_tall_as_asked_and_clear_below_its_crown(height_m: float) -> None:
    wood, leaves = branching_tree(np.random.default_rng(2), height_m=height_m)
    leaves_m = leaves.arrays.vertices_m
    assert 0.75 * height_m < leaves_m[:, 2].max() < 1.35 * height_m
    assert leaves_m[:, 2].min() > CLEAR_M - 1e-9
    low_wood_m = wood.arrays.vertices_m[wood.arrays.vertices_m[:, 2] < 2.0]
    assert np.abs(low_wood_m[:, :2]).max() < 0.5
    assert -0.1 < low_wood_m[:, 2].min() < 0


def test_leaves_leave_gaps_through_which_the_sky_is_seen() -> None:
    opacity = spray(1).pixels()[..., 3] / 255
    assert 0.2 < opacity.mean() < 0.8


def test_a_plant_stands_in_its_tub() -> None:
    tub, leaves = tub_plant(np.random.default_rng(1), 1.0)
    assert tub.arrays.vertices_m[:, 2].min() == 0
    assert leaves.arrays.vertices_m[:, 2].min() > 0
    assert np.linalg.norm(tub.arrays.vertices_m[:, :2], axis=1).max() < 0.3
