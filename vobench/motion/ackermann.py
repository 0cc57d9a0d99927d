"""A car: the bicycle model with a steering that lags and has limits, kept on a planar way by feedback.

ACKERMANNS: the presets by name. ackermann: the motion.
x' = u cos psi, y' = u sin psi, psi' = u tan(delta) / L, delta' = (asked - delta) / lag, at the middle of the rear axle.
"""

from dataclasses import dataclass
from math import pi
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Lt

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.setting import Positive, settings
from vobench.trajectory.kinematics import CurveMotion, Kinematics, along, level
from vobench.trajectory.trajectory import Stamps

STEP_S = 0.01
LOOKS = 8192


@settings(kw_only=False)
class AckermannSettings:
    """A vehicle and its driver, who comes back to the way over about lookahead_m."""

    wheelbase_m: Positive
    max_steer_rad: Annotated[float, Gt(0), Lt(pi / 2)]
    max_steer_radps: Positive
    steer_lag_s: Annotated[float, Ge(STEP_S)]
    lookahead_m: Positive

    @property
    def sharpest_radius_m(self) -> float:
        """Of the rear axle's middle at full lock."""
        return float(self.wheelbase_m / np.tan(self.max_steer_rad))


# The wheelbase is that of the Volkswagen Passat of KITTI (Geiger et al. 2013); the small robot's wheelbase and limits
# are those of a 1:10 race car (the defaults of f1tenth_gym). Lags and lookaheads are engineering choices.
ACKERMANNS = {
    "kitti_like": AckermannSettings(2.71, 0.6, 0.6, steer_lag_s=0.2, lookahead_m=5.0),
    "small_robot": AckermannSettings(0.33, 0.4189, 3.2, steer_lag_s=0.1, lookahead_m=0.5),
}


class Reference(NamedTuple):
    """Where the way is at an instant, and at which speed; numbers or arrays (K,).

    bend: its curvature in 1/m when the steering will have answered; advance: 1 ahead, -1 back.
    """

    x: Array
    y: Array
    heading: Array
    speed: Array
    acceleration: Array
    turn: Array
    bend: Array
    advance: Array


@dataclass(frozen=True, slots=True)
class AckermannMotion:
    """A Motion: state (M + 1, 4) of x, y, psi, delta at nodes_s, integrated on from the last one at any instant.

    advance (M,) is whether each step goes ahead (1) or back (-1).
    """

    target: CurveMotion
    settings: AckermannSettings
    nodes_s: Array
    state: Array
    advance: Array
    start_ns: int
    end_ns: int
    breaks_ns: Array  # those of the target, and where the steering begins to answer them

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """One Runge-Kutta step from the last node."""
        t_s = np.asarray(t_ns, float) / 1e9
        k = np.clip(np.searchsorted(self.nodes_s, t_s, side="right") - 1, 0, len(self.advance) - 1)
        step_s = t_s - self.nodes_s[k]
        stages = [
            _reference(self.target, self.settings, t_s - step_s * share, self.advance[k]) for share in (1.0, 0.5, 0.0)
        ]
        state = _stepped(tuple(self.state[k].T), stages, step_s, self.settings)
        x, y, psi, delta = state
        (*_, w, delta_rate), u, u_rate = _rates(state, stages[-1], self.settings)
        w_rate = (u_rate * np.tan(delta) + u * delta_rate / np.cos(delta) ** 2) / self.settings.wheelbase_m
        return along(level(x, y, psi), speed=u, acceleration=u_rate, turn=w, turn_rate=w_rate)


def ackermann(target: CurveMotion, settings: AckermannSettings = ACKERMANNS["small_robot"]) -> AckermannMotion:
    """A car on a planar motion from its start: it steers by the way's curvature, and back to the way where it is off.

    Raises MotionError where the way turns on the spot, or sharper than the steering allows.
    """
    _check_way(target, settings)
    breaks_s = _breaks_s(target, settings)
    nodes_s = _nodes(np.concatenate([[target.law.start_s], breaks_s, [target.law.end_s]]))
    step_s = np.diff(nodes_s)
    advance = _by_progress(target, nodes_s[:-1] + step_s / 2)[0]
    stages = [
        np.array(_reference(target, settings, nodes_s[:-1] + step_s * share, advance)).T.tolist()
        for share in (0.0, 0.5, 1.0)
    ]
    first = Reference(*stages[0][0])
    limit = settings.max_steer_rad
    delta = np.clip(np.arctan(settings.wheelbase_m * first.bend), -limit, limit)
    state: tuple[Array, ...] = (first.x, first.y, first.heading, delta)
    states = [state]
    for at_stages, lasts_s in zip(zip(*stages, strict=True), step_s.tolist(), strict=True):
        state = _stepped(state, [Reference(*stage) for stage in at_stages], lasts_s, settings)
        states.append(state)
    ends_ns = target.start_ns, target.end_ns
    return AckermannMotion(target, settings, nodes_s, np.array(states, float), advance, *ends_ns, breaks_s * 1e9)


Rates = tuple[tuple[Array, ...], Array, Array]


