"""A camera's chip: linear light to electrons to 8-bit grey values, after EMVA 1288.

mu_e        electrons that light frees in a pixel on average; the number itself is Poisson
sigma_d     read noise (electrons), Gaussian
K           system gain (grey values per electron, before the response curve)
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from vobench.errors import RenderError
from vobench.geometry.se3 import Array

Radiance = NDArray[np.float32]
Grey = NDArray[np.uint8]
FULL_SCALE_DN = 255
# Grey value of radiance 1, matt white in the scene's own light: what a careful photographer would expose for.
WHITE_DN = 200


class Response(StrEnum):
    """The curve from the chip's linear signal to the stored grey value."""

    LINEAR = "linear"
    SRGB = "srgb"  # IEC 61966-2-1; pictures made by Blender, as the paper's were, carry it


def encode(linear: Array, response: Response) -> Array:
    """Stored value in 0..1 of a linear signal in 0..1; the two pieces of sRGB meet at 0.0031308."""
    if response is Response.LINEAR:
        return linear
    power: Array = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, power)


def decode(stored: Array, response: Response) -> Array:
    """Linear signal in 0..1 of a stored value in 0..1: the inverse of `encode`."""
    if response is Response.LINEAR:
        return stored
    return np.where(stored <= 0.04045, stored / 12.92, ((np.maximum(stored, 0.04045) + 0.055) / 1.055) ** 2.4)


@dataclass(frozen=True, slots=True)
class CameraSensor:
    """A chip, its electronics and one exposure; electrons saturate at `full_well_e`.

    `exposure_gain` multiplies the exposure that puts radiance 1 at 200 grey values with unit `amplifier`;
    a shorter exposure takes photons away, a lower `amplifier` does not. `gain_spread` (PRNU, relative) and
    `offset_spread_e` (DSNU) differ from pixel to pixel but not in time.
    """

    full_well_e: float = 20_000.0
    exposure_gain: float = 1.0
    amplifier: float = 1.0
    black_dn: float = 0.0
    shot_noise: bool = False
    read_noise_e: float = 0.0
    gain_spread: float = 0.0
    offset_spread_e: float = 0.0
    response: Response = Response.SRGB

    @property
    def dn_per_electron(self) -> float:
        """K: with unit amplifier a full well is full scale."""
        return self.amplifier * FULL_SCALE_DN / self.full_well_e

    @property
    def white_e(self) -> float:
        """mu_e of radiance 1."""
        share = decode(np.array(WHITE_DN / FULL_SCALE_DN), self.response)
        return float(share) * self.full_well_e * self.exposure_gain


# `clean` measures nothing but quantisation. mt9v034 is of the class in EuRoC's cameras; its noise figures
# (full well 20 ke-, 25 e- read noise, PRNU 1 %, DSNU 10 e-) are this project's assumptions, not a data sheet's.
CAMERAS = {
    "clean": CameraSensor(),
    "mt9v034": CameraSensor(shot_noise=True, read_noise_e=25.0, gain_spread=0.01, offset_spread_e=10.0),
}


@dataclass(frozen=True, slots=True)
class NoiseStreams:
    """A generator for each kind of noise: how much light there is must not change the draws of the electronics."""

    shot: np.random.Generator
    read: np.random.Generator


@dataclass(frozen=True, slots=True)
class FixedPattern:
    """What sets one pixel of a chip apart for good: relative gain and offset in electrons, both (H, W)."""

    gain: Array
    offset_e: Array


def fixed_pattern(shape: tuple[int, int], sensor: CameraSensor, rng: np.random.Generator) -> FixedPattern:
    """Draw one chip's pattern; draw it once per camera, from a generator of its own."""
    gain = 1 + sensor.gain_spread * rng.standard_normal(shape)
    return FixedPattern(np.maximum(gain, 0.0), sensor.offset_spread_e * rng.standard_normal(shape))


def expose(
    radiance: Radiance, sensor: CameraSensor, noise: NoiseStreams, *, pattern: FixedPattern | None = None
) -> Grey:
    """One picture (H, W) of linear radiance (H, W), where 1 is matt white in the scene's own light.

    The converter is taken to be finer than the 8 bits kept, so there is one rounding, after the response.
    Raises RenderError for radiance that is negative or not a number. Source: EMVA 1288, release 3.1, section 2.
    """
    electrons = _collect(_mean_electrons(radiance, sensor, pattern), sensor, noise.shot)
    if pattern is not None:
        electrons += pattern.offset_e
    if sensor.read_noise_e > 0:
        electrons += sensor.read_noise_e * noise.read.standard_normal(electrons.shape)
    linear = (sensor.dn_per_electron * electrons + sensor.black_dn) / FULL_SCALE_DN
    stored = encode(np.clip(linear, 0.0, 1.0), sensor.response)
    return np.floor(FULL_SCALE_DN * stored + 0.5).astype(np.uint8)


def _mean_electrons(radiance: Radiance, sensor: CameraSensor, pattern: FixedPattern | None) -> Array:
    """mu_e (H, W)."""
    bad = np.argwhere(~(radiance >= 0))
    if bad.size:
        v, u = bad[0]
        raise RenderError(f"radiance must be 0 or more, got {radiance[v, u]} at pixel ({u}, {v})")
    mean_e = radiance.astype(float) * sensor.white_e
    return mean_e if pattern is None else mean_e * pattern.gain


def _collect(mean_e: Array, sensor: CameraSensor, rng: np.random.Generator) -> Array:
    """Electrons (H, W) in the wells: exact Poisson where shot noise is on, then saturation."""
    # Twice a full well is as full as infinitely much, and within what the Poisson sampler takes.
    bounded = np.minimum(mean_e, 2 * sensor.full_well_e)
    electrons = rng.poisson(bounded).astype(float) if sensor.shot_noise else bounded
    collected: Array = np.minimum(electrons, sensor.full_well_e)
    return collected
