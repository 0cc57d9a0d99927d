"""A body carried by hand: a smooth path through poses, with a shake of six degrees of freedom added."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from vobench.errors import SettingError
from vobench.geometry import se3
from vobench.geometry.rig import Mount
from vobench.geometry.se3 import Array
from vobench.motion.spline import Poses, columns, pose_spline, turned
from vobench.motion.wheeled import Rate
from vobench.setting import NonNegative, OneOf, settings
from vobench.trajectory.kinematics import Kinematics, Motion
from vobench.trajectory.trajectory import Stamps

BAND_HZ = (0.5, 8.0)
WAVES = 16  # for each degree of freedom
# How amplitude falls with frequency: as its square, so that accelerations are equal in every octave, as for a mass.
FALL = 2.0


Sizes = tuple[NonNegative, NonNegative, NonNegative]


@settings(kw_only=False)
class ShakeSettings:
    """The shake of a hand in the axes of the body: rms along and about x, y, z over the band of 0.5 to 8 Hz.

    Each step lifts the body as a sine of amplitude bounce_m, step_hz times a second, and sways it by half as
    much to alternate sides. Both are 0 for a person who stands.
    """

    rms_m: Sizes = (0.0, 0.0, 0.0)
    rms_rad: Sizes = (0.0, 0.0, 0.0)
    step_hz: NonNegative = 0.0
    bounce_m: NonNegative = 0.0

    def __post_init__(self) -> None:
        low_hz, high_hz = BAND_HZ
        is_walking = self.bounce_m > 0
        is_in_band = 2 * low_hz <= self.step_hz <= high_hz
        if is_walking and not is_in_band:
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
        """The kinematics (K,) relative to the carrier: a shift, then turns about z, the new y and the newest x."""
        value, rate, change = self._sums(t_s)
        zero = np.zeros((len(t_s), 3))
        kinematics = Kinematics(
            T_world_body=se3.transform(np.eye(3), value[:3].T),
            velocity_mps=rate[:3].T,
            angular_velocity_radps=zero,
            acceleration_mps2=change[:3].T,
            angular_acceleration_radps2=zero,
        )
        for axis in (2, 1, 0):
            row = 3 + axis
            turn = _turned(axis, value[row], rate[row], change[row])
            kinematics = composed(kinematics, turn)
        return kinematics

    def _sums(self, t_s: Array) -> Array:
        """The six sums and their first two derivatives (3, 6, K)."""
        sums = np.zeros((3, 6, len(t_s)))
        angular_frequency = 2 * np.pi * self.frequency_hz
        waves = zip(angular_frequency.T, self.amplitude.T, self.phase_rad.T, strict=True)
        for omega, amplitude, phase in waves:  # each (6,)
            angle = omega[:, None] * t_s + phase[:, None]
            sine = amplitude[:, None] * np.sin(angle)
            cosine = amplitude[:, None] * np.cos(angle)
            rate = omega[:, None] * cosine
            change = -(omega[:, None] ** 2) * sine
            sums += [sine, rate, change]
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
        """The breaks of the carrier; a shake has none."""
        return self.carrier.breaks_ns

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """The kinematics (K,) of the carrier composed with those of the shake."""
        t_s = np.asarray(t_ns, float) / 1e9
        return composed(self.carrier.at(t_ns), self.shake.at(t_s))


@settings()
class Handheld:
    """A smooth path through poses, carried by a person whose hands shake, also while the path is at rest."""

    kind: Literal["handheld"] = "handheld"
    poses: Poses
    shake: Annotated[str, OneOf("shake", SHAKES)] = "walking"
    ease_s: NonNegative = 0.0
    rate_hz: Rate = 30.0
    mount: Mount | None = None

    def motion(self, rng: np.random.Generator) -> HandheldMotion:
        """The motion with its shake drawn from `rng`. Raises MotionError."""
        t_s, T_world_body = columns(self.poses)
        carrier = pose_spline(t_s, T_world_body, ease_s=self.ease_s)
        shake = draw_shake(SHAKES[self.shake], rng)
        return HandheldMotion(carrier, shake)


def draw_shake(settings: ShakeSettings, rng: np.random.Generator) -> Shake:
    """A random shake: a sine in each of equal steps of log frequency, of random frequency and phase."""
    rms = np.array([*settings.rms_m, *settings.rms_rad])
    low_hz, high_hz = BAND_HZ
    share_of_band = (np.arange(WAVES) + rng.random((6, WAVES))) / WAVES
    frequency_hz = low_hz * (high_hz / low_hz) ** share_of_band
    amplitude = frequency_hz**-FALL
    unscaled_rms = np.sqrt(np.sum(amplitude**2, axis=1) / 2)
    amplitude *= (rms / unscaled_rms)[:, None]
    phase_rad = 2 * np.pi * rng.random((6, WAVES))

    step_phase_rad = 2 * np.pi * rng.random()
    step_frequency_hz, step_amplitude, step_phases_rad = _steps(settings, step_phase_rad)
    return Shake(
        frequency_hz=np.column_stack([frequency_hz, step_frequency_hz]),
        amplitude=np.column_stack([amplitude, step_amplitude]),
        phase_rad=np.column_stack([phase_rad, step_phases_rad]),
    )


def composed(carrier: Kinematics, load: Kinematics) -> Kinematics:
    """The kinematics in the world of a body that moves relative to a carrier that itself moves."""
    R_carrier_load = load.T_world_body[:, :3, :3]
    arm_m = load.T_world_body[:, :3, 3]
    R_load_carrier = se3.transposed(R_carrier_load)
    angular_velocity = carrier.angular_velocity_radps

    # Velocity and acceleration of the point of the carrier at the load, in the carrier's axes.
    arm_mps = np.cross(angular_velocity, arm_m)
    euler_mps2 = np.cross(carrier.angular_acceleration_radps2, arm_m)
    centripetal_mps2 = np.cross(angular_velocity, arm_mps)
    arm_mps2 = euler_mps2 + centripetal_mps2
    relative_mps = turned(R_carrier_load, load.velocity_mps)
    coriolis_mps2 = 2 * np.cross(angular_velocity, relative_mps)

    carried_mps = turned(R_load_carrier, carrier.velocity_mps + arm_mps)
    carried_mps2 = turned(R_load_carrier, carrier.acceleration_mps2 + arm_mps2 + coriolis_mps2)
    carried_radps = turned(R_load_carrier, angular_velocity)
    carried_radps2 = turned(R_load_carrier, carrier.angular_acceleration_radps2)
    axis_change_radps2 = np.cross(carried_radps, load.angular_velocity_radps)
    return Kinematics(
        T_world_body=carrier.T_world_body @ load.T_world_body,
        velocity_mps=carried_mps + load.velocity_mps,
        angular_velocity_radps=carried_radps + load.angular_velocity_radps,
        acceleration_mps2=carried_mps2 + load.acceleration_mps2,
        angular_acceleration_radps2=carried_radps2 + axis_change_radps2 + load.angular_acceleration_radps2,
    )


def _steps(settings: ShakeSettings, phase_rad: float) -> tuple[Array, Array, Array]:
    """Frequencies, amplitudes and phases (6,) of the sines of walking: z moves once per step, y once per two."""
    frequency_hz = np.ones(6)
    amplitude = np.zeros(6)
    phases_rad = np.zeros(6)
    if settings.bounce_m:
        frequency_hz[1:3] = settings.step_hz / 2, settings.step_hz
        amplitude[1:3] = settings.bounce_m / 2, settings.bounce_m
        phases_rad[1:3] = phase_rad / 2, phase_rad
    return frequency_hz, amplitude, phases_rad


def _turned(
    axis: int,
    angle_rad: Array,
    rate: Array,
    change: Array,
) -> Kinematics:
    """The kinematics (K,) of a turn about x, y or z alone: one about z with its axes renamed."""
    direction = np.eye(3)[axis]
    order = np.roll(range(3), axis + 1)
    about_z = se3.rotation_z(angle_rad)
    R = about_z[:, order][:, :, order]
    zero = np.zeros((len(angle_rad), 3))
    return Kinematics(
        T_world_body=se3.transform(R, zero),
        velocity_mps=zero,
        angular_velocity_radps=rate[:, None] * direction,
        acceleration_mps2=zero,
        angular_acceleration_radps2=change[:, None] * direction,
    )
