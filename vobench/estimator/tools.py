"""Names of `parameter.py`, `tracking.py` and `stereo.py` under the module they came from."""

from typing import TYPE_CHECKING

from vobench import retired
from vobench.estimator.parameter import parameters
from vobench.estimator.stereo import Eye, StereoPair, coarse_disparity, predicted, stereo_pair
from vobench.estimator.tracking import (
    Mask,
    Points,
    comparable,
    corners_per_cell,
    follow,
    follow_predicted,
    inside,
    local_contrast,
    lucas_kanade,
)

__all__ = [
    "Eye",
    "Mask",
    "Points",
    "StereoPair",
    "coarse_disparity",
    "comparable",
    "corners_per_cell",
    "follow",
    "follow_predicted",
    "inside",
    "local_contrast",
    "lucas_kanade",
    "parameters",
    "predicted",
    "stereo_pair",
]

if not TYPE_CHECKING:  # else every misspelt name would pass for one of ours

    def __getattr__(name):
        """A name that moved to `estimator/pose.py`, for one release."""
        return retired.lookup(__name__, name)
