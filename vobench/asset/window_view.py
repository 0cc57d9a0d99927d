"""The view through the windows of a floor plan, and the direction that they face."""

from collections.abc import Sequence

import numpy as np

from vobench.asset.daylight import Daylight, daylight
from vobench.asset.floor_plan import SIDES, FloorPlan
from vobench.asset.picture import Rng

# The probability that the direction is that of any window, instead of one of the largest room.
ANY_WINDOW_PROBABILITY = 0.3


def view_outside(
    plan: FloorPlan,
    rng: Rng,
    lighting: str,
    *,
    floor_heights_m: Sequence[float],
    kinds: tuple[str, ...],
) -> Daylight:
    """The daylight of a plan, and the view through its windows.

    `lighting` is one of `daylight.LIGHTINGS`.
    `floor_heights_m` are the heights of the floor above the ground, one of which is drawn.
    `kinds` are the kinds of surroundings, one of which is drawn.
    """
    towards_deg = outward_deg(plan, rng) if plan.windows else float(rng.uniform(0, 360))
    height_m = float(rng.choice(floor_heights_m))
    return daylight(rng, lighting, towards_deg=towards_deg, height_m=height_m, kinds=kinds)


def outward_deg(plan: FloorPlan, rng: Rng) -> float:
    """The azimuth that a random window faces, from x towards y. In most draws it is a window of the largest room."""
    largest = max(plan.rooms, key=lambda room: room.rect.area_m2)
    all_windows = list(plan.windows)
    windows_of_largest = list(plan.windows_of(largest))
    chooses_any = rng.random() < ANY_WINDOW_PROBABILITY
    candidates = all_windows if chooses_any or not windows_of_largest else windows_of_largest
    window = candidates[int(rng.integers(len(candidates)))]
    side = plan.room(window.room).side_at(window.rect)
    outward_x, outward_y = SIDES[side]
    return float(np.rad2deg(np.arctan2(outward_y, outward_x)))
