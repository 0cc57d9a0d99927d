"""Sequences from Python: simulate a case, render a picture, and open a recorded sequence."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from vobench.errors import InputError, UnknownNameError, unknown_name_sentence
from vobench.notebook.display import choose_display
from vobench.notebook.runs import plan
from vobench.notebook.trajectories import read_trajectory
from vobench.runner.launch import perform_tasks
from vobench.runner.task import sequence_tasks
from vobench.suite.case import Case
from vobench.suite.source import RecordedCase

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vobench.dataset.recording import Recording
    from vobench.sequence import Sequence
    from vobench.trajectory.trajectory import Trajectory


class RenderOptions(TypedDict, total=False):
    """The options of `render`: pose, time and model of the camera, and the engine that draws the picture."""

    camera: str
    at_m: tuple[float, float, float]
    yaw_deg: float
    pitch_deg: float
    time_s: float
    sensor: str
    gain: float
    engine: str
    samples: int | None


@dataclass(frozen=True, slots=True)
class Simulation:
    """A simulated or imported case: its folder, what an estimator may see, and the ground truth."""

    case: Case | RecordedCase
    path: Path

    @property
    def sequence(self) -> "Sequence":
        """The pictures and readings that an estimator may see."""
        return read_sequence(self.path)

    @property
    def ground_truth(self) -> "Trajectory":
        """The true path of the left camera."""
        return read_trajectory(self.path)

    def __repr__(self) -> str:
        return f"Simulation({self.case.name}, {self.path})"


def simulate(
    case: Case | RecordedCase | str,
    *,
    name: str | None = None,
    changes: Mapping[str, Any] | None = None,
    quiet: bool = False,
) -> Simulation:
    """Simulate one case, or import it if it is a recording; a case that is in the cache is reused.

    `case` is a case of a plan, as `check(suite).plan.cases` has them, or the name or path of a suite, of which `name`
    is the case: the first one without it. `changes` are those of `run`. Raises SuiteError and UnknownNameError.
    """
    if isinstance(case, str):
        planned = plan(case, changes=changes)
        chosen = _case_of(planned.cases, name)
    elif name or changes:
        raise InputError("name and changes apply to a suite; a case of a plan already has both")
    else:
        chosen = case
    recordings: dict[str, Recording] = {}
    if isinstance(chosen, RecordedCase):
        from vobench.runner.import_recording import read_case

        recordings = {chosen.name: read_case(chosen)}
    tasks = sequence_tasks(chosen, recordings)
    folder = perform_tasks(tasks, display=choose_display(is_quiet=quiet))
    return Simulation(chosen, folder)


def render(scene: str, **options: Unpack[RenderOptions]) -> "NDArray[np.uint8]":
    """A picture (H, W, 3) uint8 of a scene in red, green and blue, as `vobench render` draws it.

    `options` are the keywords of `RenderOptions`: camera, at_m, yaw_deg, pitch_deg, time_s, sensor, gain, engine,
    samples. Raises UnknownNameError, InputError and MissingDependencyError.
    """
    from vobench.runner.scene_picture import render_scene

    return render_scene(scene, **options).rgb


def read_sequence(folder: Path | str) -> "Sequence":
    """The pictures and readings of a sequence, which are read on access. Raises SequenceError."""
    from vobench.sequence import Sequence

    return Sequence.open(Path(folder))


def _case_of(cases: Collection[Case | RecordedCase], name: str | None) -> Case | RecordedCase:
    by_name = {case.name: case for case in cases}
    chosen = next(iter(by_name)) if name is None else name
    if chosen not in by_name:
        raise UnknownNameError(unknown_name_sentence("case", chosen, list(by_name)))
    return by_name[chosen]
