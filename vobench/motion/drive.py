"""A drive of the Pioneer: control, dynamics and slip combined, and its exact motion."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import MaxLen, MinLen
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import ArrayLike

from vobench.errors import MotionError
from vobench.geometry.rig import PIONEER_WHEELS, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion.controller import CONTROLLERS, MOST_FRAMES, ControllerSettings, Legs, LegTime, Vehicle
from vobench.motion.disturbance import (
    DELTAS,
    DeltaSettings,
    Disturbance,
    Disturbances,
    Generators,
    generator_of,
    random_disturbances,
)
from vobench.motion.floor_patch import FloorPatch
from vobench.motion.pioneer import THETAS, UNLIMITED, AccelerationLimits, Theta
from vobench.motion.slip import SLIPS, SlipSettings
from vobench.motion.wheeled import PIONEER_KEYS, Mover, Wheeled
from vobench.setting import MOST_POINTS, Positive
from vobench.trajectory.kinematics import Kinematics, level
from vobench.trajectory.trajectory import Stamps


@dataclass(frozen=True, slots=True)
class DriveMotion:
    """A Motion of the axle's middle: at rest before its start, continued with the last references after its end.

    It passes through every recorded state; pose, velocity and acceleration are each other's derivatives to rounding.
    pieces (P, 3, 6): coefficients in the share 0..1 of each sub-step, of x and y in m and heading in rad:
    quintics that have at both its ends the velocities and accelerations of (18)-(19), sliding included.
    Euler's positions lag behind their own speeds, so with it acceleration oscillates within a step.
    """

    start_ns: int
    end_ns: int
    rate_hz: float
    substeps: int
    pieces: Array

    @property
    def breaks_ns(self) -> Array:
        """The control instants, those after the end included."""
        periods = len(self.pieces) // self.substeps
        period_ns = 1e9 / self.rate_hz
        return np.arange(periods + 1, dtype=float) * period_ns

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """The kinematics (K,) of the axle's middle at instants (K,).

        Raises MotionError for an instant more than a second after the end, or not finite.
        """
        t_ns = np.asarray(t_ns, float)
        step_ns = 1e9 / self.rate_hz / self.substeps
        known_ns = len(self.pieces) * step_ns + 1
        is_known = t_ns <= known_ns  # false for NaN
        if not is_known.all():
            unknown_ns = t_ns[~is_known][0]
            raise MotionError(f"the drive ends at {self.end_ns} ns, but its position at {unknown_ns:.0f} ns is needed")

        piece = np.clip(np.floor(t_ns / step_ns), 0, len(self.pieces) - 1)
        share = np.maximum(t_ns / step_ns - piece, 0.0)
        coefficients = self.pieces[piece.astype(np.int64)]
        position, velocity, acceleration = _derivatives(coefficients, share[:, None])
        velocity[t_ns < 0] = 0.0
        acceleration[t_ns < 0] = 0.0
        per_s = self.rate_hz * self.substeps
        return _kinematics(position, velocity * per_s, acceleration * per_s**2)


def _boundary_values(
    state: Array,
    reference: Array,
    began: Array,
    disturbance: Array,
    beta_change: Array,
    *,
    vehicle: Vehicle,
    skid_s: float,
) -> Array:
    """x, y, psi of the axle's middle, their first and their second derivatives in the world, (P, 3, 3).

    state (P, 7); references, and the speeds as the period began, (P, 2); disturbance (P, 3): beta, delta_u and
    delta_omega; beta_change (P,): how much beta changes in the period.
    """
    x_h, y_h, psi, u, omega = state.T[:5]
    beta, delta_u, delta_omega = disturbance.T
    u_ref, omega_ref = reference.T
    u_began, omega_began = began.T
    u_rate, omega_rate = vehicle.speed_rates(
        u,
        omega,
        (u_ref, omega_ref),
        (u_began, omega_began),
        (delta_u, delta_omega),
    )

    # The speed of sliding to the left, and its derivative.
    slope = np.tan(beta)
    slope_rate = (1 + slope**2) * beta_change * vehicle.rate_hz
    side = u * slope - skid_s * u * omega
    skid_rate = skid_s * (u_rate * omega + u * omega_rate)
    side_rate = u_rate * slope + u * slope_rate - skid_rate

    a_m = vehicle.controller.a_m
    c = np.cos(psi)
    s = np.sin(psi)
    ahead = u_rate - side * omega
    left = side_rate + u * omega
    x = x_h - a_m * c
    y = y_h - a_m * s
    x_rate = c * u - s * side
    y_rate = s * u + c * side
    x_acceleration = c * ahead - s * left
    y_acceleration = s * ahead + c * left
    position = np.stack([x, y, psi], -1)
    velocity = np.stack([x_rate, y_rate, omega], -1)
    acceleration = np.stack([x_acceleration, y_acceleration, omega_rate], -1)
    return np.stack([position, velocity, acceleration], 1)


def _quintics(begin: Array, end: Array, *, step_s: float) -> Array:
    """Coefficients (P, 3, 6) of the quintics with these values and two derivatives (P, 3, 3) at share 0 and 1."""
    scale = np.array([1.0, step_s, step_s**2])[:, None]  # derivatives by the share of the step
    p0, v0, a0 = np.moveaxis(begin * scale, 1, 0)
    p1, v1, a1 = np.moveaxis(end * scale, 1, 0)

    # What the quadratic from the start misses at the end.
    p = p1 - p0 - v0 - a0 / 2
    v = v1 - v0 - a0
    a = (a1 - a0) / 2
    cubic = 10 * p - 4 * v + a
    quartic = -15 * p + 7 * v - 2 * a
    quintic = 6 * p - 3 * v + a
    return np.stack([p0, v0, a0 / 2, cubic, quartic, quintic], -1)


def _derivatives(coefficients: Array, share: Array) -> Array:
    """Value, first and second derivative (3, K, 3) at shares (K, 1) of the quintics (K, 3, 6)."""
    powers_first = np.moveaxis(coefficients, -1, 0)
    derivatives = []
    for order in range(3):
        polynomial = polyder(powers_first, order)
        derivatives.append(polyval(share, polynomial, tensor=False))
    return np.array(derivatives, float)


def _kinematics(position: Array, velocity: Array, acceleration: Array) -> Kinematics:
    """The kinematics in body axes from x, y, psi and their derivatives (K, 3) in the world."""
    heading = position[:, 2]
    cosine = np.cos(heading)
    sine = np.sin(heading)
    zero = np.zeros(len(position))

    def in_body(world: Array) -> Array:
        x, y, _ = world.T
        ahead = cosine * x + sine * y
        left = cosine * y - sine * x
        return np.stack([ahead, left, zero], -1)

    def about_z(rate: Array) -> Array:
        return np.stack([zero, zero, rate], -1)

    return Kinematics(
        T_world_body=level(*position.T),
        velocity_mps=in_body(velocity),
        angular_velocity_radps=about_z(velocity[:, 2]),
        acceleration_mps2=in_body(acceleration),
        angular_acceleration_radps2=about_z(acceleration[:, 2]),
    )


# How long a drive is known after its end, where it continues with its last references: for shutters open there.
TAIL_S = 1.0


Start = tuple[float, float, float]
References = Callable[[Array, int, int], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Drive:
    """The recorded drive of a robot, at N frames and M = (N - 1) substeps + 1 encoder instants.

    state (N, 5): x, y of h in m, psi in rad, u, omega. references (N, 2) apply from their frame on; rates (N, 2) are
    u' and omega' at that instant. `motion` is of the axle midpoint B, sliding included. reached: the frame that ended
    each leg, by entering its target or by the clock. rim_rad (M, 2): left, right. slip (N, 3): both sigmas and beta in
    rad. delta (N, 2). theta: that of this robot after perturbation, None if ideal.
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
    """Targets that the paper's controller steers the point h through; `start_m` is the start of h."""

    mover_keys: ClassVar[Mapping[Mover, tuple[str, ...]]] = {
        "pioneer": PIONEER_KEYS,
        "unicycle": ("controller", "max_accel_mps2", "max_turn_accel_radps2", "integrator", "substeps"),
    }

    kind: Literal["waypoints"] = "waypoints"
    targets_m: Annotated[tuple[tuple[float, float], ...], MinLen(1), MaxLen(MOST_POINTS)]
    tolerance_m: Positive = 0.01
    leg_s: LegTime | None = None
    max_time_s: LegTime = 60.0

    def drive(self, rngs: Generators) -> Drive:
        """The drive from rest through the targets. Raises MotionError."""
        return drive(
            self.targets_m,
            start=self.start,
            tolerance_m=self.tolerance_m,
            max_time_s=self.max_time_s,
            leg_s=self.leg_s,
            **options(self, rngs),
        )