def _rates(state: tuple[Array, ...], way: Reference, settings: AckermannSettings) -> Rates:
    """Derivatives of x, y, psi, delta; the speed u and its derivative: the model and its driver.

    After Kanayama et al. (1990), with gains by distance: at rest nothing moves.

    Off the way by (ahead, aside, turned), the driver goes faster by ahead / lookahead, and asks for a curvature
    more by aside / lookahead² + 2 turned / lookahead: critically damped on the way, whatever the speed.
    """
    x, y, psi, delta = state
    cosine = np.cos(psi)
    sine = np.sin(psi)
    turned = way.heading - psi
    ahead = cosine * (way.x - x) + sine * (way.y - y)
    aside = cosine * (way.y - y) - sine * (way.x - x)
    straight = np.cos(turned)
    slant = np.sin(turned)
    hurry = way.advance / settings.lookahead_m

    bend = way.bend + aside / settings.lookahead_m**2 + 2 * hurry * slant
    limit = settings.max_steer_rad
    limit_radps = settings.max_steer_radps
    asked = np.minimum(np.maximum(np.arctan(settings.wheelbase_m * bend), -limit), limit)
    delta_rate = np.minimum(np.maximum((asked - delta) / settings.steer_lag_s, -limit_radps), limit_radps)

    u = way.speed * (straight + hurry * ahead)
    w = u * np.tan(delta) / settings.wheelbase_m
    ahead_rate = w * aside - u + way.speed * straight
    eagerness_rate = hurry * ahead_rate - slant * (way.turn - w)
    u_rate = way.acceleration * (straight + hurry * ahead) + way.speed * eagerness_rate
    return (u * cosine, u * sine, w, delta_rate), u, u_rate


def _stepped(
    state: tuple[Array, ...], stages: list[Reference], step_s: Array | float, settings: AckermannSettings
) -> tuple[Array, ...]:
    """The state a step on, by the classical Runge-Kutta method; `stages` are at its start, middle and end."""
    start, middle, end = stages

    def after(share: float, rate: tuple[Array, ...]) -> tuple[Array, ...]:
        return tuple(value + share * step_s * change for value, change in zip(state, rate, strict=True))

    k1 = _rates(state, start, settings)[0]
    k2 = _rates(after(0.5, k1), middle, settings)[0]
    k3 = _rates(after(0.5, k2), middle, settings)[0]
    k4 = _rates(after(1.0, k3), end, settings)[0]
    mean = tuple((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True))
    return after(1.0, mean)


def _reference(target: CurveMotion, settings: AckermannSettings, t_s: Array, advance: Array) -> Reference:
    """The way at t_s (K,); its curvature is that of a steering lag later."""
    now = target.at(t_s * 1e9)
    T = now.T_world_body
    _, bend = _by_progress(target, t_s + settings.steer_lag_s)
    return Reference(
        x=T[:, 0, 3],
        y=T[:, 1, 3],
        heading=np.arctan2(T[:, 1, 0], T[:, 0, 0]),
        speed=now.velocity_mps[:, 0],
        acceleration=now.acceleration_mps2[:, 0],
        turn=now.turn_radps[:, 2],
        bend=bend,
        advance=advance,
    )


def _by_progress(target: CurveMotion, t_s: Array) -> tuple[Array, Array]:
    """Advance (K,), 1 ahead, -1 back, 0 on the spot, and curvature in 1/m (K,) of the way at t_s."""
    inside_s = np.clip(t_s, target.law.start_s, target.law.end_s)
    by_progress = target.curve.at(target.law.at(inside_s)[0])
    advance = by_progress.velocity_mps[:, 0]
    return advance, advance * by_progress.turn_radps[:, 2]


def _breaks_s(target: CurveMotion, settings: AckermannSettings) -> Array:
    breaks_s = target.breaks_ns / 1e9
    both = np.unique(np.concatenate([breaks_s, breaks_s - settings.steer_lag_s]))
    return both[(both > target.law.start_s) & (both < target.law.end_s)]


def _nodes(marks: Array) -> Array:
    """Times at most STEP_S apart, with every mark among them."""
    counts = np.ceil(np.diff(marks) / STEP_S).astype(int)
    spans = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(marks[:-1], marks[1:], counts, strict=True)]
    return np.concatenate([*spans, marks[-1:]])


def _check_way(target: CurveMotion, settings: AckermannSettings) -> None:
    s = np.concatenate([np.linspace(0, target.law.length, LOOKS), target.curve.breaks])
    by_progress = target.curve.at(s)
    if (by_progress.velocity_mps[:, 0] == 0).any():
        raise MotionError("a car cannot turn on the spot; give the way corners with a radius, or drive another robot")
    sharpest = float(np.abs(by_progress.turn_radps[:, 2]).max())
    if sharpest * settings.sharpest_radius_m > 1:
        raise MotionError(
            f"the way turns with a radius of {1 / sharpest:.3g} m, but a wheelbase of {settings.wheelbase_m:g} m and "
            f"{np.rad2deg(settings.max_steer_rad):.3g} deg of steering allow {settings.sharpest_radius_m:.3g} m or more"
        )
