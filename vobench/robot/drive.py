"""A drive through waypoints: controller, dynamics and slip together, and the exact truth of where the robot was."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.errors import MotionError
from vobench.geometry.rig import PIONEER_WHEELS, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.robot.controller import CONTROLLERS, ControllerSettings
from vobench.robot.pioneer import THETAS, Theta, axle_poses
from vobench.robot.slip import SLIPS, SlipNow, SlipSettings, slip_path
from vobench.robot.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class Drive:
    """What the robot did, at N frames and M = (N - 1) substeps + 1 encoder instants.

    state (N, 5): x, y of the point h in m, psi in rad, u in m/s, omega in rad/s. references (N, 2) hold
    from their frame on. T_world_body and twist (vx, vy, vz, wx, wy, wz in body axes) are of the axle midpoint B,
    sliding included; axle (M, 3) is its x, y and heading. reached: the frame that entered each target.
    rim_rad (M, 2): left, right.
    """

    t_ns: NDArray[np.int64]
    state: Array
    references: Array
    T_world_body: Array
    twist: Array
    reached: tuple[int, ...]
    encoder_t_ns: NDArray[np.int64]
    axle: Array
    rim_rad: Array

    @property
    def steps_per_leg(self) -> tuple[int, ...]:
        """Control periods spent on each target."""
        return tuple(np.diff(self.reached, prepend=0).tolist())


def drive(
    targets_m: ArrayLike,
    *,
    theta: Theta = THETAS["pioneer_3dx"],
    controller: ControllerSettings = CONTROLLERS["smooth"],
    slip: SlipSettings = SLIPS["none"],
    wheels: WheelGeometry = PIONEER_WHEELS,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rate_hz: float = 30.0,
    substeps: int = 4,
    integrator: str = "rk4",
    tolerance_m: float = 0.01,
    settle_s: float = 0.0,
    max_time_s: float = 60.0,
    rngs: Mapping[str, np.random.Generator] | None = None,
) -> Drive:
    """Drive h from rest at `start` (x, y, psi) through targets (K, 2) in order, its speed carried over between them.

    A target is reached in the first frame with h within `tolerance_m` on both axes; the drive ends
    `settle_s` after the last. `max_time_s` is for each target; `rngs` holds the generators of slip.STREAMS.
    Raises MotionError for values that are not finite, a loop that cannot settle, a target not reached in time.
    """
    targets = _checked_targets(targets_m, start)
    _check_clock(rate_hz, substeps, tolerance_m=tolerance_m, settle_s=settle_s, max_time_s=max_time_s)
    vehicle = Vehicle(theta, controller, wheels, rate_hz, substeps, integrator)
    course = _Course(targets, tolerance_m, ceil(max_time_s * rate_hz), ceil(settle_s * rate_hz))
    slips = slip_path(course.longest, slip, step_s=1 / rate_hz, rngs=rngs)

    state = np.array([*start, 0.0, 0.0, 0.0, 0.0])
    fine, asked, reached = [state[None]], [], list[int]()
    for frame in range(course.longest):
        reached += course.entered(state, frame, reached)
        asked.append(vehicle.references(state, course.target(reached)))
        if course.finished(frame, reached):
            break
        course.check_patience(state, frame, reached)
        left, right, beta = slips[frame].tolist()
        fine.append(vehicle.advance(state, asked[-1], SlipNow(left, right, beta, slip.skid_s)))
        state = fine[-1][-1]
    side = slips[: len(asked), 2]
    return _record(np.concatenate(fine), np.array(asked), tuple(reached), side, vehicle=vehicle, skid_s=slip.skid_s)


@dataclass(frozen=True, slots=True)
class _Course:
    """Which target is next, and when to stop; `reached` is always the frames of the targets already entered."""

    targets_m: Array
    tolerance_m: float
    patience: int
    settle: int

    @property
    def longest(self) -> int:
        """Frames in the longest drive possible."""
        return len(self.targets_m) * self.patience + self.settle + 1

    def target(self, reached: list[int]) -> Array:
        """The target (2,) to drive to: the last one for ever."""
        target: Array = self.targets_m[min(len(reached), len(self.targets_m) - 1)]
        return target

    def entered(self, state: Array, frame: int, reached: list[int]) -> list[int]:
        """This frame, once for each target in turn that h is inside of."""
        inside = (np.abs(self.targets_m[len(reached) :] - state[:2]) < self.tolerance_m).all(1)
        return [frame] * int(np.logical_and.accumulate(inside).sum())

    def finished(self, frame: int, reached: list[int]) -> bool:
        return len(reached) == len(self.targets_m) and frame >= reached[-1] + self.settle

    def check_patience(self, state: Array, frame: int, reached: list[int]) -> None:
        leg_start = reached[-1] if reached else 0
        if len(reached) == len(self.targets_m) or frame - leg_start < self.patience:
            return
        x, y = self.target(reached)
        away = float(np.hypot(x - state[0], y - state[1]))
        raise MotionError(
            f"target {len(reached) + 1} at ({x:g}, {y:g}) m was not entered in max_time_s ({self.patience} frames): "
            f"the robot is {away:.3g} m away; allow more time, a wider tolerance_m or another controller"
        )


def _record(
    fine: Array, asked: Array, reached: tuple[int, ...], beta_rad: Array, *, vehicle: Vehicle, skid_s: float
) -> Drive:
    """The drive from its fine states (M, 7), references (N, 2) and side-slip angles (N,)."""
    state = fine[:: vehicle.substeps, :5]
    u, omega = state[:, 3:].T
    T_world_body = axle_poses(*fine[:, :3].T, a_m=vehicle.controller.a_m)
    side, still = u * np.tan(beta_rad) - skid_s * u * omega, np.zeros_like(u)
    return Drive(
        t_ns=_stamps(len(state), vehicle.rate_hz, 1),
        state=state,
        references=asked,
        T_world_body=T_world_body[:: vehicle.substeps],
        twist=np.stack([u, side, still, still, still, omega], -1),
        reached=reached,
        encoder_t_ns=_stamps(len(fine), vehicle.rate_hz, vehicle.substeps),
        axle=np.column_stack([T_world_body[:, :2, 3], fine[:, 2]]),
        rim_rad=fine[:, 5:],
    )


def _stamps(count: int, rate_hz: float, substeps: int) -> NDArray[np.int64]:
    """Stamps index / (rate substeps), divided in the order that lets every `substeps`-th be exactly a frame's."""
    return np.rint(np.arange(count) * 1e9 / substeps / rate_hz).astype(np.int64)


def _checked_targets(targets_m: ArrayLike, start: tuple[float, float, float]) -> Array:
    targets = np.asarray(targets_m, float)
    if targets.ndim != 2 or targets.shape[1] != 2 or not len(targets):
        raise MotionError(f"a drive needs one or more targets of two coordinates (K, 2), got shape {targets.shape}")
    if not np.isfinite(targets).all():
        bad = int(np.flatnonzero(~np.isfinite(targets).all(1))[0])
        raise MotionError(
            f"target {bad + 1} is ({targets[bad, 0]}, {targets[bad, 1]}); both coordinates must be finite"
        )
    if not np.isfinite(start).all():
        raise MotionError(f"the start (x, y, psi) must be finite, got {start}")
    return targets


def _check_clock(rate_hz: float, substeps: int, **durations: float) -> None:
    if not (rate_hz > 0 and isfinite(rate_hz)) or substeps < 1:
        raise MotionError(f"a drive needs a positive rate_hz and 1 or more substeps, got {rate_hz} and {substeps}")
    for name, value in durations.items():
        if not (value >= 0 and isfinite(value)) or (value == 0 and name != "settle_s"):
            raise MotionError(f"{name} must be finite and positive, got {value}")
