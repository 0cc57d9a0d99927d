"""The robot's motors and their inner loops, equations (1)-(10), and the theta that results, (12)-(17).

u, omega: forward speed of the axle midpoint (m/s), yaw rate (rad/s); v_u, v_omega: mean and half difference (V).
No slip, no inductance, no limit on voltage. The equations are the paper's as corrected in docs/paper.md.
"""

from dataclasses import dataclass

from vobench.motion.pioneer import Number, Pair, Theta
from vobench.setting import NonNegative, Positive, settings


@settings()
class MotorConstants:
    """The constants that determine theta, by the paper's symbols with their SI units; defaults are not measured.

    r, d: the wheels' radius and track; m, b: mass, and how far its centre lies ahead of the axle; Iz, Ie: inertia of
    the robot about that centre, of a wheel with its motor; Ra, ka, kb: a motor's resistance, torque constant times gear
    ratio, voltage constant; Be: a wheel's friction; kPT, kDT and kPR, kDR: gains of the loops on u and on omega.
    """

    # None are published of a Pioneer 3-DX. r and d are the robot's; m and the sign of b fit it; the rest was chosen so
    # that a drive at 0.8 m/s needs about 7 V of a 12 V motor.
    r_m: Positive = 0.0975
    d_m: Positive = 0.331
    m_kg: Positive = 12.0
    b_m: float = -0.02
    Iz_kgm2: Positive = 0.35
    Ie_kgm2: NonNegative = 0.02
    Ra_ohm: Positive = 0.71
    ka_NmpA: Positive = 0.88
    kb_Vsprad: NonNegative = 0.88
    Be_Nmsprad: NonNegative = 0.01
    kPT_Vspm: Positive = 40.0
    kPR_Vsprad: Positive = 38.4172
    kDT_Vs2pm: NonNegative = 20.0
    kDR_Vs2prad: NonNegative = 3.0


@dataclass(frozen=True, slots=True)
class VoltageTheta:
    """theta^0 of (2)-(5): t1 in V s^2, t2 in V m^2 s^2, t3 in V s^2/m, t4 in V s/rad."""

    t1: float
    t2: float
    t3: float
    t4: float


def voltage_theta_of(motors: MotorConstants) -> VoltageTheta:
    """Equations (2)-(5)."""
    m = motors.m_kg
    r = motors.r_m
    d = motors.d_m
    b = motors.b_m
    Iz = motors.Iz_kgm2
    Ie = motors.Ie_kgm2
    volts_per_torque = motors.Ra_ohm / motors.ka_NmpA
    linear_inertia = m * r**2 + 2 * Ie
    inertia_about_axle = Iz + m * b**2
    turning_inertia = Ie * d**2 + 2 * r**2 * inertia_about_axle
    back_emf = motors.ka_NmpA * motors.kb_Vsprad / motors.Ra_ohm
    return VoltageTheta(
        t1=volts_per_torque * linear_inertia,
        t2=volts_per_torque * turning_inertia,
        t3=volts_per_torque * m * b,
        t4=volts_per_torque * (back_emf + motors.Be_Nmsprad),
    )


def theta_of(motors: MotorConstants) -> Theta:
    """Equations (12)-(17): theta of the robot with its loops, which (11) drives as (1) and (6) would."""
    r = motors.r_m
    d = motors.d_m
    kPT = motors.kPT_Vspm
    kPR = motors.kPR_Vsprad
    t = voltage_theta_of(motors)
    speed_damping = 2 * r * motors.kDT_Vs2pm
    turn_damping = 2 * r * d * motors.kDR_Vs2prad
    return Theta(
        t1=(t.t1 + speed_damping) / (2 * r * kPT),
        t2=(t.t2 + turn_damping) / (2 * r * d * kPR),
        t3=t.t3 * r / (2 * kPT),
        t4=t.t4 / (r * kPT) + 1,
        t5=t.t3 * r / (d * kPR),
        t6=t.t4 * d / (2 * r * kPR) + 1,
    )


def accelerations_at(
    u: Number,
    omega: Number,
    v_u: Number,
    v_omega: Number,
    *,
    motors: MotorConstants,
) -> Pair[Number]:
    """Accelerations u' in m/s^2 and omega' in rad/s^2 at these voltages: rows 4 and 5 of (1)."""
    r = motors.r_m
    d = motors.d_m
    t = voltage_theta_of(motors)
    u_coupling = t.t3 * r**2 * omega**2
    u_rate = (u_coupling - 2 * t.t4 * u + 2 * r * v_u) / t.t1
    omega_coupling = -2 * t.t3 * r**2 * u * omega
    omega_friction = t.t4 * d**2 * omega
    omega_rate = (omega_coupling - omega_friction + 2 * r * d * v_omega) / t.t2
    return u_rate, omega_rate


def loop_voltages(
    speeds: Pair[Number],
    references: Pair[Number],
    rates: Pair[Number],
    *,
    motors: MotorConstants,
) -> Pair[Number]:
    """v_u and v_omega of (6), in V: the loops differentiate the speeds and not the references."""
    u, omega = speeds
    u_ref, omega_ref = references
    u_rate, omega_rate = rates
    v_u = motors.kPT_Vspm * (u_ref - u) - motors.kDT_Vs2pm * u_rate
    v_omega = motors.kPR_Vsprad * (omega_ref - omega) - motors.kDR_Vs2prad * omega_rate
    return v_u, v_omega


def wheel_voltages(v_u: Number, v_omega: Number) -> Pair[Number]:
    """Voltages of the left and the right motor: (7) and (8) solved for them."""
    return v_u - v_omega, v_u + v_omega
