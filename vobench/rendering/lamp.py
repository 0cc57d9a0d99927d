"""Lamps: lights as ground truth of shadows sees them, each from its middle."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Floats, Mask
from vobench.rendering.dot_product import dot
from vobench.rendering.geometry import RAY_OFFSET_M
from vobench.rendering.occlusion import Bodies
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.scene import Scene

Bits = NDArray[np.uint32]

LAMPS_AT_ONCE = 32  # a bit each
SUN_DISTANCE_M = 1e4  # beyond every scene
EVERYWHERE = -2.0  # cosine less than any


@dataclass(frozen=True, slots=True)
class Lamp:
    """A light that is on, seen from its middle: what it reaches and does not.

    center_m (3,), None for the sun; axis (3,): along which it shines, or to the sun; where the cosine of the angle to
    the axis is less than min_cosine it does not shine. radius_m: as near to the middle its faces hide nothing.
    """

    center_m: Array | None
    axis: Array
    min_cosine: float = EVERYWHERE
    radius_m: float = 0.0

    def vectors_m(self, starts_m: Floats) -> Floats:
        """From points (R, 3) to the middle, or as far as matters towards the sun."""
        if self.center_m is None:
            to_sun_m = (SUN_DISTANCE_M * self.axis).astype(np.float32)
            return np.broadcast_to(to_sun_m, starts_m.shape)
        vectors_m = self.center_m.astype(np.float32) - starts_m
        if self.radius_m == 0:
            return vectors_m
        distance_m = np.linalg.norm(vectors_m, axis=1)
        outside = np.maximum(1 - self.radius_m / distance_m, 0)
        return np.asarray(vectors_m * outside[:, None])

    def is_before(self, normals: Array, offsets_m: Array) -> Mask:
        """Which planes (F, 3), offsets_m (F,) from the origin, have it before them."""
        if self.center_m is None:
            return np.asarray(normals @ self.axis > 0)
        return np.asarray(normals @ self.center_m > offsets_m + RAY_OFFSET_M)

    def shines(self, vectors_m: Floats) -> Mask | bool:
        """Whether it shines to where vectors (R, 3) lead to its middle from."""
        if self.min_cosine < -1:
            return True
        backwards = (-self.axis).astype(np.float32)
        x, y, z = (backwards[axis] * vectors_m[:, axis] for axis in range(3))
        along = x + y + z
        if self.min_cosine == 0:
            return np.asarray(along > 0)
        length_m = np.sqrt(dot(vectors_m, vectors_m))
        return np.asarray(along > self.min_cosine * length_m)


@dataclass(frozen=True, slots=True)
class LampGroup:
    """Lamps with a bit each; facing (F + 1,): bits of the lamps that each face is turned to, 0 where it is not lit."""

    lamps: tuple[Lamp, ...]
    facing: Bits

    def pixels_facing(self, facing: Bits) -> Iterator[tuple[Lamp, NDArray[np.intp]]]:
        """Each lamp with the pixels (P,) that are turned to it, by their bits (R,)."""
        for nth, lamp in enumerate(self.lamps):
            yield lamp, np.flatnonzero(facing & np.uint32(1 << nth))

    def bits_before(self, normals: Array, offsets_m: Array) -> Bits:
        """Bits (P,) of the lamps that planes (P, 3), offsets_m (P,) from the origin, are turned to."""
        bits = np.zeros(len(normals), np.uint32)
        for nth, lamp in enumerate(self.lamps):
            bits |= lamp.is_before(normals, offsets_m).astype(np.uint32) << np.uint32(nth)
        return bits


def lamps_on(scene: Scene, t_ns: int) -> tuple[int, ...]:
    """The indices of the lights that are on at an instant, but for the sky, which has no middle."""
    lights = []
    for index, light in enumerate(scene.lights):
        if light.level.mean(t_ns, t_ns) > 0 and not isinstance(light, Sky):
            lights.append(index)
    return tuple(lights)


def lamp_groups(
    scene: Scene,
    bodies: Bodies,
    is_lit: Mask,
    lights: Sequence[int],
    t_ns: int,
) -> Iterator[LampGroup]:
    """The lamps that some lights are, by their indices, at an instant.

    is_lit (F + 1,): the faces that show the light that falls on them.
    """
    lamps = []
    for index in lights:
        is_face = bodies.faces.lamp == index
        lamps.append(_lamp(scene.lights[index], bodies.faces.corners_m[is_face], t_ns))
    for first in range(0, len(lamps), LAMPS_AT_ONCE):
        some = tuple(lamps[first : first + LAMPS_AT_ONCE])
        group = LampGroup(some, np.zeros(0, np.uint32))
        facing = group.bits_before(bodies.normals, bodies.offsets_m) * is_lit
        yield LampGroup(some, facing.astype(np.uint32))


def _lamp(
    light: Light,
    corners_m: Array,
    t_ns: int,
) -> Lamp:
    match light:
        case Sun():
            return Lamp(None, light.direction(t_ns))
        case PointLight():
            return Lamp(light.position_m, np.zeros(3))
        case SpotLight():
            min_cosine = float(np.cos(np.deg2rad(light.outer_deg)))
            return Lamp(light.position_m, light.direction, min_cosine)
        case AreaLight():
            return lamp_of(corners_m)
        case Sky():
            raise ValueError("the sky surrounds the scene and has no middle")


def lamp_of(corners_m: Array) -> Lamp:
    """The lamp whose faces (F, 3, 3) shine; where they are flat, only before them."""
    first_edge_m = corners_m[:, 1] - corners_m[:, 0]
    second_edge_m = corners_m[:, 2] - corners_m[:, 0]
    doubled_areas = np.cross(first_edge_m, second_edge_m)  # (F, 3): normals twice as long as faces are large
    weights = np.linalg.norm(doubled_areas, axis=1)
    center_m = np.average(corners_m.mean(1), axis=0, weights=weights)
    axis = unit(doubled_areas.sum(0))
    from_center_m = corners_m.reshape(-1, 3) - center_m
    if np.abs(from_center_m @ axis).max() < RAY_OFFSET_M:
        return Lamp(center_m, axis, 0.0)
    distances_m = np.linalg.norm(from_center_m, axis=1)
    return Lamp(center_m, axis, radius_m=float(distances_m.max()))
