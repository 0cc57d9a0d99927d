"""Wind: the angles by which it deflects the branches of trees, as an exact function of time."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from vobench.geometry.se3 import Array
from vobench.setting import settings
from vobench.trajectory.nanoseconds import NS_PER_S

# Drag grows with the square of the speed, and so does the deflection of a branch (de Langre, Effects of wind on plants,
# 2008). Small trees in leaf begin to sway at Beaufort 5, which is 8 to 10.7 m/s.
DEFLECTION_RAD = np.deg2rad(5.0)  # of a branch at REFERENCE_MPS
REFERENCE_MPS = 10.0
# Above a canopy the speed varies by about 30 % (Raupach, Finnigan and Brunet, 1996), and drag by twice as much. The
# variance is divided evenly among gusts, the sway of the whole tree and that of each branch.
VARIATION = 0.6
ACROSS = 0.5  # the deflection across the wind, relative to its variation along the wind
GUST_HZ = (0.03, 0.15)
# A tree sways at 0.2 to 0.6 Hz, the lower the taller it is (Moore and Maguire, 2004); its branches at 1 to 3 Hz.
TREE_HZ_M = 3.0  # the frequency of a tree times its height
MOST_TREE_HZ = 1.5
BRANCH_HZ = (1.0, 3.0)
DAMPING = 0.1  # of a branch in leaf, relative to critical damping
WAVES = 4  # the number of sine waves of each part of the motion


@settings()
class Wind:
    """Wind that moves the leaves of trees and bushes.

    `speed_mps` is the mean speed of the air: 3 is a light breeze, 10 a fresh one, 15 near a gale.
    `towards_deg` is where the air moves to, counter-clockwise from x.
    `seed` determines gusts and the sway of each branch.
    """

    speed_mps: Annotated[float, Ge(0), Le(20)] = 5.0
    towards_deg: float = 0.0
    seed: Annotated[int, Ge(0)] = 0

    @property
    def towards(self) -> Array:
        """The unit vector (3,) along which the air moves."""
        angle_rad = np.deg2rad(self.towards_deg)
        return np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])

    @property
    def deflection_rad(self) -> float:
        """The mean deflection of a branch."""
        return float(DEFLECTION_RAD * (self.speed_mps / REFERENCE_MPS) ** 2)


@dataclass(frozen=True, slots=True)
class Sway:
    """The deflection of a branch along the wind and across it, in rad: a mean (2,) and sine waves of K frequencies.

    `frequency_hz` (K,), `amplitude_rad` and `phase_rad` (K, 2).
    """

    mean_rad: Array
    frequency_hz: Array
    amplitude_rad: Array
    phase_rad: Array

    def at(self, t_ns: float) -> Array:
        """The deflection (2,) at an instant."""
        angle_rad = 2 * np.pi * self.frequency_hz[:, None] * (t_ns / NS_PER_S) + self.phase_rad
        return np.asarray(self.mean_rad + (self.amplitude_rad * np.sin(angle_rad)).sum(0))


def branch_sways(wind: Wind, *, tree: int, place_m: Array, height_m: float, branches: int) -> list[Sway]:
    """The sway of each branch of a tree at a place (3,).

    Gusts move with the wind from tree to tree. Trees and branches sway at frequencies of their own: they are damped
    oscillators that turbulence drives, so that their spectra have the widths of their resonances. The sums of sine
    waves with random phases follow Shinozuka and Deodatis (Simulation of stochastic processes by spectral
    representation, 1991).
    """
    gust = _gusts(wind, place_m)
    rng = np.random.default_rng(np.random.SeedSequence(wind.seed, spawn_key=(1, tree)))
    tree_hz = min(TREE_HZ_M / height_m, MOST_TREE_HZ)
    of_tree = _Waves.resonant(rng, tree_hz)
    sways = []
    for _ in range(branches):
        of_branch = _Waves.resonant(rng, float(rng.uniform(*BRANCH_HZ)))
        sways.append(_sway(wind, (gust, of_tree, of_branch)))
    return sways


@dataclass(frozen=True, slots=True)
class _Waves:
    """One part of the motion: frequencies (K,) in Hz, and phases (K, 2) along and across the wind."""

    frequency_hz: Array
    phase_rad: Array

    @classmethod
    def resonant(cls, rng: np.random.Generator, middle_hz: float) -> "_Waves":
        """Random waves around a natural frequency, whose spectrum is that of a damped oscillator (Lorentz)."""
        share = (np.arange(WAVES) + rng.uniform(0.2, 0.8, WAVES)) / WAVES  # of the waves with a lower frequency
        frequency_hz = middle_hz * (1 + DAMPING * np.tan(np.pi * (share - 0.5)))
        lowest_hz = (1 - 4 * DAMPING) * middle_hz
        highest_hz = (1 + 4 * DAMPING) * middle_hz
        return cls(np.clip(frequency_hz, lowest_hz, highest_hz), rng.uniform(0, 2 * np.pi, (WAVES, 2)))


def _gusts(wind: Wind, place_m: Array) -> _Waves:
    """The gusts at a place, which arrive there later the farther downwind it is."""
    rng = np.random.default_rng(np.random.SeedSequence(wind.seed, spawn_key=(0,)))
    frequency_hz = rng.uniform(*GUST_HZ, WAVES)
    phase_rad = rng.uniform(0, 2 * np.pi, (WAVES, 2))
    delay_s = float(place_m @ wind.towards) / wind.speed_mps
    return _Waves(frequency_hz, phase_rad - 2 * np.pi * frequency_hz[:, None] * delay_s)


def _sway(wind: Wind, parts: tuple[_Waves, ...]) -> Sway:
    """The sum of parts that have equal variances."""
    frequency_hz = np.concatenate([waves.frequency_hz for waves in parts])
    phase_rad = np.concatenate([waves.phase_rad for waves in parts])
    variation_rad = VARIATION * wind.deflection_rad
    amplitude_rad = variation_rad * np.sqrt(2 / len(frequency_hz)) * np.array([1.0, ACROSS])
    return Sway(
        mean_rad=np.array([wind.deflection_rad, 0.0]),
        frequency_hz=frequency_hz,
        amplitude_rad=np.broadcast_to(amplitude_rad, phase_rad.shape),
        phase_rad=phase_rad,
    )
