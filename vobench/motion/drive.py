"""A drive of the Pioneer: control, dynamics and slip together, and its exact motion."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import MinLen
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import ArrayLike

from vobench.errors import MotionError
from vobench.geometry.rig import PIONEER_WHEELS, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion.controller import CONTROLLERS, ControllerSettings, Legs, LegTime, Vehicle
from vobench.motion.pioneer import THETAS, UNLIMITED, AccelerationLimits, Theta
from vobench.motion.slip import (
    DELTAS,
    SLIPS,
    DeltaSettings,
    Disturbances,
    FloorPatch,
    Generators,
    SlipNow,
    SlipSettings,
    drawn,
    generator_of,
)
from vobench.motion.wheeled import PIONEER_KEYS, Mover, Wheeled
from vobench.setting import Positive
from vobench.trajectory.kinematics import Kinematics, level
from vobench.trajectory.trajectory import Stamps


@dataclass(frozen=True, slots=True)
class DriveMotion:
    """A Motion of the axle's middle: at rest before its start, and goes on with the last references after its end.

    It meets every recorded state; pose, velocity and acceleration are each other's derivatives to rounding.
    pieces (P, 3, 6): coefficients in the share 0..1 of each sub-step, of x and y in m and heading in rad:
    quintics that have at both its ends the velocities and accelerations of (18)-(19), sliding included.
    Euler's positions lag behind their own speeds: there acceleration swings within a step.
    """

    start_ns: int
    end_ns: int
    rate_hz: float
    substeps: int
    pieces: Array

    @property
    def breaks_ns(self) -> Array:
        """The control instants, those after the end included."""
        return np.arange(len(self.pieces) // self.substeps + 1, dtype=float) * (1e9 / self.rate_hz)

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """Where the axle's middle is and how it moves at instants (K,).

        Raises MotionError for an instant more than a second after the end, or not finite.
        """
        t_ns = np.asarray(t_ns, float)
        step_ns = 1e9 / self.rate_hz / self.substeps
        known_ns = len(self.pieces) * step_ns + 1
        if not (t_ns <= known_ns).all():
            wrong = t_ns[~(t_ns <= known_ns)][0]
            raise MotionError(f"the drive ends at {self.end_ns} ns, and is asked where it is at {wrong:.0f} ns")
        index = np.clip(np.floor(t_ns / step_ns), 0, len(self.pieces) - 1)
        share = np.maximum(t_ns / step_ns - index, 0.0)
        per_s = self.rate_hz * self.substeps
        place, speed, rate = _derivatives(self.pieces[index.astype(np.int64)], share[:, None])
        speed[t_ns < 0] = 0.0
        rate[t_ns < 0] = 0.0
        return _kinematics(place, speed * per_s, rate * per_s**2)


def _derived(
    state: Array, asked: Array, began: Array, disturbed: Array, beta_change: Array, *, vehicle: Vehicle, skid_s: float
) -> Array:
    """x, y, psi of the axle's middle, their first and their second derivatives in the world, (P, 3, 3)."""
    x_h, y_h, psi, u, omega = state.T[:5]
    u_rate, omega_rate = vehicle.speed_rates(
        u, omega, (asked[:, 0], asked[:, 1]), (began[:, 0], began[:, 1]), (disturbed[:, 1], disturbed[:, 2])
    )
    slope = np.tan(disturbed[:, 0])
    a = vehicle.controller.a_m
    slope_rate = (1 + slope**2) * beta_change * vehicle.rate_hz
    side = u * slope - skid_s * u * omega
    side_rate = u_rate * slope + u * slope_rate - skid_s * (u_rate * omega + u * omega_rate)
    c = np.cos(psi)
    s = np.sin(psi)
    ahead = u_rate - side * omega
    left = side_rate + u * omega
    place = np.stack([x_h - a * c, y_h - a * s, psi], -1)
    speed = np.stack([c * u - s * side, s * u + c * side, omega], -1)
    rate = np.stack([c * ahead - s * left, s * ahead + c * left, omega_rate], -1)
    return np.stack([place, speed, rate], 1)


def _quintics(begin: Array, end: Array, *, step_s: float) -> Array:
    """Coefficients (P, 3, 6) of the quintics with these values and two derivatives (P, 3, 3) at share 0 and 1."""
    scale = np.array([1.0, step_s, step_s**2])[:, None]
    p0, v0, a0 = np.moveaxis(begin * scale, 1, 0)
    p1, v1, a1 = np.moveaxis(end * scale, 1, 0)
    p = p1 - p0 - v0 - a0 / 2
    v = v1 - v0 - a0
    a = (a1 - a0) / 2
    return np.stack([p0, v0, a0 / 2, 10 * p - 4 * v + a, -15 * p + 7 * v - 2 * a, 6 * p - 3 * v + a], -1)


