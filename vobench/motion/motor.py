"""The robot's motors and their inner loops, equations (1)-(10), and the theta that they come to, (12)-(17).

m, r, d      mass (kg), radius of the wheels (m), track (m)
b            how far the centre of mass lies ahead of the axle (m; below 0: behind it)
Iz, Ie       inertia (kg m^2) of the robot about its centre of mass, and of one wheel with its motor about its axle
Ra, ka, kb   a motor's resistance (ohm), torque constant times gear ratio (N m/A), voltage constant (V s/rad)
Be           friction of a wheel (N m s/rad)
kPT, kDT     gains of the loop on u (V s/m, V s^2/m); kPR, kDR: of the loop on omega (V s/rad, V s^2/rad)
u, omega     forward speed of the axle midpoint (m/s), yaw rate (rad/s); v_u, v_omega: mean and half difference (V)

No slip, no inductance, no limit on voltage. The equations are the paper's as docs/paper.md mends them.
"""

from dataclasses import dataclass, fields
from math import isfinite

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.motion.pioneer import Number, Theta, velocities, wheel_speeds

Pair = tuple[float, float]
POSITIVE = ("r", "d", "m", "Iz", "Ra", "ka", "kPT", "kPR")


@dataclass(frozen=True, slots=True)
class PhysicalRobot:
    """What theta is made of, in SI units; the symbols are the paper's, explained at the head of this file.

    Raises MotionError for a value that no robot has.
    """

    r: float
    d: float
    m: float
    b: float
    Iz: float
    Ie: float
    Ra: float
    ka: float
    kb: float
    Be: float
    kPT: float
    kPR: float
    kDT: float
    kDR: float

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            if not isfinite(value):
                raise MotionError(f"the robot's {name} must be finite, got {value}")
            if name in POSITIVE and value <= 0:
                raise MotionError(f"the robot's {name} must be positive, got {value}")
            if value < 0 and name != "b":  # the centre of mass may lie behind the axle
                raise MotionError(f"the robot's {name} must not be negative, got {value}")


