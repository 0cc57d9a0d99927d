"""An error-state Kalman filter: pose, velocity, both biases and gravity. Source: Sola (2017).

The error (18,) is of position p, attitude theta in the IMU's own axes, velocity v, the gyroscopes' bias b, the
accelerometers' bias a, and gravity g in odom, which is the IMU at the start however that is tilted.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from vobench.plugin import Array, ImuCalibration, cross_matrix, se3

# Parts of the error.
P = slice(0, 3)
THETA = slice(3, 6)
V = slice(6, 9)
GYRO_BIAS = slice(9, 12)
ACCEL_BIAS = slice(12, 15)
GRAVITY = slice(15, 18)
POSE = slice(0, 6)
# A MEMS gyroscope starts with a bias of some degrees a second: 0.08 rad/s in EuRoC's V1_01, +- 3 deg/s typically in
# Bosch's data sheet of the BMI160; ArduPilot's EKF3 starts with 2.5 deg/s.
START_SIGMAS = np.repeat([1e-9, 1e-9, 1.0, 0.05, 0.2, 2.0], 3)  # m, rad, m/s, rad/s, m/s², m/s²
# Least densities of noise and of random walk: no real IMU is better, and an ideal one states zero.
LEAST_GYRO = 1e-5
LEAST_ACCEL = 1e-3


@dataclass(frozen=True, slots=True)
class State:
    """Pose, velocity, biases and gravity of the IMU at an instant; the covariance (18, 18) is of the error."""

    t_ns: float
    T_odom_imu: Array
    v_mps: Array
    bias_radps: Array
    bias_mps2: Array
    gravity_mps2: Array
    covariance: Array


@dataclass(frozen=True, slots=True)
class Reading:
    """One IMU reading: angular velocity (3,) in rad/s and specific force (3,) in m/s², in the IMU's axes."""

    t_ns: float
    gyro_radps: Array
    accel_mps2: Array


def started(t_ns: float, gravity_mps2: Array) -> State:
    """The state at the origin, of unknown velocity and biases and of roughly known gravity."""
    zero = np.zeros(3)
    covariance = np.diag(START_SIGMAS**2)
    return State(t_ns, np.eye(4), zero, zero, zero, gravity_mps2, covariance)


def carried(state: State, reading: Reading, until_ns: float, imu: ImuCalibration) -> State:
    """The state at a later instant, with the reading's angular velocity and specific force constant until then."""
    dt = (until_ns - state.t_ns) / 1e9
    if dt <= 0:
        return state
    R = state.T_odom_imu[:3, :3]
    rate = reading.gyro_radps - state.bias_radps
    force = reading.accel_mps2 - state.bias_mps2
    half_turn = rotation(rate * 0.5 * dt)
    whole_turn = rotation(rate * dt)

    # The force is taken in the axes that the IMU has at the middle of the interval.
    acceleration = R @ half_turn @ force + state.gravity_mps2
    p_m = state.T_odom_imu[:3, 3] + state.v_mps * dt + acceleration * dt**2 / 2
    v_mps = state.v_mps + acceleration * dt

    F = np.eye(18)
    F[P, V] = np.eye(3) * dt
    F[V, GRAVITY] = np.eye(3) * dt
    F[THETA, THETA] = whole_turn.T
    F[THETA, GYRO_BIAS] = -np.eye(3) * dt
    F[V, THETA] = -R @ half_turn @ cross_matrix(force[None])[0] * dt
    F[V, ACCEL_BIAS] = -R @ half_turn * dt
    covariance = F @ state.covariance @ F.T + np.diag(_densities(imu) ** 2 * dt)

    T_odom_imu = se3.transform(R @ whole_turn, p_m)
    return replace(state, t_ns=until_ns, T_odom_imu=T_odom_imu, v_mps=v_mps, covariance=covariance)


def _densities(imu: ImuCalibration) -> Array:
    """The square roots (18,) of the spectral densities that the error grows by."""
    gyro_noise = max(imu.gyro_noise, LEAST_GYRO)
    accel_noise = max(imu.accel_noise, LEAST_ACCEL)
    gyro_walk = max(imu.gyro_walk, LEAST_GYRO)
    accel_walk = max(imu.accel_walk, LEAST_ACCEL)
    return np.repeat([0.0, gyro_noise, accel_noise, gyro_walk, accel_walk, 0.0], 3)


def corrected(state: State, T_odom_imu: Array, noise: Array, *, gate: float) -> State | None:
    """The state after a measured pose with a covariance (6, 6) in the IMU's axes; None if the gate rejects it."""
    R = state.T_odom_imu[:3, :3]
    p_m = state.T_odom_imu[:3, 3]
    turn = cv2.Rodrigues(R.T @ T_odom_imu[:3, :3])[0].ravel()
    residual = np.r_[T_odom_imu[:3, 3] - p_m, turn]

    # The error of position has the axes of odom, that of attitude those of the IMU.
    to_odom = np.kron(np.diag([1.0, 0.0]), R) + np.kron(np.diag([0.0, 1.0]), np.eye(3))
    innovation = state.covariance[POSE, POSE] + to_odom @ noise @ to_odom.T
    if residual @ np.linalg.solve(innovation, residual) > gate:
        return None

    gain = np.linalg.solve(innovation, state.covariance[POSE, :]).T
    step = gain @ residual
    covariance = state.covariance - gain @ innovation @ gain.T
    R_after = se3.nearest_rotation(R @ rotation(step[THETA]))
    return State(
        state.t_ns,
        se3.transform(R_after, p_m + step[P]),
        state.v_mps + step[V],
        state.bias_radps + step[GYRO_BIAS],
        state.bias_mps2 + step[ACCEL_BIAS],
        state.gravity_mps2 + step[GRAVITY],
        (covariance + covariance.T) / 2,
    )


def anchored(state: State) -> State:
    """The state with its pose taken as exact: later motion is measured from there."""
    covariance = state.covariance.copy()
    covariance[POSE, :] = 0.0
    covariance[:, POSE] = 0.0
    return replace(state, covariance=covariance)


def rotation(vector: Array) -> Array:
    """The matrix (3, 3) of a rotation vector (3,) in rad."""
    return cv2.Rodrigues(vector)[0].astype(float)