def options(robot: Wheeled, rngs: Generators) -> dict[str, Any]:
    """The keyword arguments of drives for a robot and its disturbances: those of `_ready`."""
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
    start: Start = (0.0, 0.0, 0.0),
    tolerance_m: float = 0.01,
    settle_s: float = 0.0,
    max_time_s: float = 60.0,
    leg_s: float | None = None,
    **options: Any,
) -> Drive:
    """Drive h from rest at `start` (x, y, psi) through targets (K, 2) in order, without stopping between them.

    A target is reached in the first frame with h within `tolerance_m` on both axes, for each within `max_time_s`;
    with `leg_s` each is held for exactly that time. The drive ends `settle_s` after the last.
    Raises MotionError for values that are not finite, a loop that cannot settle, a target not reached in time.
    """
    targets = _checked_rows(targets_m, "target")
    vehicle, disturbances = _ready(**options)
    legs = Legs(targets, vehicle.rate_hz, tolerance_m, max_time_s, leg_s, settle_s)

    def reference(state: Array, _frame: int, leg: int) -> tuple[float, float]:
        target = targets[min(leg, len(targets) - 1)]
        return vehicle.references(state, target)

    return _driven(reference, vehicle, disturbances(legs.max_frames), start, legs)


def follow(
    path_m: ArrayLike,
    path_mps: ArrayLike,
    *,
    start: Start,
    **options: Any,
) -> Drive:
    """Drive h from rest at `start` (x, y, psi) after a moving target: one row (N, 2) of position and velocity a frame.

    The path's velocity is fed forward and tanh pulls h back to it; a real robot lags while it accelerates, and
    on a straight line stays (theta_4 - 1) / gain of its speed behind.
    Raises MotionError as `drive` does, and if the path is faster than the controller's max_speed_mps.
    """
    path = _checked_rows(path_m, "path point")
    path_rate = _checked_rows(path_mps, "path velocity")
    vehicle, disturbances = _ready(**options)
    _check_path(path, path_rate, vehicle.controller, vehicle.rate_hz)

    def reference(state: Array, frame: int, _leg: int) -> tuple[float, float]:
        velocity_mps = tuple(path_rate[frame].tolist())
        return vehicle.references(state, path[frame], velocity_mps)

    return _driven(reference, vehicle, disturbances(len(path)), start)