def _derivatives(c: Array, s: Array) -> Array:
    """Value, first and second derivative (3, K, 3) by s (K, 1) of the quintics c (K, 3, 6)."""
    c = np.moveaxis(c, -1, 0)
    return np.array([polyval(s, polyder(c, order), tensor=False) for order in range(3)], float)


def _kinematics(place: Array, speed: Array, rate: Array) -> Kinematics:
    """From x, y, psi and their derivatives (K, 3) in the world to body axes."""
    cos_psi = np.cos(place[:, 2])
    sin_psi = np.sin(place[:, 2])
    still = np.zeros(len(place))

    def in_body(world: Array) -> Array:
        x, y, _ = world.T
        return np.stack([cos_psi * x + sin_psi * y, cos_psi * y - sin_psi * x, still], -1)

    def upright(about_z: Array) -> Array:
        return np.stack([still, still, about_z], -1)

    return Kinematics(level(*place.T), in_body(speed), upright(speed[:, 2]), in_body(rate), upright(rate[:, 2]))


# How long a drive is known after its end, where it goes on with its last references: for shutters open there.
TAIL_S = 1.0


@dataclass(frozen=True, slots=True)
class Drive:
    """What the robot did, at N frames and M = (N - 1) substeps + 1 encoder instants.

    state (N, 5): x, y of h in m, psi in rad, u, omega; references (N, 2) hold from their frame on, and rates (N, 2) are
    u' and omega' as they begin to. `motion` is of the axle midpoint B, sliding included. reached: the frame that ended
    each leg, by entering its target or by the clock.
    rim_rad (M, 2): left, right. slip (N, 3): both sigmas and beta in rad; delta (N, 2). theta: this very robot's,
    None if ideal.
    """

    t_ns: Stamps
    state: Array
    references: Array
    rates: Array
    reached: tuple[int, ...]
    encoder_t_ns: Stamps
    rim_rad: Array
    slip: Array
    delta: Array
    theta: Theta | None
    motion: DriveMotion = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoints(Wheeled):
    """Targets that the paper's controller steers the point h through, `start_m` being h's."""

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = {
        "pioneer": PIONEER_KEYS,
        "unicycle": ("controller", "max_accel_mps2", "max_turn_accel_radps2", "integrator", "substeps"),
    }

    kind: Literal["waypoints"] = "waypoints"
    targets_m: Annotated[tuple[tuple[float, float], ...], MinLen(1)]
    tolerance_m: Positive = 0.01
    leg_s: LegTime | None = None
    max_time_s: LegTime = 60.0

    def drive(self, rngs: Generators) -> Drive:
        """From rest through the targets. Raises MotionError."""
        return drive(
            self.targets_m,
            start=self.start,
            tolerance_m=self.tolerance_m,
            max_time_s=self.max_time_s,
            leg_s=self.leg_s,
            **options(self, rngs),
        )


def options(robot: Wheeled, rngs: Generators) -> dict[str, Any]:
    """Which robot it is, and what is done to it: `_ready`'s."""
    is_ideal = robot.mover == "unicycle"
    return {
        "theta": None if is_ideal else robot.theta,
        "theta_std": 0.0 if is_ideal else robot.robot_spread,
        "controller": CONTROLLERS[robot.controller],
        "limits": robot.limits,
        "slip": SLIPS["none" if is_ideal else robot.slip],
        "delta": DELTAS["none" if is_ideal else robot.delta],
        "floor": () if is_ideal else robot.floor,
        "wheels": robot.wheels,
        "rate_hz": robot.rate_hz,
        "substeps": robot.substeps,
        "integrator": robot.integrator,
        "rngs": rngs,
    }


def drive(
    targets_m: ArrayLike,
    *,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    tolerance_m: float = 0.01,
    settle_s: float = 0.0,
    max_time_s: float = 60.0,
    leg_s: float | None = None,
    **options: Any,
) -> Drive:
    """Drive h from rest at `start` (x, y, psi) through targets (K, 2) in order, its speed carried over between them.

    A target is reached in the first frame with h within `tolerance_m` on both axes, for each within `max_time_s`;
    with `leg_s` each is held for that time whatever happens. The drive ends `settle_s` after the last.
    Raises MotionError for values that are not finite, a loop that cannot settle, a target not reached in time.
    """
    targets = _checked_rows(targets_m, "target")
    vehicle, disturbed = _ready(**options)
    legs = Legs(targets, vehicle.rate_hz, tolerance_m, max_time_s, leg_s, settle_s)

    def asked(state: Array, _: int, leg: int) -> tuple[float, float]:
        return vehicle.references(state, targets[min(leg, len(targets) - 1)])

    return _driven(asked, vehicle, disturbed(legs.longest), start, legs)


