"""The whole robot as one system of seven equations: h's position, heading, two speeds and two wheel angles."""

from dataclasses import dataclass

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.rig import WheelGeometry
from vobench.geometry.se3 import Array
from vobench.robot.controller import ControllerSettings, loop_growth, references
from vobench.robot.integrate import over_period
from vobench.robot.pioneer import Theta, accelerations, velocities, wheel_speeds
from vobench.robot.slip import SlipNow

# Beyond this (m, m/s, rad) the equations have run away: no room is so large and no wheel so fast.
BOUND = 1e6


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A robot, its controller, and how finely time is cut.

    The state is (7,): x, y of h in m, psi in rad, u in m/s, omega in rad/s, left and right rim in rad.
    Raises MotionError where the closed loop would not settle on a target.
    """

    theta: Theta
    controller: ControllerSettings
    wheels: WheelGeometry
    rate_hz: float
    substeps: int
    integrator: str

    def __post_init__(self) -> None:
        k, period = self.controller.gain_per_s, 1 / self.rate_hz
        growth = loop_growth(k, self.theta, period_s=period, substeps=self.substeps, integrator=self.integrator)
        if growth > 1 - 1e-9:
            limit = min(self.theta.t4, self.theta.t6) / period
            raise MotionError(
                f"gain_per_s {k:g} at {self.rate_hz:g} Hz with {self.integrator} in {self.substeps} sub-step(s) never "
                f"settles: errors grow {growth:.4g} times a step; one Euler step needs a gain below {limit:.3g}"
            )

    def references(self, state: Array, target_m: Array) -> tuple[float, float]:
        """u_ref in m/s and omega_ref in rad/s that the controller asks for on the way to a target (2,)."""
        x, y, psi = state[:3].tolist()
        target_x, target_y = target_m.tolist()
        return references(target_x - x, target_y - y, psi, self.controller)

    def rates(self, state: Array, reference: tuple[float, float], slip: SlipNow) -> Array:
        """Time derivative (7,) of the state: equations (18) and (19), and what the wheels do for it."""
        _, _, psi, u, omega, _, _ = state.tolist()
        x_rate, y_rate, psi_rate = velocities(
            psi, u, omega, a_m=self.controller.a_m, side_mps=slip.side_speed(u, omega)
        )
        u_rate, omega_rate = accelerations(u, omega, *reference, theta=self.theta)
        left, right = wheel_speeds(u, omega, track_m=self.wheels.track_m)
        rims = slip.rim_rates(left, right, radius_m=self.wheels.radius_m)
        return np.array([x_rate, y_rate, psi_rate, u_rate, omega_rate, *rims])

    def advance(self, state: Array, reference: tuple[float, float], slip: SlipNow) -> Array:
        """States (substeps, 7) over one control period with references and slip held.

        Raises MotionError where they run away.
        """
        states = over_period(
            lambda now: self.rates(now, reference, slip),
            state,
            period_s=1 / self.rate_hz,
            substeps=self.substeps,
            integrator=self.integrator,
        )
        if not np.abs(states).max() < BOUND:
            raise MotionError(f"the motion ran away with {self.integrator}; use rk4, more sub-steps or a lower gain")
        return states
