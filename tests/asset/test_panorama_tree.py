"""Distant trees stand where they are placed, as high as they are."""

import numpy as np
import pytest

from tests.asset.canvases import canvas
from vobench.asset.panorama_canvas import COLUMNS, PanoramaCanvas, azimuths
from vobench.asset.panorama_tree import DistantTrees

DISTANCE_M = 50.0


def changed(painted: PanoramaCanvas, azimuth: float, height_m: float, sunk: float = 0.0) -> tuple[np.ndarray, ...]:
    """The rows and columns of pixels that a tree changes."""
    trees = DistantTrees(painted)
    before = painted.colour.copy()
    trees.paint(azimuth, DISTANCE_M, height_m, sunk=sunk)
    return np.nonzero((painted.colour != before).any(axis=-1))


@pytest.mark.parametrize("azimuth", [0.5, -2.0])
def test_a_tree_stands_in_its_direction_from_the_ground_to_its_height(azimuth: float) -> None:
    painted = canvas()
    rows, columns = changed(painted, azimuth, 10.0)
    assert azimuths(columns).mean() == pytest.approx(azimuth, abs=0.03)
    heights_m = painted.eye_m + painted.tangent[rows] * DISTANCE_M
    assert 7.0 < heights_m.max() < 10.5
    assert -0.5 < heights_m.min() < 0.5


def test_a_sunk_tree_is_a_bush_on_the_ground() -> None:
    painted = canvas()
    rows, _ = changed(painted, 0.5, 10.0, sunk=0.5)
    heights_m = painted.eye_m + painted.tangent[rows] * DISTANCE_M
    assert 3.0 < heights_m.max() < 5.5
    assert heights_m.min() > -0.3


def test_a_tree_behind_the_viewer_goes_on_at_the_other_end_of_the_map() -> None:
    _, columns = changed(canvas(), np.pi, 10.0)
    assert columns.min() == 0
    assert columns.max() == COLUMNS - 1


def test_leaves_are_greener_than_red_or_blue() -> None:
    painted = canvas()
    rows, columns = changed(painted, 0.5, 10.0)
    mean = painted.colour[rows, columns].mean(axis=0)
    assert mean[1] > mean[0]
    assert mean[1] > mean[2]
