"""Wheel slip on a plain floor: its settings.

Terms: the slip ratio of a wheel is 1 - ground speed / rim speed. The side-slip angle is the angle from the heading to
the velocity, positive to the left.
"""

from math import radians
from typing import Annotated

from annotated_types import Ge, Le

from vobench.setting import Positive, settings

# The random streams of slip, one for each process, so that switching one off does not change the others.
SLIP_STREAMS = ("left", "right", "side")


@settings(kw_only=False)
class SlipSettings:
    """Random slip and deterministic slip.

    The slip ratios of both wheels and the side-slip angle are independent Ornstein-Uhlenbeck processes with mean 0.
    `ratio_std` is the standard deviation of the slip ratios, `angle_std_rad` that of the side-slip angle, and
    `correlation_s` the correlation time of all three.
    `skid_s` is the sideways speed to the outside of a bend, divided by the product of speed and turn rate.
    `traction_s2pm` is the slip ratio of a wheel, divided by its acceleration.
    """

    ratio_std: Annotated[float, Ge(0), Le(0.1)] = 0.0
    angle_std_rad: Annotated[float, Ge(0), Le(0.15)] = 0.0
    skid_s: Annotated[float, Ge(0), Le(0.5)] = 0.0
    correlation_s: Positive = 0.3
    traction_s2pm: Annotated[float, Ge(0), Le(0.1)] = 0.0


# Engineering choices: there are no published values.
SLIPS = {
    "none": SlipSettings(),
    "nominal": SlipSettings(ratio_std=0.01, angle_std_rad=radians(0.5), skid_s=0.005),
    "slippery": SlipSettings(ratio_std=0.05, angle_std_rad=radians(2.0), skid_s=0.02),
    "straining": SlipSettings(
        ratio_std=0.01,
        angle_std_rad=radians(0.5),
        skid_s=0.005,
        traction_s2pm=0.03,
    ),
}
