"""Rugs of all kinds are flat and as large as asked."""

import numpy as np
import pytest

from vobench.asset.placed_piece import vertices_of
from vobench.asset.rug import rug


@pytest.mark.parametrize("seed", range(4))
def test_rugs_of_all_kinds_are_flat_and_as_large_as_asked(seed: int) -> None:
    vertices_m = vertices_of(rug(np.random.default_rng(0), 1.8, 1.2, seed))
    np.testing.assert_allclose(np.ptp(vertices_m, axis=0)[:2], [1.2, 1.8], atol=0.002)
    assert vertices_m[:, 2].max() < 0.01


def test_patterns_lie_above_the_rug_and_apart_from_one_another() -> None:
    base, border, field = rug(np.random.default_rng(0), 1.8, 1.2, 2)
    tops_m = [vertices_of([part])[:, 2].max() for part in (base, border, field)]
    assert tops_m[0] < tops_m[1] < tops_m[2]
