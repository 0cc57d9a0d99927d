"""Rays, and where they ended, as named tuples of arrays, which compiled kernels accept."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.geometry import take


class RayBatch(NamedTuple):
    """R rays that are followed through a scene.

    `point` (R,) is the row of the result to which each ray contributes.
    `origins_m` and `directions` (R, 3) are in the world, `weight` (R,) is the share of the light that a ray stands for.
    `is_direct` (R,) is whether the light of a lamp that the ray meets next is direct light, which is counted elsewhere.
    """

    point: Indices
    origins_m: Floats
    directions: Floats
    weight: Floats
    is_direct: Mask

    def take(self, rays: Rows | Mask | slice) -> "RayBatch":
        """Some of the rays, given by their indices, a mask or a slice."""
        return take(self, rays)

    def joined(self, other: "RayBatch") -> "RayBatch":
        """The rays of both batches."""
        return RayBatch(*(np.concatenate(columns) for columns in zip(self, other, strict=True)))


class RayEnds(NamedTuple):
    """Where R rays ended.

    `point` (R,) is the row of the result to which each ray contributes.
    `column` (R,) is the column of the result for the surfel or the lamp that the ray met.
    `texel` (R,) is the index of the texel of the light map on which the ray ended.
    `share` (R,) is what the ray contributes to its row and column.
    `is_near` (R,) is whether the last segment of the ray is shorter than NEAR_M.
    """

    point: Indices
    column: Indices
    texel: Indices
    share: Floats
    is_near: Mask

    def take(self, rays: Rows | Mask | slice) -> "RayEnds":
        """The ends of some rays, given by their indices, a mask or a slice."""
        return take(self, rays)


def empty_batch(count: int) -> RayBatch:
    """A batch with uninitialised arrays for `count` rays, which a kernel fills."""
    return RayBatch(
        point=np.empty(count, np.int32),
        origins_m=np.empty((count, 3), np.float32),
        directions=np.empty((count, 3), np.float32),
        weight=np.empty(count, np.float32),
        is_direct=np.empty(count, bool),
    )


def empty_ends(count: int) -> RayEnds:
    """Uninitialised arrays for the ends of `count` rays, which a kernel fills."""
    return RayEnds(
        point=np.empty(count, np.int32),
        column=np.empty(count, np.int32),
        texel=np.empty(count, np.int32),
        share=np.empty(count, np.float32),
        is_near=np.empty(count, bool),
    )


def joined_ends(parts: Sequence[RayEnds]) -> RayEnds:
    """The ends of the rays of all parts, one part after the other."""
    return RayEnds(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
