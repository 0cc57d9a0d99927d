"""Wheel encoders: rim angles to counts, with the calibration errors a real odometer does not know of."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from vobench.geometry.rig import WheelGeometry
from vobench.geometry.se3 import Array
from vobench.setting import require

Fraction = Annotated[float, Ge(-0.2), Le(0.2)]


@dataclass(frozen=True, slots=True)
class EncoderErrors:
    """How the true wheels differ from the nominal ones, relative: true = nominal (1 + error).

    They are truth about the robot; the odometer goes on with the nominal geometry. So a larger left
    wheel turns less and the estimate bends left, and a larger track overstates every turn.
    Source: Borenstein and Feng (1996), who name these as the two dominant systematic errors.
    """

    radius_left: Fraction = 0.0
    radius_right: Fraction = 0.0
    track: Fraction = 0.0

    def __post_init__(self) -> None:
        require(self)


ENCODERS = {
    "exact": EncoderErrors(),
    "nominal": EncoderErrors(radius_left=0.0015, radius_right=-0.0015, track=0.005),
}


def true_rims(rim_rad: Array, errors: EncoderErrors) -> Array:
    """Angles (M, 2) of the true wheels on a motion that turns nominal wheels by rim_rad (M, 2), left and right.

    The track changes what each wheel must travel in a turn: half the difference of the two. The
    radius changes how far a wheel turns for its travel. Exact without slip; with slip, short by
    the product of slip ratio and track error, some 1e-5.
    """
    mean, half_turn = rim_rad.mean(1), (rim_rad[:, 1] - rim_rad[:, 0]) / 2 * (1 + errors.track)
    left, right = (mean - half_turn) / (1 + errors.radius_left), (mean + half_turn) / (1 + errors.radius_right)
    return np.stack([left, right], -1)


def ticks(rim_rad: Array, wheels: WheelGeometry, errors: EncoderErrors = ENCODERS["exact"]) -> NDArray[np.int64]:
    """Counts (M, 2) since angle zero, left and right: whole ticks passed, rounded down also when rolling back."""
    return np.floor(true_rims(rim_rad, errors) * wheels.ticks_per_revolution / (2 * np.pi)).astype(np.int64)
