"""Wheel encoders: the counts of ticks, and the errors of the nominal wheel geometry."""

from typing import Annotated

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from vobench.geometry.rig import WheelGeometry
from vobench.geometry.se3 import Array
from vobench.setting import settings

Fraction = Annotated[float, Ge(-0.2), Le(0.2)]


@settings()
class EncoderErrors:
    """The relative errors of the nominal wheels: true = nominal (1 + error).

    The robot has the true wheels, the odometry uses the nominal geometry. So a larger left wheel turns less
    and the estimate bends left, and with a larger track every turn is overestimated.
    Source: Borenstein and Feng (1996), who name these as the two dominant systematic errors.
    """

    radius_left: Fraction = 0.0
    radius_right: Fraction = 0.0
    track: Fraction = 0.0


ENCODERS = {
    "exact": EncoderErrors(),
    "nominal": EncoderErrors(radius_left=0.0015, radius_right=-0.0015, track=0.005),
}


def true_rims(rim_rad: Array, errors: EncoderErrors) -> Array:
    """The angles (M, 2) of the true wheels, left and right, given those of nominal wheels in the same motion.

    In a turn, a wider track makes the outer wheel travel further, and the inner one less far. A larger radius makes a
    wheel turn less over the same distance. For example, while the robot turns on the spot and nominal wheels turn by
    (-1, 1) rad, a track error of 1 % makes it (-1.01, 1.01) rad.
    This is exact without slip. With slip, it misses the product of slip ratio and track error, some 1e-5.
    """
    left_rad, right_rad = rim_rad.T
    mean_rad = rim_rad.mean(1)
    half_difference_rad = (right_rad - left_rad) / 2 * (1 + errors.track)
    true_left_rad = (mean_rad - half_difference_rad) / (1 + errors.radius_left)
    true_right_rad = (mean_rad + half_difference_rad) / (1 + errors.radius_right)
    return np.stack([true_left_rad, true_right_rad], -1)


def ticks(
    rim_rad: Array,
    wheels: WheelGeometry,
    errors: EncoderErrors = ENCODERS["exact"],
) -> NDArray[np.int64]:
    """Counts (M, 2) since angle zero, left and right: whole ticks passed, rounded down also when rolling back."""
    rims_rad = true_rims(rim_rad, errors)
    exact_ticks = rims_rad * wheels.ticks_per_revolution / (2 * np.pi)
    return np.floor(exact_ticks).astype(np.int64)
