"""The outward direction is that of a window."""

from dataclasses import replace

import numpy as np
import pytest

from tests.asset.floor_plans import PLAN
from vobench.asset.window_view import outward_deg, view_outside
from vobench.scene.light import Sky


def test_the_outward_direction_is_that_of_a_window() -> None:
    assert outward_deg(PLAN, np.random.default_rng(0)) == pytest.approx(90)


def test_a_plan_without_windows_has_daylight_too() -> None:
    windowless = replace(PLAN, windows=())
    outside = view_outside(windowless, np.random.default_rng(0), "day", floor_heights_m=(4.0,), kinds=("city",))
    (sky,) = (light for light in outside.lights if isinstance(light, Sky))
    assert sky.panorama is not None
    assert (sky.panorama.kind, sky.panorama.height_m) == ("city", 4.0)
