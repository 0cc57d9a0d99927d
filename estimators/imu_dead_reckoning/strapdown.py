"""Strapdown integration: rotate the specific force into the world, add gravity, and integrate twice."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vobench.plugin import Array, se3


@dataclass(frozen=True, slots=True)
class State:
    """Pose and velocity of the IMU at an instant; odom is the IMU at the start."""

    t_ns: float
    T_odom_imu: Array
    v_mps: Array


def carried(state: State, turn_radps: Array, force_mps2: Array, *, gravity_mps2: Array, until_ns: float) -> State:
    """The state at a later instant, with angular rate and specific force constant until then.

    The rotation is exact; the force is taken in the axes that the IMU has at the middle of the interval.
    """
    dt = (until_ns - state.t_ns) / 1e9
    turns = np.outer([dt / 2, dt], turn_radps)  # rotation vectors (2, 3)
    half_turn, whole_turn = Rotation.from_rotvec(turns).as_matrix()
    R_odom_imu = state.T_odom_imu[:3, :3]
    acceleration = R_odom_imu @ half_turn @ force_mps2 + gravity_mps2
    moved_m = state.v_mps * dt
    p_m = state.T_odom_imu[:3, 3] + moved_m + acceleration * dt**2 / 2
    v_mps = state.v_mps + acceleration * dt
    return State(until_ns, se3.transform(R_odom_imu @ whole_turn, p_m), v_mps)
