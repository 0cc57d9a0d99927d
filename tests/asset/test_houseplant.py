"""Plants: within the space that is reserved for them, with few faces, different by seed."""

import numpy as np
import pytest

from vobench.asset import houseplant


@pytest.mark.parametrize("habit", houseplant.HABITS)
@pytest.mark.parametrize("seed", range(8))
def test_a_plant_keeps_to_its_reach_and_height_and_has_few_faces(habit: houseplant.Habit, seed: int) -> None:
    height_m = 0.9
    parts = houseplant.houseplant(np.random.default_rng(seed), height_m, habit)
    corners = np.concatenate([part.arrays.vertices_m for part in parts])
    assert np.linalg.norm(corners[:, :2], axis=1).max() <= houseplant.REACH * height_m + 1e-9
    assert corners[:, 2].min() >= -0.35 * height_m
    assert corners[:, 2].max() <= 1.15 * height_m
    assert sum(len(part.arrays.faces) for part in parts) < 1900


def test_leaves_are_seen_from_both_sides() -> None:
    parts = houseplant.houseplant(np.random.default_rng(0))
    leaves = next(part for part in parts if part.material.roughness == 0.35)
    corners = leaves.arrays.corners_m
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    np.testing.assert_allclose(area, 0, atol=1e-9)
