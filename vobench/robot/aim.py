"""What a robot is asked for, frame by frame: to lead h through targets or along a path, or speeds set beforehand."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.robot.vehicle import Vehicle


class Errand(Protocol):
    """What the robot is to do; `ends` is always the frames at which legs have ended so far."""

    @property
    def longest(self) -> int:
        """Frames in the longest drive possible."""

    def ended(self, state: Array, frame: int, ends: list[int]) -> list[int]:
        """This frame, once for each leg that ends in it."""

    def asked(self, vehicle: Vehicle, state: Array, frame: int, ends: list[int]) -> tuple[float, float]:
        """u_ref in m/s and omega_ref in rad/s, to be held until the next frame."""

    def finished(self, frame: int, ends: list[int]) -> bool:
        """Whether the drive is over with this frame."""

    def check_patience(self, place_m: list[Array], ends: list[int]) -> None:
        """Raise MotionError where the places (2,) of h so far, one a frame, show a leg that takes too long."""


@dataclass(frozen=True, slots=True)
class ThroughTargets:
    """Targets (K, 2) in order, each until h is within the tolerance on both axes; then `settle` frames more."""

    targets_m: Array
    tolerance_m: float
    patience: int
    settle: int

    @property
    def longest(self) -> int:
        """Frames in the longest drive possible."""
        return len(self.targets_m) * self.patience + self.settle + 1

    def ended(self, state: Array, frame: int, ends: list[int]) -> list[int]:
        """This frame, once for each target in turn that h is inside of."""
        inside = (np.abs(self.targets_m[len(ends) :] - state[:2]) < self.tolerance_m).all(1)
        return [frame] * int(np.logical_and.accumulate(inside).sum())

    def asked(self, vehicle: Vehicle, state: Array, frame: int, ends: list[int]) -> tuple[float, float]:  # noqa: ARG002
        """Towards the next target, the last one for ever."""
        return vehicle.references(state, self.targets_m[min(len(ends), len(self.targets_m) - 1)])

    def finished(self, frame: int, ends: list[int]) -> bool:
        """Whether the last target was entered long enough ago."""
        return len(ends) == len(self.targets_m) and frame >= ends[-1] + self.settle

    def check_patience(self, place_m: list[Array], ends: list[int]) -> None:
        """Raise MotionError where this leg's target has not been entered in time."""
        frame, leg_start = len(place_m) - 1, ends[-1] if ends else 0
        if len(ends) == len(self.targets_m) or frame - leg_start < self.patience:
            return
        target_m = self.targets_m[len(ends)]
        away_m = np.abs(np.array(place_m[leg_start:]) - target_m)
        raise MotionError(
            f"target {len(ends) + 1} at ({target_m[0]:g}, {target_m[1]:g}) m was not entered in max_time_s "
            f"({self.patience} frames): {_end_of_leg(np.hypot(*away_m.T))}; "
            f"allow more time, a wider tolerance_m or another controller"
        )


def _end_of_leg(away_m: Array) -> str:
    """How a leg that was too long ended, from h's distance to its target at every frame."""
    third, last = away_m[len(away_m) // 2 : -(len(away_m) // 4)], away_m[-(len(away_m) // 4) - 1 :]
    comes_and_goes = {-1.0, 1.0} <= set(np.sign(np.diff(last)).tolist())
    if comes_and_goes and last.min() > 0.98 * third.min() and np.ptp(last) > 0.02 * last.max():
        return f"the robot keeps circling it, between {last.min():.3g} and {last.max():.3g} m away, and comes no nearer"
    return f"the robot is {away_m[-1]:.3g} m away"


@dataclass(frozen=True, slots=True)
class ByTheClock:
    """Targets (K, 2) in order, each for its time whatever happens; `leg_ends` (K,) are the frames of the changes."""

    targets_m: Array
    leg_ends: tuple[int, ...]
    settle: int

    @classmethod
    def every(cls, frames: float, targets_m: Array, settle: int) -> "ByTheClock":
        """Each leg as long as the others, in frames, whole or not. Raises MotionError below one frame."""
        if frames < 1:
            raise MotionError(f"leg_s must last one frame or more, got {frames:.3g} frames")
        return cls(targets_m, tuple(round((i + 1) * frames) for i in range(len(targets_m))), settle)

    @property
    def longest(self) -> int:
        """Frames in the drive."""
        return self.leg_ends[-1] + self.settle + 1

    def ended(self, state: Array, frame: int, ends: list[int]) -> list[int]:  # noqa: ARG002
        """This frame where a leg's time is over."""
        return [frame] * self.leg_ends[len(ends) :].count(frame)

    def asked(self, vehicle: Vehicle, state: Array, frame: int, ends: list[int]) -> tuple[float, float]:  # noqa: ARG002
        """Towards the target of this leg, the last one for ever."""
        return vehicle.references(state, self.targets_m[min(len(ends), len(self.targets_m) - 1)])

    def finished(self, frame: int, ends: list[int]) -> bool:  # noqa: ARG002
        """Whether the last leg's time was over long enough ago."""
        return frame >= self.leg_ends[-1] + self.settle

    def check_patience(self, place_m: list[Array], ends: list[int]) -> None:
        """The clock is always on time."""


@dataclass(frozen=True, slots=True)
class AlongPath:
    """A target that moves: where it is (N, 2) and how fast it goes (N, 2), one row a frame."""

    path_m: Array
    path_mps: Array

    @property
    def longest(self) -> int:
        """Frames in the drive."""
        return len(self.path_m)

    def ended(self, state: Array, frame: int, ends: list[int]) -> list[int]:  # noqa: ARG002
        """A path has no legs."""
        return []

    def asked(self, vehicle: Vehicle, state: Array, frame: int, ends: list[int]) -> tuple[float, float]:  # noqa: ARG002
        """After the target where it is now, and as it moves."""
        v_x, v_y = self.path_mps[frame].tolist()
        return vehicle.references(state, self.path_m[frame], (v_x, v_y))

    def finished(self, frame: int, ends: list[int]) -> bool:  # noqa: ARG002
        """Whether this is the path's last row."""
        return frame == len(self.path_m) - 1

    def check_patience(self, place_m: list[Array], ends: list[int]) -> None:
        """A path takes its time."""


@dataclass(frozen=True, slots=True)
class AsTold:
    """References (N, 2) that were set beforehand, one row a frame, whatever comes of them."""

    references: Array

    @property
    def longest(self) -> int:
        """Frames in the drive."""
        return len(self.references)

    def ended(self, state: Array, frame: int, ends: list[int]) -> list[int]:  # noqa: ARG002
        """There are no legs."""
        return []

    def asked(self, vehicle: Vehicle, state: Array, frame: int, ends: list[int]) -> tuple[float, float]:  # noqa: ARG002
        """This frame's row; where the robot is does not matter."""
        u_ref, omega_ref = self.references[frame].tolist()
        return u_ref, omega_ref

    def finished(self, frame: int, ends: list[int]) -> bool:  # noqa: ARG002
        """Whether this is the last row."""
        return frame == len(self.references) - 1

    def check_patience(self, place_m: list[Array], ends: list[int]) -> None:
        """Nothing is waited for."""
