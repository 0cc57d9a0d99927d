"""The whole robot as one system of seven equations: h's position, heading, two speeds and two wheel angles."""

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.rig import WheelGeometry
from vobench.geometry.se3 import Array
from vobench.robot.controller import ControllerSettings, loop_growth, references, settling_gain
from vobench.robot.integrate import over_period
from vobench.robot.limits import UNLIMITED, AccelerationLimits
from vobench.robot.pioneer import Number, Theta, accelerations, velocities, wheel_speeds
from vobench.robot.slip import SlipNow

# Beyond this (m, m/s, rad) the equations have run away: no room is so large and no wheel so fast.
BOUND = 1e6


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A robot, its controller, and how finely time is cut.

    The state is (7,): x, y of h in m, psi in rad, u in m/s, omega in rad/s, left and right rim in rad.
    Without a theta it is the ideal unicycle: within a control period its speeds run evenly to what is asked.
    Raises MotionError where the closed loop would not settle on a target.
    """

    theta: Theta | None
    controller: ControllerSettings
    wheels: WheelGeometry
    rate_hz: float
    substeps: int
    integrator: str
    limits: AccelerationLimits = UNLIMITED

    def __post_init__(self) -> None:
        k, period_s = self.controller.gain_per_s, 1 / self.rate_hz
        growth = loop_growth(k, self.theta, period_s=period_s, substeps=self.substeps, integrator=self.integrator)
        if growth > 1 - 1e-9:
            limit = settling_gain(k, self.theta, period_s=period_s, substeps=self.substeps, integrator=self.integrator)
            cure = (
                f"take a gain below {limit:.3g} or a higher rate_hz"
                if limit > 1e-6
                else "no gain does; raise rate_hz or substeps"
            )
            raise MotionError(
                f"gain_per_s {k:g} at {self.rate_hz:g} Hz with {self.integrator} in {self.substeps} sub-step(s) never "
                f"settles: errors do not shrink; {cure}"
            )

    def references(
        self, state: Array, target_m: Array, path_mps: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[float, float]:
        """u_ref in m/s and omega_ref in rad/s that the controller asks for on the way to a target (2,)."""
        x, y, psi = state[:3].tolist()
        target_x, target_y = target_m.tolist()
        return references(target_x - x, target_y - y, psi, self.controller, path_mps=path_mps)

    def speed_rates(
        self,
        u: Number,
        omega: Number,
        reference: tuple[Number, Number],
        began: tuple[Number, Number],
        delta: tuple[Number, Number],
    ) -> tuple[Number, Number]:
        """Accelerations u' and omega' of (18), within the limits, and delta; `began`: speeds as the period began."""
        if self.theta is None:
            asked = (reference[0] - began[0]) * self.rate_hz, (reference[1] - began[1]) * self.rate_hz
        else:
            asked = accelerations(u, omega, *reference, theta=self.theta)
        u_rate, omega_rate = self.limits.held(*asked)
        return u_rate + delta[0], omega_rate + delta[1]

    def rates(
        self, state: Array, reference: tuple[float, float], slip: SlipNow, began: tuple[float, float]
    ) -> tuple[float, ...]:
        """Time derivative (7) of the state: equations (18) and (19), and what the wheels do for it."""
        _, _, psi, u, omega, _, _ = state.tolist()
        pose_rates = velocities(psi, u, omega, a_m=self.controller.a_m, side_mps=slip.side_speed(u, omega))
        speed_rates = self.speed_rates(u, omega, reference, began, (slip.delta_u, slip.delta_omega))
        ground_mps = wheel_speeds(u, omega, track_m=self.wheels.track_m)
        ground_mps2 = wheel_speeds(*speed_rates, track_m=self.wheels.track_m)
        rims = slip.rim_rates(*ground_mps, radius_m=self.wheels.radius_m, driven_mps2=ground_mps2)
        return *pose_rates, *speed_rates, *rims

    def advance(
        self, state: Array, reference: tuple[float, float], slip: SlipNow, then: SlipNow | None = None
    ) -> Array:
        """States (substeps, 7) over one control period with references held; slip runs evenly to what it is `then`.

        Raises MotionError where they run away.
        """
        _, _, _, u, omega, _, _ = state.tolist()

        def steady(now: Array) -> Array:
            return np.array(self.rates(now, reference, slip, (u, omega)))

        def changing(clocked: Array) -> Array:
            now = slip.towards(then or slip, float(clocked[7]))
            return np.array((*self.rates(clocked[:7], reference, now, (u, omega)), self.rate_hz))

        rates, start = (steady, state) if then is None or then == slip else (changing, np.append(state, 0.0))
        states = over_period(
            rates, start, period_s=1 / self.rate_hz, substeps=self.substeps, integrator=self.integrator
        )[:, :7]
        if not np.abs(states).max() < BOUND:
            raise MotionError(f"the motion ran away with {self.integrator}; use rk4, more sub-steps or a lower gain")
        return states

    def contacts_ahead(self, state: Array, slip: SlipNow) -> tuple[tuple[float, float], ...]:
        """Where the left wheel, the right wheel and the axle's middle will be a period on, if nothing changes."""
        x, y, psi, u, omega = state[:5].tolist()
        period_s, a, half = 1 / self.rate_hz, self.controller.a_m, self.wheels.track_m / 2
        x_rate, y_rate, _ = velocities(psi, u, omega, a_m=a, side_mps=slip.side_speed(u, omega))
        c, s = cos(psi + omega * period_s), sin(psi + omega * period_s)
        x, y = x + x_rate * period_s - a * c, y + y_rate * period_s - a * s
        return (x - half * s, y + half * c), (x + half * s, y - half * c), (x, y)
