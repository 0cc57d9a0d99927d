"""An error-state Kalman filter: pose, velocity, the gyroscopes' bias and gravity. Source: Sola (2017).

The error (15,) is of position and velocity in odom, of attitude in the IMU's own axes, of bias and of gravity:
p, theta, v, b, g. Gravity is three unknowns, so that a tilted start and the accelerometers' bias are in it.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from vobench.estimator.pose import cross_matrix
from vobench.geometry import se3
from vobench.geometry.rig import ImuCalibration
from vobench.geometry.se3 import Array

P, THETA, V, BIAS, GRAVITY = (slice(k, k + 3) for k in range(0, 15, 3))
POSE = slice(0, 6)
START_SIGMAS = np.repeat([1e-9, 1e-9, 1.0, 0.01, 2.0], 3)  # m, rad, m/s, rad/s, m/s²
GRAVITY_WALK = 0.02  # m/s² per √s: the accelerometers' bias turns with the body
LEAST_GYRO, LEAST_ACCEL = 1e-5, 1e-4  # densities below which no real IMU is: an ideal one has zero


@dataclass(frozen=True, slots=True)
class State:
    """Where the IMU is at an instant, how fast, and what it errs by; the covariance (15, 15) is of the error."""

    t_ns: float
    T_odom_imu: Array
    v_mps: Array
    bias_radps: Array
    gravity_mps2: Array
    covariance: Array


def started(t_ns: float, gravity_mps2: Array) -> State:
    """At rest or not, upright or not: known is the pose alone, which is the origin."""
    return State(t_ns, np.eye(4), np.zeros(3), np.zeros(3), gravity_mps2, np.diag(START_SIGMAS**2))


def carried(state: State, turn_radps: Array, force_mps2: Array, until_ns: float, imu: ImuCalibration) -> State:
    """The state at a later instant, with angular rate and specific force even until then."""
    dt = (until_ns - state.t_ns) / 1e9
    if dt <= 0:
        return state
    R = state.T_odom_imu[:3, :3]
    rate = turn_radps - state.bias_radps
    half, whole = (cv2.Rodrigues(rate * share * dt)[0].astype(float) for share in (0.5, 1.0))
    acceleration = R @ half @ force_mps2 + state.gravity_mps2
    p_m = state.T_odom_imu[:3, 3] + state.v_mps * dt + acceleration * dt**2 / 2
    F = np.eye(15)
    F[P, V] = F[V, GRAVITY] = np.eye(3) * dt
    F[THETA, THETA], F[THETA, BIAS] = whole.T, -np.eye(3) * dt
    F[V, THETA] = -R @ half @ cross_matrix(force_mps2[None])[0] * dt
    gyro, accel = max(imu.gyro_noise, LEAST_GYRO), max(imu.accel_noise, LEAST_ACCEL)
    densities = np.repeat([0.0, gyro, accel, max(imu.gyro_walk, LEAST_GYRO), GRAVITY_WALK], 3)
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
        state.bias_radps + step[BIAS],
        state.gravity_mps2 + step[GRAVITY],
        (covariance + covariance.T) / 2,
    )


def anchored(state: State) -> State:
    """The state with its pose taken as known: what comes is measured from here."""
    covariance = state.covariance.copy()
    covariance[POSE, :] = covariance[:, POSE] = 0.0
    return replace(state, covariance=covariance)
