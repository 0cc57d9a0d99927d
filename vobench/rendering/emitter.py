"""Emitters: the sources of direct light, as points see them."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, Protocol

import numpy as np

from vobench.rendering.array_types import Floats, Mask
from vobench.rendering.geometry import BoundingSphere
from vobench.rendering.texel import Texels


class Occluder(Protocol):
    """What may hide an emitter from points. Rays run from origins to origins + segments (R, 3)."""

    def clear(self, origins_m: Floats, segments_m: Floats) -> Mask:
        """Whether nothing opaque is there."""

    def passing(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """Share (R,) of light that passes what is there."""

    def through_panes(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """Share (R,) that all panes there let through."""


# Maps two random numbers (P,) to vectors (P, 3) in m to places on an emitter, and to the illuminance (P,) in lx that a
# surface perpendicular to the vector receives if all of the emitter shone from that place.
Aim = Callable[[Floats, Floats], tuple[Floats, Floats]]


class Emitter(ABC):
    """A source of direct light.

    ball: a bounding sphere, of infinite radius if the emitter surrounds the scene. sky: "pane" for the sky behind a
    pane, "open" for the sky that no pane covers, otherwise empty.
    """

    __slots__ = ()
    sky: ClassVar[str] = ""
    ball: BoundingSphere

    @property
    def least_side(self) -> int:
        """The least side of the grid of places by which its unshadowed light is sampled."""
        return 1

    @property
    def is_hard(self) -> bool:
        """Whether it is so narrow that one ray tells whether it is visible from a point."""
        return False

    @abstractmethod
    def towards(self, texels: Texels) -> Aim:
        """The function that aims at random places on the emitter from texels (P,)."""

    @abstractmethod
    def width_rad(self, points_m: Floats) -> Floats:
        """Its approximate angular width (P,) seen from points (P, 3); 0 if its shadows are hard."""

    def passing(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """The share (R,) of light from origins + segments (R, 3) that reaches the origins, past what may hide it."""
        return occluder.passing(origins_m, segments_m)

    def may_reach(self, points_m: Floats) -> Mask:
        """Which points (P, 3) its light can reach, as far as that is known without rays."""
        return np.ones(len(points_m), bool)

    def unshadowed_light(self, texels: Texels) -> Floats:
        """The illuminance (P,) in lx if nothing hides it, under a coat what enters; NaN where there is no formula."""
        return np.full(len(texels), np.nan, np.float32)


def sphere_width_rad(ball: BoundingSphere, points_m: Floats) -> Floats:
    """The angular width (P,) of a sphere seen from points (P, 3): the root of its solid angle, for distant points."""
    distance_m = np.linalg.norm(ball.centre_m - points_m, axis=1)
    width = np.sqrt(np.pi) * ball.radius_m / np.maximum(distance_m, 1e-6)
    return np.asarray(width, np.float32)
