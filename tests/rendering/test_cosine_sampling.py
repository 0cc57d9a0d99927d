"""Points on the disc are uniform, and directions are as dense as their cosine."""

import numpy as np
import pytest

from vobench.rendering.cosine_sampling import cosine_weighted, disc

A, B = (np.stack(np.meshgrid(*[(np.arange(128) + 0.5) / 128] * 2)).reshape(2, -1)).astype(np.float32)


def test_points_fill_the_disc_uniformly() -> None:
    x, y = disc(A, B)
    radius = np.hypot(x, y)
    assert radius.max() <= 1
    for limit in (0.25, 0.5, 0.75):
        assert (radius < limit).mean() == pytest.approx(limit**2, abs=0.01)
    assert x.mean() == pytest.approx(0, abs=1e-3)
    assert (x * y).mean() == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.6, -0.64, 0.48), (0.0, 0.0, -1.0)])
def test_directions_are_unit_vectors_whose_cosine_squared_is_uniform(normal) -> None:
    normals = np.tile(np.array(normal, np.float32), (len(A), 1))
    directions = cosine_weighted(normals)(A, B)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-4)
    cosine = directions @ np.array(normal)
    assert cosine.min() >= -1e-6
    for limit in (0.25, 0.5, 0.75):
        assert (cosine**2 < limit).mean() == pytest.approx(limit, abs=0.01)
    np.testing.assert_allclose(directions.mean(0), 2 / 3 * np.array(normal), atol=2e-3)
