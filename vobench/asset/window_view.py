"""What is outside the windows of a floor plan, and the direction in which they look."""

from collections.abc import Sequence

import numpy as np

from vobench.asset.daylight import Daylight, daylight
from vobench.asset.floor_plan import SIDES, FloorPlan
from vobench.asset.picture import Rng

ANY_WINDOW_SHARE = 0.3  # of places whose direction is that of any window, not of one of the largest room


def view_outside(
    plan: FloorPlan,
    rng: Rng,
    lighting: str,
    *,
    floor_heights_m: Sequence[float],
    kinds: tuple[str, ...],
) -> Daylight:
    """The daylight of a plan and the view through its windows, for a floor at a random one of some heights.

    `lighting` is one of `daylight.LIGHTINGS`; `kinds` are the surroundings to draw from.
    """
    towards_deg = outward_deg(plan, rng) if plan.windows else float(rng.uniform(0, 360))
    height_m = float(rng.choice(floor_heights_m))
    return daylight(rng, lighting, towards_deg=towards_deg, height_m=height_m, kinds=kinds)


def outward_deg(plan: FloorPlan, rng: Rng) -> float:
    """The azimuth, from x towards y, in which a random window looks; mostly a window of the largest room."""
    largest = max(plan.rooms, key=lambda room: room.rect.area_m2)
    windows = list(plan.windows_of(largest)) or list(plan.windows)
    if rng.random() < ANY_WINDOW_SHARE:
        windows = list(plan.windows)
    window = windows[int(rng.integers(len(windows)))]
    outward_x, outward_y = SIDES[plan.room(window.room).side_at(window.rect)]
    return float(np.rad2deg(np.arctan2(outward_y, outward_x)))
