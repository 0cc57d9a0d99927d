"""Rain: the drops in the air, by size and speed, and the share of light that they intercept."""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.setting import settings
from vobench.trajectory.nanoseconds import NS_PER_S

M_PER_MM = 1e-3
# Marshall and Palmer (1948): drops per m³ and per mm of diameter are N0 exp(-slope D).
N0_PER_M3_MM = 8000.0
# Smaller drops hardly fall, and the distribution states too many of them; larger ones break up.
LEAST_MM = 0.5
LARGEST_MM = 6.0
CLASS_MM = 0.25  # the width of a class of sizes, whose drops fall at the same speed
SMALLEST_RAD = 5e-4  # the angular diameter at which a drop is still drawn by itself


@settings()
class Rain:
    """Rain, and the ground that it has wetted. Without a rate, it has stopped, and the ground is still wet.

    `rate_mm_per_h` is the depth of water that falls in an hour: 1 is light, 10 heavy, 50 a cloudburst.
    `wind_mps` is the horizontal velocity of the air and of the drops in it, in the world frame.
    `puddles` is the share of level ground that is covered by puddles.
    `seed` determines the places of drops and puddles.
    """

    rate_mm_per_h: Annotated[float, Ge(0), Le(200)] = 10.0
    wind_mps: tuple[float, float] = (0.0, 0.0)
    puddles: Annotated[float, Ge(0), Le(0.5)] = 0.15
    seed: Annotated[int, Ge(0)] = 0

    @property
    def slope_per_mm(self) -> float:
        """The slope of the distribution of sizes (Marshall and Palmer, 1948, equation 3)."""
        return 4.1 * float(self.rate_mm_per_h**-0.21)

    @property
    def size_classes(self) -> "list[SizeClass]":
        """The drops of each class of sizes, the smallest first; none without a rate."""
        if self.rate_mm_per_h == 0:
            return []
        count = round((LARGEST_MM - LEAST_MM) / CLASS_MM)
        lower_mm = [LEAST_MM + index * CLASS_MM for index in range(count)]
        return [self._size_class(lower, lower + CLASS_MM) for lower in lower_mm]

    @property
    def extinction_per_m(self) -> float:
        """The share of light that drops intercept, per metre: the sum of their cross-sections in a unit of volume.

        Light that a drop diffracts remains within a pixel, so it does not count.
        """
        return sum(drops.per_m3 * drops.cross_section_m2 for drops in self.size_classes)

    def _size_class(self, lower_mm: float, upper_mm: float) -> "SizeClass":
        """The drops with diameters between two bounds."""
        slope = self.slope_per_mm
        lower = math.exp(-slope * lower_mm)
        upper = math.exp(-slope * upper_mm)
        return SizeClass((lower_mm + upper_mm) / 2, N0_PER_M3_MM * (lower - upper) / slope)


@dataclass(frozen=True, slots=True)
class SizeClass:
    """Drops of about the same diameter, and how many of them there are in a cubic metre of air."""

    diameter_mm: float
    per_m3: float

    @property
    def diameter_m(self) -> float:
        """The diameter in metres."""
        return self.diameter_mm * M_PER_MM

    @property
    def cross_section_m2(self) -> float:
        """The area of the disc that a drop covers."""
        return math.pi / 4 * self.diameter_m**2

    @property
    def fall_mps(self) -> float:
        """The terminal velocity (Atlas, Srivastava and Sekhon, 1973, equation 6)."""
        return 9.65 - 10.3 * math.exp(-0.6 * self.diameter_mm)

    @property
    def reach_m(self) -> float:
        """The distance up to which drops are drawn one by one."""
        return self.diameter_m / SMALLEST_RAD


class FallingDrops:
    """The drops near a camera at any time.

    Each size fills a cube with random drops that fall at their terminal velocity. The cube is repeated without end in
    all directions, and is so large that a camera sees no drop twice.
    """

    def __init__(self, rain: Rain) -> None:
        self._classes = rain.size_classes
        self._wind_mps = rain.wind_mps
        self._starts = list[Array]()  # of each class (N, 3), as shares of the sides of its cube, at time 0
        for index, drops in enumerate(self._classes):
            rng = np.random.default_rng(np.random.SeedSequence(rain.seed, spawn_key=(index,)))
            side_m = 2 * drops.reach_m
            count = rng.poisson(drops.per_m3 * side_m**3)
            self._starts.append(rng.uniform(0, 1, (count, 3)))

    def near(self, camera_m: Array, t_ns: float) -> "NearDrops":
        """The drops within the cubes around a point (3,) at an instant."""
        positions_m = [np.zeros((0, 3))]
        velocities_mps = [np.zeros((0, 3))]
        diameters_m = [np.zeros(0)]
        for drops, starts in zip(self._classes, self._starts, strict=True):
            side_m = 2 * drops.reach_m
            velocity_mps = np.array([*self._wind_mps, -drops.fall_mps])
            fallen_m = velocity_mps * (t_ns / NS_PER_S)
            corner_m = camera_m - drops.reach_m
            places = starts + (fallen_m - corner_m) / side_m
            places -= np.floor(places)
            positions_m.append(corner_m + side_m * places)
            velocities_mps.append(np.broadcast_to(velocity_mps, starts.shape))
            diameters_m.append(np.full(len(starts), drops.diameter_m))
        return NearDrops(
            np.concatenate(positions_m),
            np.concatenate(velocities_mps),
            np.concatenate(diameters_m),
            t_ns,
        )


@dataclass(frozen=True, slots=True)
class NearDrops:
    """Drops at the instant `t_ns`: positions (N, 3) and velocities (N, 3) in the world frame, and diameters (N,)."""

    positions_m: Array
    velocities_mps: Array
    diameters_m: Array
    t_ns: float

    def __len__(self) -> int:
        return len(self.diameters_m)

    def take(self, rows: NDArray[Any]) -> "NearDrops":
        """Some of the drops, given by a mask or by their indices."""
        return NearDrops(self.positions_m[rows], self.velocities_mps[rows], self.diameters_m[rows], self.t_ns)
