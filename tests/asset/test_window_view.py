"""The outward direction is that of a window."""

import numpy as np
import pytest

from tests.asset.floor_plans import PLAN
from vobench.asset.window_view import outward_deg


def test_the_outward_direction_is_that_of_a_window() -> None:
    assert outward_deg(PLAN, np.random.default_rng(0)) == pytest.approx(90)