def led_by(references: ArrayLike, *, start: Start, **options: Any) -> Drive:
    """Drive from rest with references (N, 2) of u in m/s and omega in rad/s, one row a frame, without feedback.

    This is how a robot drives backwards or turns on the spot, where no point h ahead of the axle can lead it.
    Of the controller it uses the position of h and the largest references.
    Raises MotionError as `drive` does, and for a reference larger than the controller's limits.
    """
    rows = _checked_rows(references, "reference")
    vehicle, disturbances = _ready(**options)
    _check_references(rows, vehicle.controller, vehicle.rate_hz)

    def reference(_state: Array, frame: int, _leg: int) -> tuple[float, float]:
        return tuple(rows[frame].tolist())

    return _driven(reference, vehicle, disturbances(len(rows)), start)


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
    """The robot, and its disturbances as a function of the number of frames, from the options of all drives.

    Without a theta (None) the robot is an ideal unicycle; `theta_std` perturbs it. rngs: DISTURBANCE_STREAMS.
    """
    if theta_std:
        if theta is None:
            raise MotionError("an ideal unicycle has no theta that theta_std could perturb")
        theta = theta.perturbed(theta_std, generator_of(rngs, "theta"))
    vehicle = Vehicle(theta, controller, wheels, rate_hz, substeps, integrator, limits)

    def disturbances(frames: int) -> Disturbances:
        return random_disturbances(frames, slip, delta, floor, step_s=1 / rate_hz, rngs=rngs)

    return vehicle, disturbances


