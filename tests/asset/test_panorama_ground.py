"""Ground lies below the horizon, and hills rise to their crest above it."""

import numpy as np
import pytest

from tests.asset.canvases import canvas
from vobench.asset.panorama_canvas import COLUMNS, HAZE_M, ROWS
from vobench.asset.panorama_ground import ground_places, paint_ground, paint_hills


def test_the_ground_recedes_to_the_horizon_at_the_height_of_the_eye() -> None:
    empty = canvas()
    x_m, y_m, footprint_m = ground_places(empty)
    distance_m = np.hypot(x_m, y_m)[:, 0]
    assert x_m.shape == (ROWS // 2, COLUMNS)
    assert (np.diff(distance_m) < 0).all()
    np.testing.assert_allclose(distance_m * -empty.tangent[ROWS // 2 :], empty.eye_m, rtol=1e-4)
    assert footprint_m[0, 0] > footprint_m[-1, 0] > 0


def test_ground_is_painted_below_the_horizon_alone() -> None:
    painted = canvas()
    sky = painted.colour[: ROWS // 2].copy()
    albedo = np.full((ROWS // 2, COLUMNS, 3), 0.2, np.float32)
    paint_ground(painted, albedo)
    np.testing.assert_array_equal(painted.colour[: ROWS // 2], sky)
    below_m = painted.eye_m / -painted.tangent[-1]
    assert below_m < 1e-3 * HAZE_M
    np.testing.assert_allclose(painted.colour[-1, 0], 0.2 * painted.daylight.level_lx / np.pi, rtol=1e-3)


@pytest.mark.parametrize("rise", [0.03, 0.08])
def test_hills_reach_their_rise_and_no_higher(rise: float) -> None:
    painted = canvas()
    before = painted.colour.copy()
    paint_hills(painted, rise=rise, distance_m=5000, albedo=(0.05, 0.07, 0.05))
    changed_rows = np.flatnonzero((painted.colour != before).any(axis=(1, 2)))
    highest = painted.tangent[changed_rows[0]]
    assert 0.9 * rise < highest < 1.2 * rise + 0.01
    assert painted.tangent[changed_rows[-1]] > -0.005
