"""Frames of plans turn points and rectangles with them."""

import numpy as np

from vobench.asset.plan_frame import PlanFrame


def test_a_point_of_a_frame_that_is_turned_left_lies_to_the_left() -> None:
    np.testing.assert_allclose(PlanFrame(1.0, 2.0, 90.0).point(3.0, 1.0), [0.0, 5.0], atol=1e-12)
    inner = PlanFrame(1.0, 2.0, 90.0).frame(3.0, 1.0, -90.0)
    np.testing.assert_allclose(inner.point(1.0, 0.0), [1.0, 5.0], atol=1e-12)


def test_the_corners_of_a_rectangle_are_counter_clockwise() -> None:
    corners_m = PlanFrame(1.0, 2.0, 33.0).rectangle(0.0, 3.0, -1.0, 1.0)
    following = np.roll(corners_m, -1, axis=0)
    area_m2 = (corners_m[:, 0] * following[:, 1] - corners_m[:, 1] * following[:, 0]).sum() / 2
    np.testing.assert_allclose(area_m2, 6.0)
