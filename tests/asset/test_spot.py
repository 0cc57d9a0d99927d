"""Spots: frames at the walls of a room, with x into the room."""

import numpy as np
import pytest

from tests.asset.floor_plans import STUDY
from vobench.asset.floor_plan import SIDES, Rect, Side
from vobench.asset.spot import Spot, spot_at_wall


@pytest.mark.parametrize(
    ("side", "along_m", "inner_m"),
    [("west", 3.0, (0.5, 3.0)), ("east", 3.0, (3.5, 3.0)), ("south", 2.0, (2.0, 2.62)), ("north", 2.0, (2.0, 4.5))],
)
def test_x_of_a_spot_at_a_wall_points_into_the_room(side: Side, along_m: float, inner_m: tuple[float, float]) -> None:
    spot = spot_at_wall(STUDY, side, along_m)
    np.testing.assert_allclose(spot.point(0.5), inner_m, atol=1e-9)
    assert spot.along_m == along_m


def test_y_of_a_spot_is_to_the_left_of_x() -> None:
    for side in SIDES:
        spot = spot_at_wall(STUDY, side, 3.0)
        origin = np.array(spot.point(0))
        x = np.array(spot.point(1)) - origin
        y = np.array(spot.point(0, 1)) - origin
        assert x[0] * y[1] - x[1] * y[0] == pytest.approx(1)


def test_a_spot_turns_rectangles_with_it() -> None:
    assert Spot(1.0, 2.0, 90.0, "south").rectangle(0, 1, -0.5, 0.5) == Rect(0.5, 2.0, 1.5, 3.0)


def test_a_footprint_begins_at_its_distance_from_the_wall() -> None:
    footprint = spot_at_wall(STUDY, "west", 3.0).footprint(0.4, 1.0, 0.1)
    np.testing.assert_allclose([footprint.x0, footprint.x1, footprint.y0, footprint.y1], [0.1, 0.5, 2.5, 3.5])
