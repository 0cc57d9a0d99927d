"""A body carried by hand: a smooth way through poses, with a shake of six degrees of freedom on top."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from vobench.errors import SettingError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.spline import Poses, columns, pose_spline, turned
from vobench.motion.wheeled import Rate
from vobench.setting import NonNegative, OneOf, settings
from vobench.trajectory.kinematics import Kinematics, Motion
from vobench.trajectory.trajectory import Stamps

BAND_HZ = (0.5, 8.0)
WAVES = 16  # for each degree of freedom
# How amplitude falls with frequency: as its square, so that every octave shakes as hard, as a mass would.
FALL = 2.0


Sizes = tuple[NonNegative, NonNegative, NonNegative]


@settings(kw_only=False)
class ShakeSettings:
    """How a hand shakes, in the axes of the body: rms along and about x, y, z over the band of 0.5 to 8 Hz.

    Each step lifts the body as a sine of amplitude bounce_m, step_hz times a second, and sways it by half as
    much to one side and the other. Both are 0 for one who stands.
    """

    rms_m: Sizes = (0.0, 0.0, 0.0)
    rms_rad: Sizes = (0.0, 0.0, 0.0)
    step_hz: NonNegative = 0.0
    bounce_m: NonNegative = 0.0

    def __post_init__(self) -> None:
        low_hz, high_hz = BAND_HZ
        if self.bounce_m and not 2 * low_hz <= self.step_hz <= high_hz:
            raise SettingError(f"should be from {2 * low_hz:g} to {high_hz:g} (got {self.step_hz:g})", "step_hz")


# Engineering choices: plausible for a person with a camera in both hands, not taken from a measurement. Only the
# pace of walking is from the literature: near 2 steps a second (MacDougall and Moore 2005).
SHAKES = {
    "none": ShakeSettings(),
    "standing": ShakeSettings((0.002, 0.002, 0.001), (0.004, 0.006, 0.006)),
    "walking": ShakeSettings((0.006, 0.008, 0.004), (0.012, 0.018, 0.018), step_hz=2.0, bounce_m=0.02),
    "running": ShakeSettings((0.015, 0.02, 0.01), (0.03, 0.045, 0.045), step_hz=2.8, bounce_m=0.04),
}


@dataclass(frozen=True, slots=True)
class Shake:
    """Six sums of sines, along and about x, y, z: each of frequencies, amplitudes and phases (6, W)."""

    frequency_hz: Array
    amplitude: Array
    phase_rad: Array

    def at(self, t_s: Array) -> Kinematics:
        """T_carrier_body (K, 4, 4): moved, then turned about z, y and x, each of these about the axis of the last."""
        value, rate, change = self._sums(t_s)
        still = np.zeros((len(t_s), 3))
        moved = Kinematics(se3.transform(np.eye(3), value[:3].T), rate[:3].T, still, change[:3].T, still)
        for axis in (2, 1, 0):
            moved = composed(moved, _turned(axis, value[3 + axis], rate[3 + axis], change[3 + axis]))
        return moved

    def _sums(self, t_s: Array) -> Array:
        """The six sums and their first two derivatives (3, 6, K)."""
        sums = np.zeros((3, 6, len(t_s)))
        for omega, amplitude, phase in zip(
            2 * np.pi * self.frequency_hz.T, self.amplitude.T, self.phase_rad.T, strict=True
        ):
            angle = omega[:, None] * t_s + phase[:, None]
            sine = amplitude[:, None] * np.sin(angle)
            cosine = amplitude[:, None] * np.cos(angle)
            sums += [sine, omega[:, None] * cosine, -(omega[:, None] ** 2) * sine]
        return sums


@dataclass(frozen=True, slots=True)
class HandheldMotion:
    """A carrier's motion with a shake in its axes."""

    carrier: Motion
    shake: Shake

    @property
    def start_ns(self) -> int:
        """The first instant."""
        return self.carrier.start_ns

    @property
    def end_ns(self) -> int:
        """The last instant."""
        return self.carrier.end_ns

    @property
    def breaks_ns(self) -> Array:
        """The carrier's: a shake has none."""
        return self.carrier.breaks_ns

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """The carrier's kinematics and the shake's, composed."""
        return composed(self.carrier.at(t_ns), self.shake.at(np.asarray(t_ns, float) / 1e9))


