"""Motions in closed form, and the textbook's way back from an IMU to the path."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.trajectory.kinematics import STANDARD_GRAVITY_MPS2, Kinematics, Motion


@dataclass(frozen=True, slots=True)
class AtRest:
    """A body that never moves, at any pose."""

    T_world_body: Array
    end_ns: int
    start_ns: int = 0
    breaks_ns: Array = field(default_factory=lambda: np.zeros(0))

    def at(self, t_ns: Array) -> Kinematics:
        still = np.zeros((len(t_ns), 3))
        return Kinematics(np.broadcast_to(self.T_world_body, (len(t_ns), 4, 4)), still, still, still, still)


@dataclass(frozen=True, slots=True)
class Shaken:
    """Six sums of sines: x, y, z in m and yaw, pitch, roll in rad; nothing about it is small or slow."""

    frequencies_hz: Array
    sizes: Array
    phases: Array
    end_ns: int
    start_ns: int = 0
    breaks_ns: Array = field(default_factory=lambda: np.zeros(0))

    def at(self, t_ns: Array) -> Kinematics:
        value, rate, bend = (self._derivative(order, np.asarray(t_ns, float) / 1e9) for order in range(3))
        (_, b, c), (da, db, dc), (dda, ddb, ddc) = (d[:, 3:].T for d in (value, rate, bend))
        T = se3.transform(Rotation.from_euler("ZYX", value[:, 3:]).as_matrix(), value[:, :3])
        sb, cb, sc, cc = np.sin(b), np.cos(b), np.sin(c), np.cos(c)
        turn = np.stack([dc - da * sb, db * cc + da * sc * cb, da * cc * cb - db * sc], -1)
        turn_rate = np.stack(
            [
                ddc - dda * sb - da * db * cb,
                ddb * cc - db * dc * sc + dda * sc * cb + da * dc * cc * cb - da * db * sc * sb,
                dda * cc * cb - da * dc * sc * cb - da * db * cc * sb - ddb * sc - db * dc * cc,
            ],
            -1,
        )
        R_body_world = np.swapaxes(T[:, :3, :3], -1, -2)
        velocity, acceleration = ((R_body_world @ d[:, :3, None])[..., 0] for d in (rate, bend))
        return Kinematics(T, velocity, turn, acceleration, turn_rate)

    def _derivative(self, order: int, t_s: Array) -> Array:
        w = 2 * np.pi * self.frequencies_hz
        waves = np.sin(w * t_s[:, None, None] + self.phases + order * np.pi / 2)
        return (self.sizes * w**order * waves).sum(-1)


def shaken(seed: int, *, lasts_s: float = 60.0) -> Shaken:
    """Up to about 3 m/s, 37 m/s² and 3 rad/s, with shakes to 5 Hz."""
    rng = np.random.default_rng(seed)
    frequencies = np.concatenate([rng.uniform(0.1, 0.5, (6, 2)), rng.uniform(1, 5, (6, 2))], 1)
    sizes = np.concatenate([rng.uniform(0.2, 0.5, (6, 2)), rng.uniform(0.01, 0.02, (6, 2))], 1)
    return Shaken(frequencies, sizes, rng.uniform(0, 2 * np.pi, (6, 4)), round(lasts_s * 1e9))


@dataclass(frozen=True, slots=True)
class Closure:
    """How far dead reckoning ends from the truth."""

    off_m: float
    off_deg: float


def closure(motion: Motion, readings: ImuReadings, rate_hz: float, T_body_imu: Array) -> Closure:
    """From the truth half a step before the first reading to half a step after the last."""
    ends_ns = readings.t_ns[[0, -1]] + np.array([-0.5, 0.5]) * 1e9 / rate_hz
    truth = motion.at(ends_ns).of_mounted(T_body_imu)
    v_mps = truth.T_world_body[0, :3, :3] @ truth.velocity_mps[0]
    T = strapdown(truth.T_world_body[0], v_mps, readings, 1 / rate_hz)
    off = se3.inverse(truth.T_world_body[1]) @ T
    return Closure(float(np.linalg.norm(off[:3, 3])), float(np.rad2deg(se3.rotation_angle(off[:3, :3]))))


def strapdown(T_world_imu: Array, v_mps: Array, readings: ImuReadings, step_s: float) -> Array:
    """The pose after the last reading, from pose and velocity before the first.

    Each reading times the step is an increment of angle and of velocity over the step around its stamp. Increments
    are corrected for coning and sculling with their neighbours, and turned exactly (after Savage 1998, parts 1 and 2).
    """
    angle, speed = readings.gyro_radps * step_s, readings.accel_mps2 * step_s
    angle_rise, speed_rise = np.gradient(angle, axis=0), np.gradient(speed, axis=0)
    turn = angle - np.cross(angle_rise, angle) / 12
    sculling = -(np.cross(angle_rise, speed) + np.cross(speed_rise, angle)) / 12
    gained = turned_on_the_way(angle, speed) + sculling
    steps = Rotation.from_rotvec(turn).as_matrix()
    R, fall = T_world_imu[:3, :3], np.array([0.0, 0.0, -STANDARD_GRAVITY_MPS2 * step_s])
    speeds_mps = [v_mps]
    for R_step, dv in zip(steps, gained, strict=True):
        speeds_mps.append(speeds_mps[-1] + R @ dv + fall)
        R = R @ R_step
    t_s = np.arange(len(speeds_mps)) * step_s
    return se3.transform(R, T_world_imu[:3, 3] + CubicSpline(t_s, speeds_mps).integrate(0, t_s[-1]))


def turned_on_the_way(angle: Array, speed: Array) -> Array:
    """The integral of a constant specific force while the body turns evenly (N, 3), in axes of the beginning."""
    size = np.linalg.norm(angle, axis=1, keepdims=True)
    safe = np.maximum(size, 1e-12)
    once = np.cross(angle, speed)
    first, second = (1 - np.cos(size)) / safe**2, (1 - np.sin(size) / safe) / safe**2
    return speed + first * once + second * np.cross(angle, once)


@dataclass(frozen=True, slots=True)
class Bed:
    """All of it as one fixture."""

    at_rest: Callable[..., AtRest] = AtRest
    shaken: Callable[..., Shaken] = shaken
    closure: Callable[..., Closure] = closure


@pytest.fixture(scope="session")
def bed() -> Bed:
    return Bed()
