"""The direction in which the windows of a floor plan look."""

import numpy as np

from vobench.asset.floor_plan import SIDES, FloorPlan
from vobench.asset.picture import Rng

ANY_WINDOW_SHARE = 0.3  # of places whose direction is that of any window, not of one of the largest room


def outward_deg(plan: FloorPlan, rng: Rng) -> float:
    """The azimuth, from x towards y, in which a random window looks; mostly a window of the largest room."""
    largest = max(plan.rooms, key=lambda room: room.rect.area_m2)
    windows = list(plan.windows_of(largest)) or list(plan.windows)
    if rng.random() < ANY_WINDOW_SHARE:
        windows = list(plan.windows)
    window = windows[int(rng.integers(len(windows)))]
    outward_x, outward_y = SIDES[plan.room(window.room).side_at(window.rect)]
    return float(np.rad2deg(np.arctan2(outward_y, outward_x)))
