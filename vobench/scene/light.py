"""Lights: panels, points, spots, the sun and the sky, each brighter or darker over time."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, ClassVar, Protocol

import numpy as np
from annotated_types import MinLen

from vobench.errors import SettingError
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.scene.material import WHITE, Rgb
from vobench.scene.mesh import face_corners
from vobench.scene.panorama import PanoramaMap
from vobench.setting import Positive, Share, settings
from vobench.trajectory.nanoseconds import NS_PER_S

if TYPE_CHECKING:
    from trimesh import Trimesh

SUN_RADIUS_RAD = np.deg2rad(0.533 / 2)  # seen from the Earth


def require_increasing(times_s: Sequence[float]) -> None:
    """Raise SettingError where a time is not later than the one before it."""
    for earlier, later in pairwise(times_s):
        if later <= earlier:
            raise SettingError(f"times should increase, but {later:g} follows {earlier:g}")


class Level(Protocol):
    """A light's brightness over time, relative to its nominal one."""

    def mean(self, start_ns: int, end_ns: int) -> float:
        """The exact mean over an interval; the value where start and end are one instant."""


@dataclass(frozen=True, slots=True)
class Steady:
    """The same at all times."""

    level: float = 1.0

    def mean(self, start_ns: int, end_ns: int) -> float:
        """The level."""
        del start_ns, end_ns
        return self.level


@settings(kw_only=False)
class Flicker:
    """A lamp on alternating current is brightest twice a period: 1 + depth cos(2π 2 mains_hz t + phase)."""

    depth: Share
    mains_hz: Positive = 50.0
    phase_deg: float = 0.0

    def mean(self, start_ns: int, end_ns: int) -> float:
        """The mean: the integral of the cosine is its value at the middle of the interval times a sinc."""
        middle_s = (start_ns + end_ns) / 2 / NS_PER_S
        length_s = (end_ns - start_ns) / NS_PER_S
        phase_rad = float(np.deg2rad(self.phase_deg))
        swing = np.cos(4 * np.pi * self.mains_hz * middle_s + phase_rad)
        smoothing = np.sinc(2 * self.mains_hz * length_s)
        return float(1 + self.depth * swing * smoothing)


@dataclass(frozen=True, slots=True)
class Dimmer:
    """Straight lines between levels at increasing times; constant before the first and after the last."""

    times_s: tuple[float, ...]
    levels: tuple[float, ...]

    def mean(self, start_ns: int, end_ns: int) -> float:
        """The mean: the area of trapezoids over the interval's length."""
        start_s = start_ns / NS_PER_S
        end_s = end_ns / NS_PER_S
        inside = [t for t in self.times_s if start_s < t < end_s]
        times = np.array([start_s, *inside, end_s])
        levels = np.interp(times, self.times_s, self.levels)
        if end_ns <= start_ns:
            return float(levels[0])
        return float(np.trapezoid(levels, times) / (end_s - start_s))


@settings(kw_only=False)
class Switched:
    """A light that is on or off at first and changes at each of the increasing instants times_s."""

    times_s: Annotated[tuple[float, ...], MinLen(1)]
    on_first: bool = True

    def __post_init__(self) -> None:
        require_increasing(self.times_s)

    def mean(self, start_ns: int, end_ns: int) -> float:
        """The share of the interval in which the light is on."""
        start_s = start_ns / NS_PER_S
        end_s = end_ns / NS_PER_S
        passed = int(np.searchsorted(self.times_s, start_s, side="right"))
        is_on = self.on_first ^ bool(passed % 2)
        if end_ns <= start_ns:
            return float(is_on)
        changes = [t for t in self.times_s if start_s < t < end_s]
        lengths = np.diff(np.array([start_s, *changes, end_s]))
        first_on = 0 if is_on else 1
        return float(lengths[first_on::2].sum() / (end_s - start_s))


