"""All that chance and the floor do to a drive: slip, the pushes delta of (18), and patches that the wheels cross.

Every random process has a stream of its own, so switching one off leaves the others' draws as they were.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.robot import slip as slips
from vobench.robot.floor import FloorPatch, under
from vobench.robot.slip import Generators, SlipNow, SlipSettings, generator_of, ornstein_uhlenbeck, slip_path

# The random streams of a drive: slip's three, delta's two, and the one that perturbs theta.
DELTA_STREAMS = ("delta_u", "delta_omega")
STREAMS = (*slips.STREAMS, *DELTA_STREAMS, "theta")

# Beyond this a slip ratio or an angle (rad) is cut: nearer 1 and pi/2 the formulas lose their meaning.
MOST_SLIP = 0.5

Contacts = Sequence[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class DeltaSettings:
    """The pushes delta_u (m/s^2) and delta_omega (rad/s^2) of (18) as Ornstein-Uhlenbeck processes.

    Standard deviations, and the time over which both forget. Raises MotionError where one is out of range.
    """

    speed_std_mps2: float = 0.0
    turn_std_radps2: float = 0.0
    correlation_s: float = 0.5

    def __post_init__(self) -> None:
        if not (0 <= self.speed_std_mps2 <= 10 and 0 <= self.turn_std_radps2 <= 50 and self.correlation_s > 0):
            raise MotionError(
                f"delta needs speed_std_mps2 in 0..10, turn_std_radps2 in 0..50 and correlation_s > 0, "
                f"got {self.speed_std_mps2}, {self.turn_std_radps2} and {self.correlation_s}"
            )


# Engineering choices: an even floor, and one whose bumps shove the robot as it goes.
DELTAS = {"none": DeltaSettings(), "nominal": DeltaSettings(0.05, 0.1), "bumpy": DeltaSettings(0.2, 0.5, 0.15)}


def delta_path(count: int, settings: DeltaSettings, *, step_s: float, rngs: Generators | None) -> Array:
    """delta_u in m/s^2 and delta_omega in rad/s^2 at every frame, (count, 2). Raises as `generator_of`."""
    path = np.zeros((count, 2))
    for column, std in enumerate((settings.speed_std_mps2, settings.turn_std_radps2)):
        if std > 0:
            rng = generator_of(rngs, DELTA_STREAMS[column])
            path[:, column] = ornstein_uhlenbeck(
                count, std=std, step_s=step_s, correlation_s=settings.correlation_s, rng=rng
            )
    return path


@dataclass(frozen=True, slots=True)
class Disturbances:
    """What disturbs a drive at its frames: rows (N, 5) of both sigmas, beta (rad) and both deltas as drawn.

    The floor changes the first three where the wheels are; between frames all run on straight lines,
    so that no velocity jumps. At the edge of a patch they take one frame to change.
    """

    rows: Array
    skid_s: float
    traction_s2pm: float
    floor: tuple[FloorPatch, ...]

    def at(self, frame: int, contacts_m: Contacts) -> SlipNow:
        """What disturbs at a frame with the left wheel, the right wheel and the axle's middle at these places."""
        left, right, beta, delta_u, delta_omega = self.rows[frame].tolist()
        if self.floor:
            on_left, on_right, on_middle = (under(self.floor, *place) for place in contacts_m)
            left, right = left * on_left[0] + on_left[1], right * on_right[0] + on_right[1]
            beta = beta * on_middle[0] + on_middle[2]
        return SlipNow(_cut(left), _cut(right), _cut(beta), self.skid_s, self.traction_s2pm, delta_u, delta_omega)


def drawn(
    count: int,
    slip: SlipSettings,
    delta: DeltaSettings,
    floor: Sequence[FloorPatch],
    *,
    step_s: float,
    rngs: Generators | None,
) -> Disturbances:
    """The disturbances of `count` frames. Raises MotionError where they ask for chance and a stream is missing."""
    slip_rows = slip_path(count, slip, step_s=step_s, rngs=rngs)
    delta_rows = delta_path(count, delta, step_s=step_s, rngs=rngs)
    return Disturbances(np.column_stack([slip_rows, delta_rows]), slip.skid_s, slip.traction_s2pm, tuple(floor))


def _cut(value: float) -> float:
    return max(-MOST_SLIP, min(MOST_SLIP, value))
