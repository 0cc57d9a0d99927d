"""The differential robot of the paper: dynamics (18), kinematics (19), wheels (9)-(10).

u, omega      forward speed of the axle midpoint B (m/s), yaw rate (rad/s, left positive)
psi           heading (rad), anticlockwise from the world's x axis, never wrapped
x, y          the controlled point h, `a` metres ahead of B
theta_1..6    identified parameters; d, r: track and wheel radius (m)
"""

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class Theta:
    """The six parameters of (18), from a least-squares fit to a real robot (Martins et al., 2009).

    t1, t2 in s are the lags of u and omega; t3 in s m/rad^2 and t5 in s/m couple them, because the
    centre of mass is not on the axle; t4 and t6 are 1 for a robot that reaches what it is asked.
    """

    t1: float
    t2: float
    t3: float
    t4: float
    t5: float
    t6: float


# Source: help text of Martins' Simulink toolbox, and Laut (2011) where named; the first as the paper prints it.
THETAS = {
    # A mixture: theta_2 belongs to the robot with the laser scanner, the other five to the one without.
    "pioneer_3dx_paper": Theta(0.5338, 0.2509, -0.0134, 0.9560, -0.0843, 1.0590),
    "pioneer_3dx": Theta(0.5338, 0.2168, -0.0134, 0.9560, -0.0843, 1.0590),
    "pioneer_3dx_laser": Theta(0.2604, 0.2509, -0.000499, 0.9965, 0.00263, 1.0768),
    "pioneer_3dx_laut": Theta(0.2183, 0.1918, -0.0050, 0.9993, -0.0279, 1.0142),
    "pioneer_2": Theta(0.1992, 0.13736, 0.001954, 0.9907, 0.01554, 0.9866),
    "pioneer_2_computer": Theta(0.3037, 0.2768, -0.0004018, 0.9835, 0.003818, 1.0725),
    "wheelchair_55kg": Theta(0.3759, 0.0188, 0.0128, 1.0027, -0.0015, 0.9808),
    "wheelchair_125kg": Theta(0.4263, 0.0289, 0.0058, 0.9883, 0.0134, 0.9931),
    "khepera_3": Theta(0.0228, 0.0568, -0.0001, 1.0030, 0.0732, 0.9981),
    "robulab_10": Theta(6.06, 0.284, 0.54, 6.48, 1.26, 1.8),
}


def accelerations(
    u: float, omega: float, u_ref: float, omega_ref: float, *, theta: Theta, delta: tuple[float, float] = (0.0, 0.0)
) -> tuple[float, float]:
    """Accelerations u' in m/s^2 and omega' in rad/s^2 of (18); `delta` is the paper's (delta_u, delta_omega)."""
    u_rate = (theta.t3 * omega**2 - theta.t4 * u + u_ref) / theta.t1 + delta[0]
    omega_rate = (-theta.t5 * u * omega - theta.t6 * omega + omega_ref) / theta.t2 + delta[1]
    return u_rate, omega_rate


def velocities(psi: float, u: float, omega: float, *, a_m: float, side_mps: float = 0.0) -> tuple[float, float, float]:
    """x', y' of the point h and psi', equation (19).

    `side_mps` is the speed at which the whole robot slides to its left: the paper's
    delta_x = -side sin(psi), delta_y = side cos(psi). Sliding turns nothing, so psi' = omega stays exact.
    """
    left = a_m * omega + side_mps
    return u * cos(psi) - left * sin(psi), u * sin(psi) + left * cos(psi), omega


def wheel_speeds(u: float, omega: float, *, track_m: float) -> tuple[float, float]:
    """Ground speeds of the left and the right wheel in m/s: (9) and (10) solved for the wheels."""
    half = omega * track_m / 2
    return u - half, u + half


def axle_poses(x_h_m: Array, y_h_m: Array, psi_rad: Array, *, a_m: float) -> Array:
    """T_world_body (N, 4, 4) of the axle midpoint B, from the point h that is `a_m` ahead of it."""
    x, y = x_h_m - a_m * np.cos(psi_rad), y_h_m - a_m * np.sin(psi_rad)
    return se3.transform(se3.rotation_z(psi_rad), np.stack([x, y, np.zeros_like(x)], -1))