def _driven(
    reference: References,
    vehicle: Vehicle,
    disturbances: Disturbances,
    start: Start,
    legs: Legs | None = None,
) -> Drive:
    """The drive of a robot, frame by frame; `reference` takes its state, the frame and the leg."""
    if np.shape(start) != (3,) or not np.isfinite(start).all():
        raise MotionError(f"the start (x, y, psi) must be three finite values, got {start}")
    state = np.array([*start, 0.0, 0.0, 0.0, 0.0])
    first_contacts = vehicle.contacts_ahead(state, Disturbance())
    slips = [disturbances.at(0, first_contacts)]
    periods = [state[None]]
    references = []
    positions_m = [state[:2]]
    ends = list[int]()
    last_frame = len(disturbances.rows) - 1
    for frame in range(last_frame + 1):
        if frame > MOST_FRAMES:
            raise MotionError(f"the drive takes more than {MOST_FRAMES} frames; at most these are possible")
        if legs:
            ends += legs.newly_ended(positions_m, ends)
        references.append(reference(state, frame, len(ends)))
        if frame == last_frame or (legs and legs.are_over(frame, ends)):
            break

        # Slip at the next frame depends on the floor there, which the robot is about to reach.
        contacts = vehicle.contacts_ahead(state, slips[-1])
        slips.append(disturbances.at(frame + 1, contacts))
        slip_now, slip_then = slips[-2:]
        periods.append(vehicle.advance(state, references[-1], slip_now, slip_then))
        state = periods[-1][-1]
        positions_m.append(state[:2])
    return _record(periods, np.array(references), tuple(ends), slips, vehicle=vehicle)


def _record(
    periods: list[Array],
    references: Array,
    ends: tuple[int, ...],
    slips: list[Disturbance],
    *,
    vehicle: Vehicle,
) -> Drive:
    """The drive from the states (1 or substeps, 7) of its periods, references (N, 2) and slip at N frames."""
    states = np.concatenate(periods)  # (M, 7), at the encoder's instants
    disturbed = np.array(slips)
    frame_states = states[:: vehicle.substeps, :5]
    u = frame_states[:, 3]
    omega = frame_states[:, 4]
    u_ref, omega_ref = references.T
    delta = disturbed[:, 5:]
    delta_u, delta_omega = delta.T
    rates = vehicle.speed_rates(u, omega, (u_ref, omega_ref), (u, omega), (delta_u, delta_omega))
    return Drive(
        t_ns=_stamps(len(slips), vehicle.rate_hz, 1),
        state=frame_states,
        references=references,
        rates=np.stack(rates, -1),
        reached=ends,
        encoder_t_ns=_stamps(len(states), vehicle.rate_hz, vehicle.substeps),
        rim_rad=states[:, 5:],
        slip=disturbed[:, :3],
        delta=delta,
        theta=vehicle.theta,
        motion=_with_tail(states, references, slips, vehicle),
    )