@dataclass(frozen=True, slots=True)
class Scaled:
    """Another function of time, `factor` times as bright."""

    of: Level
    factor: float

    def mean(self, start_ns: int, end_ns: int) -> float:
        """The other's mean, scaled."""
        return self.factor * self.of.mean(start_ns, end_ns)


STEADY = Steady()


def scaled(level: Level, factor: float) -> Level:
    """The function of time `factor` times as bright; a steady one stays so, as engines compute it once."""
    return Steady(factor * level.level) if isinstance(level, Steady) else Scaled(level, factor)


@dataclass(frozen=True, slots=True)
class AreaLight:
    """Faces that emit `power_lm` evenly from their front (Lambert).

    `material` names what they look like, where that has an emission texture.
    """

    name: str
    mesh: "Trimesh"
    power_lm: float
    level: Level = STEADY
    colour: Rgb = WHITE
    material: str = ""
    moves: ClassVar[bool] = False

    @property
    def luminance_cd_m2(self) -> float:
        """Luminance of the faces: power / (π area)."""
        area_m2 = float(areas_m2(face_corners(self.mesh)).sum())
        return self.power_lm / (np.pi * area_m2)


@dataclass(frozen=True, slots=True)
class PointLight:
    """A bulb too small to see: `power_lm` evenly in all directions, hard shadows."""

    name: str
    position_m: Array
    power_lm: float
    level: Level = STEADY
    colour: Rgb = WHITE
    moves: ClassVar[bool] = False

    def intensity_cd(self, directions: Array) -> Array:
        """Luminous intensity (...) towards unit directions (..., 3)."""
        return np.full(directions.shape[:-1], self.power_lm / (4 * np.pi))


@dataclass(frozen=True, slots=True)
class SpotLight:
    """A bulb in a reflector: even light within inner_deg of its unit `direction`, none beyond outer_deg.

    Between them the intensity falls linearly in the angle, as in Mitsuba; power_lm is all that leaves it.
    """

    name: str
    position_m: Array
    direction: Array
    power_lm: float
    inner_deg: float
    outer_deg: float
    level: Level = STEADY
    colour: Rgb = WHITE
    moves: ClassVar[bool] = False

    @property
    def peak_cd(self) -> float:
        """Intensity at the middle of the beam: the power over the integral of the fall-off."""
        theta = np.linspace(0, np.deg2rad(self.outer_deg), 4001)
        ring_sr = 2 * np.pi * np.sin(theta)
        solid_angle_sr = np.trapezoid(ring_sr * self._falloff(theta), theta)
        return float(self.power_lm / solid_angle_sr)

    def intensity_cd(self, directions: Array) -> Array:
        """Luminous intensity (...) towards unit directions (..., 3)."""
        theta = np.arccos(np.clip(directions @ self.direction, -1, 1))
        return self.peak_cd * self._falloff(theta)

    def _falloff(self, theta_rad: Array) -> Array:
        inner, outer = np.deg2rad([self.inner_deg, self.outer_deg])
        width = max(outer - inner, 1e-9)
        return np.asarray(np.clip((outer - theta_rad) / width, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Sun:
    """Direct sunlight: illuminance_lx on a surface that faces it, from a disc 0.53° wide.

    The sun is at azimuth_deg (0 along x, 90 along y) and elevation_deg at each of times_s, and
    moves evenly between; one entry each is a sun that does not move.
    """

    name: str
    illuminance_lx: float
    times_s: tuple[float, ...]
    azimuth_deg: tuple[float, ...]
    elevation_deg: tuple[float, ...]
    level: Level = STEADY
    colour: Rgb = WHITE

    @property
    def moves(self) -> bool:
        """Whether its shadows move."""
        return len(self.times_s) > 1

    def direction(self, t_ns: float) -> Array:
        """Unit vector (3,) towards the sun at an instant."""
        t_s = t_ns / NS_PER_S
        azimuth = np.deg2rad(np.interp(t_s, self.times_s, self.azimuth_deg))
        elevation = np.deg2rad(np.interp(t_s, self.times_s, self.elevation_deg))
        level = np.cos(elevation)
        return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])