def follow(path_m: ArrayLike, path_mps: ArrayLike, *, start: tuple[float, float, float], **options: Any) -> Drive:
    """Drive h from rest at `start` (x, y, psi) after a target that moves: one row (N, 2) of place and velocity a frame.

    The path's velocity is fed forward and tanh pulls h back to it; a real robot lags where it speeds up, and
    on a straight line stays (theta_4 - 1) / gain of its speed behind.
    Raises MotionError as `drive` does, and where the path is faster than the controller's max_speed_mps.
    """
    path = _checked_rows(path_m, "path point")
    path_rate = _checked_rows(path_mps, "path velocity")
    vehicle, disturbed = _ready(**options)
    _check_path(path, path_rate, vehicle.controller, vehicle.rate_hz)

    def asked(state: Array, frame: int, _: int) -> tuple[float, float]:
        return vehicle.references(state, path[frame], tuple(path_rate[frame].tolist()))

    return _driven(asked, vehicle, disturbed(len(path)), start)


def led_by(references: ArrayLike, *, start: tuple[float, float, float], **options: Any) -> Drive:
    """Drive from rest with references (N, 2) of u in m/s and omega in rad/s, one row a frame, nothing fed back.

    This is how a robot goes backwards or turns on the spot, where no point h ahead of the axle can lead it.
    Of the controller it takes the place of h and the largest references.
    Raises MotionError as `drive` does, and where a reference is larger than the controller gives.
    """
    rows = _checked_rows(references, "reference")
    vehicle, disturbed = _ready(**options)
    _check_references(rows, vehicle.controller, vehicle.rate_hz)

    def asked(_: Array, frame: int, __: int) -> tuple[float, float]:
        return tuple(rows[frame].tolist())

    return _driven(asked, vehicle, disturbed(len(rows)), start)


def _ready(
    *,
    theta: Theta | None = THETAS["pioneer_3dx"],
    theta_std: float = 0.0,
    controller: ControllerSettings = CONTROLLERS["smooth"],
    limits: AccelerationLimits = UNLIMITED,
    slip: SlipSettings = SLIPS["none"],
    delta: DeltaSettings = DELTAS["none"],
    floor: Sequence[FloorPatch] = (),
    wheels: WheelGeometry = PIONEER_WHEELS,
    rate_hz: float = 30.0,
    substeps: int = 4,
    integrator: str = "rk4",
    rngs: Generators | None = None,
) -> tuple[Vehicle, Callable[[int], Disturbances]]:
    """The robot, and what disturbs it in so many frames: the options of all drives.

    Without a theta (None) the robot is an ideal unicycle; `theta_std` perturbs it. rngs: DISTURBANCE_STREAMS.
    """
    if theta_std:
        if theta is None:
            raise MotionError("an ideal unicycle has no theta that theta_std could perturb")
        theta = theta.perturbed(theta_std, generator_of(rngs, "theta"))
    vehicle = Vehicle(theta, controller, wheels, rate_hz, substeps, integrator, limits)
    return vehicle, lambda frames: drawn(frames, slip, delta, floor, step_s=1 / rate_hz, rngs=rngs)


def _driven(
    asked: Callable[[Array, int, int], tuple[float, float]],
    vehicle: Vehicle,
    disturbances: Disturbances,
    start: tuple[float, float, float],
    legs: Legs | None = None,
) -> Drive:
    """The robot on its way, frame by frame, and a little on; `asked` takes its state, the frame and the leg."""
    if np.shape(start) != (3,) or not np.isfinite(start).all():
        raise MotionError(f"the start (x, y, psi) must be three finite values, got {start}")
    state = np.array([*start, 0.0, 0.0, 0.0, 0.0])
    slips = [disturbances.at(0, vehicle.contacts_ahead(state, SlipNow()))]
    fine = [state[None]]
    references = []
    ends = list[int]()
    places = [state[:2]]
    for frame in range(len(disturbances.rows)):
        ends += legs.ended(places, ends) if legs else []
        references.append(asked(state, frame, len(ends)))
        if frame + 1 == len(disturbances.rows) or (legs and legs.are_over(frame, ends)):
            break
        slips.append(disturbances.at(frame + 1, vehicle.contacts_ahead(state, slips[-1])))
        fine.append(vehicle.advance(state, references[-1], *slips[-2:]))
        state = fine[-1][-1]
        places.append(state[:2])
    return _record(fine, np.array(references), tuple(ends), slips, vehicle=vehicle)