def _with_tail(
    states: Array,
    references: Array,
    slips: list[Disturbance],
    vehicle: Vehicle,
) -> DriveMotion:
    """The motion of the drive through states (P + 1, 7), continued with its last references and slip."""
    last_slip = slips[-1]
    last_reference = tuple(references[-1].tolist())
    tail_periods = ceil(TAIL_S * vehicle.rate_hz)
    periods = [states]
    for _ in range(tail_periods):
        periods.append(vehicle.advance(periods[-1][-1], last_reference, last_slip))
    states = np.concatenate(periods)
    held = np.concatenate([references, np.repeat(references[-1:], tail_periods - 1, 0)])
    all_slips = np.array([*slips, *[last_slip] * tail_periods])
    disturbances = all_slips[:, [2, 5, 6]]  # beta, delta_u and delta_omega at the ends of periods

    # Each sub-step is a piece: its period, and its place in the period.
    pieces = np.arange(len(states) - 1)
    period, step = np.divmod(pieces, vehicle.substeps)
    began = states[period * vehicle.substeps, 3:5]
    change = disturbances[period + 1] - disturbances[period]

    def values(boundary_states: Array, share: Array) -> Array:
        """The boundary values of all pieces at shares (P,) of their periods."""
        return _boundary_values(
            boundary_states,
            held[period],
            began,
            disturbances[period] + share[:, None] * change,
            change[:, 0],
            vehicle=vehicle,
            skid_s=last_slip.skid_s,
        )

    begin = values(states[:-1], step / vehicle.substeps)
    end = values(states[1:], (step + 1) / vehicle.substeps)
    step_s = 1 / vehicle.rate_hz / vehicle.substeps
    duration_ns = (len(references) - 1) * 1e9 / vehicle.rate_hz
    return DriveMotion(
        start_ns=0,
        end_ns=round(duration_ns),
        rate_hz=vehicle.rate_hz,
        substeps=vehicle.substeps,
        pieces=_quintics(begin, end, step_s=step_s),
    )


def _stamps(count: int, rate_hz: float, substeps: int) -> Stamps:
    """Stamps index / (rate substeps), divided in the order that makes every `substeps`-th exactly a frame's."""
    t_ns = np.arange(count) * 1e9 / substeps / rate_hz
    return np.rint(t_ns).astype(np.int64)


def _checked_rows(rows: ArrayLike, what: str) -> Array:
    """Rows (K, 2), one or more. Raises MotionError for other shapes, and for values that are not finite."""
    pairs = np.asarray(rows, float)
    has_pairs = pairs.ndim == 2 and pairs.shape[1] == 2
    if not has_pairs or not len(pairs):
        raise MotionError(f"a drive needs one or more {what}s of two coordinates (K, 2), got shape {pairs.shape}")
    bad = np.flatnonzero(~np.isfinite(pairs).all(1))
    if bad.size:
        x, y = pairs[bad[0]]
        raise MotionError(f"{what} {bad[0] + 1} is ({x}, {y}); both coordinates must be finite")
    return pairs


def _check_path(
    path_m: Array,
    path_mps: Array,
    controller: ControllerSettings,
    rate_hz: float,
) -> None:
    """Raise MotionError for a path without a velocity at every point, or faster than the controller allows."""
    if path_m.shape != path_mps.shape:
        raise MotionError(
            f"a path needs a velocity for every point, got {len(path_m)} points and {len(path_mps)} velocities"
        )
    speed_mps = np.hypot(*path_mps.T)
    if speed_mps.max() > controller.max_speed_mps:
        fastest_s = speed_mps.argmax() / rate_hz
        raise MotionError(
            f"the path of h moves at {speed_mps.max():.3g} m/s after {fastest_s:.1f} s, "
            f"but the controller allows {controller.max_speed_mps:g} m/s"
        )


def _check_references(references: Array, controller: ControllerSettings, rate_hz: float) -> None:
    """Raise MotionError for references (N, 2) above the limits of the controller."""
    u, omega = np.abs(references).T
    _check_limit(u, controller.max_speed_mps, "m/s", rate_hz)
    _check_limit(omega, controller.max_turn_radps, "rad/s", rate_hz)


def _check_limit(
    sizes: Array,
    limit: float,
    unit: str,
    rate_hz: float,
) -> None:
    """Raise MotionError if the largest of sizes (N,), one a frame, exceeds a limit."""
    if sizes.max() > limit:
        largest_s = sizes.argmax() / rate_hz
        raise MotionError(
            f"the reference after {largest_s:.1f} s is {sizes.max():.3g} {unit}, "
            f"but the controller allows {limit:g} {unit}"
        )