@settings()
class Handheld:
    """A smooth way through poses, carried by somebody whose hands shake, also where the way is at rest."""

    kind: Literal["handheld"] = "handheld"
    poses: Poses
    shake: Annotated[str, OneOf("shake", SHAKES)] = "walking"
    ease_s: NonNegative = 0.0
    rate_hz: Rate = 30.0

    def motion(self, rng: np.random.Generator) -> HandheldMotion:
        """The motion with its shake drawn from `rng`. Raises MotionError."""
        carrier = pose_spline(*columns(self.poses), ease_s=self.ease_s)
        return HandheldMotion(carrier, draw_shake(SHAKES[self.shake], rng))


def draw_shake(settings: ShakeSettings, rng: np.random.Generator) -> Shake:
    """One shake: a sine in each of equal steps of log frequency, of random frequency and phase."""
    rms = np.array([*settings.rms_m, *settings.rms_rad])
    low_hz, high_hz = BAND_HZ
    cells = (np.arange(WAVES) + rng.random((6, WAVES))) / WAVES
    frequency_hz = low_hz * (high_hz / low_hz) ** cells
    amplitude = frequency_hz**-FALL
    amplitude *= (rms / np.sqrt(np.sum(amplitude**2, axis=1) / 2))[:, None]
    phase_rad = 2 * np.pi * rng.random((6, WAVES))
    steps = _steps(settings, 2 * np.pi * rng.random())
    columns = zip((frequency_hz, amplitude, phase_rad), steps, strict=True)
    return Shake(*(np.column_stack(pair) for pair in columns))


def composed(carrier: Kinematics, load: Kinematics) -> Kinematics:
    """A body that moves in the axes of a carrier that itself moves: its kinematics in the world."""
    R_carrier_load = load.T_world_body[:, :3, :3]
    arm_m = load.T_world_body[:, :3, 3]
    w = carrier.turn_radps

    def in_load(vectors: Array) -> Array:
        return turned(np.swapaxes(R_carrier_load, -1, -2), vectors)

    swung_mps = np.cross(w, arm_m)
    swung_mps2 = np.cross(carrier.turn_rate_radps2, arm_m) + np.cross(w, swung_mps)
    coriolis_mps2 = 2 * np.cross(w, turned(R_carrier_load, load.velocity_mps))
    seen_w = in_load(w)
    return Kinematics(
        T_world_body=carrier.T_world_body @ load.T_world_body,
        velocity_mps=in_load(carrier.velocity_mps + swung_mps) + load.velocity_mps,
        turn_radps=seen_w + load.turn_radps,
        acceleration_mps2=in_load(carrier.acceleration_mps2 + swung_mps2 + coriolis_mps2) + load.acceleration_mps2,
        turn_rate_radps2=in_load(carrier.turn_rate_radps2) + np.cross(seen_w, load.turn_radps) + load.turn_rate_radps2,
    )


def _steps(settings: ShakeSettings, phase_rad: float) -> tuple[Array, Array, Array]:
    """The sines of the steps, one for each degree of freedom (6,): lifted by each, swayed by every other."""
    frequency_hz = np.ones(6)
    amplitude = np.zeros(6)
    phases_rad = np.zeros(6)
    if settings.bounce_m:
        frequency_hz[1:3] = settings.step_hz / 2, settings.step_hz
        amplitude[1:3] = settings.bounce_m / 2, settings.bounce_m
        phases_rad[1:3] = phase_rad / 2, phase_rad
    return frequency_hz, amplitude, phases_rad


def _turned(axis: int, angle_rad: Array, rate: Array, change: Array) -> Kinematics:
    """A turn (K,) about x, y or z alone: one about z with its axes renamed."""
    along = np.eye(3)[axis]
    order = np.roll(range(3), axis + 1)
    still = np.zeros((len(angle_rad), 3))
    R = se3.rotation_z(angle_rad)[:, order][:, :, order]
    return Kinematics(se3.transform(R, still), still, rate[:, None] * along, still, change[:, None] * along)