def _record(
    periods: list[Array], asked: Array, ends: tuple[int, ...], slips: list[SlipNow], *, vehicle: Vehicle
) -> Drive:
    """The drive from the states (1 or substeps, 7) of its periods, references (N, 2) and slip at N frames."""
    fine = np.concatenate(periods)
    disturbed = np.array(slips)
    state = fine[:: vehicle.substeps, :5]
    speeds = (state[:, 3], state[:, 4])
    u, omega = speeds
    u_ref, omega_ref = asked.T
    delta_u, delta_omega = disturbed[:, 5:].T
    return Drive(
        t_ns=_stamps(len(slips), vehicle.rate_hz, 1),
        state=state,
        references=asked,
        rates=np.stack(vehicle.speed_rates(u, omega, (u_ref, omega_ref), speeds, (delta_u, delta_omega)), -1),
        reached=ends,
        encoder_t_ns=_stamps(len(fine), vehicle.rate_hz, vehicle.substeps),
        rim_rad=fine[:, 5:],
        slip=disturbed[:, :3],
        delta=disturbed[:, 5:],
        theta=vehicle.theta,
        motion=_with_tail(fine, asked, slips, vehicle),
    )


def _with_tail(fine: Array, asked: Array, slips: list[SlipNow], vehicle: Vehicle) -> DriveMotion:
    """The motion of the drive through states (P + 1, 7), its last references and slip held for a while after it."""
    tail = [fine]
    last = slips[-1]
    more = ceil(TAIL_S * vehicle.rate_hz)
    for _ in range(more):
        tail.append(vehicle.advance(tail[-1][-1], tuple(asked[-1].tolist()), last))
    states = np.concatenate(tail)
    held = np.concatenate([asked, np.repeat(asked[-1:], more - 1, 0)])
    disturbed = np.array([*slips, *[last] * more])[:, [2, 5, 6]]  # beta, delta_u and delta_omega at periods' ends
    period, step = np.divmod(np.arange(len(states) - 1), vehicle.substeps)
    began = states[period * vehicle.substeps, 3:5]
    change = disturbed[period + 1] - disturbed[period]

    def seen(state: Array, share: Array) -> Array:
        disturbance = disturbed[period] + share[:, None] * change
        return _derived(state, held[period], began, disturbance, change[:, 0], vehicle=vehicle, skid_s=last.skid_s)

    ends = seen(states[:-1], step / vehicle.substeps), seen(states[1:], (step + 1) / vehicle.substeps)
    pieces = _quintics(*ends, step_s=1 / vehicle.rate_hz / vehicle.substeps)
    return DriveMotion(0, round((len(asked) - 1) * 1e9 / vehicle.rate_hz), vehicle.rate_hz, vehicle.substeps, pieces)


def _stamps(count: int, rate_hz: float, substeps: int) -> Stamps:
    """Stamps index / (rate substeps), divided in the order that lets every `substeps`-th be exactly a frame's."""
    return np.rint(np.arange(count) * 1e9 / substeps / rate_hz).astype(np.int64)


def _checked_rows(rows: ArrayLike, what: str) -> Array:
    pairs = np.asarray(rows, float)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not len(pairs):
        raise MotionError(f"a drive needs one or more {what}s of two coordinates (K, 2), got shape {pairs.shape}")
    if not np.isfinite(pairs).all():
        bad = int(np.flatnonzero(~np.isfinite(pairs).all(1))[0])
        raise MotionError(f"{what} {bad + 1} is ({pairs[bad, 0]}, {pairs[bad, 1]}); both coordinates must be finite")
    return pairs


def _check_path(path_m: Array, path_mps: Array, controller: ControllerSettings, rate_hz: float) -> None:
    if path_m.shape != path_mps.shape:
        raise MotionError(
            f"a path needs a velocity for every point, got {len(path_m)} points and {len(path_mps)} velocities"
        )
    speed = np.hypot(*path_mps.T)
    if speed.max() > controller.max_speed_mps:
        raise MotionError(
            f"the path of h moves at {speed.max():.3g} m/s after {speed.argmax() / rate_hz:.1f} s, "
            f"and the controller gives {controller.max_speed_mps:g} m/s at most"
        )


def _check_references(asked: Array, controller: ControllerSettings, rate_hz: float) -> None:
    mosts = (controller.max_speed_mps, "m/s"), (controller.max_turn_radps, "rad/s")
    for sizes, (most, unit) in zip(np.abs(asked).T, mosts, strict=True):
        if sizes.max() > most:
            raise MotionError(
                f"the robot would be asked for {sizes.max():.3g} {unit} after {sizes.argmax() / rate_hz:.1f} s, "
                f"and {most:g} {unit} is the most"
            )
