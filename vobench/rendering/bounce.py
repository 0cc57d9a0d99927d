"""The sum of all bounces of light between surfels."""

from typing import TYPE_CHECKING

import numpy as np

from vobench.rendering.array_types import Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix
    from scipy.sparse.linalg import LinearOperator

# The bounces that remain are summed up as a geometric series if the ratio of one to the one before has changed by no
# more than EVEN and their share of all light is at most REST, or if that is at most FAINT_REST.
EVEN = 2e-3
REST = 0.03
FAINT_REST = 1e-4
LARGEST_RATIO = 0.999


def bounced(
    straight: Floats,
    reflectance: Floats,
    table: "csr_matrix | LinearOperator",
    first: Floats,
    *,
    bounces: int,
) -> Floats:
    """The illuminance (K, S, C) in lx that surfels receive by one bounce or more of K lights, in C colours.

    straight (K, S, C): their radiosity under direct light. reflectance (S, C): theirs. table (S, S): maps the radiosity
    of surfels to their illuminance. first (K, S): the illuminance by mirrors from lamps and the sky, which is grey.

    After some bounces each one is nearly the same share of the one before, so the remaining ones are summed up as a
    geometric series.
    """
    light_count, surfel_count, channels = straight.shape
    if not bounces:
        return np.zeros(straight.shape, np.float32)
    column_shape = (surfel_count, light_count * channels)  # all lights and colours beside one another
    by_mirrors = np.repeat(first.T[..., None], channels, 2).reshape(column_shape).astype(np.float32)
    radiosity = straight.transpose(1, 0, 2).reshape(column_shape)
    column_reflectance = np.tile(reflectance, (1, light_count))

    bounce = table @ radiosity + by_mirrors
    total = bounce.copy()
    ratio = np.zeros(column_shape[1])
    for bounces_left in reversed(range(bounces - 1)):
        previous_sum = bounce.sum(0, dtype=float)
        bounce = table @ (column_reflectance * bounce)
        total += bounce
        previous_ratio = ratio
        growth = bounce.sum(0, dtype=float) / np.maximum(previous_sum, 1e-30)
        ratio = np.clip(growth, 0, LARGEST_RATIO)

        rest = ratio * (1 - ratio**bounces_left) / (1 - ratio)  # the sum of the series, in units of this bounce
        total_sum = np.maximum(total.sum(0), 1e-30)
        rest_share = rest * bounce.sum(0) / total_sum
        is_even = np.abs(ratio - previous_ratio) <= EVEN
        can_stop = (rest_share <= FAINT_REST) | is_even & (rest_share <= REST)
        if can_stop.all():
            total += bounce * rest.astype(np.float32)
            break
    by_surfel = total.reshape(surfel_count, light_count, channels)
    return np.ascontiguousarray(by_surfel.transpose(1, 0, 2))
