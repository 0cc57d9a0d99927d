"""The differential robot of the paper: dynamics (18), kinematics (19), wheels (9)-(10)."""

from collections.abc import Callable
from dataclasses import astuple, dataclass
from math import cos, inf, isfinite, sin
from typing import TypeVar

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array

# Formulas that hold for one instant and for arrays of them.
Number = TypeVar("Number", float, Array)
# Of u and omega, of the left and the right wheel, or of x and y.
Pair = tuple[Number, Number]


@dataclass(frozen=True, slots=True)
class Theta:
    """The six parameters of (18), from a least-squares fit to a real robot (Martins et al., 2009).

    t1, t2 in s are the lags of u and omega; t3 in s m/rad^2 and t5 in s/m couple them, because the
    centre of mass is not on the axle; t4 and t6 are 1 for a robot that reaches its references.
    Raises MotionError for a value that is not finite, and for a lag that is not positive.
    """

    t1: float
    t2: float
    t3: float
    t4: float
    t5: float
    t6: float

    def __post_init__(self) -> None:
        values = astuple(self)
        is_finite = all(map(isfinite, values))
        has_lags = self.t1 > 0 and self.t2 > 0
        if not is_finite or not has_lags:
            raise MotionError(f"theta must be six finite values with positive lags t1 and t2, got {values}")

    def perturbed(self, relative_std: float, rng: np.random.Generator) -> "Theta":
        """A similar robot: each parameter times exp(relative_std N(0, 1)), so that none changes sign.

        Raises MotionError for a `relative_std` outside 0..0.5.
        """
        if not 0 <= relative_std <= 0.5:
            raise MotionError(f"theta_std is a fraction of each parameter, 0..0.5, got {relative_std}")
        factors = np.exp(relative_std * rng.standard_normal(6))
        values = np.array(astuple(self)) * factors
        return Theta(*values.tolist())


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
    u: Number,
    omega: Number,
    u_ref: Number,
    omega_ref: Number,
    *,
    theta: Theta,
    delta: Pair[float] = (0.0, 0.0),
) -> Pair[Number]:
    """Accelerations u' in m/s^2 and omega' in rad/s^2 of (18); `delta` is the paper's (delta_u, delta_omega)."""
    u_drive = theta.t3 * omega**2 - theta.t4 * u + u_ref
    omega_drive = -theta.t5 * u * omega - theta.t6 * omega + omega_ref
    u_rate = u_drive / theta.t1 + delta[0]
    omega_rate = omega_drive / theta.t2 + delta[1]
    return u_rate, omega_rate


def feed_forward(
    u: Number,
    omega: Number,
    u_rate: Number,
    omega_rate: Number,
    *,
    theta: Theta,
) -> Pair[Number]:
    """u_ref in m/s and omega_ref in rad/s for which (18) gives these accelerations."""
    u_coupling = theta.t3 * omega**2
    omega_coupling = theta.t5 * u * omega
    u_ref = theta.t1 * u_rate - u_coupling + theta.t4 * u
    omega_ref = theta.t2 * omega_rate + omega_coupling + theta.t6 * omega
    return u_ref, omega_ref


def velocities(
    psi: float,
    u: float,
    omega: float,
    *,
    a_m: float,
    side_mps: float = 0.0,
) -> tuple[float, float, float]:
    """x', y' of the point h and psi', equation (19).

    `side_mps` is the speed at which the whole robot slides to its left: the paper's
    delta_x = -side sin(psi), delta_y = side cos(psi). Sliding turns nothing, so psi' = omega stays exact.
    """
    left = a_m * omega + side_mps
    x_rate = u * cos(psi) - left * sin(psi)
    y_rate = u * sin(psi) + left * cos(psi)
    return x_rate, y_rate, omega


def wheel_speeds(u: Number, omega: Number, *, track_m: float) -> Pair[Number]:
    """Ground speeds of the left and the right wheel in m/s: (9) and (10) solved for the wheels."""
    half = omega * track_m / 2
    return u - half, u + half


@dataclass(frozen=True, slots=True)
class AccelerationLimits:
    """Largest |u'| in m/s^2 and |omega'| in rad/s^2 that (18) may give, before delta is added.

    At a limit the equations are not smooth: the integrator's order drops to 2 in that sub-step.
    Raises MotionError for a limit that is not positive.
    """

    speed_mps2: float = inf
    turn_radps2: float = inf

    def __post_init__(self) -> None:
        for name in ("speed_mps2", "turn_radps2"):
            limit = getattr(self, name)
            if not limit > 0:
                raise MotionError(f"the acceleration limit {name} must be positive, got {limit}")

    def held(self, u_rate: Number, omega_rate: Number) -> Pair[Number]:
        """Both rates, each clipped at its limit."""
        if self.speed_mps2 == self.turn_radps2 == inf:
            return u_rate, omega_rate
        return _clipped(u_rate, self.speed_mps2), _clipped(omega_rate, self.turn_radps2)


UNLIMITED = AccelerationLimits()


def _clipped(rate: Number, limit: float) -> Number:
    if isinstance(rate, np.ndarray):
        return np.clip(rate, -limit, limit)
    return max(-limit, min(limit, rate))


Rates = Callable[[Array], Array]


def euler(rates: Rates, state: Array, step_s: float) -> Array:
    """One explicit Euler step, order 1: what the paper's 33 ms script does."""
    return state + step_s * rates(state)


def rk4(rates: Rates, state: Array, step_s: float) -> Array:
    """One classical Runge-Kutta step, order 4 (Kutta, 1901)."""
    half_s = step_s / 2
    k1 = rates(state)
    k2 = rates(state + half_s * k1)
    k3 = rates(state + half_s * k2)
    k4 = rates(state + step_s * k3)
    weighted_sum = k1 + 2 * k2 + 2 * k3 + k4
    return state + step_s / 6 * weighted_sum


INTEGRATORS = {"rk4": rk4, "euler": euler}


def over_period(
    rates: Rates,
    state: Array,
    *,
    period_s: float,
    substeps: int,
    integrator: str = "rk4",
) -> Array:
    """States (substeps, n) at the end of every sub-step of one period; the last is the period's end.

    `rates` must be smooth over the period: change the inputs between periods, never inside one,
    and the method keeps its order.
    """
    step = INTEGRATORS[integrator]
    step_s = period_s / substeps
    states = np.empty((substeps, len(state)))
    for i in range(substeps):
        state = step(rates, state, step_s)
        states[i] = state
    return states