# Representative, not measured: no motor constants of a Pioneer 3-DX are published. r and d are the robot's;
# m and the sign of b fit it; the rest was chosen so that a drive at 0.8 m/s asks a 12 V motor for about 7 V.
REPRESENTATIVE = PhysicalRobot(
    r=0.0975, d=0.331, m=12.0, b=-0.02, Iz=0.35, Ie=0.02,
    Ra=0.71, ka=0.88, kb=0.88, Be=0.01,
    kPT=40.0, kPR=38.4172, kDT=20.0, kDR=3.0,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class VoltageTheta:
    """theta^0 of (2)-(5): t1 in V s^2, t2 in V m^2 s^2, t3 in V s^2/m, t4 in V s/rad."""

    t1: float
    t2: float
    t3: float
    t4: float


def voltage_theta_of(robot: PhysicalRobot) -> VoltageTheta:
    """Equations (2)-(5)."""
    m, r, d, b, Iz, Ie, Ra, ka = robot.m, robot.r, robot.d, robot.b, robot.Iz, robot.Ie, robot.Ra, robot.ka
    return VoltageTheta(
        t1=Ra / ka * (m * r**2 + 2 * Ie),
        t2=Ra / ka * (Ie * d**2 + 2 * r**2 * (Iz + m * b**2)),
        t3=Ra / ka * m * b,
        t4=Ra / ka * (ka * robot.kb / Ra + robot.Be),
    )


def theta_of(robot: PhysicalRobot) -> Theta:
    """Equations (12)-(17): theta of the robot with its loops, which (11) drives as (1) and (6) would."""
    r, d, kPT, kPR = robot.r, robot.d, robot.kPT, robot.kPR
    t = voltage_theta_of(robot)
    return Theta(
        t1=(t.t1 + 2 * r * robot.kDT) / (2 * r * kPT),
        t2=(t.t2 + 2 * r * d * robot.kDR) / (2 * r * d * kPR),
        t3=t.t3 * r / (2 * kPT),
        t4=t.t4 / (r * kPT) + 1,
        t5=t.t3 * r / (d * kPR),
        t6=t.t4 * d / (2 * r * kPR) + 1,
    )


def accelerations_at(
    u: Number, omega: Number, v_u: Number, v_omega: Number, *, robot: PhysicalRobot, delta: Pair = (0.0, 0.0)
) -> tuple[Number, Number]:
    """Accelerations u' in m/s^2 and omega' in rad/s^2 at these voltages: rows 4 and 5 of (1), with its delta there."""
    r, d, t = robot.r, robot.d, voltage_theta_of(robot)
    u_rate = (t.t3 * r**2 * omega**2 - 2 * t.t4 * u + 2 * r * v_u) / t.t1 + delta[0]
    omega_rate = (-2 * t.t3 * r**2 * u * omega - t.t4 * d**2 * omega + 2 * r * d * v_omega) / t.t2 + delta[1]
    return u_rate, omega_rate


def loop_voltages(
    u: Number, omega: Number, u_ref: Number, omega_ref: Number, *, robot: PhysicalRobot, delta: Pair = (0.0, 0.0)
) -> tuple[Number, Number]:
    """v_u and v_omega of (6), in V.

    The loops differentiate the speeds and not the references, so u' and omega' follow from the voltages that
    they make; (1) is linear in these, and (6) is solved for them.
    """
    t, r, off = voltage_theta_of(robot), robot.r, 0.0 * u
    u_rate, omega_rate = accelerations_at(u, omega, off, off, robot=robot, delta=delta)
    u_gain, omega_gain = 2 * r / t.t1, 2 * r * robot.d / t.t2
    v_u = (robot.kPT * (u_ref - u) - robot.kDT * u_rate) / (1 + robot.kDT * u_gain)
    v_omega = (robot.kPR * (omega_ref - omega) - robot.kDR * omega_rate) / (1 + robot.kDR * omega_gain)
    return v_u, v_omega


def wheel_voltages(v_u: Number, v_omega: Number) -> tuple[Number, Number]:
    """Voltages of the left and the right motor: (7) and (8) solved for them."""
    return v_u - v_omega, v_u + v_omega


def rim_speeds(u: Number, omega: Number, *, robot: PhysicalRobot) -> tuple[Number, Number]:
    """Angular rates of the left and the right wheel in rad/s: (9) and (10) solved for them."""
    left, right = wheel_speeds(u, omega, track_m=robot.d)
    return left / robot.r, right / robot.r


def rates(state: Array, v_u: float, v_omega: float, *, robot: PhysicalRobot, a_m: float) -> Array:
    """Time derivative (7,) of (1): x, y of the point h in m, psi in rad, u, omega, left and right rim in rad."""
    psi, u, omega = state[2:5].tolist()
    moved = velocities(psi, u, omega, a_m=a_m)
    return np.array(
        [*moved, *accelerations_at(u, omega, v_u, v_omega, robot=robot), *rim_speeds(u, omega, robot=robot)]
    )


def kinetic_energy(u: float, omega: float, *, robot: PhysicalRobot) -> float:
    """Energy in J of the body, moving and turning, and of its wheels."""
    left, right = rim_speeds(u, omega, robot=robot)
    body = robot.m * (u**2 + (robot.b * omega) ** 2) + robot.Iz * omega**2
    return (body + robot.Ie * (left**2 + right**2)) / 2


def motor_power(u: float, omega: float, v_u: float, v_omega: float, *, robot: PhysicalRobot) -> float:
    """Power in W that both motors hand to their wheels."""
    pairs = zip(wheel_voltages(v_u, v_omega), rim_speeds(u, omega, robot=robot), strict=True)
    return sum(robot.ka / robot.Ra * (volts - robot.kb * rate) * rate for volts, rate in pairs)


def friction_power(u: float, omega: float, *, robot: PhysicalRobot) -> float:
    """Power in W that friction takes from both wheels."""
    return sum(robot.Be * rate**2 for rate in rim_speeds(u, omega, robot=robot))
