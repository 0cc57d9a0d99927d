"""Lots and segments of plans of streets."""

import numpy as np
import pytest

from vobench.asset.plan_frame import PlanFrame
from vobench.asset.street_plan import LEFT, Lot, SideStreet, StreetSegment


def test_the_front_of_a_lot_is_on_x_0_and_its_back_is_skewed() -> None:
    lot = Lot(PlanFrame(0.0, 0.0, 0.0), 8.0, 10.0, skew_m=(-0.5, 1.0))
    np.testing.assert_allclose(lot.corners_m, [[0, -4], [0, 4], [-10, 5], [-10, -4.5]], atol=1e-12)


def test_segments_meet_at_a_bend_on_either_side() -> None:
    turn_deg = 14.0
    first = StreetSegment(PlanFrame(0.0, 0.0, 0.0), 30.0, (0.0, turn_deg))
    second = StreetSegment(PlanFrame(30.0, 0.0, turn_deg), 30.0, (turn_deg, 0.0))
    for y_m in (-5.0, 5.0):
        end_m = first.frame.point(first.reach_m(y_m)[1], y_m)
        start_m = second.frame.point(second.reach_m(y_m)[0], y_m)
        np.testing.assert_allclose(end_m, start_m, atol=1e-9)


def test_half_a_side_street_is_half_its_road_and_a_pavement() -> None:
    assert SideStreet(0, 20.0, LEFT, road_m=6.0, pavement_m=2.0).half_m == pytest.approx(5.0)
