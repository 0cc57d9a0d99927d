"""What grows in parks: pictures with holes, and tufts on the ground."""

import numpy as np
import pytest

from vobench.asset import meadow
from vobench.asset.furniture import matt


@pytest.mark.parametrize("paint", [meadow.blades, meadow.flowers])
def test_pictures_of_leaves_are_partly_transparent(paint) -> None:
    alpha = np.asarray(paint(0, px=128).pixels())[..., 3]
    assert 0.1 < (alpha > 0).mean() < 0.9


@pytest.mark.parametrize("paint", [meadow.lawn, meadow.gravel])
def test_seeds_of_grounds_differ_and_repeat(paint) -> None:
    first = np.asarray(paint(0, px=256).pixels())
    assert np.array_equal(first, np.asarray(paint.__wrapped__(0, px=256).values))
    assert not np.array_equal(first, np.asarray(paint(1, px=256).pixels()))


def test_tufts_stand_on_their_feet() -> None:
    feet_m = np.array([[0.0, 0.0, 1.0], [3.0, 1.0, -2.0]])
    part = meadow.tufts(np.random.default_rng(0), feet_m, (0.2, 0.2), matt())
    heights_m = part.arrays.vertices_m[:, 2].reshape(2, -1)
    assert heights_m.min(axis=1) == pytest.approx([1.0 - 0.016, -2.0 - 0.016])
    assert heights_m.max(axis=1) == pytest.approx([1.184, -1.816])
