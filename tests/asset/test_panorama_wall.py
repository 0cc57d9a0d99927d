"""Walls of distant buildings: their outline, the colours of masonry, and lit windows."""

import numpy as np
import pytest

from tests.asset.canvases import canvas
from vobench.asset.panorama_canvas import PanoramaCanvas
from vobench.asset.panorama_wall import LIT_CD_M2, LIT_RANGE_CD_M2, DistantFacade, WallPatch, coverage, seen_wall

EAVES_M = 9.0
FACADE = DistantFacade((0.5, 0.4, 0.3), (0.8, 0.8, 0.8), lit_share=1.0)


def patch(painted: PanoramaCanvas, facade: DistantFacade = FACADE) -> WallPatch:
    """The wall of a building 20 m ahead that is 10 m wide."""
    wall = seen_wall(painted, np.array([20.0, 5.0]), np.array([20.0, -5.0]))
    assert wall is not None
    rows = painted.rows(-0.15, 0.6)
    return WallPatch(painted, wall, facade, rows, eaves_m=EAVES_M, texture_offset=0.0)


def test_coverage_is_a_half_at_an_edge() -> None:
    step = np.ones(4)
    np.testing.assert_allclose(coverage(np.array([-2.0, 0.0, 3.0, 9.0]), 0, 5, step), [0, 0.5, 1, 0])


def test_a_wall_covers_pixels_from_the_ground_to_the_eaves_and_a_gable_more() -> None:
    wall = patch(canvas())
    inner = (wall.height_m > 0.2) & (wall.height_m < EAVES_M - 0.2)
    flat = wall.cover(0.0)
    middle = flat.shape[1] // 2
    np.testing.assert_allclose(flat[:, middle][inner[:, middle]], 1.0)
    assert flat[wall.height_m.repeat(1, axis=1) > EAVES_M + 0.3].max() == 0
    assert flat[wall.height_m < -0.3].max() == 0
    assert wall.cover(3.0).sum() > 1.1 * flat.sum()


def test_masonry_has_the_colour_of_its_wall() -> None:
    colour = patch(canvas()).masonry(has_bands=False)
    assert (colour > 0).all()
    ratios = colour.reshape(-1, 3).mean(axis=0)
    assert ratios[0] > ratios[1] > ratios[2]


@pytest.mark.parametrize("lit_share", [0.0, 1.0])
def test_lit_windows_shine_within_their_range_and_dark_ones_do_not(lit_share: float) -> None:
    facade = DistantFacade((0.5, 0.4, 0.3), (0.8, 0.8, 0.8), lit_share=lit_share)
    wall = patch(canvas(), facade)
    lamps_cd_m2 = wall.add_windows(wall.masonry(has_bands=True))
    assert lamps_cd_m2.max() <= LIT_CD_M2 + LIT_RANGE_CD_M2
    assert (lamps_cd_m2.max() > LIT_CD_M2) == (lit_share == 1.0)
