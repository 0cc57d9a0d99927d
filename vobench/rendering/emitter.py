"""Emitters: the sources of direct light, as points see them."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, Protocol

import numpy as np

from vobench.rendering.array_types import Floats, Mask
from vobench.rendering.geometry import BoundingSphere
from vobench.rendering.texel import Texels


class Occluder(Protocol):
    """What can hide an emitter from points. Rays lead from origins (R, 3) to origins + segments (R, 3)."""

    def is_unoccluded(self, origins_m: Floats, segments_m: Floats) -> Mask:
        """Whether no opaque face (R,) is on each ray."""

    def transmittance(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """The transmittance (R,) of opaque faces and panes together. It is 0 behind an opaque face."""

    def transmittance_of_panes(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """The transmittance (R,) of panes. Opaque faces are ignored."""


# A function of two random numbers (P,) in [0, 1). It returns the vectors (P, 3) in m from points to random places on an
# emitter, and the illuminance (P,) in lx at normal incidence if all light of the emitter came from that place.
Aim = Callable[[Floats, Floats], tuple[Floats, Floats]]


class Emitter(ABC):
    """A source of direct light.

    `ball` is a bounding sphere. Its radius is infinite if the emitter surrounds the scene.
    `sky` is "pane" for the sky behind a pane, "open" for the sky without a pane, and empty for other emitters.
    """

    __slots__ = ()
    sky: ClassVar[str] = ""
    ball: BoundingSphere

    @property
    def least_side(self) -> int:
        """The smallest side of the grid of places with which its unshadowed light is sampled."""
        return 1

    @property
    def is_hard(self) -> bool:
        """Whether it is so narrow that one ray to a point decides whether it is visible from there."""
        return False

    @abstractmethod
    def towards(self, texels: Texels) -> Aim:
        """The function that chooses random places on the emitter for texels (P,)."""

    @abstractmethod
    def width_rad(self, points_m: Floats) -> Floats:
        """Its approximate angular width (P,) seen from points (P, 3); 0 if its shadows are hard."""

    def transmittance(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """The transmittance (R,) between origins (R, 3) and places on the emitter at origins + segments (R, 3)."""
        return occluder.transmittance(origins_m, segments_m)

    def may_reach(self, points_m: Floats) -> Mask:
        """Whether its light can reach points (P, 3), as far as this is known without casting rays."""
        return np.ones(len(points_m), bool)

    def unshadowed_light(self, texels: Texels) -> Floats:
        """The illuminance (P,) in lx without shadows; NaN if there is no formula. Under a coat, it is what enters."""
        return np.full(len(texels), np.nan, np.float32)


def sphere_width_rad(ball: BoundingSphere, points_m: Floats) -> Floats:
    """The angular width (P,) of a sphere seen from points (P, 3): the root of its solid angle, for distant points."""
    distance_m = np.linalg.norm(ball.centre_m - points_m, axis=1)
    width = np.sqrt(np.pi) * ball.radius_m / np.maximum(distance_m, 1e-6)
    return np.asarray(width, np.float32)