# Coefficients a to e of ISO 15469:2004 (CIE S 011), types 5, 1 and 12.
SKIES = {
    "uniform": (0.0, -1.0, 0.0, -1.0, 0.0),
    "overcast": (4.0, -0.7, 0.0, -1.0, 0.0),
    "clear": (-1.0, -0.32, 10.0, -3.0, 0.45),
}


class Panorama(Protocol):
    """What surrounds a scene at infinity: buildings, trees, ground, and clouds in the sky."""

    def map_under(self, sky: "Sky") -> PanoramaMap:
        """The panorama under a sky, whose own panorama does not count."""


@dataclass(frozen=True, slots=True)
class Sky:
    """A sky that gives illuminance_lx on open level ground, and that ground seen below the horizon.

    `kind` is one of SKIES; only the clear one depends on where the sun is (unit vector (3,)). A `panorama` takes the
    place of the ground and hides the sky near the horizon.
    """

    name: str
    illuminance_lx: float
    kind: str = "overcast"
    sun_direction: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    ground_albedo: float = 0.2
    level: Level = STEADY
    colour: Rgb = WHITE
    panorama: Panorama | None = None
    moves: ClassVar[bool] = False

    def luminance_cd_m2(self, directions: Array) -> Array:
        """Luminance (...) along unit directions (..., 3), as it lights a scene."""
        if self.panorama is None:
            return self.standard_cd_m2(directions)
        return self.illuminance_lx * self.panorama.map_under(self).luminance(directions)

    def seen_cd_m2(self, directions: Array) -> Array:
        """Linear red, green and blue (..., 3) seen along unit directions (..., 3) at level 1."""
        if self.panorama is None:
            return np.asarray(self.standard_cd_m2(directions)[..., None] * np.array(self.colour))
        return self.illuminance_lx * self.panorama.map_under(self).seen(directions)

    def standard_cd_m2(self, directions: Array) -> Array:
        """Luminance (...) along unit directions (..., 3) without a panorama. Source: ISO 15469:2004, eqs 1 to 7."""
        sun_direction = map(float, self.sun_direction)
        scale = self.illuminance_lx / _level_illuminance(self.kind, *sun_direction)
        sky = _relative_luminance(self.kind, self.sun_direction, directions) * scale
        ground = self.ground_albedo * self.illuminance_lx / np.pi
        return np.where(directions[..., 2] >= 0, sky, ground)


def _relative_luminance(kind: str, sun_direction: Array, directions: Array) -> Array:
    a, b, c, d, e = SKIES[kind]
    sine = np.maximum(directions[..., 2], 1e-3)
    gradation: Array = 1 + a * np.exp(b / sine)
    if c == e == 0:
        return gradation
    chi = np.arccos(np.clip(directions @ sun_direction, -1, 1))
    towards_sun = c * (np.exp(d * chi) - np.exp(d * np.pi / 2))
    indicatrix: Array = 1 + towards_sun + e * np.cos(chi) ** 2
    return gradation * indicatrix


@lru_cache(maxsize=64)
def _level_illuminance(kind: str, *sun_direction: float) -> float:
    """Illuminance of level ground by a sky of relative luminance, by the midpoint rule over the upper hemisphere."""
    sine_squared = (np.arange(256) + 0.5) / 256
    azimuth = 2 * np.pi * (np.arange(512) + 0.5) / 512
    cosine = np.sqrt(1 - sine_squared)[:, None]
    angle = azimuth[None, :]
    up = np.broadcast_to(np.sqrt(sine_squared)[:, None], (256, 512))
    directions = np.stack([cosine * np.cos(angle), cosine * np.sin(angle), up], -1)
    luminance = _relative_luminance(kind, np.array(sun_direction), directions)
    return float(np.pi * luminance.mean())


Light = AreaLight | PointLight | SpotLight | Sun | Sky
