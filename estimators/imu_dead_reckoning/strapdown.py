"""Strapdown integration: turn the specific force into the world, add gravity, and integrate twice."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vobench.plugin import Array, se3


@dataclass(frozen=True, slots=True)
class State:
    """Where the IMU is and how fast, at an instant; odom is the IMU at the start."""

    t_ns: float
    T_odom_imu: Array
    v_mps: Array


def carried(state: State, turn_radps: Array, force_mps2: Array, *, gravity_mps2: Array, until_ns: float) -> State:
    """The state at a later instant, with angular rate and specific force even until then.

    The rotation is exact; the force is taken in the axes that the IMU has half-way.
    """
    dt = (until_ns - state.t_ns) / 1e9
    half, whole = Rotation.from_rotvec(np.outer([dt / 2, dt], turn_radps)).as_matrix()
    R_odom_imu = state.T_odom_imu[:3, :3]
    p_m = state.T_odom_imu[:3, 3]
    acceleration = R_odom_imu @ half @ force_mps2 + gravity_mps2
    p_m = p_m + state.v_mps * dt + acceleration * dt**2 / 2
    return State(until_ns, se3.transform(R_odom_imu @ whole, p_m), state.v_mps + acceleration * dt)
