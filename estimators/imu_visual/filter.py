"""An error-state Kalman filter: pose, velocity, both biases and gravity. Source: Sola (2017).

The error (18,) is of position p, attitude theta in the IMU's own axes, velocity v, the gyroscopes' bias b, the
accelerometers' bias a, and gravity g in odom, which is the IMU at the start however that is tilted.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from vobench.plugin import Array, ImuCalibration, cross_matrix, se3

P, THETA, V, TURN, FORCE, GRAVITY = (slice(k, k + 3) for k in range(0, 18, 3))
POSE = slice(0, 6)
START_SIGMAS = np.repeat([1e-9, 1e-9, 1.0, 0.01, 0.2, 2.0], 3)  # m, rad, m/s, rad/s, m/s², m/s²
# densities, and walks, below which no real IMU is: an ideal one has zero
LEAST_GYRO = 1e-5
LEAST_ACCEL = 1e-3


@dataclass(frozen=True, slots=True)
class State:
    """Where the IMU is at an instant, how fast, and what it errs by; the covariance (18, 18) is of the error."""

    t_ns: float
    T_odom_imu: Array
    v_mps: Array
    bias_radps: Array
    bias_mps2: Array
    gravity_mps2: Array
    covariance: Array


def started(t_ns: float, gravity_mps2: Array) -> State:
    """At rest or not, upright or not: known is the pose alone, which is the origin."""
    return State(t_ns, np.eye(4), np.zeros(3), np.zeros(3), np.zeros(3), gravity_mps2, np.diag(START_SIGMAS**2))


def carried(state: State, turn_radps: Array, force_mps2: Array, until_ns: float, imu: ImuCalibration) -> State:
    """The state at a later instant, with angular rate and specific force even until then."""
    dt = (until_ns - state.t_ns) / 1e9
    if dt <= 0:
        return state
    R = state.T_odom_imu[:3, :3]
    rate = turn_radps - state.bias_radps
    force = force_mps2 - state.bias_mps2
    half, whole = (cv2.Rodrigues(rate * share * dt)[0].astype(float) for share in (0.5, 1.0))
    acceleration = R @ half @ force + state.gravity_mps2
    p_m = state.T_odom_imu[:3, 3] + state.v_mps * dt + acceleration * dt**2 / 2
    F = np.eye(18)
    F[P, V] = F[V, GRAVITY] = np.eye(3) * dt
    F[THETA, THETA] = whole.T
    F[THETA, TURN] = -np.eye(3) * dt
    F[V, THETA] = -R @ half @ cross_matrix(force[None])[0] * dt
    F[V, FORCE] = -R @ half * dt
    gyro = max(imu.gyro_noise, LEAST_GYRO)
    accel = max(imu.accel_noise, LEAST_ACCEL)
    densities = np.repeat([0.0, gyro, accel, max(imu.gyro_walk, LEAST_GYRO), max(imu.accel_walk, LEAST_ACCEL), 0.0], 3)
    covariance = F @ state.covariance @ F.T + np.diag(densities**2 * dt)
    pose = se3.transform(R @ whole, p_m)
    return replace(state, t_ns=until_ns, T_odom_imu=pose, v_mps=state.v_mps + acceleration * dt, covariance=covariance)


def corrected(state: State, T_odom_imu: Array, noise: Array, *, gate: float) -> State | None:
    """The state after a measured pose with a covariance (6, 6) in the IMU's axes; None where it is beyond the gate."""
    R = state.T_odom_imu[:3, :3]
    turn = cv2.Rodrigues(R.T @ T_odom_imu[:3, :3])[0].ravel()
    residual = np.r_[T_odom_imu[:3, 3] - state.T_odom_imu[:3, 3], turn]
    to_odom = np.kron(np.diag([1.0, 0.0]), R) + np.kron(np.diag([0.0, 1.0]), np.eye(3))
    innovation = state.covariance[POSE, POSE] + to_odom @ noise @ to_odom.T
    if residual @ np.linalg.solve(innovation, residual) > gate:
        return None
    gain = np.linalg.solve(innovation, state.covariance[POSE, :]).T
    step = gain @ residual
    covariance = state.covariance - gain @ innovation @ gain.T
    pose = se3.transform(R @ cv2.Rodrigues(step[THETA])[0].astype(float), state.T_odom_imu[:3, 3] + step[P])
    return State(
        state.t_ns,
        se3.transform(se3.nearest_rotation(pose[:3, :3]), pose[:3, 3]),
        state.v_mps + step[V],
        state.bias_radps + step[TURN],
        state.bias_mps2 + step[FORCE],
        state.gravity_mps2 + step[GRAVITY],
        (covariance + covariance.T) / 2,
    )


def anchored(state: State) -> State:
    """The state with its pose taken as known: what comes is measured from here."""
    covariance = state.covariance.copy()
    covariance[POSE, :] = covariance[:, POSE] = 0.0
    return replace(state, covariance=covariance)
